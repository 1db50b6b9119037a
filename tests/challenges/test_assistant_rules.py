"""The rules of Carry, Delivery and Search at their edges."""

from __future__ import annotations

import numpy as np
import pytest

import toy_city
from assistant_by_hand import (
    CAFE,
    CAFE_TABLE,
    FAR,
    GREEN,
    IN_CAFE,
    IN_SHOP,
    OUTDOORS,
    SHOP,
    WHO,
    Truth,
    picture,
)
from vico.challenges.assistant.evaluate import entrance_of, has_arrived, is_carried_home, is_delivered, is_in_view
from vico.challenges.assistant.tasks import ADVANCED, STANDARD, Thresholds, thresholds
from vico.world.model import Point3
from vico.world.world import World

RED = "red helmet"
PERSON = "resident_2"


@pytest.fixture(scope="module")
def city() -> World:
    return toy_city.world()


@pytest.fixture
def truth(city: World) -> Truth:
    return Truth(city)


def beside(point: Point3, metres: float, *, angle: float = 0.7, up: float = 0.0) -> Point3:
    return (point[0] + metres * float(np.cos(angle)), point[1] + metres * float(np.sin(angle)), point[2] + up)


def test_the_advanced_setting_halves_distances_and_trebles_regions() -> None:
    assert thresholds(advanced=False) == STANDARD
    assert thresholds(advanced=True) == ADVANCED
    assert (STANDARD.destination_radius, STANDARD.home_radius, STANDARD.search_distance) == (3.0, 3.0, 10.0)
    assert (ADVANCED.destination_radius, ADVANCED.home_radius, ADVANCED.search_distance) == (1.5, 1.5, 5.0)
    assert (STANDARD.regions, ADVANCED.regions) == (1, 3)
    assert (STANDARD.surface_distance, ADVANCED.surface_distance) == (None, 1.5)
    assert STANDARD.search_pixels == ADVANCED.search_pixels == 20


# Delivery.


@pytest.mark.parametrize(
    ("limits", "metres", "done"),
    [(STANDARD, 0.0, True), (STANDARD, 2.99, True), (STANDARD, 3.01, False), (ADVANCED, 1.49, True),
     (ADVANCED, 1.51, False)],
)  # fmt: skip
def test_outdoors_a_delivery_lies_within_3_m_or_half_of_it(
    truth: Truth, limits: Thresholds, metres: float, done: bool
) -> None:
    truth.put(RED, beside(GREEN, metres, up=8.0))  # height does not count
    assert is_delivered(RED, OUTDOORS, truth, truth.world, limits) is done


def test_a_thing_in_a_room_below_the_spot_is_not_outdoors(truth: Truth) -> None:
    truth.put(RED, GREEN, "r_cafe")
    assert not is_delivered(RED, OUTDOORS, truth, truth.world, STANDARD)


@pytest.mark.parametrize(("room", "done"), [("r_cafe", True), ("r_back", True), ("r_shop", False), (None, False)])
def test_every_room_of_the_place_counts_and_nothing_else(truth: Truth, room: str | None, done: bool) -> None:
    truth.put(RED, CAFE.centre, room)
    assert is_delivered(RED, CAFE, truth, truth.world, STANDARD) is done


@pytest.mark.parametrize(("region", "room"), [(OUTDOORS, None), (CAFE, "r_cafe")], ids=["outdoors", "place"])
def test_what_somebody_holds_is_not_delivered(truth: Truth, region: object, room: str | None) -> None:
    for holder in (WHO, PERSON):
        truth.put(RED, region.centre, room)  # type: ignore[attr-defined]
        assert is_delivered(RED, region, truth, truth.world, STANDARD)  # type: ignore[arg-type]
        truth.holders[RED] = holder
        assert not is_delivered(RED, region, truth, truth.world, STANDARD)  # type: ignore[arg-type]


