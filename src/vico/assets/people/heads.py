"""Heads: where the surface of a skull is, hair and eyebrows and glasses of any head, and the heads of our own people.

Hair is a shell from the hairline to the crown, a knot, a ponytail. Glasses stand before the cheeks. Our own people's
heads are made of skull, features and beard, by a profile in shares of the head's height.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from vico.assets.people.clothing import COVERED, PRESSED, hat_parts
from vico.assets.people.lofts import BodyPart, LoftRing, blend, blob, dense, loft, with_normals
from vico.assets.people.model import Appearance, Colour, J
from vico.io.compiled import compiled

_TURNS = np.linspace(0.0, 1.45, 30)


class Skull(Protocol):
    """Where the surface of a head is; `chin` is its height, `size` reaches to the crown, `axis` is its middle's x."""

    size: float
    chin: float
    axis: float

    def at(self, share: float, angle: float, lift: float = 0.0) -> NDArray[np.float64]:
        """Return a point at a height and an angle from straight ahead (to the left), lifted off the skin by a share."""


def face_depth(skull: Skull, share: float, aside: float) -> float:
    """Return how far ahead the face is at a height, at so many metres to either side."""
    line = np.array([skull.at(share, turn) for turn in _TURNS])
    return float(np.interp(abs(aside), np.maximum.accumulate(line[:, 1]), line[:, 0]))


class ScannedSkull:
    """The surface of a head, found by rays from its axis."""

    def __init__(self, head: BodyPart, eye: float) -> None:
        crown = float(head.vertices[:, 2].max())
        # Eyes are at 0.525 of the head's height, as on our own heads.
        self.size = (crown - eye) / 0.475
        self.chin = crown - self.size
        above = head.vertices[head.vertices[:, 2] > eye]
        self.axis = float(above[:, 0].min() + above[:, 0].max()) / 2
        self.shares, self.angles = np.linspace(0.12, 0.985, 44), np.linspace(-np.pi, np.pi, 73)
        heights = self.chin + self.shares * self.size
        self.radii = _leaving(head.vertices, head.triangles, self.axis, heights, self.angles)
        # Ears would make bumps in the hair: no radius beside them above that of the head over them.
        over = int(np.searchsorted(self.shares, 0.66))
        aside = (np.abs(self.angles) > 1.15) & (np.abs(self.angles) < 2.3)
        self.radii[:over, aside] = np.minimum(self.radii[:over, aside], self.radii[over, aside])

    def at(self, share: float, angle: float, lift: float = 0.0) -> NDArray[np.float64]:
        """Return a point at a height and an angle from straight ahead (to the left), lifted off the skin by a share."""
        turned = (angle + np.pi) % (2 * np.pi) - np.pi
        row = (share - self.shares[0]) / (self.shares[1] - self.shares[0])
        column = (turned + np.pi) / (self.angles[1] - self.angles[0])
        row, column = min(max(row, 0.0), len(self.shares) - 1.001), min(max(column, 0.0), len(self.angles) - 1.001)
        k, i = int(row), int(column)
        u, v = row - k, column - i
        radius = (self.radii[k, i] * (1 - v) + self.radii[k, i + 1] * v) * (1 - u)
        radius += (self.radii[k + 1, i] * (1 - v) + self.radii[k + 1, i + 1] * v) * u
        if share > self.shares[-1]:
            radius *= (1 - share) / (1 - self.shares[-1])
        up = min(max((share - 0.60) / 0.40, 0.0), 1.0)
        out = radius + lift * self.size * math.sqrt(1 - up * up)
        height = self.chin + (share + lift * up) * self.size
        return np.array([self.axis + out * math.cos(angle), out * math.sin(angle), height])


