"""What hides things outdoors: how high buildings stand, on a grid."""

from __future__ import annotations

import math
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.world.world import World

_CELL = 0.5


@dataclass(frozen=True)
class OpaqueGrid:
    """Tops of buildings over a square world.

    Attributes
    ----------
    top
        Height of the building over each cell's centre, metres, float32, shape ``(n, n)``, indexed ``[iy, ix]``;
        -inf where there is none.
    half
        Half the side of the square, metres.
    cell
        Side of a cell, metres.
    """

    top: NDArray[np.float32]
    half: float
    cell: float = _CELL


_GRIDS: WeakKeyDictionary[World, OpaqueGrid] = WeakKeyDictionary()


def opaque_grid(world: World) -> OpaqueGrid:
    """Return the tops of a world's buildings; found once a world."""
    if world not in _GRIDS:
        _GRIDS[world] = _rasterised(world)
    return _GRIDS[world]


def _rasterised(world: World) -> OpaqueGrid:
    n = math.ceil(2 * world.half / _CELL)
    top = np.full((n, n), -np.inf, np.float32)
    centres = (np.arange(n) + 0.5) * _CELL - world.half
    for building in world.buildings:
        outline = shapely.Polygon(building.footprint[0], building.footprint[1:])
        west, south, east, north = outline.bounds
        columns = slice(*np.searchsorted(centres, (west, east)))
        rows = slice(*np.searchsorted(centres, (south, north)))
        x, y = np.meshgrid(centres[columns], centres[rows])
        shapely.prepare(outline)
        inside = shapely.contains_xy(outline, x, y)
        covered = top[rows, columns]
        covered[inside] = np.maximum(covered[inside], building.base + building.height)
    return OpaqueGrid(top, world.half)
