"""What agents did wrong, by kind: counted, and the first of it told."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal, get_args

from vico.rules import ActionStatus, ReasonCode, code_name
from vico.sim.actions import AgentFault

#: ``late``: no action in time. ``crashed``: it raised an error. ``ended``: its process ended. ``malformed``: what it
#: answered is no action, or names agents or places that nobody knows. ``state``: it could not say what it remembers.
#: ``unfair``: in a process of its own, it reached for what it is not given (see `vico.runner.watch`).
#: ``model``: it went on without the language model that it plans with.
FaultKind = Literal["late", "crashed", "ended", "malformed", "state", "unfair", "model"]
FAULT_KINDS: tuple[FaultKind, ...] = get_args(FaultKind)

#: So many faults are told one by one; more are only counted.
FAULTS_TOLD = 20
_LONGEST = 300

# Refusals that no situation excuses: the action has not the form that its space says.
_MALFORMED = frozenset(
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
        """What the simulation is told of it."""
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
        """How many there were."""
        return self.counts.total()

    def add(self, step: int, agent: str, kind: FaultKind, reason: str) -> None:
        """Note a fault."""
        new = not self.counts[agent, kind]
        self.counts[agent, kind] += 1
        if new or len(self.first) < FAULTS_TOLD:
            self.first.append(Fault(step, agent, kind, _told(reason)))

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
    return code in _MALFORMED


def _told(reason: str) -> str:
    return reason if len(reason) <= _LONGEST else reason[: _LONGEST - 3] + "..."
