"""Actions of people that move their bodies: walking, turning, looking, sitting, waiting, doors, buses and bicycles.

`vico.sim.people.doors` and `vico.sim.people.rides` carry on what is begun here.
"""

from __future__ import annotations

import math

import numpy as np

from vico.clock import DAY, clock_of
from vico.geometry import wrap_angle
from vico.rules import (
    BIKE_RATE,
    BIKE_REACH,
    BIKE_SPEED,
    BUS_DOOR_REACH,
    BUS_FARE,
    DOOR_REACH,
    INNER_DOOR_REACH,
    REACH,
    RUN_SPEED,
    ReasonCode,
)
from vico.sim.actions.model import ActionType, Actors, Check, Field, Perform, Refusal, Situation, Values, short
from vico.sim.bodies.rooms import near_door
from vico.sim.bodies.state_arrays import LEVEL_GAZE, Posture, Vehicle
from vico.sim.people import doors, rides
from vico.sim.people.placement import (
    eye_height,
    free_hand,
    gesture,
    has_room_to_sit,
    leave_seat,
    place_in_room,
    spot_beside_seat,
    spot_outside,
    take_seat,
)
from vico.sim.state.simulation_state import SimulationState
from vico.sim.transit import TransitSystem
from vico.world.model import LIFT

# Eyes turn up and down this far, radians.
_STEEPEST = math.radians(60.0)
# A member of an enumeration costs more to look up than all the rest.
_BIKE = int(Vehicle.BIKE)
#: A learner's turn is at most half a turn, degrees.
_HALF_TURN = 180.0


def check_move_forward(values: Values, i: int, state: SimulationState) -> Refusal | None:
    """Judge a walk: on foot one is slower than on a bicycle."""
    distance = values["distance"]
    if distance <= RUN_SPEED or state.people.vehicle.item(i) == _BIKE:
        return None
    return Refusal(
        ReasonCode.OUT_OF_RANGE, f"move_forward: {distance:g} m is out of range; 0 to {RUN_SPEED:g} m a step on foot"
    )


def move_forward(values: Values, i: int, state: SimulationState) -> None:
    """Walk or ride ahead over the coming second, turning meanwhile if asked; on snow and ice one gets less far."""
    p = state.people
    outdoors = state.environment.conditions
    if p.room.item(i) >= 0:
        gets_on = 1.0
    else:
        gets_on = outdoors.cycling if p.vehicle.item(i) == _BIKE else outdoors.walking
    p.move_left[i] = values["distance"] * gets_on
    p.move_speed[i] = values["distance"] * gets_on
    p.turn_left[i] = math.radians(values.get("turn") or 0.0)
    p.pitch[i] = LEVEL_GAZE


def turn_left(values: Values, i: int, state: SimulationState) -> None:
    """Turn counter-clockwise over the coming second."""
    _turn(values["degrees"], i, state)


def turn_right(values: Values, i: int, state: SimulationState) -> None:
    """Turn clockwise over the coming second."""
    _turn(-values["degrees"], i, state)


def _turn(degrees: float, i: int, state: SimulationState) -> None:
    state.people.turn_left[i] = math.radians(degrees)
    state.people.pitch[i] = LEVEL_GAZE


def check_look_at(values: Values, i: int, state: SimulationState) -> Refusal | None:
    """Judge a look: straight down there is no direction."""
    x, y, _ = values["target"]
    away = math.hypot(x - state.people.position[i, 0], y - state.people.position[i, 1])
    return None if away > 1e-3 else Refusal(ReasonCode.NO_DIRECTION, "look_at: the target is where you stand")


def look_at(values: Values, i: int, state: SimulationState) -> None:
    """Turn towards a point, the shorter way, and look up or down at it."""
    p = state.people
    x, y, z = values["target"]
    dx, dy = x - p.position[i, 0], y - p.position[i, 1]
    p.turn_left[i] = wrap_angle(math.atan2(dy, dx) - p.yaw[i])
    eyes = eye_height(state)[i] + p.position[i, 2]
    p.pitch[i] = min(_STEEPEST, max(-_STEEPEST, math.atan2(z - eyes, math.hypot(dx, dy))))


_DEGREES = Field("number", low=0.0, high=360.0, unit="degrees", slot="amount", scale=_HALF_TURN)

