"""Rules of lanes, junctions and bus lines: what follows one another does so in space."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from vico.geometry import distances
from vico.rules import BUS_DOOR_REACH, BUS_DOORS_BEHIND_FRONT, BUS_WIDTH, TRAM_SECTIONS
from vico.world.check.finding import WorldFinding
from vico.world.rails import TRAM_LENGTH, Track, tram_door
from vico.world.transit_model import Stop
from vico.world.world import World

# Metres beside the place to wait where one may stand instead.
_BESIDE = 1.0


def check_roads(world: World) -> Iterator[WorldFinding]:
    """Check that lanes follow one another end to end, and most of the network can be driven round."""
    lanes = world.lanes
    rows = np.repeat(np.arange(len(lanes)), np.diff(lanes.next_first))
    ends = lanes.points[lanes.first[rows + 1] - 1]
    starts = lanes.points[lanes.first[lanes.next]]
    gap = distances(ends, starts)
    for k in np.flatnonzero(gap > 1.0).tolist():
        yield WorldFinding(
            "lanes apart", lanes.ids[int(rows[k])], f"{gap[k]:.1f} m from its successor {lanes.ids[int(lanes.next[k])]}"
        )
    ids = {road.id for road in world.roads.roads}
    for junction in world.roads.junctions:
        for name in junction.roads:
            if name not in ids:
                yield WorldFinding("junction road", junction.id, f"there is no road {name}")


def _check_waiting(world: World, stop: Stop) -> Iterator[WorldFinding]:
    """Check that one can stand where one waits at a stop, and board the bus from there."""
    lanes = world.lanes
    x, y, yaw = lanes.at(lanes.index[stop.lane], stop.offset - np.array(BUS_DOORS_BEHIND_FRONT)).T
    aside = BUS_WIDTH / 2 * (-1.0 if lanes.lefthand else 1.0)
    away = np.hypot(x + np.sin(yaw) * aside - stop.wait[0], y - np.cos(yaw) * aside - stop.wait[1]).min()
    if away > BUS_DOOR_REACH:
        yield WorldFinding("stop out of reach", stop.id, f"its bus's doors are {away:.1f} m from where one waits")
    walkable, here = world.walkable, np.array(stop.wait[:2])
    low, high = walkable.cell_of([here - _BESIDE, here + _BESIDE])
    # A shelter may stand where one waits: a step beside it will do.
    room = walkable.connected[low[1] : high[1] + 1, low[0] : high[0] + 1]
    if not (bool(walkable.inside(here)) and room.any()):
        yield WorldFinding("stop blocked", stop.id, "nobody can stand where one waits")


def check_transit(world: World) -> Iterator[WorldFinding]:
    """Check that lines drive over lanes that follow one another, past their stops, where people can wait."""
    lanes, transit = world.lanes, world.transit
    stops = {stop.id: stop for stop in transit.stops}
    for stop in transit.stops:
        if stop.lane not in lanes.index:
            yield WorldFinding("stop lane", stop.id, f"there is no lane {stop.lane}")
        elif not 0.0 <= stop.offset <= float(lanes.length[lanes.index[stop.lane]]) + 0.01:
            yield WorldFinding("stop lane", stop.id, f"{stop.offset} m is beyond the end of {stop.lane}")
        elif any(stop.id in line.stops for line in transit.lines):
            yield from _check_waiting(world, stop)
    for line in transit.lines:
        missing = [name for name in line.lanes if name not in lanes.index]
        if missing or any(name not in stops for name in line.stops):
            yield WorldFinding("line lost", line.id, f"unknown lanes or stops: {', '.join(missing[:3]) or 'stops'}")
            continue
        numbers = [lanes.index[name] for name in line.lanes]
        for a, b in zip(numbers, numbers[1:] + numbers[:1], strict=True):
            beside = b in (int(lanes.left[a]), int(lanes.right[a]))
            if a != b and b not in lanes.following(a) and not beside:
                yield WorldFinding("line broken", line.id, f"no way from {lanes.ids[a]} to {lanes.ids[b]}")
        for name in line.stops:
            if stops[name].lane not in line.lanes:
                yield WorldFinding("line misses stop", line.id, f"{name} is not on its way")
        if len(line.travel) != len(line.stops) + 1 or any(np.diff(line.travel) <= 0):
            yield WorldFinding("line timetable", line.id, "its times do not increase from stop to stop and back")


def check_rails(world: World) -> Iterator[WorldFinding]:
    """Check that trams call at stops of their own tracks, in order and in time, where people can wait."""
    transit = world.transit
    stops = {stop.id: stop for stop in transit.tram_stops}
    for line in transit.tram_lines:
        if len(line.track) < 2 or len(line.offsets) != len(line.stops) or any(name not in stops for name in line.stops):
            yield WorldFinding("line lost", line.id, "it has no track, or stops that are not there")
            continue
        track = Track(line.track)
        beyond = any(not TRAM_LENGTH <= offset <= track.length for offset in line.offsets)
        if beyond or any(np.diff(line.offsets) <= 0):
            yield WorldFinding("line misses stop", line.id, "its stops do not follow one another on its track")
        if len(line.travel) != len(line.stops) + 1 or any(np.diff(line.travel) <= 0):
            yield WorldFinding("line timetable", line.id, "its times do not increase from stop to stop")
        for name, offset in zip(line.stops, line.offsets, strict=True):
            wait = stops[name].wait
            doors = [tram_door(track, offset, k, side)[0] for k in range(2 * TRAM_SECTIONS) for side in (1.0, -1.0)]
            away = min(math.dist(door, wait[:2]) for door in doors)
            if away > BUS_DOOR_REACH:
                yield WorldFinding("stop out of reach", name, f"the tram's doors are {away:.1f} m from where one waits")
