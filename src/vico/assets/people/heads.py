"""Heads of our own people: skull, features, hair, beard, glasses, by a profile in shares of the head's height."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from vico.assets.people.accessories import COVERED, PRESSED, hat_parts
from vico.assets.people.lofts import BodyPart, LoftRing, blend, blob, dense, loft, with_normals
from vico.assets.people.model import Appearance, Colour, J

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
# An eyebrow's way: angle, height above its level, distance from the skin.
_BROW = ((0.16, -0.005, 0.014), (0.36, 0.012, 0.034), (0.54, 0.002, 0.026))
# A ponytail's way: height on the head, distance from it.
_TAIL = ((0.74, 0.0), (0.74, 0.14), (0.56, 0.20), (0.40, 0.16), (0.40, 0.18))


class Skull(Protocol):
    """Where the surface of a head is; `chin` is its height, `size` reaches to the crown, `axis` is its middle's x."""

    size: float
    chin: float
    axis: float

    def at(self, share: float, angle: float, lift: float = 0.0) -> NDArray[np.float64]:
        """Return a point at a height and an angle from straight ahead (to the left), lifted off the skin by a share."""


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


def head_parts(look: Appearance, size: float, stature: float) -> list[BodyPart]:
    """Make a head of `size` metres, chin to crown, on a body of `stature` metres."""
    skull = _Skull(size, stature, 0.97 + 0.05 * look.gender + 0.06 * max(look.build - 0.5, 0))
    parts = [_face(look, skull)]
    parts += _features(look, skull)
    return parts + worn_on_head(look, skull)


def worn_on_head(look: Appearance, skull: Skull) -> list[BodyPart]:
    """Hair, eyebrows and glasses for any head."""
    parts = [*_brows(look, skull), *_hair(look, skull), *hat_parts(look, skull)]
    return parts + _glasses(skull) if look.glasses else parts


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


def _brows(look: Appearance, skull: Skull) -> list[BodyPart]:
    size, head, parts = skull.size, {J["head"]: 1.0}, []
    brow: Colour = _shade(look.hair_colour, 0.75, 0.75, 0.75) if look.hair != "bald" else (70, 56, 48)
    for left in (1.0, -1.0):
        line = [skull.at(0.605 + rise, left * a, out) for a, rise, out in _BROW]
        rings = [
            LoftRing(p, r * size, r * size, 0.014 * size, head, brow)
            for p, r in zip(line, (0.013, 0.014, 0.008), strict=True)
        ]
        parts.append(loft(rings, sides=5, forward=(0, 0, 1), close_start=True, close_end=True))
    return parts


def _cap(
    look: Appearance,
    skull: Skull,
    hairline: Callable[[float], float],
    thickness: Callable[[float, float], float],
    *,
    rows: int = 8,
    rough: float = 0.0,
) -> BodyPart:
    """Hair as a shell: columns from the hairline to the crown, lifted off the skull, tucked in at the rim."""
    angles = np.linspace(-np.pi, np.pi, _SIDES + 2, endpoint=False)
    columns = len(angles)
    points, colours, shares = [], [], []
    for i, angle in enumerate(angles):
        line = hairline(abs(float(angle)))
        for k in range(rows):
            share = line + (0.985 - line) * (max(k - 1, 0) / (rows - 2)) ** 0.8
            wave = rough * np.sin(12.9898 * (i * rows + k) + 4.1)
            # Hair rises from the forehead instead of standing on it like a cap's brim.
            brow = 0.35 + 0.65 * min(max(k - 1, 0) / 2, 1.0) if abs(angle) < 1.2 else 1.0
            lift = thickness(share, abs(float(angle))) * brow * (k > 0) + wave * (k > 0)
            if look.hat != "none" and share > COVERED:
                lift = min(lift, PRESSED)
            # Below the cheekbone hair falls straight instead of following the neck.
            point = skull.at(max(share, 0.40), float(angle), lift)
            if k == 0:
                point[:2] = 0.7 * point[:2] + np.array([0.3 * skull.axis, 0])
            point[2] += min(share - 0.40, 0.0) * skull.size
            points.append(point)
            strand = 0.90 + 0.16 * (0.5 + 0.5 * np.sin(7.3 * i + 0.9 * k)) - 0.12 * (k == 0)
            colours.append(np.asarray(look.hair_colour) * strand)
            low = float(np.clip((0.02 - share) / 0.35, 0, 1)) * 0.75
            shares.append(dense(blend({J["head"]: 1.0}, {J["neck"]: 0.4, J["spine3"]: 0.6}, low)))
    crown = skull.at(1.0, 0.0, min(thickness(1.0, 0.0), PRESSED if look.hat != "none" else np.inf))
    crown[:2] = skull.axis, 0
    points.append(crown)
    colours.append(np.asarray(look.hair_colour) * 1.0)
    shares.append(dense({J["head"]: 1.0}))
    faces = []
    for i in range(columns):
        j = (i + 1) % columns
        for k in range(rows - 1):
            a, b, c, d = i * rows + k, j * rows + k, j * rows + k + 1, i * rows + k + 1
            faces += [(a, b, c), (a, c, d)]
        faces.append((i * rows + rows - 1, j * rows + rows - 1, columns * rows))
    return with_normals(BodyPart(np.array(points), np.array(faces), np.array(colours), np.array(shares)))


