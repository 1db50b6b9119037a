"""Hair of any head: a shell from the hairline to the crown, a knot, a ponytail."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from vico.assets.people.accessories import COVERED, PRESSED
from vico.assets.people.lofts import BodyPart, LoftRing, blend, blob, dense, loft, with_normals
from vico.assets.people.model import Appearance, J
from vico.assets.people.skulls import Skull

# Columns of hair around the head, and rows for each of a coarse shell, of bodies for close-ups.
_COLUMNS, _FINE_COLUMNS, _FINE_ROWS = 20, 48, 1.7
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
