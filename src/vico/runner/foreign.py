"""Agents from elsewhere: submissions, planners under test, whatever is named as ``my_module:MyAgent``."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from vico.agents.base import Action, Agent, AgentState, Info, Observation
from vico.errors import InputError
from vico.runner.given import own_map
from vico.runner.isolated import MEMORY, IsolatedAgent
from vico.runner.loading import AgentSeat, load, make_agent
from vico.world.public import PublicMap
from vico.world.world import World

#: Seconds agents from elsewhere have for an action unless a run says otherwise.
DEADLINE = 60.0


@dataclass(frozen=True, kw_only=True)
class Terms:
    """On which terms agents from elsewhere take part.

    Attributes
    ----------
    deadline
        Seconds they have together each step; None as long as it takes.
    isolate
        Whether each is made and asked in a process of its own.
    workers
        How many are asked at a time where there is no deadline.
    memory
        MiB an isolated agent's process may have.
    checked
        Whether it is looked at if isolated agents leave what they are given as it is.
    """

    deadline: float | None = None
    isolate: bool = False
    workers: int = 1
    memory: int = MEMORY
    checked: bool = False

    def __post_init__(self) -> None:
        if self.deadline is not None and not 0.0 < self.deadline < 1e6:
            raise InputError(f"agents: a deadline of {self.deadline:g} s; give seconds above 0, or none")
        if self.workers < 1:
            raise InputError(f"agents: {self.workers} workers; it has to be 1 or more")
        if self.memory < 256:
            raise InputError(f"agents: {self.memory} MiB of memory; a process needs 256 or more")


class AbsentAgent:
    """In place of one that could not be made: it fails at every step, and says why.

    Parameters
    ----------
    reason
        Why it could not be made.
    """

    def __init__(self, reason: str) -> None:
        self.reason = reason

    def act(self, observation: Observation, info: Info) -> Action:
        """Fail."""
        raise RuntimeError(self.reason)

    def state(self) -> AgentState:
        """Return nothing."""
        return {}

    def restore(self, state: AgentState) -> None:
        """Remember nothing."""


def foreign_agents(spec: str, seats: Sequence[AgentSeat], world: World, terms: Terms) -> dict[str, Agent]:
    """Make an agent for every seat.

    Parameters
    ----------
    spec
        ``my_module:MyAgent``; see `vico.runner.loading.load`.
    world
        Whose public map they may ask for.

    Raises
    ------
    UnfairError
        If an isolated one reaches for what it is not given.
    InputError, MissingFileError
        If one can't be loaded or made, or isolated agents are asked for in a world that is in no folder.
    """
    if not terms.isolate:
        thing, public_map = load(spec), PublicMap.from_world(world)
        return {seat.name: make_agent(thing, seat, lambda: own_map(public_map)) for seat in seats}
    if world.path is None:
        raise InputError("agents: isolated ones read their map from the world's folder, and this world is in none")
    made: dict[str, Agent] = {}
    try:
        for seat in seats:
            made[seat.name] = IsolatedAgent(spec, seat, world=world.path, memory=terms.memory, checked=terms.checked)
    except BaseException:
        for agent in made.values():
            if isinstance(agent, IsolatedAgent):
                agent.close()
        raise
    return made
