"""Quadrotors: the flight controller, rotors and the air around them, batteries in flight, wind and gusts.

The controller is a cascade: position, velocity, attitude, rates, rotors. Thrust that the rotors cannot give goes first
from turning, then from keeping up, and last from tilting: a robot that cannot tilt tumbles. Gains are PX4's defaults
where those have units, and otherwise follow from the rotors' lag.

Wind is stronger further up. Gusts are frozen turbulence that the mean wind carries along: a sum of waves with lengths
from a metre to hundreds, of amplitudes after Dryden's spectrum, with phases by the seed. So they have no state, and two
robots side by side feel much the same.

References
----------
US Department of Defense: MIL-F-8785C (1980), Dryden's spectra. Intensities here are 0.2 of the mean wind along and
across it and 0.1 upwards, and lengths 60 m and 20 m, as usual a few tens of metres above a town; both are rounded.
Wind by height: power law with the exponent 0.25 of towns, from the 10 m above ground that weather is told for.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import Quadrotor, RobotModel
from vico.io.compiled import compiled
from vico.seeds import rng
from vico.sim.physics import PhysicsEngine
from vico.sim.physics.records import Motion
from vico.sim.robots.controller import Array, MotorController
from vico.sim.robots.path_following import WaypointFollowers
from vico.world.heights import HeightField

_EXPONENT = 0.25  # of the power law by which wind grows with height: of towns
_REFERENCE = 10.0  # m above ground that weather is told for
_LOWEST = 1.0  # m above ground below which wind grows no weaker
_INTENSITY, _LENGTH = (0.2, 0.2, 0.1), (60.0, 60.0, 20.0)
_WAVES = 12


class Gusts(NamedTuple):
    """Waves of frozen turbulence; along the mean wind, across it to the left, and up.

    Attributes
    ----------
    number
        Radians a metre, shape ``(waves,)``.
    amplitude
        Shares of the mean wind, shape ``(3, waves)``.
    phase
        Radians, shape ``(3, waves)``.
    slant
        How much of each wave's number is across the wind, shape ``(waves,)``.
    """

    number: NDArray[np.float64]
    amplitude: NDArray[np.float64]
    phase: NDArray[np.float64]
    slant: NDArray[np.float64]


def gusts_of(seed: int) -> Gusts:
    """Return the gusts of a run."""
    stream = rng(seed, "gusts")
    edges = np.geomspace(2 * math.pi / 600.0, 2 * math.pi / 1.5, _WAVES + 1)
    number, width = np.sqrt(edges[1:] * edges[:-1]), np.diff(edges)
    amplitude = np.zeros((3, _WAVES))
    for k in range(3):
        scaled = _LENGTH[k] * number
        # Power by wave number, of variance 1; along the wind, and across and up.
        along, aside = 1.0 / (1.0 + scaled**2), (1.0 + 3.0 * scaled**2) / (1.0 + scaled**2) ** 2
        power = 2.0 * _LENGTH[k] / math.pi * along if k == 0 else _LENGTH[k] / math.pi * aside
        amplitude[k] = _INTENSITY[k] * np.sqrt(2.0 * power * width)
    phase = stream.uniform(0.0, 2.0 * math.pi, (3, _WAVES))
    return Gusts(number, amplitude, phase, stream.uniform(-0.5, 0.5, _WAVES))


@compiled
def air_at(gusts, mean, position, above, seconds, out):
    """Write how the air moves, m/s, ENU.

    Parameters
    ----------
    mean
        Mean wind 10 m above ground, m/s towards east and north.
    position, above
        Where, ENU metres, and how far above ground.
    seconds
        Since the start of the run.
    """
    speed = math.hypot(mean[0], mean[1])
    out[0] = out[1] = out[2] = 0.0
    if speed < 1e-6:
        return
    grown = speed * (max(above, _LOWEST) / _REFERENCE) ** _EXPONENT
    e, n = mean[0] / speed, mean[1] / speed
    along = position[0] * e + position[1] * n - speed * seconds
    across = position[1] * e - position[0] * n
    felt = np.zeros(3)
    felt[0] = 1.0
    for w in range(len(gusts.number)):
        turn = gusts.number[w] * (along + gusts.slant[w] * across)
        for k in range(3):
            felt[k] += gusts.amplitude[k, w] * math.sin(turn + gusts.phase[k, w])
    out[0] = grown * (felt[0] * e - felt[1] * n)
    out[1] = grown * (felt[0] * n + felt[1] * e)
    out[2] = grown * felt[2]


AIR_DENSITY = 1.225
_STILL = 1e-3  # rad/s below which a rotor stands
# Entries of a setpoint.
POSITION = slice(0, 3)  # ENU, m
VELOCITY = slice(3, 6)  # ENU, m/s
VELOCITY_UP = 5  # the last of these
HEADING = 6  # rad
TURNING = 7  # rad/s
SETPOINT = 8  # how many there are


class FlightPhase(IntEnum):
    """What a robot that flies is about."""

    LANDED, FLYING, LANDING = range(3)


@dataclass
class FlightArrays:
    """What changes of the robots of a kind that flies; row = robot of that kind.

    Attributes
    ----------
    speed, wanted
        Of the rotors, rad/s, and what they are commanded to have, float64, shape ``(k, rotors)``.
    turned
        Radians that the rotors have turned, float64, shape ``(k, rotors)``.
    charge
        How full the battery is, 0..1, float64, shape ``(k,)``.
    setpoint
        What the controller follows, as `POSITION`, `VELOCITY`, `HEADING` and `TURNING` say; float64, shape ``(k, 8)``.
    phase
        A `FlightPhase`, int8, shape ``(k,)``.
    leg
        Which corner of its way it flies to, int64, shape ``(k,)``.
    lands
        Whether it lands where its way ends, bool, shape ``(k,)``.
    calm
        Seconds for which it has not sunk while landing, float64, shape ``(k,)``.
    held
        Seconds for which it has got no nearer to its corner, and how near it came, metres; float64, shape ``(k, 2)``.
    warned
        Whether it has said that its battery is low, bool, shape ``(k,)``.
    wind
        Mean wind 10 m above ground, m/s towards east and north, float64, shape ``(2,)``.
    """

    speed: NDArray[np.float64]
    wanted: NDArray[np.float64]
    turned: NDArray[np.float64]
    charge: NDArray[np.float64]
    setpoint: NDArray[np.float64]
    phase: NDArray[np.int8]
    leg: NDArray[np.int64]
    lands: NDArray[np.bool_]
    calm: NDArray[np.float64]
    held: NDArray[np.float64]
    warned: NDArray[np.bool_]
    wind: NDArray[np.float64]

    @classmethod
    def on_ground(cls, count: int, rotors: int) -> FlightArrays:
        """Robots on the ground with full batteries."""
        return cls(
            speed=np.zeros((count, rotors)),
            wanted=np.zeros((count, rotors)),
            turned=np.zeros((count, rotors)),
            charge=np.ones(count),
            setpoint=np.zeros((count, SETPOINT)),
            phase=np.zeros(count, np.int8),
            leg=np.zeros(count, np.int64),
            lands=np.zeros(count, np.bool_),
            calm=np.zeros(count),
            held=np.zeros((count, 2)),
            warned=np.zeros(count, np.bool_),
            wind=np.zeros(2),
        )


@dataclass
class Flight(WaypointFollowers):
    """The robots of a kind that flies.

    Attributes
    ----------
    model
        Their model.
    robots
        Their indices, int64, shape ``(k,)``.
    ground
        Heights of the ground.
    gusts
        Of the run.
    arrays
        What changes.
    ways
        Corners of the way that each flies, ENU metres, shape ``(m, 3)``.
    """

    width = 3

    ground: HeightField
    gusts: Gusts
    arrays: FlightArrays = field(init=False)

    def __post_init__(self) -> None:
        self.arrays = FlightArrays.on_ground(len(self.robots), len(self.model.motors))
        self.ways = [self.no_way()] * len(self.robots)
        r = self.model.rotors
        assert r is not None
        # Watts for each N^1.5 of a rotor's thrust: momentum theory.
        watts = 1.0 / (math.sqrt(2.0 * AIR_DENSITY * math.pi * r.radius**2) * r.efficiency)
        drag = 0.5 * AIR_DENSITY * r.drag_area
        self._rotors = _RotorSettings(
            r.thrust, r.moment, r.rotor_drag, drag, r.speed_up, r.slow_down, watts, r.idle_power, r.capacity, r.places,
            r.turns,
        )  # fmt: skip
        self._site = r.site

    @property
    def in_the_air(self) -> bool:
        """Whether any of them flies."""
        return bool((self.arrays.phase != FlightPhase.LANDED).any())

    def begin_frame(self, engine: PhysicsEngine) -> None:
        """Look up the ground below: it does not change much within a frame."""
        self._below = self.ground(engine.motion(self.robots).position)

    def push(self, engine: PhysicsEngine, step: float, seconds: float) -> None:
        """Let rotors and air push for a step that begins so many seconds after the start of the run."""
        a, motion = self.arrays, engine.motion(self.robots)
        above = motion.position[:, 2] - self._below
        wrenches = _push_all(
            self._rotors,
            self.gusts,
            (motion.position, motion.velocity, motion.rotation, above),
            (a.speed, a.wanted, a.turned, a.charge),
            a.wind,
            step,
            seconds,
        )
        engine.thrust_all(self.robots, self._site, wrenches)


class _RotorSettings(NamedTuple):
    """What rotors, airframe and battery of a kind are like, as compiled code takes it; see `RotorModel`.

    Attributes
    ----------
    drag
        Of the whole robot, newtons for each (m/s)^2.
    watts
        For each N^1.5 of a rotor's thrust.
    """

    thrust: float
    moment: float
    rotor_drag: float
    drag: float
    speed_up: float
    slow_down: float
    watts: float
    idle_power: float
    capacity: float
    places: Array
    turns: Array


@compiled
def _turn_rotors(settings, row, rotors, step):
    """Let the rotors of a robot follow their commands for a step; return the mean square of each one's speed."""
    speed, wanted, turned, charge = rotors
    squares = np.empty(speed.shape[1])
    for k in range(speed.shape[1]):
        before = speed[row, k]
        goal = wanted[row, k] if charge[row] > 0.0 else 0.0
        lag = settings.speed_up if goal > before else settings.slow_down
        after = goal + (before - goal) * math.exp(-step / lag)
        speed[row, k] = after if after > _STILL else 0.0
        turned[row, k] = (turned[row, k] + 0.5 * (before + after) * step) % (2.0 * math.pi)
        squares[k] = (before * before + before * after + after * after) / 3.0
    return squares


