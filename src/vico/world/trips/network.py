"""Stops and stations as a graph: what can be ridden from each, when, and at what price."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.rules import BIKE_SPEED
from vico.world.model import Point2
from vico.world.timetable import LineTimes, TramTimes
from vico.world.transit_model import Stop, TramStop, Transit
from vico.world.trips.labels import Timetable, ride_along


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
        """When what runs, as arrays."""
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
