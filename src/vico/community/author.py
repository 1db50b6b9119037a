"""Peopling a world: the procedural author, and the loop in which any author answers to the validator."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from datetime import date, timedelta
from typing import Protocol

import numpy as np

from vico.clock import clock_of
from vico.community.biography import Biographer, lifestyle_of
from vico.community.childhood import POCKET_MONEY
from vico.community.findings import CommunityFinding
from vico.community.groups import Meeting, form_groups, meetings_by_member
from vico.community.households import draw_households
from vico.community.model import Community, Group, Resident, ResidentAppearance, WorldIdentity
from vico.community.people import Household, ResidentDraft, draw_character
from vico.community.place_index import PlaceIndex
from vico.community.playmates import form_playmates
from vico.community.relations import draw_relations
from vico.community.rides import with_rides
from vico.community.schedules import DayWriter
from vico.community.schooling import assign_schools, plan_care, settle_care
from vico.community.tags import with_tags
from vico.community.validator import check_community
from vico.community.wardrobe import Wardrobe
from vico.community.work import assign_homes, assign_work, employers, study_places
from vico.errors import EmptyInputError, InputError
from vico.seeds import rng
from vico.version import __version__
from vico.world.folder import World
from vico.world.model import Category

#: A Monday; the day of a community is one of the five from it on.
FIRST_DAY = date(2025, 6, 2)

_PROCEDURAL = "procedural"


class Author(Protocol):
    """Somebody who writes communities: ours, or a language model's.

    An author is asked again with what the validator found in its last draft, until nothing is found or its tries are
    used up.
    """

    def __call__(self, world: World, *, residents: int, seed: int, findings: Sequence[CommunityFinding]) -> Community:
        """Write a draft for `world`, mending `findings`."""


def build_community(
    world: World, residents: int = 15, seed: int = 0, *, author: Author | None = None, tries: int = 3
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

    Raises
    ------
    EmptyInputError
        If the world has no homes, or nowhere to meet.
    InputError
        If `residents` is not positive, or the author's last draft is still not grounded.
    """
    if residents < 1:
        raise InputError(f"community build: {residents} residents; ask for at least 1")
    write: Author = procedural_author if author is None else author
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
    world: World, *, residents: int = 15, seed: int = 0, findings: Sequence[CommunityFinding] = ()
) -> Community:
    """Write a community by rule and by chance, without any language model.

    Everything is drawn from the places of the world: homes, jobs, hobbies and meeting places are those that there are
    and can be reached. It never repeats a draft: `findings` (there should be none) make it draw anew.

    Raises
    ------
    EmptyInputError
        If the world has no homes, or nowhere to meet.
    """
    day = FIRST_DAY + timedelta(days=int(rng(seed, "community", "day").integers(5)))
    index = PlaceIndex(world, day.weekday())
    problem: EmptyInputError | None = None
    # Few people or few places may leave somebody who is never free with others: other jobs, another try.
    for attempt in range(len(findings and [0]), 12):
        try:
            return _draft(index, residents, seed, attempt, day)
        except EmptyInputError as error:
            problem = problem or error
    assert problem is not None
    raise problem


