"""Trips of one ride each, by bus, tram or bicycle: the last that is there in time, and the first that is there at all.

Who changes is stranded too easily, so one ride is all that is looked for: all of them at once, as arrays. Walks to and
from stops and stations are bounds at first; those of the ride that looks best are measured, until its are known. Walks
are measured once, and kept for as long as the world is in use.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from vico.clock import DAY
from vico.community.model import Mode
from vico.geometry import distances
from vico.rules import BIKE_RATE, BIKE_SPEED, BUS_FARE, WALK_SPEED
from vico.world.model import Point2
from vico.world.transit import LineTimes, Stop, TramStop, TramTimes, Transit
from vico.world.trips import AHEAD
from vico.world.trips.model import ALIGHT, BOARD, DISMOUNT, MOUNT
from vico.world.trips.network import TURN
from vico.world.walk_lengths import Walk
from vico.world.world import World

_OFTEN = 12  # walks that begin or end at a point that is worth learning about
_MOST_LEARNED = 64  # points


class Walks:
    """Walks by their ends, there as back.

    Parameters
    ----------
    world
        Where. Its router is locked while a walk is looked for; nothing here may be shared between threads.
    """

    def __init__(self, world: World) -> None:
        self._lengths = world.walk_lengths()
        self._found: dict[tuple[Point2, Point2], Walk] = {}
        self._asked: Counter[Point2] = Counter()
        self._learned = 0

    @classmethod
    def of(cls, world: World) -> Walks:
        """Return the walks of a world: those of its author, its validator and all others are the same."""
        if world not in _WALKS:
            _WALKS[world] = cls(world)
        return _WALKS[world]

    def between(self, a: Point2, b: Point2) -> Walk:
        """Return the walk between two points, ENU metres."""
        ends = (a, b) if a <= b else (b, a)
        if ends not in self._found:
            for end in ends:
                self._learn(end)
            self._found[ends] = self._lengths.between(*ends)
        return self._found[ends]

    def _learn(self, end: Point2) -> None:
        self._asked[end] += 1
        if self._asked[end] == _OFTEN and self._learned < _MOST_LEARNED:
            self._learned += 1
            self._lengths.learn(end)


# The world holds no walks, so that it can be dropped; they go with it.
_WALKS: WeakKeyDictionary[World, Walks] = WeakKeyDictionary()


# Metres that a walk may be shorter than the bee line: its ends may lie off what is walked on.
_SNAP = 12.0

#: A ride by timetable: by when one has to be there, from which stop, to which, and when one is off.
_Row = tuple[float, str, str, float]


@dataclass(frozen=True)
class RideTrip:
    """A trip with one ride.

    Attributes
    ----------
    depart, arrive
        When one leaves the one door and is at the other, seconds of the day.
    walked
        Metres on foot.
    origin, destination
        Ids of the stops or stations.
    taken, left
        When one gets on, and when one is off again.
    price
        What the ride costs.
    """

    depart: float
    arrive: float
    walked: float
    origin: str
    destination: str
    taken: float
    left: float
    price: float


class _Ends:
    """Ends of the rides of a mode, and the ways to and from there.

    Parameters
    ----------
    names, points
        Ids of stops or stations, and where one waits there, ENU metres.
    """

    def __init__(self, names: list[str], points: list[Point2], walks: Walks) -> None:
        self.names, self.points, self._walks = names, points, walks
        self._xy = np.array(points, np.float64).reshape(-1, 2)
        self._from: dict[Point2, tuple[NDArray[np.float64], NDArray[np.bool_]]] = {}

    def seconds(self, door: Point2) -> NDArray[np.float64]:
        """Seconds on foot between a door and each end; bounds of those not measured yet."""
        if door not in self._from:
            bounds = np.maximum(distances(self._xy, door) - _SNAP, 0.0) / WALK_SPEED
            self._from[door] = bounds, np.zeros(len(bounds), np.bool_)
        return self._from[door][0]

    def measure(self, door: Point2, end: int) -> bool:
        """Measure the walk between a door and an end; return whether it was not known yet."""
        seconds, known = self.seconds(door), self._from[door][1]
        if known[end]:
            return False
        seconds[end] = _seconds(self._walks.between(door, self.points[end]), WALK_SPEED)
        known[end] = True
        return True

    def metres(self, door: Point2, end: int) -> float:
        """Metres on foot between a door and an end."""
        return self._walks.between(door, self.points[end]).metres


@dataclass(frozen=True)
class _Rides:
    """Rides of a mode, an array of each, shape ``(rides,)``.

    Attributes
    ----------
    ends
        Where they begin and end.
    first, last
        Numbers of their ends.
    ready
        By when one has to be there, second of the day, rising; of bicycles, which go at any time, nothing.
    off
        When one is off; of bicycles the seconds that the ride takes, bounds of those not measured yet.
    known
        Whether `off` is no bound.
    """

    ends: _Ends
    first: NDArray[np.int64]
    last: NDArray[np.int64]
    ready: NDArray[np.float64] | None
    off: NDArray[np.float64]
    known: NDArray[np.bool_]

    def within(self, begin: float, end: float) -> _Rides:
        """Return those for which one has to be there in a time."""
        if self.ready is None:
            return self
        part = slice(*np.searchsorted(self.ready, (begin, np.nextafter(end, math.inf))).tolist())
        return _Rides(self.ends, self.first[part], self.last[part], self.ready[part], self.off[part], self.known[part])


class RideTimes:
    """Trips of one ride from door to door: buses and trams keep their timetable, bicycles go at any time.

    Parameters
    ----------
    transit
        Stops, lines and stations; all bicycles stand where they stand in the morning.
    walks
        Measures the ways on the ground.
    """

    def __init__(self, transit: Transit, walks: Walks) -> None:
        self._walks = walks
        self._rides = {
            Mode.BUS: _buses(transit, walks),
            Mode.TRAM: _trams(transit, walks),
            Mode.BIKE: _bicycles(transit, walks),
        }

    @property
    def any(self) -> bool:
        """Whether there is anything to ride."""
        return any(len(rides.first) > 0 for rides in self._rides.values())

    def last(
        self, doors: tuple[Point2, Point2], mode: Mode, times: tuple[float, float], cash: float = math.inf
    ) -> RideTrip | None:
        """Return the trip that sets out last of those that are there in time; None if there is none.

        Of those that set out together, the one that is there first, then the one with the least to walk.

        Parameters
        ----------
        doors
            Where it begins and ends, ENU metres.
        times
            Seconds of the day between which it has to be made.
        cash
            What the ride may cost.
        """
        not_before, arrive_by = times
        rides = self._rides[mode].within(*times)
        while True:
            there, on = rides.ends.seconds(doors[0])[rides.first], rides.ends.seconds(doors[1])[rides.last]
            if rides.ready is not None:
                ready, off, arrive = rides.ready, rides.off, rides.off + on
            else:
                ready, off, arrive = arrive_by - on - rides.off, arrive_by - on, np.full(len(on), arrive_by)
            depart = ready - there
            good = (depart >= not_before) & (arrive <= arrive_by) & (_prices(rides) <= cash)
            if not good.any():
                return None
            fits = np.flatnonzero(good)
            k = int(fits[np.lexsort((there[fits] + on[fits], arrive[fits], -depart[fits]))[0]])
            if not self._measure(rides, k, doors):
                return _trip(rides, k, doors, (depart[k], ready[k], off[k], arrive[k]))

    def first(self, doors: tuple[Point2, Point2], mode: Mode, depart: float, cash: float = math.inf) -> RideTrip | None:
        """Return the trip that is there first of those that set out at a second of the day; None if there is none.

        Parameters are those of `last`; buses and trams of the next day are not waited for.
        """
        rides = self._rides[mode].within(depart, math.inf)
        while True:
            there, on = rides.ends.seconds(doors[0])[rides.first], rides.ends.seconds(doors[1])[rides.last]
            ready = rides.ready if rides.ready is not None else depart + there
            off = rides.off if rides.ready is not None else ready + rides.off
            arrive = np.where((depart + there <= ready) & (_prices(rides) <= cash), off + on, np.inf)
            if not np.isfinite(arrive).any():
                return None
            k = int(arrive.argmin())
            if not self._measure(rides, k, doors):
                return _trip(rides, k, doors, (depart, ready[k], off[k], arrive[k]))

    def _measure(self, rides: _Rides, k: int, doors: tuple[Point2, Point2]) -> bool:
        """Measure the ways of a ride; return whether any was not known yet."""
        a, b = int(rides.first[k]), int(rides.last[k])
        news = [rides.ends.measure(doors[0], a), rides.ends.measure(doors[1], b), not rides.known[k]]
        if not rides.known[k]:
            way = self._walks.between(rides.ends.points[a], rides.ends.points[b])
            rides.off[k], rides.known[k] = MOUNT + _seconds(way, BIKE_SPEED) + DISMOUNT, True
        return any(news)


def _seconds(way: Walk, speed: float) -> float:
    """Return how long a way takes, with a moment at every corner."""
    return way.metres / speed + TURN * way.corners


def _prices(rides: _Rides) -> NDArray[np.float64]:
    if rides.ready is not None:
        return np.full(len(rides.off), BUS_FARE)
    return BIKE_RATE * np.ceil((rides.off - MOUNT) / 60.0)


def _trip(rides: _Rides, k: int, doors: tuple[Point2, Point2], times: tuple[float, float, float, float]) -> RideTrip:
    a, b = int(rides.first[k]), int(rides.last[k])
    depart, taken, left, arrive = (float(second) for second in times)
    return RideTrip(
        depart,
        arrive,
        rides.ends.metres(doors[0], a) + rides.ends.metres(doors[1], b),
        rides.ends.names[a],
        rides.ends.names[b],
        taken,
        left,
        float(_prices(rides)[k]),
    )


def _buses(transit: Transit, walks: Walks) -> _Rides:
    """Return the rides of a day with the buses of all lines, from every stop to every other of the line."""
    rows: list[_Row] = []
    for line in transit.lines:
        if len(line.stops) < 2 or not line.departures:
            continue
        times, n = LineTimes.of(line), len(line.stops)
        for k, name in enumerate(line.stops):
            for turn in range(times.next_round(k, 0.0), times.next_round(k, DAY)):
                ready = times.leaves(turn, k) - BOARD - (AHEAD if k else 0.0)
                onward = times.leaves(turn, n)
                for call in range(k + 1, k + n):
                    # At the end of its round the bus stands at the first stop until its next departure.
                    arrives = times.arrives(turn, call) if call <= n else onward + line.travel[call - n]
                    rows.append((ready, name, line.stops[call % n], arrives + ALIGHT))
    return _by_timetable(rows, transit.stops, walks)


def _trams(transit: Transit, walks: Walks) -> _Rides:
    """Return the rides of a day with the trams of all lines, from every stop to those that come after it."""
    rows: list[_Row] = []
    for line in transit.tram_lines:
        if len(line.stops) < 2 or not line.departures:
            continue
        times = TramTimes(line)
        for k, name in enumerate(line.stops):
            for turn in range(times.next_round(k, 0.0), times.next_round(k, DAY)):
                ready = times.leaves(turn, k) - BOARD - AHEAD
                for call in range(k + 1, len(line.stops)):
                    rows.append((ready, name, line.stops[call], times.arrives(turn, call) + ALIGHT))
    return _by_timetable(rows, transit.tram_stops, walks)


def _by_timetable(rows: Sequence[_Row], every: Sequence[Stop | TramStop], walks: Walks) -> _Rides:
    """Return the rides of a timetable between some of all stops."""
    served = {name for row in rows for name in row[1:3]}
    stops = [stop for stop in every if stop.id in served]
    number = {stop.id: k for k, stop in enumerate(stops)}
    found = sorted((ready, number[a], number[b], off) for ready, a, b, off in rows if a != b)
    table = np.array(found, np.float64).reshape(-1, 4)
    first, last = table[:, 1].astype(np.int64), table[:, 2].astype(np.int64)
    ends = _Ends([stop.id for stop in stops], [(stop.wait[0], stop.wait[1]) for stop in stops], walks)
    return _Rides(ends, first, last, table[:, 0].copy(), table[:, 3].copy(), np.ones(len(found), np.bool_))


def _bicycles(transit: Transit, walks: Walks) -> _Rides:
    """Return the rides from each station with a bicycle to each other with room."""
    racks = transit.bike_stations
    ends = _Ends([rack.id for rack in racks], [(rack.position[0], rack.position[1]) for rack in racks], walks)
    pairs = [
        (a, b)
        for a, rack in enumerate(racks)
        for b, other in enumerate(racks)
        if a != b and rack.bikes > 0 and other.bikes < other.capacity
    ]
    first, last = (np.array([pair[k] for pair in pairs], np.int64) for k in (0, 1))
    bounds = [max(math.dist(ends.points[a], ends.points[b]) - _SNAP, 0.0) / BIKE_SPEED for a, b in pairs]
    off = np.array(bounds, np.float64) + MOUNT + DISMOUNT
    return _Rides(ends, first, last, None, off, np.zeros(len(pairs), np.bool_))
