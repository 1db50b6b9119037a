"""The social network: who is what to whom, read off homes, workplaces and groups; and what the network measures.

Friends are drawn after Feld's foci (American Journal of Sociology 86, 1981: ties form where people share a group, a
workplace, a class or a house), homophily (McPherson, Smith-Lovin, Cook; Annual Review of Sociology 27, 2001) and
triadic closure. How many friends somebody has is skewed, and larger for the outgoing. ``docs/community.md`` holds it
against real networks.

The measures (degrees, clustering, assortativity, path lengths) are those of Newman, "Networks" (2nd edition, 2018), so
that they can be held against published ones.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from vico.community.groups import Meeting
from vico.community.model import Community, Relation, RelationKind
from vico.community.people import Household, ResidentDraft
from vico.community.place_index import PlaceIndex
from vico.english import enumerate_words

_MANY = 7.0  # friends of an adult of middling extraversion where there are many to choose from
_SHAPE = 2.6  # of the gamma distribution of how many friends adults have
_OF_FEW = 0.33  # share of all others who are friends where there are few to choose from
_CHILD_AGE_GAP = 2  # years between children who are friends, at most
_YEARS_BETWEEN = 9.0  # years over which friendships of adults thin out by a factor of e
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
        if a.household == b.household or a.child != b.child or (a.child and apart > _CHILD_AGE_GAP):
            return 0.0
        alike = len({h.name for h in a.hobbies} & {h.name for h in b.hobbies}) + len(set(a.values) & set(b.values))
        kind = 0.4 + 0.6 * (a.character.agreeableness + b.character.agreeableness)
        return float((1 + 0.4 * alike) * kind * math.exp(-apart / (_CHILD_AGE_GAP if a.child else _YEARS_BETWEEN)))

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


#: People whose homes are this near know each other at least by sight, metres.
_NEXT_DOOR = 40.0

_RANK = list(RelationKind)
_FRIENDS_FROM = 3  # age in years from which on children have friends
_SAME_AGE_YEARS = 2  # years between pupils of one age, at most
_TEAM = 3  # of many at one workplace one knows so many to either side
_ACROSS = 0.15  # share of them that are rewired across
_TEACHERS = 2  # that a pupil knows
_KNOWN_IN_HOUSE = 5.0  # people one knows in a house
_KNOWN_NEXT_DOOR = 2.5  # people one knows next door
_NEXT_DOOR_KNOWN = 0.5  # the largest chance to know somebody next door


def draw_relations(
    rng: np.random.Generator,
    index: PlaceIndex,
    households: Sequence[Household],
    groups: Sequence[Meeting],
    year: int,
) -> list[Relation]:
    """Draw the ties between residents; of several between two, the closest one is kept, stronger for the others."""
    people = [s for h in households for s in h.members]
    network = _Network(people, year)
    for household in households:
        _tie_household(rng, network, household)
    for group in groups:
        note = f"both in the {group.circle.name.lower()}, a child and a grown-up"
        for a, b in combinations(group.members, 2):
            if a.child != b.child and a.household != b.household:
                network.tie(a, b, (RelationKind.NEIGHBOUR, note), rng.uniform(0.15, 0.5), rng.exponential(2))
    house, street = _neighbours(rng, index, people)
    colleagues = _colleagues(rng, people)
    same_class, same_school = _pupils(people)
    acquaintances = [
        Acquaintance("work", colleagues),
        Acquaintance("class", same_class),
        Acquaintance("school", same_school),
        Acquaintance("house", house),
        Acquaintance("street", street),
    ]
    _tie_friends(rng, network, people, groups, acquaintances)
    _tie_colleagues(rng, network, people, colleagues)
    for pairs, where, (low, high) in ((house, "same house", (0.2, 0.55)), (street, "next door", (0.15, 0.45))):
        for i, j in pairs:
            bond = RelationKind.NEIGHBOUR, where
            network.tie(people[i], people[j], bond, rng.uniform(low, high), rng.exponential(5))
    return network.relations()


class _Network:
    """Ties in the making, at most one between two people."""

    def __init__(self, people: Sequence[ResidentDraft], year: int) -> None:
        self._order = {s.id: k for k, s in enumerate(people)}
        self._year = year
        self._found: dict[tuple[str, str], Relation] = {}

    def tie(
        self, a: ResidentDraft, b: ResidentDraft, bond: tuple[RelationKind, str], strength: float, years: float
    ) -> None:
        """Tie two people, or strengthen the tie there is; `bond` is kind and note, `years` for how long."""
        kind, note = bond
        if self._order[a.id] > self._order[b.id]:
            a, b = b, a
        # Nobody knew anybody before they were grown up, families and playmates aside.
        youngest = min(a.age, b.age)
        from_age = 0 if kind is RelationKind.FAMILY and note != "partners" else _FRIENDS_FROM if youngest < 18 else 16
        oldest = youngest - from_age
        since = self._year - int(np.clip(round(years), 0, max(0, oldest)))
        known = self._found.get((a.id, b.id))
        new = Relation(between=(a.id, b.id), kind=kind, note=note, strength=round(min(1.0, strength), 2), since=since)
        self._found[a.id, b.id] = new if known is None else _closest(known, new)

    def relations(self) -> list[Relation]:
        """Return the ties, in the order of the people."""
        order = self._order
        return [self._found[key] for key in sorted(self._found, key=lambda k: (order[k[0]], order[k[1]]))]


def _closest(known: Relation, new: Relation) -> Relation:
    """Return the closer of two ties between the same people, a little stronger for the other."""
    first, second = sorted((known, new), key=lambda r: (_RANK.index(r.kind), -r.strength))
    return first.model_copy(
        update={
            "strength": round(min(1.0, first.strength + 0.1), 2),
            "since": min(first.since, second.since),
            "note": first.note if first.note == second.note else f"{first.note}; {second.note}",
        }
    )


def _tie_household(rng: np.random.Generator, network: _Network, household: Household) -> None:
    for a, b in combinations(household.members, 2):
        youngest = min(a.age, b.age)
        if household.kind == "couple":
            bond = RelationKind.FAMILY, "partners"
            network.tie(a, b, bond, rng.uniform(0.85, 1.0), rng.uniform(1, youngest - 17))
        elif household.kind == "parent":
            network.tie(a, b, (RelationKind.FAMILY, "parent and child"), rng.uniform(0.8, 1.0), youngest)
        elif household.kind == "family":
            if a.child and b.child:
                note, strength, years = "siblings", rng.uniform(0.6, 0.95), youngest
            elif a.child or b.child:
                note, strength, years = "parent and child", rng.uniform(0.85, 1.0), youngest
            else:
                note, strength, years = "partners", rng.uniform(0.8, 1.0), youngest - 17
            network.tie(a, b, (RelationKind.FAMILY, note), strength, years)
        elif household.kind == "siblings":
            network.tie(a, b, (RelationKind.FAMILY, "siblings"), rng.uniform(0.75, 0.95), youngest)
        else:
            network.tie(a, b, (RelationKind.FRIEND, "flatmates"), rng.uniform(0.6, 0.85), rng.uniform(0, 4))


def _tie_friends(
    rng: np.random.Generator,
    network: _Network,
    people: Sequence[ResidentDraft],
    groups: Sequence[Meeting],
    acquaintances: Sequence[Acquaintance],
) -> None:
    for friendship in draw_friendships(rng, people, groups, acquaintances):
        a, b = (people[k] for k in friendship.pair)
        alike = len({h.name for h in a.hobbies} & {h.name for h in b.hobbies}) + len(set(a.values) & set(b.values))
        strength = rng.uniform(0.3, 0.65) + 0.07 * alike - 0.003 * abs(a.age - b.age)
        strength += 0.2 * (a.character.agreeableness + b.character.agreeableness - 1)
        bond = RelationKind.FRIEND, friendship.note
        network.tie(a, b, bond, float(np.clip(strength, 0.15, 0.95)), rng.exponential(3.5))


def _circle(rng: np.random.Generator, members: Sequence[int]) -> list[tuple[int, int]]:
    """Return who of many knows whom: those near each other in an order, and a few across; all of few.

    A small world after Watts and Strogatz (Nature 393, 1998).
    """
    n = len(members)
    if n <= 2 * _TEAM + 1:
        return list(combinations(members, 2))
    pairs = set()
    for k in range(n):
        for step in range(1, _TEAM + 1):
            other = (k + step) % n if rng.random() > _ACROSS else int(rng.integers(n))
            if other != k:
                pairs.add((members[min(k, other)], members[max(k, other)]))
    return sorted(pairs)


def _colleagues(rng: np.random.Generator, people: Sequence[ResidentDraft]) -> list[tuple[int, int]]:
    """Return who knows whom at work and at university: teams, and those of one subject."""
    staff: dict[tuple[str, bool], list[int]] = {}
    for k, s in enumerate(people):
        if s.workplace is not None and not s.child:
            staff.setdefault((s.workplace, s.status == "student"), []).append(k)
    found: list[tuple[int, int]] = []
    for (_, _), members in sorted(staff.items()):
        order = [members[int(k)] for k in rng.permutation(len(members))]
        found += _circle(rng, sorted(order, key=lambda k: people[k].subject if people[k].status == "student" else ""))
    return found


def _pupils(people: Sequence[ResidentDraft]) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """Return who is in one class, and who else goes to one school at nearly the same age."""
    pupils: dict[str, list[int]] = {}
    for k, s in enumerate(people):
        if s.child and s.workplace is not None:
            pupils.setdefault(s.workplace, []).append(k)
    pairs = [pair for members in pupils.values() for pair in combinations(members, 2)]
    same = [(i, j) for i, j in pairs if people[i].age == people[j].age]
    near = [(i, j) for i, j in pairs if 0 < abs(people[i].age - people[j].age) <= _SAME_AGE_YEARS]
    return same, near


def _tie_colleagues(
    rng: np.random.Generator, network: _Network, people: Sequence[ResidentDraft], pairs: Sequence[tuple[int, int]]
) -> None:
    for i, j in pairs:
        a, b = people[i], people[j]
        note = "fellow students" if a.status == b.status == "student" else "work at the same place"
        network.tie(a, b, (RelationKind.COLLEAGUE, note), rng.uniform(0.3, 0.7), rng.exponential(3))
    teachers: dict[str, list[ResidentDraft]] = {}
    for s in people:
        if s.workplace is not None and s.status == "worker":
            teachers.setdefault(s.workplace, []).append(s)
    for s in people:
        if not s.child or s.workplace not in teachers:
            continue
        known = teachers[s.workplace]
        for k in rng.choice(len(known), min(_TEACHERS, len(known)), replace=False).tolist():
            note = "pupil and teacher" if "teach" in known[k].occupation else "from the same school"
            network.tie(s, known[k], (RelationKind.COLLEAGUE, note), rng.uniform(0.3, 0.7), rng.exponential(3))


def _neighbours(
    rng: np.random.Generator, index: PlaceIndex, people: Sequence[ResidentDraft]
) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
    """Return who knows whom in one house, and next door: of many in a large house one knows some."""
    positions = np.array([index.place_by_id[s.home].position[:2] for s in people])
    from scipy.spatial import cKDTree  # slow to import, and most who import this build no community

    near = np.sort(cKDTree(positions).query_pairs(_NEXT_DOOR, output_type="ndarray"), axis=1)
    homes: dict[str, list[int]] = {}
    for k, s in enumerate(people):
        homes.setdefault(index.place_by_id[s.home].building or f"at {s.home}", []).append(k)
    crowd = np.zeros(len(people))
    together = set()
    for members in homes.values():
        crowd[members] = len(members)
        together |= set(combinations(members, 2))
    next_door = sorted(set(map(tuple, near.tolist())) - together)
    beside = np.bincount(np.array(next_door, np.int64).reshape(-1, 2).ravel(), minlength=len(people))

    def strangers(i: int, j: int) -> bool:
        return people[i].household == people[j].household or "guest" in (people[i].status, people[j].status)

    house = [
        (i, j)
        for i, j in sorted(together)
        if not strangers(i, j) and rng.random() < min(1.0, _KNOWN_IN_HOUSE / max(crowd[i] - 1, 1))
    ]
    street = [
        (i, j)
        for i, j in next_door
        if not strangers(i, j) and rng.random() < min(_NEXT_DOOR_KNOWN, _KNOWN_NEXT_DOOR / max(beside[i], beside[j]))
    ]
    return house, street


def describe_household(household: Household, draft: ResidentDraft, relations: Mapping[str, str]) -> str:
    """Return who somebody lives with, as the end of a sentence; empty for those who live alone."""
    others = [m for m in household.members if m is not draft]
    if not others:
        return ""
    names = " and ".join(o.first for o in others)
    if household.kind == "family":
        return _describe_family(household, draft)
    if household.kind == "couple":
        return f"with {draft.her} partner {names}"
    if household.kind == "parent":
        child = "daughter" if others[0].gender == "female" else "son"
        parent = "mother" if others[0].gender == "female" else "father"
        return (
            f"with {draft.her} grown-up {child} {names}"
            if draft.age > others[0].age
            else f"with {draft.her} {parent} {names}"
        )
    if household.kind == "siblings":
        word = "sister" if others[0].gender == "female" else "brother"
        return f"with {draft.her} {'younger' if draft.age > others[0].age else 'older'} {word} {names}"
    return f"with {relations.get('mates', 'flatmates') if len(others) > 1 else 'flatmate'} {names}"


def _describe_family(household: Household, draft: ResidentDraft) -> str:
    adults = [m.first for m in household.adults if m is not draft]
    children = [m for m in household.children if m is not draft]
    parts = []
    if draft.child:
        word = "parents" if len(adults) > 1 else "mother" if household.adults[0].gender == "female" else "father"
        parts.append(f"{draft.her} {word} {' and '.join(adults)}")
        for child in children:
            elder = "twin" if child.age == draft.age else "older" if child.age > draft.age else "younger"
            parts.append(f"{draft.her} {elder} {'sister' if child.gender == 'female' else 'brother'} {child.first}")
    else:
        parts += [f"{draft.her} partner {name}" for name in adults]
        told = [f"{child.first} ({child.age})" for child in children]
        one = "daughter" if children[0].gender == "female" else "son"
        parts.append(f"{draft.her} {one if len(told) == 1 else 'children'} {enumerate_words(told)}")
    return f"with {enumerate_words(parts)}"


@dataclass(frozen=True)
class NetworkMeasures:
    """Measures of an undirected network without weights.

    Attributes
    ----------
    people, ties
        Nodes and edges.
    mean_degree, median_degree, most_degree
        Ties of a person.
    degree_skew
        Third standardised moment of the degrees: 0 where they lie evenly about the mean, positive where a few have
        many.
    alone
        Share of people without any tie.
    clustering
        Mean over those with two ties or more of the share of their pairs of neighbours that are tied (Watts and
        Strogatz).
    transitivity
        Three times the triangles over the connected triples.
    degree_assortativity, age_assortativity
        Pearson correlation over the ties of the degrees, and of the ages, at their two ends.
    largest
        Share of people in the largest connected component.
    mean_path
        Mean number of ties between two people of the largest component.
    """

    people: int
    ties: int
    mean_degree: float
    median_degree: float
    most_degree: int
    degree_skew: float
    alone: float
    clustering: float
    transitivity: float
    degree_assortativity: float
    age_assortativity: float
    largest: float
    mean_path: float


def network_measures(
    community: Community, kinds: Collection[RelationKind] = tuple(RelationKind), *, adults_only: bool = False
) -> NetworkMeasures:
    """Measure the network of the relations of some kinds.

    Parameters
    ----------
    kinds
        Relations that count.
    adults_only
        Leave out whoever is younger than 18.

    Returns
    -------
    NetworkMeasures
        A measure that is not defined, as the correlation of equal numbers, is 0.
    """
    people = [r for r in community.residents if r.age >= 18 or not adults_only]
    row = {r.id: k for k, r in enumerate(people)}
    pairs = [
        (row[a], row[b])
        for (a, b), kind in ((r.between, r.kind) for r in community.relations)
        if kind in kinds and a in row and b in row
    ]
    return measures_of(len(people), np.array(pairs, np.int64).reshape(-1, 2), np.array([r.age for r in people], float))


def measures_of(people: int, pairs: NDArray[np.int64], ages: NDArray[np.float64]) -> NetworkMeasures:
    """Measure a network given by its edges.

    Parameters
    ----------
    pairs
        The two ends of every edge, each edge once; shape ``(edges, 2)``.
    ages
        Of the nodes, years; shape ``(people,)``.
    """
    from scipy.sparse import coo_matrix  # slow to import, and most who import this measure nothing
    from scipy.sparse.csgraph import connected_components, shortest_path

    ends = np.concatenate([pairs, pairs[:, ::-1]])
    graph = coo_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(people, people)).tocsr()
    degrees = np.asarray(graph.sum(axis=1)).ravel()
    triangles = np.asarray((graph @ graph).multiply(graph).sum(axis=1)).ravel() / 2.0
    triples = degrees * (degrees - 1.0) / 2.0
    some = triples > 0
    _, labels = connected_components(graph, directed=False)
    sizes = np.bincount(labels, minlength=1)
    members = np.flatnonzero(labels == int(np.argmax(sizes)))
    steps = shortest_path(graph[members][:, members], unweighted=True, directed=False)
    apart = len(members) * (len(members) - 1)
    spread = float(degrees.std())
    return NetworkMeasures(
        people=people,
        ties=len(pairs),
        mean_degree=float(degrees.mean()),
        median_degree=float(np.median(degrees)),
        most_degree=int(degrees.max()),
        degree_skew=float(((degrees - degrees.mean()) ** 3).mean() / spread**3) if spread else 0.0,
        alone=float((degrees == 0).mean()),
        clustering=float((triangles[some] / triples[some]).mean()) if some.any() else 0.0,
        transitivity=float(triangles.sum() / triples.sum()) if some.any() else 0.0,
        degree_assortativity=_correlation(degrees[ends[:, 0]], degrees[ends[:, 1]]),
        age_assortativity=_correlation(ages[ends[:, 0]], ages[ends[:, 1]]),
        largest=float(sizes.max() / people),
        mean_path=float(steps.sum() / apart) if apart else 0.0,
    )


def _correlation(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    if len(a) < 2 or a.std() == 0 or b.std() == 0:
        return 0.0
    return float(np.corrcoef(a, b)[0, 1])