@compiled
def _leaving(
    points: NDArray[Any], triangles: NDArray[Any], axis: float, heights: NDArray[Any], angles: NDArray[Any]
) -> NDArray[Any]:
    """How far from the axis the surface is left for good, by level and angle (Moeller and Trumbore's ray test)."""
    radii = np.zeros((len(heights), len(angles)))
    for k in range(len(heights)):
        for i in range(len(angles)):
            wx, wy = np.cos(angles[i]), np.sin(angles[i])
            for f in range(len(triangles)):
                a, b, c = points[triangles[f, 0]], points[triangles[f, 1]], points[triangles[f, 2]]
                if min(a[2], b[2], c[2]) > heights[k] or max(a[2], b[2], c[2]) < heights[k]:
                    continue
                e1x, e1y, e1z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
                e2x, e2y, e2z = c[0] - a[0], c[1] - a[1], c[2] - a[2]
                px, py, pz = wy * e2z, -wx * e2z, wx * e2y - wy * e2x
                det = e1x * px + e1y * py + e1z * pz
                if abs(det) < 1e-12:
                    continue
                tx, ty, tz = axis - a[0], -a[1], heights[k] - a[2]
                u = (tx * px + ty * py + tz * pz) / det
                qx, qy, qz = ty * e1z - tz * e1y, tz * e1x - tx * e1z, tx * e1y - ty * e1x
                v = (wx * qx + wy * qy) / det
                if u > -1e-6 and v > -1e-6 and u + v < 1 + 1e-6:
                    radii[k, i] = max(radii[k, i], (e2x * qx + e2y * qy + e2z * qz) / det)
        # A ray may slip through an eye: take the level's middle radius there.
        seen = np.median(radii[k])
        for i in range(len(angles)):
            if radii[k, i] <= 0:
                radii[k, i] = seen
    return radii


# An eyebrow's way: angle, height, half its width, shares of the head's height.
_BROW = np.array(
    [
        [0.120, 0.592, 0.008],
        [0.170, 0.596, 0.015],
        [0.260, 0.602, 0.015],
        [0.360, 0.608, 0.012],
        [0.460, 0.606, 0.008],
        [0.540, 0.598, 0.003],
    ]
)
# How far an eyebrow's middle stands off the skin, and how deep its rims lie in it, shares of the head's height.
_OFF, _IN = 0.007, 0.006
# Across a coarse eyebrow: share of its half width, how far it is off the skin, how pale.
_COARSE = ((-1.2, 0.0, 0.2), (0.0, 0.024, 0.1), (1.2, 0.0, 0.2))
# A lens.
_ASIDE = 0.145  # of the nose: its middle
_LEVEL = 0.520  # its height on the head
_HALF_WIDTH = 0.098
_HALF_HEIGHT = 0.074
# Frames.
_THICK = 0.0055  # half their thickness
_CLEAR = 0.014  # off the skin
_CURVE = 0.22  # around the face
_FRAME: Colour = (30, 28, 30)


def eyebrows(look: Appearance, skull: Skull, *, fine: bool) -> list[BodyPart]:
    """Make both eyebrows: shells that rise from the skin, in the hair's colour, paler to their rims."""
    stations = np.linspace(_BROW[0, 0], _BROW[-1, 0], 15 if fine else 5)
    heights, halves = (np.interp(stations, _BROW[:, 0], _BROW[:, k]) for k in (1, 2))
    hair, skin = 0.72 * np.asarray(look.hair_colour, np.float64), np.asarray(look.skin, np.float64)
    across = (
        (-1.0, -_IN, 0.85),
        (-0.55, 0.6 * _OFF, 0.35),
        (0.0, _OFF, 0.2),
        (0.55, 0.6 * _OFF, 0.3),
        (1.0, -_IN, 0.8),
    )
    rows = across if fine else _COARSE
    parts = []
    for left in (1.0, -1.0):
        points, colours = [], []
        for k, (angle, height, half) in enumerate(zip(stations, heights, halves, strict=True)):
            # The ends lie in the skin.
            end = k in (0, len(stations) - 1)
            for c, (offset, lift, pale) in enumerate(rows):
                points.append(skull.at(height + offset * half, left * angle, -_IN if end and fine else lift))
                share = 0.7 if end and fine else pale
                strand = 1.0 + 0.10 * np.sin(12.9898 * (k * len(rows) + c)) if fine else 1.0
                colours.append(((1 - share) * hair + share * skin) * strand)
        wide, faces = len(rows), []
        for k in range(len(stations) - 1):
            for c in range(wide - 1):
                a = k * wide + c
                quad = (a, a + wide, a + wide + 1, a + 1)
                quad = quad if left > 0 else quad[::-1]
                faces += [(quad[0], quad[1], quad[2]), (quad[0], quad[2], quad[3])]
        weights = np.tile(dense({J["head"]: 1.0}), (len(points), 1))
        parts.append(with_normals(BodyPart(np.array(points), np.array(faces), np.array(colours), weights)))
    return parts


