"""What agents tell of their plans."""

from __future__ import annotations

from typing import Any

import pytest

import toy_city
from assistant_by_hand import OUTDOORS, SHOP, subtask, task
from vico.agents.assistant import make_planner
from vico.agents.base import Goal, Plan, plan_record
from vico.agents.schedule import followers_of
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.world.public import PublicMap


def test_a_resident_tells_where_the_day_leads_and_the_way_there() -> None:
    world, people = toy_city.world(), toy_city.community()
    followers = followers_of(people, PublicMap.from_world(world), seed=0)
    sim = Simulation(world, people, SimConfig(observe=(), start=28_795))
    observations, infos = sim.observe()
    for _ in range(20):
        actions = {name: follower.act(observations[name], infos[name]) for name, follower in followers.items()}
        result = sim.step(actions)
        observations, infos = result.observations, result.infos
    before = followers["resident_2"].state()
    plan = plan_record(followers["resident_2"], sim.state.second)
    assert plan is not None
    assert plan["goals"][0]["place"] == "South Green"
    assert plan["path"][-1][:2] == [0.0, -25.0]
    assert "08:01" in plan["why"]
    after = followers["resident_2"].state()
    assert str(before) == str(after)  # to be asked changes nothing


@pytest.mark.parametrize("method", ["heuristic", "ours", "mcts"])
def test_a_planner_tells_its_subtask(method: str) -> None:
    world, people = toy_city.world(), toy_city.community()
    told = task("delivery", [subtask([SHOP], OUTDOORS)], world).instructions()
    public_map = PublicMap.from_world(world)
    planner = make_planner(method, told, public_map, seed=0)
    sim = Simulation(world, people, SimConfig(assistants=1, observe=("assistant_0",), image=64))
    observations, infos = sim.observe(["assistant_0"])
    planner.act(observations["assistant_0"], infos["assistant_0"])
    plan = plan_record(planner, sim.state.second)
    assert plan is not None
    assert [goal["text"] for goal in plan["goals"]] == ["Cleo Ek asks.", "Hat Shop", "the green"]
    assert plan["path"]


class Odd:
    """An agent whose plan is what it is made with."""

    def __init__(self, plan: Any) -> None:
        self.said = plan

    def plan(self, second: float) -> Any:
        if isinstance(self.said, Exception):
            raise self.said
        return self.said


def test_who_has_no_plan_or_cannot_tell_it_does_no_harm() -> None:
    assert plan_record(object(), 0.0) is None
    assert plan_record(Odd(None), 0.0) is None
    for odd in (ValueError("x"), 3, {"goals": []}):
        record = plan_record(Odd(odd), 0.0)
        assert record is not None
        assert "cannot be told" in record["why"]


def test_long_plans_are_cut() -> None:
    plan = Plan((Goal("go"),) * 100, ((0.0, 0.0, 0.0),) * 10_000, "because " * 1000)
    record = plan_record(Odd(plan), 0.0)
    assert record is not None
    assert (len(record["goals"]), len(record["path"]), len(record["why"])) == (20, 500, 400)
