"""Do children live as children do: with adults, at school, and, while small, never alone?"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import pytest

from toytown import PLACES, make_world
from vico.community import Community, Resident, check_community, procedural_author
from vico.community.model import RelationKind
from vico.community.people import ALONE_FROM, GROWN_UP
from vico.rules import walk_speed
from vico.world.world import World

_SCHOOLS = (
    ("Lime Street School", "office", "school", None),
    ("Snail House", "office", "kindergarten", "Mo-Fr 07:00-17:00"),
    ("Sand Pit", "open", "playground", None),
)


@pytest.fixture(scope="module")
def school_town() -> World:
    return make_world(PLACES + _SCHOOLS)


@pytest.fixture(scope="module")
def families(school_town: World) -> Community:
    return procedural_author(school_town, residents=90, seed=5)


def children(community: Community) -> list[Resident]:
    return [r for r in community.residents if r.age < GROWN_UP]


def change(community: Community, child: Resident, **fields: object) -> Community:
    people = [r.model_copy(update=fields) if r.id == child.id else r for r in community.residents]
    return community.model_copy(update={"residents": people})


def small(community: Community) -> Resident:
    return next(r for r in children(community) if r.age < ALONE_FROM and r.workplace is not None)


def test_a_seventh_of_the_people_are_children_of_all_ages(school_town: World) -> None:
    people = [r for seed in range(3) for r in procedural_author(school_town, residents=90, seed=seed).residents]
    young = [r.age for r in people if r.age < GROWN_UP]
    assert 0.11 <= len(young) / len(people) <= 0.19
    assert {min(young), max(young)} == {5, 17}


def test_every_draft_with_children_is_without_a_finding(school_town: World, families: Community) -> None:
    assert check_community(families, school_town) == []
    assert all(r.workplace for r in children(families))


def test_small_children_are_taken_to_school_and_fetched(families: Community) -> None:
    child = small(families)
    ways = {(way.start, then.place) for way, then in pairwise(child.schedule) if way.type == "commute"}
    family = [r for r in families.residents if r.household == child.household and r.age >= ALONE_FROM]
    for start, goal in ways:
        assert any((way.start, then.place) == (start, goal) for r in family for way, then in pairwise(r.schedule))
    assert any(item.activity.startswith("See ") for r in family for item in r.schedule)


def test_friends_of_children_are_of_their_age(families: Community) -> None:
    ages = {r.id: r.age for r in families.residents}
    pairs = [[ages[i] for i in r.between] for r in families.relations if r.kind is RelationKind.FRIEND]
    young = [pair for pair in pairs if min(pair) < GROWN_UP]
    assert len(young) > 5
    assert all(abs(a - b) <= 7 and max(a, b) < GROWN_UP for a, b in young)


def test_where_there_is_no_school_children_learn_at_home(town: World) -> None:
    pupils = children(procedural_author(town, residents=60, seed=2))
    assert {r.occupation for r in pupils} == {"home-schooled pupil"}
    assert all(any(i.tag == "study" and i.place == r.home for i in r.schedule) for r in pupils)


def alone(c: Community) -> Community:
    return change(c, small(c), household="household_999")


def at_work(c: Community) -> Community:
    return change(c, children(c)[0], occupation="barista")


def truant(c: Community) -> Community:
    child = children(c)[0]
    lazy = [i.model_copy(update={"tag": "leisure"}) if i.tag == "study" else i for i in child.schedule]
    return change(c, child, schedule=lazy)


def rich(c: Community) -> Community:
    return change(c, children(c)[0], cash=400)


def left_to_itself(c: Community) -> Community:
    child = small(c)
    for r in c.residents:
        if r.household == child.household and r.age >= ALONE_FROM:
            walk = [i.model_copy(update={"start": i.start[:-1] + "1"}) for i in r.schedule]
            c = change(c, r, schedule=walk)
    return c


def too_young(c: Community) -> Community:
    return change(c, small(c), age=3)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (alone, "lives with no grown-up relative"),
        (at_work, "children don't work"),
        (truant, "h of lessons on a school day"),
        (rich, "not in 2..60"),
        (left_to_itself, "goes out alone"),
        (too_young, "is too young"),
    ],
)
def test_the_validator_sees_what_is_no_childhood(
    school_town: World, families: Community, spoil: Callable[[Community], Community], words: str
) -> None:
    assert any(words in finding.what for finding in check_community(spoil(families), school_town))


def test_the_old_walk_slowly() -> None:
    assert walk_speed(6) == walk_speed(40) == 1.0
    assert walk_speed(75) > walk_speed(85) > walk_speed(90) > 0.7