def glasses(skull: Skull, *, fine: bool) -> list[BodyPart]:
    """Make frames that stand off the face all around, with temples that reach to the ears."""
    size, parts, sides = skull.size, [], 6 if fine else 4
    turns = np.linspace(0, 2 * np.pi, 29 if fine else 11)
    # Superellipses: rounder than a rectangle, squarer than a circle.
    c, s = np.cos(turns), np.sin(turns)
    aside = _ASIDE + _HALF_WIDTH * np.sign(c) * np.abs(c) ** 0.75
    level = _LEVEL + _HALF_HEIGHT * np.sign(s) * np.abs(s) ** 0.75
    depth = np.array([face_depth(skull, z, y * size) for y, z in zip(aside, level, strict=True)])
    # Noses pass between the lenses: they hold no frame off.
    held = aside > 0.4 * _ASIDE
    ahead = float((depth + _CURVE * (aside - _ASIDE) * size)[held].max()) + _CLEAR * size
    rim = np.column_stack([ahead - _CURVE * (aside - _ASIDE) * size, aside * size, skull.chin + level * size])
    outer = rim[np.argmax(rim[:, 1])] + np.array([0.0, 0.0, 0.03 * size])
    inner = rim[np.argmin(rim[:, 1])] + np.array([0.0, 0.0, 0.02 * size])
    arch = np.array([inner[0] + 0.012 * size, 0.0, inner[2] + 0.012 * size])
    for left in (1.0, -1.0):
        mirror = np.array([1.0, left, 1.0])
        parts.append(_wire(list(rim * mirror), size, (1.0, 0.0, 0.0), sides))
        ways = [outer * mirror, skull.at(0.548, left * 1.2, 0.022), skull.at(0.555, left * 1.7, 0.022)]
        parts.append(_wire(ways, size, (0.0, 0.0, 1.0), sides))
    mirrored = inner * np.array([1.0, -1.0, 1.0])
    parts.append(_wire([inner, arch, mirrored], size, (0.0, 0.0, 1.0), sides))
    return parts


def _wire(path: list[NDArray[np.float64]], size: float, forward: tuple[float, float, float], sides: int) -> BodyPart:
    thick = _THICK * size
    return loft(
        [LoftRing(p, thick, thick, thick, {J["head"]: 1.0}, _FRAME) for p in path], sides=sides, forward=forward
    )


_COLUMNS = 20  # of hair around the head
# Of bodies for close-ups.
_FINE_COLUMNS = 48
_FINE_ROWS = 1.7  # for each of a coarse shell
#: Above this share of the head's height nothing grows on bald heads.
BALD = 0.72
# A ponytail's way: height on the head, distance from it.
_TAIL = ((0.74, 0.0), (0.74, 0.14), (0.56, 0.20), (0.40, 0.16), (0.40, 0.18))
# Hair that falls does so from here on, a share of the head's height: below the cheekbone it leaves the skin.
_FALLS = 0.40
# Cut hair follows the neck down to here; hair that ends on the skin is tucked in so far.
_NAPE, _TUCKED = 0.14, 0.03


@dataclass(frozen=True)
class _Cut:
    """How hair is cut; lengths as shares of the head's height.

    Attributes
    ----------
    thickness
        How far it stands off the skin, by height on the head and angle from straight ahead.
    rows
        Of vertices, from the hairline to the crown, on coarse bodies.
    rough
        How uneven its surface is.
    falls
        Whether it falls past the neck instead of following it.
    ends
        How high on the head it reaches.
    """

    thickness: Callable[[float, float], float]
    rows: int = 8
    rough: float = 0.0
    falls: bool = False
    ends: float = 0.985