@compiled
def _push(settings, body, squares, out):
    """Write force and torque on a robot, in its frame; return the sum of its rotors' thrusts to the power of 1.5.

    `body` is how the air moves past it, in its frame, m/s.
    """
    out[:] = 0.0
    force, torque = out[:3], out[3:]
    work = 0.0
    for k in range(len(squares)):
        thrust = settings.thrust * squares[k]
        work += thrust**1.5
        speed = math.sqrt(squares[k])
        x, y, z = settings.places[k]
        fx, fy = settings.rotor_drag * speed * body[0], settings.rotor_drag * speed * body[1]
        force[0] += fx
        force[1] += fy
        force[2] += thrust
        torque[0] += y * thrust - z * fy
        torque[1] += z * fx - x * thrust
        torque[2] += x * fy - y * fx - settings.turns[k] * settings.moment * thrust
    size = math.sqrt(body[0] ** 2 + body[1] ** 2 + body[2] ** 2)
    for k in range(3):
        force[k] += settings.drag * size * body[k]
    return work


@compiled
def _push_all(settings, gusts, motion, rotors, wind, step, seconds):
    """Let rotors turn and batteries drain for a step; return forces and torques on all robots, shape ``(k, 6)``."""
    position, velocity, rotation, above = motion
    charge = rotors[3]
    out, air, body = np.empty((len(position), 6)), np.empty(3), np.empty(3)
    for row in range(len(position)):
        squares = _turn_rotors(settings, row, rotors, step)
        air_at(gusts, wind, position[row], above[row], seconds, air)
        past = air - velocity[row]
        for k in range(3):
            body[k] = rotation[row, 0, k] * past[0] + rotation[row, 1, k] * past[1] + rotation[row, 2, k] * past[2]
        work = _push(settings, body, squares, out[row])
        drawn = settings.watts * work + (settings.idle_power if work > 0.0 else 0.0)
        charge[row] = max(0.0, charge[row] - drawn * step / settings.capacity)
    return out


