"""Where everyone is when a run starts: residents where their schedule puts them, assistants on free ground."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError
from vico.seeds import rng
from vico.sim.appointments import Appointment, whereabouts
from vico.sim.avatars import free_ground
from vico.sim.moves import place_in_room, put_outdoors, take_seat
from vico.sim.simulation_state import SimulationState

_PASSAGES = ("hall", "corridor", "stairs", "lift", "storage", "bathroom", "washroom", "shower_room")


def place_residents(state: SimulationState, days: Sequence[Sequence[Appointment]], second: int) -> None:
    """Put each resident where the day says: in a place, or on the way to one.

    Raises
    ------
    InputError
        If somebody has no schedule, or there is no room where they should be.
    """
    for i, stays in enumerate(days):
        where = whereabouts(stays, second)
        name = state.people.names[i]
        if where is None:
            raise InputError(f"{name}: no item of the schedule names a place of this world; check the community")
        if where.share >= 1.0 or where.origin == where.place:
            place_at(i, where.place, state)
            if any(begin <= second < end for stay in stays for begin, end in stay.asleep):
                put_to_bed(i, state)
            continue
        path = state.base.way(where.origin, where.place)
        if path is None or len(path) < 2 or where.share <= 0.0:
            place_at(i, where.origin, state)
            continue
        point, yaw = along(path, where.share)
        spot = free_ground(state.world.walkable, point, state.obstacles(), within=8.0)
        if spot is None:
            raise InputError(f"{name}: no free ground near {point.round(1).tolist()} to start from")
        put_outdoors(i, spot, yaw, state)


def place_at(i: int, index: int, state: SimulationState) -> None:
    """Put someone into a place: its first room with space, or the ground in front of it."""
    place = state.world.places[index]
    # Where people stay comes before where they pass; within each, rooms near the street come first.
    order = sorted(place.rooms, key=lambda name: state.indoor.rooms[state.indoor.index[name]].kind in _PASSAGES)
    for room_id in order:
        room = state.indoor.index[room_id]
        inside = state.indoor.rooms[room].inside
        if state.indoor.free_spot(room, inside, state.taken_in(room, without=i)) is not None:
            place_in_room(i, room, state)
            return
    spot = free_ground(state.world.walkable, np.asarray(place.position), state.obstacles(), within=12.0)
    if spot is None:
        raise InputError(f"{state.people.names[i]}: {place.name} is full, and so is the ground in front of it")
    put_outdoors(i, spot, 0.0, state)


def put_to_bed(i: int, state: SimulationState) -> None:
    """Lay someone into the first free bed of the place they are in, if it has one that they can get out of."""
    p, seats, indoor = state.people, state.seats, state.indoor
    if p.place[i] < 0:
        return
    taken = state.seats_taken()
    for name in state.world.places[int(p.place[i])].rooms:
        room = indoor.index[name]
        inside = seats.in_room(room)
        free = inside.start + np.flatnonzero(seats.lies[inside] & ~taken[inside])
        bed = next((k for k in free.tolist() if seats.stand_before(k, indoor) is not None), None)
        if bed is not None:
            p.room[i] = room
            take_seat(i, bed, state)
            p.moved[i] = 0.0
            return


def along(path: NDArray[np.float64], share: float) -> tuple[NDArray[np.float64], float]:
    """Point at a share of a path's length, and the direction of travel there, radians."""
    legs = np.diff(path, axis=0)
    lengths = np.hypot(legs[:, 0], legs[:, 1])
    goal = share * float(lengths.sum())
    ends = np.cumsum(lengths)
    k = min(int(np.searchsorted(ends, goal)), len(legs) - 1)
    rest = (goal - (ends[k] - lengths[k])) / max(lengths[k], 1e-9)
    return path[k] + legs[k] * rest, math.atan2(legs[k, 1], legs[k, 0])


def place_assistants(first: int, places: Mapping[str, Sequence[float]], state: SimulationState, seed: int) -> None:
    """Put everybody from a number on where a run gives them a place, x, y and yaw by name; else where the seed says.

    Raises
    ------
    InputError
        If nobody is called so, or there is no free ground within a metre.
    """
    names = state.people.names[first:]
    unknown = [name for name in places if name not in names]
    if unknown:
        raise InputError(f"assistant_places: nobody is called {unknown[0]!r}; there are {', '.join(names) or 'none'}")
    for i, name in enumerate(names, first):
        if name not in places:
            continue
        x, y, yaw = places[name]
        walkable = state.world.walkable
        spot = free_ground(walkable, np.array([x, y]), state.obstacles(), within=1.0)
        if spot is None or not walkable.is_connected(spot):
            raise InputError(
                f"assistant_places: {name}: at ({x:.1f}, {y:.1f}) there is no free ground that one gets away from; "
                "give another place"
            )
        put_outdoors(i, spot, yaw, state)
    for i, name in enumerate(names, first):
        if name not in places:
            place_anywhere(i, state, rng(seed, "spawn", name))


def place_anywhere(i: int, state: SimulationState, stream: np.random.Generator) -> None:
    """Put someone on a random reachable sidewalk or open ground."""
    for _ in range(100):
        spot = free_ground(
            state.world.walkable, state.world.walkable.random_point(stream), state.obstacles(), within=5.0
        )
        if spot is not None:
            put_outdoors(i, spot, float(stream.uniform(-math.pi, math.pi)), state)
            return
    raise InputError(f"{state.people.names[i]}: found no free ground to start on; let fewer people take part")
