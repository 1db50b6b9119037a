"""The record of an episode that was played out."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Protocol

from vico.agents.base import usage_of
from vico.challenges.records import EpisodeRecord, Part, Setting
from vico.clock import seconds_of_day
from vico.envs import Simulation
from vico.runner.gather import FaultLog


class PlayedTask(Protocol):
    """What a record tells of the task."""

    @property
    def category(self) -> str:
        """Its category."""

    @property
    def world(self) -> str:
        """Name of its world."""

    @property
    def seed(self) -> int:
        """What it was drawn with."""

    @property
    def start(self) -> str:
        """Time of day at which it began, ``HH:MM``."""

    @property
    def steps(self) -> int:
        """Seconds at most."""


def episode_record(
    task: PlayedTask,
    sim: Simulation,
    faults: FaultLog,
    agents: Iterable[Any],
    *,
    judged: tuple[dict[str, float], list[Part]],
    of: tuple[str, str, Setting],
    wall_seconds: float,
) -> EpisodeRecord:
    """Return the record of an episode.

    Parameters
    ----------
    agents
        Those whose use of a language model counts.
    judged
        The metrics, and what became of each part.
    of
        Name of the challenge, method and setting.
    """
    challenge, method, setting = of
    used = [usage_of(agent) for agent in agents]
    return EpisodeRecord(
        challenge=challenge,
        category=task.category,
        method=method,
        setting=setting,
        world=task.world,
        seed=task.seed,
        metrics=judged[0],
        parts=judged[1],
        steps=round(sim.state.second) - seconds_of_day(task.start),
        limit=task.steps,
        wall_seconds=wall_seconds,
        state_hash=sim.state_hash(),
        tokens=sum(one.tokens for one in used),
        cost=sum(one.cost for one in used),
        fault_counts=faults.by_kind(),
        faults=faults.first,
    )
