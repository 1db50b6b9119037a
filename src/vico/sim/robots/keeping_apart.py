"""Keeping robots that fly apart from whoever is below and from each other, inside the world, and not too high."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vico.geometry import distances
from vico.sim.bodies import Bodies
from vico.sim.robots.airspace import BESIDE, CEILING
from vico.sim.robots.path_follower import RobotStatus
from vico.sim.robots.rotors import POSITION, VELOCITY, Flight, FlightPhase
from vico.sim.robots.state import RobotMode, RobotRun

Array = NDArray[np.float64]

#: Metres a second squared robots that fly speed up and brake with.
BRAKE = 1.5

_LANDED = int(FlightPhase.LANDED)
_IDLE = int(RobotMode.IDLE)
# Metres above and beside others that it keeps to.
_ABOVE, _ASIDE = 1.5, 1.5
# Seconds that the motion of people and vehicles is foreseen, and of others that fly, who come faster; metres within
# which they are looked for.
_FORESIGHT, _FLIGHT_FORESIGHT, _NEAR, _FLIGHT_NEAR = 1.5, 2.5, 20.0, 45.0
# Metres that somebody's feet are above it from which on it is not they who are below.
_OVERHEAD = 1.0
# Metres a second it climbs and sinks with to let others pass, and metres above everything below which it does not sink.
_CLIMB, _GIVE_WAY, _LOW = 2.0, 1.0, 3.0


@dataclass(frozen=True)
class Around:
    """Whom a robot that flies has to keep apart from.

    Attributes
    ----------
    others
        Everybody near it.
    flies
        Who of them flies, bool, shape ``(n,)``.
    lower
        Of whom it keeps above: of those that fly the lower ones, and of two at one height the one with the smaller
        entity number; bool, shape ``(n,)``.
    position, bottom
        Its own, ENU metres; `bottom` is where it would stand.
    """

    others: Bodies
    flies: NDArray[np.bool_]
    lower: NDArray[np.bool_]
    position: Array
    bottom: float

    def meets(self, velocity: Array) -> NDArray[np.bool_]:
        """Return who comes too near to one side of it, at a velocity of its own, within the time that is foreseen."""
        away = self.others.position[:, :2] - self.position[:2]
        moves = self.others.velocity - velocity[:2]
        square = np.maximum((moves * moves).sum(axis=1), 1e-9)
        longest = np.where(self.flies, _FLIGHT_FORESIGHT, _FORESIGHT)
        nearest = away + moves * np.clip(-(away * moves).sum(axis=1) / square, 0.0, longest)[:, None]
        found: NDArray[np.bool_] = np.hypot(nearest[:, 0], nearest[:, 1]) - self.others.half_length < _ASIDE
        return found

    def floor(self, velocity: Array) -> float:
        """How high it has to keep because of whoever is below it, or soon will be, ENU metres; -inf for nobody."""
        if not len(self.others):
            return -math.inf
        near = self.lower & self.meets(velocity)
        return float(self.others.top[near].max()) + _ABOVE if near.any() else -math.inf

    def roof(self, velocity: Array) -> float:
        """How high it may reach because of others that fly above it, or soon will; inf for nobody."""
        if not len(self.others):
            return math.inf
        near = self.flies & ~self.lower & self.meets(velocity)
        return float(self.others.position[near, 2].min()) - _ABOVE if near.any() else math.inf


def near_in_the_air(run: RobotRun, flight: Flight, row: int, everybody: Bodies) -> Around:
    """Return everybody else within some metres of a robot that flies."""
    robot = int(flight.robots[row])
    own, position = int(run.entities[robot]), run.position(robot)
    bottom = float(position[2]) - flight.model.stand
    fly = [run.entities[f.robots[f.arrays.phase != _LANDED]] for f in run.flights if f is not None]
    away = distances(everybody.position[:, :2], position[:2]) - everybody.half_length
    chosen = np.flatnonzero((away < max(_FLIGHT_NEAR, _NEAR)) & (everybody.entity != own))
    flies = np.isin(everybody.entity[chosen], np.concatenate(fly))
    near = away[chosen] < np.where(flies, _FLIGHT_NEAR, _NEAR)
    others, flies = everybody.where(chosen[near]), flies[near]
    z = others.position[:, 2]
    below = (z < bottom) | ((z == bottom) & (others.entity < own))
    lower = np.where(flies, below, z < bottom + flight.model.height + _OVERHEAD)
    return Around(others, flies, lower, position, bottom)


def keep_apart(run: RobotRun, flight: Flight, row: int, around: Around) -> None:
    """Climb, and come no nearer, while anybody is below or ahead; sink for who flies above; stay inside the world."""
    a, robot = flight.arrays, int(flight.robots[row])
    if a.phase[row] == _LANDED:
        return
    setpoint, bottom, commanded = a.setpoint[row], around.bottom, run.arrays.mode[robot] != _IDLE
    velocity = setpoint[VELOCITY].copy()
    floor, roof = around.floor(velocity), around.roof(velocity)
    if bottom - 0.5 < floor:
        setpoint[5] = max(setpoint[5], 0.0)
        setpoint[2] = max(setpoint[2], floor + flight.model.stand)
    if bottom < floor:
        setpoint[VELOCITY] = 0.0, 0.0, _CLIMB
        setpoint[POSITION] = around.position
        if commanded:
            run.arrays.status[robot] = RobotStatus.WAITING
    elif bottom + flight.model.height > roof - 0.5:
        is_free = bottom > run.scene.airspace.top(around.position) + _LOW
        sinks = commanded and is_free and bottom + flight.model.height > roof
        setpoint[5] = min(setpoint[5], -_GIVE_WAY if sinks else 0.0)
        setpoint[2] = min(setpoint[2], around.position[2])
    _keep_inside(run, setpoint, around.position)


def _keep_inside(run: RobotRun, setpoint: Array, position: Array) -> None:
    """Fly neither out of the world nor too high; come back from there."""
    half = run.scene.airspace.half - BESIDE
    ceiling = float(run.scene.world.height(position)) + CEILING
    for axis, (low, high) in enumerate(((-half, half), (-half, half), (-math.inf, ceiling))):
        outwards = setpoint[3 + axis]
        # As fast as it can stop at the edge: told only there, it would come metres too far, and swing to and fro.
        room = high - position[axis] if outwards > 0.0 else position[axis] - low
        setpoint[3 + axis] = math.copysign(min(abs(outwards), math.sqrt(2.0 * BRAKE * max(room, 0.0))), outwards)
        if not low <= position[axis] <= high:
            setpoint[axis] = min(max(setpoint[axis], low), high)
