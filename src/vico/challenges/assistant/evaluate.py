"""Evaluating an episode: success rules of Carry, Delivery and Search, the judge, and causes of failure.

Each rule is one function. The judge says which subtasks are done, since when, and how well people were followed. What
happened to each subtask is noted as an episode goes, and one cause is named at its end.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.challenges.assistant.tasks import (
    BLOCKED_DISTANCE,
    BLOCKED_STEPS,
    FOLLOW_DISTANCE,
    SEEN_DISTANCE,
    SEEN_PIXELS,
    Region,
    Subtask,
    Task,
    Thresholds,
    thresholds,
)
from vico.english import split_name
from vico.geometry import distances
from vico.runner.loop import Hook, Step
from vico.runner.truth import GroundTruth
from vico.world.world import World


def is_delivered(name: str, region: Region, state: GroundTruth, world: World, limits: Thresholds) -> bool:
    """Whether a thing lies at its destination."""
    if state.object_holder(name) is not None:
        return False
    room = state.object_room(name)
    if region.place is not None:
        inside = room is not None and world.room_by_id[room].place == region.place
        return inside and _by_surface(state.object_position(name), region, world, limits)
    return room is None and _ground_distance(state.object_position(name), region.centre) <= limits.destination_radius


def is_carried_home(name: str, home: Region, state: GroundTruth, world: World, limits: Thresholds) -> bool:
    """Whether a thing lies in a home, or before its entrance."""
    if state.object_holder(name) is not None:
        return False
    room, position = state.object_room(name), state.object_position(name)
    if room is not None:
        return world.room_by_id[room].place == home.place and _by_surface(position, home, world, limits)
    return _ground_distance(position, entrance_of(home, world)) <= limits.home_radius


def has_arrived(person: str, home: Region, state: GroundTruth, world: World, limits: Thresholds) -> bool:
    """Whether somebody is at home, or before its entrance."""
    if state.agent_place(person) == home.place:
        return True
    outdoors = state.agent_room(person) is None
    return outdoors and _ground_distance(state.agent_position(person), entrance_of(home, world)) <= limits.home_radius


def is_in_view(name: str, who: str, observation: Mapping[str, Any], state: GroundTruth, limits: Thresholds) -> bool:
    """Whether so much of a thing is in an assistant's picture, from near enough."""
    # Through a door that stands open it counts as well.
    if _ground_distance(state.agent_position(who), state.object_position(name)) > limits.search_distance:
        return False
    pixels = np.count_nonzero(np.asarray(observation["segmentation"]) == state.object_entity(name))
    return bool(pixels >= limits.search_pixels)


def entrance_of(region: Region, world: World) -> NDArray[np.float64]:
    """Return where one goes into a place, ENU metres; its position where it has no door."""
    place = world.place_by_id[str(region.place)]
    doors = [door.position for door in world.entrances if door.id == place.entrance]
    return np.asarray(doors[0] if doors else place.position, np.float64)


def _by_surface(position: NDArray[np.float64], region: Region, world: World, limits: Thresholds) -> bool:
    """Whether a point is as near to the surface that a region names as is asked for, if one is."""
    if region.surface is None or limits.surface_distance is None:
        return True
    room = world.room_by_id[region.surface.room]
    surface = next(one for one in room.containers if one.entity == region.surface.entity)
    c, s = math.cos(surface.yaw), math.sin(surface.yaw)
    x, y = position[:2] - np.asarray(surface.centre[:2])
    beyond = np.abs([c * x + s * y, c * y - s * x]) - np.asarray(surface.size) / 2
    return float(np.hypot(*np.maximum(beyond, 0.0))) <= limits.surface_distance


def _ground_distance(a: NDArray[np.float64], b: Any) -> float:
    return float(np.hypot(*(np.asarray(a)[:2] - np.asarray(b)[:2])))


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

    def __init__(self, task: Task, world: World, state: GroundTruth, assistants: list[str]) -> None:
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


#: Every cause, in the order in which a table lists them.
CAUSES = (
    "never got there",  # no assistant came to the right region, although there was time
    "blocked",  # ... and they were stopped again and again, for a tenth of the episode or more
    "not seen",  # one came to the right region and left it, but the thing or the person was never in view
    "not recognised",  # in view and near, but nobody tried to pick it, spoke to them or reported it
    "refused pick",  # every attempt to take it was refused
    "dropped",  # taken, and put down neither in the source nor near the destination
    "wrong place",  # put down there, or reported, where that is not a success
    "person lost",  # the person was spoken to, or handed things over, and was then out of reach
    "out of time",  # the episode ended while it was on the way, or before its turn came
)
# Assistants who were stopped for this share of an episode were blocked.
_BLOCKED_SHARE = 0.1
# A region outdoors was come to within this distance of its edge, metres; somebody is met within the second.
_AT, _MET = 3.0, 10.0
# So near to a destination what was put down missed it, metres.
_MISSED_BY = 10.0
# There was time where all assistants did nothing but wait for so long before the end, and for what was in view so long
# before it, steps.
_IDLE, _TO_DO = 60, 60


