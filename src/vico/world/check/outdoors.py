"""Rules of streets, entrances, places and objects outdoors.

Lanes, lines and tracks that follow one another do so in space. Entrances and places exist, belong together, and can be
reached on foot. Objects stand on the ground, and in nothing else.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.geo import overlay
from vico.geometry import direction, distances
from vico.rules import BUS_DOOR_REACH, BUS_DOORS_BEHIND_FRONT, BUS_WIDTH, TRAM_SECTIONS
from vico.world.check.buildings import outline_of
from vico.world.heights import HeightField
from vico.world.model import Entrance, Place, WorldFinding
from vico.world.transit import TRAM_LENGTH, Stop, Track, tram_door
from vico.world.walkable import WalkableMap
from vico.world.world import World

_TOUCH = 0.01  # square metres of outlines that may overlap
_KERB = 0.4  # metres at each side of a lane that no vehicle's body sweeps
_JOINED = ("fence", "wall", "guard_rail", "hedge", "retaining_wall")  # pieces of a barrier meet, and meet their posts


def check_objects(world: World) -> Iterator[WorldFinding]:
    """Check that nothing outdoors stands in a building, beyond the edge, or off the ground; everything has a model."""
    objects = world.objects
    models = world.prototypes()
    for name in sorted(set(objects.prototype.tolist()) - set(models)):
        yield WorldFinding("object without model", name, "prototypes.glb has no such node")
    outside = np.flatnonzero(objects.outdoors)
    # Roofs on posts and storeys over passages don't count: what stands below them stands outdoors.
    standing = [
        body.positions[: len(body.positions) // 2]
        for body in world.surfaces("collision")
        if float(body.positions[:, 2].min()) < float(world.height(body.positions[:, :2]).max()) + 2.2
    ]
    tree = shapely.STRtree([shapely.Polygon(ring[:, :2].astype(np.float64)) for ring in standing])
    points = shapely.points(objects.position[outside, :2])
    for k in np.unique(tree.query(points, predicate="within")[0]).tolist():
        yield WorldFinding("object in a building", str(objects.id[outside[k]]), "it stands inside a wall")
    for k in outside[np.abs(objects.position[outside, :2]).max(axis=1) > world.half].tolist():
        yield WorldFinding("object beyond the edge", str(objects.id[k]), "it stands outside the world's square")
    off = np.abs(world.height(objects.position[outside]) - objects.z[outside]) > 0.05
    for k in outside[off].tolist():
        yield WorldFinding("object not seated", str(objects.id[k]), "its foot is not at ground level")


def check_clearances(world: World) -> Iterator[WorldFinding]:
    """Check that nothing solid stands on a lane that is driven, nor in another solid thing."""
    objects = world.objects
    solid = np.flatnonzero(objects.outdoors & objects.solid)
    if not len(solid):
        return
    feet = shapely.polygons(objects.feet()[solid])
    lanes = world.lanes
    driven = np.flatnonzero(lanes.inside < 0) if len(lanes) else np.zeros(0, np.int64)
    if len(driven):
        # What vehicles sweep on each lane: a little narrower than the lane.
        lines = np.array([shapely.LineString(lanes.line(int(k))[:, :2]) for k in driven], object)
        bands = np.asarray(overlay.buffer(lines, lanes.width[driven] / 2 - _KERB, cap_style="flat"), object)
        for k, lane in np.column_stack(shapely.STRtree(bands).query(feet, predicate="intersects")).tolist():
            inside = float(overlay.common_area(feet[k], bands[lane]))
            if inside > _TOUCH:
                what = f"{inside:.2f} m2 of its foot stand on lane {lanes.ids[int(driven[lane])]}"
                yield WorldFinding("object on a lane", str(objects.id[solid[k]]), what)
    left, right = shapely.STRtree(feet).query(feet, predicate="intersects")
    chosen = left < right
    for a, b in zip(left[chosen].tolist(), right[chosen].tolist(), strict=True):
        if str(objects.kind[solid[a]]) in _JOINED and str(objects.kind[solid[b]]) in _JOINED:
            continue
        common = float(overlay.common_area(feet[a], feet[b]))
        if common > _TOUCH:
            what = f"{common:.2f} m2 of its foot stand in {objects.id[solid[b]]}"
            yield WorldFinding("objects overlap", str(objects.id[solid[a]]), what)


_APPROACH = 2.0  # metres between a door and the spot in front of it
_FRONT = 0.2  # metres before a door that lie outside its building
_ON_WALL = 0.05


def check_entrances(world: World) -> Iterator[WorldFinding]:
    """Check that doors lie in the walls of their buildings, and can be walked up to."""
    outlines = {b.id: outline_of(b) for b in world.buildings}
    for door in world.entrances:
        yield from entrance_findings(door, outlines.get(door.building), world.walkable, world.height)


def entrance_findings(
    door: Entrance, outline: shapely.Polygon | None, walkable: WalkableMap, height: HeightField
) -> Iterator[WorldFinding]:
    """Check one door; `outline` is its building's, None if there is no such building."""
    if outline is None:
        yield WorldFinding("entrance lost", door.id, f"there is no building {door.building}")
        return
    away = outline.exterior.distance(shapely.Point(door.position[:2]))
    if away > _ON_WALL:
        yield WorldFinding("entrance off the wall", door.id, f"{away:.2f} m from the outline of {door.building}")
    step = math.dist(door.position[:2], door.approach)
    if step > _APPROACH:
        yield WorldFinding("entrance far", door.id, f"its approach is {step:.2f} m away")
    if not bool(walkable.is_connected(door.approach)):
        yield WorldFinding("entrance blocked", door.id, "its approach can't be reached on foot from the map's edge")
    if abs(float(height(door.position)) - door.position[2]) > 0.05:
        yield WorldFinding("entrance not seated", door.id, "it is not at ground level")
    if bool(faces_into(outline, np.array([door.position[:2]]), direction(door.facing)[None])[0]):
        yield WorldFinding("entrance turned", door.id, "it faces into the building")


