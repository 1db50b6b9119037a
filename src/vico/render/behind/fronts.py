"""Which room lies behind which stretch of glass."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vico.render.records import ROOM_FRONT
from vico.world.model import Category

if TYPE_CHECKING:
    from vico.world.model import Entrance, Room
    from vico.world.world import World

#: What shows its rooms to the street.
OPEN_TO_SIGHT = frozenset({Category.STORE, Category.FOOD, Category.ENTERTAINMENT})
# Fronts on one wall: their doors lie no farther than this off each other's plane, metres.
_SAME_WALL = 0.6
# Panes that reach farther to the side than their room by so much show its wall, metres.
_REST = 0.8


def room_fronts(world: World) -> NDArray[np.void]:
    """Return the `ROOM_FRONT` of every shop, café and the like that has a room with a door to a street.

    Those on one wall meet halfway between their doors; of several behind one door the first one's room is seen.
    """
    entrances = {entrance.id: entrance for entrance in world.entrances}
    first: dict[str, str] = {}
    have_rooms = {room.place for room in world.rooms if any(not door.to for door in room.doors)}
    for place in world.places:
        if place.category in OPEN_TO_SIGHT and place.entrance in entrances and place.id in have_rooms:
            first.setdefault(place.entrance or "", place.id)
    shown = {place: entrance for entrance, place in first.items()}
    found, where = [], []
    for k, room in enumerate(world.rooms):
        door = next((door for door in room.doors if not door.to), None)
        if room.place not in shown or door is None:
            continue
        entrance = entrances[shown.pop(room.place)]
        found.append((*_ends(entrance, room), k))
        where.append(entrance.building)
    fronts = np.array(found, ROOM_FRONT) if found else np.zeros(0, ROOM_FRONT)
    _share_walls(fronts, where)
    return fronts[fronts["right"] - fronts["left"] > 0.5]


def _ends(entrance: Entrance, room: Room) -> tuple[float, ...]:
    """Return both frames, and how far the room reaches in its own."""
    door = next(door for door in room.doors if not door.to)
    # Inwards, along the axis of the room that a step in from the door is nearest to.
    toward = math.atan2(door.inside[1] - door.position[1], door.inside[0] - door.position[0])
    quarter = round((toward - room.yaw) / (math.pi / 2)) % 4
    yaw = room.yaw + quarter * math.pi / 2
    ix, iy = math.cos(yaw), math.sin(yaw)
    dx, dy = room.centre[0] - door.position[0], room.centre[1] - door.position[1]
    middle, depth = dx * iy - dy * ix, dx * ix + dy * iy
    deep, wide = (room.size[0], room.size[1]) if quarter % 2 == 0 else (room.size[1], room.size[0])
    # The middle of the room's wall goes behind the door on the street: so most panes beside it have the room behind.
    off = depth - deep / 2
    return (
        *entrance.position,
        -math.cos(entrance.facing),
        -math.sin(entrance.facing),
        door.position[0] + off * ix + middle * iy,
        door.position[1] + off * iy - middle * ix,
        room.centre[2],
        ix,
        iy,
        -_REST - wide / 2,
        wide / 2 + _REST,
        room.size[2],
        deep,
        wide / 2 - 0.02,
    )


def _share_walls(fronts: NDArray[np.void], buildings: Sequence[str]) -> None:
    """Cut fronts of one wall where they meet."""
    by_building: dict[str, list[int]] = {}
    for k, building in enumerate(buildings):
        by_building.setdefault(building, []).append(k)
    for group in by_building.values():
        for i in group:
            for j in group:
                if i != j:
                    _cut(fronts[i], fronts[j])


def _cut(front: np.void, other: np.void) -> None:
    """End a front halfway to another one's door."""
    ix, iy = float(front["inward_x"]), float(front["inward_y"])
    dx, dy = float(other["x"] - front["x"]), float(other["y"] - front["y"])
    along, off = dx * iy - dy * ix, dx * ix + dy * iy
    if abs(off) > _SAME_WALL or ix * other["inward_x"] + iy * other["inward_y"] < 0.9:
        return
    if along > 0.0:
        front["right"] = min(float(front["right"]), along / 2)
    else:
        front["left"] = max(float(front["left"]), along / 2)