@dataclass
class SubtaskLog:
    """What happened to one subtask.

    Attributes
    ----------
    came, there
        An assistant was in the right region at some time, and is in it now.
    met_at
        Step at which an assistant was first near the person and saw them; None before.
    spoke
        An assistant spoke near the person.
    seen
        Step at which each thing was first in view and near, by name.
    refused, held
        Things by name: picked without success, in an assistant's hand.
    """

    came: bool = False
    there: bool = False
    met_at: int | None = None
    spoke: bool = False
    seen: dict[str, int] = field(default_factory=dict)
    refused: set[str] = field(default_factory=set)
    held: set[str] = field(default_factory=set)


class CauseTracker(Hook):
    """Notes what happened to each subtask.

    Parameters
    ----------
    judge
        Of the same episode; it is told of each step first.
    """

    def __init__(self, judge: Judge) -> None:
        self.judge = judge
        self.stories = [SubtaskLog() for _ in judge.task.subtasks]
        self.steps = 0
        self.blocked_steps = 0
        self._idle = 0
        self._trails: dict[str, deque[tuple[NDArray[np.float64], bool]]] = {
            name: deque(maxlen=BLOCKED_STEPS) for name in judge.assistants
        }

    def on_step(self, step: Step) -> None:
        """Take in a step."""
        self.steps = step.number
        judge = self.judge
        waits = all(step.actions.get(who, {}).get("type", "wait") == "wait" for who in judge.assistants)
        self._idle = self._idle + 1 if waits else 0
        for k, story in enumerate(self.stories):
            if judge.verdicts[k] is None:
                source = judge.task.subtasks[k].true_source
                story.there = any(self._is_in(who, source) for who in judge.assistants)
                story.came = story.came or story.there
        for who in judge.assistants:
            observation = step.result.observations.get(who)
            if observation is None:
                continue
            action = step.actions.get(who, {})
            self._trail(who, action, observation)
            for k, subtask in enumerate(judge.task.subtasks):
                if judge.verdicts[k] is None:
                    self._note(self.stories[k], k, subtask, who, action, observation)

    def cause_of(self, k: int) -> str:
        """Return why a subtask failed; one of `CAUSES`."""
        category = self.judge.task.category
        return {"carry": self._of_carry, "delivery": self._of_delivery, "search": self._of_search}[category](k)

    def _of_delivery(self, k: int) -> str:
        story = self.stories[k]
        missing = [name for name in self.judge.things[k] if name not in story.held]
        if missing:
            return self._not_taken(k, missing)
        if any(self.judge.state.object_holder(name) for name in self.judge.things[k]):
            return "out of time" if self.judge.reported_at[k] is None else "wrong place"
        return self._let_go(k)

    def _of_search(self, k: int) -> str:
        story = self.stories[k]
        if self.judge.reported_at[k] is not None:
            return "wrong place"
        if story.seen:
            return self._left_alone(k, min(story.seen.values()))
        return self._not_there(k)

    def _of_carry(self, k: int) -> str:
        story, escort = self.stories[k], self.judge.escorts[k]
        if escort.handed_at is None:
            if story.held or story.spoke:  # held: one of two things
                return "person lost"
            return self._not_there(k) if story.met_at is None else self._left_alone(k, story.met_at)
        if escort.arrived_at is None:
            return "out of time" if self._ran_out(k) else "person lost"
        if any(self.judge.state.object_holder(name) for name in self.judge.things[k]):
            return "out of time" if self.judge.reported_at[k] is None else "wrong place"
        return self._let_go(k)

    def _not_taken(self, k: int, missing: list[str]) -> str:
        """Why things were never in anybody's hands."""
        story = self.stories[k]
        if any(name in story.refused for name in missing):
            return "refused pick"
        seen = [story.seen[name] for name in missing if name in story.seen]
        return self._left_alone(k, min(seen)) if seen else self._not_there(k)

    def _left_alone(self, k: int, since: int) -> str:
        """Why what was in view from some step on was not picked, spoken to or reported."""
        return "out of time" if self._ran_out(k) and self.steps - since < _TO_DO else "not recognised"

    def _not_there(self, k: int) -> str:
        """Why nobody came to the right region, or nobody saw anything in it."""
        story = self.stories[k]
        if story.came and not (story.there and self._ran_out(k)):
            return "not seen"
        if self.blocked_steps >= _BLOCKED_SHARE * self.steps * len(self.judge.assistants):
            return "blocked"
        return "out of time" if self._ran_out(k) else "never got there"

    def _let_go(self, k: int) -> str:
        """Whether things that lie where they should not are at least near the destination, or in the source."""
        judge, subtask = self.judge, self.judge.task.subtasks[k]
        ends = [region for region in (subtask.true_source, subtask.destination) if region is not None]
        near = (any(self._lies_near(name, region) for region in ends) for name in judge.things[k])
        return "wrong place" if all(near) else "dropped"

    def _lies_near(self, name: str, region: Region) -> bool:
        state = self.judge.state
        room = state.object_room(name)
        if room is not None:
            return self.judge.world.room_by_id[room].place == region.place
        apart = state.object_position(name)[:2] - np.asarray(region.centre[:2])
        return float(np.hypot(*apart)) <= region.radius + _MISSED_BY

    def _ran_out(self, k: int) -> bool:
        """Whether the episode ended before anybody said that the subtask was done, and all were busy to its end."""
        return self.judge.reported_at[k] is None and self._idle < _IDLE

    def _note(
        self,
        story: SubtaskLog,
        k: int,
        subtask: Subtask,
        who: str,
        action: Mapping[str, Any],
        observation: Mapping[str, Any],
    ) -> None:
        """Note what one assistant did about one subtask in a step."""
        state = self.judge.state
        refused = observation["state"]["action_status"] == "refused"
        for name in self.judge.things[k]:
            if state.object_holder(name) == who:
                story.held.add(name)
                story.refused.discard(name)
            elif name not in story.seen and self._sees(who, observation, state.object_entity(name), name):
                story.seen[name] = self.steps
            picks = action.get("type") == "pick" and action.get("object") == state.object_entity(name)
            if picks and refused and name not in story.held:
                story.refused.add(name)
        if self.judge.task.category == "carry":
            self._note_person(story, subtask.person.agent, who, action, observation)

    def _note_person(
        self, story: SubtaskLog, person: str, who: str, action: Mapping[str, Any], observation: Mapping[str, Any]
    ) -> None:
        state = self.judge.state
        near = state.agent_room(person) == state.agent_room(who)
        apart = state.agent_position(person)[:2] - state.agent_position(who)[:2]
        if not near or float(np.hypot(*apart)) > _MET:
            return
        # Others may be asked something in their hearing.
        first = split_name(next(s.person.name for s in self.judge.task.subtasks if s.person.agent == person))[1]
        if action.get("type") == "communicate" and first.casefold() in str(action.get("text", "")).casefold():
            story.spoke = True
        shown = np.asarray(observation["segmentation"]) == state.agent_entity(person)
        if story.met_at is None and np.count_nonzero(shown) >= SEEN_PIXELS:
            story.met_at = self.steps

    def _sees(self, who: str, observation: Mapping[str, Any], entity: int, name: str) -> bool:
        """Whether a thing is in view and near; the picture is looked at only where it can be."""
        state = self.judge.state
        if float(np.hypot(*(state.agent_position(who) - state.object_position(name))[:2])) > SEEN_DISTANCE:
            return False
        return bool(np.count_nonzero(np.asarray(observation["segmentation"]) == entity) >= SEEN_PIXELS)

    def _is_in(self, who: str, region: Region) -> bool:
        state = self.judge.state
        if region.place is not None:
            return state.agent_place(who) == region.place
        if state.agent_room(who) is not None:
            return False
        return float(np.hypot(*(state.agent_position(who)[:2] - np.asarray(region.centre[:2])))) <= region.radius + _AT

    def _trail(self, who: str, action: Mapping[str, Any], observation: Mapping[str, Any]) -> None:
        """Count the steps of an assistant that tries to move, and has not come from the spot for a while."""
        trail = self._trails[who]
        trail.append((np.array(observation["pose"][:2], np.float64), action.get("type") == "move_forward"))
        if len(trail) < BLOCKED_STEPS:
            return
        where = np.array([position for position, _ in trail])
        moved = float(distances(where, where[-1]).max())
        tries = sum(walks for _, walks in trail)
        self.blocked_steps += moved < BLOCKED_DISTANCE and tries > BLOCKED_STEPS // 3
