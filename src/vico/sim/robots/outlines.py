"""What others meet of robots: an upright box around each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.sim.bodies import Bodies
from vico.sim.physics import PhysicsEngine
from vico.sim.robots.scene import RobotScene

#: Metres a robot has to be above where it stands on the ground to count as being in the air.
_AIRBORNE = 0.5


def bodies_of(
    scene: RobotScene, engine: PhysicsEngine, entities: NDArray[np.int32], rooms: NDArray[np.int32]
) -> Bodies:
    """Return upright boxes around the robots: on the ground, on the floor of their rooms, or where they fly."""
    outlines = scene.outlines
    bases = [engine.base(i) for i in range(len(entities))]
    position = np.array([base.position for base in bases]).reshape(-1, 3)
    ground = scene.world.height(position)
    inside = np.flatnonzero(rooms >= 0)
    if len(inside):
        ground[inside] = scene.rooms.indoor.floor[rooms[inside]]
    bottom = position[:, 2] - outlines.stand
    in_the_air = (bottom > ground + _AIRBORNE) | scene.outlines.flies
    position[:, 2] = np.where(in_the_air, bottom, ground)
    return Bodies(
        entities,
        outlines.kind,
        position,
        np.array([base.yaw for base in bases]),
        outlines.half_length,
        outlines.half_width,
        outlines.height,
        np.array([base.velocity for base in bases]).reshape(-1, 3)[:, :2].copy(),
    )
