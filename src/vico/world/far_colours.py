"""Colours of meshes from afar: means of what triangles show of their textures, and one picture for all windows.

Colours are in linear light. The windows of far houses shine by night as near windows do.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.exact import each
from vico.world.mesh import Material, Surface

_TEXELS = 128  # of a texture's side that a mean colour is made from


class ColouredTriangles(NamedTuple):
    """Triangles with the colours they have from afar.

    Attributes
    ----------
    corners
        Metres, shape ``(n, 3, 3)``.
    normals
        As long as the triangle's area, square metres, shape ``(n, 3)``.
    colour
        Means in linear light, shape ``(n, 3)``.
    entity
        Shape ``(n,)``.
    cover
        Which share of a triangle is no hole, shape ``(n,)``.
    shine
        Which share of its light it gives of its own by night, as lit windows do, shape ``(n,)``.
    """

    corners: NDArray[np.float64]
    normals: NDArray[np.float64]
    colour: NDArray[np.float64]
    entity: NDArray[np.int32]
    cover: NDArray[np.float64]
    shine: NDArray[np.float64]

    def where(self, chosen: NDArray[Any]) -> ColouredTriangles:
        """Return some of the triangles: a mask, shape ``(n,)``, or indices."""
        return ColouredTriangles(*(column[chosen] for column in self))


_value = np.arange(256) / 255.0
LINEAR = np.where(_value <= 0.04045, _value / 12.92, each(math.pow, (_value + 0.055) / 1.055, 2.4))
"""Linear light of the values of sRGB, 0 to 1, shape ``(256,)``."""


def srgb(linear: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return colours in linear light as sRGB.

    Parameters
    ----------
    linear
        0 to 1, what is beyond is cut off, any shape.

    Returns
    -------
    NDArray
        Of the same shape.
    """
    value = np.clip(linear, 0.0, 1.0)
    coded = np.where(value <= 0.0031308, 12.92 * value, 1.055 * value ** (1.0 / 2.4) - 0.055)
    return np.round(255.0 * coded).astype(np.uint8)


def coloured_triangles(surfaces: Iterable[Surface]) -> ColouredTriangles:
    """Return the triangles of surfaces with the colours they have from afar.

    Parameters
    ----------
    surfaces
        Any; those without triangles add none.

    Returns
    -------
    Looks
        Surface by surface, in their order.
    """
    found = [_coloured_triangles_of(surface) for surface in surfaces if len(surface.triangles)]
    if not found:
        none = np.zeros((0, 3))
        return ColouredTriangles(np.zeros((0, 3, 3)), none, none, np.zeros(0, np.int32), np.zeros(0), np.zeros(0))
    return ColouredTriangles(*(np.concatenate(column) for column in zip(*found, strict=True)))


def _coloured_triangles_of(surface: Surface) -> ColouredTriangles:
    corners = surface.positions[surface.triangles].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2.0
    colour = LINEAR[surface.colour][surface.triangles].mean(axis=1)
    cover, shine = np.ones(len(corners)), np.zeros(len(corners))
    material = surface.material
    if material.texture is not None:
        shown, cover, shine = _texture_means(material.texture, material.cutout, surface.uv[surface.triangles])
        colour, shine = colour * shown, material.emission * shine
    return ColouredTriangles(corners, normals, colour, surface.entity[surface.triangles[:, 0]], cover, shine)


