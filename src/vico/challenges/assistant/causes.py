"""Why subtasks fail: what happened to each is noted as an episode goes, and one cause is named at its end."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.challenges.assistant.judge import Judge
from vico.challenges.assistant.model import Region, Subtask
from vico.challenges.assistant.thresholds import (
    BLOCKED_DISTANCE,
    BLOCKED_STEPS,
    SEEN_DISTANCE,
    SEEN_PIXELS,
)
from vico.english import split_name
from vico.geometry import distances
from vico.runner.loop import Hook, Step

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
class Story:
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


class Chronicle(Hook):
    """Notes what happened to each subtask.

    Parameters
    ----------
    judge
        Of the same episode; it is told of each step first.
    """

    def __init__(self, judge: Judge) -> None:
        self.judge = judge
        self.stories = [Story() for _ in judge.task.subtasks]
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
        story: Story,
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
        self, story: Story, person: str, who: str, action: Mapping[str, Any], observation: Mapping[str, Any]
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
