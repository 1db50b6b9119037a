"""Robots at doors: who may go through, when there is room behind, and rides in lifts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.sim import lifts
from vico.sim.simulation_state import SimulationState
from vico.sim.state import RADIUS
from vico.world.indoor_ways import lift_seconds
from vico.world.model import Place

#: Metres between a robot that has come through a door and others.
_APART = 0.1
# Seconds for which doors stay open after robots.
_HELD = 0.8


def follow(state: SimulationState, dt: float) -> None:
    """Let robots that wait at doors go through, and ride in lifts; who finds a place shut gives up."""
    robots = state.robots
    if robots is None:
        return
    for robot, room in robots.at_doors():
        origin = int(robots.rooms[robot])
        place = _place_entered(robot, room, state) if origin < 0 else None
        if place is not None and shut_words(place, state):
            robots.give_up(robot)
            continue
        if room >= 0 and lifts.is_ride(origin, room, state):
            rooms = state.indoor.rooms
            if robots.ride(robot, dt) < lift_seconds(rooms[room].centre[2] - rooms[origin].centre[2]) - 1e-6:
                continue
        if -1 in (origin, room) and not _is_open(room if origin < 0 else origin, state):
            continue
        if robots.pass_door(robot, room, _taken(robot, room, state)):
            _tell(robot, origin, room, place, state)
    _keep_on_decks(state)


def _is_open(room: int, state: SimulationState) -> bool:
    """Open the entrance to a room; return whether it is open."""
    entrance = state.world.places[int(state.indoor.place[room])].entrance
    if entrance is None:
        return True
    number = state.base.entrance_index[entrance]
    state.leaves.hold(number, _HELD)
    return state.leaves.share_of(number) >= 1.0 - 1e-6


def shut_words(place: Place, state: SimulationState) -> str:
    """Why nobody without an appointment is let into a place now; "" if it is open."""
    closure = state.environment.agenda.effects.shut.get(place.id)
    if closure is not None:
        return f"{place.name} is closed ({closure.event.title})"
    if state.openings is None or state.openings.is_open(place.id, state.second):
        return ""
    return f"{place.name} is closed now; it is {state.openings.hours(place.id)}"


def place_of_room(room: int, state: SimulationState) -> Place | None:
    """Return the place a room belongs to."""
    index = int(state.indoor.place[room]) if room >= 0 else -1
    return state.world.places[index] if index >= 0 else None


def _place_entered(robot: int, room: int, state: SimulationState) -> Place | None:
    assert state.robots is not None
    goal = state.robots.trip_room(robot)
    return place_of_room(goal if goal >= 0 else room, state)


def _taken(robot: int, room: int, state: SimulationState) -> NDArray[np.float64]:
    """Discs (x, y, radius) in which the middle of a robot that comes into a room (-1: outdoors) cannot be."""
    assert state.robots is not None
    own = state.robots.room_needed(robot) + _APART
    if room < 0:
        bodies = state.obstacles()
        reach = np.hypot(bodies.half_length, bodies.half_width)
        return np.column_stack([bodies.position[:, :2], reach + own])
    points = state.taken_in(room)
    return np.column_stack([points[:, :2], np.full(len(points), RADIUS + own)])


def _tell(robot: int, origin: int, room: int, place: Place | None, state: SimulationState) -> None:
    assert state.robots is not None
    name, position = state.robots.names[robot], state.robots.bodies().position[robot]
    if origin < 0 and place is not None:
        state.events.add("enter", name, f"enters {place.name}", position, place=place.id)
    left = place_of_room(origin, state)
    if room < 0 and left is not None:
        state.events.add("exit", name, f"leaves {left.name}", position, place=left.id)


def _keep_on_decks(state: SimulationState) -> None:
    """Have things on decks be in the rooms that the robots are in."""
    robots, objects = state.robots, state.objects
    assert robots is not None
    carried = np.flatnonzero((objects.holder != 0) & (objects.hand < 0))
    if not len(carried):
        return
    room_of = dict(zip(robots.bodies().entity.tolist(), robots.rooms.tolist(), strict=True))
    for k in carried.tolist():
        objects.room[k] = room_of.get(int(objects.holder[k]), int(objects.room[k]))
