"""A city as arrays: where one can walk, the stops with their timetable, the bicycle stations."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.clock import DAY
from vico.world.public import PublicMap
from vico.world.timetable import LineTimes, TramTimes
from vico.world.transit_model import Stop, TramStop


class CityArrays(NamedTuple):
    """What the abstract city knows of a world.

    Attributes
    ----------
    half, cell
        Half the side of the square, and the side of a cell, metres.
    clearance
        Metres to the nearest solid thing from each cell, 0 where one cannot be, shape ``(n, n)``, ``[iy, ix]``.
    stop_xy
        Where one waits at each stop, shape ``(stops, 2)``.
    station_xy
        Bicycle stations, shape ``(stations, 2)``.
    gives, takes
        Whether a station has a bicycle, and room for one; bool.
    call_stop, call_line, call_after
        Of each call of a line at a stop, ordered by stop: the stop, the line, and the seconds from the beginning of its
        round to the arrival there.
    first_call
        Of each stop the first of its calls, and after the last stop their number; int64.
    next_call
        Of each call the next one of its line, -1 after the last.
    begins, first_begin
        When the rounds of a line begin, seconds of the day, one line after the other; where each line's are.
    dwell
        Seconds that a bus stands at a stop.
    """

    half: float
    cell: float
    clearance: NDArray[np.float32]
    stop_xy: NDArray[np.float64]
    station_xy: NDArray[np.float64]
    gives: NDArray[np.bool_]
    takes: NDArray[np.bool_]
    call_stop: NDArray[np.int64]
    call_line: NDArray[np.int64]
    call_after: NDArray[np.float64]
    first_call: NDArray[np.int64]
    next_call: NDArray[np.int64]
    begins: NDArray[np.float64]
    first_begin: NDArray[np.int64]
    dwell: float


def city_arrays(public_map: PublicMap, *, dwell: float) -> CityArrays:
    """Return a public map as arrays.

    Parameters
    ----------
    dwell
        Seconds that a bus stands at a stop.
    """
    walkable = public_map.walkable
    clearance = np.where(walkable.connected, walkable.clearance, 0.0).astype(np.float32)
    stops: list[Stop | TramStop] = [*public_map.stops, *public_map.tram_stops]
    number = {stop.id: k for k, stop in enumerate(stops)}
    times: list[LineTimes | TramTimes] = [LineTimes.of(line) for line in public_map.lines if line.departures]
    times += [TramTimes(line) for line in public_map.tram_lines if line.departures]
    calls: list[tuple[int, int, int, float]] = []  # stop, line, order, seconds after the round begins
    begins: list[list[float]] = []
    for line, found in enumerate(times):
        begins.append([found.begins(k) for k in range(len(found.line.departures))])
        # A bus stands at its first stop before it leaves; there its round begins.
        after = [found.arrives(0, k) - found.begins(0) for k in range(len(found.line.stops))]
        if found.round and after:
            after[0] -= dwell
        calls += [(number[stop], line, k, after[k]) for k, stop in enumerate(found.line.stops) if stop in number]
    calls.sort()
    index = {(line, order): k for k, (_, line, order, _) in enumerate(calls)}
    of_stop = np.array([call[0] for call in calls], np.int64)
    return CityArrays(
        half=float(walkable.half),
        cell=float(walkable.cell),
        clearance=np.ascontiguousarray(clearance),
        stop_xy=np.array([stop.wait[:2] for stop in stops], np.float64).reshape(-1, 2),
        station_xy=np.array([s.position[:2] for s in public_map.bike_stations], np.float64).reshape(-1, 2),
        gives=np.array([s.bikes > 0 for s in public_map.bike_stations], np.bool_),
        takes=np.array([s.bikes < s.capacity for s in public_map.bike_stations], np.bool_),
        call_stop=of_stop,
        call_line=np.array([call[1] for call in calls], np.int64),
        call_after=np.array([call[3] for call in calls], np.float64),
        first_call=np.searchsorted(of_stop, np.arange(len(stops) + 1)).astype(np.int64),
        next_call=np.array([index.get((line, order + 1), -1) for _, line, order, _ in calls], np.int64),
        begins=np.array([b for line in begins for b in line], np.float64),
        first_begin=np.cumsum([0, *(len(b) for b in begins)]).astype(np.int64),
        dwell=float(dwell),
    )


def is_sound(city: CityArrays) -> bool:
    """Whether the rounds of every line begin one after the other, within two days."""
    parts = [city.begins[a:b] for a, b in pairwise(city.first_begin.tolist())]
    return all((np.diff(part) >= 0).all() and part[-1] < 2 * DAY for part in parts)
