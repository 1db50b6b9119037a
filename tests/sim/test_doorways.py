"""Who goes through the door of a house opens it first: from outside going in, from inside going out."""

from __future__ import annotations

import numpy as np
import pytest

import toy_city
from vico.sim.avatars import CLIP
from vico.sim.config import SimConfig
from vico.sim.simulation import Simulation

_ENTER = {"type": "enter", "place": toy_city.CAFE}
_DOOR = np.array([-5.0, 5.0])


@pytest.fixture
def sim() -> Simulation:
    """Two assistants, the first 1.8 m before a door and looking the other way."""
    made = Simulation(toy_city.world(), None, SimConfig(assistants=2, observe=()))
    made.scenario.place_agent("assistant_0", (-5.3, 3.2), yaw=-np.pi / 2)
    made.scenario.place_agent("assistant_1", (-20.0, -15.0))
    return made


def test_a_hand_is_on_the_door_before_one_is_in_and_before_one_is_out(sim: Simulation) -> None:
    p, seen = sim.state.people, []
    sim.state.on_substep = lambda: seen.append((int(p.room[0]), int(p.clip[0]), p.position[0, :2].copy(), p.yaw[0]))
    for _ in range(3):
        sim.step({"assistant_0": _ENTER})
    outside = [one for one in seen if one[0] < 0]
    opening = [one for one in outside if one[1] == CLIP["open_door"]]
    assert len(opening) >= 8
    assert opening == outside[-len(opening) :]
    for _, _, position, yaw in opening:
        to_door = _DOOR - position
        assert np.hypot(*to_door) < 0.75
        assert np.cos(np.arctan2(to_door[1], to_door[0]) - yaw) > 0.99
    assert len(outside) <= 25
    # The same way out: at the door within the room first.
    assert p.door[0] == -1
    seen.clear()
    p.position[0, :2] = sim.state.indoor.rooms[0].inside[:2]
    for _ in range(3):
        sim.step({"assistant_0": {"type": "exit"}})
    inside = [one for one in seen if one[0] >= 0]
    assert sum(one[1] == CLIP["open_door"] for one in inside) >= 8
    assert 10 <= len(inside) <= 20
    assert p.room[0] == -1


def test_on_the_way_through_a_door_one_goes_on_and_does_nothing_else(sim: Simulation) -> None:
    sim.step({"assistant_0": _ENTER})
    moved = sim.step({"assistant_0": {"type": "move_forward", "distance": 1.0}})
    assert moved.observations["assistant_0"]["state"]["action_code"] == "moving"
    other = sim.step({"assistant_0": _ENTER | {"place": toy_city.SHOP}}).observations["assistant_0"]["state"]
    assert other["action_status"] == "refused"
    assert sim.state.people.room[0] >= 0


def test_a_run_goes_on_the_same_from_a_snapshot_at_a_door(sim: Simulation) -> None:
    sim.step({"assistant_0": _ENTER})
    assert sim.state.people.at_door()[0]
    before = sim.snapshot()
    first = [sim.step({"assistant_0": {"type": "wait"}}).hash for _ in range(4)]
    sim.restore(before)
    assert [sim.step({"assistant_0": {"type": "wait"}}).hash for _ in range(4)] == first


def test_who_stands_in_the_way_is_not_walked_into_and_the_door_opens_from_there(sim: Simulation) -> None:
    sim.scenario.place_agent("assistant_1", (-5.1, 4.4))
    result = [sim.step({"assistant_0": _ENTER}) for _ in range(3)]
    assert not [event for one in result for event in one.events if event.kind == "collision"]
    assert sim.state.people.room[0] >= 0


def test_a_room_that_fills_up_while_the_door_opens_is_refused_then(sim: Simulation) -> None:
    sim.step({"assistant_0": _ENTER})
    indoor = sim.state.indoor
    near = indoor.arrival(0, -1)
    taken = indoor._spots(0, near)
    for k, spot in enumerate(taken[:: max(1, len(taken) // 400)]):
        size = np.array([0.3, 0.3, 0.5])
        sim.state.objects.add(f"crate {k}", "box", spot, 0, size, 0.0)
    while sim.state.people.at_door()[0]:
        state = sim.step({"assistant_0": {"type": "wait"}}).observations["assistant_0"]["state"]
    assert (state["action_code"], state["room"]) == ("full", "")
