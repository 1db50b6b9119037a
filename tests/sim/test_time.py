"""Time in layers: ticks, sub-steps and control periods; however a second is cut, the same happens in it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import toy_city
from vico.errors import InputError
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.state.steps import ControlPeriods, ticks_of
from vico.world.world import World

MORNING = SimConfig(start=8 * 3600 - 20, assistants=1, observe=())
ROBOTS = replace(MORNING, robots=("husky", "go2"))


def toy(config: SimConfig = MORNING) -> Simulation:
    """The toy city before 08:00."""
    return Simulation(toy_city.world(), toy_city.community(), config)


def walking(second: int) -> dict[str, Any]:
    """Some turn while others walk; every fifth second somebody speaks."""
    actions: dict[str, Any] = {f"resident_{i}": {"type": "move_forward", "distance": 0.3 + 0.4 * i} for i in range(3)}
    actions[f"resident_{second % 3}"] = {"type": "turn_left", "degrees": 50.0 + second}
    if second % 5 == 0:
        actions["assistant_0"] = {"type": "communicate", "text": f"It is {second}.", "range": 10.0}
    return actions


def cut_hashes(sim: Simulation, seconds: int, slices: list[float]) -> list[str]:
    """Act once a second and let it pass in slices; return the hash at every whole second."""
    found = []
    for second in range(seconds):
        sim.act(walking(second) | {"robot_0": {"type": "control", "vector": [3.0] * 4}})
        for part in slices:
            sim.advance(part)
        found.append(sim.state_hash())
    return found


@pytest.mark.parametrize("slices", [[0.02] * 50, [0.1] * 10, [0.06, 0.9, 0.04]])
def test_however_a_second_is_cut_the_state_after_it_is_the_same(slices: list[float]) -> None:
    assert cut_hashes(toy(ROBOTS), 6, slices) == cut_hashes(toy(ROBOTS), 6, [1.0])


def test_a_second_of_a_real_town_may_be_cut_too(helsinki: World) -> None:
    config = SimConfig(cars=6, pedestrians=8, assistants=1, robots=("husky",), errands=True, observe=())
    whole, cut = (Simulation(helsinki, None, config) for _ in "ab")
    assert cut_hashes(whole, 4, [1.0]) == cut_hashes(cut, 4, [0.02] * 50)


def test_a_step_ends_when_the_next_agent_is_due() -> None:
    sim = toy(replace(ROBOTS, periods={"robot_1": 0.04, "assistant_0": 0.1}))
    start = sim.state.tick
    ends, due = [], []
    for _ in range(5):
        due.append(sorted(sim.step({}).observations))
        ends.append(sim.state.tick - start)
    assert ends == [4, 8, 10, 12, 16]
    assert due == [["robot_1"], ["robot_1"], ["assistant_0"], ["robot_1"], ["robot_1"]]


def test_people_do_the_same_beside_a_robot_that_is_controlled_fifty_times_a_second() -> None:
    often, seldom = toy(replace(ROBOTS, periods={"robot_0": 0.02})), toy(ROBOTS)
    forward = {"robot_0": {"type": "control", "vector": [3.0] * 4}}
    for second in range(4):
        seldom.step(walking(second) | forward)
        for part in range(50):
            result = often.step((walking(second) if part == 0 else {}) | forward)
        assert set(result.observations) == set(often.agents)
        a, b = seldom.state.arrays(), often.state.arrays()
        differing = [name for name in a if not np.array_equal(a[name], b[name])]
        assert differing == []


def test_what_is_said_between_is_heard_at_the_next_observation() -> None:
    sim = toy(replace(MORNING, periods={"assistant_0": 0.1}))
    sim.scenario.place_agent("assistant_0", (0.0, -20.0))
    for k, name in enumerate(("resident_0", "resident_1")):
        sim.scenario.place_agent(name, (1.0 + k, -20.0))
    for part in range(10):
        text = "Good morning!" if part == 3 else ""
        result = sim.step({"assistant_0": {"type": "communicate", "text": text, "range": 10.0}} if text else {})
    heard = {name: [m["text"] for m in result.observations[name]["events"]] for name in ("resident_0", "resident_1")}
    assert heard == {"resident_0": ["Good morning!"], "resident_1": ["Good morning!"]}
    assert sim.step({}).observations["assistant_0"]["events"] == []


def test_actions_of_agents_that_are_not_due_are_left_out() -> None:
    sim = toy(replace(MORNING, periods={"assistant_0": 0.1}))
    sim.step({})
    before = sim.state.people.yaw.copy()
    for _ in range(5):
        sim.step({"resident_0": {"type": "turn_left", "degrees": 90.0}})
    assert np.array_equal(sim.state.people.yaw, before)


def test_a_turn_that_is_cut_short_is_turned_as_far_as_time_went() -> None:
    sim = toy(replace(MORNING, periods={"assistant_0": 0.5}))
    k = sim.state.people.names.index("assistant_0")
    before = float(sim.state.people.yaw[k])
    sim.step({"assistant_0": {"type": "turn_left", "degrees": 40.0}})
    turned = float(np.degrees(sim.state.people.yaw[k]) - np.degrees(before))
    assert turned % 360.0 == pytest.approx(20.0)


def test_a_model_names_its_own_period_and_robots_stands_for_all() -> None:
    sim = toy(replace(ROBOTS, periods={"robots": "model", "robot_1": 0.5}))
    assert sim.periods.ticks.tolist()[-2:] == [2, 50]


@pytest.mark.parametrize(
    ("periods", "told"),
    [
        ({"resident_0": 0.05}, r"resident_0's is 0.05 s; it has to be a multiple of 0.1 s"),
        ({"robot_0": 0.015}, r"multiple of 0.01 s"),
        ({"robot_0": 0.0}, r"more than 0"),
        ({"robot_0": float("nan")}, r"more than 0"),
        ({"robot_7": 0.1}, r"nobody is called 'robot_7'"),
        ({"resident_0": "model"}, r"give seconds"),
    ],
)
def test_a_period_that_cannot_be_is_refused(periods: dict[str, float | str], told: str) -> None:
    with pytest.raises(InputError, match=told):
        ControlPeriods.of(["resident_0"], {"robot_0": 0.02}, periods, start=0)


def test_time_passes_in_hundredths_of_a_second() -> None:
    assert ticks_of(0.29, "it") == 29
    with pytest.raises(InputError, match=r"multiple of 0\.01"):
        toy().advance(0.005)


def test_a_snapshot_may_be_taken_within_a_sub_step() -> None:
    sim = toy(ROBOTS)
    sim.act(walking(0))
    sim.advance(0.26)
    kept = sim.snapshot()
    sim.advance(0.74)
    after = sim.state_hash()
    sim.restore(kept)
    sim.advance(0.74)
    assert sim.state_hash() == after


def test_a_robot_may_be_controlled_a_hundred_times_a_second() -> None:
    sim = toy(replace(ROBOTS, periods={"robot_0": 0.01}))
    start = sim.state.tick
    due = [list(sim.step({"robot_0": {"type": "control", "vector": [3.0] * 4}}).observations) for _ in range(12)]
    assert sim.state.tick - start == 12
    assert due == [["robot_0"]] * 12
