"""What the model is told of a world and of the bodies that it is to give lives: facts, in words and bounded lists."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

from vico.clock import clock_of
from vico.community.childhood import ALONE_FROM, GROWN_UP
from vico.community.jobs import jobs_at
from vico.community.llm.prose import label_text
from vico.community.model import Community, ItemType, RelationKind, Resident
from vico.community.place_index import GUEST_KINDS, PlaceIndex, kind_of
from vico.community.work import STUDY_KINDS, employers
from vico.seeds import rng
from vico.world.model import Category, Place

# Workplaces offered to a household besides those of its members.
_OFFERED = 8
_LATE = 24 * 60


class PlaceLabels:
    """Names by which a model knows places: as on the map, with something added where two have the same."""

    def __init__(self, places: Sequence[Place]) -> None:
        names = {place.id: label_text(place.name) or place.id for place in places}
        counts = Counter(name.casefold() for name in names.values())
        self._label = {
            key: name if counts[name.casefold()] == 1 else f"{name} ({label_text(key)})" for key, name in names.items()
        }
        self._place = {label: key for key, label in self._label.items()}

    def __getitem__(self, place: str) -> str:
        """Return the label of a place."""
        return self._label[place]

    def place(self, label: str) -> str:
        """Return the id of the place with a label."""
        return self._place[label]


@dataclass(frozen=True)
class Cast:
    """The bodies, homes and households of a community that a model is to write, and what has to stay.

    Attributes
    ----------
    base
        The procedural author's community: bodies, ages, homes, children's schools; and what stands where the model
        fails.
    index
        The world on the community's day.
    """

    base: Community
    index: PlaceIndex

    @cached_property
    def labels(self) -> PlaceLabels:
        """Names of the places."""
        return PlaceLabels(self.index.world.places)

    @cached_property
    def households(self) -> list[list[Resident]]:
        """Residents by household, in the community's order."""
        found: dict[str, list[Resident]] = {}
        for resident in self.base.residents:
            found.setdefault(resident.household or resident.id, []).append(resident)
        return list(found.values())

    @cached_property
    def coupled(self) -> frozenset[str]:
        """Ids of small children and of those who take them: their days go together, minute by minute, and stay."""
        found: set[str] = set()
        for household in self.households:
            for child in household:
                if child.age >= ALONE_FROM:
                    continue
                found.add(child.id)
                ways = set(_ways(child))
                found |= {other.id for other in household if other is not child and ways & set(_ways(other))}
        return frozenset(found)

    @cached_property
    def offers(self) -> list[list[str]]:
        """Ids of workplaces that each household may choose from: its own, and others that few other households get."""
        people = [r for r in self.base.residents if r.age >= GROWN_UP]
        taken = {r.workplace for r in people}
        free = [place.id for place in employers(self.index) if place.id not in taken]
        order = rng(self.base.seed, "community", "llm", "offers").permutation(len(free)).tolist()
        offers = []
        at = 0
        for household in self.households:
            own = [r.workplace for r in household if r.workplace is not None and r.age >= GROWN_UP]
            more = [free[order[(at + k) % len(free)]] for k in range(min(_OFFERED, len(free)))]
            at += _OFFERED
            homes = {r.home for r in household}
            offers.append([place for place in dict.fromkeys([*own, *more]) if place not in homes])
        return offers

    def scene(self) -> dict[str, Any]:
        """Return what a town this is, on which day."""
        counts = Counter(place.category.value for place in self.index.places())
        return {
            "name": label_text(self.base.world.name),
            "day": self.base.weekday,
            "places": {name: counts[name] for name in sorted(counts)},
        }

    def place_facts(self, place: str, *, jobs: bool = False, walk_from: str | None = None) -> dict[str, Any]:
        """Return what is to be known of a place: name, building, function, hours on the day.

        Parameters
        ----------
        jobs
            With the trades that it employs.
        walk_from
            With the minutes on foot from this place.
        """
        found = self.index.place_by_id[place]
        facts: dict[str, Any] = {
            "name": self.labels[place],
            "building": found.building,
            "function": function_of(found),
            "open": _hours_in_words(self.index, found),
        }
        if jobs:
            facts["employs"] = self.trades(place)
        if walk_from is not None:
            facts["minutes_on_foot_from_home"] = self.index.minutes(walk_from, place)
        return facts

    def trades(self, place: str) -> list[str]:
        """Return the occupations that somebody at a place may have."""
        found = self.index.place_by_id[place]
        study = ["student of ..."] if kind_of(found) in STUDY_KINDS else []
        return [*(job.title for job in jobs_at(found)), *study]

    def body(self, resident: Resident) -> dict[str, Any]:
        """Return what can be seen of somebody, and what is settled: name and age, looks, home, family, school."""
        kept = self.keeps_work(resident)
        return {
            "id": resident.id,
            "suggested_name": resident.name,
            "age": resident.age,
            "gender": resident.gender,
            "looks": looks_in_words(resident),
            "lives": self.home_in_words(resident),
            "family": self.family(resident),
            "settled": {
                "occupation": resident.occupation,
                "workplace": self.labels[resident.workplace] if resident.workplace else None,
            }
            if kept
            else None,
        }

    def keeps_work(self, resident: Resident) -> bool:
        """Whether somebody's occupation is settled: children's, and that of who takes small ones somewhere."""
        return resident.age < GROWN_UP or resident.id in self.coupled

    def home_in_words(self, resident: Resident) -> str:
        """Return where somebody lives."""
        home = self.index.place_by_id[resident.home]
        return f"{'as a guest ' if kind_of(home) in GUEST_KINDS else ''}at {self.labels[home.id]}"

    def family(self, resident: Resident) -> list[str]:
        """Return who shares somebody's home, as ids with what they are to each other."""
        names = {r.id for r in self.base.residents if r.household == resident.household} - {resident.id}
        found = []
        for relation in self.base.relations_of(resident.id):
            other = relation.between[1] if relation.between[0] == resident.id else relation.between[0]
            if other in names and relation.kind in (RelationKind.FAMILY, RelationKind.FRIEND):
                found.append(f"{other}: {relation.note.partition(';')[0]}")
        return found

    def near(self, homes: Iterable[str], categories: Iterable[Category], most: int) -> list[str]:
        """Return the places of some categories near some homes, the nearest of each in turn, at most so many."""
        wanted = frozenset(categories)
        lists = [
            [place.id for place in self.index.by_nearness(home) if place.category in wanted]
            for home in dict.fromkeys(homes)
        ]
        longest = max((len(one) for one in lists), default=0)
        merged = dict.fromkeys(one[k] for k in range(longest) for one in lists if k < len(one))
        return list(merged)[:most]