def _shell(look: Appearance, skull: Skull, hairline: Callable[[float], float], cut: _Cut, *, fine: bool) -> BodyPart:
    """Hair as a shell: columns from the hairline to the crown, lifted off the skull, tucked in at the rim."""
    angles = np.linspace(-np.pi, np.pi, _FINE_COLUMNS if fine else _COLUMNS, endpoint=False)
    columns, rows = len(angles), round(_FINE_ROWS * cut.rows) if fine else cut.rows
    lowest = _FALLS if cut.falls else _NAPE
    points, colours, shares = [], [], []
    for i, angle in enumerate(angles):
        line = hairline(abs(float(angle)))
        for k in range(rows):
            share = line + max(cut.ends - line, 0.0) * (max(k - 1, 0) / (rows - 2)) ** 0.8
            wave = cut.rough * np.sin(12.9898 * (i * rows + k) + 4.1)
            lift = _lift(look, cut, share, line, abs(float(angle))) + wave if k > 0 else 0.0
            if k == rows - 1 and cut.ends <= BALD:
                lift = -_TUCKED
            point = skull.at(max(share, lowest), float(angle), lift)
            if k == 0:
                point[:2] = 0.7 * point[:2] + np.array([0.3 * skull.axis, 0])
            point[2] += min(share - lowest, 0.0) * skull.size
            points.append(point)
            strand = 0.90 + 0.16 * (0.5 + 0.5 * np.sin(7.3 * i + 0.9 * k)) - 0.12 * (k == 0)
            colours.append(np.asarray(look.hair_colour) * strand)
            low = float(np.clip((0.02 - share) / 0.35, 0, 1)) * 0.75
            shares.append(dense(blend({J["head"]: 1.0}, {J["neck"]: 0.4, J["spine3"]: 0.6}, low)))
    faces = []
    for i in range(columns):
        j = (i + 1) % columns
        for k in range(rows - 1):
            a, b, c, d = i * rows + k, j * rows + k, j * rows + k + 1, i * rows + k + 1
            faces += [(a, b, c), (a, c, d)]
    if cut.ends > BALD:
        crown = skull.at(1.0, 0.0, min(cut.thickness(1.0, 0.0), PRESSED if look.hat != "none" else np.inf))
        crown[:2] = skull.axis, 0
        points.append(crown)
        colours.append(np.asarray(look.hair_colour) * 1.0)
        shares.append(dense({J["head"]: 1.0}))
        last = rows - 1
        faces += [(i * rows + last, (i + 1) % columns * rows + last, columns * rows) for i in range(columns)]
    return with_normals(BodyPart(np.array(points), np.array(faces), np.array(colours), np.array(shares)))


def _lift(look: Appearance, cut: _Cut, share: float, line: float, angle: float) -> float:
    """Return how far hair is off the skin."""
    # It rises from the skin at its rim instead of standing on it like a cap's brim.
    rooted = 0.35 + 0.65 * min((share - line) / 0.09, 1.0) if angle < 1.2 or not cut.falls else 1.0
    lift = cut.thickness(share, angle) * rooted
    return min(lift, PRESSED) if look.hat != "none" and share > COVERED else lift


def _line(front: float, temple: float, burn: float, ear: float, back: float) -> Callable[[float], float]:
    """Return a hairline by the angle from straight ahead: the forehead, before, over and behind the ear, the nape."""
    angles = (0.0, 0.45, 0.95, 1.10, 1.25, 1.38, 1.85, 2.05, 2.4, np.pi)
    behind = 0.5 * (min(burn, ear) + back)
    lines = (front, front, temple, burn, burn, ear, ear, behind, back, back)
    return lambda angle: float(np.interp(angle, angles, lines))


