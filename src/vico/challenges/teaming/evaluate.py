"""The judge of a teaming episode: looks once a second, and has the category's rules say what that comes to."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from vico.challenges.teaming import accompany, guide, spot
from vico.challenges.teaming.category import JudgeSample, ground_distance, standing_robots
from vico.challenges.teaming.tasks import SEEN_DISTANCE, Category, TeamingTask
from vico.runner.loop import Hook, Step
from vico.runner.truth import GroundTruth, RobotPopulation
from vico.world.world import World

FALLEN = "fallen"


class CategoryRules(Protocol):
    """Follows one episode of a category, a look a second.

    Attributes
    ----------
    done_at
        Second at which it was done; None before.
    over
        Whether no more can come of it.
    """

    done_at: float | None
    over: bool

    def look(self, look: JudgeSample) -> None:
        """Take in how things stand."""

    def cause(self) -> str:
        """Return why it failed, one of the category's causes; "" if it did not."""


RULES: dict[Category, Callable[[TeamingTask, World], CategoryRules]] = {
    "accompany": accompany.Accompany,
    "guide": guide.Guide,
    "spot": spot.Spot,
}
CAUSES: dict[Category, tuple[str, ...]] = {
    "accompany": accompany.CAUSES,
    "guide": guide.CAUSES,
    "spot": spot.CAUSES,
}


class TeamingJudge(Hook):
    """Looks at the state after each step for falls, and once a second for all else.

    Parameters
    ----------
    seconds
        Returns now, seconds since the first midnight.

    Attributes
    ----------
    rules
        Those of the task's category.
    fallen
        Whether a robot fell: the episode has failed, then.
    """

    def __init__(
        self, task: TeamingTask, world: World, truth: GroundTruth, robots: RobotPopulation, seconds: Callable[[], float]
    ) -> None:
        self.task, self.truth, self.robots, self._seconds = task, truth, robots, seconds
        self.rules = RULES[task.category](task, world)
        self.fallen = False
        self._start, self._looked = seconds(), -1
        self._said: list[str] = []

    def on_step(self, step: Step) -> None:
        """Look at the state."""
        action = step.actions.get(self.task.person.agent, {})
        if action.get("type") == "communicate":
            self._said.append(str(action["text"]))
        self.fallen = self.fallen or any(
            bool(self.robots.observation(k)["fallen"][0]) for k in range(len(self.robots.names))
        )
        second = self._seconds() - self._start
        if int(second) > self._looked and not self.fallen:
            self._looked = int(second)
            self.rules.look(self._sample(step, second))
            self._said = []

    @property
    def over(self) -> bool:
        """Whether no more can come of it."""
        return self.fallen or self.rules.over

    @property
    def done_at(self) -> float | None:
        """Second at which it was done; None if it was not."""
        return None if self.fallen else self.rules.done_at

    def cause(self) -> str:
        """Return why it failed; "" if it did not."""
        return FALLEN if self.fallen else self.rules.cause()

    def _sample(self, step: Step, second: float) -> JudgeSample:
        task, positions = self.task, self.robots.bodies().position
        walks = task.walk is not None
        who = task.person.agent
        thing = None if task.thing is None else self.truth.object_position(task.thing.name)
        return JudgeSample(
            second=second,
            robots=positions,
            stands=standing_robots(self.robots),
            person=self.truth.agent_position(who) if walks else np.zeros(3),
            place=(self.truth.agent_place(who) or "") if walks else "",
            outdoors=walks and self.truth.agent_room(who) is None,
            said=tuple(self._said),
            thing=thing,
            shown=self._pixels_shown(step),
        )

    def _pixels_shown(self, step: Step) -> tuple[int, ...]:
        """Return how many pixels of the thing each robot sees that is near enough."""
        if self.task.thing is None:
            return ()
        name = self.task.thing.name
        entity, at = self.truth.object_entity(name), self.truth.object_position(name)
        found = []
        for robot, position in zip(self.robots.names, self.robots.bodies().position, strict=True):
            picture = (step.result.observations.get(robot) or {}).get("segmentation")
            near = picture is not None and ground_distance(position, at) <= SEEN_DISTANCE
            found.append(int(np.count_nonzero(np.asarray(picture) == entity)) if near else 0)
        return tuple(found)
