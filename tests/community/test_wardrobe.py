"""Can people be told apart, and do they look their age and their trade?"""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from vico.community import Resident, build_community
from vico.community.model import ResidentAppearance
from vico.community.profiles import clothes_of, trade_clothes
from vico.world.world import World

# What makes one unit of difference: years, metres, shares, and a channel of a colour.
_SCALES = {"age": 15.0, "height": 0.08, "build": 0.25, "muscle": 0.3, "gender": 1.0}
_COLOURS = ("skin", "hair_colour", "top_colour", "bottom_colour", "shoes_colour")
_KINDS = ("hair", "beard", "glasses", "top", "bottom", "shoes", "hat", "over", "bag")


def difference(a: ResidentAppearance, b: ResidentAppearance) -> float:
    """How far two looks are from each other: about 1 is a detail that is seen from across a street."""
    one, two = dict(a), dict(b)
    parts = [abs(float(one[k]) - float(two[k])) / scale for k, scale in _SCALES.items()]  # type: ignore[arg-type]
    parts += [float(np.linalg.norm(np.subtract(one[k], two[k]))) / 60.0 for k in _COLOURS]  # type: ignore[arg-type]
    parts += [float(one.get(k, "none") != two.get(k, "none")) for k in _KINDS]
    return float(np.linalg.norm(parts))


@pytest.fixture(scope="module")
def fifty(town: World) -> list[Resident]:
    return build_community(town, residents=50, seed=1).residents


def test_no_two_of_fifty_look_alike(fifty: list[Resident]) -> None:
    closest = min((difference(a.appearance, b.appearance), a.name, b.name) for a, b in combinations(fifty, 2))
    assert closest[0] > 1.5, closest


def test_children_are_as_tall_as_their_age_and_the_old_are_grey(fifty: list[Resident]) -> None:
    for r in fifty:
        look = r.appearance
        if r.age <= 7:
            assert look["height"] < 1.4
        if r.age < 16:
            assert not look["beard"]
            assert look["hair"] != "bald"
        if r.age > 75:
            assert min(look["hair_colour"]) > 110, r.name


def test_pupils_carry_a_bag_and_trades_have_their_clothes(fifty: list[Resident]) -> None:
    for r in fifty:
        clothes = clothes_of(r.occupation)
        if clothes is not None:
            assert r.appearance.get("bag", "none") == clothes.bag
            assert clothes.top == () or r.appearance["top"] in clothes.top


def test_clothes_name_trades_that_there_are() -> None:
    assert clothes_of("police officer") is not None
    assert clothes_of("senior nurse") == clothes_of("nurse")
    assert clothes_of("student of law") is not None
    assert clothes_of("retired physician") is None
    assert len([trade for clothes in trade_clothes() for trade in clothes.trades]) > 45
