"""The social network: who is what to whom, read off homes, workplaces and groups."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np

from vico.community.groups import Meeting
from vico.community.model import Relation, RelationKind
from vico.community.people import Household, ResidentDraft
from vico.community.place_index import PlaceIndex

#: People whose homes are this near know each other at least by sight, metres.
_NEXT_DOOR = 40.0

_RANK = list(RelationKind)
# Children have friends from this age, years; friends are of one age, to within so many years.
_FRIENDS_FROM, _OF_ONE_AGE = 3, 2


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
        _tie_group(rng, network, group)
    _tie_colleagues(rng, network, people)
    _tie_neighbours(rng, network, index, people)
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
            _tie_family(rng, network, a, b)
        elif household.kind == "siblings":
            network.tie(a, b, (RelationKind.FAMILY, "siblings"), rng.uniform(0.75, 0.95), youngest)
        else:
            network.tie(a, b, (RelationKind.FRIEND, "flatmates"), rng.uniform(0.6, 0.85), rng.uniform(0, 4))


def _tie_family(rng: np.random.Generator, network: _Network, a: ResidentDraft, b: ResidentDraft) -> None:
    if a.child and b.child:
        bond, strength, years = "siblings", rng.uniform(0.6, 0.95), min(a.age, b.age)
    elif a.child or b.child:
        bond, strength, years = "parent and child", rng.uniform(0.85, 1.0), min(a.age, b.age)
    else:
        bond, strength, years = "partners", rng.uniform(0.8, 1.0), min(a.age, b.age) - 17
    network.tie(a, b, (RelationKind.FAMILY, bond), strength, years)


def _tie_group(rng: np.random.Generator, network: _Network, group: Meeting) -> None:
    bond = RelationKind.FRIEND, f"both in the {group.circle.name.lower()}"
    for a, b in combinations(group.members, 2):
        if a.household == b.household:
            continue
        alike = len({h.name for h in a.hobbies} & {h.name for h in b.hobbies}) + len(set(a.values) & set(b.values))
        strength = rng.uniform(0.25, 0.55) + 0.07 * alike - 0.003 * abs(a.age - b.age)
        strength += 0.2 * (a.character.agreeableness + b.character.agreeableness - 1)
        if a.child != b.child:
            note = f"{bond[1]}, a child and a grown-up"
            network.tie(a, b, (RelationKind.NEIGHBOUR, note), float(np.clip(strength, 0.15, 0.5)), rng.exponential(2))
            continue
        network.tie(a, b, bond, float(np.clip(strength, 0.15, 0.9)), rng.exponential(3.5))


def _tie_colleagues(rng: np.random.Generator, network: _Network, people: Sequence[ResidentDraft]) -> None:
    staff: dict[str, list[ResidentDraft]] = {}
    for s in people:
        if s.workplace is not None:
            staff.setdefault(s.workplace, []).append(s)
    for colleagues in staff.values():
        for a, b in combinations(colleagues, 2):
            if a.child and b.child:
                _tie_pupils(rng, network, a, b)
                continue
            note = "fellow students" if a.status == b.status == "student" else "work at the same place"
            if a.child != b.child:
                note = "pupil and teacher" if "teach" in f"{a.occupation} {b.occupation}" else "from the same school"
            network.tie(a, b, (RelationKind.COLLEAGUE, note), rng.uniform(0.3, 0.7), rng.exponential(3))


def _tie_pupils(rng: np.random.Generator, network: _Network, a: ResidentDraft, b: ResidentDraft) -> None:
    """Tie two of one school: those of an age are friends, the others know each other by sight at most."""
    apart = abs(a.age - b.age)
    if a.household == b.household or apart > _OF_ONE_AGE:
        return
    note = "in the same class" if apart == 0 else "go to the same school"
    if apart == 0 or rng.random() < 0.4:
        network.tie(a, b, (RelationKind.FRIEND, note), rng.uniform(0.3, 0.9) - 0.1 * apart, rng.exponential(3))


def _tie_neighbours(
    rng: np.random.Generator, network: _Network, index: PlaceIndex, people: Sequence[ResidentDraft]
) -> None:
    positions = np.array([index.place_by_id[s.home].position[:2] for s in people])
    from scipy.spatial import cKDTree  # slow to import, and most who import this build no community

    near = cKDTree(positions).query_pairs(_NEXT_DOOR, output_type="ndarray")
    homes: dict[str, list[int]] = {}
    for k, s in enumerate(people):
        homes.setdefault(index.place_by_id[s.home].building or f"at {s.home}", []).append(k)
    together = [pair for members in homes.values() for pair in combinations(members, 2)]
    for i, j in sorted({*together, *map(tuple, np.sort(near, axis=1).tolist())}):
        a, b = people[i], people[j]
        if a.household == b.household or "guest" in (a.status, b.status):
            continue
        if index.same_building(a.home, b.home):
            network.tie(a, b, (RelationKind.NEIGHBOUR, "same house"), rng.uniform(0.2, 0.55), rng.exponential(5))
        elif rng.random() < 0.6:
            network.tie(a, b, (RelationKind.NEIGHBOUR, "next door"), rng.uniform(0.15, 0.45), rng.exponential(5))


def describe_household(household: Household, draft: ResidentDraft, relations: Mapping[str, str]) -> str:
    """Who somebody lives with, as the end of a sentence; empty for those who live alone."""
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
        parts.append(f"{draft.her} {one if len(told) == 1 else 'children'} {_listed(told)}")
    return f"with {_listed(parts)}"


def _listed(parts: Sequence[str]) -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"
