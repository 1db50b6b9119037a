"""Peopling a world: the procedural author, and the loop in which any author answers to the validator."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date, timedelta
from typing import Protocol

import numpy as np

from vico import __version__
from vico.community.biography import Biographer, lifestyle_of
from vico.community.ground import Ground
from vico.community.groups import Meeting, form_groups
from vico.community.model import Appearance, Community, Group, Resident, WorldIdentity, clock_of
from vico.community.people import Household, Sketch, Wardrobe, draw_character, draw_households
from vico.community.relations import draw_relations
from vico.community.schedules import DayWriter
from vico.community.validator import Finding, check_community
from vico.community.work import assign_homes, assign_work, employers, study_places
from vico.errors import EmptyInputError, InputError
from vico.world.folder import World
from vico.world.model import Category
from vico.world.seeds import rng

#: A Monday; the day of a community is one of the five from it on.
FIRST_DAY = date(2025, 6, 2)

_PROCEDURAL = "procedural"


class Author(Protocol):
    """Somebody who writes communities: ours, or a language model's.

    An author is asked again with what the validator found in its last draft, until nothing is found or its tries are
    used up.
    """

    def __call__(self, world: World, *, residents: int, seed: int, findings: Sequence[Finding]) -> Community:
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
    findings: list[Finding] = []
    for _ in range(max(1, tries)):
        draft = write(world, residents=residents, seed=seed, findings=findings)
        findings = check_community(draft, world)
        if not findings:
            return draft
    first = findings[0]
    raise InputError(
        f"community build: after {tries} drafts {len(findings)} findings are left, the first at {first.where}: "
        f"{first.what}; {first.mend}"
    )


def procedural_author(
    world: World, *, residents: int = 15, seed: int = 0, findings: Sequence[Finding] = ()
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
    ground = Ground(world, day.weekday())
    problem: EmptyInputError | None = None
    # Few people or few places may leave somebody who is never free with others: other jobs, another try.
    for attempt in range(len(findings and [0]), 12):
        try:
            return _draft(ground, residents, seed, attempt, day)
        except EmptyInputError as error:
            problem = problem or error
    assert problem is not None
    raise problem


def _draft(ground: Ground, count: int, seed: int, attempt: int, day: date) -> Community:
    def stream(name: str) -> np.random.Generator:
        return rng(seed, "community", name, attempt)

    world = ground.world
    _, rooms = ground.homes()
    if not ground.places([c for c in Category if c not in (Category.ACCOMMODATION, Category.TRANSIT)]):
        raise EmptyInputError(
            f"community: world {world.manifest.name!r} has no reachable place but homes and stops: nowhere to "
            "work or to meet; build a world with a larger --radius"
        )
    households = draw_households(
        stream("people"),
        count,
        students=bool(study_places(ground)),
        guests=bool(rooms),
        workers=bool(employers(ground)),
    )
    sketches = [s for h in households for s in h.members]
    uses: dict[str, int] = {}
    for sketch in sketches:
        draw_character(rng(seed, "community", "character", attempt, sketch.id), sketch, uses)
    assign_homes(stream("homes"), ground, households)
    assign_work(stream("work"), ground, sketches)
    meetings = form_groups(stream("groups"), ground, sketches)
    schedules, haunts = DayWriter(stream("days"), ground).write(households, meetings)
    relations = draw_relations(stream("relations"), ground, households, meetings, day.year)
    biographer = Biographer(stream("biographies"), ground)
    looks = _looks(stream("looks"), households)
    spawns = ground.spawn_points([s.home for s in sketches])
    people = []
    for sketch, spawn in zip(sketches, spawns, strict=True):
        chance = rng(seed, "community", "details", attempt, sketch.id)
        mine = [m for m in meetings if any(x is sketch for x in m.members)]
        assert sketch.personality is not None
        people.append(
            Resident(
                id=sketch.id,
                name=f"{sketch.first} {sketch.last}",
                age=sketch.age,
                gender="female" if sketch.gender == "female" else "male",
                appearance=looks[sketch.id],
                occupation=sketch.occupation,
                values=sketch.values,
                personality=sketch.personality,
                hobbies=[h.name for h in sketch.hobbies],
                lifestyle=lifestyle_of(chance, sketch),
                biography=biographer.write(sketch, households[sketch.household], mine),
                cash=_cash(chance, sketch),
                home=sketch.home,
                workplace=sketch.workplace,
                known_places=_known(ground, sketch, haunts[sketch.id], mine),
                spawn=spawn,
                schedule=schedules[sketch.id],
            )
        )
    return Community(
        producer=f"vico {__version__}",
        author=_PROCEDURAL,
        seed=seed,
        date=day,
        world=WorldIdentity(name=world.manifest.name, digest=world.digest),
        residents=people,
        groups=_groups(meetings),
        relations=relations,
    )


def _looks(chance: np.random.Generator, households: Sequence[Household]) -> dict[str, Appearance]:
    wardrobe = Wardrobe(chance)
    looks: dict[str, Appearance] = {}
    for household in households:
        for k, sketch in enumerate(household.members):
            related = household.kind in ("parent", "siblings") and k > 0
            looks[sketch.id] = wardrobe.look_of(sketch, looks[household.members[0].id] if related else None)
    return looks


def _cash(chance: np.random.Generator, sketch: Sketch) -> int:
    pay = {
        "worker": sketch.job.pay if sketch.job else 0.4,
        "freelancer": 0.45,
        "student": 0.1,
        "retired": 0.35,
        "guest": 0.6,
    }
    level = 120 + 620 * pay[sketch.status] + 2 * (sketch.age - 18)
    return int(np.clip(round(float(chance.normal(level, 90))), 100, 1000))


def _known(ground: Ground, sketch: Sketch, haunts: Sequence[str], mine: Sequence[Meeting]) -> list[str]:
    """Where they go, where they meet, where their hobbies could take them, and what they pass on their own street."""
    known = [sketch.home, *([sketch.workplace] if sketch.workplace else []), *haunts, *(m.place.id for m in mine)]
    near = sorted(ground.places(), key=lambda p: (round(ground.metres(sketch.home, p.id), 3), p.id))
    for hobby in sketch.hobbies:
        known += [p.id for p in near if p.kind in hobby.kinds][:2]
    for category in (Category.FOOD, Category.STORE, Category.OPEN, Category.TRANSIT):
        known += [p.id for p in near if p.category is category][:3]
    return list(dict.fromkeys(known))


def _groups(meetings: Sequence[Meeting]) -> list[Group]:
    names = [m.circle.name for m in meetings]
    return [
        Group(
            id=f"group_{k}",
            name=m.circle.name if names.count(m.circle.name) == 1 else f"{m.circle.name} at {m.place.name}",
            description=m.circle.description,
            activity=m.circle.activity,
            place=m.place.id,
            members=[s.id for s in m.members],
            start=clock_of(m.start * 60),
            end=clock_of(m.end * 60),
        )
        for k, m in enumerate(meetings)
    ]


__all__ = ["Author", "Finding", "Sketch", "build_community", "procedural_author"]
