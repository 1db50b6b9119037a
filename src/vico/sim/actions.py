"""What agents may ask for, and why it may be refused. Checking never raises and changes nothing."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from vico.sim.avatars import BIKE_SPEED, RUN_SPEED
from vico.sim.handling import put_down
from vico.sim.indoor import DOOR_REACH, INNER_DOOR_REACH, near_door
from vico.sim.moves import spot_outside
from vico.sim.rides import why_not
from vico.sim.stage import Stage
from vico.sim.state import REACH, REACH_UP, Posture, Vehicle

EARSHOT = 10.0
LONGEST_TEXT = 1000

Kind = Literal["number", "integer", "point", "vector", "text", "hand", "target", "name"]

# Fields of each action: name -> (kind, required).
FIELDS: dict[str, dict[str, tuple[Kind, bool]]] = {
    "move_forward": {"distance": ("number", True)},
    "turn_left": {"degrees": ("number", True)},
    "turn_right": {"degrees": ("number", True)},
    "look_at": {"target": ("point", True)},
    "pick": {"hand": ("hand", True), "object": ("integer", True)},
    "put": {"hand": ("hand", True), "target": ("target", False)},
    "hand_over": {"hand": ("hand", True), "agent": ("name", True)},
    "enter": {"place": ("name", True)},
    "exit": {},
    "enter_bus": {},
    "exit_bus": {},
    "enter_bike": {},
    "exit_bike": {},
    "communicate": {"text": ("text", True), "range": ("number", False)},
    "sit": {},
    "stand": {},
    "sleep": {},
    "wake": {},
    "drink": {},
    "eat": {},
    "wait": {},
    "task_complete": {"index": ("integer", True)},
    "control": {"vector": ("vector", True)},
}
ACTIONS = tuple(FIELDS)

# What still works asleep, seated, and on a vehicle.
_ASLEEP = {"sleep", "wake", "wait", "task_complete"}
_SEATED = _ASLEEP | {
    "turn_left", "turn_right", "look_at", "pick", "put", "hand_over", "communicate", "sit", "stand", "drink", "eat",
}  # fmt: skip
_IN_BUS = {"exit_bus", "communicate", "look_at", "turn_left", "turn_right", "wait", "drink", "eat", "task_complete"}
_ON_BIKE = {"exit_bike", "communicate", "look_at", "turn_left", "turn_right", "move_forward", "wait", "task_complete"}


@dataclass(frozen=True)
class Command:
    """A well-formed action: its kind and its values, in plain types."""

    kind: str
    values: Mapping[str, Any]


@dataclass(frozen=True)
class Refusal:
    """Why an action will not be done."""

    reason: str


def check(action: object, agent: int, stage: Stage) -> Command | Refusal:
    """Judge an action in the light of the state.

    Parameters
    ----------
    action
        Anything at all; good ones are mappings with ``type`` and the fields of `FIELDS`.
    agent
        Index into ``stage.names``.

    Returns
    -------
    Command or Refusal
        What to do, or why not.
    """
    command = parse(action)
    if isinstance(command, Refusal):
        return command
    people = len(stage.people)
    if agent >= people:
        return _check_robot(command, agent - people, stage)
    if command.kind == "control":
        return Refusal("control is for robots; avatars move with move_forward, turn_left and turn_right")
    reason = _check_posture(command.kind, agent, stage) or _RULES.get(command.kind, _allowed)(
        command.values, agent, stage
    )
    return Refusal(reason) if reason else command


def parse(action: object) -> Command | Refusal:
    """Judge the form of an action alone: its type, its fields and their types."""
    if not isinstance(action, Mapping):
        return Refusal(f"an action is a dict with a 'type', not {type(action).__name__}")
    kind = action.get("type")
    if not isinstance(kind, str) or kind not in FIELDS:
        return Refusal(f"unknown action type {_short(kind)}; types are {', '.join(ACTIONS)}")
    expected = FIELDS[kind]
    odd = [_short(name) for name in action if name != "type" and name not in expected]
    if odd:
        known = ", ".join(expected) or "none"
        return Refusal(f"{kind}: unknown field {odd[0]}; its fields are: {known}")
    values: dict[str, Any] = {}
    for name, (form, required) in expected.items():
        if name not in action or (action[name] is None and not required):
            if required:
                return Refusal(f"{kind}: field {name!r} is missing")
            continue
        value = _value(action[name], form)
        if value is None:
            return Refusal(f"{kind}: {name} has to be {_FORMS[form]}, not {_short(action[name])}")
        values[name] = value
    return Command(kind, values)


_FORMS: dict[Kind, str] = {
    "number": "a finite number",
    "integer": "a whole number",
    "point": "three finite numbers x, y, z",
    "vector": "a list of finite numbers",
    "text": f"1 to {LONGEST_TEXT} characters of text",
    "hand": "0 (left) or 1 (right)",
    "target": "an entity number or three finite numbers x, y, z",
    "name": "a name",
}


def _value(raw: object, form: Kind) -> Any:
    if form == "number":
        return _number(raw)
    if form in ("integer", "hand"):
        whole = _integer(raw)
        return None if form == "hand" and whole not in (0, 1) else whole
    if form in ("text", "name"):
        return raw if isinstance(raw, str) and raw.strip() and len(raw) <= LONGEST_TEXT else None
    if form == "target" and not _is_list(raw):
        return _integer(raw)
    if not _is_list(raw):
        return None
    numbers = [_number(part) for part in raw]  # type: ignore[attr-defined]
    if None in numbers or (form in ("point", "target") and len(numbers) != 3) or not 0 < len(numbers) <= 64:
        return None
    return tuple(numbers)


def _is_list(raw: object) -> bool:
    return isinstance(raw, (list, tuple)) or (isinstance(raw, np.ndarray) and raw.ndim == 1)


def _number(raw: object) -> float | None:
    if isinstance(raw, np.ndarray) and raw.size == 1:
        raw = raw.reshape(-1)[0]
    if isinstance(raw, (bool, np.bool_)) or not isinstance(raw, (int, float, np.integer, np.floating)):
        return None
    try:
        value = float(raw)
    except OverflowError:
        return None
    return value if math.isfinite(value) and abs(value) <= 1e12 else None


def _integer(raw: object) -> int | None:
    value = _number(raw)
    return int(value) if value is not None and value == int(value) else None


def _short(value: object) -> str:
    try:
        text = repr(value)
    except Exception:
        # A value that can't even be shown is still only a bad action.
        text = f"a {type(value).__name__}"
    return text if len(text) <= 60 else text[:57] + "..."


def _allowed(values: Mapping[str, Any], i: int, stage: Stage) -> str | None:
    return None


def _check_posture(kind: str, i: int, stage: Stage) -> str | None:
    p = stage.people
    if p.posture[i] == Posture.LYING and kind not in _ASLEEP:
        return f"{kind}: asleep; wake first"
    if p.posture[i] == Posture.SITTING and kind not in _SEATED:
        return f"{kind}: seated; stand first"
    if p.vehicle[i] == Vehicle.BUS and kind not in _IN_BUS:
        return f"{kind}: in a bus; exit_bus first"
    if p.vehicle[i] == Vehicle.BIKE and kind not in _ON_BIKE:
        return f"{kind}: on a bicycle; exit_bike first"
    return None


def _check_move(values: Mapping[str, Any], i: int, stage: Stage) -> str | None:
    limit = BIKE_SPEED if stage.people.vehicle[i] == Vehicle.BIKE else RUN_SPEED
    distance = values["distance"]
    if not 0.0 <= distance <= limit:
        return f"move_forward: {distance:g} m is out of range; 0 to {limit:g} m a step"
    return None


def _check_turn(values: Mapping[str, Any], i: int, stage: Stage) -> str | None:
    degrees = values["degrees"]
    return None if 0.0 <= degrees <= 360.0 else f"turn: {degrees:g} degrees is out of range; 0 to 360"


def _check_look(values: Mapping[str, Any], i: int, stage: Stage) -> str | None:
    x, y, _ = values["target"]
    away = math.hypot(x - stage.people.position[i, 0], y - stage.people.position[i, 1])
    return None if away > 1e-3 else "look_at: the target is where you stand"


def _check_pick(values: Mapping[str, Any], i: int, stage: Stage) -> str | None:
    p, goods = stage.people, stage.goods
    hand = values["hand"]
    if p.held[i, hand]:
        return f"pick: hand {hand} holds {int(p.held[i, hand])} already"
    k = goods.index(values["object"])
    if k < 0:
        return f"pick: {values['object']} is nothing that can be carried"
    if goods.hand[k] >= 0:
        return f"pick: {goods.names[k]} is in somebody's hand"
    return _check_within("pick", goods.names[k], goods.position[k], int(goods.room[k]), i, stage)


def _check_within(verb: str, what: str, point: NDArray[np.float64], room: int, i: int, stage: Stage) -> str | None:
    p = stage.people
    if room != p.room[i]:
        return f"{verb}: {what} is not in here"
    away = math.hypot(point[0] - p.position[i, 0], point[1] - p.position[i, 1])
    if away > REACH:
        return f"{verb}: {what} is {away:.1f} m away; reach is {REACH} m"
    if not -0.5 <= point[2] - p.position[i, 2] <= REACH_UP:
        return f"{verb}: {what} is too high or too low to reach"
    return None


def _check_put(values: Mapping[str, Any], i: int, stage: Stage) -> str | None:
    hand = values["hand"]
    if not stage.people.held[i, hand]:
        return f"put: hand {hand} is empty"
    spot = put_down(values.get("target"), i, hand, stage)
    return spot if isinstance(spot, str) else None


def _check_hand_over(values: Mapping[str, Any], i: int, stage: Stage) -> str | None:
    p = stage.people
    hand = values["hand"]
    if not p.held[i, hand]:
        return f"hand_over: hand {hand} is empty"
    if values["agent"] not in p.names:
        return f"hand_over: nobody is called {_short(values['agent'])}"
    j = p.names.index(values["agent"])
    if j == i:
        return "hand_over: that is yourself"
    if not stage.same_space(i, j):
        return f"hand_over: {p.names[j]} is not in here"
    away = float(np.hypot(*(p.position[i, :2] - p.position[j, :2])))
    if away > REACH:
        return f"hand_over: {p.names[j]} is {away:.1f} m away; reach is {REACH} m"
    if p.held[j].all():
        return f"hand_over: {p.names[j]} has no free hand"
    return None


def _check_enter(values: Mapping[str, Any], i: int, stage: Stage) -> str | None:
    p, name = stage.people, values["place"]
    if p.room[i] >= 0:
        room = stage.indoor.index.get(name)
        if room is None:
            return f"enter: {_short(name)} is no room of this building; exit first to enter another place"
        door = next((d for d in stage.indoor.doors[p.room[i]] if d.to == room), None)
        if door is None:
            return f"enter: no door leads from here to {name}"
        if not near_door(p.position[i], door, INNER_DOOR_REACH):
            up = door.position[2] - float(p.position[i, 2])
            if abs(up) > 0.5:
                way = "up" if up > 0 else "down"
                return f"enter: the door to {name} is {abs(up):.1f} m further {way}; take the stairs"
            return f"enter: the door to {name} is farther than {INNER_DOOR_REACH:g} m away"
    else:
        place = stage.place(name)
        if place is None:
            return f"enter: no place has the id {_short(name)}"
        if place.entrance is None or not place.rooms:
            return f"enter: {place.name} is in the open; there is nothing to enter"
        away = float(np.hypot(*(stage.doors[stage.place_index[name]] - p.position[i, :2])))
        if away > DOOR_REACH:
            return f"enter: the entrance of {place.name} is {away:.1f} m away; {DOOR_REACH:g} m or less is needed"
        room = stage.indoor.index[place.rooms[0]]
    anchor = stage.indoor.arrival(room, int(p.room[i]) if p.room[i] >= 0 else -1)
    if stage.indoor.free_spot(room, anchor, stage.people_in(room)) is None:
        return "enter: it is full"
    return None


def _check_exit(values: Mapping[str, Any], i: int, stage: Stage) -> str | None:
    p = stage.people
    if p.room[i] < 0:
        return "exit: already outdoors"
    door = next((d for d in stage.indoor.doors[p.room[i]] if d.to < 0), None)
    if door is None:
        return "exit: no door of this room leads outdoors"
    if not near_door(p.position[i], door, DOOR_REACH):
        return f"exit: the door is farther than {DOOR_REACH:g} m away"
    return None if spot_outside(i, stage) is not None else "exit: somebody stands in front of the door"


def _check_communicate(values: Mapping[str, Any], i: int, stage: Stage) -> str | None:
    reach = values.get("range", EARSHOT)
    return None if 0.0 < reach <= EARSHOT else f"communicate: range {reach:g} m is out of range; up to {EARSHOT:g} m"


def _check_stand(values: Mapping[str, Any], i: int, stage: Stage) -> str | None:
    return None if stage.people.posture[i] == Posture.SITTING else "stand: not seated"


def _check_wake(values: Mapping[str, Any], i: int, stage: Stage) -> str | None:
    return None if stage.people.posture[i] == Posture.LYING else "wake: not asleep"


def _check_task(values: Mapping[str, Any], i: int, stage: Stage) -> str | None:
    return None if values["index"] >= 0 else "task_complete: index has to be 0 or more"


def _check_transit(kind: str, i: int, stage: Stage) -> str | None:
    return why_not(kind, i, stage)


def _check_robot(command: Command, robot: int, stage: Stage) -> Command | Refusal:
    if command.kind == "wait":
        return command
    if command.kind != "control":
        return Refusal(f"{command.kind}: robots take control and wait")
    assert stage.robots is not None
    width = stage.robots.control_size(robot)
    if len(command.values["vector"]) != width:
        return Refusal(f"control: {len(command.values['vector'])} numbers; this robot takes {width}")
    return command


_RULES = {
    "move_forward": _check_move,
    "turn_left": _check_turn,
    "turn_right": _check_turn,
    "look_at": _check_look,
    "pick": _check_pick,
    "put": _check_put,
    "hand_over": _check_hand_over,
    "enter": _check_enter,
    "exit": _check_exit,
    "communicate": _check_communicate,
    "stand": _check_stand,
    "wake": _check_wake,
    "task_complete": _check_task,
    "enter_bus": lambda values, i, stage: _check_transit("enter_bus", i, stage),
    "exit_bus": lambda values, i, stage: _check_transit("exit_bus", i, stage),
    "enter_bike": lambda values, i, stage: _check_transit("enter_bike", i, stage),
    "exit_bike": lambda values, i, stage: _check_transit("exit_bike", i, stage),
}