_GRAVITY = 9.81  # m/s^2
# Gains of errors, 1/s; where there are two, sideways and up.
_POSITION = (0.95, 1.0)
_VELOCITY = (2.2, 4.0)
_ATTITUDE = 6.5
_HEADING_GAIN = 2.8
_RATE = 18.0
_RATE_YAW = 6.0
_INTEGRAL = (0.8, 1.5)  # of a velocity's error, 1/s^2
_MOST_INTEGRAL = 7.0  # m/s^2
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
def _follow(frame, seconds, motion, setpoint, integral, wanted):
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
def _attitude(frame, acceleration, heading, out):
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
def _torque(frame, rotation, rates, wanted, turning, out):
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
def _room(base, change, low, high):
    """Return the largest share, 0..1, of a change that keeps all of `base` plus it within bounds."""
    share = 1.0
    for k in range(len(base)):
        if change[k] > 1e-12:
            share = min(share, max(0.0, (high - base[k]) / change[k]))
        elif change[k] < -1e-12:
            share = min(share, max(0.0, (low - base[k]) / change[k]))
    return share


@compiled
def _mix(frame, thrust, torque, out):
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
def _fly_all(frame, seconds, motion, setpoints, memory):
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
    """Follows positions and velocities; its commands are setpoints (`vico.sim.robots.quadrotor.FlightArrays`).

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
