"""When a robot counts as fallen, as up again, and as lost."""

from __future__ import annotations

import numpy as np

from vico.sim.robots.controller import MotorController
from vico.sim.robots.path_follower import RobotStatus
from vico.sim.robots.state import RobotMode, RobotRun

#: Seconds a robot has to be tilted to count as fallen; cosine of the tilt at which it may be up again.
_FALL_TIME, _UPRIGHT = 0.3, 0.95
#: Seconds after which a robot that can't get up is left lying.
_GIVE_UP = 30.0
# What the arrays hold: members of an enumeration are slow to look up.
_FALLEN = int(RobotStatus.FALLEN)


def watch_falls(run: RobotRun, dt: float) -> None:
    """Note who fell, who is up again and who is lost, `dt` seconds after this was last asked."""
    status = run.arrays.status.tolist()
    for group in run.scene.groups:
        limit = group.model.fallen_below
        for robot in group.robots.tolist():
            if status[robot] == _FALLEN:
                _watch_lying(run, robot, group.controller, dt)
            elif limit is not None:
                tilted = float(run.engine.base(robot).rotation[2, 2]) < limit
                _watch_standing(run, robot, dt if tilted else 0.0)


def _watch_standing(run: RobotRun, robot: int, tilted: float) -> None:
    arrays = run.arrays
    lying = float(arrays.lying[robot]) + tilted if tilted else 0.0
    arrays.lying[robot] = lying
    if lying > _FALL_TIME:
        arrays.status[robot] = RobotStatus.FALLEN
        arrays.lying[robot] = 0.0
        run.note(robot, "fallen")


def _watch_lying(run: RobotRun, robot: int, controller: MotorController, dt: float) -> None:
    arrays, base = run.arrays, run.engine.base(robot)
    lying = float(arrays.lying[robot])
    above = run.above_ground(robot)
    upright = float(base.rotation[2, 2]) > _UPRIGHT
    if upright and controller.stands(lying, base, run.engine.joints(robot)[0], above):
        arrays.status[robot] = RobotStatus.MOVING if arrays.mode[robot] != RobotMode.IDLE else RobotStatus.IDLE
        lift = controller.lift(0.0, base, above)
        if lift is not None:  # let go
            run.engine.thrust(robot, lift[:1], np.zeros((1, 3)))
        arrays.lying[robot] = 0.0
        run.note(robot, "recovered")
    elif lying - dt <= _GIVE_UP < lying:
        run.note(robot, "lost")
