"""What a main agent knows when it decides: public profiles, everybody's day, its own conversations, nothing else."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from vico.agents.influence.days import DayPlan
from vico.agents.influence.profiles import Profile

#: Messages of a conversation, and how near one talks, metres.
ROUNDS = 3
TALKING_DISTANCE = 2.0


@dataclass
class Talk:
    """A conversation of one's own with a member.

    Attributes
    ----------
    began
        Seconds of the day.
    said, answers
        What one said, and what the member answered, in order.
    """

    target: str
    began: float
    said: list[str] = field(default_factory=list)
    answers: list[str] = field(default_factory=list)

    def record(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {"target": self.target, "began": self.began, "said": list(self.said), "answers": list(self.answers)}


@dataclass(frozen=True)
class Situation:
    """What is known when a target is chosen or something is said.

    Attributes
    ----------
    time, ends
        Seconds of the day: now, and when the day of talk is over.
    here
        ENU metres.
    me, rival
        The main agents.
    members, days
        Profiles and days of the others, by id.
    talks
        One's own conversations, the present one last.
    not_before
        Until when one has given up on members, by id: they could not be found, or did not answer.
    seconds_to
        Tells how long it takes to walk to a place, by its id, seconds; infinite where there is no way.
    address
        By id, what tells a member from the others when spoken to.
    """

    time: float
    ends: float
    here: tuple[float, float]
    me: Profile
    rival: Profile
    members: Mapping[str, Profile]
    days: Mapping[str, DayPlan]
    talks: tuple[Talk, ...]
    not_before: Mapping[str, float]
    seconds_to: Callable[[str], float]
    address: Mapping[str, str]

    def talks_with(self, member: str) -> list[Talk]:
        """Return one's conversations with somebody in which something was said."""
        return [talk for talk in self.talks if talk.target == member and talk.said]

    def reachable(self) -> dict[str, float]:
        """Return which members can be met where they are now, and how long the way is, seconds.

        Those on the way somewhere, asleep, given up on, or about to leave before one is there are left out.
        """
        found = {}
        for member in self.members:
            stay = self.days[member].at(self.time)
            if not stay.can_talk or stay.place is None or self.not_before.get(member, 0.0) > self.time:
                continue
            seconds = self.seconds_to(stay.place)
            if self.time + seconds < min(stay.end, self.ends):
                found[member] = seconds
        return found


class TargetChoice(Protocol):
    """Decides whom to see next."""

    def choose(self, situation: Situation, chance: np.random.Generator) -> str | None:
        """Return a member's id; None to wait a little."""


class Dialogue(Protocol):
    """Decides what to say."""

    def say(self, situation: Situation, talk: Talk, chance: np.random.Generator) -> str | None:
        """Return the next message of a conversation; None to end it."""
