"""The social network: who is what to whom, read off homes, workplaces and groups."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np

from vico.community.ground import Ground
from vico.community.groups import Meeting
from vico.community.model import Relation, RelationKind
from vico.community.people import Household, Sketch

#: People whose homes are this near know each other at least by sight, metres.
_NEXT_DOOR = 40.0

_RANK = list(RelationKind)


def draw_relations(
    rng: np.random.Generator,
    ground: Ground,
    households: Sequence[Household],
    groups: Sequence[Meeting],
    year: int,
) -> list[Relation]:
    """Draw the ties between residents; of several between two, the closest one is kept, stronger for the others."""
    people = [s for h in households for s in h.members]
    order = {s.id: k for k, s in enumerate(people)}
    found: dict[tuple[str, str], Relation] = {}

    def tie(a: Sketch, b: Sketch, kind: RelationKind, note: str, strength: float, years: float) -> None:
        if order[a.id] > order[b.id]:
            a, b = b, a
        # Nobody knew anybody before they were grown up, families aside.
        oldest = min(a.age, b.age) - (0 if kind is RelationKind.FAMILY and note != "partners" else 16)
        since = year - int(np.clip(round(years), 0, max(0, oldest)))
        known = found.get((a.id, b.id))
        new = Relation(between=(a.id, b.id), kind=kind, note=note, strength=round(min(1.0, strength), 2), since=since)
        if known is None:
            found[a.id, b.id] = new
            return
        first, second = sorted((known, new), key=lambda r: (_RANK.index(r.kind), -r.strength))
        found[a.id, b.id] = first.model_copy(
            update={
                "strength": round(min(1.0, first.strength + 0.1), 2),
                "since": min(first.since, second.since),
                "note": first.note if first.note == second.note else f"{first.note}; {second.note}",
            }
        )

    for household in households:
        for a, b in combinations(household.members, 2):
            if household.kind == "couple":
                tie(
                    a,
                    b,
                    RelationKind.FAMILY,
                    "partners",
                    rng.uniform(0.85, 1.0),
                    rng.uniform(1, min(a.age, b.age) - 17),
                )
            elif household.kind == "parent":
                tie(a, b, RelationKind.FAMILY, "parent and child", rng.uniform(0.8, 1.0), min(a.age, b.age))
            elif household.kind == "siblings":
                tie(a, b, RelationKind.FAMILY, "siblings", rng.uniform(0.75, 0.95), min(a.age, b.age))
            else:
                tie(a, b, RelationKind.FRIEND, "flatmates", rng.uniform(0.6, 0.85), rng.uniform(0, 4))
    for group in groups:
        note = f"both in the {group.circle.name.lower()}"
        for a, b in combinations(group.members, 2):
            if a.household == b.household:
                continue
            alike = len({h.name for h in a.hobbies} & {h.name for h in b.hobbies}) + len(set(a.values) & set(b.values))
            strength = rng.uniform(0.25, 0.55) + 0.07 * alike - 0.003 * abs(a.age - b.age)
            strength += 0.2 * (a.character.agreeableness + b.character.agreeableness - 1)
            tie(a, b, RelationKind.FRIEND, note, float(np.clip(strength, 0.15, 0.9)), rng.exponential(3.5))
    for a, b in combinations([s for s in people if s.workplace is not None], 2):
        if a.workplace == b.workplace:
            note = "fellow students" if a.status == b.status == "student" else "work at the same place"
            tie(a, b, RelationKind.COLLEAGUE, note, rng.uniform(0.3, 0.7), rng.exponential(3))
    for a, b in combinations(people, 2):
        if a.household != b.household and "guest" not in (a.status, b.status):
            if ground.same_spot(a.home, b.home):
                tie(a, b, RelationKind.NEIGHBOUR, "same house", rng.uniform(0.2, 0.55), rng.exponential(5))
            elif ground.metres(a.home, b.home) < _NEXT_DOOR and rng.random() < 0.6:
                tie(a, b, RelationKind.NEIGHBOUR, "next door", rng.uniform(0.15, 0.45), rng.exponential(5))
    return [found[key] for key in sorted(found, key=lambda k: (order[k[0]], order[k[1]]))]


def describe_household(household: Household, sketch: Sketch, relations: Mapping[str, str]) -> str:
    """Who somebody lives with, as the end of a sentence; empty for those who live alone."""
    others = [m for m in household.members if m is not sketch]
    if not others:
        return ""
    names = " and ".join(o.first for o in others)
    if household.kind == "couple":
        return f"with {sketch.her} partner {names}"
    if household.kind == "parent":
        child = "daughter" if others[0].gender == "female" else "son"
        parent = "mother" if others[0].gender == "female" else "father"
        return (
            f"with {sketch.her} grown-up {child} {names}"
            if sketch.age > others[0].age
            else f"with {sketch.her} {parent} {names}"
        )
    if household.kind == "siblings":
        word = "sister" if others[0].gender == "female" else "brother"
        return f"with {sketch.her} {'younger' if sketch.age > others[0].age else 'older'} {word} {names}"
    return f"with {relations.get('mates', 'flatmates') if len(others) > 1 else 'flatmate'} {names}"
