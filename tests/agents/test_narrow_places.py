from __future__ import annotations

import math

import numpy as np
import pytest

from vico.agents.travel import TURNING_CLEARANCE, can_ride_out, find_way_out
from vico.world.walkable import BLOCKED, SIDEWALK, WalkableMap


def walled(*free: tuple[float, float, float, float]) -> WalkableMap:
    """Return 40 m of wall with these boxes of it free: west, south, east, north, metres."""
    cls = np.full((80, 80), BLOCKED, np.uint8)
    for west, south, east, north in free:
        cls[round((south + 20) * 2) : round((north + 20) * 2), round((west + 20) * 2) : round((east + 20) * 2)] = (
            SIDEWALK
        )
    return WalkableMap(cls, 20.0, 0.5)


@pytest.fixture
def passage() -> WalkableMap:
    """Return a passage of 1.5 m with a square at its north end, and the map's edge beyond."""
    return walled((-0.5, -8, 1.0, 6), (-10, 6, 10, 20))


def ends(position: tuple[float, float], heading: float, actions: list[dict[str, object]]) -> tuple[float, float]:
    """Return where actions lead."""
    (x, y), yaw = position, heading
    for action in actions:
        if action["type"] == "move_forward":
            x, y = x + action["distance"] * math.cos(yaw), y + action["distance"] * math.sin(yaw)  # type: ignore
        else:
            yaw += math.radians(action["degrees"]) * (1 if action["type"] == "turn_left" else -1)  # type: ignore
    return x, y


def test_who_points_along_a_passage_rides_out_of_it(passage: WalkableMap) -> None:
    actions = find_way_out(passage, (0.25, 0.0), math.radians(88.0))
    assert actions is not None
    assert {action["type"] for action in actions[-2:]} == {"move_forward"}
    x, y = ends((0.25, 0.0), math.radians(88.0), actions)
    assert passage.clearance_of(x, y) >= TURNING_CLEARANCE


def test_no_ride_is_longer_than_is_legal(passage: WalkableMap) -> None:
    rides = []
    for k in range(40):
        # Where numbers are rounded one way and the other.
        actions = find_way_out(passage, (0.25 + 0.001 * k, -6.0 + 0.0137 * k), math.radians(88.0 + 0.1 * k))
        assert actions is not None
        rides += [action["distance"] for action in actions if action["type"] == "move_forward"]
    assert max(rides) == 3.0


def test_where_it_is_wide_nothing_has_to_be_done(passage: WalkableMap) -> None:
    assert find_way_out(passage, (0.0, 12.0), 1.0) == []


def test_there_is_no_way_out_for_who_points_to_the_blind_end(passage: WalkableMap) -> None:
    assert find_way_out(passage, (0.25, 0.0), math.radians(-90.0)) is None


def test_a_rack_in_the_passage_can_be_used_and_one_in_a_shaft_cannot(passage: WalkableMap) -> None:
    assert can_ride_out(passage, (0.25, 0.0))
    assert not can_ride_out(walled((-0.5, -1.5, 1.0, 1.5), (-10, 6, 10, 20)), (0.25, 0.0))
