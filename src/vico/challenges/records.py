"""What every challenge leaves of an episode, and how its episodes are described and played: one form for all tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, Protocol

from vico.runner.faults import Fault
from vico.runner.foreign import Terms

#: What decides an episode besides method, world and seed: ``assistants``, ``advanced``, ``steps``, ...
Setting = Mapping[str, bool | int | float | str]

#: Entries of a setting that say whose weights a method has: they tell methods apart, and no tasks.
OF_POLICIES = ("policy", "policy_sha256")

#: Called with a label, how far an episode is, and its limit.
Progress = Callable[[str, int, int], None]


def setting_of_task(setting: Setting) -> Setting:
    """Return what of a setting decides the task, and so which episodes can be compared."""
    return {name: value for name, value in setting.items() if name not in OF_POLICIES}


@dataclass(frozen=True)
class Metric:
    """A column of a challenge's table.

    Attributes
    ----------
    key
        Under which `EpisodeRecord.metrics` has it.
    label, unit
        As the table's head shows them.
    better
        Which way is good.
    low, high
        Bounds that no mean and no interval leaves.
    digits
        After the point.
    about
        The column in words, below the table.
    """

    key: str
    label: str
    unit: str
    better: Literal["higher", "lower"]
    low: float = float("-inf")
    high: float = float("inf")
    digits: int = 1
    about: str = field(kw_only=True)


@dataclass(frozen=True)
class Job:
    """One episode that is to be played; plain data, for another process too.

    Attributes
    ----------
    method
        A method of the challenge, two of them joined by ``+``, or ``my_module:MyAgent``.
    world
        Its folder.
    terms
        On which terms agents from elsewhere take part.
    world_url
        Where the world is copied from by whoever plays the job, if it lies in an object store: `world` need hold no
        more than its manifest then.
    """

    challenge: str
    category: str
    method: str
    setting: Setting
    world: Path
    seed: int
    terms: Terms = field(default_factory=Terms)
    world_url: str = ""


@dataclass(frozen=True)
class Part:
    """One of the things an episode asked for: a subtask, a commute, a member of a community.

    Attributes
    ----------
    success
        Whether it was done.
    cause
        Why not, one of the challenge's causes; empty where it was done.
    done_at
        Step at which it was done; None if it was not.
    """

    name: str
    success: bool
    cause: str = ""
    done_at: int | None = None


@dataclass(frozen=True)
class EpisodeRecord:
    """What one episode came to.

    Attributes
    ----------
    metrics
        By the keys of the challenge's `Metric`; what an episode has no value for is left out.
    parts
        What was asked for, one by one.
    steps, limit
        Steps that were played, and the most there could be.
    state_hash
        Of the last state: the same version, world, method and seed come to the same.
    tokens, cost
        Of language model calls, in tokens and US dollars.
    fault_counts, faults
        How often agents did something wrong, by kind (see `vico.runner.faults`), and the first of it.
    """

    challenge: str
    category: str
    method: str
    setting: Setting
    world: str
    seed: int
    metrics: Mapping[str, float]
    parts: list[Part]
    steps: int
    limit: int
    wall_seconds: float
    state_hash: str
    tokens: int = 0
    cost: float = 0.0
    fault_counts: dict[str, int] = field(default_factory=dict)
    faults: list[Fault] = field(default_factory=list)


class Challenge(Protocol):
    """What is asked and how it is judged; a module level object of each challenge's package."""

    @property
    def name(self) -> str:
        """As `vico eval` calls it."""

    @property
    def categories(self) -> Sequence[str]:
        """Kinds of tasks; one at least."""

    @property
    def methods(self) -> Sequence[str]:
        """Names of the methods that come with it."""

    def metrics(self, category: str) -> Sequence[Metric]:
        """Columns of a category's table, the one that ranks methods first."""

    def causes(self, category: str) -> Sequence[str]:
        """All causes that a failed part may have."""

    def task(self, job: Job) -> Mapping[str, object]:
        """Return what is asked in an episode, as JSON: the same for all methods.

        Raises
        ------
        vico.errors.InputError
            If the world does not hold what the task needs.
        """

    def play(self, job: Job, *, recording: Path | None = None, progress: Progress | None = None) -> EpisodeRecord:
        """Play one episode and judge it.

        Parameters
        ----------
        recording
            Folder to which a run is recorded that the viewer replays; None records nothing.
        """
