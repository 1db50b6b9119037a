"""Ground that robots keep off: too narrow for them, or beside kerbs that are too high."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import RobotModel
from vico.world.folder import World

#: Metres a robot leaves to walls on its way.
WALL_GAP = 0.12


def narrow_ground(world: World, model: RobotModel) -> NDArray[np.bool_]:
    """Return the cells of the walkable map that a robot's ways keep off, bool, shape ``(n, n)``.

    Those too narrow for it, and those beside kerbs that are too high for it.
    """
    narrow: NDArray[np.bool_] = world.walkable.clearance < model.half_width + WALL_GAP
    if model.kerb is not None:
        narrow |= _at_kerbs(world, higher=model.kerb, within=model.half_width)
    return narrow


def _at_kerbs(world: World, *, higher: float, within: float) -> NDArray[np.bool_]:
    """Return the cells of the walkable map that lie so near to kerbs that are higher than that, metres."""
    walkable, height = world.walkable, world.height
    row = np.arange(walkable.n)
    cells = walkable.centre_of(np.stack(np.meshgrid(row, row), axis=-1))
    is_near = np.abs(height.edge_distance(cells)) < within
    is_near[is_near] = height.upper(cells[is_near]) - height.lower(cells[is_near]) > higher
    return is_near