def hairline(look: Appearance) -> Callable[[float], float] | None:
    """Return where hair starts: a share of the head's height by the angle from straight ahead; None: no hair at all."""
    recede = 0.05 * look.gender * float(np.clip((look.age - 30) / 40, 0, 1))
    front, temple = 0.775 + recede, 0.66 + recede
    if look.hair == "bald":
        return _line(0.97, 0.93, 0.56, 0.62, 0.34) if look.age >= 30 else None
    lines = {
        "crop": (front, temple, 0.52, 0.61, 0.32),
        "short": (front - 0.03, temple, 0.47, 0.60, 0.28),
        "curly": (front - 0.02, temple - 0.02, 0.44, 0.52, 0.24),
        "bob": (front, 0.44, 0.02, 0.02, -0.02),
        "long": (front, 0.48, -0.42, -0.42, -0.52),
    }
    return _line(*lines.get(look.hair, (front, temple - 0.02, 0.565, 0.60, 0.32)))


def _top(share: float, low: float) -> float:
    return float(np.clip((share - low) / 0.3, 0, 1))


def _over_ears(angle: float) -> float:
    return max(1 - abs(angle - 1.65) / 0.6, 0.0)


_CUTS: dict[str, _Cut] = {
    "bald": _Cut(lambda share, _: 0.014 if share < BALD - 1e-9 else -_TUCKED, rows=6, ends=BALD),
    "crop": _Cut(lambda share, _: 0.026),
    "short": _Cut(lambda share, _: 0.034 + 0.045 * _top(share, 0.7), rough=0.007),
    "curly": _Cut(
        lambda share, angle: 0.07 + 0.065 * _top(share, 0.55) + 0.03 * _over_ears(angle), rows=10, rough=0.022
    ),
    "bob": _Cut(
        lambda share, angle: 0.052 + 0.02 * _top(share, 0.7) + 0.045 * _over_ears(angle) * (1 - _top(share, 0.5)),
        rows=10,
        rough=0.005,
        falls=True,
    ),
    "long": _Cut(
        lambda share, angle: 0.042 + 0.03 * float(np.clip((angle - 0.8) / 0.3, 0, 1)) + 0.02 * _top(share, 0.7),
        rows=12,
        rough=0.007,
        falls=True,
    ),
    "ponytail": _Cut(lambda *_: 0.034, rough=0.003),
    "bun": _Cut(lambda *_: 0.034, rough=0.003),
}


def hair(look: Appearance, skull: Skull, *, fine: bool) -> list[BodyPart]:
    """Make the hair of a head; `fine`: for close-ups."""
    size, head, line = skull.size, {J["head"]: 1.0}, hairline(look)
    if line is None:
        return []
    parts = [_shell(look, skull, line, _CUTS[look.hair], fine=fine)]
    if look.hair == "bun":
        knot = np.array([0.15, 0.16, 0.15]) * size
        low = 0.30 if look.hat != "none" else 0.0
        return [*parts, blob(skull.at(0.88 - low, np.pi, 0.07), knot, head, look.hair_colour, sides=9, rings=6)]
    if look.hair != "ponytail":
        return parts
    neck = {J["neck"]: 0.5, J["head"]: 0.5}
    path = np.array([skull.at(share, np.pi, lift) for share, lift in _TAIL])
    path[-1, 2] -= 0.25 * size
    radii = np.array((0.05, 0.075, 0.09, 0.075, 0.02)) * size
    along, steps = np.arange(len(path)), np.linspace(0, len(path) - 1, 13 if fine else 5)
    if fine:
        path, radii = PchipInterpolator(along, path)(steps), PchipInterpolator(along, radii)(steps)
    rings = [
        LoftRing(point, 1.2 * r, 1.2 * r, r, head if step < 2.5 else neck, look.hair_colour)
        for step, point, r in zip(steps, path, radii, strict=True)
    ]
    return [*parts, loft(rings, sides=14 if fine else 8, forward=(0, 1, 0), close_end=True)]


