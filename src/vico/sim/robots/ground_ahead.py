"""The ground ahead of a robot that drives or walks: how it slopes, and where walls are."""

from __future__ import annotations

import math

import numpy as np

from vico.sim.physics.records import Base
from vico.sim.robots.rooms import OUTDOORS
from vico.sim.robots.state import RobotRun
from vico.world.walkable import BLOCKED

#: Metres over which a slope counts: a robot brakes on the whole of it.
_REACH = 1.2
#: Metres ahead between two points that are looked at for walls, how many, and m/s at which a robot may touch one.
_STEP, _POINTS, _TOUCH = 0.25, 8, 0.3


def slope_ahead(run: RobotRun, robot: int, base: Base) -> float:
    """Return by how much the ground falls for each metre ahead of a robot; floors of rooms are level."""
    if run.trips.room[robot] != OUTDOORS:
        return 0.0
    x, y = base.position[:2].tolist()
    ahead = x + _REACH * math.cos(base.yaw), y + _REACH * math.sin(base.yaw)
    here, there = run.scene.world.height(np.array([(x, y), ahead])).tolist()
    return float(here - there) / _REACH


def speed_at_walls(run: RobotRun, robot: int, base: Base, brake: float) -> float:
    """Return the fastest that a robot may go straight on to touch what stands there slowly, m/s; indoors any.

    `brake` is how hard it brakes, m/s2.
    """
    if run.trips.room[robot] != OUTDOORS:
        return math.inf
    along = run.scene.models[robot].half_length + _STEP * np.arange(_POINTS)
    points = base.position[:2] + along[:, None] * (math.cos(base.yaw), math.sin(base.yaw))
    walls = np.flatnonzero(run.scene.world.walkable.class_at(points) == BLOCKED)
    if not len(walls):
        return math.inf
    return max(_TOUCH, math.sqrt(2.0 * brake * _STEP * float(walls[0])))
