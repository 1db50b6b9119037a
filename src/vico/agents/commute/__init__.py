"""Agents for the commute challenge."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from vico.agents.base import Agent
from vico.agents.commute.commuter import Commuter, WalkPlanner
from vico.agents.commute.llm import LlmPlanner
from vico.agents.commute.mcts import MctsPlanner
from vico.agents.commute.ours import DayPlanner
from vico.errors import InputError
from vico.io.data_files import PACKAGED
from vico.world.public import PublicMap

_POLICIES = PACKAGED / "agents" / "commute"

Instructions = list[dict[str, Any]]


def _learned_agent_maker(name: str) -> Callable[[Instructions, PublicMap, int], Agent]:
    """Return the maker of the agent that acts by a packaged policy."""

    def make(instructions: Instructions, public_map: PublicMap, seed: int) -> Agent:
        from vico.agents.commute.learning import Network, PolicyCommuter  # compiled code, slow to import

        return PolicyCommuter(Network.read(_POLICIES / f"{name}.npz"), public_map, seed=seed)

    return make


METHODS: dict[str, Callable[[Instructions, PublicMap, int], Agent]] = {
    "rule": lambda _, public_map, seed: Commuter(WalkPlanner(public_map), public_map, seed=seed),
    "mcts": lambda _, public_map, seed: Commuter(MctsPlanner(public_map, seed=seed), public_map, seed=seed),
    "llm": lambda told, public_map, seed: Commuter(LlmPlanner(told, public_map), public_map, seed=seed),
    "ppo": _learned_agent_maker("ppo"),
    "a2c": _learned_agent_maker("a2c"),
    "ours": lambda told, public_map, seed: Commuter(DayPlanner(told, public_map), public_map, seed=seed),
}


def make_planner(method: str, instructions: Instructions, public_map: PublicMap, *, seed: int) -> Agent:
    """Make an agent by the name of its method.

    Parameters
    ----------
    instructions
        What the task tells the agent (`CommuteTask.instructions`).

    Raises
    ------
    InputError
        If there is no such method.
    """
    if method not in METHODS:
        raise InputError(f"no method called {method!r}; there are {', '.join(METHODS)}")
    return METHODS[method](instructions, public_map, seed)
