"""Rules of rooms: below ground, without overlap, and every room and whatever holds things can be walked to.

The walk leads from the door to the street to every room, and in each room to what holds things.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.geo import overlay
from vico.rules import REACH
from vico.world.model import Container, Room, WorldFinding
from vico.world.objects import Objects
from vico.world.world import World

BODY = 0.25
_SAME_DOOR = 0.5  # metres between the two sides of a doorway


def walkable_inside(rooms: Sequence[Room], objects: Objects, *, body: float = BODY) -> list[WorldFinding]:
    """Prove that people get everywhere indoors.

    Parameters
    ----------
    rooms
        Rooms of any number of places, those of a place in the order of its ``rooms``.
    objects
        What stands in them; only solid things are in the way.
    body
        Radius of a body, metres.

    Returns
    -------
    list of Finding
        Empty if from the way out of each place a body can walk to every doorway of every room, through it to the room
        beyond, up and down stairs and lifts, and to every container's reach point.

    Notes
    -----
    Exact, not on a raster: the floor less what lies within `body` of walls and solid things, in one piece.
    """
    by_room: dict[str, list[int]] = {}
    for k in np.flatnonzero(np.asarray(objects.solid, bool) & ~objects.outdoors).tolist():
        by_room.setdefault(str(objects.room[k]), []).append(k)
    corners = objects.corners()
    known = {room.id: room for room in rooms}
    found: list[WorldFinding] = []
    places: dict[str, list[Room]] = {}
    for room in rooms:
        places.setdefault(room.place, []).append(room)
        found += _room(room, corners[by_room.get(room.id, [])], body)
        found += _doorways(room, known)
    for place, mine in places.items():
        found += _unreachable_rooms(place, mine)
    return found


def floor_space(room: Room, outlines: NDArray[np.float64], body: float = BODY) -> shapely.Geometry:
    """Return where the middle of a body can be: one part, or several that can't be walked between.

    Parameters
    ----------
    outlines
        Corners of the solid things in the room, shape ``(n, 4, 2)``.
    """
    box = _box(room, body)
    if not len(outlines):
        return box
    taken = overlay.union_all(overlay.buffer(shapely.polygons(outlines), body, quad_segs=4), grid=None)
    return overlay.difference(box, taken, grid=None)


def _room(room: Room, outlines: NDArray[np.float64], body: float) -> list[WorldFinding]:
    parts = shapely.get_parts(floor_space(room, outlines, body))
    start = shapely.Point(room.inside[:2])
    home = [part for part in parts if part.distance(start) < 0.02]
    if not home:
        return [WorldFinding("room blocked", room.id, "nobody can stand inside its door")]
    floor = overlay.buffer(home[0], 0.02)
    found = []
    for door in room.doors:
        if not floor.covers(shapely.Point(door.inside[:2])):
            to = door.to or "the street"
            found.append(WorldFinding("door blocked", room.id, f"its door to {to} can't be walked to from its way in"))
    for container in room.containers:
        if not floor.covers(shapely.Point(container.reach)):
            found.append(
                WorldFinding("container blocked", container.id, "its reach point can't be walked to from the door")
            )
        if _reach_of(container) > REACH:
            found.append(WorldFinding("container far", container.id, f"its reach point is more than {REACH} m from it"))
    return found


def _doorways(room: Room, known: dict[str, Room]) -> list[WorldFinding]:
    """Doorways lie in their rooms at floor level, and both sides of one agree."""
    found = []
    for door in room.doors:
        floor = room.floor_at(*door.inside[:2])
        if abs(door.position[2] - floor) > 0.05 or abs(door.inside[2] - floor) > 0.05:
            found.append(
                WorldFinding("door level", room.id, f"its door to {door.to or 'the street'} is not at floor level")
            )
        if not door.to:
            continue
        other = known.get(door.to)
        back = None if other is None else next((door for door in other.doors if door.to == room.id), None)
        is_ride = other is not None and room.kind == other.kind == "lift"
        if back is None:
            found.append(WorldFinding("door one-sided", room.id, f"its door to {door.to} does not lead back"))
        elif not is_ride and math.dist(door.position, back.position) > _SAME_DOOR:
            found.append(WorldFinding("door apart", room.id, f"the two sides of its door to {door.to} do not meet"))
    return found


def _unreachable_rooms(place: str, rooms: Sequence[Room]) -> list[WorldFinding]:
    """Rooms no row of doors leads to from the street."""
    ways = {room.id: [door.to for door in room.doors if door.to] or list(room.links) for room in rooms}
    first = next((room for room in rooms if any(not door.to for door in room.doors)), rooms[0])
    seen, queue = {first.id}, [first.id]
    while queue:
        for name in ways.get(queue.pop(), []):
            if name not in seen:
                seen.add(name)
                queue.append(name)
    return [
        WorldFinding("room cut off", room.id, f"no row of doors leads there from the entrance of {place}")
        for room in rooms
        if room.id not in seen
    ]


def _reach_of(container: Container) -> float:
    """Return how far a container's reach point is from its sides, metres; 0 on a floor."""
    if container.kind == "floor":
        return 0.0
    c, s = math.cos(container.yaw), math.sin(container.yaw)
    dx, dy = container.reach[0] - container.centre[0], container.reach[1] - container.centre[1]
    u, v = abs(dx * c + dy * s) - container.size[0] / 2, abs(dy * c - dx * s) - container.size[1] / 2
    return math.hypot(max(u, 0.0), max(v, 0.0))