MOTION = (
    ActionType(
        "move_forward",
        "Walk (to 1 m), run (to 2.5 m) or ride (to 3 m) ahead, straight or turning meanwhile (to the left above 0); "
        "what is in the way stops it with `collision`.",
        move_forward,
        check_move_forward,
        {
            "distance": Field("number", low=0.0, high=BIKE_SPEED, unit="m", slot="amount", scale=RUN_SPEED),
            "turn": Field("number", required=False, low=-360.0, high=360.0, unit="degrees"),
        },
        when=Situation.ON_FOOT | Situation.ON_BIKE,
    ),
    ActionType("turn_left", "Turn to the left.", turn_left, fields={"degrees": _DEGREES}, when=Situation.AWAKE),
    ActionType("turn_right", "Turn to the right.", turn_right, fields={"degrees": _DEGREES}, when=Situation.AWAKE),
    ActionType(
        "look_at",
        "Turn towards a point and look up or down at it.",
        look_at,
        check_look_at,
        {"target": Field("point", slot="target")},
        when=Situation.AWAKE,
    ),
)


_TARGET = Field("integer", required=False, slot="entity")
_ON_FURNITURE = Situation.ON_FOOT | Situation.SEATED


def _check_rest(posture: Posture) -> Check:
    """Return what judges sitting or lying down: a free seat or bed within reach."""

    def check(values: Values, i: int, state: SimulationState) -> Refusal | None:
        if state.people.posture[i] == posture:
            return None
        found = _seat_for(posture, values, i, state)
        return found if isinstance(found, Refusal) else None

    return check


def _seat_for(posture: Posture, values: Values, i: int, state: SimulationState) -> int | Refusal:
    """Return the free seat or bed nearest to a person, of the thing that was asked for if one was; or why none."""
    p, seats = state.people, state.seats
    lies, asked = posture == Posture.LYING, values.get("target")
    verb, what = ("sleep", "bed") if lies else ("sit", "seat")
    # Who sits may lie down at once: they are looked for from the floor.
    x, y, z = p.position[i]
    feet = np.array([x, y, z if p.seat[i] < 0 else seats.floor[p.seat[i]]])
    near = seats.near(feet, int(p.room[i]), lies=lies)
    if asked is not None:
        near = near[seats.entity[near] == asked]
        what = f"{what} with the number {asked}"
    if not len(near):
        return Refusal(ReasonCode.NO_SEAT, f"{verb}: no {what} within {REACH} m")
    free = near[~state.seats_taken()[near]].tolist()
    if not free:
        return Refusal(ReasonCode.NO_SEAT, f"{verb}: no {what} within {REACH} m is free")
    if lies and p.room[i] >= 0:
        free = [bed for bed in free if seats.stand_before(bed, state.indoor) is not None]
    if not free:
        return Refusal(ReasonCode.NO_SEAT, f"{verb}: no {what} within {REACH} m can be got out of")
    seat = next((seat for seat in free if has_room_to_sit(seat, i, state)), None)
    if seat is None:
        return Refusal(ReasonCode.NO_SEAT, f"{verb}: somebody stands at every free {what} within {REACH} m")
    return seat


def _check_getting_up(verb: str, i: int, state: SimulationState) -> Refusal | None:
    if spot_beside_seat(i, state) is not None:
        return None
    p, seats = state.people, state.seats
    if p.room[i] >= 0 and seats.stand_before(int(p.seat[i]), state.indoor) is None:
        what = "bed" if p.posture[i] == Posture.LYING else "seat"
        return Refusal(ReasonCode.NO_FREE_SPOT, f"{verb}: walls and furniture leave no room to stand by this {what}")
    return Refusal(ReasonCode.NO_FREE_SPOT, f"{verb}: no room to stand; somebody is in the way")


def check_stand(values: Values, i: int, state: SimulationState) -> Refusal | None:
    """Judge standing up."""
    if state.people.posture[i] == Posture.SITTING:
        return _check_getting_up("stand", i, state)
    return Refusal(ReasonCode.NOT_SEATED, "stand: not seated")


def check_wake(values: Values, i: int, state: SimulationState) -> Refusal | None:
    """Judge waking up."""
    if state.people.posture[i] == Posture.LYING:
        return _check_getting_up("wake", i, state)
    return Refusal(ReasonCode.NOT_ASLEEP, "wake: not asleep")


def _rest(posture: Posture) -> Perform:
    def perform(values: Values, i: int, state: SimulationState) -> None:
        if state.people.posture[i] == posture:
            return
        seat = _seat_for(posture, values, i, state)
        assert isinstance(seat, int)
        take_seat(i, seat, state)

    return perform


def _rise(values: Values, i: int, state: SimulationState) -> None:
    """Get up, and stand beside the seat or the bed."""
    spot = spot_beside_seat(i, state)
    assert spot is not None
    leave_seat(i, spot, state)


def _show(clip: str) -> Perform:
    def perform(values: Values, i: int, state: SimulationState) -> None:
        hand = free_hand(i, state)
        gesture(clip, i, state, hand=1 if hand is None else hand)

    return perform


def check_hand(kind: str) -> Check:
    """Return what judges eating or drinking: a hand for it."""

    def check(values: Values, i: int, state: SimulationState) -> Refusal | None:
        if free_hand(i, state) is None:
            return Refusal(ReasonCode.HAND_FULL, f"{kind}: both hands are full")
        return None

    return check


