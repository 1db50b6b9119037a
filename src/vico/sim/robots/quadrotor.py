"""Four rotors: from where a robot should be to the speeds of its rotors, of all robots of a kind at once.

A cascade: position, velocity, attitude, rates, rotors. Thrust that the rotors cannot give goes first from turning, then
from keeping up, and last from tilting: who can't tilt tumbles. Gains are PX4's defaults where those have units, and
otherwise follow from the rotors' lag.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import Quadrotor, RobotModel
from vico.io.compiled import compiled
from vico.sim.physics.records import Motion
from vico.sim.robots.controller import Array, MotorController
from vico.sim.robots.rotors import HEADING, SETPOINT, TURNING

_GRAVITY = 9.81
# 1/s of a position's, a velocity's, an attitude's, a heading's and a rate's error; 1/s^2 of a velocity's integral.
_POSITION, _VELOCITY, _ATTITUDE, _HEADING_GAIN, _RATE, _RATE_YAW = (0.95, 1.0), (2.2, 4.0), 6.5, 2.8, 18.0, 6.0
_INTEGRAL, _MOST_INTEGRAL = (0.8, 1.5), 7.0
# Metres that what is followed may be ahead of the robot, and that it flies to as fast as it can at the most.
_LEASH = 1.5
_FASTEST_RATE = 4.0  # rad/s
_LEAST, _MOST = 0.02, 0.97  # shares of a rotor's thrust that are used


class Airframe(NamedTuple):
    """What the controller knows of a robot.

    Attributes
    ----------
    mass, inertia
        Kg, and kg m^2 about its axes.
    tilt
        The most it tilts, radians.
    reach
        Fastest sideways and upwards, m/s.
    places, turns, thrust, moment
        Of the rotors, as `vico.assets.robots.RotorModel`.
    fastest
        Of the rotors, rad/s.
    """

    mass: float
    inertia: NDArray[np.float64]
    tilt: float
    reach: NDArray[np.float64]
    places: NDArray[np.float64]
    turns: NDArray[np.float64]
    thrust: float
    moment: float
    fastest: float


@compiled
def _follow(frame, seconds, motion, setpoint, integral, wanted):  # type: ignore[no-untyped-def]
    """Move what is followed on by some seconds, and write the acceleration that follows it."""
    position, velocity = motion
    for k in range(3):
        axis = 0 if k < 2 else 1
        if setpoint[3 + k] != 0.0:
            ahead = setpoint[k] + setpoint[3 + k] * seconds - position[k]
            setpoint[k] = position[k] + min(max(ahead, -_LEASH), _LEASH)
        speed = setpoint[3 + k] + _POSITION[axis] * (setpoint[k] - position[k])
        limit = frame.reach[axis]
        missing = min(max(speed, -limit), limit) - velocity[k]
        integral[k] = min(max(integral[k] + _INTEGRAL[axis] * missing * seconds, -_MOST_INTEGRAL), _MOST_INTEGRAL)
        wanted[k] = _VELOCITY[axis] * missing + integral[k]
    setpoint[HEADING] += setpoint[TURNING] * seconds


@compiled
def _attitude(frame, acceleration, heading, out):  # type: ignore[no-untyped-def]
    """Write the rotation that pushes along an acceleration beside gravity's; return the thrust, newtons."""
    up = acceleration[2] + _GRAVITY
    up = max(up, 0.3 * _GRAVITY)
    ax, ay = acceleration[0], acceleration[1]
    aside = math.hypot(ax, ay)
    most = up * math.tan(frame.tilt)
    if aside > most:
        ax, ay = ax * most / aside, ay * most / aside
    size = math.sqrt(ax * ax + ay * ay + up * up)
    zx, zy, zz = ax / size, ay / size, up / size
    c, s = math.cos(heading), math.sin(heading)
    # y = z x heading, x = y x z
    yx, yy, yz = -zz * s, zz * c, zx * s - zy * c
    norm = math.sqrt(yx * yx + yy * yy + yz * yz)
    yx, yy, yz = yx / norm, yy / norm, yz / norm
    out[0, 0], out[1, 0], out[2, 0] = yy * zz - yz * zy, yz * zx - yx * zz, yx * zy - yy * zx
    out[0, 1], out[1, 1], out[2, 1] = yx, yy, yz
    out[0, 2], out[1, 2], out[2, 2] = zx, zy, zz
    return frame.mass * size