# Height above the chin, then front, back and half-width around the head's axis; shares of the head's height.
_SKULL = np.array(
    [
        [0.00, 0.30, 0.02, 0.12],
        [0.03, 0.355, 0.10, 0.17],
        [0.08, 0.380, 0.18, 0.215],
        [0.15, 0.390, 0.26, 0.250],
        [0.20, 0.398, 0.30, 0.265],
        [0.26, 0.395, 0.34, 0.280],
        [0.34, 0.400, 0.38, 0.295],
        [0.43, 0.400, 0.41, 0.312],
        [0.52, 0.385, 0.43, 0.320],
        [0.60, 0.398, 0.44, 0.325],
        [0.70, 0.398, 0.45, 0.330],
        [0.80, 0.370, 0.43, 0.318],
        [0.88, 0.310, 0.37, 0.275],
        [0.94, 0.230, 0.28, 0.210],
        [0.98, 0.130, 0.17, 0.125],
        [1.00, 0.020, 0.03, 0.020],
    ]
)
_SIDES = 18


class _Skull:
    """Places points on one head."""

    def __init__(self, size: float, stature: float, broad: float) -> None:
        self.size, self.chin, self.broad, self.axis = size, stature - size, broad, 0.0

    def at(self, share: float, angle: float, lift: float = 0.0) -> NDArray[np.float64]:
        """Return a point at a height and an angle from straight ahead (to the left), lifted off the skin by a share."""
        front, back, side = (np.interp(share, _SKULL[:, 0], _SKULL[:, k]) for k in (1, 2, 3))
        c, s = np.cos(angle), np.sin(angle)
        power = 2 / 2.15
        # Towards the crown, off the skin means upwards.
        up = float(np.clip((share - 0.60) / 0.40, 0, 1))
        out = lift * np.sqrt(1 - up * up)
        x = np.sign(c) * abs(c) ** power * ((front if c >= 0 else back) + out)
        y = np.sign(s) * abs(s) ** power * (side * self.broad + out)
        return np.array([x * self.size, y * self.size, self.chin + (share + lift * up) * self.size])


def head_parts(look: Appearance, size: float, stature: float, *, fine: bool) -> list[BodyPart]:
    """Make a head of `size` metres, chin to crown, on a body of `stature` metres."""
    skull = _Skull(size, stature, 0.97 + 0.05 * look.gender + 0.06 * max(look.build - 0.5, 0))
    parts = [_face(look, skull)]
    parts += _features(look, skull)
    return parts + worn_on_head(look, skull, fine=fine)


def worn_on_head(look: Appearance, skull: Skull, *, fine: bool) -> list[BodyPart]:
    """Hair, eyebrows and glasses for any head; `fine`: for close-ups."""
    parts = [*eyebrows(look, skull, fine=fine), *hair(look, skull, fine=fine), *hat_parts(look, skull)]
    return parts + glasses(skull, fine=fine) if look.glasses else parts


def _shade(colour: Colour, red: float, green: float, blue: float) -> Colour:
    r, g, b = (int(np.clip(v * f, 0, 255)) for v, f in zip(colour, (red, green, blue), strict=True))
    return r, g, b


