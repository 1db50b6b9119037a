"""Actions of people on things and on each other: picking up, putting down, handing over, speaking, buying."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.geometry import distance, distances, wrap_angle
from vico.rules import EARSHOT, REACH, ReasonCode, reach_up
from vico.sim.actions.model import ActionType, Actors, Field, Refusal, Situation, Values, short
from vico.sim.bodies.arrays import RESIDENT
from vico.sim.bodies.collisions import box_gap, free_place_on_deck, lay_on_deck
from vico.sim.bodies.seats import AT_SPOT, PRICE, SERVICE
from vico.sim.bodies.state_arrays import Posture, Vehicle
from vico.sim.people.hearing import listeners_of_person, listeners_of_robot
from vico.sim.people.placement import (
    ObjectBox,
    drop_objects,
    free_hand,
    free_spot_on_surface,
    gesture,
    move_held_objects,
    object_top_below,
    objects_on,
    overlapping_entity,
    place_in_line,
)
from vico.sim.state.simulation_state import SimulationState
from vico.world.model import Container

_AHEAD = (0.55, 0.45, 0.7, 0.9)
# Who lies where a thing is to go is given this much room beside it, metres.
_BESIDE = 0.8
# Containers are searched for a free spot at this pitch, metres.
_PITCH = 0.1


@dataclass(frozen=True)
class PlacementPoint:
    """Where a thing comes to lie.

    Attributes
    ----------
    point
        World frame, metres, float64, shape ``(3,)``.
    carrier
        The entity that carries the thing there; 0: the ground, a floor or furniture.
    offset
        Where it lies in the carrier's frame, metres, shape ``(3,)``; None without a carrier.
    beside
        Entity of whoever or whatever is at the point that was asked for, so that the thing lies beside it; 0: nobody.
    on
        Entity of the thing that it lies on; 0: none.
    """

    point: NDArray[np.float64]
    carrier: int = 0
    offset: NDArray[np.float64] | None = None
    beside: int = 0
    on: int = 0


def check_pick(values: Values, i: int, state: SimulationState) -> Refusal | None:
    """Judge picking up: a free hand, and something to carry within reach."""
    p, objects = state.people, state.objects
    hand = values["hand"]
    if p.held[i, hand]:
        return Refusal(ReasonCode.HAND_FULL, f"pick: hand {hand} holds {int(p.held[i, hand])} already")
    k = objects.index(values["object"])
    if k < 0:
        return Refusal(ReasonCode.NOT_PORTABLE, f"pick: {values['object']} is nothing that can be carried")
    if objects.hand[k] >= 0:
        return Refusal(ReasonCode.HELD_ALREADY, f"pick: {objects.names[k]} is in somebody's hand")
    what, point = objects.names[k], objects.position[k]
    if int(objects.room[k]) != p.room[i]:
        return Refusal(ReasonCode.ELSEWHERE, f"pick: {what} is not in here")
    away = math.hypot(point[0] - p.position[i, 0], point[1] - p.position[i, 1])
    if away > REACH:
        return Refusal(ReasonCode.TOO_FAR, f"pick: {what} is {away:.1f} m away; reach is {REACH} m")
    if not -0.5 <= point[2] - p.position[i, 2] <= reach_up(float(p.height[i])):
        return Refusal(ReasonCode.TOO_HIGH_OR_LOW, f"pick: {what} is too high or too low to reach")
    return None


def pick(values: Values, i: int, state: SimulationState) -> None:
    """Take a thing into a hand."""
    p, objects = state.people, state.objects
    k = objects.index(values["object"])
    above = objects_on(k, state) if objects.holder[k] == 0 else []
    hold(k, i, values["hand"], state)
    drop_objects(above, state)
    gesture("pick", i, state, hand=values["hand"])
    state.events.add("pick", p.names[i], f"picks up {objects.names[k]}", p.position[i], object=int(objects.entity[k]))


def check_put(values: Values, i: int, state: SimulationState) -> Refusal | None:
    """Judge putting down: something in the hand, and a spot for it."""
    hand = values["hand"]
    if not state.people.held[i, hand]:
        return Refusal(ReasonCode.HAND_EMPTY, f"put: hand {hand} is empty")
    spot = put_down(values.get("target"), i, hand, state)
    return spot if isinstance(spot, Refusal) else None


def put(values: Values, i: int, state: SimulationState) -> None:
    """Put down what a hand holds."""
    p, objects = state.people, state.objects
    spot = put_down(values.get("target"), i, values["hand"], state)
    assert isinstance(spot, PlacementPoint)
    k = objects.index(int(p.held[i, values["hand"]]))
    p.held[i, values["hand"]] = 0
    objects.hand[k] = -1
    objects.holder[k] = 0
    objects.position[k] = spot.point
    objects.room[k] = p.room[i]
    deck = state.deck(spot.carrier)
    if deck is not None and spot.offset is not None:
        lay_on_deck(deck, spot.carrier, k, spot.offset, objects)
    gesture("put", i, state, hand=values["hand"])
    where = f" beside {state.entity(spot.beside)['name']}" if spot.beside else ""
    where = f" on {state.entity(spot.on)['name']}" if spot.on else where
    said, entity = f"puts down {objects.names[k]}{where}", int(objects.entity[k])
    state.events.add("put", p.names[i], said, objects.position[k], object=entity)


def check_hand_over(values: Values, i: int, state: SimulationState) -> Refusal | None:
    """Judge handing over: something in the hand, and somebody near with a free one."""
    p = state.people
    hand = values["hand"]
    if not p.held[i, hand]:
        return Refusal(ReasonCode.HAND_EMPTY, f"hand_over: hand {hand} is empty")
    if values["agent"] not in p.names:
        return Refusal(ReasonCode.UNKNOWN_AGENT, f"hand_over: nobody is called {short(values['agent'])}")
    j = p.names.index(values["agent"])
    if j == i:
        return Refusal(ReasonCode.SELF, "hand_over: that is yourself")
    if not state.same_space(i, j):
        return Refusal(ReasonCode.ELSEWHERE, f"hand_over: {p.names[j]} is not in here")
    away = distance(p.position[i, :2], p.position[j, :2])
    if away > REACH:
        return Refusal(ReasonCode.TOO_FAR, f"hand_over: {p.names[j]} is {away:.1f} m away; reach is {REACH} m")
    if p.held[j].all():
        return Refusal(ReasonCode.HAND_FULL, f"hand_over: {p.names[j]} has no free hand")
    return None


def hand_over(values: Values, i: int, state: SimulationState) -> None:
    """Give what a hand holds to somebody's free hand, the left one first."""
    p, objects = state.people, state.objects
    j = p.names.index(values["agent"])
    k = objects.index(int(p.held[i, values["hand"]]))
    p.held[i, values["hand"]] = 0
    hold(k, j, 0 if not p.held[j, 0] else 1, state)
    gesture("reach", i, state, hand=values["hand"])
    state.events.add(
        "hand_over",
        p.names[i],
        f"hands {objects.names[k]} to {p.names[j]}",
        p.position[i],
        object=int(objects.entity[k]),
        to=p.names[j],
    )


