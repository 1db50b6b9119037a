"""Where main agents look from in a room, and how they get away from what stops them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from vico.agents.influence.visiting import Visitor, remaining_viewpoints, room_viewpoints
from vico.seeds import rng


class NoMap:
    """A map that nobody needs indoors."""


def stopped(status: str) -> dict[str, Any]:
    state = {"room": "shop.room0", "action_status": status, "action_code": ""}
    return {"pose": np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]), "state": state}


def test_every_point_of_a_large_room_is_near_a_spot_or_the_door() -> None:
    room = np.array([10.0, -4.0, math.radians(30.0), 9.0, 6.0])
    door = (10.0 + 9.0 * math.cos(room[2]), -4.0 + 9.0 * math.sin(room[2]))
    spots = [*room_viewpoints(room, door), door]
    for along in np.linspace(-9.0, 9.0, 19):
        for across in np.linspace(-6.0, 6.0, 13):
            x = 10.0 + along * math.cos(room[2]) - across * math.sin(room[2])
            y = -4.0 + along * math.sin(room[2]) + across * math.cos(room[2])
            assert min(math.dist((x, y), spot) for spot in spots) < 5.0


def test_a_small_room_is_seen_from_its_door_and_there_are_no_spots_outdoors() -> None:
    assert room_viewpoints(np.array([0.0, 0.0, 0.0, 2.0, 1.5]), (1.5, 0.0)) == []
    assert room_viewpoints(np.array([0.0, 0.0, 0.0, np.inf, np.inf]), (1.5, 0.0)) == []


def test_the_next_spot_is_the_nearest_that_was_not_looked_from() -> None:
    assert remaining_viewpoints([(9.0, 0.0), (1.0, 0.0), (4.0, 0.0)], (0.0, 0.0)) == [(4.0, 0.0), (9.0, 0.0)]


def test_who_keeps_being_stopped_goes_a_step_another_way() -> None:
    """The same step into something solid again and again once held main agents in a room until the day was over."""
    visitor = Visitor(NoMap(), rng(0, "test"))  # type: ignore[arg-type]
    found = [visitor._towards_indoors(stopped("collision"), (4.0, 0.0), near=1.0) for _ in range(4)]
    assert [action and action["type"] for action in found[:2]] == ["move_forward", "move_forward"]
    assert found[2] is not None
    assert found[2]["type"] in ("turn_left", "turn_right")
    assert 50.0 <= found[2]["degrees"] <= 150.0
    assert found[3] == {"type": "move_forward", "distance": 0.6}
    # Who is stopped now and then goes on as before.
    for _ in range(5):
        for status in ("ok", "ok", "collision"):
            action = visitor._towards_indoors(stopped(status), (4.0, 0.0), near=1.0)
            assert action is not None
            assert action["type"] == "move_forward"