def _texture_means(
    texture: NDArray[np.uint8], cutout: bool, uv: NDArray[np.float32]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the mean colours of what triangles show of a texture, which shares of them are no holes, and what shines.

    Taken over the upright rectangles around the triangles in the texture, from sums over everything left of and below
    a texel: rectangles may be as large as they like, for a texture repeats.
    """
    steps = [max(side // _TEXELS, 1) for side in texture.shape[:2]]
    texels = texture[steps[0] // 2 :: steps[0], steps[1] // 2 :: steps[1]]
    there = texels[..., 3:] >= 128 if cutout else np.ones((*texels.shape[:2], 1), bool)
    shines = texels[..., 3:] / 255.0 if texels.shape[2] == 4 and not cutout else np.zeros_like(there, np.float64)
    layers = np.concatenate([LINEAR[texels[..., :3]] * there, there, shines], axis=2)
    rows, columns = layers.shape[:2]
    sums = np.zeros((rows + 1, columns + 1, 5))
    sums[1:, 1:] = layers.cumsum(axis=0).cumsum(axis=1)

    def below(u: NDArray[np.int64], v: NDArray[np.int64]) -> NDArray[np.float64]:
        (over_u, u), (over_v, v) = np.divmod(u, columns), np.divmod(v, rows)
        whole_u, whole_v = over_u[:, None], over_v[:, None]
        whole: NDArray[np.float64] = whole_u * whole_v * sums[-1, -1] + whole_v * sums[-1, u] + whole_u * sums[v, -1]
        return whole + sums[v, u]

    places = uv.astype(np.float64) * (columns, rows)
    first = np.floor(places.min(axis=1) + 1e-3).astype(np.int64)
    last = np.maximum(np.ceil(places.max(axis=1) - 1e-3).astype(np.int64), first + 1)
    total = below(last[:, 0], last[:, 1]) - below(first[:, 0], last[:, 1])
    total += below(first[:, 0], first[:, 1]) - below(last[:, 0], first[:, 1])
    texels_of = np.prod(last - first, axis=1)
    colour, (cover, shine) = total[:, :3], total[:, 3:].T
    return colour / np.maximum(cover[:, None], 1e-9), cover / texels_of, shine / texels_of


def sums_by(group: NDArray[Any], weight: NDArray[np.float64], values: NDArray[np.float64], count: int) -> Any:
    """Return the weighted sums of values by group.

    Parameters
    ----------
    group
        Of every row, integers below `count`, shape ``(n,)``.
    weight
        Shape ``(n,)``.
    values
        Shape ``(n, k)``.
    count
        How many groups there are.

    Returns
    -------
    NDArray
        Shape ``(count, k + 1)``; the last column is of the weights' own sums.
    """
    columns = [np.bincount(group, weight * column, minlength=count) for column in values.T]
    return np.column_stack([*columns, np.bincount(group, weight, minlength=count)])


def spread_points(corners: NDArray[np.float64], area: NDArray[np.float64], each: float) -> tuple[Any, Any, Any]:
    """Scatter points evenly over triangles, one for every `each` square metres and at least one.

    Parameters
    ----------
    corners
        Metres, shape ``(n, 3, 3)``.
    area
        Square metres, shape ``(n,)``; may be that of a view from above.
    each
        Square metres.

    Returns
    -------
    triangle, place, weight
        Of every point: the triangle's number, shape ``(p,)``, where it is, metres, shape ``(p, 3)``, and the area
        that it stands for, square metres, shape ``(p,)``.
    """
    count = 1 + (area / each).astype(np.int64)
    triangle = np.repeat(np.arange(len(corners)), count)
    # A sequence without gaps or lumps: multiples of two irrational numbers, folded into the triangle.
    share = (np.arange(len(triangle))[:, None] * np.array([0.7548776662466927, 0.5698402909980532])) % 1.0
    outside = share.sum(axis=1) > 1.0
    share[outside] = 1.0 - share[outside]
    a, b, c = (corners[triangle, k] for k in range(3))
    place = a + share[:, :1] * (b - a) + share[:, 1:] * (c - a)
    return triangle, place, (area / count)[triangle]


BAYS, STOREYS = 4, 4
"""Windows side by side, and above one another, in the picture."""

_SIDE = 16  # texels of a window with the wall around it
_BAY, _STOREY = 3.3, 3.2  # metres
_ACROSS, _UP = slice(5, 11), slice(5, 13)  # of the side: a window of 1.2 m x 1.6 m, as most are
_DARK, _DARK_SHINES = (66, 74, 84), 5
_LAMP, _LAMP_SHINES = (216, 182, 130), 184
# Every third window has a lamp on at night, as those of facades have: which ones looks like chance.
_LIT = frozenset({1, 4, 7, 10, 12})


def _picture() -> NDArray[np.uint8]:
    """Paint a white wall with windows, brighter where a lamp is on; alpha is the light they give."""
    picture = np.zeros((STOREYS * _SIDE, BAYS * _SIDE, 4), np.uint8)
    picture[..., :3] = 255
    for k in range(STOREYS * BAYS):
        row, column = divmod(k, BAYS)
        pane = picture[row * _SIDE :, column * _SIDE :][_UP, _ACROSS]
        pane[..., :3] = _LAMP if k in _LIT else _DARK
        pane[..., 3] = _LAMP_SHINES if k in _LIT else _DARK_SHINES
    return picture


WINDOWS = Material("far windows", _picture(), emission=1.0)
"""Material of walls with windows."""

assert WINDOWS.texture is not None
WINDOWS_MEAN = LINEAR[WINDOWS.texture[..., :3]].mean(axis=(0, 1))
"""The picture's mean colour in linear light: a wall's own colour is divided by it, shape ``(3,)``."""


def has_windows(length: NDArray[np.float64], height: float) -> NDArray[np.bool_]:
    """Return which walls have room for a window, given how long they are and their height, metres."""
    return (length > 0.8 * _BAY) & (height > 0.8 * _STOREY)


def window_uv(length: NDArray[np.float64], foot: float, base: float, eaves: float, seed: int) -> NDArray[np.float64]:
    """Return where walls are in the picture, so that no window is cut.

    Parameters
    ----------
    length
        Of the walls, metres, shape ``(n,)``.
    foot, base, eaves
        Heights of their lower edge, of the ground and of their upper edge, metres.
    seed
        Chooses the windows that are lit.

    Returns
    -------
    NDArray
        Texture coordinates of the lower corners and the upper ones, shape ``(n, 4, 2)``: as quads are gone round.
    """
    bays = np.maximum(np.round(length / _BAY), 1.0) / BAYS
    storeys = max(round((eaves - base) / _STOREY), 1) / STOREYS
    below = (foot - base) / (eaves - base) * storeys
    left = (seed + 3.0 * np.arange(len(length))) % BAYS / BAYS
    low = (seed // BAYS) % STOREYS / STOREYS
    bottom, top = np.full(len(length), low + below), np.full(len(length), low + storeys)
    right = left + bays
    corners = ((left, bottom), (right, bottom), (right, top), (left, top))
    return np.stack([np.column_stack(corner) for corner in corners], axis=1)
