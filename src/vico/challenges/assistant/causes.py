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
from vico.runner.loop import Hook, Step

#: Every cause, in the order in which a table lists them.
CAUSES = (
    "never got there",  # no assistant came to a region that was named, although there was time
    "blocked",  # ... and they were stopped again and again, for a tenth of the episode or more
    "not seen",  # one came to the right region, but the thing or the person was never in view
    "not recognised",  # in view and near, but nobody tried to pick it, spoke to them or reported it
    "refused pick",  # every attempt to take it was refused
    "dropped",  # taken, and let go where it is neither source nor destination
    "wrong place",  # put down, or reported, where that is not a success
    "person lost",  # the person was met, or handed things over, and was then out of reach
    "out of time",  # the episode ended while it was on the way, or before its turn came
)
# Assistants who were stopped for this share of an episode were blocked.
_BLOCKED_SHARE = 0.1
# A region outdoors was come to within this distance of its edge, metres; somebody is met within the second.
_AT, _MET = 3.0, 10.0


@dataclass
class Story:
    """What happened to one subtask.

    Attributes
    ----------
    came
        An assistant was in the right region.
    looked
        An assistant was in one of the regions that were named.
    seen, tried, refused, held, put
        Things by name: in view and near, picked with or without success, refused, in an assistant's hand, put down.
    met
        An assistant was near the person and saw them, or spoke with them.
    """

    came: bool = False
    looked: bool = False
    met: bool = False
    spoke: bool = False
    seen: set[str] = field(default_factory=set)
    tried: set[str] = field(default_factory=set)
    refused: set[str] = field(default_factory=set)
    held: set[str] = field(default_factory=set)
    put: set[str] = field(default_factory=set)


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
        self._trails: dict[str, deque[tuple[NDArray[np.float64], bool]]] = {
            name: deque(maxlen=BLOCKED_STEPS) for name in judge.assistants
        }

    def stepped(self, step: Step) -> None:
        """Take in a step."""
        self.steps = step.number
        judge = self.judge
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
            return "out of time"
        return self._let_go(k)

    def _of_search(self, k: int) -> str:
        story = self.stories[k]
        if self.judge.reported_at[k] is not None:
            return "wrong place"
        if story.seen:
            return "not recognised"
        return "not seen" if story.came and not self._ran_out(k) else self._not_there(k)

    def _of_carry(self, k: int) -> str:
        story, escort = self.stories[k], self.judge.escorts[k]
        if escort.handed_at is None:
            if story.held:
                return "person lost"  # with one of two things
            if story.spoke:
                return "person lost"
            if story.met:
                return "not recognised"
            return "not seen" if story.came and not self._ran_out(k) else self._not_there(k)
        if escort.arrived_at is None:
            return "out of time"
        if any(self.judge.state.object_holder(name) for name in self.judge.things[k]):
            near = self.judge.reported_at[k] is None and self._ran_out(k)
            return "out of time" if near else "person lost"
        return self._let_go(k)

    def _not_taken(self, k: int, missing: list[str]) -> str:
        """Why things were never in anybody's hands."""
        story = self.stories[k]
        if any(name in story.refused for name in missing):
            return "refused pick"
        if any(name in story.seen for name in missing):
            return "out of time" if self._ran_out(k) else "not recognised"
        return "not seen" if story.came and not self._ran_out(k) else self._not_there(k)

    def _not_there(self, k: int) -> str:
        """Why nobody came to the right region, or nobody had time to look through it."""
        if self.blocked_steps >= _BLOCKED_SHARE * self.steps * len(self.judge.assistants):
            return "blocked"
        if self._ran_out(k):
            return "out of time"
        return "not seen" if self.stories[k].came else "never got there"

    def _let_go(self, k: int) -> str:
        """Whether things that lie where they should not were put there, or lost."""
        return "wrong place" if self.stories[k].put >= self.stories[k].held else "dropped"

    def _ran_out(self, k: int) -> bool:
        """Whether the episode ended before anybody said that the subtask was done, or gave it up."""
        return self.judge.reported_at[k] is None and self.steps >= self.judge.task.steps

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
        story.came = story.came or self._is_in(who, subtask.true_source)
        story.looked = story.looked or any(self._is_in(who, region) for region in subtask.sources)
        refused = observation["state"]["action_status"] == "refused"
        for name in self.judge.things[k]:
            if state.object_holder(name) == who:
                story.held.add(name)
                story.refused.discard(name)
            elif name not in story.seen and self._sees(who, observation, state.object_entity(name), name):
                story.seen.add(name)
            if action.get("type") == "pick" and action.get("object") == state.object_entity(name):
                story.tried.add(name)
                if refused and name not in story.held:
                    story.refused.add(name)
            if action.get("type") == "put" and not refused and name in story.held and state.object_holder(name) is None:
                story.put.add(name)
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
        if action.get("type") == "communicate":
            story.spoke = True
        if not story.met:
            story.met = bool(
                np.count_nonzero(np.asarray(observation["segmentation"]) == state.agent_entity(person)) >= SEEN_PIXELS
            )

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
        moved = float(np.hypot(*(where - where[-1]).T).max())
        tries = sum(walks for _, walks in trail)
        self.blocked_steps += moved < BLOCKED_DISTANCE and tries > BLOCKED_STEPS // 3
