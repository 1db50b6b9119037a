"""Is a world what it says it is? Everything a consumer relies on, checked one by one."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.errors import VicoError
from vico.world.files import sha256_of
from vico.world.folder import World, world_files
from vico.world.indoor_checks import walkable_inside
from vico.world.lanes import LaneGraph
from vico.world.mesh import Surface, read_glb
from vico.world.model import Building, Room
from vico.world.solid_checks import coplanar_overlaps

_APPROACH = 2.0
_REACH = 1.5
_SEATED = 0.5  # metres a ground floor may lie above the highest ground at its walls
_BODY = 0.25
_FLICKER = 0.05  # square metres of two triangles in one plane that count
_SEEN = 0.5  # square metres of two buildings in one plane that an eye would see
_TOUCH = 0.01  # square metres of outlines that may overlap
_KERB = 0.4  # metres at each side of a lane that no vehicle's body sweeps
_JOINED = ("fence", "wall", "guard_rail", "hedge", "retaining_wall")  # pieces of a barrier meet, and meet their posts


class Finding(NamedTuple):
    """Something wrong.

    Attributes
    ----------
    id
        Which rule.
    where
        Id of the thing (a building, an object, a lane), or a file's name.
    what
        One sentence.
    at
        East and north of it, metres; None for files.
    """

    id: str
    where: str
    what: str
    at: tuple[float, float] | None = None


def check_world(world: World) -> list[Finding]:
    """Check a world.

    Parameters
    ----------
    world
        As read from its folder.

    Returns
    -------
    list of Finding
        Empty if all is well. A file that can't be read is a finding too, and ends the checks that need it.
    """
    findings: list[Finding] = []
    for rule in (
        _files,
        _buildings_closed,
        _buildings_seated,
        _buildings_apart,
        _entrances,
        _places,
        _rooms,
        _containers,
        _indoors,
        _objects,
        _clearances,
        _roads,
        _transit,
        _entities,
    ):
        try:
            findings += rule(world)
        except VicoError as error:
            findings.append(Finding("readable", rule.__name__.strip("_"), str(error)))
    return _located(world, findings) if findings else findings


def _located(world: World, findings: list[Finding]) -> list[Finding]:
    """The findings with the places of the things they name, as far as the world can be read."""
    at: dict[str, tuple[float, float]] = {}
    with contextlib.suppress(VicoError):
        for building in world.buildings:
            middle = _outline(building).representative_point()
            at[building.id] = (middle.x, middle.y)
        at |= {door.id: door.position[:2] for door in world.entrances}
        at |= {place.id: place.position[:2] for place in world.places}
        for room in world.rooms:
            at[room.id] = room.centre[:2]
            at |= {container.id: container.centre[:2] for container in room.containers}
        at |= dict(zip(world.objects.id.tolist(), world.objects.position[:, :2].tolist(), strict=True))
        at |= {stop.id: stop.wait[:2] for stop in world.transit.stops}
        lanes = world.lanes
        for k, name in enumerate(lanes.ids):
            at[name] = tuple(lanes.line(k)[0, :2].tolist())
    found = ((f, at.get(f.where)) for f in findings)
    return [f._replace(at=(round(float(p[0]), 2), round(float(p[1]), 2))) if p is not None else f for f, p in found]


def _files(world: World) -> Iterator[Finding]:
    """Every file is there, and is what was written."""
    if world.path is None:
        return
    listed = world.manifest.files
    there = world_files(world.path)
    for name in sorted(set(listed) - set(there)):
        yield Finding("file missing", name, "listed in world.json, but not there")
    for name in sorted(set(there) - set(listed)):
        yield Finding("file unknown", name, "there, but not listed in world.json")
    for name in there:
        if name in listed and sha256_of(world.path / name) != listed[name]:
            yield Finding("file changed", name, "its SHA-256 is not the one in world.json")


def _buildings_closed(world: World) -> Iterator[Finding]:
    """Walls and roof of each building close, every edge once in each direction, and enclose a positive volume."""
    walls = world.surfaces("buildings") if world.path is None else read_glb(world.file("meshes/buildings.glb"))["walls"]
    surfaces = [*walls, *world.surfaces("roofs")]
    open_edges, volume = closedness(surfaces)
    for building in world.buildings:
        if building.entity not in volume:
            yield Finding("building without mesh", building.id, "no triangle has its entity")
        elif open_edges.get(building.entity):
            yield Finding("building leaks", building.id, f"{open_edges[building.entity]} edges have no counterpart")
        elif volume[building.entity] <= 0.0:
            yield Finding("building inside out", building.id, f"its volume is {volume[building.entity]:.1f} m3")


def closedness(surfaces: list[Surface]) -> tuple[dict[int, int], dict[int, float]]:
    """Edges without a counterpart, and volume (m3), by entity; corners are one where they are equal in the file."""
    corners = np.concatenate([s.positions[s.triangles] for s in surfaces])
    entity = np.concatenate([s.entity[s.triangles[:, 0]] for s in surfaces])
    flat = np.ascontiguousarray(corners.reshape(-1, 3) + np.float32(0.0))
    _, index = np.unique(flat.view(np.dtype((np.void, 12))).ravel(), return_inverse=True)
    index = index.reshape(-1, 3).astype(np.int64)
    count = int(index.max()) + 1 if len(index) else 0
    starts, ends = index.ravel(), np.roll(index, -1, axis=1).ravel()
    owner = np.repeat(entity, 3).astype(np.int64)
    real = starts != ends
    starts, ends, owner = starts[real], ends[real], owner[real]
    # Each edge counts +1 in one direction and -1 in the other: what does not cancel is open.
    forward = starts < ends
    key = (owner * count + np.where(forward, starts, ends)) * count + np.where(forward, ends, starts)
    unique, inverse = np.unique(key, return_inverse=True)
    balance = np.bincount(inverse, weights=np.where(forward, 1.0, -1.0))
    open_edges: dict[int, int] = {}
    for number in (unique[balance != 0] // count // count).tolist():
        open_edges[number] = open_edges.get(number, 0) + 1
    points = corners.astype(np.float64)
    numbers, where = np.unique(entity, return_inverse=True)
    # Volumes about a corner of each body: coordinates far from the origin would drown them in rounding.
    reference = np.zeros((len(numbers), 3))
    reference[where] = points[:, 0]
    points = points - reference[where][:, None, :]
    signed = np.einsum("ni,ni->n", points[:, 0], np.cross(points[:, 1], points[:, 2])) / 6.0
    volume = np.bincount(where, weights=signed, minlength=len(numbers))
    return open_edges, dict(zip(numbers.tolist(), volume.tolist(), strict=True))


def _outline(building: Building) -> shapely.Polygon:
    return shapely.Polygon(building.footprint[0], building.footprint[1:])


def _buildings_seated(world: World) -> Iterator[Finding]:
    """Walls reach the ground all round (unless the whole building hangs), ground floors lie neither high nor deep."""
    lowest: dict[int, float] = {}
    for body in world.surfaces("collision"):
        number = int(body.entity[0])
        lowest[number] = min(lowest.get(number, math.inf), float(body.positions[:, 2].min()))
    for building in world.buildings:
        ground = world.height(np.array(building.footprint[0]))
        low = lowest.get(building.entity, math.inf)
        canopy = building.tags.get("building") == "roof"  # open below, however low it is
        if ground.min() + 0.05 < low < ground.min() + 2.2 and not canopy:
            yield Finding(
                "building floats", building.id, f"its walls begin at {low:.2f} m, the ground at {ground.min():.2f} m"
            )
        if not building.base <= ground.max() + _SEATED:
            yield Finding(
                "building not seated",
                building.id,
                f"its ground floor is at {building.base:.2f} m, the ground at its walls at most {ground.max():.2f} m",
            )
        if building.height <= 0:
            yield Finding("building flat", building.id, f"its height is {building.height} m")
        if not _outline(building).is_valid:
            yield Finding("building outline", building.id, "its footprint crosses itself")


def _buildings_apart(world: World) -> Iterator[Finding]:
    """No two drawn faces of walls and roofs lie in one plane, face the same way and overlap: they would flicker."""
    surfaces = [*world.surfaces("buildings"), *world.surfaces("roofs")]
    numbers = {building.entity: building.id for building in world.buildings}
    corners = np.concatenate([s.positions[s.triangles] for s in surfaces])
    entity = np.concatenate([s.entity[s.triangles[:, 0]] for s in surfaces])
    pairs = coplanar_overlaps(corners, least=_FLICKER, among=np.isin(entity, list(numbers)))
    areas: dict[tuple[int, int], float] = {}
    for a, b, area in zip(pairs.first[pairs.same], pairs.second[pairs.same], pairs.area[pairs.same], strict=True):
        key = (min(int(entity[a]), int(entity[b])), max(int(entity[a]), int(entity[b])))
        areas[key] = areas.get(key, 0.0) + float(area)
    for (one, other), area in sorted(areas.items()):
        if area < _SEEN:
            continue
        whom = "itself" if one == other else numbers[other]
        yield Finding("building faces overlap", numbers[one], f"{area:.2f} m2 lie in one plane with faces of {whom}")


def _entrances(world: World) -> Iterator[Finding]:
    outlines = {b.id: _outline(b) for b in world.buildings}
    for door in world.entrances:
        if door.building not in outlines:
            yield Finding("entrance lost", door.id, f"there is no building {door.building}")
            continue
        outline = outlines[door.building]
        away = outline.exterior.distance(shapely.Point(door.position[:2]))
        if away > 0.05:
            yield Finding("entrance off the wall", door.id, f"{away:.2f} m from the outline of {door.building}")
        step = math.dist(door.position[:2], door.approach)
        if step > _APPROACH:
            yield Finding("entrance far", door.id, f"its approach is {step:.2f} m away")
        if not bool(world.walkable.is_connected(door.approach)):
            yield Finding("entrance blocked", door.id, "its approach can't be reached on foot from the map's edge")
        if abs(float(world.height(door.position)) - door.position[2]) > 0.05:
            yield Finding("entrance not seated", door.id, "it is not at ground level")
        front = (door.position[0] + 0.2 * math.cos(door.facing), door.position[1] + 0.2 * math.sin(door.facing))
        if outline.contains(shapely.Point(front)):
            yield Finding("entrance turned", door.id, "it faces into the building")


def _places(world: World) -> Iterator[Finding]:
    seen: set[str] = set()
    open_doors = {e.building for e in world.entrances}
    for building in world.buildings:
        if building.accessible != (building.id in open_doors):
            yield Finding("building access", building.id, "`accessible` disagrees with its entrances")
    for place in world.places:
        if place.id in seen:
            yield Finding("place twice", place.id, "two places have this id")
        seen.add(place.id)
        if (place.building is None) != (place.entrance is None):
            yield Finding("place half inside", place.id, "it has a building or an entrance, but not both")
        if place.building is not None and place.building not in world.building_by_id:
            yield Finding("place lost", place.id, f"there is no building {place.building}")
        if place.entrance is not None:
            door = world.entrance_by_id.get(place.entrance)
            if door is None:
                yield Finding("place lost", place.id, f"there is no entrance {place.entrance}")
            elif door.building != place.building:
                yield Finding("place lost", place.id, f"its entrance belongs to {door.building}")
        if not bool(world.walkable.is_connected(place.position[:2])):
            yield Finding("place unreachable", place.id, "its position can't be reached on foot")
        if place.building is not None and not place.rooms:
            yield Finding("place empty", place.id, "it is in a building, but has no room")
        for name in place.rooms:
            room = world.room_by_id.get(name)
            if room is None or room.place != place.id:
                yield Finding("room lost", place.id, f"there is no room {name} of this place")


def _box(room: Room) -> shapely.Polygon:
    c, s = math.cos(room.yaw), math.sin(room.yaw)
    x, y = room.size[0] / 2, room.size[1] / 2
    return shapely.Polygon(
        [
            (room.centre[0] + c * u - s * v, room.centre[1] + s * u + c * v)
            for u, v in ((-x, -y), (x, -y), (x, y), (-x, y))
        ]
    )


def _rooms(world: World) -> Iterator[Finding]:
    """No two rooms overlap (neighbours share a wall), and all lie below ground."""
    rooms = world.rooms
    if not rooms:
        return
    boxes = [_box(room) for room in rooms]
    low = np.array([room.centre[2] for room in rooms])
    high = low + np.array([room.size[2] for room in rooms])
    shrunk = shapely.buffer(np.array(boxes), -0.01, join_style="mitre")
    left, right = shapely.STRtree(shrunk).query(shrunk, predicate="intersects")
    clash = (left < right) & (low[left] < high[right]) & (low[right] < high[left])
    for i, j in zip(left[clash].tolist(), right[clash].tolist(), strict=True):
        yield Finding("rooms overlap", rooms[i].id, f"it overlaps {rooms[j].id}")
    for k, room in enumerate(rooms):
        ground = float(world.height(np.array(boxes[k].exterior.coords)).min())
        if high[k] > ground - 0.5:
            yield Finding(
                "room shows", room.id, f"its ceiling is at {high[k]:.2f} m, the ground above at {ground:.2f} m"
            )
        for link in room.links:
            other = world.room_by_id.get(link)
            if other is None or room.id not in other.links:
                yield Finding("room link", room.id, f"its link to {link} is not returned")
        box = boxes[k].buffer(0.02)
        if not box.contains(shapely.Point(room.inside[:2])) or not box.contains(shapely.Point(room.door[:2])):
            yield Finding("room door", room.id, "its door or the spot inside it lies outside the room")


def _containers(world: World) -> Iterator[Finding]:
    """Containers can be reached from a free point of their room, on foot from the door."""
    objects = world.objects
    corners = objects.corners()
    by_room: dict[str, list[int]] = {}
    for k in np.flatnonzero(~objects.outdoors & objects.solid).tolist():
        by_room.setdefault(str(objects.room[k]), []).append(k)
    for room in world.rooms:
        box = _box(room)
        mine = [shapely.Polygon(corners[k]) for k in by_room.get(room.id, [])]
        taken = shapely.union_all(mine) if mine else shapely.Polygon()
        space = box.buffer(-_BODY).difference(taken.buffer(_BODY))
        parts = [part for part in shapely.get_parts(space) if part.contains(shapely.Point(room.inside[:2]))]
        if not parts:
            yield Finding("room blocked", room.id, "nobody can stand inside its door")
            continue
        floor = parts[0].buffer(0.02)
        for container in room.containers:
            reach = shapely.Point(container.reach)
            if not floor.contains(reach):
                yield Finding("container blocked", container.id, "its reach point can't be walked to from the door")
            away = 0.0
            if container.kind != "floor":
                c, s = math.cos(container.yaw), math.sin(container.yaw)
                dx, dy = container.reach[0] - container.centre[0], container.reach[1] - container.centre[1]
                u, v = abs(dx * c + dy * s) - container.size[0] / 2, abs(dy * c - dx * s) - container.size[1] / 2
                away = math.hypot(max(u, 0.0), max(v, 0.0))
            if away > _REACH:
                yield Finding("container far", container.id, f"its reach point is {away:.2f} m from the surface")
            if not box.contains(shapely.Point(container.centre[:2])):
                yield Finding("container outside", container.id, f"it is not in {room.id}")


def _indoors(world: World) -> Iterator[Finding]:
    """From the street every room and everything that holds things can be walked to."""
    # Containers have a rule of their own; rooms of worlds made by hand may list no doors.
    rooms = [room for room in world.rooms if room.doors]
    for found in walkable_inside(rooms, world.objects):
        if not found.id.startswith("container"):
            yield Finding(*found)


def _objects(world: World) -> Iterator[Finding]:
    """Nothing outdoors stands in a building, beyond the edge, or off the ground; everything has a model."""
    objects = world.objects
    models = world.prototypes()
    for name in sorted(set(objects.prototype.tolist()) - set(models)):
        yield Finding("object without model", name, "prototypes.glb has no such node")
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
        yield Finding("object in a building", str(objects.id[outside[k]]), "it stands inside a wall")
    for k in outside[np.abs(objects.position[outside, :2]).max(axis=1) > world.half].tolist():
        yield Finding("object beyond the edge", str(objects.id[k]), "it stands outside the world's square")
    off = np.abs(world.height(objects.position[outside]) - objects.z[outside]) > 0.05
    for k in outside[off].tolist():
        yield Finding("object not seated", str(objects.id[k]), "its foot is not at ground level")


def _lane_bands(lanes: LaneGraph, chosen: NDArray[np.int64]) -> NDArray[np.object_]:
    """What vehicles sweep on each lane, a little narrower than the lane."""
    lines = np.array([shapely.LineString(lanes.line(int(k))[:, :2]) for k in chosen], object)
    return np.asarray(shapely.buffer(lines, lanes.width[chosen] / 2 - _KERB, cap_style="flat"), object)


def _clearances(world: World) -> Iterator[Finding]:
    """Nothing solid stands on a lane that is driven, nor in another solid thing."""
    objects = world.objects
    solid = np.flatnonzero(objects.outdoors & objects.solid)
    if not len(solid):
        return
    feet = shapely.polygons(objects.feet()[solid])
    lanes = world.lanes
    driven = np.flatnonzero(lanes.inside < 0) if len(lanes) else np.zeros(0, np.int64)
    if len(driven):
        bands = _lane_bands(lanes, driven)
        for k, lane in np.column_stack(shapely.STRtree(bands).query(feet, predicate="intersects")).tolist():
            inside = float(shapely.area(shapely.intersection(feet[k], bands[lane])))
            if inside > _TOUCH:
                what = f"{inside:.2f} m2 of its foot stand on lane {lanes.ids[int(driven[lane])]}"
                yield Finding("object on a lane", str(objects.id[solid[k]]), what)
    left, right = shapely.STRtree(feet).query(feet, predicate="intersects")
    chosen = left < right
    for a, b in zip(left[chosen].tolist(), right[chosen].tolist(), strict=True):
        if str(objects.kind[solid[a]]) in _JOINED and str(objects.kind[solid[b]]) in _JOINED:
            continue
        common = float(shapely.area(shapely.intersection(feet[a], feet[b])))
        if common > _TOUCH:
            what = f"{common:.2f} m2 of its foot stand in {objects.id[solid[b]]}"
            yield Finding("objects overlap", str(objects.id[solid[a]]), what)


def _roads(world: World) -> Iterator[Finding]:
    """Lanes follow one another end to end, and most of the network can be driven round."""
    lanes = world.lanes
    rows = np.repeat(np.arange(len(lanes)), np.diff(lanes.next_first))
    ends = lanes.points[lanes.first[rows + 1] - 1]
    starts = lanes.points[lanes.first[lanes.next]]
    gap = np.hypot(*(ends - starts).T)
    for k in np.flatnonzero(gap > 1.0).tolist():
        yield Finding(
            "lanes apart", lanes.ids[int(rows[k])], f"{gap[k]:.1f} m from its successor {lanes.ids[int(lanes.next[k])]}"
        )
    ids = {road.id for road in world.roads.roads}
    for junction in world.roads.junctions:
        for name in junction.roads:
            if name not in ids:
                yield Finding("junction road", junction.id, f"there is no road {name}")


def _transit(world: World) -> Iterator[Finding]:
    """Lines drive over lanes that follow one another, past their stops, where people can wait."""
    lanes, transit = world.lanes, world.transit
    stops = {stop.id: stop for stop in transit.stops}
    for stop in transit.stops:
        if stop.lane not in lanes.index:
            yield Finding("stop lane", stop.id, f"there is no lane {stop.lane}")
        elif not 0.0 <= stop.offset <= float(lanes.length[lanes.index[stop.lane]]) + 0.01:
            yield Finding("stop lane", stop.id, f"{stop.offset} m is beyond the end of {stop.lane}")
    for line in transit.lines:
        missing = [name for name in line.lanes if name not in lanes.index]
        if missing or any(name not in stops for name in line.stops):
            yield Finding("line lost", line.id, f"unknown lanes or stops: {', '.join(missing[:3]) or 'stops'}")
            continue
        numbers = [lanes.index[name] for name in line.lanes]
        for a, b in zip(numbers, numbers[1:] + numbers[:1], strict=True):
            beside = b in (int(lanes.left[a]), int(lanes.right[a]))
            if a != b and b not in lanes.following(a) and not beside:
                yield Finding("line broken", line.id, f"no way from {lanes.ids[a]} to {lanes.ids[b]}")
        for name in line.stops:
            if stops[name].lane not in line.lanes:
                yield Finding("line misses stop", line.id, f"{name} is not on its way")
        if len(line.travel) != len(line.stops) + 1 or any(np.diff(line.travel) <= 0):
            yield Finding("line timetable", line.id, "its times do not increase from stop to stop and back")


def _entities(world: World) -> Iterator[Finding]:
    """No two things share a number. Stops' and stations' objects carry their records' own."""
    numbers: list[NDArray[np.int64]] = [
        np.array([b.entity for b in world.buildings], np.int64),
        np.array([r.entity for r in world.rooms], np.int64),
        world.objects.entity.astype(np.int64),
    ]
    every = np.concatenate(numbers)
    values, counts = np.unique(every, return_counts=True)
    for number in values[counts > 1].tolist():
        yield Finding("entity twice", str(number), f"{int(counts[values == number][0])} things have this number")
