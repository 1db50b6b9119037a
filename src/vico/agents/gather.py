"""Asking agents what they want: one that crashes or is late never ends the run, it waits."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from typing import Any

from vico.agents.base import Agent
from vico.rules import ActionStatus

log = logging.getLogger(__name__)


@dataclass
class Gathered:
    """The actions of a step, and the faults there were: status and reason by agent."""

    actions: dict[str, Any] = field(default_factory=dict)
    agent_faults: dict[str, tuple[ActionStatus, str]] = field(default_factory=dict)


class Gatherer:
    """Asks every agent for its action.

    Parameters
    ----------
    agents
        By name.
    deadline
        Seconds all agents have together, for they are asked side by side, each in a thread of its own; one that is
        late waits this step, and is not asked again before it is done. None asks them one after the other in this
        thread and waits as long as it takes, which is what makes a run repeatable.
    """

    def __init__(self, agents: Mapping[str, Agent], *, deadline: float | None = None) -> None:
        self.agents = dict(agents)
        self.deadline = deadline
        self._pool: dict[str, ThreadPoolExecutor] = {}
        self._busy: dict[str, Future[Any]] = {}

    def gather(self, observations: Mapping[str, dict[str, Any]], infos: Mapping[str, dict[str, Any]]) -> Gathered:
        """Ask all agents; the order of names decides nothing but the order of asking."""
        gathered = Gathered()
        if self.deadline is None:
            for name, agent in self.agents.items():
                try:
                    gathered.actions[name] = agent.act(observations[name], infos[name])
                except Exception as error:
                    self._failed(name, error, gathered)
            return gathered
        asked: dict[str, Future[Any]] = {}
        for name, agent in self.agents.items():
            if name in self._busy and not self._busy[name].done():
                gathered.agent_faults[name] = (ActionStatus.LATE, "still busy with an earlier step")
                continue
            pool = self._pool.setdefault(name, ThreadPoolExecutor(1, thread_name_prefix=name))
            asked[name] = self._busy[name] = pool.submit(agent.act, observations[name], infos[name])
        # One deadline for all: they think side by side.
        wait(asked.values(), timeout=self.deadline)
        for name, future in asked.items():
            if not future.done():
                gathered.agent_faults[name] = (ActionStatus.LATE, f"no action within {self.deadline:g} s")
                continue
            try:
                gathered.actions[name] = future.result()
            except Exception as error:
                self._failed(name, error, gathered)
        return gathered

    def _failed(self, name: str, error: Exception, gathered: Gathered) -> None:
        log.warning("agent %s failed and waits: %s", name, error, exc_info=error)
        gathered.agent_faults[name] = (ActionStatus.FAILED, f"{type(error).__name__}: {error}")

    def close(self) -> None:
        """Let go of the threads; one that never returns is left behind."""
        for pool in self._pool.values():
            pool.shutdown(wait=False, cancel_futures=True)
