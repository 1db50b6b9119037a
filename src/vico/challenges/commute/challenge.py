"""The commute challenge as every table sees it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from vico.agents.commute import METHODS
from vico.challenges.commute.causes import CAUSES
from vico.challenges.commute.generate import generate_commute
from vico.challenges.commute.model import CommuteTask
from vico.challenges.commute.play import play_day
from vico.challenges.commute.rules import HOURS
from vico.challenges.records import EpisodeRecord, Job, Metric, Progress
from vico.errors import InputError
from vico.world.folder import kept_world
from vico.world.world import World

CATEGORY = "commute"

_METRICS = (
    Metric("late_rate", "Late Rate", "%", "lower", 0.0, 100.0, about="commutes that were late or missed"),
    Metric("travel_time", "Travel Time", "min", "lower", 0.0, digits=2, about="minutes a day from leaving to arrival"),
    Metric("price", "Price", "a day", "lower", 0.0, digits=2, about="fares, rents, and fees for bicycles left about"),
    Metric("walk_distance", "Walk Distance", "km", "lower", 0.0, digits=2, about="kilometres a day on foot"),
)


class CommuteChallenge:
    """Be in time at every place of a day, with little travelling, money and walking.

    Settings of a job: ``hours`` from the first leaving to the end (`vico.challenges.commute.rules.HOURS` unless given).
    """

    name = "commute"
    categories: Sequence[str] = (CATEGORY,)
    methods: Sequence[str] = tuple(METHODS)

    def metrics(self, category: str) -> Sequence[Metric]:
        """Columns of the table: who is late least comes first."""
        return _METRICS

    def causes(self, category: str) -> Sequence[str]:
        """All causes that a failed commute may have."""
        return CAUSES

    def task(self, job: Job) -> Mapping[str, object]:
        """Return what is asked in an episode, as JSON.

        Raises
        ------
        vico.errors.InputError
            If the setting is not usable, or the world has too few places far enough apart.
        """
        return self._task(job, kept_world(job.world)).model_dump(mode="json")

    def play(self, job: Job, *, recording: Path | None = None, progress: Progress | None = None) -> EpisodeRecord:
        """Play one day and judge it; see `vico.challenges.records.Challenge.play`."""
        world = kept_world(job.world)
        return play_day(world, self._task(job, world), job, recording=recording, progress=progress)

    def _task(self, job: Job, world: World) -> CommuteTask:
        unknown = sorted(set(job.setting) - {"hours"})
        if unknown:
            raise InputError(f"commute: there is no setting {unknown[0]!r}; there is hours")
        hours = job.setting.get("hours", HOURS)
        if isinstance(hours, bool) or not isinstance(hours, (int, float)):
            raise InputError(f"commute: hours is {hours!r}; give a number")
        return generate_commute(world, seed=job.seed, hours=float(hours))


COMMUTE = CommuteChallenge()
