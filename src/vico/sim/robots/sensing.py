"""What robots feel of themselves: the sensors that their models name, and the shapes of what those give."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import RobotModel
from vico.sim.robots.batteries import charge_of
from vico.sim.robots.flying import flight_of
from vico.sim.robots.path_follower import RobotStatus
from vico.sim.robots.rotors import Flight
from vico.sim.robots.state import RobotRun


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


def observation(run: RobotRun, robot: int) -> dict[str, NDArray[Any]]:
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
        angles, speeds = run.engine.joints(robot) if flown is None else _rotors(*flown)
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


def _rotors(flight: Flight, row: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return angles and speeds of a robot's rotors, rad and rad/s, positive to the left seen from above."""
    rotors = flight.model.rotors
    assert rotors is not None
    return flight.arrays.turned[row] * rotors.turns, flight.arrays.speed[row] * rotors.turns
