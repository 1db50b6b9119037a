"""Asking agents for their actions, each step: one that fails, is late or lies waits, and the run goes on.

Faults are counted by kind, and the first of each are listed. Agents with a deadline are asked in threads of their
own, for which nobody has to wait: not the run, and not the end of the program.
"""

from __future__ import annotations

import logging
import threading
from collections import Counter
from collections.abc import Callable, Collection, Mapping
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import asdict, dataclass, field
from functools import partial
from queue import SimpleQueue
from typing import Any, Literal, get_args

from vico.agents.base import Action, Agent, AgentState, split_groups
from vico.rules import ActionStatus, ReasonCode, code_name
from vico.runner.audit import UnfairError
from vico.runner.foreign import AgentProcessError, EndedError, IsolatedAgent
from vico.runner.messages import MalformedError, copy_info, copy_observation, plain_action
from vico.sim.actions import AgentFault

#: ``late``: no action in time. ``crashed``: it raised an error. ``ended``: its process ended. ``malformed``: what it
#: answered is no action, or names agents or places that nobody knows. ``state``: it could not say what it remembers.
#: ``unfair``: in a process of its own, it reached for what it is not given (see `vico.runner.audit`).
#: ``model``: it went on without the language model that it plans with.
FaultKind = Literal["late", "crashed", "ended", "malformed", "state", "unfair", "model"]
FAULT_KINDS: tuple[FaultKind, ...] = get_args(FaultKind)

#: So many faults are told one by one; more are only counted.
FAULTS_LISTED = 20
_LONGEST = 300

# Refusals that no situation excuses: the action has not the form that its space says.
_MALFORMED_CODES = frozenset(
    code_name(code)
    for code in (
        ReasonCode.NOT_AN_ACTION,
        ReasonCode.UNKNOWN_TYPE,
        ReasonCode.UNKNOWN_FIELD,
        ReasonCode.MISSING_FIELD,
        ReasonCode.BAD_VALUE,
        ReasonCode.WRONG_SIZE,
        ReasonCode.FOR_ROBOTS_ONLY,
        ReasonCode.FOR_PEOPLE_ONLY,
        ReasonCode.UNKNOWN_AGENT,
        ReasonCode.UNKNOWN_PLACE,
    )
)


@dataclass(frozen=True)
class Failure:
    """Why an agent has no action in a step."""

    kind: FaultKind
    reason: str

    @property
    def outcome(self) -> AgentFault:
        """Outcome for the simulation: a status and a reason."""
        return (ActionStatus.LATE if self.kind == "late" else ActionStatus.FAILED), self.reason


@dataclass(frozen=True)
class Fault:
    """Something an agent did wrong; it waited instead.

    Attributes
    ----------
    step
        In which step, from 1.
    kind
        One of `FAULT_KINDS`.
    """

    step: int
    agent: str
    kind: str
    reason: str


class FaultLog:
    """Counts faults by agent and kind, and keeps the first of each agent and kind, and the first of all."""

    def __init__(self) -> None:
        self.counts: Counter[tuple[str, str]] = Counter()
        self.first: list[Fault] = []

    @property
    def count(self) -> int:
        """Number of faults."""
        return self.counts.total()

    def add(self, step: int, agent: str, kind: FaultKind, reason: str) -> None:
        """Note a fault."""
        new = not self.counts[agent, kind]
        self.counts[agent, kind] += 1
        if new or len(self.first) < FAULTS_LISTED:
            text = reason if len(reason) <= _LONGEST else reason[: _LONGEST - 3] + "..."
            self.first.append(Fault(step, agent, kind, text))

    def by_kind(self) -> dict[str, int]:
        """Return how many there were of each kind there was."""
        found = {kind: sum(n for (_, k), n in self.counts.items() if k == kind) for kind in FAULT_KINDS}
        return {kind: number for kind, number in found.items() if number}

    def by_agent(self) -> dict[str, dict[str, int]]:
        """Return how many there were of each kind, by agent."""
        found: dict[str, dict[str, int]] = {}
        for (agent, kind), number in sorted(self.counts.items()):
            found.setdefault(agent, {})[kind] = number
        return found

    def record(self) -> dict[str, Any]:
        """Return what goes into ``run.json``, and into a checkpoint: counts, and the first ones."""
        return {"count": self.count, "by_agent": self.by_agent(), "first": [asdict(fault) for fault in self.first]}

    @classmethod
    def of(cls, record: Mapping[str, Any]) -> FaultLog:
        """Go on from what `record` returned."""
        log = cls()
        for agent, kinds in record["by_agent"].items():
            for kind, number in kinds.items():
                log.counts[agent, kind] = number
        log.first = [Fault(**fault) for fault in record["first"]]
        return log


def is_malformed(code: str) -> bool:
    """Whether a refusal (``action_code`` of an observation) says that the action had no form that could be right."""
    return code in _MALFORMED_CODES


_Task = tuple[Future[Any], Callable[..., Any], tuple[Any, ...]]


class AgentThread:
    """Does one task after the other in a daemon thread, which starts with the first.

    Unlike a pool of the standard library, it does not keep the program from ending while a task never returns.

    Parameters
    ----------
    name
        Of the agent, for debuggers.
    """

    def __init__(self, name: str) -> None:
        self._tasks: SimpleQueue[_Task | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._work, name=f"agent {name}", daemon=True)

    def submit(self, task: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Do a task after those before it; return what it will come to."""
        future: Future[Any] = Future()
        self._tasks.put((future, task, arguments))
        if not self._thread.ident:
            self._thread.start()
        return future

    def close(self) -> None:
        """Let the thread end after the task it is at."""
        self._tasks.put(None)

    def _work(self) -> None:
        while (wanted := self._tasks.get()) is not None:
            future, task, arguments = wanted
            try:
                future.set_result(task(*arguments))
            except BaseException as error:
                future.set_exception(error)


log = logging.getLogger(__name__)


@dataclass
class Gathered:
    """The actions of a step by agent, and why others have none."""

    actions: dict[str, Action] = field(default_factory=dict)
    failures: dict[str, Failure] = field(default_factory=dict)

    @property
    def agent_faults(self) -> dict[str, AgentFault]:
        """Faults of those who failed, for `vico.sim.loop.simulation.Simulation.step`."""
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
        self._groups, self._alone = split_groups({name: self.agents[name] for name in self.trusted})
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
                given = copy_observation(observations[name]), copy_info(infos[name])
                asked[name] = self._busy[name] = pool.submit(_ask_agent, self.agents[name], *given)
        self._ask_trusted(observations, infos, gathered)
        wait(asked.values(), timeout=self.deadline)
        for name in others:
            if name not in asked:
                if name not in gathered.failures:
                    given = copy_observation(observations[name]), copy_info(infos[name])
                    self._take(name, gathered, partial(_ask_agent, self.agents[name], *given))
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
                    self._note_failure(name, answer, gathered)
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
            self._note_failure(name, error, gathered)

    def _note_failure(self, name: str, error: BaseException, gathered: Gathered) -> None:
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


def _ask_agent(agent: Agent, observation: dict[str, Any], info: dict[str, Any]) -> Action:
    """Ask one agent; in its own thread, for looking into what it answers may take long as well."""
    return plain_action(agent.act(observation, info))
