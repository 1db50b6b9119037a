"""Peopling a world: the procedural author, and the loop in which any author answers to the validator."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from datetime import date as Date  # parameters of that name would hide it
from datetime import timedelta
from functools import partial
from typing import Protocol

import numpy as np

from vico.clock import clock_of
from vico.community.day import day_measures
from vico.community.groups import Meeting, form_groups, form_playmates, meetings_by_member
from vico.community.mode_choice import with_rides
from vico.community.model import (
    Community,
    CommunityDay,
    CommunityFinding,
    Group,
    Resident,
    ResidentAppearance,
    WorldIdentity,
    with_tags,
)
from vico.community.people import POCKET_MONEY, ResidentDraft, draw_character, draw_households
from vico.community.place_index import PlaceIndex
from vico.community.profiles import Biographer, Wardrobe, honest_character, lifestyle_of
from vico.community.relations import draw_relations
from vico.community.schedules import FIRST_DAY, DayDrafts, DaySchedules, drafts_on, planning_date, write_days
from vico.community.schooling import assign_schools, plan_care, settle_care
from vico.community.validator import check_community
from vico.community.work import assign_homes, assign_work, check_beds, employers, study_places
from vico.errors import EmptyInputError, InputError
from vico.seeds import rng
from vico.version import __version__
from vico.world.model import Category
from vico.world.world import World

__all__ = ["Author", "CommunityFinding", "ResidentDraft", "build_community", "procedural_author"]
#: For so many days, at most, schedules are written.
MOST_DAYS = 14

_PROCEDURAL = "procedural"
# Members of the largest household where nobody knows how many beds there are.
_LARGEST = 5


class Author(Protocol):
    """Somebody who writes communities: ours, or a language model's.

    An author is asked again with what the validator found in its last draft, until nothing is found or its tries are
    used up.
    """

    def __call__(self, world: World, *, residents: int, seed: int, findings: Sequence[CommunityFinding]) -> Community:
        """Write a draft for `world`, mending `findings`."""


def build_community(
    world: World,
    residents: int = 15,
    seed: int = 0,
    *,
    author: Author | None = None,
    tries: int = 3,
    date: Date | None = None,
    days: int = 1,
) -> Community:
    """People a world, and see to it that the validator has nothing to say.

    Parameters
    ----------
    world
        Where they live.
    residents
        How many, 1 or more.
    seed
        Decides who they are: the same world and seed give the same community.
    author
        Who writes; the procedural one unless given.
    tries
        How often the author may mend its draft.
    date, days
        Of the procedural author: the first day, one of five working days by seed unless given, and how many days
        everybody has a schedule for.

    Raises
    ------
    EmptyInputError
        If the world has no homes, or nowhere to meet.
    InputError
        If `residents` or `days` is not positive or too large, a day is asked of another author, or the author's last
        draft is still not grounded.
    """
    if residents < 1:
        raise InputError(f"community build: {residents} residents; ask for at least 1")
    if not 1 <= days <= MOST_DAYS:
        raise InputError(f"community build: {days} days; ask for 1 to {MOST_DAYS}")
    if author is not None and (date is not None or days != 1):
        raise InputError("community build: only the procedural author takes a date or several days; leave them out")
    write: Author = partial(procedural_author, date=date, days=days) if author is None else author
    findings: list[CommunityFinding] = []
    for _ in range(max(1, tries)):
        draft = with_tags(write(world, residents=residents, seed=seed, findings=findings), world.places)
        findings = check_community(draft, world)
        if not findings:
            return draft
    first = findings[0]
    raise InputError(
        f"community build: after {tries} drafts {len(findings)} findings are left, the first at {first.where}: "
        f"{first.what}; {first.mend}"
    )


def procedural_author(
    world: World,
    *,
    residents: int = 15,
    seed: int = 0,
    findings: Sequence[CommunityFinding] = (),
    date: Date | None = None,
    days: int = 1,
) -> Community:
    """Write a community by rule and by chance, without any language model.

    Everything is drawn from the places of the world: homes, jobs, hobbies and meeting places are those that there are
    and can be reached. It never repeats a draft: `findings` (there should be none) make it draw anew.

    Raises
    ------
    EmptyInputError
        If the world has no homes, or nowhere to meet.
    """
    day = date or FIRST_DAY + timedelta(days=int(rng(seed, "community", "day").integers(5)))
    dates = [day + timedelta(days=k) for k in range(days)]
    index = PlaceIndex(world, planning_date(day), holidays=False)
    problem: EmptyInputError | None = None
    # Few people or few places may leave somebody who is never free with others: other jobs, another try.
    for attempt in range(len(findings and [0]), 12):
        try:
            return _draft(index, residents, seed, attempt, dates)
        except EmptyInputError as error:
            problem = problem or error
    assert problem is not None
    raise problem


def _draft(index: PlaceIndex, count: int, seed: int, attempt: int, dates: Sequence[Date]) -> Community:
    def stream(name: str) -> np.random.Generator:
        return rng(seed, "community", name, attempt)

    planned = _plan(index, count, stream)
    first_day = index.on(dates[0])
    as_planned = (first_day.date, first_day.weekday) == (index.date, index.weekday)
    first = planned if as_planned else drafts_on(first_day, planned, stream)
    playmates = form_playmates(stream("playmates"), first.index, first.cares)
    meetings = form_groups(stream("groups"), first.index, first.people, playmates)
    relations = draw_relations(stream("relations"), index, planned.households, meetings, dates[0].year)
    days = write_days(planned, first, meetings, relations, dates, stream)
    groups = _groups(meetings)
    people = _residents(planned, days, meetings, stream)
    riding = [
        with_rides(
            [resident.model_copy(update={"schedule": day.items[resident.id]}) for resident in people],
            groups,
            day.index,
            lambda name: stream(f"rides/{name}"),
        )
        for day in days
    ]
    community = Community(
        producer=f"vico {__version__}",
        author=_PROCEDURAL,
        seed=seed,
        date=dates[0],
        world=WorldIdentity(name=index.world.manifest.name, digest=index.world.digest),
        residents=riding[0],
        groups=groups,
        relations=relations,
        further_days=[
            CommunityDay(
                date=day.date, absent=_absent(meetings, groups, day), schedules={r.id: r.schedule for r in residents}
            )
            for day, residents in zip(days[1:], riding[1:], strict=True)
        ],
    )
    # What is said of people has to agree with their days.
    measures = day_measures(community)
    biographer = Biographer(stream("biographies"), planned.index)
    joined = meetings_by_member(meetings)
    residents = []
    for resident, draft in zip(community.residents, planned.people, strict=True):
        draft.personality = honest_character(draft, measures[draft.id])
        household = planned.households[draft.household]
        told = {
            "personality": draft.personality,
            "lifestyle": lifestyle_of(stream(f"ways/{draft.id}"), draft, resident.schedule, measures[draft.id]),
            "biography": biographer.write(draft, household, joined.get(draft.id, [])),
        }
        residents.append(resident.model_copy(update=told))
    return community.model_copy(update={"residents": residents})


def _plan(index: PlaceIndex, count: int, stream: Callable[[str], np.random.Generator]) -> DayDrafts:
    """Draw everybody with home, school and work, as they are on a working day."""
    _, rooms = index.homes()
    check_beds(index, count)
    if not index.places([c for c in Category if c not in (Category.ACCOMMODATION, Category.TRANSIT)]):
        raise EmptyInputError(
            f"community: world {index.world.manifest.name!r} has no reachable place but homes and stops: nowhere to "
            "work or to meet; build a world with a larger --radius"
        )
    households = draw_households(
        stream("people"),
        count,
        students=bool(study_places(index)),
        guests=bool(rooms),
        workers=bool(employers(index)),
        largest=max((index.beds(home) for home in index.homes()[0]), default=0) or _LARGEST,
    )
    drafts = [s for h in households for s in h.members]
    uses: dict[str, int] = {}
    for draft in drafts:
        draw_character(stream(f"character/{draft.id}"), draft, uses)
    assign_homes(stream("homes"), index, households)
    assign_schools(stream("schools"), index, households)
    cares = plan_care(stream("care"), index, households)
    assign_work(stream("work"), index, drafts, cares)
    for care in cares:
        settle_care(index, care)
    return DayDrafts(index, households, cares)


def _residents(
    planned: DayDrafts,
    days: Sequence[DaySchedules],
    meetings: Sequence[Meeting],
    stream: Callable[[str], np.random.Generator],
) -> list[Resident]:
    """Write everybody down, with the first day on foot, but for what is said of them."""
    index, households, drafts = planned.index, planned.households, planned.people
    wardrobe = Wardrobe(stream("looks"))
    looks: dict[str, ResidentAppearance] = {}
    for household in households:
        for k, member in enumerate(household.members):
            # Children take after their parents, relatives who live together otherwise after the first of them.
            parents = [looks[adult.id] for adult in household.adults] if member.child else []
            if household.kind in ("parent", "siblings") and k > 0:
                parents = [looks[household.members[0].id]]
            looks[member.id] = wardrobe.look_of(member, parents)
    spawns = index.spawn_points([s.home for s in drafts])
    joined = meetings_by_member(meetings)
    people = []
    for draft, spawn in zip(drafts, spawns, strict=True):
        chance = stream(f"details/{draft.id}")
        # Where they go, where they meet, where their hobbies could take them, and what they pass on their own street.
        known = [draft.home, *([draft.workplace] if draft.workplace else [])]
        known += [place for day in days for place in day.frequented[draft.id]]
        known += [meeting.place.id for meeting in joined.get(draft.id, [])]
        passed = (Category.FOOD, Category.STORE, Category.OPEN, Category.TRANSIT)
        known += index.nearest(
            draft.home, *((hobby.kinds, 2) for hobby in draft.hobbies), *((category, 3) for category in passed)
        )
        people.append(
            Resident(
                id=draft.id,
                name=f"{draft.first} {draft.last}",
                age=draft.age,
                gender="female" if draft.gender == "female" else "male",
                appearance=looks[draft.id],
                occupation=draft.occupation,
                values=draft.values,
                personality=draft.character,
                hobbies=[h.name for h in draft.hobbies],
                lifestyle="",
                biography="",
                cash=_cash(chance, draft),
                household=f"household_{draft.household}",
                home=draft.home,
                workplace=draft.workplace,
                known_places=list(dict.fromkeys(known)),
                spawn=spawn,
                schedule=days[0].items[draft.id],
            )
        )
    return people


def _absent(meetings: Sequence[Meeting], groups: Sequence[Group], day: DaySchedules) -> dict[str, list[str]]:
    """Return who does not come to which group on a further day."""
    met = {(m.circle.name, m.place.id, m.start): {member.id for member in m.members} for m in day.meetings}
    found = {}
    for meeting, group in zip(meetings, groups, strict=True):
        here = met.get((meeting.circle.name, meeting.place.id, meeting.start), set())
        if absent := [member for member in group.members if member not in here]:
            found[group.id] = absent
    return found


def _cash(chance: np.random.Generator, draft: ResidentDraft) -> int:
    if draft.child:
        least, most = POCKET_MONEY
        return int(np.clip(round(float(chance.normal(3 * (draft.age - 4), 3))), least, most))
    pay = {
        "worker": draft.job.pay if draft.job else 0.4,
        "freelancer": 0.45,
        "student": 0.1,
        "retired": 0.35,
        "guest": 0.6,
    }
    level = 120 + 620 * pay[draft.status] + 2 * (draft.age - 18)
    return int(np.clip(round(float(chance.normal(level, 90))), 100, 1000))


def _groups(meetings: Sequence[Meeting]) -> list[Group]:
    """Return meetings as groups, named after their circle with as much of place and time as tells them apart."""
    forms = [
        [
            m.circle.name,
            f"{m.circle.name} at {m.place.name}",
            f"{m.circle.name} at {m.place.name}, {clock_of(m.start * 60)[:5]}",
            f"{m.circle.name} at {m.place.name}, {clock_of(m.start * 60)[:5]} ({m.place.id})",
        ]
        for m in meetings
    ]
    counts = [Counter(names) for names in zip(*forms, strict=True)]
    return [
        Group(
            id=f"group_{k}",
            name=next(name for name, count in zip(forms[k], counts, strict=True) if count[name] == 1),
            description=m.circle.description,
            activity=m.circle.activity,
            place=m.place.id,
            members=[s.id for s in m.members],
            start=clock_of(m.start * 60),
            end=clock_of(m.end * 60),
        )
        for k, m in enumerate(meetings)
    ]
