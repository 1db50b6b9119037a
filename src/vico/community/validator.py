"""Is a community grounded in its world? Every finding says where, what, and how to mend it.

The findings are written for people and for authors: a language model gets them back with its draft. Households and
childhoods have to be believable: children live with adults, learn on school days, and are never at work.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from vico.clock import seconds_of_day
from vico.community.mode_choice import SLACK, SPARE, first_ride
from vico.community.model import (
    LAST,
    TAGS_OF_TYPE,
    ActivityTag,
    Community,
    CommunityFinding,
    Group,
    ItemType,
    Mode,
    RelationKind,
    Resident,
    ScheduleItem,
)
from vico.community.people import (
    ALONE_FROM,
    GROWN_UP,
    POCKET_MONEY,
    YOUNGEST,
    adults_only,
    childhood,
    is_pupil,
    schools,
)
from vico.community.place_index import SPAWN_GAP, PlaceIndex, kind_of, staffed_spans
from vico.community.schooling import SCHOOL_DAYS, lesson_span, school_places
from vico.community.work import STUDY_KINDS, job_of, jobs_at, staff_capacity, works_at
from vico.rules import walk_speed
from vico.world.model import Category, Place
from vico.world.world import World

# Years between a child and at least one adult it lives with.
_PARENT = (16, 60)
_AT_SCHOOL = 2 * 3600  # seconds of lessons of a day at school
_AT_HOME = 3600  # seconds of lessons of a day at home
_SLEEP = 7.5 * 3600  # seconds that children sleep a night
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
        """Return what is wrong.

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
        if self.school_day and self._is_open(school) and sum(map(_clock_seconds, learning)) < least:
            what = f"{sum(map(_clock_seconds, learning)) / 3600:.1f} h of lessons on a school day"
            yield self._of("schedule", what, f"plan {least / 3600:g} h or more with the tag study")
        if sum(_clock_seconds(i) for i in child.schedule if i.type is ItemType.SLEEP) < _SLEEP:
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


def _clock_seconds(item: ScheduleItem) -> int:
    return seconds_of_day(item.end) - seconds_of_day(item.start)


CASH = (100, 1000)


def check_community(community: Community, world: World) -> list[CommunityFinding]:
    """Check that a community is grounded in a world.

    Checks that it was made for this world; names and ids are unique; homes are accommodation; workplaces employ the
    occupation and appear in the biography; known places exist and include all that are used; cash is 100..1000;
    schedules cover the day without gaps, walks are possible and long enough for the router, opening hours hold where
    they are given; groups meet at places that exist, and their members' schedules say so; everybody has a group;
    relations join residents; children live with adults, go to school and nowhere that is not for them, and the small
    ones go nowhere alone (`vico.community.validator`); and spawn points are reachable and 2 m apart.

    Returns
    -------
    list of Finding
        Empty if all is well.
    """
    if community.world.digest != world.digest:
        return [
            CommunityFinding(
                "world.digest",
                f"the community was made for world {community.world.name!r} ({community.world.digest[:12]}), not for "
                f"this one, {world.manifest.name!r} ({world.digest[:12]})",
                "give the world it was made for, or build a community for this one",
            )
        ]
    if not community.residents:
        return [CommunityFinding("residents", "nobody lives here", "write at least one resident")]
    index = PlaceIndex(world, community.date)
    found = _Check(community.on(community.date), index).run()
    for k, day in enumerate(community.further_days):
        found += _further_day(community, k, index.on(day.date))
    return found


def _further_day(community: Community, k: int, index: PlaceIndex) -> list[CommunityFinding]:
    """Check what a further day may have wrong that the first has not."""
    day, where = community.further_days[k], f"further_days[{k}]"
    if day.date <= community.dates[k]:
        return [CommunityFinding(where, f"{day.date} does not come after {community.dates[k]}", "put days in order")]
    people = [r.id for r in community.residents]
    if missing := sorted(set(people) ^ set(day.schedules)):
        what = f"{', '.join(missing[:5])}: residents without a schedule, or schedules of nobody"
        return [CommunityFinding(f"{where}.schedules", what, "write one schedule for each resident")]
    check = _Check(community.on(day.date), index)
    check.day()
    return [CommunityFinding(f"{where}.{one.where}", one.what, one.mend) for one in check.found]


