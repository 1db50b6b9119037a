"""When a robot counts as fallen, as up again, and as lost."""

from __future__ import annotations

import numpy as np

from vico.sim.bodies import Bodies
from vico.sim.robots.controller import MotorController
from vico.sim.robots.crashes import GIVE_UP, note_tilt, watch_crashes
from vico.sim.robots.path_follower import RobotStatus
from vico.sim.robots.state import RobotMode, RobotRun

#: Cosine of the tilt at which a robot may be up again.
_UPRIGHT = 0.95
# What the arrays hold: members of an enumeration are slow to look up.
_FALLEN = int(RobotStatus.FALLEN)


def watch_falls(run: RobotRun, dt: float, obstacles: Bodies) -> None:
    """Note who fell, who is up again and who is lost, `dt` seconds after this was last asked.

    `obstacles` are bodies of everybody else outdoors.
    """
    status = run.arrays.status.tolist()
    for group, flight in zip(run.scene.groups, run.flights, strict=True):
        if flight is not None:
            watch_crashes(run, flight, dt, obstacles)
            continue
        limit = group.model.fallen_below
        for robot in group.robots.tolist():
            if status[robot] == _FALLEN:
                _watch_lying(run, robot, group.controller, dt)
            elif limit is not None:
                tilted = float(run.engine.base(robot).rotation[2, 2]) < limit
                note_tilt(run, robot, dt if tilted else 0.0)


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
    elif lying - dt <= GIVE_UP < lying:
        run.note(robot, "lost")
