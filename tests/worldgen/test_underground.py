"""Which buildings lie below the ground, as their tags say."""

import pytest

from vico.worldgen.facts.site import is_underground


@pytest.mark.parametrize(
    ("tags", "below"),
    [
        ({"layer": "-1"}, False),
        ({"location": "underground"}, True),
        ({"tunnel": "yes"}, True),
        ({"parking": "underground", "layer": "-1"}, True),
        ({"parking": "underground"}, False),
        ({"building:levels:underground": "2"}, False),
        ({"level": "-1"}, True),
        ({"level": "-2;-1"}, True),
        ({"level": "-2--1"}, True),
        ({"level": "-1;0;1"}, False),
        ({"level": "-1-2"}, False),
        ({"level": "-0"}, False),
        ({"level": "0"}, False),
    ],
)
def test_layer_alone_says_nothing_of_the_ground(tags: dict[str, str], below: bool) -> None:
    assert is_underground(tags) is below
