"""The judge of a robot episode: where the thing is, who went along with the person, and what happened."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.challenges.assistant.evaluate import entrance_of
from vico.challenges.robot.tasks import (
    AT_REST,
    DESTINATION_RADIUS,
    FOLLOW_DISTANCE,
    HOME_RADIUS,
    REACHED,
    RESTS_FOR,
    SEEN_DISTANCE,
    SEEN_PIXELS,
    RobotTask,
)
from vico.geometry import distances
from vico.runner.loop import Hook, Step
from vico.runner.truth import GroundTruth, RobotPopulation
from vico.world.world import World

#: Why a task fails, in the order in which a table lists them.
CAUSES = (
    "not found",  # the thing was never in view of a robot, or the person was never called
    "not reached",  # seen, but the arm never came near it
    "not grasped",  # near, but no jaw ever held it
    "dropped on the way",  # held, and now on the ground away from the destination, on no deck and in no jaw
    "not placed",  # in a jaw or on a deck to the end, although it was at the destination
    "fallen",  # a robot fell, and was not on its way again
    "person lost",  # the person went home, and no robot was near for half of the way
    "out of time",  # the episode ended while it was on the way
    "unusable action",  # a learned policy gave numbers that are none, which ended the episode
)
# A thing on a deck lies no lower than this above the ground, metres, and no farther than the second from its robot.
_ON_DECK, _OF_DECK = 0.15, 0.9
# Share of the way home on which the person is to be near a robot.
_TOGETHER = 0.5


@dataclass
class RobotEpisodeLog:
    """What has happened.

    Attributes
    ----------
    seen, reached, held
        Second at which the thing was first in view of a robot and near, within an arm's reach, in a jaw; None before.
    put_down, arrived
        With Carry: second at which the person had put it down, and was home after that.
    followed, walked
        Looks at the person on the way home, and those at which a robot was near.
    force
        Largest force on the weaker finger while a jaw held the thing, newtons.
    drops
        How often it left a jaw for anything but a deck or the destination.
    """

    seen: float | None = None
    reached: float | None = None
    held: float | None = None
    put_down: float | None = None
    arrived: float | None = None
    followed: int = 0
    walked: int = 0
    force: float = 0.0
    drops: int = 0


class RobotJudge(Hook):
    """Looks at the state after each step, once a second at the full second; the verdict is that of the last look.

    Parameters
    ----------
    seconds
        Returns now, seconds since the first midnight.
    """

    def __init__(
        self, task: RobotTask, world: World, truth: GroundTruth, robots: RobotPopulation, seconds: Callable[[], float]
    ) -> None:
        self.task, self.world, self.truth, self.robots, self._seconds = task, world, truth, robots, seconds
        self.story = RobotEpisodeLog()
        #: Second of the episode since which all is as it should be; None while it is not.
        self.done_at: float | None = None
        #: Cause of an end that came from outside, as by a policy that gave no usable action; "" for none.
        self.ended_by = ""
        self._start = seconds()
        self._looked = -1
        self._rests_since: float | None = None
        self._last = truth.object_position(task.thing.name)
        self._in_jaw = False

    def on_step(self, step: Step) -> None:
        """Look at the state."""
        second = self._seconds() - self._start
        if int(second) > self._looked:
            self._looked = int(second)
            self._see(step, second)
            self.look(second)

    def look(self, second: float) -> None:
        """Look at the thing, the robots and the person."""
        name, story = self.task.thing.name, self.story
        position = self.truth.object_position(name)
        entity = self.truth.object_entity(name)
        held = [k for k in range(len(self.robots.names)) if self.robots.in_hand(k) == entity]
        near = np.hypot(*(self.robots.bodies().position[:, :2] - position[:2]).T)
        if story.reached is None and float(near[0]) < REACHED and self.truth.object_holder(name) is None:
            story.reached = second
        if held:
            story.held = second if story.held is None else story.held
            felt = self.robots.observation(held[0]).get("contacts")
            story.force = max(story.force, 0.0 if felt is None else float(np.min(felt)))
        rests = float(np.linalg.norm(position - self._last)) < AT_REST and not held
        self._rests_since = (second if self._rests_since is None else self._rests_since) if rests else None
        self._last = position
        if self._in_jaw and not held and not self.on_deck(position) and not self._is_there(position):
            story.drops += 1
        self._in_jaw = bool(held)
        if self.task.category == "carry":
            self._go_along(second)
        at_rest = self._rests_since is not None and second - self._rests_since >= RESTS_FOR
        came = self.task.category == "deliver" or story.arrived is not None
        is_done = at_rest and came and self._is_there(position) and self.truth.object_holder(name) is None
        is_done = is_done and not self.on_deck(position)
        self.done_at = (self.done_at if self.done_at is not None else second) if is_done else None

    @property
    def over(self) -> bool:
        """Whether all is as it should be, for good."""
        return self.done_at is not None

    def cause(self) -> str:
        """Return why it failed, one of `CAUSES`; "" if it did not."""
        story, position = self.story, self.truth.object_position(self.task.thing.name)
        if self.done_at is not None:
            return ""
        if self.ended_by:
            return self.ended_by
        if self.task.category == "carry" and story.put_down is None:
            return "not found"
        if story.held is None and story.seen is None:
            return "not found"
        if any(bool(self.robots.observation(k)["fallen"][0]) for k in range(len(self.robots.names))):
            return "fallen"
        if story.held is None:
            return "not reached" if story.reached is None else "not grasped"
        if story.walked and story.arrived is not None and story.followed < _TOGETHER * story.walked:
            return "person lost"
        if self._in_jaw or self.on_deck(position):
            return "not placed" if self._is_there(position) else "out of time"
        return "dropped on the way"

    def together(self) -> float:
        """Return on which share of the person's way home a robot was near, percent."""
        return 100.0 * self.story.followed / self.story.walked if self.story.walked else 0.0

    def on_deck(self, position: NDArray[np.float64]) -> bool:
        """Return whether a thing lies on a robot."""
        bodies = self.robots.bodies().position
        away = distances(bodies[:, :2], position[:2])
        return bool(np.any((away < _OF_DECK) & (position[2] - bodies[:, 2] > _ON_DECK)))

    def _is_there(self, position: NDArray[np.float64]) -> bool:
        destination, room = self.task.destination, self.truth.object_room(self.task.thing.name)
        if room is not None:
            return self.world.room_by_id[room].place == destination.place is not None
        if self.task.category == "carry":
            return _ground_distance(position, entrance_of(destination, self.world)) <= HOME_RADIUS
        return _ground_distance(position, destination.centre) <= DESTINATION_RADIUS

    def _see(self, step: Step, second: float) -> None:
        """Note when a robot first has the thing in view and near."""
        if self.story.seen is not None:
            return
        name = self.task.thing.name
        entity, position = self.truth.object_entity(name), self.truth.object_position(name)
        for k, robot in enumerate(self.robots.names):
            picture = (step.result.observations.get(robot) or {}).get("segmentation")
            if picture is None or _ground_distance(self.robots.bodies().position[k], position) > SEEN_DISTANCE:
                continue
            if np.count_nonzero(np.asarray(picture) == entity) >= SEEN_PIXELS:
                self.story.seen = second
                return

    def _go_along(self, second: float) -> None:
        """Note when the person has put the thing down, who is near on the way home, and when they are there."""
        story, person = self.story, self.task.person.agent
        if story.put_down is None:
            if self.truth.object_holder(self.task.thing.name) == person:
                return
            story.put_down = second
        if story.arrived is not None:
            return
        at = self.truth.agent_position(person)
        home = self.task.destination
        inside = self.truth.agent_place(person)
        if inside == home.place or (
            inside is None and _ground_distance(at, entrance_of(home, self.world)) <= HOME_RADIUS
        ):
            story.arrived = second
            return
        near = np.linalg.norm(self.robots.bodies().position - at, axis=1) <= FOLLOW_DISTANCE
        story.walked += 1
        story.followed += bool(near.any())


def _ground_distance(a: Any, b: Any) -> float:
    return float(np.hypot(*(np.asarray(a)[:2] - np.asarray(b)[:2])))
