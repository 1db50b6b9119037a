"""What is sewn onto clothes: the shirt in an open jacket, lapels, ties, buttons, pockets; and turned-in hems."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from vico.assets.people.lofts import BodyPart, with_normals
from vico.assets.people.model import Appearance, Colour

# Where the front opens (share of the stature), half its width there and at the neck, as shares too.
_OPENING = {"suit": (0.655, 0.002, 0.036), "jacket": (0.520, 0.020, 0.030), "coat": (0.735, 0.003, 0.032)}


def darker(colour: Colour, share: float) -> Colour:
    """Return a shade of a colour."""
    return int(colour[0] * share), int(colour[1] * share), int(colour[2] * share)


def front_of(
    look: Appearance,
    cloth: BodyPart,
    level: Callable[[float], float],
    neckline: float,
    rows: Sequence[float] = (),
    thickness: float = 0.0034,
) -> list[BodyPart]:
    """Dress the front of a top.

    Parameters
    ----------
    look
        Which top it is.
    cloth
        The top as a mesh.
    level
        Metres above the floor of a share of the stature.
    neckline
        Where the cloth ends above, as a share of the stature.
    rows
        Heights at which the cloth has rows of vertices, metres: pieces get rows there, or they would cut through it.
    thickness
        How far pieces lie above the cloth, as a share of the stature.
    """
    dark, h = darker(look.top_colour, 0.72), look.height

    def piece(
        span: tuple[float, float],
        widths: tuple[float, float],
        layer: float,
        colour: Colour,
        centres: tuple[float, float] = (0.0, 0.0),
    ) -> BodyPart:
        heights = np.array([level(span[0]), *(z for z in rows if level(span[0]) < z < level(span[1])), level(span[1])])
        if not len(rows):
            heights = np.linspace(level(span[0]), level(span[1]), 12)
        at = (heights - heights[0]) / (heights[-1] - heights[0])
        middle, half = np.interp(at, (0, 1), centres) * h, np.interp(at, (0, 1), widths) * h
        return sewn(cloth, heights, middle, half, layer * thickness * h, colour)

    if look.top in _OPENING:
        low, narrow, wide = _OPENING[look.top]
        parts = [piece((low, neckline), (narrow, wide), 1.0, look.under_colour)]
        for left in (1.0, -1.0):
            edges = (left * (narrow + 0.004), left * (wide + 0.006))
            parts.append(piece((low, neckline), (0.004, 0.009), 1.5, dark, edges))
        if look.top == "suit" and look.gender > 0.5:
            parts.append(piece((0.655, neckline - 0.004), (0.006, 0.004), 2.2, (110, 34, 42)))
        if look.top == "coat":
            parts.append(piece((0.54, low), (0.0025, 0.0025), 1.0, dark))
        return parts
    if look.top == "shirt":
        return [piece((0.53, neckline - 0.004), (0.0035, 0.0035), 1.0, dark)]
    if look.top == "hoodie":
        return [piece((0.56, 0.615), (0.055, 0.042), 1.3, dark)]
    return []


def sewn(
    cloth: BodyPart,
    heights: NDArray[np.float64],
    middle: NDArray[np.float64],
    half: NDArray[np.float64],
    lift: float,
    colour: Colour,
) -> BodyPart:
    """Return a strip up the front of `cloth`, five vertices wide.

    Parameters
    ----------
    cloth
        What it is sewn to.
    heights, middle, half
        Of its rows, how far to the left of the middle it runs there, and half its width, metres.
    lift
        How far it lies off the cloth, metres.
    colour
        sRGB.
    """
    columns = np.linspace(-1.0, 1.0, 5)
    y = (middle[:, None] + half[:, None] * columns).ravel()
    z = np.repeat(heights, len(columns))
    x = _foremost(cloth, y, z)
    for _ in range(12):
        if np.isfinite(x).all():
            break
        # At the neck the piece may be wider, or higher, than what it is sewn to.
        lost = ~np.isfinite(x)
        y, z = np.where(lost, 0.85 * y, y), np.where(lost, z - 0.004, z)
        x = _foremost(cloth, y, z)
    points = np.column_stack([np.where(np.isfinite(x), x, np.nanmax(np.where(np.isfinite(x), x, np.nan))) + lift, y, z])
    faces, width = [], len(columns)
    for k in range(len(heights) - 1):
        for c in range(width - 1):
            a = k * width + c
            faces += [(a, a + 1, a + width + 1), (a, a + width + 1, a + width)]
    nearest = ((points[:, None] - cloth.vertices[None]) ** 2).sum(2).argmin(1)
    colours = np.tile(np.asarray(colour, np.float64), (len(points), 1))
    return with_normals(BodyPart(points, np.array(faces), colours, cloth.weights[nearest]))


def _foremost(part: BodyPart, y: NDArray[np.float64], z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the largest x of a part's surface at each (y, z)."""
    a, b, c = (part.vertices[part.triangles[:, k]] for k in range(3))
    area = (b[:, 1] - a[:, 1]) * (c[:, 2] - a[:, 2]) - (c[:, 1] - a[:, 1]) * (b[:, 2] - a[:, 2])
    facing = area > 1e-12  # towards +x: above its rim in front there is still the back of the collar
    a, b, c, area = a[facing], b[facing], c[facing], area[facing]
    py, pz = y[:, None], z[:, None]
    u = ((b[:, 1] - py) * (c[:, 2] - pz) - (c[:, 1] - py) * (b[:, 2] - pz)) / area
    v = ((c[:, 1] - py) * (a[:, 2] - pz) - (a[:, 1] - py) * (c[:, 2] - pz)) / area
    w = 1 - u - v
    x = u * a[:, 0] + v * b[:, 0] + w * c[:, 0]
    inside = (u > -1e-6) & (v > -1e-6) & (w > -1e-6)
    return np.where(inside, x, -np.inf).max(axis=1)


def hemmed(part: BodyPart, edges: NDArray[np.int64], depth: float) -> BodyPart:
    """Turn the open edges of a piece of cloth in by `depth` metres, so that it has an inside."""
    rim = np.unique(edges)
    place = np.full(len(part.vertices), -1)
    place[rim] = np.arange(len(rim)) + len(part.vertices)
    inner = part.vertices[rim] - depth * part.normals[rim]
    u, v = edges[:, 0], edges[:, 1]
    strips = np.concatenate([np.column_stack([v, u, place[u]]), np.column_stack([v, place[u], place[v]])])
    return BodyPart(
        np.concatenate([part.vertices, inner]),
        np.concatenate([part.triangles, strips]),
        np.concatenate([part.colour, 0.7 * part.colour[rim]]),
        np.concatenate([part.weights, part.weights[rim]]),
        np.concatenate([part.normals, part.normals[rim]]),
    )
