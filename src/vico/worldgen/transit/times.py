"""The record of a bus line: its drive over lanes and its timetable.

A bus that stands at a stop until its time holds up everybody behind it. What a round leaves over until the next
departure is therefore driven: first by a way about (in truth the bus would be beyond the window's edge), then by
driving slower between stops; only what still remains is waited for at the first stop.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from vico.geo.gtfs.feed import DAY
from vico.world.model import Line, Stop
from vico.worldgen.transit.drive import BUS_LENGTH, Berth, Drive

BUS_SPEED = 10.0
DWELL = 30.0
FIRST_DEPARTURE, LAST_DEPARTURE = 5 * 3600, 23 * 3600
HEADWAY = (360.0, 600.0)

_JUNCTION_SECONDS = 6.0
_STOP_SECONDS = 10.0  # that braking for a stop and starting from it cost
_SLOWEST = 5.5  # m/s between stops; buses that have time drive no slower than a little below it
_SMALL = 25.0  # seconds over that are not worth a way about
_RESERVE = 45.0  # seconds of a round kept to make up for traffic
_LONGEST_WAY_ABOUT = 600.0  # seconds: none drives about for longer, however rare its buses are
_MOST_BENDS = 4
_TRIALS = 24
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")


@dataclass(frozen=True)
class Timing:
    """A round and its times.

    Attributes
    ----------
    loop
        Berths in the order they are served.
    legs
        Lanes after each berth's up to and including the next one's.
    departures
        From the first berth, seconds of the day.
    travel
        Seconds from leaving the first berth to arriving at each, then back at the first.
    idle
        Seconds a bus waits at the first berth, beyond the time that people board in.
    """

    loop: tuple[Berth, ...]
    legs: tuple[tuple[int, ...], ...]
    departures: tuple[int, ...]
    travel: tuple[float, ...]
    idle: float


def timing(
    loop: Sequence[Berth],
    drive: Drive,
    *,
    departures: Sequence[int] = (),
    interval: int | None = None,
    hours: tuple[int, int] | None = None,
    later: int = 0,
) -> Timing:
    """Drive a loop and time it.

    Parameters
    ----------
    loop
        Berths in the order they are served.
    departures
        From the first stop, seconds of the day, where a timetable gives them.
    interval, hours
        Seconds between buses and the first and last of the day, where the map says; planned otherwise: as many buses
        as make it six to ten minutes.
    later
        Seconds by which the first bus of a plan leaves after that hour.
    """
    for _ in loop:
        # The round must not begin in the middle of a lane that an earlier stop is on: it would drive the lane twice.
        if loop[-1].lane != loop[0].lane or loop[0].offset <= loop[-1].offset + BUS_LENGTH:
            break
        early = DWELL + (loop[0].offset - loop[-1].offset) / BUS_SPEED
        departures = sorted(round(when - early) % DAY for when in departures)
        loop = [loop[-1], *loop[:-1]]
    legs = [drive.lanes_between(a, b) for a, b in zip(loop, [*loop[1:], loop[0]], strict=True)]
    clock = sum(_seconds(drive, a, leg, b) + DWELL for a, leg, b in _rows(loop, legs))
    if departures:
        times = list(departures)
        gaps = sorted(b - a for a, b in pairwise(times))
        headway = float(gaps[len(gaps) // 2]) if gaps else clock
    else:
        first, last = hours or (FIRST_DEPARTURE, LAST_DEPARTURE)
        headway = float(interval or max(clock / max(1, math.ceil(clock / HEADWAY[1])), HEADWAY[0]))
        # Whole minutes, so that the timetable can be read.
        headway = math.ceil(headway / 60.0) * 60.0
        times = list(range(first + later % int(headway), last + 1, int(headway)))
    rest = max(1, math.ceil(clock / headway)) * headway - clock
    legs[-1] = _way_about(drive, loop[-1], legs[-1], loop[0], min(rest - _RESERVE, _LONGEST_WAY_ABOUT))
    travel = [0.0]
    clock = slowest = 0.0
    for start, leg, end in _rows(loop, legs):
        clock += _seconds(drive, start, leg, end)
        slowest += _metres(drive, start, leg, end) / _SLOWEST + _STOP_SECONDS + DWELL
        travel.append(round(clock, 1))
        clock += DWELL
    rest = max(1, math.ceil(clock / headway)) * headway - clock
    spare = min(rest, max(slowest - clock, 0.0))
    under_way = [t - DWELL * max(i - 1, 0) for i, t in enumerate(travel)]
    travel = [round(t + spare * share / max(under_way[-1], 1.0), 1) for t, share in zip(travel, under_way, strict=True)]
    return Timing(tuple(loop), tuple(tuple(leg) for leg in legs), tuple(times), tuple(travel), rest - spare)


def line_record(number: int, name: str, times: Timing, drive: Drive, stops: Mapping[Berth, Stop], colour: str) -> Line:
    """Record a timed round.

    Parameters
    ----------
    number
        Of the line in its world.
    stops
        Record of each berth's stop.
    colour
        ``#rrggbb``; one of ours where empty.
    """
    chain = [times.loop[0].lane, *(lane for leg in times.legs for lane in leg)][:-1]
    return Line(
        id=f"line_{number}",
        name=name,
        colour=colour or COLOURS[number % len(COLOURS)],
        stops=[stops[berth].id for berth in times.loop],
        lanes=[drive.lanes.ids[i] for i in chain],
        departures=list(times.departures),
        travel=list(times.travel),
    )


def _rows(loop: Sequence[Berth], legs: Sequence[Sequence[int]]) -> list[tuple[Berth, Sequence[int], Berth]]:
    return list(zip(loop, legs, [*loop[1:], loop[0]], strict=True))


def _seconds(drive: Drive, start: Berth, leg: Sequence[int], end: Berth) -> float:
    """How long a leg takes."""
    lanes = drive.lanes
    driven = [start.lane, *leg]
    seconds = sum(float(lanes.length[i] / min(lanes.speed[i], BUS_SPEED)) for i in driven)
    seconds -= start.offset / min(float(lanes.speed[start.lane]), BUS_SPEED)
    seconds -= float(lanes.length[end.lane] - end.offset) / min(float(lanes.speed[end.lane]), BUS_SPEED)
    # Every passage of a junction counts, also of one that is passed again; its lanes follow one another.
    zones = [int(z) for z in lanes.zone[driven]]
    junctions = sum(b >= 0 and a != b for a, b in pairwise([-1, *zones]))
    # Drives in traffic take a quarter longer than at the limit, and every junction is waited for a little.
    return max(seconds, 0.0) * 1.25 + _JUNCTION_SECONDS * junctions + 4.0


def _metres(drive: Drive, start: Berth, leg: Sequence[int], end: Berth) -> float:
    length = drive.lanes.length
    return float(length[[start.lane, *leg]].sum()) - start.offset - float(length[end.lane]) + end.offset


def _way_about(drive: Drive, start: Berth, leg: list[int], end: Berth, rest: float) -> list[int]:
    """Return the leg from the last stop to the first, longer by nearly `rest` seconds where the streets allow it."""
    base = _seconds(drive, start, leg, end)
    bends: list[Berth] = []
    best = leg
    for _ in range(_MOST_BENDS):
        left = base + rest - _seconds(drive, start, best, end)
        if left < _SMALL:
            break
        last = bends[-1] if bends else start
        done = best[: len(best) - len(drive.lanes_between(last, end))]
        found: tuple[float, list[int], Berth] | None = None
        for bend in _bends(drive, last, end, left):
            trial = [*done, *drive.lanes_between(last, bend), *drive.lanes_between(bend, end)]
            longer = _seconds(drive, start, trial, end) - base
            turns = int(drive.uturn[trial].sum()) > int(drive.uturn[leg].sum())
            if longer <= rest and not turns and (found is None or longer > found[0] + 1.0):
                found = longer, trial, bend
        if found is None or found[0] <= rest - left + 1.0:
            break
        best = found[1]
        bends.append(found[2])
    return best


def _bends(drive: Drive, start: Berth, end: Berth, seconds: float) -> list[Berth]:
    """Lanes to drive by on the way to a stop that make it longer by up to so many seconds, spread over the lengths."""
    lanes = drive.lanes
    drive.prepare([start])
    extra = drive.costs_from(start.lane) + drive.costs_to(end.lane)
    extra = extra - (drive.costs_from(start.lane)[end.lane] if start.lane != end.lane else 0.0)
    usable = (lanes.inside < 0) & np.isfinite(extra) & (extra > 40.0) & (extra < seconds * BUS_SPEED)
    usable[[start.lane, end.lane]] = False
    found = np.flatnonzero(usable)
    found = found[np.argsort(extra[found], kind="stable")]
    if len(found) > _TRIALS:
        found = found[np.unique(np.linspace(0, len(found) - 1, _TRIALS).round().astype(int))]
    bends = [Berth("", "", int(lane), float(lanes.length[lane]) / 2) for lane in found]
    # Where there is but one way to go round, it is gone once more, past the stop.
    return [*bends, end]
