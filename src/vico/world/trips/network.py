"""Parts of trips: stops and stations as a graph of rides, and the ways on the ground between their ends.

Rides say what can be ridden from each stop or station, when, and at what price. Ways on the ground are bounds at first,
found when it matters, then kept.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from threading import Lock
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.geometry import polyline_length
from vico.rules import BIKE_SPEED
from vico.world.model import Point2
from vico.world.routing import Router
from vico.world.transit import LineTimes, Stop, TramStop, TramTimes, Transit
from vico.world.trips.label_setting import GroundWays, Timetable, ride_along, straight_lines


class Ride(NamedTuple):
    """A ride by bus or tram.

    Attributes
    ----------
    to
        Node where it ends.
    depart, arrive
        When the bus leaves, and when one is off again; seconds.
    line
        Number of the line.
    first, last
        The indices among the line's stops where it begins and ends (counted on past the last stop).
    """

    to: int
    depart: float
    arrive: float
    line: int
    first: int
    last: int


@dataclass(frozen=True)
class Station:
    """Whether a bicycle station has a bicycle to take, and a place to leave one."""

    gives: bool
    takes: bool


class TripNetwork:
    """The stops that lines serve, then the bicycle stations, as nodes; numbers of nodes are their order.

    Parameters
    ----------
    transit
        Stops, lines and stations.
    closed
        Ids of what is out of use.
    buses, bikes, trams
        Whether there are any.

    Attributes
    ----------
    ids, points
        Of each node: id of the stop or station, and where one waits, ENU metres.
    stations
        The nodes that are bicycle stations.
    boardable
        Nodes where a ride may begin, int64, ascending.
    returnable
        Stations with a place for a bicycle, int64, ascending.
    top_speed
        Speed as the crow flies that no ride exceeds, m/s; 0 without any.
    """

    def __init__(
        self,
        transit: Transit,
        closed: Collection[str] = (),
        *,
        buses: bool = True,
        bikes: bool = True,
        trams: bool = True,
    ) -> None:
        lines = [line for line in transit.lines if line.id not in closed and len(line.stops) > 1 and line.departures]
        self.lines: list[LineTimes | TramTimes] = [LineTimes.of(line) for line in lines] if buses else []
        on_rails = [line for line in transit.tram_lines if line.id not in closed and len(line.stops) > 1]
        self.lines += [TramTimes(line) for line in on_rails if line.departures and trams]
        served = {stop for times in self.lines for stop in times.line.stops} - set(closed)
        every: list[Stop | TramStop] = [*transit.stops, *transit.tram_stops]
        stops = [stop for stop in every if stop.id in served]
        stations = [station for station in transit.bike_stations if station.id not in closed] if bikes else []
        self.ids = [stop.id for stop in stops] + [station.id for station in stations]
        self.points: list[Point2] = [(s.wait[0], s.wait[1]) for s in stops]
        self.points += [(s.position[0], s.position[1]) for s in stations]
        self._number = {name: k for k, name in enumerate(self.ids)}
        self._calls: list[list[tuple[int, int]]] = [[] for _ in self.ids]
        for number, times in enumerate(self.lines):
            for k, stop in enumerate(times.line.stops):
                if stop in self._number:
                    self._calls[self._number[stop]].append((number, k))
        first = len(stops)
        self.stations = {
            first + k: Station(station.bikes > 0, station.bikes < station.capacity)
            for k, station in enumerate(stations)
        }
        boardable = [k for k in range(len(self)) if self._calls[k] or (k in self.stations and self.stations[k].gives)]
        self.boardable = np.array(boardable, np.int64)
        self.returnable = np.array([k for k, station in self.stations.items() if station.takes], np.int64)
        self.top_speed = max(self._fastest_bus(), BIKE_SPEED if self.stations else 0.0)

    def __len__(self) -> int:
        return len(self.ids)

    @cached_property
    def timetable(self) -> Timetable:
        """Return the timetable as arrays."""
        travel = [times.line.travel[: len(times.line.stops) + times.round] for times in self.lines]
        nodes = [[self._number.get(stop, -1) for stop in times.line.stops] for times in self.lines]
        departures = [
            times.departures if isinstance(times, LineTimes) else times.line.departures for times in self.lines
        ]
        return Timetable(
            calls=np.array([call for calls in self._calls for call in calls], np.int64).reshape(-1, 2),
            first_call=_begins(self._calls),
            first_stop=_begins(nodes),
            nodes=np.array([node for of_line in nodes for node in of_line], np.int64),
            first_time=_begins(travel),
            travel=np.array([second for of_line in travel for second in of_line], np.float64),
            first_departure=_begins(departures),
            departures=np.array([second for of_line in departures for second in of_line], np.float64),
            buses=np.array([times.buses if isinstance(times, LineTimes) else 0 for times in self.lines], np.int64),
            gives=np.array([k in self.stations and self.stations[k].gives for k in range(len(self))], np.bool_),
            takes=self.returnable,
            boardable=self.boardable,
        )

    def bus_rides(self, node: int, ready: float) -> Iterator[Ride]:
        """Yield the rides with the next bus or tram of every line that stops at a node, for who is there at `ready`."""
        rides = np.empty((len(self.timetable.nodes), 3))
        for call in range(*self.timetable.first_call[node : node + 2].tolist()):
            first, leaves, count = ride_along(self.timetable, call, ready, rides)
            for to, arrive, last in rides[:count].tolist():
                yield Ride(int(to), leaves, arrive, int(self.timetable.calls[call, 0]), first, int(last))

    def bus_stops_between(self, line: int, first: int, last: int) -> list[Point2]:
        """Return the points of the stops that a bus ride calls at, its own two included; closed ones are left out."""
        stops = self.lines[line].line.stops
        called = (stops[k % len(stops)] for k in range(first, last + 1))
        return [self.points[self._number[stop]] for stop in called if stop in self._number]

    def _fastest_bus(self) -> float:
        """Return the speed as the crow flies that no bus exceeds between two stops, m/s."""
        fastest = 0.0
        for times in self.lines:
            stops = [*times.line.stops, *times.line.stops[:1]] if times.round else times.line.stops
            known = [
                (self.points[self._number[s]], t)
                for s, t in zip(stops, times.line.travel[: len(stops)], strict=True)
                if s in self._number
            ]
            for (a, start), (b, end) in pairwise(known):
                fastest = max(fastest, math.dist(a, b) / (end - start) if end > start else math.inf)
        return fastest


def _begins(parts: Sequence[Sequence[object]]) -> NDArray[np.int64]:
    """Return where each part begins among all, and how many there are."""
    return np.cumsum([0, *map(len, parts)], dtype=np.int64)


#: Seconds that a corner costs: an agent that turns does not go on in the same second.
TURN = 1.0
# Metres that a way may be shorter than the bee line at an end from which the nearest walkable point is taken.
_SNAP = 6.0


class Way(NamedTuple):
    """A way on the ground.

    Attributes
    ----------
    path
        Corner points, shape ``(k, 2)``.
    metres
        Its length; infinite if there is no way.
    """

    path: NDArray[np.float64]
    metres: float

    def seconds(self, speed: float) -> float:
        """Return how long it takes at a speed, m/s, with a moment at every corner, in hundredths of a second."""
        return round(self.metres / speed + TURN * max(0, len(self.path) - 2), 2)


NO_WAY = Way(np.zeros((0, 2)), math.inf)


def find_way(
    router: Router, start: Point2, goal: Point2, blocked: NDArray[np.bool_] | None = None, *, often: bool = False
) -> Way:
    """Return the way between two points; `NO_WAY` if there is none. Parameters are those of `Router.path`."""
    path = router.path(start, goal, blocked=blocked, often=often)
    if path is None:
        return NO_WAY
    return Way(path, round(polyline_length(path), 3))


class KnownWays:
    """The ways between the stops and stations of a place that were found so far; threads may share it.

    Parameters
    ----------
    names
        Of the stops and stations.
    walk_speed
        Metres a second on foot.

    Attributes
    ----------
    number
        Of each name, in their order.
    """

    def __init__(self, names: Sequence[str], walk_speed: float) -> None:
        self.number = {name: k for k, name in enumerate(names)}
        self.walk_speed = walk_speed
        self._ways: dict[tuple[int, int], Way] = {}
        self._row = np.full(len(names), -1, np.int64)
        self._known = np.full((1, len(names), 3), np.nan)
        self._lock = Lock()

    def get(self, a: int, b: int) -> Way | None:
        """Return the way from one to another, by number; None if it is not known."""
        return self._ways.get((a, b))

    def keep(self, a: int, b: int, way: Way) -> Way:
        """Keep a way from one to another, and return it; or the one that is known already."""
        with self._lock:
            if (a, b) not in self._ways:
                row = self._row[a]
                if row < 0:
                    row = self._row.max() + 1
                    if row == len(self._known):
                        self._known = np.concatenate([self._known, np.full_like(self._known, np.nan)])
                    self._row[a] = row
                self._known[row, b] = measures(way, self.walk_speed)
                self._ways[a, b] = way
            return self._ways[a, b]

    def arrays(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return the row of each of the known ways from there, -1 without any, and the measures by row and number."""
        with self._lock:
            return self._row, self._known


