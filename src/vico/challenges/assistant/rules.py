"""When a subtask is done: the success rules of Carry, Delivery and Search, each in one function.

Carry
    Task: find a person, take the things they hand over, follow them home, put the things down there.
    Success: all things lie, in nobody's hands, inside the home or within 3 m of its entrance, after the person arrived.
Delivery
    Task: bring things from a source (a place or a region outdoors) to a destination (a place or a spot outdoors).
    Success: all things lie, in nobody's hands, in one of the destination's rooms, or outdoors within 3 m of the spot.
Search
    Task: find a described thing in a place or a region outdoors.
    Success: `task_complete` while 20 or more pixels of it are in view within 10 m.

In the advanced setting distances are halved, and things indoors are to lie within 1.5 m of a surface that is named.
Every number is in `vico.challenges.assistant.thresholds`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vico.challenges.assistant.model import Region
from vico.challenges.assistant.thresholds import Thresholds
from vico.world.world import World


class StateView(Protocol):
    """What an evaluator may look at: the truth, not any agent's view of it."""

    def object_position(self, name: str) -> NDArray[np.float64]:
        """Where the thing called `name` is, metres, shape ``(3,)``."""

    def object_room(self, name: str) -> str | None:
        """Id of the room it is in; None outdoors."""

    def object_holder(self, name: str) -> str | None:
        """Name of the agent that holds it; None if nobody does."""

    def object_entity(self, name: str) -> int:
        """Its entity, as pictures show it."""

    def agent_entity(self, name: str) -> int:
        """Entity of a person, as pictures show it."""

    def agent_position(self, name: str) -> NDArray[np.float64]:
        """Where a person stands, metres, shape ``(3,)``."""

    def agent_place(self, name: str) -> str | None:
        """Id of the place a person is in; None outdoors."""

    def agent_room(self, name: str) -> str | None:
        """Id of the room a person is in; None outdoors."""


def is_delivered(name: str, region: Region, state: StateView, world: World, limits: Thresholds) -> bool:
    """Whether a thing lies at its destination."""
    if state.object_holder(name) is not None:
        return False
    room = state.object_room(name)
    if region.place is not None:
        inside = room is not None and world.room_by_id[room].place == region.place
        return inside and _by_surface(state.object_position(name), region, world, limits)
    return room is None and _away(state.object_position(name), region.centre) <= limits.destination_radius


def is_carried_home(name: str, home: Region, state: StateView, world: World, limits: Thresholds) -> bool:
    """Whether a thing lies in a home, or before its entrance."""
    if state.object_holder(name) is not None:
        return False
    room, position = state.object_room(name), state.object_position(name)
    if room is not None:
        return world.room_by_id[room].place == home.place and _by_surface(position, home, world, limits)
    return _away(position, entrance_of(home, world)) <= limits.home_radius


def has_arrived(person: str, home: Region, state: StateView, world: World, limits: Thresholds) -> bool:
    """Whether somebody is at home, or before its entrance."""
    if state.agent_place(person) == home.place:
        return True
    outdoors = state.agent_room(person) is None
    return outdoors and _away(state.agent_position(person), entrance_of(home, world)) <= limits.home_radius


def is_in_view(name: str, who: str, observation: Mapping[str, Any], state: StateView, limits: Thresholds) -> bool:
    """Whether so much of a thing is in an assistant's picture, from near enough."""
    # Through a door that stands open it counts as well.
    if _away(state.agent_position(who), state.object_position(name)) > limits.search_distance:
        return False
    pixels = np.count_nonzero(np.asarray(observation["segmentation"]) == state.object_entity(name))
    return bool(pixels >= limits.search_pixels)


def entrance_of(region: Region, world: World) -> NDArray[np.float64]:
    """Return where one goes into a place, ENU metres; its position where it has no door."""
    place = world.place_by_id[str(region.place)]
    doors = [door.position for door in world.entrances if door.id == place.entrance]
    return np.asarray(doors[0] if doors else place.position, np.float64)


def _by_surface(position: NDArray[np.float64], region: Region, world: World, limits: Thresholds) -> bool:
    """Whether a point is as near to the surface that a region names as is asked for, if one is."""
    if region.surface is None or limits.surface_distance is None:
        return True
    room = world.room_by_id[region.surface.room]
    surface = next(one for one in room.containers if one.entity == region.surface.entity)
    c, s = math.cos(surface.yaw), math.sin(surface.yaw)
    x, y = position[:2] - np.asarray(surface.centre[:2])
    beyond = np.abs([c * x + s * y, c * y - s * x]) - np.asarray(surface.size) / 2
    return float(np.hypot(*np.maximum(beyond, 0.0))) <= limits.surface_distance


def _away(a: NDArray[np.float64], b: Any) -> float:
    return float(np.hypot(*(np.asarray(a)[:2] - np.asarray(b)[:2])))
