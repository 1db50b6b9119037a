"""Functions, Gymnasium policies and classes without a state, made into agents."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from vico.agents.base import Action, Agent, AgentState, Info, Observation
from vico.errors import InputError


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
