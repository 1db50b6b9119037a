"""What challenges of robots have in common: how a job becomes a task that is drawn, played and judged."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, Protocol, TypeVar

from vico.challenges.records import EpisodeRecord, Job, Metric, Progress, Setting
from vico.challenges.staging import world_and_people
from vico.challenges.task_files import PlacedTask
from vico.community.model import Community
from vico.errors import InputError
from vico.runner.foreign import Terms
from vico.world.world import World

Category = TypeVar("Category", bound=str)
Task = TypeVar("Task", bound=PlacedTask)
# As parameters and results of what a challenge brings along.
DrawnCategory = TypeVar("DrawnCategory", bound=str, contravariant=True)
DrawnTask = TypeVar("DrawnTask", bound=PlacedTask, covariant=True)
PlayedTask = TypeVar("PlayedTask", bound=PlacedTask, contravariant=True)


class Draws(Protocol[DrawnCategory, DrawnTask]):
    """Makes one episode's task."""

    def __call__(
        self, world: World, community: Community, category: DrawnCategory, *, seed: int, steps: int
    ) -> DrawnTask:
        """Return it."""


class Plays(Protocol[PlayedTask]):
    """Plays one task through and judges it."""

    def __call__(
        self,
        world: World,
        community: Community,
        task: PlayedTask,
        *,
        method: str,
        setting: Setting | None,
        terms: Terms | None,
        recording: Path | None,
        progress: Progress | None,
    ) -> EpisodeRecord:
        """Return what came of it."""


@dataclass(frozen=True)
class RobotsChallenge(Generic[Category, Task]):
    """A challenge of robots; see `vico.challenges.episodes` for how it is played.

    Attributes
    ----------
    residents
        People who live in its worlds.
    steps, period, periods
        Unless a setting says otherwise: seconds at most, and between two actions of a robot; bounds of that.
    settings
        Of a job, beside ``steps`` and ``period``.
    told_settings
        Those of them that are told to whoever gives another one.
    columns, failures
        By category.
    """

    name: str
    categories: Sequence[Category]
    methods: Sequence[str]
    residents: int
    steps: int
    period: float
    periods: tuple[float, float]
    columns: Mapping[Category, Sequence[Metric]]
    failures: Mapping[Category, Sequence[str]]
    draw_task: Draws[Category, Task]
    play_task: Plays[Task]
    settings: Collection[str] = ()
    told_settings: str = "steps and period"

    def metrics(self, category: str) -> Sequence[Metric]:
        """Columns of a category's table; Ts counts failures as the limit."""
        return self.columns[self._category(category)]

    def causes(self, category: str) -> Sequence[str]:
        """All causes that a failure may have."""
        return self.failures[self._category(category)]

    def task(self, job: Job) -> Mapping[str, object]:
        """Return the task of an episode, as JSON.

        Raises
        ------
        InputError
            If there is no such category or setting, or the world does not hold what the task needs.
        """
        return self._task(job).model_dump(mode="json")

    def play(self, job: Job, *, recording: Path | None = None, progress: Progress | None = None) -> EpisodeRecord:
        """Play one episode and judge it."""
        task = self._task(job)
        world, people = world_and_people(job.world, self.residents)
        return self.play_task(
            world,
            people,
            task,
            method=job.method,
            setting=job.setting,
            terms=job.terms,
            recording=recording,
            progress=progress,
        )

    def _task(self, job: Job) -> Task:
        category = self._category(job.category)
        unknown = sorted(set(job.setting) - {"steps", "period", *self.settings})
        if unknown:
            raise InputError(f"{self.name}: there is no setting {unknown[0]!r}; there are {self.told_settings}")
        period, (low, high) = float(job.setting.get("period", self.period)), self.periods
        if not low <= period <= high or abs(period * 100 - round(period * 100)) > 1e-6:
            raise InputError(
                f"{self.name}: a period of {period:g} s; it has to be {low:g} to {high:g}, a multiple of 0.01"
            )
        world, people = world_and_people(job.world, self.residents)
        return self.draw_task(world, people, category, seed=job.seed, steps=int(job.setting.get("steps", self.steps)))

    def _category(self, name: str) -> Category:
        category = next((one for one in self.categories if one == name), None)
        if category is None:
            raise InputError(f"{self.name}: no category called {name!r}; there are {', '.join(self.categories)}")
        return category
