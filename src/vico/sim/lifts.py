"""Lifts: who rides stays in the car of the floor that was left until the ride is over, and then stands in the other."""

from __future__ import annotations

import numpy as np

from vico.sim.moves import place_in_room
from vico.sim.simulation_state import SimulationState
from vico.world.indoor_ways import lift_seconds
from vico.world.model import LIFT


def is_ride(origin: int, room: int, state: SimulationState) -> bool:
    """Return whether it is a ride from one room to another: both are cars of a lift."""
    rooms = state.indoor.rooms
    return origin >= 0 and rooms[origin].kind == rooms[room].kind == LIFT


def ride(i: int, room: int, state: SimulationState) -> None:
    """Have someone ride from the car they are in to the car of another floor."""
    p, rooms = state.people, state.indoor.rooms
    p.lift_room[i] = room
    p.lift_left[i] = lift_seconds(rooms[room].centre[2] - rooms[int(p.room[i])].centre[2])


def follow(state: SimulationState, dt: float) -> None:
    """Let lifts go on for `dt` seconds; who has arrived gets out when there is room in the car, and nobody before."""
    p = state.people
    if not p.lift_left.any():
        return
    for i in np.flatnonzero(p.lift_left > 0.0).tolist():
        room = int(p.lift_room[i])
        if not is_ride(int(p.room[i]), room, state):  # somebody put them elsewhere
            p.lift_left[i] = 0.0
            continue
        p.lift_left[i] -= dt
        if p.lift_left[i] > 1e-6:
            continue
        near = state.indoor.arrival(room, int(p.room[i]))
        if state.indoor.free_spot(room, near, state.taken_in(room, without=i)) is None:
            p.lift_left[i] = dt
            continue
        p.lift_left[i] = 0.0
        place_in_room(i, room, state, near=near)
