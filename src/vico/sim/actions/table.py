"""The table of all actions. A new one is an entry in the tuple of its group's module; nothing else lists actions."""

from __future__ import annotations

from vico.sim.actions.doors import DOORS
from vico.sim.actions.fields import FORMS
from vico.sim.actions.hands import HANDS
from vico.sim.actions.model import ActionType, Actors
from vico.sim.actions.motion import MOTION
from vico.sim.actions.posture import POSTURE
from vico.sim.actions.robots import ARMS, ROBOTS
from vico.sim.actions.shops import SHOPS
from vico.sim.actions.speech import REPORTS, ROBOT_SPEECH, SPEECH
from vico.sim.actions.vehicles import VEHICLES

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
