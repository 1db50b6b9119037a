"""A main agent's knowledge when it decides: public profiles, everybody's day, its own conversations and visits.

It knows nothing else. A day says where somebody is to be found, and when they are on the way. A visit says what became
of going to somebody: talked, or why not.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, Literal, Protocol

import numpy as np

from vico.agents.day_plan import ScheduleItem
from vico.clock import DAY, seconds_of_day
from vico.english import split_name

#: The big five, in the order of `Profile.five`.
BIG_FIVE = ("openness", "conscientiousness", "extraversion", "agreeableness", "neuroticism")


@dataclass(frozen=True)
class Tie:
    """Somebody one knows: the other's id, what ties the two, and how strongly, 0..1."""

    other: str
    kind: str
    strength: float


@dataclass(frozen=True)
class Profile:
    """What is known of a resident.

    Attributes
    ----------
    id
        Name of the agent.
    values
        What matters most to them, the first most.
    five
        The big five, 0..1, in the order of `FIVE`.
    groups
        Names of the groups they belong to.
    ties
        Whom they know.
    """

    id: str
    name: str
    age: int
    occupation: str
    values: tuple[str, ...]
    five: tuple[float, float, float, float, float]
    traits: tuple[str, ...]
    hobbies: tuple[str, ...]
    groups: tuple[str, ...]
    ties: tuple[Tie, ...]
    lifestyle: str = ""
    biography: str = ""

    @property
    def first_name(self) -> str:
        """What one calls them."""
        return split_name(self.name)[1]

    def trait(self, name: str) -> float:
        """Return one of the big five, 0..1."""
        return self.five[BIG_FIVE.index(name)]

    def tie_to(self, other: str) -> float:
        """Return how strongly they are tied to somebody, 0 for strangers."""
        return max((tie.strength for tie in self.ties if tie.other == other), default=0.0)


def forms_of_address(profiles: Sequence[Profile]) -> dict[str, str]:
    """Return by id what tells each person from the others when they are spoken to: the first name, or the whole one."""
    firsts = [profile.first_name.lower() for profile in profiles]
    return {
        profile.id: profile.first_name if firsts.count(profile.first_name.lower()) == 1 else profile.name
        for profile in profiles
    }


@dataclass(frozen=True)
class PlannedStay:
    """A stretch of a day: at a place, or on the way where `place` is None; seconds of the day."""

    start: float
    end: float
    place: str | None
    type: str
    activity: str

    @property
    def can_talk(self) -> bool:
        """Whether one can be spoken to: somewhere, and awake."""
        return self.place is not None and self.type != "sleep"


@dataclass(frozen=True)
class DayPlan:
    """All stays of a day, in order."""

    stays: tuple[PlannedStay, ...]

    def at(self, time: float) -> PlannedStay:
        """Return what somebody does at a time, seconds."""
        of_day = time % DAY
        return next((stay for stay in reversed(self.stays) if stay.start <= of_day), self.stays[0])

    def chances(self, now: float, until: float) -> Iterable[PlannedStay]:
        """Yield the stays between two times of the day in which one can be spoken to."""
        return (stay for stay in self.stays if stay.can_talk and stay.end > now and stay.start < until)


def day_plan_of(schedule: Iterable[ScheduleItem]) -> DayPlan:
    """Return a schedule as a plan; the last item lasts until midnight."""
    items = list(schedule)
    stays = []
    for item in items:
        end = DAY if item is items[-1] else seconds_of_day(item.end)
        place = None if str(item.type) == "commute" else item.place
        stays.append(PlannedStay(seconds_of_day(item.start), end, place, str(item.type), item.activity))
    return DayPlan(tuple(stays))


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


#: How a visit ends. All but ``talked`` say why no conversation came of it:
#: ``not reached``: there was no way, it took too long, or the place let nobody in;
#: ``not found``: the place was searched, or waited at, and they were not there;
#: ``on the way``: they said that they were on their way somewhere;
#: ``no answer``: they had walked off, or did not answer;
#: ``nothing to say``: the strategy had nothing to say to them;
#: ``day over``: the day of talk ended before.
Ending = Literal["talked", "not reached", "not found", "on the way", "no answer", "nothing to say", "day over"]
#: Those of a visit that was for nothing, in the order in which a visit goes.
FAILURES: tuple[Ending, ...] = ("not reached", "not found", "on the way", "no answer", "nothing to say", "day over")


@dataclass
class Visit:
    """Going to see somebody.

    Attributes
    ----------
    place
        Id of the place where they were to be met.
    began, ended
        Seconds of the day.
    ending
        What became of it; ``day over`` until something did.
    """

    target: str
    place: str
    began: float
    ended: float
    ending: Ending = "day over"

    def record(self) -> dict[str, Any]:
        """Return it as plain data."""
        return asdict(self)
