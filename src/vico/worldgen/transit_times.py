"""The record of a bus line: its drive over lanes and its timetable."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise

from vico.geo.gtfs import DAY
from vico.world.model import Line, Stop
from vico.worldgen.transit_drive import BUS_LENGTH, Berth, Drive

BUS_SPEED = 10.0
DWELL = 30.0
FIRST_DEPARTURE, LAST_DEPARTURE = 5 * 3600, 23 * 3600
HEADWAY = (360.0, 600.0)

_JUNCTION_SECONDS = 6.0
_STOP_SECONDS = 10.0  # that braking for a stop and starting from it cost
_SLOWEST = 5.5  # m/s between stops; buses that have time drive no slower than a little below it
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")


def line_record(
    number: int,
    name: str,
    loop: Sequence[Berth],
    drive: Drive,
    stops: Mapping[Berth, Stop],
    *,
    colour: str = "",
    departures: Sequence[int] = (),
    interval: int | None = None,
    hours: tuple[int, int] | None = None,
) -> Line:
    """Drive a loop and time it.

    Parameters
    ----------
    number
        Of the line in its world.
    loop
        Berths in the order they are served.
    stops
        Record of each berth's stop.
    colour
        ``#rrggbb``; one of ours where empty.
    departures
        From the first stop, seconds of the day, where a timetable gives them.
    interval, hours
        Seconds between buses and the first and last of the day, where the map says; planned otherwise: as many buses
        as make it six to ten minutes.
    """
    lanes = drive.lanes
    for _ in loop:
        # The round must not begin in the middle of a lane that an earlier stop is on: it would drive the lane twice.
        if loop[-1].lane != loop[0].lane or loop[0].offset <= loop[-1].offset + BUS_LENGTH:
            break
        early = DWELL + (loop[0].offset - loop[-1].offset) / BUS_SPEED
        departures = sorted(round(when - early) % DAY for when in departures)
        loop = [loop[-1], *loop[:-1]]
    chain = [loop[0].lane]
    travel = [0.0]
    clock = slowest = 0.0
    for k, (start, end) in enumerate(zip(loop, [*loop[1:], loop[0]], strict=True)):
        leg = drive.lanes_between(start, end)
        driven = [start.lane, *leg]
        seconds = sum(float(lanes.length[i] / min(lanes.speed[i], BUS_SPEED)) for i in driven)
        seconds -= start.offset / min(float(lanes.speed[start.lane]), BUS_SPEED)
        seconds -= float(lanes.length[end.lane] - end.offset) / min(float(lanes.speed[end.lane]), BUS_SPEED)
        junctions = len({int(z) for z in lanes.zone[driven] if z >= 0})
        # Drives in traffic take a quarter longer than at the limit, and every junction is waited for a little.
        clock += max(seconds, 0.0) * 1.25 + _JUNCTION_SECONDS * junctions + 4.0
        metres = float(lanes.length[driven].sum()) - start.offset - float(lanes.length[end.lane]) + end.offset
        slowest += metres / _SLOWEST + _STOP_SECONDS + DWELL
        travel.append(round(clock, 1))
        clock += DWELL
        chain += leg if k < len(loop) - 1 else leg[:-1]
    if departures:
        times = list(departures)
        gaps = sorted(b - a for a, b in pairwise(times))
        headway = float(gaps[len(gaps) // 2]) if gaps else clock
    else:
        first, last = hours or (FIRST_DEPARTURE, LAST_DEPARTURE)
        headway = float(interval or max(clock / max(1, math.ceil(clock / HEADWAY[1])), HEADWAY[0]))
        # Whole minutes, so that the timetable can be read.
        headway = math.ceil(headway / 60.0) * 60.0
        times = list(range(first, last + 1, int(headway)))
    # A bus that waits for its next round at one stop is in others' way: what is left over is spread over the drives,
    # as far as buses drive that slowly.
    rest = max(1, math.ceil(clock / headway)) * headway - clock
    spare = min(rest, max(slowest - clock, 0.0))
    under_way = [t - DWELL * max(i - 1, 0) for i, t in enumerate(travel)]
    travel = [round(t + spare * share / max(under_way[-1], 1.0), 1) for t, share in zip(travel, under_way, strict=True)]
    return Line(
        id=f"line_{number}",
        name=name,
        colour=colour or COLOURS[number % len(COLOURS)],
        stops=[stops[berth].id for berth in loop],
        lanes=[lanes.ids[i] for i in chain],
        departures=times,
        travel=travel,
    )
