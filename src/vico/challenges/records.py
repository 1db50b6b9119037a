"""Records of a challenge and of its episodes, and the registry of challenges, loaded by name when asked for."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, Protocol, cast

from vico.agents.model_access import model_from_environment
from vico.errors import InputError, line_of, sentence_of
from vico.runner.foreign import Terms
from vico.runner.gather import Fault

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
        How often agents did something wrong, by kind (see `vico.runner.gather`), and the first of it.
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


#: Name -> where its object is: ``module:OBJECT``.
CHALLENGES = {
    "assistant": "vico.challenges.assistant.challenge:ASSISTANT",
    "commute": "vico.challenges.commute.challenge:COMMUTE",
    "influence": "vico.challenges.influence:INFLUENCE",
    "robot": "vico.challenges.robot.challenge:ROBOT",
    "teaming": "vico.challenges.teaming.challenge:TEAMING",
}
#: The method, of any challenge, that asks a language model.
ASKS_A_MODEL = "llm"
_NEEDED = ("name", "categories", "methods", "metrics", "causes", "task", "play")


def load_challenge(name: str) -> Challenge:
    """Return a challenge by its name, or as ``my_module:MY_CHALLENGE``.

    Raises
    ------
    InputError
        If there is none of that name, it can't be imported, or it is no challenge.
    """
    module, _, attribute = CHALLENGES.get(name, name).partition(":")
    if not attribute:
        raise InputError(f"no challenge called {name!r}; there are {', '.join(CHALLENGES)}, or my_module:MY_CHALLENGE")
    try:
        found = getattr(importlib.import_module(module), attribute, None)
    except ModuleNotFoundError as error:
        if error.name is None or not (module == error.name or module.startswith(f"{error.name}.")):
            raise
        raise InputError(f"challenge {name}: there is no module {error.name}; this version does not have it") from None
    except Exception as error:
        raise InputError(f"challenge {name}: cannot be imported: {sentence_of(error)} at {line_of(error)}") from None
    if found is None:
        raise InputError(f"challenge {name}: {module} has no {attribute}; this version does not have it")
    lacking = [part for part in _NEEDED if not hasattr(found, part)]
    if lacking:
        raise InputError(f"challenge {name}: {module}:{attribute} has no {lacking[0]}; see vico.challenges.records")
    return cast(Challenge, found)


def check_methods(challenge: Challenge, methods: list[str]) -> None:
    """Make sure that every method is one of a challenge's, agents from elsewhere, or two of these joined by ``+``.

    Raises
    ------
    InputError
        If one is not; the message names those there are. And if one asks a language model, and none is named.
    """
    for method in methods:
        for part in parts_of(method):
            if part == ASKS_A_MODEL and part in challenge.methods:
                model_from_environment(method=part)  # before anything is drawn or played
            if part not in challenge.methods and ":" not in part:
                raise InputError(
                    f"{challenge.name}: no method called {part!r}; there are {', '.join(sorted(challenge.methods))}, "
                    "my_module:MyAgent, or two of these joined by +"
                )
    if len(set(methods)) < len(methods):
        raise InputError(f"{challenge.name}: a method is given twice; name each once")


def parts_of(method: str) -> list[str]:
    """Return the one or two methods that a method's name stands for."""
    return method.split("+")


def foreign_parts(challenge: Challenge, method: str) -> list[str]:
    """Return those of them that are agents from elsewhere."""
    return [part for part in parts_of(method) if part not in challenge.methods]