def _ways(resident: Resident) -> list[tuple[str, str, str | None]]:
    """Return start, end and goal of the ways of a day."""
    return [
        (way.start, way.end, then.place) for way, then in pairwise(resident.schedule) if way.type is ItemType.COMMUTE
    ]


def function_of(place: Place) -> str:
    """Return what a place is for, in words: ``cafe (food)``."""
    return f"{label_text(kind_of(place).replace('_', ' '))} ({place.category.value})"


def _hours_in_words(index: PlaceIndex, place: Place) -> str:
    if place.category is Category.ACCOMMODATION:
        return "always"
    spans = [f"{clock_of(a * 60)[:5]}-{clock_of(min(b, _LATE) * 60)[:5]}" for a, b in index.hours(place)]
    return ", ".join(spans) or "closed"


def looks_in_words(resident: Resident) -> str:
    """Return what one sees of somebody."""
    look = resident.appearance
    person = (
        ("girl" if resident.gender == "female" else "boy")
        if resident.age < GROWN_UP
        else ("woman" if resident.gender == "female" else "man")
    )
    build = "slim" if look["build"] < 0.35 else "heavily built" if look["build"] > 0.65 else "of medium build"
    hair = "bald" if look["hair"] == "bald" else f"{look['hair']} hair"
    extras = [word for word, has in (("beard", look["beard"]), ("glasses", look["glasses"])) if has]
    clothes: list[str] = [look["top"], look["bottom"], look["shoes"]]
    worn = [look.get("hat", "none"), look.get("over", "none"), look.get("bag", "none")]
    clothes += [one for one in worn if one != "none"]
    return ", ".join([f"{person}, {look['height']:.2f} m tall, {build}, {hair}", *extras, *clothes])
