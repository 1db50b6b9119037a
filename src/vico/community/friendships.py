"""Who is friends with whom: people meet where their lives cross, and friends of friends become friends.

After Feld's foci (American Journal of Sociology 86, 1981: ties form where people share a group, a workplace, a class
or a house), homophily (McPherson, Smith-Lovin, Cook; Annual Review of Sociology 27, 2001) and triadic closure. How many
friends somebody has is skewed, and larger for the outgoing. ``docs/community.md`` holds it against real networks.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from vico.community.groups import Meeting
from vico.community.people import ResidentDraft

# Friends of an adult of middling extraversion where there are many to choose from, and the shape of their gamma
# distribution; among few, this share of all others.
_MANY, _SHAPE, _OF_FEW = 7.0, 2.6, 0.33
# Children have friends of their age, to within so many years; adults' friends thin out with the years between, scale.
_OF_ONE_AGE, _YEARS_BETWEEN = 2, 9.0
# Chance that a place in somebody's circle is filled by a friend of a friend.
_CLOSURE = 0.35
# How likely two are to be friends for what they share, of ties that may be of several kinds.
_WEIGHTS = {"group": 9.0, "work": 2.0, "class": 4.0, "school": 1.0, "house": 1.5, "street": 0.6, "town": 0.12}
_NOTES = {
    "work": "friends from work",
    "class": "in the same class",
    "school": "go to the same school",
    "house": "friends from the house",
    "street": "friends from the street",
    "town": "old friends",
}
_THROUGH_FRIENDS = "met through friends"


@dataclass(frozen=True)
class Friendship:
    """Two who are friends: their numbers, the lower one first, and how they met."""

    pair: tuple[int, int]
    note: str


@dataclass(frozen=True)
class Acquaintance:
    """Pairs of people, by numbers, whose lives cross at one kind of place: `work`, `class`, `school`, `house`, ..."""

    kind: str
    pairs: Iterable[tuple[int, int]]


def draw_friendships(
    rng: np.random.Generator,
    people: Sequence[ResidentDraft],
    groups: Sequence[Meeting],
    acquaintances: Sequence[Acquaintance],
) -> list[Friendship]:
    """Draw who is friends with whom.

    Parameters
    ----------
    people
        Everybody, in the order of their numbers.
    acquaintances
        Pairs whose lives cross besides the groups.

    Returns
    -------
    list of Friendship
        Each pair once, in order. Nobody is without a friend who is in a group with somebody of their kind.
    """
    draw = _Draw(rng, people)
    notes = {"group": "friends"} | _NOTES
    how: dict[tuple[int, int], str] = {}
    weights: dict[tuple[int, int], float] = {}

    def cross(kind: str, pairs: Iterable[tuple[int, int]], note: str) -> None:
        for i, j in pairs:
            pair = (i, j) if i < j else (j, i)
            if (fit := draw.fit(*pair)) > 0:
                how.setdefault(pair, note)
                weights[pair] = weights.get(pair, 0.0) + _WEIGHTS[kind] * fit

    number = {draft.id: k for k, draft in enumerate(people)}
    for group in groups:
        members = [number[member.id] for member in group.members]
        cross("group", combinations(members, 2), f"both in the {group.circle.name.lower()}")
    for known in acquaintances:
        cross(known.kind, known.pairs, notes[known.kind])
    for i in range(len(people)):
        others = rng.integers(len(people), size=6).tolist()
        cross("town", [(i, j) for j in others if j != i], notes["town"])
    draw.by_chance(weights)
    draw.friends_of_friends()
    draw.lonely(weights)
    return [Friendship(pair, how.get(pair, _THROUGH_FRIENDS)) for pair in sorted(draw.found)]


class _Draw:
    """Friendships in the making."""

    def __init__(self, rng: np.random.Generator, people: Sequence[ResidentDraft]) -> None:
        self._rng, self._people = rng, people
        self.found: set[tuple[int, int]] = set()
        self._friends: list[set[int]] = [set() for _ in people]
        few = _OF_FEW * (len(people) - 1)
        mean = _MANY * few / (_MANY + few) if few else 0.0
        liking = np.array([0.4 + 1.1 * draft.character.extraversion for draft in people])
        self._room = np.rint(rng.gamma(_SHAPE, mean * liking / _SHAPE)).astype(np.int64)

    def fit(self, i: int, j: int) -> float:
        """Return how well two go together; 0 for those who share a home, and for a child and a grown-up."""
        a, b = self._people[i], self._people[j]
        apart = abs(a.age - b.age)
        if a.household == b.household or a.child != b.child or (a.child and apart > _OF_ONE_AGE):
            return 0.0
        alike = len({h.name for h in a.hobbies} & {h.name for h in b.hobbies}) + len(set(a.values) & set(b.values))
        kind = 0.4 + 0.6 * (a.character.agreeableness + b.character.agreeableness)
        return float((1 + 0.4 * alike) * kind * math.exp(-apart / (_OF_ONE_AGE if a.child else _YEARS_BETWEEN)))

    def _tie(self, i: int, j: int) -> None:
        self.found.add((i, j) if i < j else (j, i))
        self._friends[i].add(j)
        self._friends[j].add(i)

    def _has_room(self, i: int, share: float = 1.0) -> bool:
        return len(self._friends[i]) < share * self._room[i]

    def by_chance(self, weights: Mapping[tuple[int, int], float]) -> None:
        """Tie pairs in an order drawn by their weights, as long as both have room."""
        pairs = sorted(weights)
        heat = self._rng.exponential(size=len(pairs)) / np.array([weights[pair] for pair in pairs])
        for k in np.argsort(heat, kind="stable").tolist():
            i, j = pairs[k]
            if self._has_room(i, 1 - _CLOSURE) and self._has_room(j, 1 - _CLOSURE):
                self._tie(i, j)

    def friends_of_friends(self) -> None:
        """Fill what room is left with friends of friends, the commoner the more friends two share."""
        for i in self._rng.permutation(len(self._people)).tolist():
            shared = Counter(k for j in sorted(self._friends[i]) for k in sorted(self._friends[j]))
            options = [k for k in shared if k != i and k not in self._friends[i] and self._has_room(k)]
            heat = {k: self._rng.exponential() / max(1e-9, shared[k] * self.fit(i, k)) for k in options}
            for k in sorted(options, key=lambda k: heat[k]):
                if not self._has_room(i):
                    break
                if self.fit(i, k) > 0:
                    self._tie(i, k)

    def lonely(self, weights: Mapping[tuple[int, int], float]) -> None:
        """Give those without a friend the one who suits best of all whom they meet."""
        best: dict[int, tuple[float, int]] = {}
        for (i, j), weight in sorted(weights.items()):
            for me, other in ((i, j), (j, i)):
                best[me] = max(best.get(me, (0.0, -1)), (weight, other))
        for i, friends in enumerate(self._friends):
            if not friends and i in best:
                self._tie(i, best[i][1])
