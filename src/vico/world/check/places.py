"""Rules of entrances and places: they exist, belong together, and can be reached on foot."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.world.check.buildings import outline_of
from vico.world.check.finding import WorldFinding
from vico.world.heights import HeightField
from vico.world.model import Entrance, Place
from vico.world.walkable import WalkableMap
from vico.world.world import World

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
    out = np.array([[math.cos(door.facing), math.sin(door.facing)]])
    if bool(faces_into(outline, np.array([door.position[:2]]), out)[0]):
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
