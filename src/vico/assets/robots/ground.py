"""Ground that robots keep off: too narrow for them, too steep, or beside kerbs that are too high."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots.model import RobotModel
from vico.world.world import World

#: Metres a robot leaves to walls on its way.
WALL_GAP = 0.12


def narrow_ground(world: World, model: RobotModel) -> NDArray[np.bool_]:
    """Return the cells of the walkable map that a robot's ways keep off, bool, shape ``(n, n)``.

    Those too narrow for it, those too steep, and those beside kerbs that are too high for it.
    """
    narrow: NDArray[np.bool_] = world.walkable.clearance < model.half_width + WALL_GAP
    if model.kerb is not None:
        narrow |= _at_kerbs(world, higher=model.kerb, within=model.half_width)
    if model.grade is not None:
        narrow |= _steep(world, model.grade)
    return narrow


def _steep(world: World, grade: float) -> NDArray[np.bool_]:
    """Return the cells of the walkable map where the ground between kerbs rises by more than that a metre."""
    walkable = world.walkable
    heights = world.height.smooth(_cells(world)).astype(np.float64)
    return np.hypot(*np.gradient(heights, walkable.cell)) > grade


def _cells(world: World) -> NDArray[np.float64]:
    """Return the middles of the walkable map's cells, ENU metres, shape ``(n, n, 2)``."""
    row = np.arange(world.walkable.n)
    return world.walkable.centre_of(np.stack(np.meshgrid(row, row), axis=-1))


def _at_kerbs(world: World, *, higher: float, within: float) -> NDArray[np.bool_]:
    """Return the cells of the walkable map that lie so near to kerbs that are higher than that, metres."""
    height, cells = world.height, _cells(world)
    is_near = np.abs(height.edge_distance(cells)) < within
    is_near[is_near] = height.upper(cells[is_near]) - height.lower(cells[is_near]) > higher
    return is_near
