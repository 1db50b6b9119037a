"""Ground that a robot cannot traverse: too narrow for it, too steep, or beside kerbs that are too high."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots.model import RobotModel
from vico.world.world import World

#: Metres a robot leaves to walls on its way.
WALL_GAP = 0.12
# Rows of the walkable map that are looked at together: a city has tens of thousands.
_ROWS = 256


def untraversable_cells(world: World, model: RobotModel) -> NDArray[np.bool_]:
    """Return the cells of the walkable map that a robot's ways keep off, bool, shape ``(n, n)``.

    Those too narrow for it, those too steep, and those beside kerbs that are too high for it.
    """
    count = world.walkable.n
    found = np.empty((count, count), np.bool_)
    for first in range(0, count, _ROWS):
        rows = slice(first, min(first + _ROWS, count))
        narrow = world.walkable.clearance[rows] < model.half_width + WALL_GAP
        if model.kerb is not None:
            narrow |= _at_kerbs(world, rows, higher=model.kerb, within=model.half_width)
        if model.grade is not None:
            narrow |= _steep(world, rows, model.grade)
        found[rows] = narrow
    return found


def _steep(world: World, rows: slice, grade: float) -> NDArray[np.bool_]:
    """Return the cells of some rows where the ground between kerbs rises by more than that a metre."""
    # Slopes are between the rows before and after.
    more = slice(max(rows.start - 1, 0), min(rows.stop + 1, world.walkable.n))
    heights = world.height.smooth(_cells(world, more)).astype(np.float64)
    steep = np.hypot(*np.gradient(heights, world.walkable.cell)) > grade
    return np.asarray(steep[rows.start - more.start :][: rows.stop - rows.start])


def _cells(world: World, rows: slice) -> NDArray[np.float64]:
    """Return the middles of the walkable map's cells in some rows, ENU metres, shape ``(rows, n, 2)``."""
    columns, row = np.arange(world.walkable.n), np.arange(rows.start, rows.stop)
    return world.walkable.centre_of(np.stack(np.meshgrid(columns, row), axis=-1))


def _at_kerbs(world: World, rows: slice, *, higher: float, within: float) -> NDArray[np.bool_]:
    """Return the cells of some rows that are so near to kerbs that are higher than that, metres."""
    height, cells = world.height, _cells(world, rows)
    is_near = np.abs(height.edge_distance(cells)) < within
    is_near[is_near] = height.upper(cells[is_near]) - height.lower(cells[is_near]) > higher
    return is_near
