"""What the motors of all robots follow until the next time: controllers, commands, and getting up."""

from __future__ import annotations

import numpy as np

from vico.sim.robots.path_follower import RobotStatus
from vico.sim.robots.scene import Group
from vico.sim.robots.state import Mode, RobotRun

_MOTORS, _FALLEN = int(Mode.MOTORS), int(RobotStatus.FALLEN)


def command_motors(run: RobotRun, group: Group, memory: np.ndarray) -> None:
    """Tell the motors of a kind of robots what to follow for its period.

    Parameters
    ----------
    memory
        What the group's controller remembers, shape ``(k, controller.memory)``; updated in place.
    """
    arrays, robots = run.arrays, group.robots
    fallen = arrays.status[robots] == _FALLEN
    commanded = ~fallen & (arrays.mode[robots] == _MOTORS)
    led = np.flatnonzero(~fallen & ~commanded)
    if len(led):
        _follow_velocities(run, group, memory, led)
    for row in np.flatnonzero(fallen | commanded).tolist():
        memory[row] = 0.0
        robot = int(robots[row])
        lying = None
        if fallen[row]:
            lying = group.controller.lying_targets(float(arrays.lying[robot]), run.engine.base(robot))
            arrays.lying[robot] += group.model.control_period
        if lying is not None:
            run.engine.command(robot, *lying)
        elif arrays.mode[robot] == _MOTORS:
            targets = arrays.command[robot, : len(group.model.motors)]
            run.engine.command(robot, targets, group.controller.command_gains)
        else:
            run.engine.command(robot, group.model.stance)


def _follow_velocities(run: RobotRun, group: Group, memory: np.ndarray, rows: np.ndarray) -> None:
    """Have robots follow their velocities, all in one call."""
    everyone = len(rows) == len(group.robots)
    robots = group.robots if everyone else group.robots[rows]
    mine = memory if everyone else memory[rows]
    targets = group.controller.targets(run.engine.motion(robots), run.arrays.velocity[robots], mine)
    run.engine.command_all(robots, targets, group.controller.gains(mine))
    if not everyone:
        memory[rows] = mine