def _line(front: float, temple: float, ear: float, back: float) -> Callable[[float], float]:
    """Return a hairline by the angle from straight ahead."""
    return lambda angle: float(
        np.interp(angle, (0.0, 0.5, 0.95, 1.25, 1.75, 2.2, np.pi), (front, front, temple, ear, ear, back, back))
    )


def hairline(look: Appearance) -> Callable[[float], float] | None:
    """Return where hair starts: a share of the head's height by the angle from straight ahead; None: no hair at all."""
    recede = 0.05 * look.gender * float(np.clip((look.age - 30) / 40, 0, 1))
    front, temple = 0.775 + recede, 0.66 + recede
    if look.hair == "bald":
        return _line(0.97, 0.93, 0.50, 0.20) if look.age >= 30 else None
    lines = {
        "crop": (front, temple, 0.50, 0.20),
        "short": (front - 0.03, temple, 0.44, 0.14),
        "curly": (front - 0.02, temple - 0.02, 0.34, 0.08),
        "bob": (front, 0.44, 0.02, -0.02),
        "long": (front, 0.48, -0.42, -0.52),
    }
    return _line(*lines.get(look.hair, (front, temple - 0.02, 0.46, 0.16)))


def _hair(look: Appearance, skull: Skull) -> list[BodyPart]:
    size, head, line = skull.size, {J["head"]: 1.0}, hairline(look)
    if line is None:
        return []

    def top(share: float, low: float) -> float:
        return float(np.clip((share - low) / 0.3, 0, 1))

    if look.hair == "bald":
        return [_cap(look, skull, line, lambda share, _: 0.012 * float(share < 0.72), rows=6)]
    if look.hair == "crop":
        return [_cap(look, skull, line, lambda share, _: 0.026, rows=8)]
    if look.hair == "short":
        return [_cap(look, skull, line, lambda share, _: 0.034 + 0.045 * top(share, 0.7), rough=0.007)]
    if look.hair == "curly":
        return [_cap(look, skull, line, lambda share, _: 0.07 + 0.065 * top(share, 0.55), rough=0.022, rows=10)]
    if look.hair == "bob":
        return [_cap(look, skull, line, lambda share, _: 0.052 + 0.02 * top(share, 0.7), rows=10, rough=0.005)]
    if look.hair == "long":
        fall = lambda share, angle: 0.042 + 0.03 * float(angle > 1) + 0.02 * top(share, 0.7)  # noqa: E731
        return [_cap(look, skull, line, fall, rows=12, rough=0.007)]
    parts = [_cap(look, skull, line, lambda share, angle: 0.034, rows=8, rough=0.003)]
    if look.hair == "bun":
        knot = np.array([0.15, 0.16, 0.15]) * size
        low = 0.30 if look.hat != "none" else 0.0
        return [*parts, blob(skull.at(0.88 - low, np.pi, 0.07), knot, head, look.hair_colour, sides=9, rings=6)]
    neck = {J["neck"]: 0.5, J["head"]: 0.5}
    path = [skull.at(share, np.pi, lift) for share, lift in _TAIL]
    path[-1][2] -= 0.25 * size
    radii = (0.05, 0.075, 0.09, 0.075, 0.02)
    rings = [
        LoftRing(point, r * size, r * size, 1.2 * r * size, head if k < 3 else neck, look.hair_colour)
        for k, (point, r) in enumerate(zip(path, radii, strict=True))
    ]
    return [*parts, loft(rings, sides=8, forward=(0, 0, 1), close_end=True)]


def _glasses(skull: Skull) -> list[BodyPart]:
    size, head, dark = skull.size, {J["head"]: 1.0}, (30, 28, 30)
    parts = []
    for left in (1.0, -1.0):
        middle = skull.at(0.525, left * 0.45, 0.035)
        turns = np.linspace(0, 2 * np.pi, 11)
        path = [middle + np.array([-0.02 * abs(np.cos(t)), 0.085 * np.cos(t), 0.062 * np.sin(t)]) * size for t in turns]
        rings = [LoftRing(p, 0.008 * size, 0.008 * size, 0.008 * size, head, dark) for p in path]
        parts.append(loft(rings, sides=4, forward=(1, 0, 0)))
        temple = [middle + np.array([-0.02, left * 0.085, 0.01]) * size, skull.at(0.545, left * 1.6, 0.03)]
        parts.append(
            loft(
                [LoftRing(p, 0.008 * size, 0.008 * size, 0.008 * size, head, dark) for p in temple],
                sides=4,
                forward=(0, 0, 1),
            )
        )
    bridge = [skull.at(0.545, a, 0.045) for a in (0.14, -0.14)]
    parts.append(
        loft(
            [LoftRing(p, 0.008 * size, 0.008 * size, 0.008 * size, head, dark) for p in bridge],
            sides=4,
            forward=(0, 0, 1),
        )
    )
    return parts
