"""Are households and childhoods believable? Children live with adults, learn on school days, and are never at work."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

from vico.clock import seconds_of_day
from vico.community.childhood import ALONE_FROM, GROWN_UP, YOUNGEST, adults_only, childhood, is_pupil, schools
from vico.community.findings import CommunityFinding
from vico.community.model import ActivityTag, Community, ItemType, RelationKind, Resident, ScheduleItem
from vico.community.place_index import PlaceIndex, kind_of
from vico.community.schooling import SCHOOL_DAYS, lesson_span, school_places

# Years between a child and at least one adult it lives with.
_PARENT = (16, 60)
# Seconds of a school day that are lessons, at school and at home, and of a night that children sleep.
_AT_SCHOOL, _AT_HOME, _SLEEP = 2 * 3600, 3600, 7.5 * 3600
# Children are out between these seconds of the day only.
_OUT = (6 * 3600, 22 * 3600 + 1800)


def households_of(community: Community, index: PlaceIndex) -> list[CommunityFinding]:
    """Check households and children.

    Returns
    -------
    list of CommunityFinding
        Empty if all is well.
    """
    together: dict[str, list[Resident]] = {}
    for resident in community.residents:
        if resident.household is not None:
            together.setdefault(resident.household, []).append(resident)
    found = [
        CommunityFinding(
            f"{member.id}.home",
            f"{member.name} shares {household} with {members[0].name}, but not the home",
            f"write {members[0].home!r}, or another household",
        )
        for household, members in together.items()
        for member in members
        if member.home != members[0].home
    ]
    kin: dict[str, set[str]] = {}
    for relation in community.relations:
        if relation.kind is RelationKind.FAMILY:
            for me, other in (relation.between, relation.between[::-1]):
                kin.setdefault(me, set()).add(other)
    offered = {kind for school, places in school_places(index) if places for kind in (school.title,)}
    for child in community.residents:
        if child.age < GROWN_UP:
            family = [r for r in together.get(child.household or "", []) if r is not child]
            relatives = kin.get(child.id, set())
            adults = [r for r in family if r.age >= GROWN_UP and r.id in relatives]
            found += _Child(child, family, index).findings(adults, offered)
    return found


class _Child:
    """One child, and who it lives with."""

    def __init__(self, child: Resident, family: list[Resident], index: PlaceIndex) -> None:
        self.child, self.family, self.index = child, family, index
        self.school_day = index.weekday in SCHOOL_DAYS

    def findings(self, adults: list[Resident], offered: set[str]) -> Iterator[CommunityFinding]:
        """Say what is wrong.

        Parameters
        ----------
        adults
            Grown-up relatives it lives with.
        offered
            Titles of the schools that the world has.
        """
        child = self.child
        if child.age < YOUNGEST:
            yield self._of("age", f"{child.age} is too young", f"residents are {YOUNGEST} years old or older")
        if not adults:
            what = f"{child.name}, {child.age}, lives with no grown-up relative"
            yield self._of("household", what, "give a parent the same household and a family relation to the child")
        elif not any(_PARENT[0] <= adult.age - child.age <= _PARENT[1] for adult in adults):
            ages = ", ".join(str(adult.age) for adult in adults)
            what = f"{child.name} is {child.age}, the adults of the household {ages}"
            yield self._of("age", what, f"let one be {_PARENT[0]} to {_PARENT[1]} years older")
        yield from self._school(offered)
        yield from self._day()
        if child.age < ALONE_FROM:
            yield from self._company()

    def _of(self, field: str, what: str, mend: str) -> CommunityFinding:
        return CommunityFinding(f"{self.child.id}.{field}", what, mend)

    def _school(self, offered: set[str]) -> Iterator[CommunityFinding]:
        child, home = self.child, childhood().home_school.title
        school = next((one for one in schools() if one.title == child.occupation), None)
        fitting = [one for one in schools() if one.ages[0] <= child.age <= one.ages[1]]
        if not is_pupil(child.occupation):
            titles = ", ".join(one.title for one in fitting)
            what = f"{child.name}, {child.age}, is {child.occupation!r}: children don't work"
            yield self._of("occupation", what, f"write {titles} or {home}")
        elif school is None and (near := [one.title for one in fitting if one.title in offered]):
            if self._could_go():
                yield self._of("occupation", f"{child.name} is {home} though there is a school", f"write {near[0]}")
        elif school is not None and school not in fitting:
            yield self._of("occupation", f"{child.name}, {child.age}, is {child.occupation!r}", "choose by age")
        place = self.index.place_by_id.get(child.workplace or "")
        if school is None and child.workplace is not None:
            yield self._of("workplace", f"{child.workplace} is given, but {child.name} goes to no school", "write null")
        elif school is not None and (place is None or kind_of(place) not in school.kinds):
            what = f"{child.workplace} is no place for a {school.title}"
            yield self._of("workplace", what, f"choose one of kind {' or '.join(school.kinds)}")

    def _could_go(self) -> bool:
        """Whether nothing keeps a child from school: the small ones' way may not fit with that to another school."""
        return self.child.age >= ALONE_FROM

    def _is_open(self, school: str | None) -> bool:
        place = self.index.place_by_id.get(school or "")
        return place is None or lesson_span(self.index, place) is not None

    def _day(self) -> Iterator[CommunityFinding]:
        child = self.child
        school = child.workplace
        learning = [i for i in child.schedule if i.tag is ActivityTag.STUDY and i.place == (school or child.home)]
        least = _AT_HOME if school is None else _AT_SCHOOL
        if self.school_day and self._is_open(school) and sum(map(_length, learning)) < least:
            what = f"{sum(map(_length, learning)) / 3600:.1f} h of lessons on a school day"
            yield self._of("schedule", what, f"plan {least / 3600:g} h or more with the tag study")
        if sum(_length(i) for i in child.schedule if i.type is ItemType.SLEEP) < _SLEEP:
            yield self._of("schedule", "too little sleep for a child", f"plan {_SLEEP / 3600:g} h or more")
        for k, item in enumerate(child.schedule):
            place = self.index.place_by_id.get(item.place or "")
            if item.tag is ActivityTag.WORK:
                yield self._of(f"schedule[{k}]", f"{child.name}, {child.age}, is at work", "children don't work")
            if place is not None and kind_of(place) in adults_only():
                what = f"{place.name} is a {place.kind}, {child.name} is {child.age}"
                yield self._of(f"schedule[{k}]", what, "choose a place for children")
            late = item.place != child.home and (
                seconds_of_day(item.start) < _OUT[0] or seconds_of_day(item.end) > _OUT[1]
            )
            if late:
                yield self._of(
                    f"schedule[{k}]", f"{child.name}, {child.age}, is out {item.start}-{item.end}", "be home"
                )

    def _company(self) -> Iterator[CommunityFinding]:
        """Whoever is too small to go alone sets out with somebody of the household."""
        ways = {
            (way.start, way.end, then.place)
            for other in self.family
            if other.age >= ALONE_FROM
            for way, then in pairwise(other.schedule)
            if way.type is ItemType.COMMUTE
        }
        for k, (way, then) in enumerate(pairwise(self.child.schedule)):
            if way.type is ItemType.COMMUTE and (way.start, way.end, then.place) not in ways:
                what = f"{self.child.name}, {self.child.age}, goes out alone at {way.start}"
                mend = "let somebody of the household go the same way at the same time, and come along"
                yield self._of(f"schedule[{k}]", what, mend)


def _length(item: ScheduleItem) -> int:
    return seconds_of_day(item.end) - seconds_of_day(item.start)
