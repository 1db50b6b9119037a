"""What lies on the upper face of any head: eyebrows, and glasses that stand before the cheeks."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.assets.people.lofts import BodyPart, LoftRing, dense, loft, with_normals
from vico.assets.people.model import Appearance, Colour, J
from vico.assets.people.skulls import Skull, face_depth

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
# A lens: how far aside of the nose its middle is, its height on the head, half its width and height.
_ASIDE, _LEVEL, _HALF_WIDTH, _HALF_HEIGHT = 0.145, 0.520, 0.098, 0.074
# Frames: half their thickness, how far they are off the skin, how far they curve around the face.
_THICK, _CLEAR, _CURVE = 0.0055, 0.014, 0.22
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
