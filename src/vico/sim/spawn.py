"""Where everyone is when a run starts: residents where their schedule puts them, assistants on free ground."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError
from vico.sim.avatars import free_ground
from vico.sim.moves import place_in_room, put_outdoors
from vico.sim.stage import Stage
from vico.sim.timetable import Appointment, whereabouts
from vico.world.routing import Router

_PASSAGES = ("hall", "corridor", "stairs", "lift", "storage", "bathroom", "washroom", "shower_room")


def place_residents(stage: Stage, days: Sequence[Sequence[Appointment]], second: int) -> None:
    """Put each resident where the day says: in a place, or on the way to one.

    Raises
    ------
    InputError
        If somebody has no schedule, or there is no room where they should be.
    """
    router: Router | None = None
    for i, stays in enumerate(days):
        where = whereabouts(stays, second)
        name = stage.people.names[i]
        if where is None:
            raise InputError(f"{name}: no item of the schedule names a place of this world; check the community")
        if where.share >= 1.0 or where.origin == where.place:
            place_at(i, where.place, stage)
            continue
        places = stage.world.places
        router = router or Router(stage.world.walkable)
        path = router.path(places[where.origin].position[:2], places[where.place].position[:2])
        if path is None or len(path) < 2 or where.share <= 0.0:
            place_at(i, where.origin, stage)
            continue
        point, yaw = along(path, where.share)
        spot = free_ground(stage.world.walkable, point, stage.obstacles(), within=8.0)
        if spot is None:
            raise InputError(f"{name}: no free ground near {point.round(1).tolist()} to start from")
        put_outdoors(i, spot, yaw, stage)


def place_at(i: int, index: int, stage: Stage) -> None:
    """Put someone into a place: its first room with space, or the ground in front of it."""
    place = stage.world.places[index]
    # Where people stay comes before where they pass; within each, rooms near the street come first.
    order = sorted(place.rooms, key=lambda name: stage.indoor.rooms[stage.indoor.index[name]].kind in _PASSAGES)
    for room_id in order:
        room = stage.indoor.index[room_id]
        inside = stage.indoor.rooms[room].inside
        if stage.indoor.free_spot(room, inside, stage.people_in(room, without=i)) is not None:
            place_in_room(i, room, stage)
            return
    spot = free_ground(stage.world.walkable, np.asarray(place.position), stage.obstacles(), within=12.0)
    if spot is None:
        raise InputError(f"{stage.people.names[i]}: {place.name} is full, and so is the ground in front of it")
    put_outdoors(i, spot, 0.0, stage)


def along(path: NDArray[np.float64], share: float) -> tuple[NDArray[np.float64], float]:
    """Point at a share of a path's length, and the direction of travel there, radians."""
    legs = np.diff(path, axis=0)
    lengths = np.hypot(legs[:, 0], legs[:, 1])
    goal = share * float(lengths.sum())
    ends = np.cumsum(lengths)
    k = min(int(np.searchsorted(ends, goal)), len(legs) - 1)
    rest = (goal - (ends[k] - lengths[k])) / max(lengths[k], 1e-9)
    return path[k] + legs[k] * rest, math.atan2(legs[k, 1], legs[k, 0])


def place_anywhere(i: int, stage: Stage, rng: np.random.Generator) -> None:
    """Put someone on a random reachable sidewalk or open ground."""
    for _ in range(100):
        spot = free_ground(stage.world.walkable, stage.world.walkable.random_point(rng), stage.obstacles(), within=5.0)
        if spot is not None:
            put_outdoors(i, spot, float(rng.uniform(-math.pi, math.pi)), stage)
            return
    raise InputError(f"{stage.people.names[i]}: found no free ground to start on; let fewer people take part")
