"""Asking agents what they want, each step: one that fails, is late or lies waits, and the run goes on."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Collection, Mapping
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from vico.agents.base import Action, Agent, AgentState, by_group
from vico.runner.answers import MalformedError, plain_action
from vico.runner.faults import Failure, FaultKind
from vico.runner.given import own_info, own_observation
from vico.runner.isolated import AgentProcessError, EndedError, IsolatedAgent
from vico.runner.threads import AgentThread
from vico.runner.watch import UnfairError
from vico.sim.actions import AgentFault

log = logging.getLogger(__name__)

_LONGEST = 300


@dataclass
class Gathered:
    """The actions of a step by agent, and why others have none."""

    actions: dict[str, Action] = field(default_factory=dict)
    failures: dict[str, Failure] = field(default_factory=dict)

    @property
    def agent_faults(self) -> dict[str, AgentFault]:
        """What `vico.sim.loop.simulation.Simulation.step` is told of those who failed."""
        return {name: failure.outcome for name, failure in self.failures.items()}


class Gatherer:
    """Asks every agent for its action.

    Agents are given copies of what they observe, and what they answer is copied into plain data.

    Parameters
    ----------
    agents
        By name.
    trusted
        Those that come with vico and keep to its rules: they are asked one after the other in this thread, without a
        deadline, and given what they observe without a copy.
    deadline
        Seconds the others have together, from when the trusted ones have answered; they are asked side by side, each
        in a thread of its own. One that is late waits this step, and is not asked again before it is done. None waits
        as long as it takes, which is what makes a run repeatable.
    workers
        How many of the others are asked at a time where there is no deadline. Decides nothing but how long it takes.
    """

    def __init__(
        self,
        agents: Mapping[str, Agent],
        *,
        trusted: Collection[str] = (),
        deadline: float | None = None,
        workers: int = 1,
    ) -> None:
        self.agents = dict(agents)
        self.deadline = deadline
        self.trusted = [name for name in self.agents if name in trusted]
        self.others = [name for name in self.agents if name not in trusted]
        self._groups, self._alone = by_group({name: self.agents[name] for name in self.trusted})
        side_by_side = deadline is None and workers > 1 and len(self.others) > 1
        self._shared = ThreadPoolExecutor(workers, "agents") if side_by_side else None
        self._threads: dict[str, AgentThread] = {}
        self._busy: dict[str, Future[Action]] = {}

    def gather(self, observations: Mapping[str, dict[str, Any]], infos: Mapping[str, dict[str, Any]]) -> Gathered:
        """Ask the agents that have an observation; in which order decides nothing."""
        gathered = Gathered()
        others = [name for name in self.others if name in observations]
        asked: dict[str, Future[Action]] = {}
        for name in others:
            if self.is_busy(name):
                gathered.failures[name] = Failure("late", "still busy with an earlier step")
            elif (pool := self._pool_of(name)) is not None:
                given = own_observation(observations[name]), own_info(infos[name])
                asked[name] = self._busy[name] = pool.submit(_answer, self.agents[name], *given)
        self._ask_trusted(observations, infos, gathered)
        wait(asked.values(), timeout=self.deadline)
        for name in others:
            if name not in asked:
                if name not in gathered.failures:
                    given = own_observation(observations[name]), own_info(infos[name])
                    self._take(name, gathered, partial(_answer, self.agents[name], *given))
            elif asked[name].done():
                self._take(name, gathered, asked[name].result)
            else:
                gathered.failures[name] = Failure("late", f"no action within {self.deadline:g} s")
        return gathered

    def look_away(self) -> set[str]:
        """Return the names of the trusted agents that want no picture with their next observation."""
        return {name for name in self.trusted if not getattr(self.agents[name], "wants_picture", True)}

    def is_busy(self, name: str) -> bool:
        """Whether an agent still works on an earlier step."""
        return name in self._busy and not self._busy[name].done()

    def wait_for_busy(self) -> None:
        """Give agents that still work on an earlier step their deadline once more."""
        wait(self._busy.values(), timeout=self.deadline)

    def states(self) -> tuple[dict[str, AgentState], dict[str, Failure]]:
        """Return what every agent remembers, by name, and why there are some that did not say."""
        states: dict[str, AgentState] = {}
        failures: dict[str, Failure] = {}
        for name, agent in self.agents.items():
            if self.is_busy(name):
                failures[name] = Failure("late", "still busy with an earlier step")
                continue
            try:
                states[name] = agent.state()
            except BaseException as error:
                failure = failure_of(error)
                failures[name] = failure if failure.kind == "ended" else Failure("state", f"state(): {failure.reason}")
        return states, failures

    def restore(self, states: Mapping[str, AgentState]) -> None:
        """Let every agent remember what `states` returned."""
        for name, agent in self.agents.items():
            agent.restore(states[name])

    def close(self) -> None:
        """End isolated agents' processes and let go of the threads; one that never returns is left behind."""
        for agent in self.agents.values():
            if isinstance(agent, IsolatedAgent):
                agent.close()
        for thread in self._threads.values():
            thread.close()
        if self._shared is not None:
            self._shared.shutdown(wait=False, cancel_futures=True)

    def _ask_trusted(
        self, observations: Mapping[str, dict[str, Any]], infos: Mapping[str, dict[str, Any]], gathered: Gathered
    ) -> None:
        """Ask those that come with vico: first those that are asked in groups, then the others one by one."""
        for group, members in self._groups:
            names = [name for name in members if name in observations]
            try:
                answers = group.act_for(names, observations, infos)
            except Exception as error:
                answers = dict.fromkeys(names, error)
            for name in names:
                if isinstance(answer := answers[name], Exception):
                    self._failed(name, answer, gathered)
                else:
                    gathered.actions[name] = answer
        for name in self._alone:
            if name in observations:
                self._take(name, gathered, partial(self.agents[name].act, observations[name], infos[name]))

    def _pool_of(self, name: str) -> ThreadPoolExecutor | AgentThread | None:
        """Return the threads in which an agent is asked; None for this one."""
        if self.deadline is None:
            return self._shared
        if name not in self._threads:
            self._threads[name] = AgentThread(name)
        return self._threads[name]

    def _take(self, name: str, gathered: Gathered, answer: Callable[[], Action]) -> None:
        """Take an agent's answer, or note why there is none."""
        try:
            gathered.actions[name] = answer()
        except BaseException as error:
            self._failed(name, error, gathered)

    def _failed(self, name: str, error: BaseException, gathered: Gathered) -> None:
        gathered.failures[name] = failure_of(error)
        log.info("agent %s failed and waits", name, exc_info=error)


def failure_of(error: BaseException) -> Failure:
    """Return what an error of an agent's comes to.

    Raises
    ------
    KeyboardInterrupt
        If it is one that may be meant for the whole run.
    """
    if isinstance(error, KeyboardInterrupt) and threading.current_thread() is threading.main_thread():
        raise error
    kind: FaultKind = "crashed"
    if isinstance(error, MalformedError):
        kind = "malformed"
    elif isinstance(error, EndedError):
        kind = "ended"
    elif isinstance(error, UnfairError):
        kind = "unfair"
    try:
        said = str(error).strip().splitlines()[:1]
    except Exception:
        said = []  # an error that can't even be shown
    words = [line[:_LONGEST] for line in said]
    own = kind != "crashed" or isinstance(error, AgentProcessError)  # words that say it all
    return Failure(kind, ": ".join(words if own and words else [type(error).__name__, *words]))


def _answer(agent: Agent, observation: dict[str, Any], info: dict[str, Any]) -> Action:
    """Ask one agent; in its own thread, for looking into what it answers may take long as well."""
    return plain_action(agent.act(observation, info))
