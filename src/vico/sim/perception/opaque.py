"""What hides things outdoors: how high buildings stand, on a grid."""

from __future__ import annotations

import math
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from vico.world.walkable import fill_polygon
from vico.world.world import World

_CELL = 0.5


@dataclass(frozen=True)
class OpaqueGrid:
    """Tops of buildings over a square world.

    Attributes
    ----------
    level
        Which of `tops` the building over each cell's centre has, the highest where there are several, uint16 or uint32,
        shape ``(n, n)``, indexed ``[iy, ix]``. A city has a hundred million cells: half the memory of heights.
    tops
        Heights, metres, float32, ascending; the first is -inf, where there is no building.
    half
        Half the side of the square, metres.
    cell
        Side of a cell, metres.
    """

    level: NDArray[np.unsignedinteger]
    tops: NDArray[np.float32]
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
    highest = np.array([building.base + building.height for building in world.buildings], np.float32)
    tops = np.concatenate([np.array([-np.inf], np.float32), np.unique(highest)])
    level = np.zeros((n, n), np.uint16 if len(tops) <= np.iinfo(np.uint16).max else np.uint32)
    of_building = np.searchsorted(tops, highest)
    # The highest are written last.
    for k in np.argsort(of_building, kind="stable").tolist():
        rings = [np.asarray(ring, np.float64) for ring in world.buildings[k].footprint]
        starts = np.cumsum([0, *map(len, rings)])
        x, y = np.ascontiguousarray(np.concatenate(rings).T)
        fill_polygon(level, x, y, starts, float(world.half), _CELL, level.dtype.type(of_building[k]))
    return OpaqueGrid(level, tops, world.half)