@compiled
def _torque(frame, rotation, rates, wanted, turning, out):  # type: ignore[no-untyped-def]
    """Write the torque, Nm in the robot's frame, that turns it towards an attitude."""
    error = np.zeros(3)
    for i in range(3):
        # Half the antisymmetric part of rotation^T wanted.
        error[0] += 0.5 * (rotation[i, 2] * wanted[i, 1] - rotation[i, 1] * wanted[i, 2])
        error[1] += 0.5 * (rotation[i, 0] * wanted[i, 2] - rotation[i, 2] * wanted[i, 0])
        error[2] += 0.5 * (rotation[i, 1] * wanted[i, 0] - rotation[i, 0] * wanted[i, 1])
    for k in range(3):
        gain, rate_gain = (_ATTITUDE, _RATE) if k < 2 else (_HEADING_GAIN, _RATE_YAW)
        rate = gain * error[k] + (turning * rotation[2, k])
        rate = min(max(rate, -_FASTEST_RATE), _FASTEST_RATE)
        out[k] = frame.inertia[k] * rate_gain * (rate - rates[k])
    # What turning about one axis does to the others.
    jx, jy, jz = frame.inertia
    out[0] += (jz - jy) * rates[1] * rates[2]
    out[1] += (jx - jz) * rates[2] * rates[0]
    out[2] += (jy - jx) * rates[0] * rates[1]


@compiled
def _room(base, change, low, high):  # type: ignore[no-untyped-def]
    """Return the largest share, 0..1, of a change that keeps all of `base` plus it within bounds."""
    share = 1.0
    for k in range(len(base)):
        if change[k] > 1e-12:
            share = min(share, max(0.0, (high - base[k]) / change[k]))
        elif change[k] < -1e-12:
            share = min(share, max(0.0, (low - base[k]) / change[k]))
    return share


@compiled
def _mix(frame, thrust, torque, out):  # type: ignore[no-untyped-def]
    """Write the rotor speeds, rad/s, that give a torque that tilts (Nm), a thrust (N) and a torque that turns.

    As much of each as there is room for beside the one before.
    """
    count = len(out)
    high = frame.thrust * frame.fastest**2
    low, high = _LEAST * high, _MOST * high
    forces, change = np.empty(count), np.empty(count)
    xx = yy = 0.0
    for k in range(count):
        xx += frame.places[k, 0] ** 2
        yy += frame.places[k, 1] ** 2
    largest = 0.0
    for k in range(count):
        change[k] = torque[0] * frame.places[k, 1] / yy - torque[1] * frame.places[k, 0] / xx
        largest = max(largest, abs(change[k]))
    largest = min(largest, 0.5 * (high - low))
    for k in range(count):
        forces[k] = min(max(thrust / count, low + largest), high - largest)
    share = _room(forces, change, low, high)
    for k in range(count):
        forces[k] += share * change[k]
        change[k] = -torque[2] * frame.turns[k] / (frame.moment * count)
    share = _room(forces, change, low, high)
    for k in range(count):
        out[k] = math.sqrt((forces[k] + share * change[k]) / frame.thrust)


@compiled
def _fly_all(frame, seconds, motion, setpoints, memory):  # type: ignore[no-untyped-def]
    """Return rotor speeds of all robots, rad/s, shape ``(k, rotors)``."""
    position, velocity, rotation, rates = motion
    out = np.empty((len(setpoints), len(frame.turns)))
    acceleration, attitude, torque = np.empty(3), np.empty((3, 3)), np.empty(3)
    for k in range(len(setpoints)):
        setpoint = setpoints[k]
        _follow(frame, seconds, (position[k], velocity[k]), setpoint, memory[k], acceleration)
        thrust = _attitude(frame, acceleration, setpoint[HEADING], attitude)
        # Tilted more or less than it should be, it pushes up as much as it should.
        upright = 0.0
        for i in range(3):
            upright += rotation[k, i, 2] * attitude[i, 2]
        _torque(frame, rotation[k], rates[k], attitude, setpoint[TURNING], torque)
        _mix(frame, thrust * max(upright, 0.0), torque, out[k])
    return out


class FourRotors(MotorController):
    """Follows positions and velocities; its commands are setpoints (`vico.sim.robots.rotors.FlightArrays`).

    Remembers the integral of what is missing of the velocity: what it takes against wind.
    """

    memory = 3

    def __init__(self, model: RobotModel) -> None:
        super().__init__(model)
        settings, rotors, reach = model.controller, model.rotors, model.velocity_limit
        assert isinstance(settings, Quadrotor)
        assert rotors is not None
        assert reach is not None
        self._frame = Airframe(
            settings.mass,
            settings.inertia,
            settings.tilt,
            # Faster than what it is told, to catch up in wind.
            1.25 * np.array([reach[0], reach[2]]),
            rotors.places,
            rotors.turns,
            rotors.thrust,
            rotors.moment,
            float(model.motor_limits[1].min()),
        )

    def rotor_speeds(self, motion: Motion, setpoints: Array, memory: Array, seconds: float) -> Array:
        """Rotor speeds that follow setpoints, which move on by so many seconds."""
        assert setpoints.shape[1] == SETPOINT
        state = (motion.position, motion.velocity, motion.rotation, motion.angular_velocity_body)
        found: Array = _fly_all(self._frame, seconds, state, setpoints, memory)
        return found
