"""Residents in the making: what is known of somebody before their day is written, and the character they are given."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from vico.community.catalogue import Hobby, Job, basic_values, hobbies, trait_words
from vico.community.childhood import GROWN_UP, School
from vico.community.model import Personality
from vico.rules import walk_speed


@dataclass(frozen=True)
class Lessons:
    """A child's school: of which kind, at which place (None: at home), from when until when, minutes of the day."""

    school: School | None
    place: str | None
    start: int
    end: int


@dataclass(frozen=True)
class Duty:
    """Something that somebody has promised to do at a place, minutes of the day."""

    start: int
    end: int
    activity: str
    place: str


@dataclass
class ResidentDraft:
    """A resident in the making.

    Attributes
    ----------
    status
        worker, freelancer, student, retired, guest or pupil.
    household
        Index of their household.
    job
        Their trade, for those who work at a place.
    occupation
        Title, as it is written.
    subject
        What a student studies; what a retired person, a freelancer or a guest is known for.
    shift
        Working hours of the day, or those at school, minutes; None for those who have none.
    lessons
        A pupil's school; None on a day without.
    duties
        What they do for the children of their household, in the order of the day.
    out_until, home_by
        Until when they go out alone, and when they are back from meetings, minutes of the day.
    first_shift
        Whether they work the first part of a long day rather than the last.
    days_off
        Days of the week on which they don't work though their place is open, 0 Monday .. 6 Sunday.
    """

    id: str
    gender: str
    age: int
    status: str
    household: int
    first: str = ""
    last: str = ""
    personality: Personality | None = None
    values: list[str] = field(default_factory=list)
    hobbies: list[Hobby] = field(default_factory=list)
    early: float = 0.5
    job: Job | None = None
    occupation: str = ""
    subject: str = ""
    home: str = ""
    workplace: str | None = None
    shift: tuple[int, int] | None = None
    lessons: Lessons | None = None
    duties: list[Duty] = field(default_factory=list)
    out_until: int = 24 * 60
    home_by: int = 24 * 60
    first_shift: bool = True
    days_off: frozenset[int] = frozenset()

    @property
    def child(self) -> bool:
        """Whether they are not grown up."""
        return self.age < GROWN_UP

    @property
    def day_off(self) -> bool:
        """Whether they neither work nor learn on the day though on others they do."""
        return self.shift is None and self.lessons is None and self.status in ("worker", "student", "pupil")

    @property
    def drive(self) -> float:
        """How much they work beyond what others do, about -0.6 to 0.7, 0 for most."""
        ambition = 0.3 * ("achievement" in self.values) + 0.1 * ("power" in self.values)
        return self.character.conscientiousness - 0.6 + ambition

    @property
    def character(self) -> Personality:
        """Their personality, once drawn."""
        assert self.personality is not None
        return self.personality

    @property
    def pace(self) -> float:
        """How fast they walk, m/s."""
        return walk_speed(self.age)

    @property
    def she(self) -> str:
        """She or he."""
        return "she" if self.gender == "female" else "he"

    @property
    def her(self) -> str:
        """Possessive: her or his."""
        return "her" if self.gender == "female" else "his"


@dataclass
class Household:
    """People who share a home, and what they are to each other."""

    kind: str
    members: list[ResidentDraft]
    home: str = ""

    @property
    def adults(self) -> list[ResidentDraft]:
        """Those who are grown up."""
        return [member for member in self.members if not member.child]

    @property
    def children(self) -> list[ResidentDraft]:
        """Those who are not, the oldest first."""
        return [member for member in self.members if member.child]


def draw_character(rng: np.random.Generator, draft: ResidentDraft, uses: dict[str, int]) -> None:
    """Give somebody a personality, values and hobbies that go together.

    Parameters
    ----------
    uses
        How often each hobby has been given so far; common ones become less likely. Updated.
    """
    five = np.clip(rng.normal(0.55, 0.19, 5), 0.05, 0.95)
    names = ("openness", "conscientiousness", "extraversion", "agreeableness", "neuroticism")
    diligent, nervous = names.index("conscientiousness"), names.index("neuroticism")
    # The conscientious are made by the years.
    older = 0.08 if draft.age > 45 else -0.10 if draft.child else 0.0
    five[diligent] = np.clip(five[diligent] + older, 0.05, 0.95)
    five[nervous] = max(0.05, five[nervous] - 0.1)
    scores = {name: round(float(v), 2) for name, v in zip(names, five, strict=True)}
    # The words for the two or three traits that stand out most from the middle.
    order = sorted(names, key=lambda name: (-abs(scores[name] - 0.5), name))
    traits = []
    for name in order[: 2 + int(rng.integers(2))]:
        words = trait_words()[name].high if scores[name] >= 0.5 else trait_words()[name].low
        traits.append(words[int(rng.integers(len(words)))])
    draft.personality = Personality(**scores, traits=traits)
    values, pastimes = basic_values(), hobbies()
    weights = np.array(
        [max(0.15, 0.5 + sum(w * (scores[t] - 0.5) * 3 for t, w in value.leans.items())) for value in values]
    )
    picks = rng.choice(len(values), 3, replace=False, p=weights / weights.sum())
    draft.values = [values[int(k)].name for k in picks]
    low_age, high_age = np.array([h.ages for h in pastimes]).T
    fits = np.array([h.weight for h in pastimes]) * (low_age <= draft.age) * (draft.age <= high_age)
    for k, hobby in enumerate(pastimes):
        fits[k] *= 0.35 ** uses.get(hobby.name, 0)
        fits[k] *= max(0.1, 1 + sum((scores[t] - 0.5) * 2.5 for t in hobby.traits))
        fits[k] *= 1.8 if set(hobby.values) & set(draft.values) else 1.0
    picks = rng.choice(len(pastimes), 2 + int(rng.random() < 0.55), replace=False, p=fits / fits.sum())
    draft.hobbies = [pastimes[int(k)] for k in picks]
    for hobby in draft.hobbies:
        uses[hobby.name] = uses.get(hobby.name, 0) + 1
    lark = 0.35 + 0.4 * (scores["conscientiousness"] - 0.5) + (draft.age - 40) / 90
    draft.early = float(np.clip(rng.normal(lark + 0.15, 0.18), 0, 1))
