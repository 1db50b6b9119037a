"""What a build says of values that are not plain."""

from __future__ import annotations

import numpy as np
import pytest

from toytown import PLACES, make_world
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmData, OsmNode
from vico.worldgen.evidence import opening_hours_notes, quantity_notes


def told(tags: dict[str, str], x: float = 0.0) -> tuple[dict[str, int], list[str]]:
    osm = OsmData(LocalFrame(52.0, 11.0), 50.0, 60.0, [OsmNode(1, np.array([x, 0.0]), tags)], [], [], [])
    counts, found = quantity_notes(osm)
    return counts, [one.reason for one in found]


def test_plain_values_are_not_told() -> None:
    assert told({"height": "12 m", "building:levels": "3", "maxspeed": "30 mph", "width": "12'", "name": "G+4"}) == (
        {},
        [],
    )
    assert told({"maxspeed": "none"}) == ({}, [])


@pytest.mark.parametrize(
    ("key", "text", "sentence"),
    [
        ("building:levels", "G+4", "was read as 5 storeys: storeys added up, the ground floor one of them"),
        ("height", "10-12", "was read as 12 m: the highest of several values"),
        ("building:levels", "two", "can't be read: decided by rule"),
        ("height", "9999", "can't be (0.1 to 900 m): decided by rule"),
    ],
)
def test_each_other_value_is_told_with_its_tag(key: str, text: str, sentence: str) -> None:
    counts, sentences = told({key: text})
    assert sentences == [f"{key}={text!r} {sentence}"]
    assert sum(counts.values()) == 1


def test_values_beyond_the_window_are_not_told() -> None:
    assert told({"height": "tall"}, x=80.0) == ({}, [])


def test_hours_of_places_are_told() -> None:
    world = make_world()
    hours = ["Mo-Fr 08:00-20:00", "Mo-Fr 8-20", "whenever", None]
    places = [
        place.model_copy(update={"opening_hours": text}) for place, text in zip(world.places, hours, strict=False)
    ]
    assert len(PLACES) >= 4
    counts, found = opening_hours_notes(places)
    assert counts == {"by_rule": 1, "not_read": 1}
    assert [one.reason for one in found] == [
        "opening_hours='Mo-Fr 8-20' was read as 'Mo-Fr 8:00-20:00'",
        "opening_hours='whenever' can't be read: usual hours hold",
    ]
