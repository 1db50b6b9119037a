"""Are the people that the procedural author writes grounded, varied and believable?"""

from __future__ import annotations

import os
import subprocess
import sys
from collections import Counter
from datetime import date
from pathlib import Path

import numpy as np
import pytest

from toytown import PLACES, make_world
from vico.assets import people
from vico.clock import seconds_of_day
from vico.community import Community, build_community, check_community, digest_of, procedural_author
from vico.community.catalogue import names as known_names
from vico.community.model import ItemType
from vico.community.place_index import PlaceIndex
from vico.errors import EmptyInputError, InputError
from vico.world.model import Category
from vico.world.world import World

_ALWAYS = ("accommodation", "open", "transit")


@pytest.mark.parametrize("seed", range(8))
def test_the_validator_finds_nothing_in_any_draft(town: World, seed: int) -> None:
    assert check_community(procedural_author(town, residents=15, seed=seed), town) == []


def test_helsinki_is_peopled_without_a_finding(helsinki: World) -> None:
    assert check_community(procedural_author(helsinki, residents=15, seed=0), helsinki) == []


@pytest.mark.parametrize("count", [1, 2, 3, 7, 60])
def test_any_number_of_residents_is_possible(town: World, count: int) -> None:
    assert len(build_community(town, residents=count, seed=1).residents) == count


@pytest.mark.parametrize("hours", ["08:00-10:30, 11:00-16:00", "09:00-13:00, 16:00-20:00", "06:00-08:30, 17:00-02:00"])
def test_shifts_heed_midday_closings(hours: str) -> None:
    world = make_world(tuple((*p[:3], f"Mo-Su {hours}") if p[1] not in _ALWAYS else p for p in PLACES))
    for seed in range(3):
        assert check_community(procedural_author(world, residents=30, seed=seed), world) == []


def test_as_many_as_there_are_beds_for_are_peopled_without_a_finding(helsinki: World) -> None:
    community = build_community(helsinki, residents=180, seed=3)
    assert len({r.name for r in community.residents}) == 180
    sizes = [len(g.members) for g in community.groups]
    assert min(sizes) >= 2
    assert np.median(sizes) <= 8


def test_names_are_unique(town: World) -> None:
    names = [r.name for r in build_community(town, residents=60, seed=2).residents]
    assert len(set(names)) == 60


def test_name_lists_hold_no_name_twice() -> None:
    assert [
        name
        for names in (known_names().female, known_names().male, known_names().last)
        for name, n in Counter(names).items()
        if n > 1
    ] == []


def test_occupations_are_varied(community: Community) -> None:
    assert len({r.occupation for r in community.residents}) >= 12


def test_ages_span_childhood_and_old_age(town: World) -> None:
    ages = [r.age for seed in range(3) for r in build_community(town, residents=60, seed=seed).residents]
    assert min(ages) <= 7
    assert max(ages) >= 80
    assert all(5 <= age <= 90 for age in ages)


def test_no_two_biographies_share_a_sentence(community: Community) -> None:
    sentences = Counter(s for r in community.residents for s in r.biography.split(". "))
    assert [s for s, n in sentences.items() if n > 1] == []


def test_biographies_have_three_to_five_sentences(community: Community) -> None:
    lengths = {r.name: r.biography.count(". ") + 1 for r in community.residents}
    assert {n: k for n, k in lengths.items() if not 3 <= k <= 5} == {}


def test_templates_leave_no_braces(community: Community) -> None:
    assert [r.biography for r in community.residents if "{" in r.biography or "}" in r.biography] == []


def test_groups_are_three_to_six_for_fifteen_people(town: World) -> None:
    counts = [len(build_community(town, residents=15, seed=s).groups) for s in range(6)]
    assert all(3 <= n <= 6 for n in counts), counts


def test_meetings_bring_all_members_to_one_place_at_one_time(community: Community) -> None:
    people_by_id = community.resident_by_id
    for group in community.groups:
        middle = (seconds_of_day(group.start) + seconds_of_day(group.end)) // 2
        assert {people_by_id[m].item_at(middle).place for m in group.members} == {group.place}


def test_people_leave_home_at_different_times(community: Community) -> None:
    leave = {next((i.start for i in r.schedule if i.type == "commute"), None) for r in community.residents}
    assert len(leave) >= 8


def test_everybody_sleeps_six_hours_and_eats_twice(community: Community) -> None:
    for r in community.residents:
        asleep = sum(seconds_of_day(i.end) - seconds_of_day(i.start) for i in r.schedule if i.type == "sleep")
        assert asleep >= 6 * 3600 - 60, r.name
        assert sum(i.type == "meal" for i in r.schedule) >= 2, r.name