def _box(room: Room, inset: float = 0.0) -> shapely.Polygon:
    """Return the outline of a room's floor, its sides `inset` metres farther in."""
    c, s = math.cos(room.yaw), math.sin(room.yaw)
    x, y = room.size[0] / 2 - inset, room.size[1] / 2 - inset
    return shapely.Polygon(
        [
            (room.centre[0] + c * u - s * v, room.centre[1] + s * u + c * v)
            for u, v in ((-x, -y), (x, -y), (x, y), (-x, y))
        ]
    )


def check_rooms(world: World) -> Iterator[WorldFinding]:
    """Check that no two rooms overlap (neighbours share a wall), and all lie below ground."""
    rooms = world.rooms
    if not rooms:
        return
    boxes = [_box(room) for room in rooms]
    low = np.array([room.centre[2] for room in rooms])
    high = low + np.array([room.size[2] for room in rooms])
    shrunk = overlay.buffer(np.array(boxes), -0.01, join_style="mitre")
    left, right = shapely.STRtree(shrunk).query(shrunk, predicate="intersects")
    clash = (left < right) & (low[left] < high[right]) & (low[right] < high[left])
    for i, j in zip(left[clash].tolist(), right[clash].tolist(), strict=True):
        yield WorldFinding("rooms overlap", rooms[i].id, f"it overlaps {rooms[j].id}")
    for k, room in enumerate(rooms):
        ground = float(world.height(np.array(boxes[k].exterior.coords)).min())
        if high[k] > ground - 0.5:
            yield WorldFinding(
                "room shows", room.id, f"its ceiling is at {high[k]:.2f} m, the ground above at {ground:.2f} m"
            )
        for link in room.links:
            other = world.room_by_id.get(link)
            if other is None or room.id not in other.links:
                yield WorldFinding("room link", room.id, f"its link to {link} is not returned")
        box = overlay.buffer(boxes[k], 0.02)
        if not box.contains(shapely.Point(room.inside[:2])) or not box.contains(shapely.Point(room.door[:2])):
            yield WorldFinding("room door", room.id, "its door or the spot inside it lies outside the room")


def check_containers(world: World) -> Iterator[WorldFinding]:
    """Check that containers can be reached from a free point of their room, on foot from the door."""
    objects = world.objects
    corners = objects.corners()
    by_room: dict[str, list[int]] = {}
    for k in np.flatnonzero(~objects.outdoors & objects.solid).tolist():
        by_room.setdefault(str(objects.room[k]), []).append(k)
    for room in world.rooms:
        box = _box(room)
        mine = [shapely.Polygon(corners[k]) for k in by_room.get(room.id, [])]
        taken = overlay.union_all(mine, grid=None) if mine else shapely.Polygon()
        space = overlay.difference(overlay.buffer(box, -BODY), overlay.buffer(taken, BODY), grid=None)
        parts = [part for part in shapely.get_parts(space) if part.contains(shapely.Point(room.inside[:2]))]
        if not parts:
            yield WorldFinding("room blocked", room.id, "nobody can stand inside its door")
            continue
        floor = overlay.buffer(parts[0], 0.02)
        for container in room.containers:
            reach = shapely.Point(container.reach)
            if not floor.contains(reach):
                yield WorldFinding(
                    "container blocked", container.id, "its reach point can't be walked to from the door"
                )
            away = _reach_of(container)
            if away > REACH:
                yield WorldFinding("container far", container.id, f"its reach point is {away:.2f} m from the surface")
            if not box.contains(shapely.Point(container.centre[:2])):
                yield WorldFinding("container outside", container.id, f"it is not in {room.id}")


def check_indoors(world: World) -> Iterator[WorldFinding]:
    """Check that from the street every room and everything that holds things can be walked to."""
    # Containers have a rule of their own; rooms of worlds made by hand may list no doors.
    with_doors = [room for room in world.rooms if room.doors]
    for found in walkable_inside(with_doors, world.objects):
        if not found.id.startswith("container"):
            yield found
