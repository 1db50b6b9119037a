"""The community assistant challenge, as `vico eval assistant` plays it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from vico.agents.assistant import METHODS
from vico.challenges.assistant.causes import CAUSES
from vico.challenges.assistant.episode import Reported, play_task, world_and_people
from vico.challenges.assistant.generate import generate_task, shortened
from vico.challenges.assistant.model import CATEGORIES, Task
from vico.challenges.assistant.theatre import PlayedByHand
from vico.challenges.assistant.thresholds import STEPS, SUBTASKS
from vico.challenges.records import EpisodeRecord, Job, Metric, Progress
from vico.errors import InputError

_SR = Metric("SR", "SR", "%", "higher", 0.0, 100.0, about="success rate: subtasks that were done")
_TS = Metric(
    "Ts", "Ts", "steps", "lower", 0.0, about="step at which the last subtask was done; the limit if not all were"
)
_HR = Metric(
    "HR", "HR", "%", "higher", 0.0, 100.0,
    about="human following rate: steps within 5 m of a person who walks home, of all steps of the limit",
)  # fmt: skip
_HR_ESCORT = Metric(
    "HR_escort", "HR from hand-over to arrival", "%", "higher", 0.0, 100.0,
    about="the same, of the steps from hand-over to arrival",
)  # fmt: skip


class AssistantChallenge:
    """Carry, Delivery and Search; see `vico.challenges.assistant.rules`."""

    name = "assistant"
    categories: Sequence[str] = CATEGORIES

    @property
    def methods(self) -> Sequence[str]:
        """Names of the planners that come with it."""
        return tuple(METHODS)

    def metrics(self, category: str) -> Sequence[Metric]:
        """Columns of a category's table."""
        return (_SR, _HR, _HR_ESCORT, _TS) if category == "carry" else (_SR, _TS)

    def causes(self, category: str) -> Sequence[str]:
        """All causes that a failed subtask may have."""
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
        return self._play(job, job.method, recording, progress)

    def _play(
        self, job: Job, method: str | PlayedByHand, recording: Path | None, progress: Progress | None
    ) -> EpisodeRecord:
        task = self._task(job)
        world, people = world_and_people(job.world, task.category)
        return play_task(
            world,
            people,
            task,
            method=method,
            setting=job.setting,
            terms=job.terms,
            recording=recording,
            hooks=[] if progress is None else [Reported(progress, task)],
        )

    def _task(self, job: Job) -> Task:
        category = next((one for one in CATEGORIES if one == job.category), None)
        if category is None:
            raise InputError(f"assistant: no category called {job.category!r}; there are {', '.join(CATEGORIES)}")
        world, people = world_and_people(job.world, category)
        assistants = int(job.setting.get("assistants", 1))
        if not 1 <= assistants <= 2:
            raise InputError(f"assistant: {assistants} assistants; the tasks are for 1 or 2")
        task = generate_task(
            world,
            people,
            category,
            seed=job.seed,
            assistants=assistants,
            advanced=bool(job.setting.get("advanced", False)),
            steps=int(job.setting.get("steps", STEPS)),
        )
        return shortened(task, subtasks=int(job.setting.get("subtasks", SUBTASKS)))


ASSISTANT = AssistantChallenge()
