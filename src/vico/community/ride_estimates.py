"""What a ride costs at least, about: to leave out most of the many that are worth nobody's while."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vico.community.model import Mode
from vico.rules import BIKE_SPEED, BUS_DWELL, WALK_SPEED
from vico.world.folder import World
from vico.world.model import Place, Point2
from vico.world.routing import Router
from vico.world.timetable import LineTimes

# What is measured on large cells, over open ground and round their corners, is longer than the walk by up to so much.
_OVER = 0.8
# So many of the quickest rides by bicycle are looked at closely.
_LIKELY = 8


class RideEstimates:
    """Least times from door to door by bus or bicycle, waiting left out.

    Walks to and from each stop and station are measured for all places in one search, on cells of 2 m.

    Parameters
    ----------
    world
        Its places and its transit.
    """

    def __init__(self, world: World) -> None:
        self._router = Router(world.walkable.coarser().coarser())
        self._positions = np.array([place.position[:2] for place in world.places], np.float64).reshape(-1, 2)
        self._number = {place.id: k for k, place in enumerate(world.places)}
        transit = world.transit
        stops = {stop.id: (stop.wait[0], stop.wait[1]) for stop in transit.stops}
        served = list(dict.fromkeys(name for line in transit.lines for name in line.stops))
        number = {name: k for k, name in enumerate(served)}
        rides = np.full((len(served), len(served)), np.inf)
        for line in transit.lines:
            times, n = LineTimes.of(line), len(line.stops)
            for first in range(n):
                for last in range(first + 1, first + n):
                    onward = times.line.travel[n] + BUS_DWELL if last > n else 0.0
                    seconds = onward + line.travel[last - n if last > n else last] - line.travel[first]
                    a, b = number[line.stops[first]], number[line.stops[last % n]]
                    rides[a, b] = min(rides[a, b], seconds - (BUS_DWELL if first else 0.0))
        racks = [(station.position[0], station.position[1]) for station in transit.bike_stations]
        xy = np.array(racks, np.float64).reshape(-1, 2)
        between = np.hypot(xy[:, None, 0] - xy[None, :, 0], xy[:, None, 1] - xy[None, :, 1]) / BIKE_SPEED
        between[[station.bikes < 1 for station in transit.bike_stations]] = np.inf
        np.fill_diagonal(between, np.inf)
        self._ends = {Mode.BUS: [stops[name] for name in served], Mode.BIKE: racks}
        self._rides = {Mode.BUS: rides, Mode.BIKE: between}
        self._walks: dict[Mode, NDArray[np.float64]] = {}
        self._stations = np.array([station.id for station in transit.bike_stations], np.str_)

    def seconds(self, a: Place, b: Place, mode: Mode, *, on_foot: float = 1.0) -> float:
        """Return the least a ride takes between the doors of two places; infinite if there is none.

        Parameters
        ----------
        on_foot
            What a second on foot counts.
        """
        if not np.isfinite(self._rides[mode]).any():
            return math.inf
        return float(self._between(a, b, mode, on_foot).min())

    def unlikely_stations(self, a: Place, b: Place) -> tuple[str, ...]:
        """Return the bicycle stations, by id, that are on none of the `_LIKELY` quickest rides between two doors."""
        quickest = np.argsort(self._between(a, b, Mode.BIKE, 1.0), axis=None, kind="stable")[:_LIKELY]
        return tuple(np.delete(self._stations, np.unravel_index(quickest, self._rides[Mode.BIKE].shape)).tolist())

    def _between(self, a: Place, b: Place, mode: Mode, on_foot: float) -> NDArray[np.float64]:
        """Return the least seconds of every ride between two doors, by its ends, shape ``(ends, ends)``."""
        walks = self._measured(mode)
        there, on = walks[:, self._number[a.id]], walks[:, self._number[b.id]]
        return np.asarray(on_foot * (there[:, None] + on[None, :]) + self._rides[mode])

    def _measured(self, mode: Mode) -> NDArray[np.float64]:
        """Return the seconds on foot from each end of rides to each place, shape ``(ends, places)``."""
        if mode not in self._walks:
            self._walks[mode] = np.array([self._walk(end) for end in self._ends[mode]])
        return self._walks[mode]

    def _walk(self, end: Point2) -> NDArray[np.float64]:
        walkable = self._router.walkable
        column, row = walkable.cell_of(self._positions).T
        metres = self._router.distance_field(end)[row, column].astype(np.float64) * _OVER
        bee_line = np.hypot(*(self._positions - np.array(end)).T)
        # Where large cells leave no way through, there may be one.
        return np.where(np.isfinite(metres), np.maximum(metres, bee_line), bee_line) / WALK_SPEED