def test_workers_spend_six_hours_at_their_workplace(town: World) -> None:
    people = build_community(town, residents=40, seed=3).residents
    parents = {r.household for r in people if r.age < 10}
    for r in people:
        # Who fetches small children may work part-time.
        if r.workplace is None or r.occupation.startswith("student") or r.age < 18 or r.household in parents:
            continue
        hours = (
            sum(seconds_of_day(i.end) - seconds_of_day(i.start) for i in r.schedule if i.place == r.workplace) / 3600
        )
        assert hours >= 5.5, (r.name, r.occupation, hours)


def test_couples_grow_up_before_they_meet(town: World) -> None:
    community = build_community(town, residents=60, seed=4)
    ages = {r.id: r.age for r in community.residents}
    for relation in community.relations:
        if "partners" in relation.note:
            assert community.date.year - relation.since <= min(ages[i] for i in relation.between) - 16


def test_every_appearance_makes_a_body_record(town: World) -> None:
    for r in build_community(town, residents=60, seed=5).residents:
        assert people.Appearance.from_dict(r.appearance).age == r.age


def test_spawn_points_keep_two_metres_apart(town: World) -> None:
    points = np.array([r.spawn for r in build_community(town, residents=60, seed=6).residents])
    gaps = np.linalg.norm(points[:, None] - points[None], axis=2) + 1e9 * np.eye(len(points))
    assert gaps.min() >= 2.0


def test_different_seeds_give_different_people(town: World) -> None:
    assert len({build_community(town, residents=3, seed=s).residents[0].name for s in range(5)}) > 1


def test_the_same_seed_gives_the_same_bytes_in_a_fresh_process(community: Community) -> None:
    code = (
        "from toytown import make_world; from vico.community import build_community, digest_of;"
        "print(digest_of(build_community(make_world(), residents=15, seed=0)))"
    )
    root = Path(__file__).parents[2]
    path = os.pathsep.join([str(root / "src"), str(root / "tests")])
    environment = {**os.environ, "PYTHONPATH": path, "PYTHONHASHSEED": "77"}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == digest_of(community)


def test_a_world_without_homes_is_refused() -> None:
    world = make_world(tuple(p for p in PLACES if p[1] != "accommodation"))
    with pytest.raises(EmptyInputError, match="no reachable accommodation"):
        build_community(world)


def test_a_world_of_homes_only_is_refused() -> None:
    world = make_world(tuple(p for p in PLACES if p[1] == "accommodation"))
    with pytest.raises(EmptyInputError, match="nowhere to work or to meet"):
        build_community(world)


def test_hotels_alone_can_house_people() -> None:
    world = make_world(tuple(p for p in PLACES if p[2] != "apartments"))
    assert len(build_community(world, residents=5).residents) == 5


def test_nobody_lives_in_no_community(town: World) -> None:
    with pytest.raises(InputError, match="at least 1"):
        build_community(town, residents=0)


def test_nurses_need_a_clinic() -> None:
    world = make_world(tuple(p for p in PLACES if p[2] != "clinic"))
    jobs = {r.occupation for seed in range(4) for r in build_community(world, residents=30, seed=seed).residents}
    assert not jobs & {"nurse", "physician"}


def test_an_author_is_told_what_to_mend(town: World, community: Community) -> None:
    heard: list[list[str]] = []

    def careless(world: World, *, residents: int, seed: int, findings: object) -> Community:
        assert isinstance(findings, list)
        heard.append([f.where for f in findings])
        if findings:
            return community
        poor = community.residents[0].model_copy(update={"cash": 5})
        return community.model_copy(update={"residents": [poor, *community.residents[1:]]})

    assert build_community(town, author=careless) is community
    assert heard == [[], ["resident_0.cash"]]


def test_homes_are_dwellings_for_all_but_guests(town: World, community: Community) -> None:
    kinds = {
        town.place_by_id[r.home].kind
        for r in community.residents
        if not r.occupation.startswith(("visit", "tour", "trav"))
    }
    assert kinds == {"apartments"}
    assert {town.place_by_id[r.home].category for r in community.residents} == {Category.ACCOMMODATION}


def test_everybody_has_a_bed_at_home(helsinki: World) -> None:
    index, people = PlaceIndex(helsinki, date(2025, 6, 2)), procedural_author(helsinki, residents=25, seed=2).residents
    crowded = [h for h, n in Counter(r.home for r in people).items() if n > index.beds(index.place_by_id[h])]
    assert crowded == []


def test_nobody_is_called_a_night_owl_who_rises_early_nor_an_early_riser_who_sleeps_in(town: World) -> None:
    words: Counter[str] = Counter()
    for seed in range(6):
        for resident in procedural_author(town, residents=15, seed=seed).residents:
            word = resident.lifestyle.split(";")[0]
            rises = min(seconds_of_day(item.end) for item in resident.schedule if item.type is ItemType.SLEEP)
            words[word] += 1
            assert (word == "Early riser") == (rises <= 6.5 * 3600), (resident.name, word, rises)
            assert word not in ("Night owl", "Works late and sleeps in") or rises >= 7.5 * 3600, (resident.name, word)
    assert words.keys() >= {"Early riser", "Keeps regular hours", "Night owl"}