def _face(look: Appearance, skull: _Skull) -> BodyPart:
    """Return the skull, tinted at lips, cheeks and eye sockets; the chin follows the jaw joint."""
    angles = np.linspace(0, 2 * np.pi, _SIDES, endpoint=False)
    points = np.array([[skull.at(share, a) for a in angles] for share in _SKULL[:, 0]])
    count = len(_SKULL)
    faces = []
    for k in range(count - 1):
        for i in range(_SIDES):
            j = (i + 1) % _SIDES
            a, b, c, d = k * _SIDES + i, k * _SIDES + j, (k + 1) * _SIDES + j, (k + 1) * _SIDES + i
            faces += [(a, b, c), (a, c, d)]
    vertices = points.reshape(-1, 3)
    skin = np.tile(np.asarray(look.skin, np.float64), (len(vertices), 1))
    share = np.repeat(_SKULL[:, 0], _SIDES)
    y = vertices[:, 1] / skull.size
    ahead = vertices[:, 0] > 0.2 * skull.size
    lips = ahead & (np.abs(share - 0.20) < 0.02) & (np.abs(y) < 0.10)
    skin[lips] = _shade(look.skin, 0.78, 0.58, 0.56)
    sockets = ahead & (np.abs(share - 0.52) < 0.02) & (np.abs(y) > 0.06) & (np.abs(y) < 0.28)
    skin[sockets] = _shade(look.skin, 0.86, 0.82, 0.80)
    cheeks = ahead & (np.abs(share - 0.38) < 0.06) & (np.abs(y) > 0.12) & (np.abs(y) < 0.27)
    skin[cheeks] = _shade(look.skin, 1.0, 0.94, 0.92)
    if look.beard:
        chin = (share < 0.29) & (vertices[:, 0] > -0.02 * skull.size) & ~lips
        skin[chin] = look.hair_colour
    weights = np.tile(dense({J["head"]: 1.0}), (len(vertices), 1))
    jaw = (np.clip((0.22 - share) / 0.08, 0, 1) * (vertices[:, 0] > 0.1 * skull.size))[:, None]
    weights = weights * (1 - jaw) + jaw * dense({J["jaw"]: 1.0})
    return with_normals(BodyPart(vertices, np.array(faces), skin, weights))


def _features(look: Appearance, skull: _Skull) -> list[BodyPart]:
    size, head = skull.size, {J["head"]: 1.0}
    wide = 1.0 + 0.25 * look.ancestry[0] / sum(look.ancestry)
    nose = []
    for share, out, half in (
        (0.56, 0.385, 0.022),
        (0.48, 0.415, 0.030),
        (0.40, 0.455, 0.038),
        (0.345, 0.492, 0.052),
        (0.315, 0.445, 0.060),
        (0.295, 0.40, 0.04),
    ):
        centre = (0.37 * size, 0.0, skull.chin + share * size)
        nose.append(LoftRing(centre, (out - 0.37) * size, 0.03 * size, half * wide * size, head, look.skin, 1.7))
    parts = [loft(nose, sides=8, close_start=True, close_end=True)]
    for side, left in (("left", 1.0), ("right", -1.0)):
        eye = {J[f"{side}_eye"]: 1.0}
        middle = skull.at(0.525, left * 0.46)
        inset = np.array([0.028 * size, 0, 0])
        parts.append(
            blob(middle - inset, np.array([0.040, 0.056, 0.028]) * size, eye, (236, 232, 228), sides=8, rings=4)
        )
        iris = middle + np.array([0.004 * size, -left * 0.003 * size, 0])
        parts.append(
            blob(
                iris - inset * 0.1,
                np.array([0.016, 0.022, 0.024]) * size,
                eye,
                _shade(look.eyes, 0.6, 0.6, 0.6),
                sides=6,
                rings=4,
            )
        )
        lid = middle + np.array([-0.010, 0, 0.026]) * size
        parts.append(
            blob(
                lid, np.array([0.034, 0.060, 0.012]) * size, head, _shade(look.skin, 0.72, 0.66, 0.64), sides=8, rings=3
            )
        )
        ear = skull.at(0.46, left * 1.66)
        parts.append(
            blob(
                ear + np.array([0, left * 0.012, 0]) * size,
                np.array([0.075, 0.030, 0.120]) * size,
                head,
                _shade(look.skin, 0.96, 0.88, 0.86),
                sides=7,
                rings=5,
            )
        )
    mouth = [skull.at(0.195, a, 0.004) for a in (-0.27, -0.12, 0.0, 0.12, 0.27)]
    lips = [
        LoftRing(
            p, r * size, r * size, 0.012 * size, {J["head"]: 0.6, J["jaw"]: 0.4}, _shade(look.skin, 0.74, 0.52, 0.50)
        )
        for p, r in zip(mouth, (0.006, 0.018, 0.020, 0.018, 0.006), strict=True)
    ]
    parts.append(loft(lips, sides=6, forward=(0, 0, 1), close_start=True, close_end=True))
    return parts