def hold(k: int, i: int, hand: int, state: SimulationState) -> None:
    """Put object `k` into a hand of person `i`."""
    p, objects = state.people, state.objects
    p.held[i, hand] = objects.entity[k]
    objects.holder[k] = p.entity[i]
    objects.hand[k] = hand
    move_held_objects(state)


def put_down(target: Any, i: int, hand: int, state: SimulationState) -> PlacementPoint | Refusal:
    """Find where a thing would come to lie.

    Parameters
    ----------
    target
        Entity of a container or of a robot with a deck, a point, or None for the ground ahead.

    Returns
    -------
    PlacementPoint or Refusal
        The spot, or why there is none.
    """
    p = state.people
    k = state.objects.index(int(p.held[i, hand]))
    size = state.objects.size[k]
    thing = ObjectBox(size, float(state.objects.yaw[k]), int(state.objects.entity[k]))
    if target is None:
        return _ahead(i, thing, state)
    if isinstance(target, tuple):
        return _at_point(target, i, thing, state)
    room = int(p.room[i])
    if room >= 0:
        for container in state.indoor.rooms[room].containers:
            if container.entity == target:
                return _on(container, i, k, state)
    deck = state.deck(target)
    if deck is not None:
        away = deck.gap(state.people.position[i])
        if state.people.room[i] >= 0 or away > REACH:
            return Refusal(ReasonCode.TOO_FAR, f"put: the deck is {away:.1f} m away; reach is {REACH} m")
        place = free_place_on_deck(deck, target, k, state.objects)
        if isinstance(place, str):
            return Refusal(ReasonCode.NO_FREE_SPOT, f"put: {place}")
        return PlacementPoint(deck.world(place), carrier=target, offset=place)
    return Refusal(ReasonCode.UNKNOWN_TARGET, f"put: {target} is nothing here that a thing can be put on")