def measures(way: Way, walk_speed: float) -> tuple[float, float, float]:
    """Return a way's metres, and its seconds on foot and by bicycle."""
    return way.metres, way.seconds(walk_speed), way.seconds(BIKE_SPEED)


class Ways:
    """Ways between numbered points.

    Parameters
    ----------
    router
        Finds them.
    points
        ENU metres: of stops and stations, then of the start and the goal.
    place
        Numbers of the stops and stations among the known ways, int64.
    known
        Ways that are known; those found are kept there.
    blocked
        Cells that are closed, as for `Router.path`.
    """

    def __init__(
        self,
        router: Router,
        points: Sequence[Point2],
        place: NDArray[np.int64],
        known: KnownWays,
        *,
        blocked: NDArray[np.bool_] | None = None,
    ) -> None:
        self.points = list(points)
        self.walk_speed = known.walk_speed
        self._router, self._place, self._known, self._blocked = router, place, known, blocked
        xy = np.array(self.points, np.float64).reshape(-1, 2)
        sure = router.walkable.is_connected(xy) if blocked is None else np.zeros(len(xy), bool)
        off = np.where(sure, 0.0, _SNAP)
        self._own: dict[tuple[int, int], Way] = {}
        of_start, of_goal = np.full((2, len(xy), 3), np.nan)
        self._ground = GroundWays(
            xy, off, place, *known.arrays(), of_start, of_goal, straight_lines(xy, off, len(xy) - 1)
        )

    @property
    def ground(self) -> GroundWays:
        """The ways as they are known now."""
        row, known = self._known.arrays()
        return self._ground._replace(row=row, known=known)

    def is_known(self, a: int, b: int) -> bool:
        """Whether the way is known, and not a bound."""
        return self._get(a, b) is not None

    def way(self, a: int, b: int) -> Way:
        """Return the way from one point to another, finding it if need be."""
        if (way := self._get(a, b)) is not None:
            return way
        start, goal = len(self.points) - 2, len(self.points) - 1
        between = a < start and b < start
        way = find_way(self._router, self.points[a], self.points[b], self._blocked, often=between)
        if between:
            return self._known.keep(int(self._place[a]), int(self._place[b]), way)
        self._own[a, b] = way
        if a == start:
            self._ground.of_start[b] = measures(way, self.walk_speed)
        if b == goal:
            self._ground.of_goal[a] = measures(way, self.walk_speed)
        return way

    def _get(self, a: int, b: int) -> Way | None:
        if max(a, b) < len(self.points) - 2:
            return self._known.get(int(self._place[a]), int(self._place[b]))
        return self._own.get((a, b))
