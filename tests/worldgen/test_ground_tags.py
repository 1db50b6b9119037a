"""Which ways and areas of a map lie on the ground."""

from __future__ import annotations

import pytest

from vico.worldgen.facts.site import on_the_ground


@pytest.mark.parametrize(
    ("tags", "outdoors"),
    [
        ({}, True),
        ({"layer": "-1"}, True),  # under a bridge, or in a cutting
        ({"layer": "-2", "natural": "water"}, True),
        ({"layer": "1"}, True),
        ({"layer": "below"}, True),
        ({"tunnel": "yes"}, False),
        ({"tunnel": "culvert", "layer": "-1"}, False),
        ({"tunnel": "building_passage"}, True),
        ({"location": "underground"}, False),
        ({"indoor": "yes"}, False),
        ({"highway": "corridor"}, False),
        ({"level": "-1"}, False),
        ({"level": "-1", "layer": "-1"}, False),
        ({"level": "-2;-1"}, False),
        ({"level": "-1;0"}, True),
        ({"level": "-1", "layer": "0"}, True),  # below a square on a hill, open to the sky
        ({"level": "2"}, True),
    ],
)
def test_a_layer_alone_says_nothing_of_the_ground(tags: dict[str, str], outdoors: bool) -> None:
    assert on_the_ground(tags) is outdoors