def check_resident(resident: Resident, community: Community, index: PlaceIndex) -> list[CommunityFinding]:
    """Check what can be said of one resident alone: who they are and their day, not their groups' days or their spawn.

    Parameters
    ----------
    resident
        Need not be in the community yet.
    community
        Whose day and groups count.
    index
        The community's world on its day.

    Returns
    -------
    list of CommunityFinding
        Empty if all is well.
    """
    check = _Check(community, index)
    check.person(resident)
    check.schedule(resident)
    return check.found


class _Check:
    def __init__(self, community: Community, index: PlaceIndex) -> None:
        self.community = community
        self.index = index
        self.found: list[CommunityFinding] = []
        self.groups_of: dict[str, list[Group]] = {}
        for group in community.groups:
            for member in group.members:
                self.groups_of.setdefault(member, []).append(group)

    def say(self, where: str, what: str, mend: str) -> None:
        self.found.append(CommunityFinding(where, what, mend))

    def run(self) -> list[CommunityFinding]:
        self.unique()
        for resident in self.community.residents:
            self.person(resident)
        self.jobs()
        self.day()
        self.relations()
        self.spawns()
        return self.found

    def jobs(self) -> None:
        """Places employ no more people than they have room for."""
        staff = Counter(r.workplace for r in self.community.residents if r.workplace and is_employed(r))
        for place_id, count in staff.items():
            place = self.index.place_by_id.get(place_id)
            if place is not None and count > (most := staff_capacity(self.index, place)):
                what = f"{count} people work at {place.name}, which has room for {most}"
                self.say(f"{place_id}.staff", what, f"let {count - most} of them work elsewhere")

    def day(self) -> None:
        """Check all that another day may have wrong."""
        for resident in self.community.residents:
            self.known_places(resident)
            self.schedule(resident)
        self.found += households_of(self.community, self.index)
        self.groups()

    def place(self, where: str, place_id: str) -> Place | None:
        """Look a place up; say so if it doesn't exist or can't be reached."""
        place = self.index.place_by_id.get(place_id)
        if place is None:
            self.say(where, f"there is no place {place_id!r} in this world", "use the id of a place of the world")
        elif not self.index.reachable(place):
            self.say(where, f"{place.name} ({place_id}) can't be reached on foot", "choose another place")
            return None
        return place

    def unique(self) -> None:
        for what, values in (
            ("id", [r.id for r in self.community.residents]),
            ("name", [r.name for r in self.community.residents]),
            ("group id", [g.id for g in self.community.groups]),
            ("group name", [g.name for g in self.community.groups]),
        ):
            for value, count in Counter(values).items():
                if count > 1:
                    self.say(what, f"{count} share the {what} {value!r}", f"give each its own {what}")

    def person(self, r: Resident) -> None:
        home = self.place(f"{r.id}.home", r.home)
        if home is not None and home.category is not Category.ACCOMMODATION:
            self.say(
                f"{r.id}.home",
                f"{home.name} ({r.home}) is of category {home.category.value}, not accommodation",
                "choose an accommodation place as home",
            )
        self.workplace(r)
        least, most = POCKET_MONEY if r.age < GROWN_UP else CASH
        if not least <= r.cash <= most:
            self.say(f"{r.id}.cash", f"{r.cash} is not in {least}..{most}", "give an amount in that range")
        for k, known in enumerate(r.known_places):
            self.place(f"{r.id}.known_places[{k}]", known)
        if r.id not in self.groups_of:
            self.say(r.id, f"{r.name} is in no group", "add them to a group they like and are free for")
        if int(r.appearance["age"]) != r.age or r.appearance["gender"] != (0.0 if r.gender == "female" else 1.0):
            self.say(
                f"{r.id}.appearance",
                f"age {r.appearance['age']:g}, gender {r.appearance['gender']:g} don't agree with {r.age}, {r.gender}",
                "use the resident's age; gender 0 for female, 1 for male",
            )

    def known_places(self, r: Resident) -> None:
        """Everywhere that somebody is, lives, works or meets is known to them."""
        used = {r.home, *([r.workplace] if r.workplace else []), *(i.place for i in r.schedule if i.place)}
        used |= {g.place for g in self.groups_of.get(r.id, ())}
        if unknown := sorted(used - set(r.known_places)):
            self.say(
                f"{r.id}.known_places", f"{', '.join(unknown)} are used but not known", "add them to the known places"
            )

    def workplace(self, r: Resident) -> None:
        where, student = f"{r.id}.workplace", r.occupation.lower().startswith("student")
        if r.age < GROWN_UP:
            self.biography(r)
            return  # their schools are looked at with their days
        if r.workplace is None:
            if (job_of(r.occupation) is not None and not _works_without_place(r.occupation)) or student:
                self.say(where, f"{r.name} is {r.occupation!r} but has no workplace", "choose a place that employs one")
            return
        place = self.place(where, r.workplace)
        if place is None:
            return
        if student:
            fits = place.kind.split(";")[0].strip().lower() in STUDY_KINDS
        else:
            fits = not r.occupation.lower().startswith("retired") and works_at(r.occupation, place)
        if not fits:
            jobs = ", ".join(job.title for job in jobs_at(place)) or "nobody"
            self.say(
                where,
                f"{r.name} is {r.occupation!r}, but {place.name} is a {place.kind} ({place.category.value})",
                f"choose a place of another kind, or an occupation it employs: {jobs}",
            )
        self.biography(r)

    def biography(self, r: Resident) -> None:
        place = self.index.place_by_id.get(r.workplace or "")
        if place is not None and place.name.casefold() not in r.biography.casefold():
            self.say(
                f"{r.id}.biography",
                f"it does not mention {r.name}'s workplace, {place.name}",
                f"mention {place.name}, or change the workplace to the one that the biography tells of",
            )

    def schedule(self, r: Resident) -> None:
        items = r.schedule
        if not items:
            self.say(f"{r.id}.schedule", "it is empty", "plan the day from 00:00:00 to 23:59:59")
            return
        if items[0].start != "00:00:00":
            self.say(f"{r.id}.schedule[0]", f"the day starts at {items[0].start}", "start at 00:00:00")
        if items[-1].end != LAST:
            self.say(f"{r.id}.schedule[{len(items) - 1}]", f"the day ends at {items[-1].end}", f"end at {LAST}")
        for k, item in enumerate(items):
            where = f"{r.id}.schedule[{k}]"
            if item.end <= item.start:
                self.say(where, f"it ends at {item.end}, not after its start {item.start}", "give it some time")
            if k and item.start != items[k - 1].end:
                self.say(
                    where,
                    f"it starts at {item.start}, but the item before ends at {items[k - 1].end}",
                    "let each item start when the one before ends",
                )
            if item.tag is not None and item.tag not in TAGS_OF_TYPE[item.type]:
                tags = ", ".join(sorted(TAGS_OF_TYPE[item.type]))
                self.say(where, f"its tag {item.tag} does not go with its type {item.type}", f"take one of {tags}")
            if item.type is ItemType.COMMUTE:
                self.commute(r, k, where)
            else:
                self.stay(r, item, where)
                if k and items[k - 1].type is not ItemType.COMMUTE:
                    self.way_between(items[k - 1], item, where)

    def commute(self, r: Resident, k: int, where: str) -> None:
        items, item = r.schedule, r.schedule[k]
        if item.place is not None or item.building is not None:
            self.say(where, "a commute has a place or a building", "leave both empty on the way")
        if not 0 < k < len(items) - 1 or ItemType.COMMUTE in (items[k - 1].type, items[k + 1].type):
            self.say(where, "a commute is not between two stays", "put commutes between things to do, one each")
            return
        a, b = items[k - 1].place, items[k + 1].place
        if a not in self.index.place_by_id or b not in self.index.place_by_id or a is None or b is None:
            return  # said already
        names = f"from {self.index.place_by_id[a].name} to {self.index.place_by_id[b].name}"
        if item.mode is None or item.mode is Mode.WALK:
            what, needed = "walk", self.index.seconds(a, b) / walk_speed(r.age)
            if math.isinf(needed):
                self.say(where, f"there is no way {names}", "choose a place that can be reached")
                return
        else:
            what, start = f"way by {item.mode}", seconds_of_day(item.start)
            times = start, seconds_of_day(item.end)
            needed = first_ride(self.index, (a, b), item.mode, times, r.cash) - start
            if math.isinf(needed):
                self.say(where, f"no {item.mode} goes {names}", "walk, or choose a place that can be reached so")
                return
        given = seconds_of_day(item.end) + (1 if item.end == LAST else 0) - seconds_of_day(item.start)
        taking = f"{given} s for the {what} {names}, which takes {needed:.0f} s"
        if given < needed:
            self.say(where, taking, f"allow {math.ceil(needed)} s or more")
        elif given > SLACK * needed + SPARE:
            self.say(where, taking, "leave later or arrive earlier")

    def way_between(self, before: ScheduleItem, item: ScheduleItem, where: str) -> None:
        places = self.index.place_by_id
        a, b = before.place, item.place
        if a in places and b in places and a is not None and b is not None and a != b:
            self.say(
                where,
                f"nobody gets from {places[a].name} to {places[b].name} in no time",
                "insert a commute between them",
            )

    def stay(self, r: Resident, item: ScheduleItem, where: str) -> None:
        if item.mode is not None:
            self.say(where, f"{item.activity!r} has a mode, {item.mode}", "only ways have a mode: leave it out")
        if item.place is None:
            self.say(where, f"{item.activity!r} has no place", "say where it happens")
            return
        place = self.place(where, item.place)
        if place is None:
            return
        if item.building != place.building:
            self.say(where, f"building {item.building!r} is not that of {place.name}", f"write {place.building!r}")
        if item.type is ItemType.SLEEP and place.category is not Category.ACCOMMODATION:
            self.say(where, f"{place.name} is no place to sleep", "sleep at home")
        spans = self.index.given_hours(place)
        if spans is None or place.id == r.home:
            return
        start, end = seconds_of_day(item.start), seconds_of_day(item.end)
        if not any(
            a * 60 <= start and end <= b * 60 for a, b in (staffed_spans(spans) if place.id == r.workplace else spans)
        ):
            self.say(
                where,
                f"{place.name} is not open {item.start}-{item.end} on {self.community.weekday} ({place.opening_hours})",
                "choose another time or another place",
            )

    def groups(self) -> None:
        people = {r.id: r for r in self.community.residents}
        for g in self.community.groups:
            self.place(f"{g.id}.place", g.place)
            if g.end <= g.start:
                self.say(g.id, f"it meets from {g.start} to {g.end}", "let it end after it starts")
            if len(set(g.members)) != len(g.members):
                self.say(f"{g.id}.members", "somebody is named twice", "name each member once")
            if len(g.members) < min(2, len(people)):
                self.say(f"{g.id}.members", f"{len(g.members)} members make no group", "find at least two")
            if strangers := sorted(set(g.absent) - set(g.members)):
                self.say(f"{g.id}.absent", f"{', '.join(strangers)} are no members", "name members only")
            for member in g.members:
                if member in g.absent and member in people:
                    continue
                if member not in people:
                    self.say(f"{g.id}.members", f"there is no resident {member!r}", "use ids of residents")
                elif not any(
                    i.place == g.place and i.start == g.start and i.end == g.end for i in people[member].schedule
                ):
                    self.say(
                        f"{member}.schedule",
                        f"it does not have the {g.name} ({g.id}) at {g.place}, {g.start}-{g.end}",
                        "put the meeting into the schedule",
                    )

    def relations(self) -> None:
        people = {r.id: r for r in self.community.residents}
        for k, relation in enumerate(self.community.relations):
            where, (a, b) = f"relations[{k}]", relation.between
            if a not in people or b not in people or a == b:
                self.say(where, f"{a!r} and {b!r} are not two residents", "join two residents by their ids")
            elif (
                not self.community.date.year - max(people[a].age, people[b].age)
                <= relation.since
                <= self.community.date.year
            ):
                self.say(
                    where, f"{people[a].name} and {people[b].name} since {relation.since}", "give a year in their lives"
                )
        pairs = Counter(tuple(sorted(r.between)) for r in self.community.relations)
        for pair, count in pairs.items():
            if count > 1:
                self.say("relations", f"{count} relations join {pair[0]} and {pair[1]}", "keep one, the closest")

    def spawns(self) -> None:
        residents, walkable = self.community.residents, self.index.world.walkable
        points = np.array([r.spawn for r in residents], float)
        reachable = walkable.is_connected(points)
        for r, ok in zip(residents, reachable.tolist(), strict=True):
            if not ok:
                self.say(f"{r.id}.spawn", f"{r.spawn} can't be reached from the map's edge", "choose a walkable point")
        gaps = np.linalg.norm(points[:, None] - points[None], axis=2)
        for i, j in np.argwhere(np.triu(gaps < SPAWN_GAP - 1e-9, 1)).tolist():
            self.say(
                f"{residents[j].id}.spawn",
                f"it is {gaps[i, j]:.2f} m from {residents[i].id}'s",
                f"keep spawn points {SPAWN_GAP:g} m apart",
            )


def is_employed(r: Resident) -> bool:
    """Whether somebody's workplace is where they work, and not where they learn."""
    return r.age >= GROWN_UP and not r.occupation.lower().startswith("student")


def _works_without_place(occupation: str) -> bool:
    return any(
        word in occupation.lower() for word in ("freelance", "independent", "self-employed", "retired", "former")
    )