# The table's edge is at x = -6 + 0.8 and at y = 13 - 0.4.
@pytest.mark.parametrize(
    ("x", "y", "done"),
    [(-6.0, 13.0, True), (-3.71, 13.0, True), (-3.69, 13.0, False), (-6.0, 11.11, True), (-6.0, 11.09, False),
     (-4.15, 11.55, True), (-4.1, 11.5, False)],
)  # fmt: skip
def test_a_surface_that_is_named_is_at_most_a_metre_and_a_half_away(
    truth: Truth, x: float, y: float, done: bool
) -> None:
    truth.put(RED, (x, y, toy_city.FLOOR), "r_cafe")
    assert is_delivered(RED, CAFE_TABLE, truth, truth.world, ADVANCED) is done
    assert is_carried_home(RED, CAFE_TABLE, truth, truth.world, ADVANCED) is done
    assert is_delivered(RED, CAFE_TABLE, truth, truth.world, STANDARD)


# Carry.


@pytest.mark.parametrize(("limits", "reach"), [(STANDARD, 3.0), (ADVANCED, 1.5)])
def test_carried_home_is_inside_or_near_the_entrance(truth: Truth, limits: Thresholds, reach: float) -> None:
    door = entrance_of(CAFE, truth.world)
    assert door.tolist() == [-5.0, 5.0, -0.1]  # the door itself, not the spot before it that maps show
    at = (float(door[0]), float(door[1]), float(door[2]))
    for metres, done in ((reach - 0.01, True), (reach + 0.01, False)):
        truth.put(RED, beside(at, metres, angle=-1.0))
        assert is_carried_home(RED, CAFE, truth, truth.world, limits) is done
        truth.put(PERSON, beside(at, metres, angle=-1.0))
        assert has_arrived(PERSON, CAFE, truth, truth.world, limits) is done
    truth.put(RED, IN_CAFE, "r_back")
    assert is_carried_home(RED, CAFE, truth, truth.world, limits)
    truth.holders[RED] = PERSON
    assert not is_carried_home(RED, CAFE, truth, truth.world, limits)


def test_the_house_next_door_is_not_home_however_near_its_door_is(truth: Truth) -> None:
    truth.put(RED, (-5.0, 5.0, -0.1), "r_shop")
    truth.put(PERSON, (-5.0, 5.0, -0.1), "r_shop")
    assert not is_carried_home(RED, CAFE, truth, truth.world, STANDARD)
    assert not has_arrived(PERSON, CAFE, truth, truth.world, STANDARD)
    truth.put(PERSON, IN_CAFE, "r_back")
    assert has_arrived(PERSON, CAFE, truth, truth.world, STANDARD)


def test_a_home_without_a_door_is_where_its_place_is(city: World) -> None:
    park = city.place_by_id[toy_city.PARK]
    region = SHOP.model_copy(update={"place": toy_city.PARK})
    assert entrance_of(region, city).tolist() == list(park.position)


# Search.


@pytest.mark.parametrize(
    ("limits", "pixels", "metres", "found"),
    [(STANDARD, 20, 9.99, True), (STANDARD, 19, 1.0, False), (STANDARD, 500, 10.01, False), (ADVANCED, 20, 4.99, True),
     (ADVANCED, 500, 5.01, False)],
)  # fmt: skip
def test_found_is_20_pixels_within_10_m_or_half_of_it(
    truth: Truth, limits: Thresholds, pixels: int, metres: float, found: bool
) -> None:
    truth.put(RED, GREEN)
    truth.put(WHO, beside(GREEN, metres))
    assert is_in_view(RED, WHO, picture({RED: pixels, "blue helmet": 90}), truth, limits) is found


def test_what_is_seen_through_a_door_is_found(truth: Truth) -> None:
    truth.put(RED, IN_SHOP, "r_shop")
    for room in ("r_shop", "r_back", None):
        truth.put(WHO, IN_SHOP, room)
        assert is_in_view(RED, WHO, picture({RED: 400}), truth, STANDARD)
    truth.put(WHO, FAR)
    assert not is_in_view(RED, WHO, picture({RED: 400}), truth, STANDARD)
