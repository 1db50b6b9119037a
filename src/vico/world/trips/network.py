"""Stops and stations as a graph: what can be ridden from each, when, and at what price."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vico.rules import BIKE_SPEED, BUS_FARE, ride_price
from vico.world.model import Point2
from vico.world.timetable import LineTimes, TramTimes
from vico.world.transit_model import Stop, TramStop, Transit

#: Seconds that each takes: getting into a bus, out of it, on and off a bicycle. An agent acts once a second.
BOARD = ALIGHT = MOUNT = DISMOUNT = 1.0
#: Who boards on the way has to be there so many seconds before the bus is due to leave: it may be early by as much.
AHEAD = 10.0


class Ride(NamedTuple):
    """A ride one may take.

    Attributes
    ----------
    to
        Node where it ends.
    depart, arrive
        When the bus leaves or one gets on the bicycle, and when one is off again; seconds.
    price
        What it costs.
    line
        Number of the bus line, -1 for a bicycle.
    first, last
        Of a bus ride the indices among the line's stops where it begins and ends (counted on past the last stop).
    """

    to: int
    depart: float
    arrive: float
    price: float
    line: int
    first: int = 0
    last: int = 0


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

    def bus_rides(self, node: int, ready: float) -> Iterator[Ride]:
        """Yield the rides with the next bus or tram of every line that stops at a node, for who is there at `ready`."""
        for number, k in self._calls[node]:
            times = self.lines[number]
            stops = times.line.stops
            n = len(stops)
            waits = times.round and k == 0
            turn = times.next_round(k, ready + BOARD + (0.0 if waits else AHEAD))
            leaves, onward = times.leaves(turn, k), times.leaves(turn, n) if times.round else 0.0
            for last in range(k + 1, k + n if times.round else n):
                to = self._number.get(stops[last % n])
                # At the end of its round the bus stands at the first stop until its next departure.
                arrives = times.arrives(turn, last) if last <= n else onward + times.line.travel[last - n]
                if to is not None and to != node:
                    yield Ride(to, leaves, arrives + ALIGHT, BUS_FARE, number, k, last)

    def bike_ride(self, to: int, ready: float, seconds: float) -> Ride:
        """Return the ride to a station that takes `seconds` on the way, for who stands by a bicycle at `ready`."""
        arrive = ready + MOUNT + seconds + DISMOUNT
        return Ride(to, ready, arrive, round(ride_price(seconds + DISMOUNT, returned=True), 2), -1)

    def bus_stops_between(self, ride: Ride) -> list[Point2]:
        """Return the points of the stops that a bus ride calls at, its own two included; closed ones are left out."""
        stops = self.lines[ride.line].line.stops
        called = (stops[k % len(stops)] for k in range(ride.first, ride.last + 1))
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