def faces_into(outline: shapely.Polygon, position: NDArray[np.float64], out: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which doors face into their building, shape ``(n,)``: what lies before them is inside its outline.

    Parameters
    ----------
    outline
        The building's.
    position, out
        Where the doors are, metres, and unit vectors of the way they face, shape ``(n, 2)``.
    """
    front = position + _FRONT * out
    return np.asarray(shapely.contains_xy(outline, front[:, 0], front[:, 1]), bool)


def check_places(world: World) -> Iterator[WorldFinding]:
    """Check that buildings, entrances, rooms and places agree on who belongs where."""
    seen: set[str] = set()
    open_doors = {e.building for e in world.entrances}
    for building in world.buildings:
        if building.accessible != (building.id in open_doors):
            yield WorldFinding("building access", building.id, "`accessible` disagrees with its entrances")
    for place in world.places:
        if place.id in seen:
            yield WorldFinding("place twice", place.id, "two places have this id")
        seen.add(place.id)
        if (place.building is None) != (place.entrance is None):
            yield WorldFinding("place half inside", place.id, "it has a building or an entrance, but not both")
        if place.building is not None and place.building not in world.building_by_id:
            yield WorldFinding("place lost", place.id, f"there is no building {place.building}")
        if place.entrance is not None:
            door = world.entrance_by_id.get(place.entrance)
            if door is None:
                yield WorldFinding("place lost", place.id, f"there is no entrance {place.entrance}")
            elif door.building != place.building:
                yield WorldFinding("place lost", place.id, f"its entrance belongs to {door.building}")
        if not is_reachable(place, world.walkable):
            yield WorldFinding("place unreachable", place.id, "its position can't be reached on foot")
        if place.building is not None and not place.rooms:
            yield WorldFinding("place empty", place.id, "it is in a building, but has no room")
        for name in place.rooms:
            room = world.room_by_id.get(name)
            if room is None or room.place != place.id:
                yield WorldFinding("room lost", place.id, f"there is no room {name} of this place")


def is_reachable(place: Place, walkable: WalkableMap) -> bool:
    """Whether one can walk to a place from the map's edge."""
    return bool(walkable.is_connected(place.position[:2]))


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