def wait(values: Values, i: int, state: SimulationState) -> None:
    """Do nothing for a second."""


POSTURE = (
    ActionType(
        "sit",
        "Sit down on the nearest free seat within 1.5 m, or on a certain one.",
        _rest(Posture.SITTING),
        _check_rest(Posture.SITTING),
        {"target": _TARGET},
        when=_ON_FURNITURE,
    ),
    ActionType("stand", "Stand up from a seat.", _rise, check_stand, when=_ON_FURNITURE),
    ActionType(
        "sleep",
        "Lie down on the nearest free bed within 1.5 m, or on a certain one, and sleep.",
        _rest(Posture.LYING),
        _check_rest(Posture.LYING),
        {"target": _TARGET},
        when=_ON_FURNITURE | Situation.ASLEEP,
    ),
    ActionType("wake", "Wake and get up.", _rise, check_wake, when=_ON_FURNITURE | Situation.ASLEEP),
    ActionType("drink", "Drink something.", _show("drink"), check_hand("drink"), when=_ON_FURNITURE | Situation.IN_BUS),
    ActionType("eat", "Eat something.", _show("eat"), check_hand("eat"), when=_ON_FURNITURE | Situation.IN_BUS),
    ActionType("wait", "Do nothing.", wait, when=Situation.ANY, actors=Actors.PEOPLE | Actors.ROBOTS),
)


#: A door that lies further up or down than this is on another level, metres.
_LEVEL = 0.5


def check_enter(values: Values, i: int, state: SimulationState) -> Refusal | None:
    """Judge going in: through an entrance from the street, through a door from a room."""
    p, name = state.people, values["place"]
    if p.at_door().item(i):
        if p.room[i] < 0 and state.place_index.get(name) == p.door[i]:
            return None  # on the way in
        return Refusal(ReasonCode.MOVING, "enter: on the way through a door; wait until you are through")
    if p.lift_left[i] > 0.0:
        if state.indoor.index.get(name) == p.lift_room[i]:
            return None  # on the way there
        return Refusal(ReasonCode.MOVING, f"enter: the lift is moving; it is there in {p.lift_left[i]:.1f} s")
    refusal = _refuse_inner_door(name, i, state) if p.room[i] >= 0 else _refuse_entrance(name, i, state)
    if refusal is not None:
        return refusal
    room = _room_behind(name, i, state)
    anchor = state.indoor.arrival(room, int(p.room[i]) if p.room[i] >= 0 else -1)
    if state.indoor.free_spot(room, anchor, state.taken_in(room)) is None:
        return Refusal(ReasonCode.FULL, "enter: it is full")
    return None


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
        doors.approach_door(i, state.place_index[values["place"]], state)
        return
    room = _room_behind(values["place"], i, state)
    if doors.is_lift_ride(int(p.room[i]), room, state):
        doors.begin_lift_ride(i, room, state)
        return
    place_in_room(i, room, state, near=indoor.arrival(room, int(p.room[i])))
    if indoor.rooms[room].kind != LIFT:  # whose doors open by themselves
        doors.release_door(i, state)


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
        doors.approach_door(i, int(p.place[i]), state)


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


_NEAR_STOP = 6.0  # metres from the place to wait within which a stop is told of
_NO_TRANSIT = "this run has no transit"


def check_enter_bus(values: Values, i: int, state: SimulationState) -> Refusal | None:
    """Judge boarding: a bus that stands with a door near, a seat, the fare."""
    transit, p = state.transit, state.people
    if transit is None:
        return Refusal(ReasonCode.NO_TRANSIT, f"enter_bus: {_NO_TRANSIT}")
    refusal = _refuse_unless_on_foot_outdoors("enter_bus", i, state)
    if refusal is not None:
        return refusal
    bus = transit.bus_at(p.position[i])
    if bus is None:
        line = transit.goes_round(p.position[i], _NEAR_STOP)
        if line is not None:
            said = f"enter_bus: bus {line} does not come by here: it goes round a street that is closed"
            return Refusal(ReasonCode.CLOSED, said)
        said = (
            f"enter_bus: no bus or tram stands with a door within {BUS_DOOR_REACH:g} m{_from_depot(i, state, transit)}"
        )
        return Refusal(ReasonCode.NO_VEHICLE, said)
    if transit.ends(bus):
        what, _, name = transit.service_of(bus)
        return Refusal(ReasonCode.NO_VEHICLE, f"enter_bus: {what} {name} ends here{_from_depot(i, state, transit)}")
    if transit.aboard(bus) >= transit.capacity(bus):
        what, _, name = transit.service_of(bus)
        return Refusal(ReasonCode.FULL, f"enter_bus: {what} {name} is full with {transit.capacity(bus)} people")
    return _refuse_unless_paid("enter_bus", "the fare is", BUS_FARE, i, state)


