"""Who goes through the door of a house opens it first: from outside going in, from inside going out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import toy_city
from vico.sim.animation import Hold
from vico.sim.bodies.avatars import CLIP
from vico.sim.config import SimConfig
from vico.sim.loop.checks import overlaps_of
from vico.sim.loop.simulation import Simulation
from vico.sim.people.placement import place_in_room
from vico.sim.recording import read_run
from vico.sim.recording.recorder import Recorder

_ENTER = {"type": "enter", "place": toy_city.CAFE}
_DOOR = np.array([-5.0, 5.0])


@pytest.fixture
def sim() -> Simulation:
    """Two assistants, the first 1.8 m before a door and looking the other way."""
    made = Simulation(toy_city.world(), None, SimConfig(assistants=2, observe=()))
    made.scenario.place_agent("assistant_0", (-5.3, 3.2), yaw=-np.pi / 2)
    made.scenario.place_agent("assistant_1", (-20.0, -15.0))
    return made


def test_one_opens_a_door_walks_through_it_and_it_closes_behind(sim: Simulation) -> None:
    p, leaves, seen = sim.state.people, sim.state.leaves, []
    sim.state.on_substep = lambda: seen.append(
        (int(p.room[0]), int(p.clip[0]), p.position[0, :2].copy(), float(p.yaw[0]), leaves.share_of(0))
    )
    for _ in range(5):
        sim.step({"assistant_0": _ENTER})
    outside = [one for one in seen if one[0] < 0]
    opening = [one for one in outside if one[1] == CLIP["open_door"]]
    assert len(opening) >= 8
    for _, _, position, yaw, _ in opening:
        to_door = _DOOR - position
        assert np.hypot(*to_door) < 0.75
        assert np.cos(np.arctan2(to_door[1], to_door[0]) - yaw) > 0.99
    assert len(outside) <= 32
    _walks_through_the_open_door(outside)
    assert (p.door[0], p.passing[0], len(leaves)) == (-1, 0, 0)
    # The same way out: at the door within the room first.
    seen.clear()
    p.position[0, :2] = sim.state.indoor.rooms[0].inside[:2]
    for _ in range(5):
        sim.step({"assistant_0": {"type": "exit"}})
    inside = [one for one in seen if one[0] >= 0]
    assert sum(one[1] == CLIP["open_door"] for one in inside) >= 8
    assert 9 <= len(inside) <= 19
    _walks_through_the_open_door([one for one in seen if one[0] < 0])
    assert (p.room[0], p.door[0], len(leaves)) == (-1, -1, 0)
    assert sim.state.world.walkable.clearance_at(p.position[0, :2]) >= 0.25


def _walks_through_the_open_door(seen: list[tuple[int, int, np.ndarray, float, float]]) -> None:
    """No further than one walks in a tenth of a second, and behind the wall only in the middle of an open door."""
    way = np.array([one[2] for one in seen])
    assert np.hypot(*np.diff(way, axis=0).T).max() < 0.16
    behind = [one for one in seen if one[2][1] > _DOOR[1] - 0.2]
    assert len(behind) >= 5
    for _, clip, position, _, share in behind:
        assert abs(position[0] - _DOOR[0]) < 0.1
        assert clip in (CLIP["walk"], CLIP["open_door"])
        assert share == 1.0


def test_one_who_is_kept_from_coming_out_goes_back_into_the_room(sim: Simulation) -> None:
    p = sim.state.people
    place_in_room(0, 0, sim.state)
    p.position[0, :2] = sim.state.indoor.rooms[0].inside[:2]
    sim.step({"assistant_0": {"type": "exit"}})
    while not p.passing[0]:
        sim.step({"assistant_0": {"type": "wait"}})
    p.position[1] = [-5.0, 4.3, 0.0]
    said = [sim.step({"assistant_0": {"type": "wait"}}).observations["assistant_0"]["state"] for _ in range(4)]
    assert "blocked" in [one["action_code"] for one in said]
    assert sim.state.people.room[0] == 0
    assert not overlaps_of(sim.state)


def test_on_the_way_through_a_door_one_goes_on_and_does_nothing_else(sim: Simulation) -> None:
    sim.step({"assistant_0": _ENTER})
    moved = sim.step({"assistant_0": {"type": "move_forward", "distance": 1.0}})
    assert moved.observations["assistant_0"]["state"]["action_code"] == "moving"
    other = sim.step({"assistant_0": _ENTER | {"place": toy_city.SHOP}}).observations["assistant_0"]["state"]
    assert other["action_status"] == "refused"
    sim.step({"assistant_0": {"type": "wait"}})
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
    result = [sim.step({"assistant_0": _ENTER}) for _ in range(2)]
    assert not [event for one in result for event in one.events if event.kind == "collision"]
    sim.scenario.place_agent("assistant_1", (-20.0, -15.0))
    for _ in range(3):
        sim.step({"assistant_0": {"type": "wait"}})
    assert sim.state.people.room[0] >= 0


def test_a_room_that_fills_up_while_the_door_opens_is_refused_then(sim: Simulation) -> None:
    sim.step({"assistant_0": _ENTER})
    indoor = sim.state.indoor
    near = indoor.arrival(0, -1)
    taken = indoor._spots(0, near[:2])
    for k, spot in enumerate(taken[:: max(1, len(taken) // 400)]):
        size = np.array([0.3, 0.3, 0.5])
        sim.state.objects.add(f"crate {k}", "box", spot, 0, size, 0.0)
    while sim.state.people.at_door()[0]:
        state = sim.step({"assistant_0": {"type": "wait"}}).observations["assistant_0"]["state"]
    assert (state["action_code"], state["room"]) == ("full", "")


def test_one_comes_out_to_a_spot_beside_the_door_close_to_the_wall(
    sim: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    spot = np.array([-4.2, 4.72])
    monkeypatch.setattr("vico.sim.people.doors.spot_outside", lambda i, state: spot)
    place_in_room(0, 0, sim.state)
    for _ in range(5):
        sim.step({"assistant_0": {"type": "exit"}})
    p = sim.state.people
    assert (p.room[0], p.passing[0]) == (-1, 0)
    assert p.position[0, :2].tolist() == spot.tolist()


def test_who_waits_long_for_others_in_a_door_is_told_so(sim: Simulation, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vico.sim.people.doors._is_door_free", lambda i, way, state: False)
    reasons = [
        sim.step({"assistant_0": _ENTER}).observations["assistant_0"]["state"]["action_reason"] for _ in range(26)
    ]
    assert "enter: somebody is in the door" in reasons
    assert sim.state.people.room[0] < 0


def test_a_recording_tells_how_far_doors_are_open_and_what_is_held_up(sim: Simulation, tmp_path: Path) -> None:
    people = sim.state.people
    with Recorder(tmp_path / "run", sim, sources={}, wanted=4) as recorder:
        people.hold[1], people.hold_share[1] = int(Hold.PLACARD_RIGHT), 0.5
        recorder.begin({})
        expected = []
        for _ in range(4):
            actions = {"assistant_0": _ENTER}
            recorder.write(sim.step(actions), actions)
            leaves = sim.state.leaves
            expected.append(dict(zip(leaves.entrance.tolist(), leaves.share.tolist(), strict=True)))
    run = read_run(tmp_path / "run")
    doors, first = run.columns("doors"), run.columns("people", 0, 0)
    for step, open_then in enumerate(expected, 1):
        now = doors["step"] == step
        assert dict(zip(doors["entrance"][now].tolist(), doors["share"][now].tolist(), strict=True)) == pytest.approx(
            open_then, abs=0.006
        )
    assert any(expected)
    row = first["entity"].tolist().index(int(people.entity[1]))
    assert (int(first["hold"][row]), float(first["hold_share"][row])) == (int(Hold.PLACARD_RIGHT), 0.5)


def test_whoever_waits_longest_at_a_door_goes_through_next_though_others_come_out(sim: Simulation) -> None:
    p, room = sim.state.people, sim.state.indoor.rooms[0]
    # In front of the door, in the way of the one who comes out, who would try again and again.
    sim.scenario.place_agent("assistant_0", (-5.0, 4.4), yaw=np.pi / 2)
    place_in_room(1, 0, sim.state)
    p.position[1, :2] = room.inside[:2]
    sim.step({"assistant_1": {"type": "exit"}})
    for _ in range(20):
        sim.step({"assistant_0": _ENTER, "assistant_1": {"type": "exit"}})
        if p.room[0] >= 0:
            break
    assert p.room[0] >= 0
