"""What an agent is, and the simplest one: random actions."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from vico.agents.state import AgentState, generator_state, restore_generator
from vico.seeds import rng
from vico.world.public import PublicMap

Action = dict[str, Any]
Observation = dict[str, Any]
Info = dict[str, Any]

# Of a plan that is told: so many goals, points and letters.
_MOST_GOALS, _LONGEST_PATH, _LONGEST_WHY = 20, 500, 400

AHEAD = slice(3, 5)  # of an observation's pose: east and north of the direction it looks along


@dataclass(frozen=True)
class Goal:
    """Something an agent means to do.

    Attributes
    ----------
    text
        In words.
    position
        Where, ENU metres; None where that is not known.
    place
        Name of the place; "" where it is none.
    """

    text: str
    position: tuple[float, float, float] | None = None
    place: str = ""


@dataclass(frozen=True)
class Plan:
    """What an agent means to do, as it may tell whoever looks at it.

    Attributes
    ----------
    goals
        What, the next first.
    path
        Points of the way that it is about to go, ENU metres.
    why
        A sentence.
    """

    goals: tuple[Goal, ...] = ()
    path: tuple[tuple[float, float, float], ...] = ()
    why: str = ""


class Agent(Protocol):
    """Whoever acts: residents, planners, learners, people at a keyboard, submissions.

    Turns observations into actions, once a step, and sees nothing else of the world but public maps. One that
    spends on language models has attributes ``tokens`` and ``cost`` (US dollars), what it spent so far; one that
    goes on where its model gives nothing of use says so in ``model_faults``, pairs of a step and a reason. One that
    wants to be understood has a method ``plan(second)``, which returns a `Plan`, or None while it has none; it is
    asked between two steps when somebody looks at the agent, and changes nothing. One that looks up only now and
    then says with an attribute ``wants_picture`` whether its next observation is to have pictures; where it comes
    with vico, none are made for it otherwise.
    """

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the action for the coming second; what it is given may be kept, and is left as it is."""

    def state(self) -> AgentState:
        """Return all it remembers, as nested dicts of JSON values and arrays.

        A fresh agent that is made in the same way and given this to `restore` acts on as this one does.
        """

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned, instead of what it remembers."""


class GroupAgent(Protocol):
    """Many agents that are quicker asked together; what each of them does is what it would do alone.

    An agent that belongs to one has it as its attribute ``group``. Members keep their own `Agent.state`.
    """

    def act_for(
        self, names: Sequence[str], observations: Mapping[str, Observation], infos: Mapping[str, Info]
    ) -> dict[str, Action | Exception]:
        """Return the members' actions for the coming second, by name; the error of one that failed in its place."""


def plan_record(agent: object, second: float) -> dict[str, Any] | None:
    """Return the plan that an agent publishes, as JSON has it; None if it publishes none, or fails to.

    Parameters
    ----------
    agent
        Asked for ``plan(second)``, if it has that.
    second
        Now, seconds since the first midnight.
    """
    ask = getattr(agent, "plan", None)
    if not callable(ask):
        return None
    try:
        plan = ask(second)
        if plan is None:
            return None
        goals = [
            {
                "text": goal.text,
                "place": goal.place,
                "position": None if goal.position is None else _triple(goal.position),
            }
            for goal in plan.goals[:_MOST_GOALS]
        ]
        path = [_triple(point) for point in plan.path[:_LONGEST_PATH]]
        return {"goals": goals, "path": path, "why": str(plan.why)[:_LONGEST_WHY]}
    except Exception as error:  # anybody's code: who cannot say what it plans still acts
        return {"goals": [], "path": [], "why": f"its plan cannot be told: {type(error).__name__}"}


def _triple(point: Sequence[float]) -> list[float]:
    x, y, z = (round(float(value), 2) for value in point)
    return [x, y, z]


def by_group(agents: Mapping[str, Agent]) -> tuple[list[tuple[GroupAgent, list[str]]], list[str]]:
    """Return the groups that agents belong to, each with its members' names, and the names of those without."""
    groups: dict[int, tuple[GroupAgent, list[str]]] = {}
    alone = []
    for name, agent in agents.items():
        group: GroupAgent | None = getattr(agent, "group", None)
        if group is None:
            alone.append(name)
        else:
            groups.setdefault(id(group), (group, []))[1].append(name)
    return list(groups.values()), alone


class RandomAgent:
    """Walks, turns, talks and goes through doors at random.

    Parameters
    ----------
    name
        Whose stream of chance it uses.
    seed
        Of the run.
    """

    def __init__(self, name: str, *, seed: int = 0) -> None:
        self._rng = rng(seed, "random agent", name)

    def act(self, observation: Observation, info: Info) -> Action:
        """Return some action that makes sense where the agent is; two out of three are steps ahead."""
        state = observation["state"]
        draw = float(self._rng.random())
        if state["action_status"] == "collision" or draw < 0.2:
            side = "turn_left" if self._rng.random() < 0.5 else "turn_right"
            return {"type": side, "degrees": float(self._rng.uniform(20.0, 160.0))}
        if draw < 0.25 and state["room"]:
            return {"type": "exit"}
        if draw < 0.25 and state["accessible_places"]:
            options = state["accessible_places"]
            return {"type": "enter", "place": options[int(self._rng.integers(len(options)))]}
        if draw < 0.27:
            return {"type": "communicate", "text": "Hello!"}
        if draw < 0.32:
            return {"type": ("drink", "eat", "wait")[int(self._rng.integers(3))]}
        return {"type": "move_forward", "distance": float(self._rng.uniform(0.2, 1.2))}

    def state(self) -> AgentState:
        """Return where its stream of chance stands."""
        return {"generator": generator_state(self._rng)}

    def restore(self, state: AgentState) -> None:
        """Go on where another one was."""
        restore_generator(self._rng, state["generator"])


def heading(observation: Observation) -> float:
    """Yaw an agent looks along, radians."""
    east, north = observation["pose"][AHEAD]
    return math.atan2(north, east)


def wrapped(angle: float) -> float:
    """Return the same direction within -pi..pi."""
    return float((angle + math.pi) % (2 * math.pi) - math.pi)


__all__ = [
    "Action",
    "Agent",
    "AgentState",
    "Goal",
    "GroupAgent",
    "Info",
    "Observation",
    "Plan",
    "PublicMap",
    "RandomAgent",
    "by_group",
    "heading",
    "plan_record",
    "wrapped",
]
