"""The record of a bus line: its drive over lanes and its timetable.

A tenth of a round, `BUS_LAYOVER` seconds at the least, is waited for at the first stop: a bus that comes late leaves on
time all the same. But one that stands at a stop until its time holds up everybody behind it. What a round leaves over
beyond that is therefore driven: first by a way about (in truth the bus would be beyond the window's edge), then by
driving slower between stops; only what still remains is waited for, too.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from vico.geo.gtfs_feed import DAY
from vico.rules import BUS_DWELL, BUS_LAYOVER
from vico.world.transit import Line, Stop
from vico.worldgen.transit.drive import BUS_LENGTH, Berth, Drive

BUS_SPEED = 10.0
DWELL = BUS_DWELL
FIRST_DEPARTURE, LAST_DEPARTURE = 5 * 3600, 23 * 3600
HEADWAY = (360.0, 600.0)

# Share of a round kept at the first stop to make up for what was lost on the way, and the most seconds of it: longer
# nobody is held up behind a bus that waits for its time.
_LAYOVER_SHARE, _MOST_LAYOVER = 0.1, 60.0
_BUSY = 1.17  # times as long a round takes with 60 cars in central Helsinki: so much time our own plans give it
_JUNCTION_SECONDS = 6.0
_SIGNAL_SECONDS = 12.0  # that a junction with signals costs
_STOP_SECONDS = 10.0  # that braking for a stop and starting from it cost
_SLOWEST = 4.8  # m/s between stops; buses that have time drive no slower than a little below it
_SMALL = 25.0  # seconds over that are not worth a way about
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
        whole = clock * _BUSY + _layover(clock)
        headway = float(interval or max(whole / max(1, math.ceil(whole / HEADWAY[1])), HEADWAY[0]))
        # Whole minutes, so that the timetable can be read.
        headway = math.ceil(headway / 60.0) * 60.0
        times = list(range(first + later % int(headway), last + 1, int(headway)))
    legs[-1] = _way_about(drive, loop[-1], legs[-1], loop[0], min(_spare(clock, headway), _LONGEST_WAY_ABOUT))
    travel = [0.0]
    clock = slowest = 0.0
    for start, leg, end in _rows(loop, legs):
        clock += _seconds(drive, start, leg, end)
        slowest += _metres(drive, start, leg, end) / _SLOWEST + _waits(drive, start, leg) + _STOP_SECONDS + DWELL
        travel.append(round(clock, 1))
        clock += DWELL
    spare = min(_spare(clock, headway), max(slowest - clock, 0.0))
    rest = _rounds(clock, headway) * headway - clock
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


def _layover(clock: float) -> float:
    """Return how long a bus whose round takes `clock` seconds is to wait at the first stop."""
    return min(max(_LAYOVER_SHARE * clock, BUS_LAYOVER), _MOST_LAYOVER)


def _rounds(clock: float, headway: float) -> int:
    """Return how many departures there are in the time of a round and its layover."""
    return max(1, math.ceil((clock + _layover(clock)) / headway))


def _spare(clock: float, headway: float) -> float:
    """Return the seconds of a round that are neither driven nor waited for."""
    return _rounds(clock, headway) * headway - clock - _layover(clock)


def _rows(loop: Sequence[Berth], legs: Sequence[Sequence[int]]) -> list[tuple[Berth, Sequence[int], Berth]]:
    return list(zip(loop, legs, [*loop[1:], loop[0]], strict=True))


def _seconds(drive: Drive, start: Berth, leg: Sequence[int], end: Berth) -> float:
    """How long a leg takes."""
    lanes = drive.lanes
    driven = [start.lane, *leg]
    seconds = sum(float(lanes.length[i] / min(lanes.speed[i], BUS_SPEED)) for i in driven)
    seconds -= start.offset / min(float(lanes.speed[start.lane]), BUS_SPEED)
    seconds -= float(lanes.length[end.lane] - end.offset) / min(float(lanes.speed[end.lane]), BUS_SPEED)
    # Drives in traffic take a quarter longer than at the limit.
    return max(seconds, 0.0) * 1.25 + _waits(drive, start, leg) + 4.0


def _waits(drive: Drive, start: Berth, leg: Sequence[int]) -> float:
    """How long the junctions of a leg are waited for."""
    lanes = drive.lanes
    driven = [start.lane, *leg]
    # Every passage of a junction counts, also of one that is passed again; its lanes follow one another.
    zones = [int(z) for z in lanes.zone[driven]]
    entered = [lane for lane, a, b in zip(driven, [-1, *zones], zones, strict=False) if b >= 0 and a != b]
    signalled = [lane for lane in entered if lanes.inside[lane] >= 0 and lanes.signals[lanes.inside[lane]]]
    return _JUNCTION_SECONDS * (len(entered) - len(signalled)) + _SIGNAL_SECONDS * len(signalled)


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
