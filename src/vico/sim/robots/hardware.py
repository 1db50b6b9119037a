"""Hardware of robots: what motors follow, what sensors give, and what is left in batteries.

Motors follow controllers, motor commands, or the motions of getting up. Sensors are those that models name. Batteries
drain by what motors do, and are exchanged when they are low or empty.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import BatteryModel, RobotModel
from vico.exact import dot
from vico.sim.physics.engine import Actuate
from vico.sim.robots import commands
from vico.sim.robots.flying import LOW_BATTERY, flight_of
from vico.sim.robots.path_following import RobotStatus
from vico.sim.robots.quadrotor import Flight, FlightPhase
from vico.sim.robots.scene import RobotGroup
from vico.sim.robots.state import RobotMode, RobotRun

_MOTORS, _FALLEN = int(RobotMode.MOTORS), int(RobotStatus.FALLEN)


def commanded_velocities(run: RobotRun, group: RobotGroup) -> np.ndarray | None:
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
            arrays, robots, a = self._run.arrays, group.robots, flight.arrays
            motion = self._run.engine.motion
            if all_follow:
                a.wanted[:] = group.controller.rotor_speeds(motion(robots), a.setpoint, memory, step)
            else:
                fallen, motors = arrays.status[robots] == _FALLEN, arrays.mode[robots] == _MOTORS
                led = ~fallen & ~motors & (a.phase != _LANDED)
                rows = led.nonzero()[0]
                if len(rows):
                    setpoint, mine = a.setpoint[rows], memory[rows]
                    a.wanted[rows] = group.controller.rotor_speeds(motion(robots[rows]), setpoint, mine, step)
                    a.setpoint[rows], memory[rows] = setpoint, mine
                memory[~led] = 0.0
                a.wanted[~led] = 0.0
                told = motors & ~fallen
                a.wanted[told] = arrays.command[robots[told], : len(group.model.motors)]
                arrays.lying[robots[fallen]] += step
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
        rows = led.nonzero()[0]
        who, mine = robots[rows], memory[rows]
        targets = group.controller.targets(run.engine.motion(who), arrays.velocity[who], mine)
        run.engine.command_all(who, _as_held(run, who, targets), group.controller.gains(mine))
        memory[rows] = mine
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
            targets = group.controller.command_targets(run.engine.motion(who), told, memory[row : row + 1])
            run.engine.command(robot, _as_held(run, who, targets)[0], group.controller.command_gains)
        else:
            run.engine.command(robot, group.model.stance)


def _as_held(run: RobotRun, robots: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """Return targets with fingers kept where they touch what is held by oracle."""
    return targets if run.oracle is None else run.oracle.spread(robots, targets)


#: Seconds that a robot stands with a low or empty battery until somebody, who is not shown, has put in a full one.
EXCHANGE = 600.0
_IDLE, _LANDED = int(RobotMode.IDLE), int(FlightPhase.LANDED)


def charge_of(run: RobotRun, robot: int) -> float:
    """Return how full a robot's battery is, 0..1; 1 for robots whose battery nobody keeps account of."""
    flown = flight_of(run, robot)
    return float(run.arrays.charge[robot] if flown is None else flown[0].arrays.charge[flown[1]])


def watch_batteries(run: RobotRun, dt: float) -> None:
    """Let batteries drain for `dt` seconds by what the motors do now; stop who has an empty one, and exchange it."""
    arrays = run.arrays
    for robot, model in enumerate(run.scene.models):
        if model.battery is None:
            continue
        before = float(arrays.charge[robot])
        if before == 0.0:
            if arrays.mode[robot] != _IDLE:
                commands.stop(run, robot)
            _exchange(run, robot, dt)
            continue
        after = max(0.0, before - _power(run, robot, model, model.battery) * dt / model.battery.capacity)
        arrays.charge[robot] = after
        if before > LOW_BATTERY >= after:
            run.note(robot, "battery_low")
        if after == 0.0:
            run.note(robot, "battery_empty")
            commands.stop(run, robot)
        if after <= LOW_BATTERY and arrays.mode[robot] == _IDLE:
            _exchange(run, robot, dt)
        else:
            arrays.uncharged[robot] = 0.0
    for flight in run.flights:
        if flight is not None:
            a = flight.arrays
            for row, robot in enumerate(flight.robots.tolist()):
                if a.charge[row] <= LOW_BATTERY and a.phase[row] == _LANDED:
                    _exchange(run, robot, dt)
                else:
                    arrays.uncharged[robot] = 0.0


def _exchange(run: RobotRun, robot: int, dt: float) -> None:
    """Wait for a full battery, and put it in when the time has come."""
    arrays = run.arrays
    arrays.uncharged[robot] += dt
    if arrays.uncharged[robot] < EXCHANGE - 1e-6:
        return
    arrays.uncharged[robot] = 0.0
    flown = flight_of(run, robot)
    if flown is None:
        arrays.charge[robot] = 1.0
    else:
        flight, row = flown
        flight.arrays.charge[row], flight.arrays.warned[row] = 1.0, False
    run.note(robot, "recharged")