def _draft(index: PlaceIndex, count: int, seed: int, attempt: int, day: date) -> Community:
    def stream(name: str) -> np.random.Generator:
        return rng(seed, "community", name, attempt)

    world = index.world
    _, rooms = index.homes()
    if not index.places([c for c in Category if c not in (Category.ACCOMMODATION, Category.TRANSIT)]):
        raise EmptyInputError(
            f"community: world {world.manifest.name!r} has no reachable place but homes and stops: nowhere to "
            "work or to meet; build a world with a larger --radius"
        )
    households = draw_households(
        stream("people"),
        count,
        students=bool(study_places(index)),
        guests=bool(rooms),
        workers=bool(employers(index)),
    )
    drafts = [s for h in households for s in h.members]
    uses: dict[str, int] = {}
    for draft in drafts:
        draw_character(rng(seed, "community", "character", attempt, draft.id), draft, uses)
    assign_homes(stream("homes"), index, households)
    assign_schools(stream("schools"), index, households)
    cares = plan_care(stream("care"), index, households)
    assign_work(stream("work"), index, drafts, cares)
    for care in cares:
        settle_care(index, care)
    meetings = form_groups(stream("groups"), index, drafts, form_playmates(stream("playmates"), index, cares))
    schedules, frequented = DayWriter(stream("days"), index).write(households, meetings)
    relations = draw_relations(stream("relations"), index, households, meetings, day.year)
    biographer = Biographer(stream("biographies"), index)
    looks = _looks(stream("looks"), households)
    spawns = index.spawn_points([s.home for s in drafts])
    joined = meetings_by_member(meetings)
    people = []
    for draft, spawn in zip(drafts, spawns, strict=True):
        chance = rng(seed, "community", "details", attempt, draft.id)
        mine = joined.get(draft.id, [])
        assert draft.personality is not None
        people.append(
            Resident(
                id=draft.id,
                name=f"{draft.first} {draft.last}",
                age=draft.age,
                gender="female" if draft.gender == "female" else "male",
                appearance=looks[draft.id],
                occupation=draft.occupation,
                values=draft.values,
                personality=draft.personality,
                hobbies=[h.name for h in draft.hobbies],
                lifestyle=lifestyle_of(chance, draft, schedules[draft.id]),
                biography=biographer.write(draft, households[draft.household], mine),
                cash=_cash(chance, draft),
                household=f"household_{draft.household}",
                home=draft.home,
                workplace=draft.workplace,
                known_places=_known(index, draft, frequented[draft.id], mine),
                spawn=spawn,
                schedule=schedules[draft.id],
            )
        )
    groups = _groups(meetings)
    people = with_rides(people, groups, index, lambda name: rng(seed, "community", "rides", attempt, name))
    return Community(
        producer=f"vico {__version__}",
        author=_PROCEDURAL,
        seed=seed,
        date=day,
        world=WorldIdentity(name=world.manifest.name, digest=world.digest),
        residents=people,
        groups=groups,
        relations=relations,
    )


def _looks(chance: np.random.Generator, households: Sequence[Household]) -> dict[str, ResidentAppearance]:
    wardrobe = Wardrobe(chance)
    looks: dict[str, ResidentAppearance] = {}
    for household in households:
        for k, draft in enumerate(household.members):
            parents = [looks[adult.id] for adult in household.adults] if draft.child else []
            if household.kind in ("parent", "siblings") and k > 0:
                parents = [looks[household.members[0].id]]
            looks[draft.id] = wardrobe.look_of(draft, parents)
    return looks


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


def _known(index: PlaceIndex, draft: ResidentDraft, frequented: Sequence[str], mine: Sequence[Meeting]) -> list[str]:
    """Where they go, where they meet, where their hobbies could take them, and what they pass on their own street."""
    known = [draft.home, *([draft.workplace] if draft.workplace else []), *frequented, *(m.place.id for m in mine)]
    near = index.by_nearness(draft.home)
    for hobby in draft.hobbies:
        known += [p.id for p in near if p.kind in hobby.kinds][:2]
    for category in (Category.FOOD, Category.STORE, Category.OPEN, Category.TRANSIT):
        known += [p.id for p in near if p.category is category][:3]
    return list(dict.fromkeys(known))


def _groups(meetings: Sequence[Meeting]) -> list[Group]:
    return [
        Group(
            id=f"group_{k}",
            name=name,
            description=m.circle.description,
            activity=m.circle.activity,
            place=m.place.id,
            members=[s.id for s in m.members],
            start=clock_of(m.start * 60),
            end=clock_of(m.end * 60),
        )
        for k, (m, name) in enumerate(zip(meetings, _group_names(meetings), strict=True))
    ]


def _group_names(meetings: Sequence[Meeting]) -> list[str]:
    """Name groups after their circle, with as much of place and time as tells them apart; chains share names."""
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
    return [next(name for name, count in zip(mine, counts, strict=True) if count[name] == 1) for mine in forms]


__all__ = ["Author", "CommunityFinding", "ResidentDraft", "build_community", "procedural_author"]
