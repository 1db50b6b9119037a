"""The contract of an agent: its actions, its plan, its saved state, and adapters that make agents of other things.

- `Agent` and `GroupAgent` are the interfaces. `RandomAgent` is the simplest agent.
- What an agent remembers is plain data (`AgentState`): nested dicts of JSON values and NumPy arrays, no objects.
- `as_agent` makes agents of functions, Gymnasium policies and classes without a state.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from types import NoneType, UnionType
from typing import Any, ClassVar, NamedTuple, Protocol, get_args, get_origin, get_type_hints

import numpy as np

from vico.errors import InputError
from vico.seeds import rng
from vico.world.public import PublicMap

__all__ = [
    "Action",
    "Agent",
    "AgentState",
    "AgentUsage",
    "FieldState",
    "FunctionAgent",
    "Goal",
    "GroupAgent",
    "Info",
    "NoStateError",
    "Observation",
    "Plan",
    "PolicyAgent",
    "PublicMap",
    "RandomAgent",
    "as_agent",
    "generator_state",
    "heading",
    "model_faults_of",
    "plan_record",
    "restore_generator",
    "split_groups",
    "usage_of",
]
#: What an agent remembers: nested, keys are text, values are what JSON has, or NumPy arrays.
AgentState = dict[str, Any]


def generator_state(generator: np.random.Generator) -> AgentState:
    """Return where a random stream stands; `restore_generator` goes back there."""
    return dict(generator.bit_generator.state)


def restore_generator(generator: np.random.Generator, state: Mapping[str, Any]) -> None:
    """Put a random stream where another one of its kind stood.

    Raises
    ------
    InputError
        If the state is of another kind of stream.
    """
    try:
        generator.bit_generator.state = dict(state)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"agent: not a state of this random stream ({error}); restore it with the same vico") from None


class FieldState:
    """State that follows from fields: what a subclass annotates in its body is saved, and restored.

    Fields are saved by name, without leading underscores, in the order in which they are declared: numbers, text,
    enums, arrays, lists, sets, tuples and dicts of these, records, random streams, and objects that have a state. An
    infinite number is saved as None, which stands for the value in the class's body. What is not to be saved is
    annotated in ``__init__``.
    """

    def state(self) -> AgentState:
        """Return all it remembers."""
        return {name.lstrip("_"): _saved_value(getattr(self, name)) for name in _state_fields(type(self))}

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        for name, kind in _state_fields(type(self)).items():
            saved, own = state[name.lstrip("_")], getattr(self, name)
            if isinstance(own, np.random.Generator):
                restore_generator(own, saved)
            elif hasattr(own, "restore"):
                own.restore(saved)
            else:
                is_infinite = saved is None and kind is float
                setattr(self, name, getattr(type(self), name) if is_infinite else _restored_value(kind, saved))


_FIELDS: dict[type, dict[str, Any]] = {}  # by class, for hints are slow to look up


def _state_fields(of: type) -> dict[str, Any]:
    if of not in _FIELDS:
        _FIELDS[of] = {name: kind for name, kind in get_type_hints(of).items() if get_origin(kind) is not ClassVar}
    return _FIELDS[of]


def _saved_value(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.copy()
    if isinstance(value, np.random.Generator):
        return generator_state(value)
    if isinstance(value, Enum):
        return str(value)
    if isinstance(value, float):
        return None if math.isinf(value) else value
    if hasattr(value, "state"):
        return value.state()
    if isinstance(value, set):
        return sorted(value)
    if isinstance(value, list | tuple):
        return [_saved_value(one) for one in value]
    if isinstance(value, Mapping):
        return {str(name): _saved_value(one) for name, one in value.items()}
    return value


def _restored_value(kind: Any, saved: Any) -> Any:
    """Return a saved value as an annotation has it: JSON has no tuples, sets, records, or keys that are numbers."""
    origin, parts = get_origin(kind), get_args(kind)
    if origin is UnionType:
        return None if saved is None else _restored_value(next(one for one in parts if one is not NoneType), saved)
    if origin is np.ndarray:
        return np.array(saved, *get_args(parts[1]))
    if origin in (list, set):
        return origin(_restored_value(parts[0], one) for one in saved)
    if origin is tuple:
        return tuple(saved)
    if origin in (dict, Counter):
        return origin(
            {int(name) if parts[0] is int else name: _restored_value(parts[-1], one) for name, one in saved.items()}
        )
    if isinstance(kind, type) and isinstance(saved, Mapping) and kind is not Any:
        return kind(**saved)
    return kind(saved) if isinstance(kind, type) and issubclass(kind, Enum) else saved


Action = dict[str, Any]
Observation = dict[str, Any]
Info = dict[str, Any]

_MOST_GOALS = 20  # goals of a plan that are told, at most
_LONGEST_PATH = 500  # points of its path
_LONGEST_WHY = 400  # characters of its reason

HEADING_SLICE = slice(3, 5)  # of an observation's pose: east and north of the direction it looks along


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


def split_groups(agents: Mapping[str, Agent]) -> tuple[list[tuple[GroupAgent, list[str]]], list[str]]:
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


class RandomAgent(FieldState):
    """Walks, turns, talks and goes through doors at random.

    Parameters
    ----------
    name
        Whose stream of chance it uses.
    seed
        Of the run.
    """

    _generator: np.random.Generator

    def __init__(self, name: str, *, seed: int = 0) -> None:
        self._generator = rng(seed, "random agent", name)

    def act(self, observation: Observation, info: Info) -> Action:
        """Return some action that makes sense where the agent is; two out of three are steps ahead."""
        state = observation["state"]
        draw = float(self._generator.random())
        if state["action_status"] == "collision" or draw < 0.2:
            side = "turn_left" if self._generator.random() < 0.5 else "turn_right"
            return {"type": side, "degrees": float(self._generator.uniform(20.0, 160.0))}
        if draw < 0.25 and state["room"]:
            return {"type": "exit"}
        if draw < 0.25 and state["accessible_places"]:
            options = state["accessible_places"]
            return {"type": "enter", "place": options[int(self._generator.integers(len(options)))]}
        if draw < 0.27:
            return {"type": "communicate", "text": "Hello!"}
        if draw < 0.32:
            return {"type": ("drink", "eat", "wait")[int(self._generator.integers(3))]}
        return {"type": "move_forward", "distance": float(self._generator.uniform(0.2, 1.2))}


def heading(observation: Mapping[str, Any]) -> float:
    """Yaw an agent looks along, radians."""
    east, north = observation["pose"][HEADING_SLICE]
    return math.atan2(north, east)


class NoStateError(InputError):
    """An agent was asked for its state and has none to give."""


class AgentUsage(NamedTuple):
    """What an agent spent on language models so far: tokens, and US dollars."""

    tokens: int = 0
    cost: float = 0.0


def usage_of(agent: object) -> AgentUsage:
    """Return what an agent says it spent: its attributes ``tokens`` and ``cost``, 0 where it has none."""
    tokens, cost = getattr(agent, "tokens", 0), getattr(agent, "cost", 0.0)
    whole = tokens if isinstance(tokens, int) and tokens >= 0 else 0
    dollars = float(cost) if isinstance(cost, (int, float)) and np.isfinite(cost) and cost >= 0 else 0.0
    return AgentUsage(whole, dollars)


def model_faults_of(agent: object) -> list[tuple[int, str]]:
    """Return when an agent went on without the language model it plans with: steps, and why.

    It says so itself, in its attribute ``model_faults``; what is no such list counts as nothing.
    """
    said = getattr(agent, "model_faults", ())
    if not isinstance(said, list | tuple):
        return []
    pairs = [one for one in said if isinstance(one, list | tuple) and len(one) == 2]
    return [(step, why) for step, why in pairs if isinstance(step, int) and isinstance(why, str)]


def as_agent(thing: Any, *, name: str = "agent") -> Agent:
    """Make an agent of what acts.

    Parameters
    ----------
    thing
        An agent; something with ``act`` but without ``state`` and ``restore``; a policy with ``predict``; or a
        function ``(observation, info) -> action``.
    name
        What to call it in errors.

    Raises
    ------
    InputError
        If it is none of these.
    """
    if callable(getattr(thing, "act", None)):
        if callable(getattr(thing, "state", None)) and callable(getattr(thing, "restore", None)):
            agent: Agent = thing
            return agent
        return FunctionAgent(thing.act, of=thing)
    if callable(getattr(thing, "predict", None)):
        return PolicyAgent(thing)
    if callable(thing) and not isinstance(thing, type):
        return FunctionAgent(thing)
    raise InputError(
        f"{name}: a {type(thing).__name__} is no agent; give an object with act(observation, info), a policy with "
        "predict(observation), or a function (observation, info) -> action"
    )


class FunctionAgent:
    """Asks a function.

    Parameters
    ----------
    function
        ``(observation, info) -> action``.
    of
        What it belongs to; the function itself without. If that has an attribute ``stateless`` that is true, it
        promises to remember nothing, and the agent's state is empty.
    """

    def __init__(self, function: Callable[[Observation, Info], Action], *, of: object = None) -> None:
        self._function = function
        self._owner = function if of is None else of

    @property
    def tokens(self) -> int:
        """Tokens of language models it says it used."""
        return usage_of(self._owner).tokens

    @property
    def cost(self) -> float:
        """US dollars it says it spent."""
        return usage_of(self._owner).cost

    def act(self, observation: Observation, info: Info) -> Action:
        """Return what the function returns."""
        return self._function(observation, info)

    def state(self) -> AgentState:
        """Return nothing, if it is declared that there is nothing to remember.

        Raises
        ------
        NoStateError
            If that is not declared.
        """
        if getattr(self._owner, "stateless", False) is not True:
            owner = self._owner
            raise NoStateError(
                f"{getattr(owner, '__name__', type(owner).__name__)}: has no state() and restore(state), so a run "
                "with it cannot be resumed; add both, set its attribute stateless = True if it remembers nothing, or "
                "run without checkpoints"
            )
        return {}

    def restore(self, state: AgentState) -> None:
        """Remember nothing.

        Raises
        ------
        NoStateError
            If it is not declared that there is nothing to remember.
        """
        self.state()


class PolicyAgent:
    """Asks a policy as Gymnasium's learners have it.

    Parameters
    ----------
    policy
        Its ``predict(observation)`` returns an action, or an action and a recurrent state, which is then handed to
        ``predict(observation, state=...)`` the next time. Actions are those of the agent's action space, or, for
        robots, the control vector alone.
    """

    def __init__(self, policy: Any) -> None:
        self._policy = policy
        self._recurrent: Any = None

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the policy's action."""
        given = {} if self._recurrent is None else {"state": self._recurrent}
        answer = self._policy.predict(observation, **given)
        if isinstance(answer, tuple) and len(answer) == 2:
            answer, self._recurrent = answer
        if isinstance(answer, np.ndarray) and answer.ndim == 1:
            return {"type": "control", "vector": answer}
        return dict(answer) if isinstance(answer, Mapping) else answer

    def state(self) -> AgentState:
        """Return the recurrent state; the policy's weights are its own."""
        return {"recurrent": self._recurrent}

    def restore(self, state: AgentState) -> None:
        """Go on from a recurrent state."""
        self._recurrent = state["recurrent"]
