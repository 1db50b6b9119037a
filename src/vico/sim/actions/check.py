"""Judging actions: form, actor, situation, range, and the action's own rule. Never raises and changes nothing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from vico.rules import ReasonCode
from vico.sim.actions.fields import FORMS, short
from vico.sim.actions.model import ActionType, Command, Refusal, Situation
from vico.sim.actions.table import ACTIONS, PEOPLE_ACTIONS, ROBOT_ACTIONS, form_of
from vico.sim.simulation_state import SimulationState
from vico.sim.state import Posture, Vehicle

_OF_PEOPLE, _OF_ROBOTS = frozenset(PEOPLE_ACTIONS), frozenset(ROBOT_ACTIONS)


def check(action: object, agent: int, state: SimulationState) -> Command | Refusal:
    """Judge an action in the light of the state.

    Parameters
    ----------
    action
        Anything at all; good ones are mappings with ``type`` and the fields of that entry of `ACTIONS`.
    agent
        Index into ``state.names``.

    Returns
    -------
    Command or Refusal
        What to do, or why not.
    """
    people = len(state.people)
    is_robot = agent >= people
    command = parse(action, robot=is_robot)
    if isinstance(command, Refusal):
        return command
    kind = form_of(command.kind, robot=is_robot)
    refusal = (
        _refuse_actor(kind, is_robot=is_robot)
        or (None if is_robot else _refuse_situation(kind, agent, state) or _refuse_at_door(kind, agent, state))
        or _refuse_range(kind, command)
        or kind.check(command.values, agent - people if is_robot else agent, state)
    )
    return refusal or command


def parse(action: object, *, robot: bool = False) -> Command | Refusal:
    """Judge the form of an action of a person, or a robot, alone: its type, its fields and their types."""
    if not isinstance(action, Mapping):
        sentence = f"an action is a dict with a 'type', not {type(action).__name__}"
        return Refusal(ReasonCode.NOT_AN_ACTION, sentence)
    kind = action.get("type")
    if not isinstance(kind, str) or kind not in ACTIONS:
        sentence = f"unknown action type {short(kind)}; types are {', '.join(ACTIONS)}"
        return Refusal(ReasonCode.UNKNOWN_TYPE, sentence)
    expected = form_of(kind, robot=robot).fields
    odd = [short(name) for name in action if name != "type" and name not in expected]
    if odd:
        known = ", ".join(expected) or "none"
        return Refusal(ReasonCode.UNKNOWN_FIELD, f"{kind}: unknown field {odd[0]}; its fields are: {known}")
    values: dict[str, Any] = {}
    for name, field in expected.items():
        if name not in action or (action[name] is None and not field.required):
            if field.required:
                return Refusal(ReasonCode.MISSING_FIELD, f"{kind}: field {name!r} is missing")
            continue
        value = field.read(action[name])
        if value is None:
            sentence = f"{kind}: {name} has to be {FORMS[field.kind]}, not {short(action[name])}"
            return Refusal(ReasonCode.BAD_VALUE, sentence)
        values[name] = value
    return Command(kind, values)


def _refuse_actor(kind: ActionType, *, is_robot: bool) -> Refusal | None:
    """Refuse what robots alone, or people alone, can do."""
    if is_robot and kind.name not in _OF_ROBOTS:
        sentence = f"{kind.name}: robots take {' and '.join(sorted(ROBOT_ACTIONS))}"
        return Refusal(ReasonCode.FOR_PEOPLE_ONLY, sentence)
    if not is_robot and kind.name not in _OF_PEOPLE:
        sentence = f"{kind.name} is for robots; avatars move with move_forward, turn_left and turn_right"
        return Refusal(ReasonCode.FOR_ROBOTS_ONLY, sentence)
    return None


class _Bar(NamedTuple):
    """A situation that rules actions out, its code, and what to say."""

    situation: Situation
    code: ReasonCode
    sentence: str


_ASLEEP = _Bar(Situation.ASLEEP, ReasonCode.ASLEEP, "asleep; wake first")
_SEATED = _Bar(Situation.SEATED, ReasonCode.SEATED, "seated; stand first")
_IN_BUS = _Bar(Situation.IN_BUS, ReasonCode.IN_BUS, "in a bus; exit_bus first")
_ON_BIKE = _Bar(Situation.ON_BIKE, ReasonCode.ON_BIKE, "on a bicycle; exit_bike first")


# By number: every action of everybody is looked up here.
_BUS = int(Vehicle.BUS)
_POSTURE_BARS = {int(Posture.LYING): _ASLEEP, int(Posture.SITTING): _SEATED}
# What can be done on the way through the door of a house; the last two ask for what is going on.
_AT_DOORS = frozenset({"wait", "communicate", "enter", "exit"})
_VEHICLE_BARS = {int(Vehicle.BUS): _IN_BUS, int(Vehicle.BIKE): _ON_BIKE}


def _refuse_situation(kind: ActionType, i: int, state: SimulationState) -> Refusal | None:
    """Refuse what can't be done asleep, seated, in a bus or on a bicycle."""
    riding, held = state.people.vehicle.item(i), state.people.posture.item(i)
    # In a bus the place decides whether one sits.
    posture = None if riding == _BUS else _POSTURE_BARS.get(held)
    vehicle = _VEHICLE_BARS.get(riding)
    for bar in (posture, vehicle):
        if bar is not None and bar.situation not in kind.when:
            return Refusal(bar.code, f"{kind.name}: {bar.sentence}")
    return None


def _refuse_at_door(kind: ActionType, i: int, state: SimulationState) -> Refusal | None:
    """Refuse what nobody does on the way through the door of a house."""
    p = state.people
    if kind.name in _AT_DOORS or p.door.item(i) < 0:
        return None
    return Refusal(ReasonCode.MOVING, f"{kind.name}: on the way through a door; wait until you are through")


def _refuse_range(kind: ActionType, command: Command) -> Refusal | None:
    """Refuse numbers out of their field's bounds."""
    for name, value in command.values.items():
        field = kind.fields[name]
        if not field.in_range(value):
            sentence = f"{command.kind}: {name} {value:g} is out of range; {field.range}"
            return Refusal(ReasonCode.OUT_OF_RANGE, sentence)
    return None