def _power(run: RobotRun, robot: int, model: RobotModel, battery: BatteryModel) -> float:
    """Return the watts that a robot takes out of its battery now."""
    forces = run.engine.motor_forces(robot).tolist()
    speeds = dict(zip(model.joints, run.engine.joints(robot)[1].tolist(), strict=True))
    work = heat = 0.0
    for motor, unit, force in zip(model.motors, model.motor_units, forces, strict=True):
        speed = speeds.get(motor)
        if speed is None:
            # A motor without a joint of its own turns the base, or drives it ahead.
            base = run.engine.base(robot)
            turns = unit == "rad/s"
            speed = float(base.angular_velocity_body[2] if turns else dot(base.rotation[:, 0], base.velocity))
        else:
            heat += force * force
        # Motors that are pushed back feed nothing into the battery.
        work += max(force * speed, 0.0)
    return battery.idle_power + work / battery.efficiency + battery.holding * heat


class Reading(NamedTuple):
    """What one reading of a sensor looks like: an array of a shape, with bounds."""

    shape: tuple[int, ...]
    low: float
    high: float
    dtype: Any = np.float64


def readings_of(model: RobotModel) -> dict[str, Reading]:
    """Return what a kind of robot feels, by name; see `observation`."""
    s, endless = model.sensors, float("inf")
    found = {"fallen": Reading((1,), 0, 1, np.int8)}
    if s.joints:
        count = len(model.motors if model.rotors else model.joints)
        found["joint_position"] = found["joint_velocity"] = Reading((count,), -endless, endless)
    if s.imu:
        found["angular_velocity"] = Reading((3,), -endless, endless)
        found["specific_force"] = Reading((3,), -endless, endless)
        found["gravity"] = Reading((3,), -1.001, 1.001)
    if s.odometry:
        found["base_pose"] = Reading((7,), -endless, endless)
        found["base_velocity"] = Reading((3,), -endless, endless)
    if s.rotors:
        found["rotor_speed"] = Reading((len(model.motors),), 0.0, endless)
    if s.battery:
        found["battery"] = Reading((1,), 0.0, 1.0)
    if s.contacts:
        found["contacts"] = Reading((len(s.contacts),), 0.0, endless)
    return found


def proprioception(run: RobotRun, robot: int) -> dict[str, NDArray[Any]]:
    """Return what a robot feels of itself, as `readings_of` its model says.

    Returns
    -------
    dict
        ``fallen`` (0 or 1); of joints ``joint_position`` and ``joint_velocity`` (rad, rad/s, order of the model's
        joints; of what flies, of its rotors in the order of the motors, to the left seen from above); of the IMU, in
        the base's frame, ``angular_velocity`` (rad/s), ``specific_force`` (acceleration without gravity's, m/s2: 9.81
        upwards at rest) and ``gravity`` (its direction); of odometry ``base_pose`` (x, y, z, quaternion w, x, y, z)
        and ``base_velocity`` (ENU, m/s); ``rotor_speed`` (rad/s, in the order of the motors); ``battery``, how full it
        is, 0..1; ``contacts``, newtons on each link that feels.
    """
    s, base = run.scene.models[robot].sensors, run.engine.base(robot)
    found: dict[str, NDArray[Any]] = {
        "fallen": np.array([run.arrays.status[robot] == RobotStatus.FALLEN], np.int8),
    }
    flown = flight_of(run, robot)
    if s.joints:
        if flown is None:
            angles, speeds = run.engine.joints(robot)
        else:  # those of its rotors, positive to the left seen from above
            flight, row = flown
            assert flight.model.rotors is not None
            turns = flight.model.rotors.turns
            angles, speeds = flight.arrays.turned[row] * turns, flight.arrays.speed[row] * turns
        found["joint_position"], found["joint_velocity"] = np.array(angles), np.array(speeds)
    if s.imu:
        imu = run.engine.imu(robot)
        found["angular_velocity"], found["specific_force"] = imu.angular_velocity, imu.specific_force
        found["gravity"] = -base.rotation[2]
    if s.odometry:
        found["base_pose"] = np.concatenate([base.position, base.quaternion])
        found["base_velocity"] = base.velocity.copy()
    if s.rotors and flown is not None:
        found["rotor_speed"] = flown[0].arrays.speed[flown[1]].copy()
    if s.battery:
        found["battery"] = np.array([charge_of(run, robot)])
    if s.contacts:
        links = run.engine.link_names(robot)
        forces = run.engine.contacts().link_forces(robot, len(links))
        found["contacts"] = forces[[links.index(link) for link in s.contacts]]
    return found
