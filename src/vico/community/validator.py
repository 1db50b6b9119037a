"""Is a community grounded in its world? Every finding says where, what, and how to mend it.

The findings are written for people and for authors: a language model gets them back with its draft.
"""

from __future__ import annotations

import math
from collections import Counter

import numpy as np

from vico.clock import seconds_of_day
from vico.community.childhood import GROWN_UP, POCKET_MONEY
from vico.community.findings import CommunityFinding
from vico.community.hours import staffed
from vico.community.jobs import job_of, jobs_at, works_at
from vico.community.model import LAST, Community, Group, ItemType, Mode, Resident, ScheduleItem
from vico.community.place_index import SPAWN_GAP, PlaceIndex
from vico.community.rides import SLACK, SPARE, first_ride
from vico.community.staff import staff_capacity
from vico.community.tags import TAGS_OF_TYPE
from vico.community.validator_households import households_of
from vico.community.work import STUDY_KINDS
from vico.rules import walk_speed
from vico.world.model import Category, Place
from vico.world.world import World

CASH = (100, 1000)


def check_community(community: Community, world: World) -> list[CommunityFinding]:
    """Check that a community is grounded in a world.

    Checks that it was made for this world; names and ids are unique; homes are accommodation; workplaces employ the
    occupation and appear in the biography; known places exist and include all that are used; cash is 100..1000;
    schedules cover the day without gaps, walks are possible and long enough for the router, opening hours hold where
    they are given; groups meet at places that exist, and their members' schedules say so; everybody has a group;
    relations join residents; children live with adults, go to school and nowhere that is not for them, and the small
    ones go nowhere alone (`vico.community.validator_households`); and spawn points are reachable and 2 m apart.

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
            self.known(resident)
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

    def known(self, r: Resident) -> None:
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
                    self.joined(items[k - 1], item, where)

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
        given = _length(item)
        taking = f"{given} s for the {what} {names}, which takes {needed:.0f} s"
        if given < needed:
            self.say(where, taking, f"allow {math.ceil(needed)} s or more")
        elif given > SLACK * needed + SPARE:
            self.say(where, taking, "leave later or arrive earlier")

    def joined(self, before: ScheduleItem, item: ScheduleItem, where: str) -> None:
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
            a * 60 <= start and end <= b * 60 for a, b in (staffed(spans) if place.id == r.workplace else spans)
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


def _length(item: ScheduleItem) -> int:
    return seconds_of_day(item.end) + (1 if item.end == LAST else 0) - seconds_of_day(item.start)


def _works_without_place(occupation: str) -> bool:
    return any(
        word in occupation.lower() for word in ("freelance", "independent", "self-employed", "retired", "former")
    )