def _ahead(i: int, thing: ObjectBox, state: SimulationState) -> PlacementPoint | Refusal:
    p = state.people
    room = int(p.room[i])
    c, s = math.cos(p.yaw[i]), math.sin(p.yaw[i])
    for ahead in _AHEAD:
        x, y = p.position[i, 0] + ahead * c, p.position[i, 1] + ahead * s
        if room < 0:
            is_free = state.world.walkable.class_at((x, y)) > 0
            ground = float(state.world.height((x, y)))
        else:
            is_free = state.indoor.gap(room, (x, y)) >= min(thing.size[0], thing.size[1]) / 2
            ground = state.indoor.floor_at(room, (x, y))
        spot = np.array([x, y, ground])
        if is_free and overlapping_entity(thing, spot, room, state) == 0:
            return PlacementPoint(spot)
    return Refusal(ReasonCode.NO_FREE_SPOT, "put: no free ground ahead; turn, or name a target")


def _at_point(
    point: tuple[float, float, float], i: int, thing: ObjectBox, state: SimulationState
) -> PlacementPoint | Refusal:
    p = state.people
    x, y, z = point
    away = math.hypot(x - p.position[i, 0], y - p.position[i, 1])
    if away > REACH:
        return Refusal(ReasonCode.TOO_FAR, f"put: the point is {away:.1f} m away; reach is {REACH} m")
    room = int(p.room[i])
    if room >= 0:
        if not state.indoor.holds(room, (x, y, state.indoor.floor_at(room, (x, y)))):
            return Refusal(ReasonCode.ELSEWHERE, "put: the point is outside this room")
        surface = state.indoor.resting_point(room, (x, y), math.hypot(thing.size[0], thing.size[1]) / 2)
    else:
        if state.world.walkable.class_at((x, y)) == 0:
            return Refusal(ReasonCode.BLOCKED, "put: something solid is at that point")
        surface = np.array([x, y, float(state.world.height((x, y)))])
    height = float(surface[2])
    if not height - 0.5 <= z <= height + reach_up(float(p.height[i])):
        return Refusal(ReasonCode.TOO_HIGH_OR_LOW, f"put: the point is not above the surface there ({height:.2f} m)")
    on_another = object_top_below(thing, point, room, state)
    if on_another is not None and on_another[0][2] > height:
        return PlacementPoint(on_another[0], on=on_another[1])
    other = overlapping_entity(thing, surface, room, state)
    if other == 0:
        return PlacementPoint(surface)
    beside = free_spot_on_surface(thing, surface, room, state, within=_BESIDE)
    if beside is None or math.hypot(beside[0] - p.position[i, 0], beside[1] - p.position[i, 1]) > REACH:
        name = state.entity(other)["name"]
        return Refusal(ReasonCode.NO_FREE_SPOT, f"put: {name} is at that point, and there is no room beside it")
    return PlacementPoint(beside, beside=other)


