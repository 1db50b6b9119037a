"""What the motors of all robots follow until the next time: controllers, commands, and getting up."""

from __future__ import annotations

import numpy as np

from vico.sim.physics.engine import Actuate
from vico.sim.robots.path_follower import RobotStatus
from vico.sim.robots.rotors import Flight, FlightPhase
from vico.sim.robots.scene import RobotGroup
from vico.sim.robots.state import RobotMode, RobotRun

_MOTORS, _FALLEN = int(RobotMode.MOTORS), int(RobotStatus.FALLEN)
_LANDED = int(FlightPhase.LANDED)


def velocities(run: RobotRun, group: RobotGroup) -> np.ndarray | None:
    """Return what a kind of robots follow, shape ``(k, 3)``; None unless all of them follow velocities.

    It stays the same until the robots decide again, or somebody commands one.
    """
    arrays, robots = run.arrays, group.robots
    if np.any((arrays.status[robots] == _FALLEN) | (arrays.mode[robots] == _MOTORS)):
        return None
    return arrays.velocity[robots]


def follow_setpoints(run: RobotRun, flight: Flight, group: RobotGroup) -> bool:
    """Return whether all of a kind that flies are in the air and follow setpoints.

    It stays the same until the robots decide again, or somebody commands one.
    """
    arrays, robots = run.arrays, group.robots
    told = (arrays.status[robots] == _FALLEN) | (arrays.mode[robots] == _MOTORS)
    return not (told | (flight.arrays.phase == _LANDED)).any()


def command_rotors(
    run: RobotRun,
    flight: Flight,
    group: RobotGroup,
    memory: np.ndarray,
    seconds: float,
    *,
    all_follow: bool = False,
) -> None:
    """Tell the rotors of a kind of robots what speeds to have for some seconds; all that are in the air in one call.

    Parameters
    ----------
    memory
        What the group's controller remembers, shape ``(k, controller.memory)``; updated in place.
    all_follow
        As `follow_setpoints` has it.
    """
    arrays, robots, a = run.arrays, group.robots, flight.arrays
    if all_follow:
        a.wanted[:] = group.controller.rotor_speeds(run.engine.motion(robots), a.setpoint, memory, seconds)
        return
    fallen, motors = arrays.status[robots] == _FALLEN, arrays.mode[robots] == _MOTORS
    led = ~fallen & ~motors & (a.phase != _LANDED)
    rows = led.nonzero()[0]
    if len(rows):
        setpoint, mine = a.setpoint[rows], memory[rows]
        a.wanted[rows] = group.controller.rotor_speeds(run.engine.motion(robots[rows]), setpoint, mine, seconds)
        a.setpoint[rows], memory[rows] = setpoint, mine
    memory[~led] = 0.0
    a.wanted[~led] = 0.0
    told = motors & ~fallen
    a.wanted[told] = arrays.command[robots[told], : len(group.model.motors)]
    arrays.lying[robots[fallen]] += seconds


class AllRotors:
    """The rotors of all robots that fly, within a sub-step: who follows setpoints is decided between sub-steps.

    Rotors are told what to do, and push, before each of the solver's steps: a quadrotor cannot wait for the next frame.
    Rotors that stand, or come to a stop on the ground, are told once a frame.
    """

    def __init__(self, run: RobotRun) -> None:
        self._run, self._began = run, 0.0
        self._flown = [
            (flight, group, memory, follow_setpoints(run, flight, group))
            for group, memory, flight in zip(run.scene.groups, run.memory, run.flights, strict=True)
            if flight is not None
        ]
        self._in_the_air = any(flight.in_the_air for flight, *_ in self._flown)

    def begin_frame(self, seconds: float, frame: float) -> Actuate | None:
        """Return what the engine has to call within a frame; None: nobody is in the air.

        Parameters
        ----------
        seconds
            Since the start of the run.
        frame
            Its length, seconds.
        """
        for flight, *_ in self._flown:
            flight.begin_frame(self._run.engine)
        self._began = seconds
        if self._in_the_air:
            return self._actuate
        self._actuate(0.0, frame)
        return None

    def _actuate(self, since: float, step: float) -> None:
        """Let rotors follow their commands and push for a step that begins so many seconds into the frame."""
        for flight, group, memory, all_follow in self._flown:
            command_rotors(self._run, flight, group, memory, step, all_follow=all_follow)
            flight.push(self._run.engine, step, self._began + since)


def command_motors(run: RobotRun, group: RobotGroup, memory: np.ndarray, velocity: np.ndarray | None) -> None:
    """Tell the motors of a kind of robots what to follow for its period.

    The usual case, that all of them follow velocities, takes one call without copies.

    Parameters
    ----------
    memory
        What the group's controller remembers, shape ``(k, controller.memory)``; updated in place.
    velocity
        As `velocities` has it.
    """
    arrays, robots = run.arrays, group.robots
    if velocity is not None:
        targets = _as_held(run, robots, group.controller.targets(run.engine.motion(robots), velocity, memory))
        run.engine.command_all(robots, targets, group.controller.gains(memory))
        return
    fallen = arrays.status[robots] == _FALLEN
    led = ~fallen & (arrays.mode[robots] != _MOTORS)
    if led.any():
        _follow_velocities(run, group, memory, led.nonzero()[0])
    for row in (~led).nonzero()[0].tolist():
        robot = int(robots[row])
        if arrays.mode[robot] != _MOTORS or fallen[row]:
            memory[row] = 0.0
        lying = None
        if fallen[row]:
            lying = group.controller.lying_targets(float(arrays.lying[robot]), run.engine.base(robot))
            lift = group.controller.lift(float(arrays.lying[robot]), run.engine.base(robot), run.above_ground(robot))
            if lift is not None:
                run.engine.thrust(robot, lift[:1], lift[1][:1], lift[1][1:])
            arrays.lying[robot] += group.model.control_period
        if lying is not None:
            run.engine.command(robot, *lying)
        elif arrays.mode[robot] == _MOTORS:
            who, told = robots[row : row + 1], arrays.command[robot : robot + 1, : len(group.model.motors)]
            targets = group.controller.commanded(run.engine.motion(who), told, memory[row : row + 1])
            run.engine.command(robot, _as_held(run, who, targets)[0], group.controller.command_gains)
        else:
            run.engine.command(robot, group.model.stance)


def _as_held(run: RobotRun, robots: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """Return targets with fingers kept where they touch what is held by oracle."""
    return targets if run.oracle is None else run.oracle.spread(robots, targets)


def _follow_velocities(run: RobotRun, group: RobotGroup, memory: np.ndarray, rows: np.ndarray) -> None:
    """Have some of a kind's robots follow their velocities, all in one call."""
    robots, mine = group.robots[rows], memory[rows]
    targets = _as_held(
        run, robots, group.controller.targets(run.engine.motion(robots), run.arrays.velocity[robots], mine)
    )
    run.engine.command_all(robots, targets, group.controller.gains(mine))
    memory[rows] = mine
