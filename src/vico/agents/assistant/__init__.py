"""Planners for the community assistant tasks, over one set of skills."""

from __future__ import annotations

from typing import Any

from vico.agents.assistant.baselines import HeuristicPlanner, RandomPlanner
from vico.agents.assistant.errands import ChoicePlanner
from vico.agents.assistant.llm_planner import LlmPlanner
from vico.agents.assistant.ours import OurPlanner
from vico.agents.assistant.task_planning import MctsPlanner
from vico.agents.base import Agent
from vico.errors import InputError
from vico.world.public import PublicMap

METHODS: dict[str, type[HeuristicPlanner] | type[RandomPlanner] | type[ChoicePlanner]] = {
    "random": RandomPlanner,
    "heuristic": HeuristicPlanner,
    "mcts": MctsPlanner,
    "llm": LlmPlanner,
    "ours": OurPlanner,
}


def make_planner(
    method: str,
    instructions: list[dict[str, Any]],
    public_map: PublicMap,
    *,
    seed: int,
    number: int = 0,
    of: int = 1,
    distance: bool = True,
) -> Agent:
    """Make a planner by name.

    Parameters
    ----------
    instructions
        What the task tells the assistants (`Task.instructions`).
    number, of
        Which of how many assistants this one is.
    distance
        Whether the planner may reckon with distances.

    Raises
    ------
    InputError
        If there is no such method, or it asks a language model and the environment names none.
    """
    if method not in METHODS:
        raise InputError(f"no method called {method!r}; there are {', '.join(sorted(METHODS))}")
    return METHODS[method](instructions, public_map, seed=seed, number=number, of=of, distance=distance)