def _on(container: Container, i: int, k: int, state: SimulationState) -> PlacementPoint | Refusal:
    """Free spot of a container's top nearest to the person, apart from what lies there already."""
    p, objects = state.people, state.objects
    x, y, z = container.centre
    half = np.array(container.size) / 2
    person = p.position[i]
    gap = box_gap(person[0], person[1], x, y, container.yaw, half[0], half[1])
    if gap > REACH:
        return Refusal(ReasonCode.TOO_FAR, f"put: the {container.kind} is {gap:.1f} m away; reach is {REACH} m")
    if z - person[2] > reach_up(float(p.height[i])):
        return Refusal(ReasonCode.TOO_HIGH_OR_LOW, f"put: the {container.kind} is too high")
    margin = np.minimum(half * 0.9, np.hypot(objects.size[k, 0], objects.size[k, 1]) / 2)
    u = np.linspace(-half[0] + margin[0], half[0] - margin[0], max(1, int(2 * (half[0] - margin[0]) / _PITCH) + 1))
    v = np.linspace(-half[1] + margin[1], half[1] - margin[1], max(1, int(2 * (half[1] - margin[1]) / _PITCH) + 1))
    grid = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    c, s = math.cos(container.yaw), math.sin(container.yaw)
    spots = np.column_stack([x + c * grid[:, 0] - s * grid[:, 1], y + s * grid[:, 0] + c * grid[:, 1]])
    away = distances(spots, person[:2])
    lying = (objects.hand < 0) & (objects.room == p.room[i])
    lying &= np.abs(objects.position[:, 2] - z) < 0.3
    radius = np.hypot(objects.size[:, 0], objects.size[:, 1]) / 2
    for index in np.argsort(away, kind="stable"):
        if away[index] > REACH:
            break
        clear = distances(objects.position[lying, :2], spots[index]) >= radius[lying] + radius[k]
        on_floor_below = container.kind == "floor" and state.indoor.gap(int(p.room[i]), spots[index]) < radius[k]
        if clear.all() and not on_floor_below:
            return PlacementPoint(np.array([*spots[index], z]))
    return Refusal(ReasonCode.NO_FREE_SPOT, f"put: no free spot on the {container.kind} within reach")


_HAND = Field("hand", slot="hand")
_WHEN = Situation.ON_FOOT | Situation.SEATED

HANDS = (
    ActionType(
        "pick",
        "Take an object within 1.5 m into a free hand; a hand holds one.",
        pick,
        check_pick,
        {"hand": _HAND, "object": Field("integer", slot="entity")},
        when=_WHEN,
    ),
    ActionType(
        "put",
        "Put down what a hand holds: on a container, on a robot's deck, at a point, or on the ground ahead.",
        put,
        check_put,
        {"hand": _HAND, "target": Field("target", required=False, slot="where")},
        when=_WHEN,
    ),
    ActionType(
        "hand_over",
        "Give what a hand holds to somebody within 1.5 m.",
        hand_over,
        check_hand_over,
        {"hand": _HAND, "agent": Field("name", slot="agent")},
        when=_WHEN,
    ),
)


#: Nobody talks with hands to people farther off, metres.
_TALKING_DISTANCE = 4.0
#: Who looks so nearly at another one faces them, radians.
_FACES = math.radians(15.0)


def communicate(values: Values, i: int, state: SimulationState) -> None:
    """Say something to everybody near in the same space; noise and corners keep some from hearing it."""
    p = state.people
    heard = listeners_of_person(state, i, values.get("range", EARSHOT))
    state.events.say(p.names[i], values["text"], p.position[i], heard.hearers, heard.missed)
    hand = free_hand(i, state)
    near = _listeners_near(heard.hearers, i, state)
    gesture("wave" if near is None else "talk", i, state, hand=1 if hand is None else hand)
    for j in near or []:
        if p.kind[j] == RESIDENT:
            _face(j, i, state)
    if near:
        _face(i, near[0], state)


def communicate_as_robot(values: Values, robot: int, state: SimulationState) -> None:
    """Say something to people near, as `communicate` does, and to all other robots by radio."""
    assert state.robots is not None
    heard = listeners_of_robot(state, robot, values.get("range", EARSHOT))
    position = state.robots.bodies().position[robot]
    state.events.say(state.robots.names[robot], values["text"], position, heard.hearers, heard.missed)


