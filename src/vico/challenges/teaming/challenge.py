"""The teaming challenge, as `vico eval teaming` plays it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from vico.agents.teaming import METHODS
from vico.challenges.records import EpisodeRecord, Job, Metric, Progress
from vico.challenges.teaming.episode import play_teaming_task, world_and_people
from vico.challenges.teaming.generate import generate_teaming_task
from vico.challenges.teaming.judge import CAUSES
from vico.challenges.teaming.model import CATEGORIES, Category, TeamingTask
from vico.challenges.teaming.thresholds import PERIOD, PERIODS, STEPS
from vico.errors import InputError

_SR = Metric("SR", "SR", "%", "higher", 0.0, 100.0)
_TS = Metric("Ts", "Ts", "s", "lower", 0.0)
_TOGETHER = Metric("together", "Together on the way", "%", "higher", 0.0, 100.0)
_SEEN = Metric("seen", "Thing first in view", "s", "lower", 0.0)


class TeamingChallenge:
    """A humanoid, a quadruped and a drone at work with a person or another robot; see `vico.challenges.teaming`.

    Settings of a job: ``steps``, seconds at most; ``period``, seconds between two actions of a robot.
    """

    name = "teaming"
    categories: Sequence[str] = CATEGORIES
    methods: Sequence[str] = METHODS

    def metrics(self, category: str) -> Sequence[Metric]:
        """Columns of a category's table; Ts counts failures as the limit."""
        return (_SR, _TS, _SEEN if category == "spot" else _TOGETHER)

    def causes(self, category: str) -> Sequence[str]:
        """All causes that a failure may have."""
        return CAUSES[_category(category)]

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
        world, people = world_and_people(job.world)
        return play_teaming_task(
            world,
            people,
            task,
            method=job.method,
            setting=job.setting,
            terms=job.terms,
            recording=recording,
            progress=progress,
        )

    def _task(self, job: Job) -> TeamingTask:
        category = _category(job.category)
        unknown = sorted(set(job.setting) - {"steps", "period"})
        if unknown:
            raise InputError(f"teaming: there is no setting {unknown[0]!r}; there are steps and period")
        period = float(job.setting.get("period", PERIOD))
        if not PERIODS[0] <= period <= PERIODS[1] or abs(period * 100 - round(period * 100)) > 1e-6:
            raise InputError(f"teaming: a period of {period:g} s; it has to be 0.02 to 1, a multiple of 0.01")
        world, people = world_and_people(job.world)
        return generate_teaming_task(world, people, category, seed=job.seed, steps=int(job.setting.get("steps", STEPS)))


def _category(name: str) -> Category:
    category = next((one for one in CATEGORIES if one == name), None)
    if category is None:
        raise InputError(f"teaming: no category called {name!r}; there are {', '.join(CATEGORIES)}")
    return category


TEAMING = TeamingChallenge()
