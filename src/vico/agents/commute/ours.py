"""Our planner: the whole day's modes by expected cost, by the timetable, with the chance of being late reckoned in.

For every commute it weighs walking, the trips of the router (bus, tram, bicycles from station to station; several that
are each the best in arrival, price or metres on foot), renting a bicycle and keeping it at the appointment, and riding
on with one that was kept. What is kept costs its rent through the stay and saves the walks to and from stations, so the
day is planned backwards from its end, when no bicycle may be out, by dynamic programming over (appointment, on foot or
with a bicycle). Arrivals are taken to be normally distributed about the router's, with the lateness of buses that is
usual; a trip that uses a bus begins so late that one need not stand at the stop for long.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vico.agents.commute.commuter import CommuteQuery
from vico.agents.commute.legs import LegMaker
from vico.agents.travel import can_ride_out
from vico.rules import BIKE_RATE
from vico.world.model import Point2
from vico.world.public import PublicMap
from vico.world.trips import Leg, Trip

# Who keeps a bicycle is at an appointment this near to its point, where there is so much room to walls, metres.
_THERE, _ROOM = 2.5, 1.1


@dataclass(frozen=True)
class Weights:
    """What the planner thinks of, in seconds of travelling.

    Attributes
    ----------
    metre
        A metre on foot, beside the time it takes.
    money
        A unit of money.
    late
        Being late for certain.
    walk_spread, bike_spread
        Standard deviation of walking and cycling times, as shares of them.
    walk_longer, bike_longer
        By how much they take longer than the router says, as shares: others are in the way.
    bus_delay, bus_spread
        Mean and standard deviation of how late buses and trams are, seconds.
    mount
        Seconds that getting on or off a bicycle takes beside what the router says: finding room for it.
    before_bus
        Seconds before its departure at which one wants to be at a stop.
    """

    metre: float = 1.0
    money: float = 12.0
    late: float = 3000.0
    walk_spread: float = 0.05
    bike_spread: float = 0.12
    walk_longer: float = 0.04
    bike_longer: float = 0.15
    bus_delay: float = 20.0
    bus_spread: float = 45.0
    mount: float = 5.0
    before_bus: float = 45.0


@dataclass(frozen=True)
class Option:
    """A trip, what it costs, and whether one arrives with a bicycle."""

    trip: Trip
    cost: float
    keeps: bool


class DayPlanner:
    """Plans the trips of a day.

    Parameters
    ----------
    instructions
        What the task tells: the day's appointments.
    public_map
        Streets, timetables and stations.
    weights
        What it weighs.
    """

    def __init__(
        self, instructions: list[dict[str, Any]], public_map: PublicMap, *, weights: Weights | None = None
    ) -> None:
        self._day: list[dict[str, Any]] = instructions[0]["appointments"]
        self._trips = public_map.trips
        self._legs = LegMaker(public_map)
        self._weights = weights or Weights()
        # Cost of the rest of the day from an appointment on, by its number and whether one has a bicycle there.
        self._rest: dict[tuple[int, bool], float] = {}
        # Stations that were of no use on this day, or from where no bicycle can be ridden off.
        self._walkable = public_map.walkable
        # Where one is at an appointment with a bicycle, by its point.
        self._spots: dict[Point2, Point2 | None] = {}
        self._useless = {
            name for name in self._legs.stations if not can_ride_out(self._walkable, self._legs.point_of(name))
        }

    def __call__(self, question: CommuteQuery) -> Trip | None:
        """Return the trip with the least cost of the rest of the day."""
        useless = self._useless | {name for name in question.closed if name in self._legs.stations}
        if useless != self._useless:
            self._useless = useless
            self._rest.clear()
        question = replace(question, closed=tuple(dict.fromkeys((*question.closed, *sorted(useless)))))
        if question.vehicle == "bike":
            found = list(self._with_bicycle(question))
        else:
            found = list(self._on_foot(question))
        if not found and question.vehicle == "bike":
            # Wherever it was of no use: a bicycle has to be back at a station.
            return self._legs.brought_back(question.here, question.goal, question.now)
        if not found:
            return None
        best = min(found, key=lambda option: option.cost + self._after(question.index, option.keeps))
        return self._departing(best.trip, question.now)

    # -- the rest of the day -----------------------------------------------------------------------------------------

    def _after(self, index: int, keeps: bool) -> float:
        """Return what the day costs from an appointment on, the rent of a bicycle through the stay included."""
        if index == len(self._day) - 1:
            return math.inf if keeps else 0.0
        if (index, keeps) not in self._rest:
            here, there = self._day[index], self._day[index + 1]
            question = CommuteQuery(
                here=_point(here),
                goal=_point(there),
                now=float(here["end"]),
                due=float(there["start"]),
                cash=math.inf,
                vehicle="bike" if keeps else "",
                index=index + 1,
                closed=tuple(sorted(self._useless)),
                first=True,
            )
            options = self._with_bicycle(question) if keeps else self._on_foot(question)
            onward = (option.cost + self._after(index + 1, option.keeps) for option in options)
            stay = BIKE_RATE * (here["end"] - here["start"]) / 60.0 * self._weights.money if keeps else 0.0
            self._rest[index, keeps] = stay + min(onward, default=math.inf)
        return self._rest[index, keeps]

    # -- options -----------------------------------------------------------------------------------------------------

    def _on_foot(self, question: CommuteQuery) -> Iterator[Option]:
        """Yield the trips of who has no bicycle."""
        q = question
        cash = None if math.isinf(q.cash) else q.cash
        for trip in self._trips.alternatives(q.here, q.goal, q.now, cash=cash, closed=q.closed):
            yield self._option(trip, q, keeps=False)
        spot = self._spot_for_bicycle(q.goal)
        if q.cash < 2 * BIKE_RATE or spot is None:
            return
        for station in self._legs.stations.values():
            if station.bikes == 0 or station.id in q.closed:
                continue
            walk = self._legs.walk(q.here, self._legs.point_of(station.id), q.now)
            ride = walk and self._legs.rent(station.id, None, spot, walk.arrive)
            if walk is not None and ride is not None:
                yield self._option(Trip(q.now, (walk, ride)), q, keeps=True)

    def _with_bicycle(self, question: CommuteQuery) -> Iterator[Option]:
        """Yield the trips of who rides a bicycle."""
        q = question
        spot = self._spot_for_bicycle(q.goal)
        on = self._legs.ride_on(q.here, None, spot, q.now) if spot is not None else None
        if on is not None:
            yield self._option(Trip(q.now, (on,)), q, keeps=True)
        for station in self._legs.stations.values():
            if station.bikes >= station.capacity or station.id in q.closed:
                continue
            ride = self._legs.ride_on(q.here, station.id, q.goal, q.now)
            walk = ride and self._legs.walk(self._legs.point_of(station.id), q.goal, ride.arrive)
            if ride is not None and walk is not None:
                yield self._option(Trip(q.now, (ride, walk)), q, keeps=False)

    def _spot_for_bicycle(self, goal: Point2) -> Point2 | None:
        """Return the nearest spot at which one is there and has room to turn a bicycle; None if there is none."""
        if goal not in self._spots:
            steps = np.arange(-_THERE, _THERE + 0.01, 0.25)
            around = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
            away = np.hypot(around[:, 0], around[:, 1])
            around = np.asarray(goal) + around[np.argsort(away, kind="stable")][: int((away <= _THERE).sum())]
            walkable = self._walkable
            wide = np.flatnonzero(walkable.is_connected(around) & (walkable.clearance_at(around) >= _ROOM))
            self._spots[goal] = (float(around[wide[0], 0]), float(around[wide[0], 1])) if len(wide) else None
        return self._spots[goal]

    # -- what they cost ----------------------------------------------------------------------------------------------

    def _option(self, trip: Trip, question: CommuteQuery, *, keeps: bool) -> Option:
        weights = self._weights
        delay, variance = self._uncertainty(trip.legs)
        travel = trip.seconds + delay - self._spare(trip)
        lateness = trip.arrive + delay - question.due
        late = weights.late * _probability(lateness / math.sqrt(variance))
        # Of two that are late the one that is less so.
        late += max(0.0, lateness)
        # A kept bicycle is paid for while one waits for the start, too.
        early = BIKE_RATE * max(0.0, -lateness) / 60.0 if keeps else 0.0
        cost = travel + weights.metre * trip.walked + weights.money * (trip.price + early) + late
        return Option(trip, cost, keeps)

    def _uncertainty(self, legs: Sequence[Leg]) -> tuple[float, float]:
        """Return by how much a trip takes longer than planned on average, and the variance, seconds."""
        weights = self._weights
        delay, variance = 0.0, 25.0
        for leg in legs:
            if leg.mode == "walk":
                delay += weights.walk_longer * leg.seconds
                variance += (weights.walk_spread * leg.seconds) ** 2
            elif leg.mode == "bike":
                delay += weights.bike_longer * leg.seconds + 2 * weights.mount
                variance += (weights.bike_spread * leg.seconds) ** 2
            else:
                delay += weights.bus_delay
                variance += weights.bus_spread**2
        return delay, variance

    def _spare(self, trip: Trip) -> float:
        """Return the seconds that one may begin a trip later, as a bus is waited for."""
        if len(trip.legs) < 2 or trip.legs[1].mode not in ("bus", "tram"):
            return 0.0
        walk, bus = trip.legs[:2]
        needed = walk.seconds * (1.0 + self._weights.walk_longer) + self._weights.before_bus
        return max(0.0, bus.depart - trip.depart - needed)

    def _departing(self, trip: Trip, now: float) -> Trip:
        """Return the trip, begun as late as the first bus allows."""
        return Trip(now + math.floor(self._spare(trip)), trip.legs)


def _point(appointment: dict[str, Any]) -> Point2:
    x, y = appointment["position"]
    return float(x), float(y)


def _probability(deviations: float) -> float:
    """Return the chance that a normal variable is above minus so many deviations."""
    return 0.5 * math.erfc(-deviations / math.sqrt(2.0))
