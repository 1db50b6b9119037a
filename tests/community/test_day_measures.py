"""Do people's days show their character, and do the words for it agree with what they do?"""

from __future__ import annotations

from dataclasses import asdict
from datetime import date

import numpy as np
import pytest

from toytown import PLACES, make_world
from vico.community import Community, build_community, check_community
from vico.community.catalogue import claims, trait_words, ways
from vico.community.day import character_findings, day_measures
from vico.community.model import ActivityTag, Resident
from vico.community.place_index import PlaceIndex
from vico.community.work import staff_capacity
from vico.errors import EmptyInputError
from vico.world.model import Category
from vico.world.world import World

Measured = list[tuple[Resident, dict[str, float]]]


@pytest.fixture(scope="module")
def adults(town: World) -> Measured:
    found: Measured = []
    for seed in range(3):
        community = build_community(town, residents=90, seed=seed)
        measures = day_measures(community)
        found += [(r, asdict(measures[r.id])) for r in community.residents if r.age >= 18]
    return found


@pytest.mark.parametrize("seed", range(3))
def test_no_word_for_anybody_is_contradicted_by_their_days(town: World, seed: int) -> None:
    community = build_community(town, residents=40, seed=seed, days=1 + seed % 3)
    assert character_findings(community) == []


def test_a_homebody_who_is_out_all_day_is_found(community: Community) -> None:
    measures = day_measures(community)
    out = max(community.residents, key=lambda r: measures[r.id].out)
    assert measures[out.id].out > 3
    named = out.model_copy(update={"lifestyle": "Keeps regular hours; would rather stay in and likes a tidy flat."})
    residents = [named if r.id == out.id else r for r in community.residents]
    found = character_findings(community.model_copy(update={"residents": residents}))
    assert [f.where for f in found] == [f"{out.id}.lifestyle"]
    assert "would rather stay in" in found[0].what


def test_claims_are_about_words_that_are_used() -> None:
    words = {word for pair in trait_words().values() for word in (*pair.high, *pair.low)} | {way.text for way in ways()}
    words |= {"Early riser", "Night owl", "Works late and sleeps in", "Keeps regular hours"}
    assert {word for claim in claims() for word in claim.says} <= words


def test_the_outgoing_spend_more_hours_with_others(adults: Measured) -> None:
    company = [m["company"] for _, m in adults]
    assert np.corrcoef(company, [r.personality.extraversion for r, _ in adults])[0, 1] > 0.2


def test_the_ambitious_work_longer(adults: Measured) -> None:
    working = [(r, m["work"]) for r, m in adults if m["work"] > 4]
    driven = [r.personality.conscientiousness + 0.3 * ("achievement" in r.values) for r, _ in working]
    assert np.corrcoef(driven, [hours for _, hours in working])[0, 1] > 0.08


def test_those_who_care_for_others_visit_and_help_more(adults: Measured) -> None:
    caring = [m["visiting"] for r, m in adults if "benevolence" in r.values]
    others = [m["visiting"] for r, m in adults if "benevolence" not in r.values]
    assert np.mean(caring) > 2 * np.mean(others)


def test_who_enjoys_life_eats_out_more_than_who_counts_pennies(adults: Measured) -> None:
    pleased = [m["meals_out"] for r, m in adults if "hedonism" in r.values and "security" not in r.values]
    careful = [m["meals_out"] for r, m in adults if "security" in r.values and "hedonism" not in r.values]
    assert np.mean(pleased) > 1.1 * np.mean(careful)


def test_two_households_of_one_house_are_no_company(community: Community) -> None:
    """At home, company is visitors: whoever never goes out and has none has no company."""
    measures = day_measures(community)
    for resident in community.residents:
        if all(item.place == resident.home for item in resident.schedule):
            assert measures[resident.id].company == 0.0


def test_places_employ_no_more_than_they_have_room_for(helsinki: World) -> None:
    community = build_community(helsinki, residents=150, seed=5)
    index = PlaceIndex(helsinki, community.date)
    staff: dict[str, int] = {}
    for r in community.residents:
        if r.workplace is not None and r.age >= 18 and not r.occupation.startswith("student"):
            staff[r.workplace] = staff.get(r.workplace, 0) + 1
    assert [p for p, n in staff.items() if n > staff_capacity(index, index.place_by_id[p])] == []
    # Shops with two or more are staffed while they are open.
    assert max(staff.values()) >= 2


def test_more_staff_than_a_place_has_room_for_is_found(town: World) -> None:
    community = build_community(town, residents=60, seed=1)
    cafe = next(p for p in town.places if p.kind == "cafe")
    crowd = [
        r.model_copy(update={"workplace": cafe.id, "occupation": "barista"}) if r.age >= 18 else r
        for r in community.residents
    ]
    found = check_community(community.model_copy(update={"residents": crowd}), town)
    assert any(f.where == f"{cafe.id}.staff" and "has room for 8" in f.what for f in found)


def test_shops_with_two_hands_are_staffed_while_open(town: World) -> None:
    covered = []
    for seed in range(4):
        community = build_community(town, residents=60, seed=seed)
        index = PlaceIndex(town, community.date)
        for place in (p for p in town.places if p.category in ("store", "food")):
            staff = [r for r in community.residents if r.workplace == place.id]
            if len(staff) < 2:
                continue
            there = np.zeros(24 * 60, bool)
            for item in (i for r in staff for i in r.schedule if i.place == place.id):
                there[_minute(item.start) : _minute(item.end) + 1] = True
            spans = [(max(a, 6 * 60), min(b, 23 * 60)) for a, b in index.hours(place)]
            covered.append(np.mean(np.concatenate([there[a:b] for a, b in spans])))
    assert np.mean(covered) > 0.85


def _minute(clock: str) -> int:
    return int(clock[:2]) * 60 + int(clock[3:5])


def test_too_many_for_the_beds_are_refused_with_how_many_there_is_room_for(helsinki: World) -> None:
    index = PlaceIndex(helsinki, date(2025, 6, 2))
    beds = sum(index.beds(place) for homes in index.homes() for place in homes)
    with pytest.raises(EmptyInputError, match=rf"{beds} beds.*ask for at most {int(0.9 * beds)} residents"):
        build_community(helsinki, residents=1000)
    assert len(build_community(helsinki, residents=int(0.9 * beds)).residents) == int(0.9 * beds)


def test_sunday_closing_is_heeded_by_visitors() -> None:
    closed = tuple((*p[:3], "Mo-Sa 09:00-20:00") if p[1] == "store" else p for p in PLACES)
    world = make_world(closed)
    community = build_community(world, residents=40, seed=2, date=date(2025, 6, 8))
    stores = {p.id for p in world.places if p.category == "store"}
    assert [i.activity for r in community.residents for i in r.schedule if i.place in stores] == []
    assert any(i.tag is not ActivityTag.SHOP for r in community.residents for i in r.schedule)


def test_the_nearest_places_of_some_kinds_are_those_of_the_whole_order(helsinki: World) -> None:
    index = PlaceIndex(helsinki, date(2025, 6, 2))
    for home in [place.id for place in index.homes()[0]][::40]:
        order = index.by_nearness(home)
        food = [place.id for place in order if place.category is Category.FOOD][:3]
        bars = [place.id for place in order if place.kind in ("bar", "pub")][:2]
        assert index.nearest(home, (Category.FOOD, 3), (("pub", "bar"), 2)) == food + bars
        everything = [place.id for place in order if place.category is Category.OPEN]
        assert index.nearest(home, (Category.OPEN, 10_000), (("none such",), 2)) == everything
