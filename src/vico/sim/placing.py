"""Where a thing can lie: never in one place with another thing, or with somebody."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vico.sim.bodies import OBJECT, Bodies
from vico.sim.footprints import OUTDOORS, body_gap, can_touch, records_of
from vico.sim.simulation_state import SimulationState

#: So deep may things be in each other, metres: rounding errors.
_TOLERANCE = 1e-3
# A free spot beside a taken one is looked for in rings this far apart, metres, in so many directions.
_RING, _DIRECTIONS = 0.1, 16
# What is let go so far below a top comes to lie on it, and so far above it, metres: rounding errors.
_LET_GO, _JUST_ABOVE = 0.03, 1e-4
_FALLS = 1.5  # what falls comes to rest within so many metres
# On one surface: floors and tops of furniture differ by more, metres.
_SAME_HEIGHT = 0.02


@dataclass(frozen=True)
class Thing:
    """A thing that is to be put somewhere.

    Attributes
    ----------
    size
        Extents of its box, metres, shape ``(3,)``.
    yaw
        Counter-clockwise from east, radians.
    entity
        Its entity, 0 if it has none yet: it is not in its own way.
    """

    size: NDArray[np.float64]
    yaw: float
    entity: int = 0


def in_the_way(thing: Thing, point: NDArray[np.float64], room: int, state: SimulationState) -> int:
    """Return the entity of the first body that a thing would be inside of at a point, 0 if there is none.

    Parameters
    ----------
    point
        Where the middle of its underside would be, ENU metres.
    room
        Index of the room, -1 outdoors.
    """
    one = np.ones(1)
    body = Bodies(
        np.array([thing.entity], np.int32), np.array([OBJECT], np.int8), np.asarray(point, np.float64)[None],
        thing.yaw * one, thing.size[0] / 2 * one, thing.size[1] / 2 * one, thing.size[2] * one, np.zeros((1, 2)),
    )  # fmt: skip
    mine = records_of(body, room)[0]
    for other in _bodies_in(room, state):
        if other["entity"] != thing.entity and can_touch(mine, other) and body_gap(mine, other) < -_TOLERANCE:
            return int(other["entity"])
    return 0


def free_spot_near(
    thing: Thing, point: NDArray[np.float64], room: int, state: SimulationState, *, within: float
) -> NDArray[np.float64] | None:
    """Return the spot on the same surface nearest to a point where a thing lies in nobody's place.

    Returns
    -------
    ndarray or None
        ENU metres, shape ``(3,)``: the point itself where it is free; None if there is no such spot.
    """
    x, y, z = (float(value) for value in point)
    if in_the_way(thing, point, room, state) == 0:
        return np.array([x, y, z])
    rise = z - float(state.world.height((x, y)))
    for ring in range(1, int(within / _RING) + 1):
        for k in range(_DIRECTIONS):
            angle = 2 * math.pi * k / _DIRECTIONS
            spot = np.array([x + _RING * ring * math.cos(angle), y + _RING * ring * math.sin(angle), z])
            if room >= 0:
                fits = _lies_in_room(thing, spot, room, state)
            else:
                fits = bool(state.world.walkable.class_at(spot) > 0)
                spot[2] = float(state.world.height(spot[:2])) + rise
            if fits and in_the_way(thing, spot, room, state) == 0:
                return spot
    return None


def top_at(
    thing: Thing, point: tuple[float, float, float], room: int, state: SimulationState
) -> tuple[NDArray[np.float64], int] | None:
    """Return where a thing comes to rest on another one that is below a point, and that one's entity.

    Parameters
    ----------
    point
        Where the thing is let go, ENU metres: on the top of the other one, or above it.

    Returns
    -------
    tuple or None
        The middle of its underside, ENU metres, shape ``(3,)``, and an entity; None if no level top is below, if the
        thing would tip over its edge, or if something else is there.
    """
    x, y, z = point
    for top, k in reversed(state.objects.tops_under((x, y), room)):
        entity = int(state.objects.entity[k])
        if entity != thing.entity and top <= z + _LET_GO:
            spot = np.array([x, y, top + _JUST_ABOVE])
            return (spot, entity) if in_the_way(thing, spot, room, state) == 0 else None
    return None


def lying_on(k: int, state: SimulationState) -> list[int]:
    """Return the indices of all that lies on a thing, directly or on what lies there, the lowest first."""
    objects = state.objects
    on: list[int] = []
    loose = np.flatnonzero((objects.holder == 0) & (objects.room == objects.room[k]))
    for j in loose[np.argsort(objects.position[loose, 2], kind="stable")].tolist():
        if j != k and objects.support_of(j) in (k, *on):
            on.append(j)
    return on


def let_fall(fallen: list[int], state: SimulationState) -> None:
    """Have things, the lowest first, come to rest on what is below them, or beside it where there is no room."""
    objects = state.objects
    for k in fallen:
        x, y, z = objects.position[k].tolist()
        room = int(objects.room[k])
        thing = Thing(objects.size[k], float(objects.yaw[k]), int(objects.entity[k]))
        rests = top_at(thing, (x, y, z), room, state)
        if rests is not None:
            objects.position[k] = rests[0]
            continue
        ground = float(state.world.height((x, y)))
        if room >= 0:
            # Not up onto a table that it lay below.
            ground = state.indoor.support(room, (x, y))
            ground = ground if ground <= z + _LET_GO else state.indoor.floor_at(room, (x, y))
        spot = free_spot_near(thing, np.array([x, y, ground]), room, state, within=_FALLS)
        if spot is not None:
            objects.position[k] = spot


def _lies_in_room(thing: Thing, spot: NDArray[np.float64], room: int, state: SimulationState) -> bool:
    """Return whether a thing would lie on the surface at a spot's height, clear of the walls."""
    indoor, reach = state.indoor, float(min(thing.size[0], thing.size[1])) / 2
    if abs(indoor.support(room, spot.tolist()) - spot[2]) > _SAME_HEIGHT:
        return False
    is_on_floor = abs(indoor.floor_at(room, spot) - spot[2]) <= _SAME_HEIGHT
    return indoor.gap(room, spot) >= reach if is_on_floor else indoor.holds(room, tuple(spot))


def _bodies_in(room: int, state: SimulationState) -> NDArray[np.void]:
    if room < 0:
        return records_of(state.obstacles(), OUTDOORS)
    objects, people = state.objects, state.people
    lying = objects.in_rooms()
    lying = lying[objects.room[lying] == room]
    inside = np.flatnonzero(people.room == room)
    return records_of(Bodies.joined([people.bodies_of(inside), objects.bodies_of(lying)]), room)
