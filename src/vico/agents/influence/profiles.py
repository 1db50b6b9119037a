"""Public profiles: what everybody in a community may know of somebody."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from vico.english import split_name

#: The big five, in the order of `Profile.five`.
FIVE = ("openness", "conscientiousness", "extraversion", "agreeableness", "neuroticism")


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
        return self.five[FIVE.index(name)]

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
