"""The table of all actions, how they are judged, and how those of a step are applied.

A new action is an entry in the tuple of its group's module; nothing else lists actions. Judging looks at form, actor,
situation, range, and the action's own rule; it never raises and changes nothing. Checked actions are performed, bad
ones refused with a code and a sentence.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from vico.rules import ActionStatus, ReasonCode, code_name
from vico.sim.actions.interaction import HANDS, REPORTS, ROBOT_SPEECH, SHOPS, SPEECH
from vico.sim.actions.model import FORMS, ActionType, Actors, Command, Refusal, Situation, short
from vico.sim.actions.movement import DOORS, MOTION, POSTURE, VEHICLES
from vico.sim.actions.robots import ARMS, ROBOTS
from vico.sim.bodies.state_arrays import REASON_LENGTH, Posture, Vehicle
from vico.sim.state.simulation_state import SimulationState

# What robots do otherwise than people do it.
_ROBOTS = (*ARMS, *ROBOT_SPEECH)
_ALL = (*MOTION, *HANDS, *DOORS, *VEHICLES, *SPEECH, *POSTURE, *REPORTS, *ROBOTS, *SHOPS)

#: Every action by name, in the order of their numbers in a learner's action.
ACTIONS: dict[str, ActionType] = {action.name: action for action in _ALL}
#: Names of the actions that people may do, and robots.
PEOPLE_ACTIONS = tuple(action.name for action in _ALL if Actors.PEOPLE in action.actors)
ROBOT_ACTIONS = tuple(action.name for action in (*_ALL, *_ROBOTS) if Actors.ROBOTS in action.actors)
_AS_ROBOT = {action.name: action for action in _ROBOTS}


def form_of(name: str, *, robot: bool) -> ActionType:
    """Return what an action is for a robot, or for a person."""
    return _AS_ROBOT.get(name, ACTIONS[name]) if robot else ACTIONS[name]


def actions_markdown() -> str:
    """Return the table of all actions for the documentation: name, fields with ranges, what it does."""
    lines = ["| type | fields | what it does |", "|---|---|---|"]
    for action in (*ACTIONS.values(), *_ROBOTS):
        fields = "; ".join(
            f"`{name}`{'' if field.required else ' (optional)'}: {field.range or FORMS[field.kind]}"
            for name, field in action.fields.items()
        )
        who = " (robots)" if action in _ROBOTS else ""
        lines.append(f"| `{action.name}`{who} | {fields} | {action.summary} |")
    return "\n".join(lines) + "\n"


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


#: How an agent failed to act (late, or with an error), and why.
AgentFault = tuple[ActionStatus, str]


def apply_actions(actions: Mapping[str, Any], faults: Mapping[str, AgentFault], state: SimulationState) -> int:
    """Do what agents ask for, in the order of their names' indices; return how many actions were refused.

    Parameters
    ----------
    actions
        One by agent's name; names nobody has are ignored.
    faults
        Agents that were late or failed: they do nothing, and it is noted.
    """
    refused = 0
    for agent, name in enumerate(state.names):
        if name in faults:
            status, reason = faults[name]
            late = status is ActionStatus.LATE
            state.set_outcome(agent, status, ReasonCode.AGENT_LATE if late else ReasonCode.AGENT_FAILED, reason)
            kind = "agent_late" if late else "agent_failed"
            state.events.add(kind, name, reason[:REASON_LENGTH], state.position_of(agent))
        elif (action := actions.get(name)) is not None and not _is_wait(action):
            verdict = check(action, agent, state)
            if isinstance(verdict, Command):
                perform(verdict, agent, state)
                continue
            refused += 1
            state.set_outcome(agent, ActionStatus.REFUSED, verdict.code, verdict.reason)
            where, code = state.position_of(agent), code_name(verdict.code)
            state.events.add("refused", name, verdict.reason, where, code=code)
    return refused


def _is_wait(action: object) -> bool:
    """Return whether an action is a plain wait, which anybody may do at any time, and which does nothing."""
    if type(action) is not dict or len(action) != 1:
        return False
    kind = action.get("type")
    return isinstance(kind, str) and kind == "wait"


def perform(command: Command, agent: int, state: SimulationState) -> None:
    """Do what `check` allowed. The state must be the one it was checked against."""
    people = len(state.people)
    robot = agent >= people
    form_of(command.kind, robot=robot).perform(command.values, agent - people if robot else agent, state)
