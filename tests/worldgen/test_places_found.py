"""Places of other sources beside the map's, in central Helsinki: same, closed, refined, added; never Google's words."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import EXTRACT
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmData, read_osm
from vico.geo.places import FoundPlace
from vico.world.model import Category, Dropped, Entrance, Place
from vico.world.world import World
from vico.worldgen.facts.named_places import NamedPlace, named_places
from vico.worldgen.facts.site import site_facts
from vico.worldgen.places.stage import compare_places, likeness, meaning_of, places_from_osm


@pytest.fixture(scope="module")
def osm() -> OsmData:
    return read_osm(EXTRACT, LocalFrame(60.1690, 24.9435), 150.0)


def _found(name: str, xy: tuple[float, float], kind: str = "coffee_shop", **more: object) -> FoundPlace:
    fields = {"id": f"overture:{name}", "source": "overture", "attribution": "Overture"} | more
    return FoundPlace(name=name, kind=kind, xy=xy, **fields)  # type: ignore[arg-type]


def _placed(osm: OsmData, world: World, found: list[FoundPlace]) -> tuple[list[Place], list[Entrance], dict[str, str]]:
    dropped: list[Dropped]
    places, doors, dropped = places_from_osm(
        site_facts(osm),
        buildings=world.buildings,
        walkable=world.walkable,
        height=world.height,
        roads=world.roads,
        found=found,
    )
    return places, doors, {what.id: what.reason for what in dropped}


def _in_a_building(world: World) -> tuple[float, float]:
    """A point a metre inside the wall of an accessible building."""
    door = max(world.entrances, key=lambda door: door.position[0])
    x, y = door.position[0] - np.cos(door.facing), door.position[1] - np.sin(door.facing)
    return float(x), float(y)


def test_a_place_the_map_lacks_is_added_with_its_door(osm: OsmData, helsinki: World) -> None:
    places, doors, _ = _placed(osm, helsinki, [_found("Zyx Kahvila", _in_a_building(helsinki))])
    place = next(p for p in places if p.id == "overture:Zyx Kahvila")
    assert (place.category, place.kind, place.name) == (Category.FOOD, "cafe", "Zyx Kahvila")
    door = next(d for d in doors if d.id == place.entrance)
    assert bool(helsinki.walkable.is_connected(door.approach))


def test_the_same_place_is_not_there_twice(osm: OsmData, helsinki: World) -> None:
    named = next(n for n in named_places(osm) if n.category is Category.FOOD and len(n.name) > 6)
    x, y = float(named.xy[0]) + 8.0, float(named.xy[1])
    places, _, dropped = _placed(osm, helsinki, [_found(named.name.upper() + " Oy", (x, y))])
    assert f"the same as {named.id}" in dropped[f"overture:{named.name.upper()} Oy"]
    assert all(not p.id.startswith("overture") for p in places)


def test_a_place_another_source_calls_closed_is_dropped_with_the_reason(osm: OsmData, helsinki: World) -> None:
    named = next(n for n in named_places(osm) if n.category is Category.FOOD and len(n.name) > 6)
    places, _, dropped = _placed(
        osm, helsinki, [_found(named.name, (float(named.xy[0]), float(named.xy[1])), open=False)]
    )
    assert dropped[named.id].endswith("closed, as another source says")
    assert named.id not in {p.id for p in places}


def test_every_found_place_is_there_or_has_a_reason(osm: OsmData, helsinki: World) -> None:
    spots = np.random.default_rng(0).uniform(-150, 150, (60, 2)).round(1)
    kinds = ("coffee_shop", "park", "law_firm", "bridge", "hotel", "train_station")
    names = ["".join(np.random.default_rng(k).choice(list("abcdefghijklmno"), 9)) for k in range(60)]
    found = [_found(names[k], (float(x), float(y)), kinds[k % 6]) for k, (x, y) in enumerate(spots)]
    places, _, dropped = _placed(osm, helsinki, found)
    there = {p.id for p in places}
    assert all((f.id in there) != (f.id in dropped) for f in found)
    assert sum("nobody goes to such a thing" in reason for reason in dropped.values()) == 10


def test_google_leaves_nothing_but_its_id(osm: OsmData, helsinki: World) -> None:
    google = {"source": "google", "attribution": "Google Maps", "may_be_kept": False}
    secret = _found("Secret Bistro", _in_a_building(helsinki), "bistro", id="google:ChIJ1", **google)
    shut = _found("Shut Secret", (3.0, 4.0), "bar", id="google:ChIJ2", open=False, **google)
    park = _found("Secret Park", (5.0, 6.0), "park", id="google:ChIJ3", **google)
    places, _, dropped = _placed(osm, helsinki, [secret, shut, park])
    place = next(p for p in places if p.id == "google:ChIJ1")
    assert place.kind == "restaurant"
    assert place.name.startswith("Restaurant")
    written = " ".join([*(p.model_dump_json() for p in places), *dropped.values(), *dropped])
    assert "Secret" not in written
    assert "bistro" not in written
    assert dropped["google:ChIJ2"] == "bar: closed"
    # Where it stands there does not decide where the door is.
    moved = replace(secret, xy=(secret.xy[0] - 1.0, secret.xy[1] - 1.0))
    again = next(p for p in _placed(osm, helsinki, [moved])[0] if p.id == "google:ChIJ1")
    assert again == place


def test_shops_of_a_street_have_doors_of_their_own(osm: OsmData, helsinki: World) -> None:
    places, _, _ = _placed(osm, helsinki, [])
    shops = [p for p in places if p.category in (Category.STORE, Category.FOOD) and p.entrance]
    through = Counter(p.entrance for p in shops)
    alone = sum(through[p.entrance] == 1 for p in shops)
    assert alone > 0.7 * len(shops)


def test_a_vague_kind_is_refined() -> None:
    shop = NamedPlace("n1", "Kauppa Virta", Category.STORE, "shop", np.zeros(2), {}, None)
    told = compare_places([shop], [_found("Kauppa Virta", (1.0, 1.0), "shoe_store")])
    assert told.refined["n1"].kind == "shoes"


@pytest.mark.parametrize(
    ("source", "kind", "wider", "meaning"),
    [
        ("google", "italian_restaurant", (), (Category.FOOD, "restaurant")),
        ("google", "point_of_interest", ("establishment", "book_store"), (Category.STORE, "books")),
        ("google", "establishment", (), None),
        ("google", "unheard_of", (), None),
        ("overture", "georgian_restaurant", ("restaurant",), (Category.FOOD, "restaurant")),
        ("overture", "patent_law", ("professional_services",), (Category.OFFICE, "company")),
        ("overture", "lake", (), None),
        ("overture", "asian_art_museum", (), (Category.ENTERTAINMENT, "museum")),
    ],
)
def test_words_of_other_sources(
    source: str, kind: str, wider: tuple[str, ...], meaning: tuple[Category, str] | None
) -> None:
    assert meaning_of(source, kind, wider) == meaning


def test_names_are_alike_beyond_case_accents_order_and_legal_forms() -> None:
    assert likeness("Café Engel Oy", "cafe engel") == 1.0
    assert likeness("Kiasma Museum", "Museum Kiasma") == 1.0
    assert likeness("Stockmann", "Stockmann Helsinki") >= 0.8
    assert likeness("Alepa", "K-Market") < 0.5


@given(st.text(max_size=20), st.text(max_size=20))
def test_likeness_is_a_share(one: str, other: str) -> None:
    assert 0.0 <= likeness(one, other) <= 1.0
    assert likeness(one, one) == 1.0
