"""Robots that fly: what their rotors and the air do to them, and what is left in their batteries."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled
from vico.sim.physics import PhysicsEngine
from vico.sim.robots.ways_of_many import OnTheirWays
from vico.sim.robots.wind import Gusts, air_at
from vico.world.heights import HeightField

AIR_DENSITY = 1.225
_STILL = 1e-3  # rad/s below which a rotor stands
#: Entries of a setpoint: position (ENU, metres), velocity (m/s), heading (rad) and turning (rad/s).
POSITION, VELOCITY, HEADING, TURNING, SETPOINT = slice(0, 3), slice(3, 6), 6, 7, 8


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
    def landed(cls, count: int, rotors: int) -> FlightArrays:
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
class Flight(OnTheirWays):
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
        self.arrays = FlightArrays.landed(len(self.robots), len(self.model.motors))
        self.ways = [self.no_way()] * len(self.robots)
        r = self.model.rotors
        assert r is not None
        self._lift = (r.thrust, r.moment, r.rotor_drag, 0.5 * AIR_DENSITY * r.drag_area)
        self._lags = (r.speed_up, r.slow_down)
        # Watts for each N^1.5 of a rotor's thrust: momentum theory.
        disc = 2.0 * AIR_DENSITY * math.pi * r.radius**2
        self._power = (1.0 / (math.sqrt(disc) * r.efficiency), r.idle_power, r.capacity)
        self._places, self._turns, self._site = r.places, r.turns, r.site

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
            (self._lift, self._lags, self._power, self._places, self._turns, self.gusts),
            (motion.position, motion.velocity, motion.rotation, above),
            (a.speed, a.wanted, a.turned, a.charge),
            a.wind,
            step,
            seconds,
        )
        engine.thrust_all(self.robots, self._site, wrenches)


@compiled
def _turn_rotors(row, rotors, lags, step):  # type: ignore[no-untyped-def]
    """Let the rotors of a robot follow their commands for a step; return the mean square of each one's speed."""
    speed, wanted, turned, charge = rotors
    squares = np.empty(speed.shape[1])
    for k in range(speed.shape[1]):
        before = speed[row, k]
        goal = wanted[row, k] if charge[row] > 0.0 else 0.0
        lag = lags[0] if goal > before else lags[1]
        after = goal + (before - goal) * math.exp(-step / lag)
        speed[row, k] = after if after > _STILL else 0.0
        turned[row, k] = (turned[row, k] + 0.5 * (before + after) * step) % (2.0 * math.pi)
        squares[k] = (before * before + before * after + after * after) / 3.0
    return squares


@compiled
def _push(body, squares, lift, places, turns, out):  # type: ignore[no-untyped-def]
    """Write force and torque on a robot, in its frame; return the sum of its rotors' thrusts to the power of 1.5.

    `body` is how the air moves past it, in its frame, m/s.
    """
    thrust_factor, moment, rotor_drag, drag = lift
    out[:] = 0.0
    work = 0.0
    for k in range(len(squares)):
        thrust = thrust_factor * squares[k]
        work += thrust**1.5
        speed = math.sqrt(squares[k])
        x, y, z = places[k]
        fx, fy = rotor_drag * speed * body[0], rotor_drag * speed * body[1]
        out[0] += fx
        out[1] += fy
        out[2] += thrust
        out[3] += y * thrust - z * fy
        out[4] += z * fx - x * thrust
        out[5] += x * fy - y * fx - turns[k] * moment * thrust
    size = math.sqrt(body[0] ** 2 + body[1] ** 2 + body[2] ** 2)
    for k in range(3):
        out[k] += drag * size * body[k]
    return work


@compiled
def _push_all(settings, motion, rotors, wind, step, seconds):  # type: ignore[no-untyped-def]
    """Let rotors turn and batteries drain for a step; return forces and torques on all robots, shape ``(k, 6)``."""
    lift, lags, power, places, turns, gusts = settings
    position, velocity, rotation, above = motion
    charge = rotors[3]
    out, air, body = np.empty((len(position), 6)), np.empty(3), np.empty(3)
    for row in range(len(position)):
        squares = _turn_rotors(row, rotors, lags, step)
        air_at(gusts, wind, position[row], above[row], seconds, air)
        past = air - velocity[row]
        for k in range(3):
            body[k] = rotation[row, 0, k] * past[0] + rotation[row, 1, k] * past[1] + rotation[row, 2, k] * past[2]
        work = _push(body, squares, lift, places, turns, out[row])
        drawn = power[0] * work + (power[1] if work > 0.0 else 0.0)
        charge[row] = max(0.0, charge[row] - drawn * step / power[2])
    return out
