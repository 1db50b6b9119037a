"""Going into places, from room to room, and out."""

from __future__ import annotations

import numpy as np

from vico.rules import DOOR_REACH, INNER_DOOR_REACH, ReasonCode
from vico.sim import doorways, lifts
from vico.sim.actions.fields import Field, short
from vico.sim.actions.model import ActionType, Refusal, Values
from vico.sim.indoor import near_door
from vico.sim.moves import place_in_room, spot_outside
from vico.sim.simulation_state import SimulationState
from vico.world.model import LIFT

#: A door that lies further up or down than this is on another level, metres.
_LEVEL = 0.5


def check_enter(values: Values, i: int, state: SimulationState) -> Refusal | None:
    """Judge going in: through an entrance from the street, through a door from a room."""
    p, name = state.people, values["place"]
    if p.at_door().item(i):
        return _refuse_at_door(name, i, state)
    if p.lift_left[i] > 0.0:
        return _refuse_in_lift(name, i, state)
    refusal = _refuse_inner_door(name, i, state) if p.room[i] >= 0 else _refuse_entrance(name, i, state)
    if refusal is not None:
        return refusal
    room = _room_behind(name, i, state)
    anchor = state.indoor.arrival(room, int(p.room[i]) if p.room[i] >= 0 else -1)
    if state.indoor.free_spot(room, anchor, state.taken_in(room)) is None:
        return Refusal(ReasonCode.FULL, "enter: it is full")
    return None


def _refuse_at_door(name: str, i: int, state: SimulationState) -> Refusal | None:
    p = state.people
    if p.room[i] < 0 and state.place_index.get(name) == p.door[i]:
        return None  # on the way in
    return Refusal(ReasonCode.MOVING, "enter: on the way through a door; wait until you are through")


def _refuse_in_lift(name: str, i: int, state: SimulationState) -> Refusal | None:
    p = state.people
    if state.indoor.index.get(name) == p.lift_room[i]:
        return None  # on the way there
    return Refusal(ReasonCode.MOVING, f"enter: the lift is moving; it is there in {p.lift_left[i]:.1f} s")


def _refuse_inner_door(name: str, i: int, state: SimulationState) -> Refusal | None:
    p = state.people
    room = state.indoor.index.get(name)
    if room is None:
        sentence = f"enter: {short(name)} is no room of this building; exit first to enter another place"
        return Refusal(ReasonCode.UNKNOWN_PLACE, sentence)
    door = next((d for d in state.indoor.doors[p.room[i]] if d.to == room), None)
    if door is None:
        return Refusal(ReasonCode.NO_DOOR, f"enter: no door leads from here to {name}")
    if near_door(p.position[i], door, INNER_DOOR_REACH):
        return None
    up = door.position[2] - float(p.position[i, 2])
    if abs(up) > _LEVEL:
        way = "up" if up > 0 else "down"
        sentence = f"enter: the door to {name} is {abs(up):.1f} m further {way}; take the stairs"
        return Refusal(ReasonCode.TOO_HIGH_OR_LOW, sentence)
    return Refusal(ReasonCode.TOO_FAR, f"enter: the door to {name} is farther than {INNER_DOOR_REACH:g} m away")


def _refuse_entrance(name: str, i: int, state: SimulationState) -> Refusal | None:
    place = state.place(name)
    if place is None:
        return Refusal(ReasonCode.UNKNOWN_PLACE, f"enter: no place has the id {short(name)}")
    if place.entrance is None or not place.rooms:
        return Refusal(ReasonCode.NO_DOOR, f"enter: {place.name} is in the open; there is nothing to enter")
    away = float(np.hypot(*(state.base.doors[state.place_index[name]] - state.people.position[i, :2])))
    if away > DOOR_REACH:
        sentence = f"enter: the entrance of {place.name} is {away:.1f} m away; {DOOR_REACH:g} m or less is needed"
        return Refusal(ReasonCode.TOO_FAR, sentence)
    closure = state.environment.agenda.effects.shut.get(name)
    if closure is None:
        if not state.is_locked_out(i, name):
            return None
        assert state.openings is not None
        return Refusal(ReasonCode.CLOSED, f"enter: {place.name} is closed now; it is {state.openings.hours(name)}")
    return Refusal(ReasonCode.CLOSED, f"enter: {place.name} is closed ({closure.event.title})")


def _room_behind(name: str, i: int, state: SimulationState) -> int:
    if state.people.room[i] >= 0:
        return state.indoor.index[name]
    place = state.place(name)
    assert place is not None
    return state.indoor.index[place.rooms[0]]


def enter(values: Values, i: int, state: SimulationState) -> None:
    """Go through an entrance, or through the door to the next room."""
    p, indoor = state.people, state.indoor
    if p.lift_left[i] > 0.0 or p.at_door().item(i):
        return
    if p.room[i] < 0:
        doorways.begin(i, state.place_index[values["place"]], state)
        return
    room = _room_behind(values["place"], i, state)
    if lifts.is_ride(int(p.room[i]), room, state):
        lifts.ride(i, room, state)
        return
    place_in_room(i, room, state, near=indoor.arrival(room, int(p.room[i])))
    if indoor.rooms[room].kind != LIFT:  # whose doors open by themselves
        doorways.let_go(i, state)


def check_exit(values: Values, i: int, state: SimulationState) -> Refusal | None:
    """Judge going out: by a door of this room that leads outdoors."""
    p = state.people
    if p.room[i] < 0:
        return Refusal(ReasonCode.OUTDOORS, "exit: already outdoors")
    if p.at_door().item(i):
        return None  # on the way out
    door = next((d for d in state.indoor.doors[p.room[i]] if d.to < 0), None)
    if door is None:
        return Refusal(ReasonCode.NO_DOOR, "exit: no door of this room leads outdoors")
    if not near_door(p.position[i], door, DOOR_REACH):
        return Refusal(ReasonCode.TOO_FAR, f"exit: the door is farther than {DOOR_REACH:g} m away")
    if spot_outside(i, state) is None:
        return Refusal(ReasonCode.BLOCKED, "exit: somebody stands in front of the door")
    return None


def leave(values: Values, i: int, state: SimulationState) -> None:
    """Go to the door and out of the building, to look away from it there."""
    p = state.people
    if not p.at_door().item(i):
        doorways.begin(i, int(p.place[i]), state)


DOORS = (
    ActionType(
        "enter",
        "Go into a place (its id) by an entrance within 2 m, which takes 2 to 3 s, or into the next room (its id) by a "
        "door within 1 m; a lift takes its time from car to car.",
        enter,
        check_enter,
        {"place": Field("name", slot="place")},
    ),
    ActionType("exit", "Go out of the building by a door within 2 m, which takes 2 to 4 s.", leave, check_exit),
)
