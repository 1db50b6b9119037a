"""Rules of rooms: they lie below ground without overlap, and what holds things can be reached."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import shapely

from vico.geo import overlay
from vico.rules import REACH
from vico.world.check.finding import WorldFinding
from vico.world.check.indoors import BODY, walkable_inside
from vico.world.model import Room
from vico.world.world import World


def _box(room: Room) -> shapely.Polygon:
    c, s = math.cos(room.yaw), math.sin(room.yaw)
    x, y = room.size[0] / 2, room.size[1] / 2
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
            away = 0.0
            if container.kind != "floor":
                c, s = math.cos(container.yaw), math.sin(container.yaw)
                dx, dy = container.reach[0] - container.centre[0], container.reach[1] - container.centre[1]
                u, v = abs(dx * c + dy * s) - container.size[0] / 2, abs(dy * c - dx * s) - container.size[1] / 2
                away = math.hypot(max(u, 0.0), max(v, 0.0))
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
