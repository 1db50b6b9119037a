"""Residents asked as a group do what each of them does alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import toy_city
from vico.agents.base import split_groups
from vico.agents.residents import Residents
from vico.agents.schedule import followers_of
from vico.community.author import procedural_author
from vico.community.model import Community
from vico.io.plain_data import encode
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.world.public import PublicMap
from vico.world.world import World


class Counting:
    """Counts how often a resident is asked."""

    def __init__(self, member: Any) -> None:
        self.member, self.asked = member, 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self.member, name)

    def act(self, observation: dict[str, Any], info: dict[str, Any]) -> dict[str, Any]:
        self.asked += 1
        action: dict[str, Any] = self.member.act(observation, info)
        return action


Said = dict[int, dict[str, Any]]


def together_and_alone(
    world: World, people: Community, config: SimConfig, steps: int, said: Said | None = None
) -> tuple[float, set[str]]:
    """Compare the group's actions with the single ones at every step; `said`: what others do, by step.

    Returns the share of the residents that the group asked, and the types of actions there were.
    """
    sim = Simulation(world, people, config)
    public_map = PublicMap.from_world(world)
    alone, members = followers_of(people, public_map), followers_of(people, public_map)
    counting = {name: Counting(member) for name, member in members.items()}
    group = Residents(counting, public_map.walkable)
    for member in members.values():
        member.group = group
    names = list(members)
    observations, infos = sim.observe()
    types: set[str] = set()
    for step in range(steps):
        together = group.act_for(names, observations, infos)
        single = {name: alone[name].act(observations[name], infos[name]) for name in names}
        assert together == single, f"step {step}"
        types |= {str(action["type"]) for action in single.values()}
        result = sim.step(single | (said or {}).get(step, {}))
        observations, infos = result.observations, result.infos
    for name in names:
        assert encode(alone[name].state()) == encode(members[name].state()), name
    return sum(one.asked for one in counting.values()) / (steps * len(names)), types


def test_in_a_small_town_around_opening_time() -> None:
    people, config = toy_city.community(), SimConfig(start=8 * 3600 - 20, observe=())
    _, types = together_and_alone(toy_city.world(), people, config, 400)
    assert {"move_forward", "enter", "wait", "communicate"} <= types


def test_answering_questions() -> None:
    """Their states, which are compared at the end, hold whom they saw and what they heard."""
    config = SimConfig(start=8 * 3600 - 20, observe=(), assistants=1)
    questions = ["Have you seen Cleo Ek?", "Bo, have you seen Ada?", "How do I get to South Green?", "Who are you?"]
    said: Said = {
        step: {"assistant_0": {"type": "communicate", "text": questions[k % len(questions)]}}
        for k, step in enumerate(range(2, 120, 3))
    }
    _, types = together_and_alone(toy_city.world(), toy_city.community(), config, 150, said)
    assert "communicate" in types


@pytest.mark.parametrize(
    ("start", "usual"),
    [(7.9, "move_forward"), pytest.param(12.0, "eat", marks=pytest.mark.slow), (23.249, "sleep")],
)
def test_a_hundred_residents_of_helsinki(helsinki: World, hundred: Community, start: float, usual: str) -> None:
    config = SimConfig(start=int(start * 3600), observe=(), cars=20, pedestrians=20)
    asked, types = together_and_alone(helsinki, hundred, config, 160)
    assert {usual, "wait", "drink"} <= types
    assert asked < 0.25


@pytest.fixture(scope="module")
def hundred(helsinki: World) -> Community:
    return procedural_author(helsinki, residents=100, seed=3)


def test_a_member_that_fails_is_told_in_its_place() -> None:
    class Failing:
        rests_until = walks_until = -np.inf
        stride, acquaintances, greeting_times, encounters = None, (), {}, 0  # type: ignore[var-annotated]

        def act(self, observation: Any, info: Any) -> dict[str, Any]:
            raise ValueError("no idea")

    sim = Simulation(toy_city.world(), toy_city.community(), SimConfig(observe=()))
    followers = followers_of(toy_city.community(), PublicMap.from_world(sim.world))
    group = Residents({**followers, "resident_0": Failing()}, sim.world.walkable)
    actions = group.act_for(list(followers), *sim.observe())
    assert isinstance(actions["resident_0"], ValueError)
    assert all(isinstance(action, dict) for name, action in actions.items() if name != "resident_0")


def test_stock_residents_belong_to_one_group() -> None:
    followers = followers_of(toy_city.community(), PublicMap.from_world(toy_city.world()))
    ((_, names),), alone = split_groups(followers)
    assert names == list(followers)
    assert alone == []
