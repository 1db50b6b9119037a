"""The community robot challenge, as `vico eval robot` plays it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from vico.agents.robot import METHODS
from vico.challenges.records import OF_POLICIES, EpisodeRecord, Job, Metric, Progress
from vico.challenges.robot.episode import play_robot_task, world_and_people
from vico.challenges.robot.generate import generate_robot_task
from vico.challenges.robot.judge import CAUSES
from vico.challenges.robot.model import CATEGORIES, RobotTask
from vico.challenges.robot.policy_files import LEARNED
from vico.challenges.robot.thresholds import PERIOD, STEPS
from vico.errors import InputError

_SR = Metric("SR", "SR", "%", "higher", 0.0, 100.0)
_TS = Metric("Ts", "Ts", "s", "lower", 0.0)
_TOGETHER = Metric("together", "With the person on the way home", "%", "higher", 0.0, 100.0)
_FORCE = Metric("force", "Grip on the weaker finger", "N", "higher", 0.0)
_DROPS = Metric("drops", "Drops", "an episode", "lower", 0.0, digits=2)
# Robots act 10 to 100 times a second.
_PERIODS = (0.01, 0.1)


class RobotChallenge:
    """Carry and Deliver by a mobile manipulator and a carrier, with real contact; see `vico.challenges.robot.generate`.

    Settings of a job: ``steps``, seconds at most; ``period``, seconds between two actions of a robot;
    ``oracle_grasp``, whether hands never lose what they closed on; of methods that were learned ``policy``, where
    theirs lies, and its hash ``policy_sha256``.
    """

    name = "robot"
    categories: Sequence[str] = CATEGORIES
    methods: Sequence[str] = (*METHODS, *LEARNED)

    def metrics(self, category: str) -> Sequence[Metric]:
        """Columns of a category's table; Ts counts failures as the limit."""
        return (_SR, _TS, _TOGETHER, _DROPS, _FORCE) if category == "carry" else (_SR, _TS, _DROPS, _FORCE)

    def causes(self, category: str) -> Sequence[str]:
        """All causes that a failure may have."""
        return CAUSES

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
        return play_robot_task(
            world,
            people,
            task,
            method=job.method,
            setting=job.setting,
            terms=job.terms,
            recording=recording,
            progress=progress,
        )

    def _task(self, job: Job) -> RobotTask:
        category = next((one for one in CATEGORIES if one == job.category), None)
        if category is None:
            raise InputError(f"robot: no category called {job.category!r}; there are {', '.join(CATEGORIES)}")
        unknown = sorted(set(job.setting) - {"steps", "period", "oracle_grasp", *OF_POLICIES})
        if unknown:
            raise InputError(f"robot: there is no setting {unknown[0]!r}; there are steps, period and oracle_grasp")
        period = float(job.setting.get("period", PERIOD))
        if not _PERIODS[0] <= period <= _PERIODS[1] or abs(period * 100 - round(period * 100)) > 1e-6:
            raise InputError(f"robot: a period of {period:g} s; it has to be 0.01 to 0.1, a multiple of 0.01")
        world, people = world_and_people(job.world)
        return generate_robot_task(world, people, category, seed=job.seed, steps=int(job.setting.get("steps", STEPS)))


ROBOT = RobotChallenge()