def _face(i: int, j: int, state: SimulationState) -> None:
    """Turn someone who stands still to somebody else."""
    p = state.people
    if p.move_left[i] or p.turn_left[i] or p.posture[i] != Posture.STANDING or p.vehicle[i] != Vehicle.NONE:
        return
    dx, dy = p.position[j, :2] - p.position[i, :2]
    turn = wrap_angle(math.atan2(dy, dx) - float(p.yaw[i]))
    if abs(turn) > _FACES:
        p.turn_left[i] = turn


def _listeners_near(listeners: list[str], i: int, state: SimulationState) -> list[int] | None:
    """Return which people listen from so near that one talks with them, the nearest first; None if all are farther."""
    p = state.people
    people = [p.names.index(name) for name in listeners if name in p.names]
    if not people:
        return []
    away = distances(p.position[people, :2], p.position[i, :2])
    near = [people[k] for k in np.argsort(away, kind="stable") if away[k] <= _TALKING_DISTANCE]
    return near or None


def task_complete(values: Values, i: int, state: SimulationState) -> None:
    """Report a task as done."""
    p, index = state.people, values["index"]
    state.events.add("task_complete", p.names[i], f"reports task {index} done", p.position[i], index=index)


_RANGE = Field(
    "number", required=False, low=0.0, high=EARSHOT, above_low=True, unit="m", slot="amount", scale=EARSHOT, least=0.1
)

SPEECH = (
    ActionType(
        "communicate",
        "Say something to everybody within a range in the same space who can hear it above the noise.",
        communicate,
        fields={"text": Field("text", slot="text"), "range": _RANGE},
        when=Situation.AWAKE,
    ),
)
#: What robots do under that name.
ROBOT_SPEECH = (
    ActionType(
        "communicate",
        "Have a robot say something to people near it, and to all other robots by radio; it goes on with what it does.",
        communicate_as_robot,
        fields={"text": Field("text"), "range": _RANGE},
        when=Situation(0),
        actors=Actors.ROBOTS,
    ),
)
REPORTS = (
    ActionType(
        "task_complete",
        "Report a task as done, by its index.",
        task_complete,
        fields={"index": Field("integer", low=0, slot="index")},
        when=Situation.ANY,
    ),
)


def check_queue(values: Values, i: int, state: SimulationState) -> Refusal | None:
    """Judge joining a line: a till in the room, at its end, with the money."""
    p, room = state.people, int(state.people.room[i])
    if room not in state.tills:
        return Refusal(ReasonCode.UNKNOWN_TARGET, "queue: there is no till in this room")
    if state.lines.room[i] == room:
        return None
    place = place_in_line(i, state)
    if place is None:
        return Refusal(
            ReasonCode.FULL, f"queue: {len(state.lines.waiting(room))} stand in line, and there is no room for more"
        )
    away = distance(p.position[i, :2], place[1])
    if away > AT_SPOT:
        return Refusal(
            ReasonCode.TOO_FAR, f"queue: the end of the line is {away:.1f} m away; {AT_SPOT:g} m or less is needed"
        )
    cash = float(p.cash[i])
    if cash < PRICE:
        return Refusal(ReasonCode.NO_MONEY, f"queue: one pays {PRICE:g}, and you have {cash:.2f}")
    return None


def queue(values: Values, i: int, state: SimulationState) -> None:
    """Stand at the end of the line, or stay in it."""
    room = int(state.people.room[i])
    if state.lines.room[i] != room:
        before = len(state.lines.waiting(room))
        state.lines.join(i, room)
        state.events.add("queue", state.people.names[i], f"stands in line behind {before}", state.people.position[i])


SHOPS = (
    ActionType(
        "queue",
        f"Stand in line at the till of the room, at its end: served in turn, {SERVICE:g} s each, for {PRICE:g}.",
        queue,
        check_queue,
    ),
)