def _from_depot(i: int, state: SimulationState, transit: TransitSystem) -> str:
    """Say which bus is awaited from the depot where somebody stands, if one is."""
    expected = transit.expected_from_depot(state.people.position[i], _NEAR_STOP)
    if expected is None:
        return ""
    return f"; bus {expected[0]} is in the depot until shortly before {clock_of(expected[1] % DAY)}"


def check_exit_bus(values: Values, i: int, state: SimulationState) -> Refusal | None:
    """Judge getting off: at a stop, with free ground at a door."""
    transit = state.transit
    if transit is None:
        return Refusal(ReasonCode.NO_TRANSIT, f"exit_bus: {_NO_TRANSIT}")
    if state.people.vehicle[i] != Vehicle.BUS:
        return Refusal(ReasonCode.NOT_RIDING, "exit_bus: not in a bus or tram")
    bus = rides.bus_of(i, state, transit)
    if transit.stopped_at(bus) is None:
        return Refusal(ReasonCode.MOVING, f"exit_bus: the {transit.service_of(bus)[0]} is moving")
    if rides.spot_beside_bus(bus, state, transit) is None:
        return Refusal(ReasonCode.NO_FREE_SPOT, "exit_bus: no free ground at the doors")
    return None


def check_enter_bike(values: Values, i: int, state: SimulationState) -> Refusal | None:
    """Judge mounting: a free bicycle near, and room to ride off."""
    transit = state.transit
    if transit is None:
        return Refusal(ReasonCode.NO_TRANSIT, f"enter_bike: {_NO_TRANSIT}")
    refusal = _refuse_unless_on_foot_outdoors("enter_bike", i, state)
    if refusal is not None:
        return refusal
    bike = transit.bicycles.at(state.people.position[i])
    if bike is None:
        return Refusal(ReasonCode.NO_VEHICLE, f"enter_bike: no free bicycle within {BIKE_REACH:g} m")
    if rides.room_to_ride(i, bike, state, transit) is None:
        return Refusal(ReasonCode.NO_FREE_SPOT, "enter_bike: no room to get on here")
    return _refuse_unless_paid("enter_bike", "the first minute costs", BIKE_RATE, i, state)


def check_exit_bike(values: Values, i: int, state: SimulationState) -> Refusal | None:
    """Judge dismounting."""
    if state.transit is None:
        return Refusal(ReasonCode.NO_TRANSIT, f"exit_bike: {_NO_TRANSIT}")
    if state.people.vehicle[i] != Vehicle.BIKE:
        return Refusal(ReasonCode.NOT_RIDING, "exit_bike: not on a bicycle")
    if rides.spot_beside_bicycle(i, state, state.transit) is None:
        return Refusal(ReasonCode.NO_FREE_SPOT, "exit_bike: no free ground beside the bicycle; ride on a little")
    return None


def _refuse_unless_paid(kind: str, what: str, price: float, i: int, state: SimulationState) -> Refusal | None:
    cash, owed = float(state.people.cash[i]), float(state.people.owed[i])
    if owed > 0.0:
        return Refusal(ReasonCode.NO_MONEY, f"{kind}: you owe {owed:.2f} for an earlier ride")
    if cash < price:
        return Refusal(ReasonCode.NO_MONEY, f"{kind}: {what} {price:g}, and you have {cash:.2f}")
    return None


def _refuse_unless_on_foot_outdoors(kind: str, i: int, state: SimulationState) -> Refusal | None:
    if state.people.vehicle[i] != Vehicle.NONE:
        return Refusal(ReasonCode.RIDING_ALREADY, f"{kind}: riding already")
    if state.people.room[i] >= 0:
        return Refusal(ReasonCode.INDOORS, f"{kind}: go outdoors first")
    return None


VEHICLES = (
    ActionType(
        "enter_bus",
        "Board a bus or tram that stands with a door near; the fare is 2.",
        lambda values, i, state: rides.board_bus(i, state),
        check_enter_bus,
    ),
    ActionType(
        "exit_bus",
        "Get off the bus or tram at a stop.",
        lambda values, i, state: rides.alight_bus(i, state),
        check_exit_bus,
        when=Situation.ON_FOOT | Situation.IN_BUS,
    ),
    ActionType(
        "enter_bike",
        "Get on a free bicycle within 2 m.",
        lambda values, i, state: rides.mount_bicycle(i, state),
        check_enter_bike,
    ),
    ActionType(
        "exit_bike",
        "Get off the bicycle, and pay: 0.2 a started minute, 20 more away from a station.",
        lambda values, i, state: rides.dismount_bicycle(i, state),
        check_exit_bike,
        when=Situation.ON_FOOT | Situation.ON_BIKE,
    ),
)
