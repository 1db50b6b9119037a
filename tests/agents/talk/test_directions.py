"""Ways are told by streets, turns and metres."""

from __future__ import annotations

import numpy as np
import pytest

from vico.agents.talk.sentences import describe_way, read_sentences, round_distance, turn_between
from vico.world.heights import HeightField
from vico.world.model import Category
from vico.world.public import PublicMap, PublicPlace, PublicStreet
from vico.world.walkable import BLOCKED, SIDEWALK, WalkableMap

HALF = 100.0


def city() -> PublicMap:
    """East Street along y = 0 from x = -90 to 50, North Lane from there to the northern edge; all else is blocked."""
    n = int(HALF * 4)
    cells = np.full((n, n), BLOCKED, np.uint8)
    centre = (np.arange(n) + 0.5) * 0.5 - HALF
    x, y = np.meshgrid(centre, centre)
    cells[(abs(y) < 4) & (x > -90) & (x < 54)] = SIDEWALK
    cells[(abs(x - 50) < 4) & (y > -4)] = SIDEWALK
    streets = [
        PublicStreet("East Street", [(-90.0, 0.0), (50.0, 0.0)], 6.0),
        PublicStreet("North Lane", [(50.0, 0.0), (50.0, 90.0)], 6.0),
    ]
    shop = PublicPlace("p", "Hat Shop", Category.STORE, "clothes", "b", (50.0, 80.0, 0.0), (55.0, 80.0, 0.0))
    return PublicMap(HALF, WalkableMap(cells, HALF), HeightField.flat(HALF), [shop], [], [], [], streets=streets)


def test_a_way_round_a_corner() -> None:
    public = city()
    found = describe_way(public, (-40.0, 0.0), public.places[0], read_sentences())
    assert found is not None
    words, metres = found
    start, turn, door = words.split(", ")
    assert start.startswith("go east along East Street for about ")
    assert turn.startswith("turn left and go along North Lane for about ")
    assert door == "and the door is on your right"
    told = [int(part.rsplit(" ", 2)[1]) for part in (start, turn)]
    assert told == [pytest.approx(90, abs=15), pytest.approx(80, abs=15)]
    assert sum(told) == pytest.approx(metres, abs=15)


def test_no_way() -> None:
    public = city()
    place = PublicPlace("q", "Isle", Category.OPEN, "park", None, (-80.0, 80.0, 0.0), None)
    assert describe_way(public, (-80.0, 70.0), place, read_sentences()) is None


def test_streets_are_told_apart_and_end() -> None:
    index = city().street_index
    assert index.streets_at([(0.0, 3.0), (50.0, 60.0), (0.0, 50.0)]) == ["East Street", "North Lane", ""]
    assert index.streets_at(np.zeros((0, 2))) == []


@pytest.mark.parametrize(
    ("after", "turn"), [((1, 0.1), "straight"), ((0, 1), "left"), ((0, -1), "right"), ((-1, 0.1), "back")]
)
def test_turns(after: tuple[float, float], turn: str) -> None:
    assert turn_between((1.0, 0.0), after) == turn


def test_distances_are_said_roundly() -> None:
    assert [round_distance(metres) for metres in (2.0, 14.0, 148.0, 320.0, 990.0)] == [10, 10, 150, 300, 1000]
