"""Legs of trips made to order: a walk, a ride from this stop to that one, a bicycle from a station to anywhere."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from vico.rules import BIKE_SPEED, BUS_FARE, WALK_SPEED, ride_price
from vico.world.model import Point2
from vico.world.public import PublicMap
from vico.world.transit import BikeStation
from vico.world.trips.model import DISMOUNT, MOUNT, Leg, Trip
from vico.world.trips.network import TripNetwork, Way, find_way


def nearest_point(here: Point2, points: Mapping[str, Point2], without: Collection[object] = ()) -> str | None:
    """Return the name of the nearest point as the crow flies; None if there is none."""
    names = [name for name in points if name not in without]
    return min(names, key=lambda name: (math.dist(here, points[name]), name), default=None)


# Ways that are kept; more are found anew.
_CACHED_WAYS = 5_000


class LegMaker:
    """Makes legs from the public map and the timetable; ways are found once.

    Parameters
    ----------
    public_map
        Streets, stops, lines and stations.

    Attributes
    ----------
    stops
        Where one waits at each stop of bus or tram that a line serves, by id, ENU metres.
    stations
        Bicycle stations by id.
    """

    def __init__(self, public_map: PublicMap) -> None:
        self._router = public_map.router
        self._network = TripNetwork(public_map.transit)
        self._node = {name: k for k, name in enumerate(self._network.ids)}
        self.stations: dict[str, BikeStation] = {s.id: s for s in public_map.bike_stations}
        self.stops: dict[str, Point2] = {
            name: self._network.points[k] for name, k in self._node.items() if k not in self._network.stations
        }
        self._ways: dict[tuple[Point2, Point2], Way] = {}

    def way(self, start: Point2, goal: Point2) -> Way:
        """Return the way on the ground between two points; infinitely long if there is none."""
        key = (start, goal)
        if key not in self._ways:
            if len(self._ways) >= _CACHED_WAYS:
                self._ways.clear()
            self._ways[key] = find_way(self._router, start, goal) if start != goal else Way(_polyline([start]), 0.0)
        return self._ways[key]

    def walk(self, start: Point2, goal: Point2, depart: float) -> Leg | None:
        """Return a walk; None if there is no way."""
        way = self.way(start, goal)
        if not math.isfinite(way.metres):
            return None
        return Leg("walk", start, goal, way.path, depart, depart + way.seconds(WALK_SPEED), way.metres)

    def walk_seconds(self, start: Point2, goal: Point2) -> float:
        """Return how long a walk takes; infinite if there is no way, 0 from a point to itself."""
        return 0.0 if start == goal else self.way(start, goal).seconds(WALK_SPEED)

    def bus(self, origin: str, destination: str, ready: float, closed: Collection[str] = ()) -> Leg | None:
        """Return the direct ride by bus or tram that arrives first, for who is at a stop at `ready`; None without."""
        first, last = self._node.get(origin), self._node.get(destination)
        if first is None or last is None or {origin, destination} & set(closed):
            return None
        lines = self._network.lines
        rides = [ride for ride in self._network.bus_rides(first, ready) if ride.to == last]
        rides = [ride for ride in rides if lines[ride.line].line.id not in closed]
        if not rides:
            return None
        ride = min(rides, key=lambda ride: (ride.arrive, ride.line))
        points = self._network.bus_stops_between(ride.line, ride.first, ride.last)
        metres = sum(math.dist(a, b) for a, b in pairwise(points))
        times = lines[ride.line]
        return Leg(
            "bus" if times.round else "tram",
            self.stops[origin],
            self.stops[destination],
            _polyline(points),
            ride.depart,
            ride.arrive,
            metres,
            price=BUS_FARE,
            line=times.line.id,
            origin=origin,
            destination=destination,
        )

    def reached_from(self, origin: str) -> list[str]:
        """Return the stops that direct rides lead to from one, by id."""
        rides = self._network.bus_rides(self._node[origin], 0.0)
        return list(dict.fromkeys(self._network.ids[ride.to] for ride in rides))

    def rent(self, origin: str, destination: str | None, goal: Point2, ready: float) -> Leg | None:
        """Return a ride on a rented bicycle from a station.

        Parameters
        ----------
        destination
            Station it is left at; None where it is kept and ridden to `goal`.
        ready
            When one stands at the station.
        """
        end = self.point_of(destination) if destination is not None else goal
        return self._ride(self.point_of(origin), end, ready + MOUNT, origin, destination)

    def ride_on(self, here: Point2, destination: str | None, goal: Point2, depart: float) -> Leg | None:
        """Return a ride of who is on a bicycle already; parameters as for `rent`."""
        end = self.point_of(destination) if destination is not None else goal
        return self._ride(here, end, depart, None, destination)

    def brought_back(self, here: Point2, goal: Point2, now: float, closed: Collection[object] = ()) -> Trip | None:
        """Return the trip of who rides a bicycle to the nearest station, and from there on foot; None without one."""
        station = nearest_point(here, {name: self.point_of(name) for name in self.stations}, closed)
        ride = self.ride_on(here, station, goal, now) if station is not None else None
        walk = self.walk(ride.end, goal, ride.arrive) if ride is not None else None
        return Trip(now, (ride, walk)) if ride is not None and walk is not None else None

    def point_of(self, station: str) -> Point2:
        """Return where a station is, ENU metres."""
        x, y = self.stations[station].position[:2]
        return x, y

    def _ride(
        self, start: Point2, end: Point2, depart: float, origin: str | None, destination: str | None
    ) -> Leg | None:
        way = self.way(start, end)
        if not math.isfinite(way.metres):
            return None
        seconds = way.seconds(BIKE_SPEED) + (DISMOUNT if destination is not None else 0.0)
        price = round(ride_price(seconds, returned=True), 2)
        return Leg(
            "bike",
            start,
            end,
            way.path,
            depart,
            depart + seconds,
            way.metres,
            price=price,
            origin=origin,
            destination=destination,
        )


def _polyline(points: list[Point2]) -> NDArray[np.float64]:
    return np.array(points, np.float64).reshape(-1, 2)
