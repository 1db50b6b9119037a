"""The judge of an episode: which subtasks are done, since when, and how well people were followed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from vico.challenges.assistant.model import Subtask, Task
from vico.challenges.assistant.rules import (
    StateView,
    has_arrived,
    is_carried_home,
    is_delivered,
    is_in_view,
)
from vico.challenges.assistant.thresholds import FOLLOW_DISTANCE, thresholds
from vico.runner.loop import Hook, Step
from vico.world.world import World


@dataclass
class Escort:
    """How somebody was helped to carry things home.

    Attributes
    ----------
    handed_at, arrived_at
        Steps at which the last thing was handed over, and at which the person was home after that; None before.
    followed
        Steps between them at which an assistant was near.
    """

    handed_at: int | None = None
    arrived_at: int | None = None
    followed: int = 0


class Judge(Hook):
    """Keeps the verdicts of one episode.

    A subtask is judged once and for all when an assistant reports it (`task_complete`), or else at the episode's end.

    Parameters
    ----------
    assistants
        Their agents' names.
    """

    def __init__(self, task: Task, world: World, state: StateView, assistants: list[str]) -> None:
        self.task, self.world, self.state, self.assistants = task, world, state, assistants
        self.limits = thresholds(advanced=task.advanced)
        names = {thing.id: thing.name for thing in task.objects}
        #: Names of each subtask's things, as the simulation knows them.
        self.things = [[names[i] for i in subtask.objects] for subtask in task.subtasks]
        #: Verdicts; None where nobody reported.
        self.verdicts: list[bool | None] = [None] * len(task.subtasks)
        #: Since which step each is done; None while it is not.
        self.since: list[int | None] = [None] * len(task.subtasks)
        #: When each was reported.
        self.reported_at: list[int | None] = [None] * len(task.subtasks)
        self.escorts = [Escort() for _ in task.subtasks]

    def on_step(self, step: Step) -> None:
        """Look at the state after a step, and take the reports that were made in it."""
        self.watch(step.number)
        self.take_reports(step)

    def take_reports(self, step: Step) -> None:
        """Take the reports that were made in a step."""
        for name, action in step.actions.items():
            if action.get("type") != "task_complete" or name not in self.assistants:
                continue
            seen = step.result.observations.get(name)
            # Only what the simulation accepted counts as a report.
            if seen is not None and seen["state"]["action_status"] == "ok":
                self.report(int(action["index"]), name, seen, step.number)

    def watch(self, step: int) -> None:
        """Look at the state after a step."""
        for k, subtask in enumerate(self.task.subtasks):
            if self.task.category == "carry":
                self._escort(k, subtask, step)
        self.look(step)

    def look(self, step: int) -> None:
        """Look at what is done, between the steps that count for how people are followed."""
        for k, subtask in enumerate(self.task.subtasks):
            if self.verdicts[k] is None and self.task.category != "search":
                done = self._is_done(k, subtask)
                self.since[k] = (self.since[k] if self.since[k] is not None else step) if done else None

    def report(self, index: int, who: str, observation: Mapping[str, Any], step: int) -> None:
        """Take an assistant's word that a subtask is done."""
        if not 0 <= index < len(self.verdicts) or self.verdicts[index] is not None:
            return
        if self.task.category == "search":
            found = all(is_in_view(n, who, observation, self.state, self.limits) for n in self.things[index])
            self.since[index] = step if found else None
        self.verdicts[index] = self.since[index] is not None
        self.reported_at[index] = step

    @property
    def over(self) -> bool:
        """Whether everything was reported."""
        return None not in self.verdicts

    def final(self) -> list[bool]:
        """Verdicts, with what nobody reported judged as it stands."""
        return [since is not None if v is None else v for v, since in zip(self.verdicts, self.since, strict=True)]

    def following(self, steps: int) -> tuple[float, float]:
        """Return how well people were followed, percent.

        Returns
        -------
        tuple
            Share of all frames of the task in which a person who goes home is followed (the paper's), and the mean over
            subtasks of the share of frames between hand-over and arrival; who handed nothing over counts 0.
        """
        shares = []
        for escort in self.escorts:
            if escort.handed_at is None:
                shares.append(0.0)
                continue
            # Both ends count: whoever was near at the hand-over, too.
            frames = (steps if escort.arrived_at is None else escort.arrived_at) - escort.handed_at + 1
            shares.append(escort.followed / frames)
        return 100.0 * sum(e.followed for e in self.escorts) / max(steps, 1), 100.0 * float(np.mean(shares))

    def _is_done(self, k: int, subtask: Subtask) -> bool:
        assert subtask.destination is not None
        if self.task.category == "delivery":
            place = subtask.destination
            return all(is_delivered(n, place, self.state, self.world, self.limits) for n in self.things[k])
        if self.escorts[k].arrived_at is None:
            return False
        home = subtask.destination
        return all(is_carried_home(n, home, self.state, self.world, self.limits) for n in self.things[k])

    def _escort(self, k: int, subtask: Subtask, step: int) -> None:
        """Note when somebody has handed over everything, who is near on the way home, and when they are there."""
        escort, person = self.escorts[k], subtask.person.agent
        assert subtask.destination is not None
        if escort.handed_at is None:
            if any(self.state.object_holder(name) == person for name in self.things[k]):
                return
            escort.handed_at = step
        if escort.arrived_at is not None:
            return
        escort.followed += any(self._is_near(person, who) for who in self.assistants)
        if has_arrived(person, subtask.destination, self.state, self.world, self.limits):
            escort.arrived_at = step

    def _is_near(self, person: str, who: str) -> bool:
        apart = self.state.agent_position(person) - self.state.agent_position(who)
        return float(np.linalg.norm(apart)) <= FOLLOW_DISTANCE
