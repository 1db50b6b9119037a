"""An agent that is restored from its state acts on exactly as the one that went on."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest

import toy_city
from vico.agents.assistant import METHODS, make_planner
from vico.agents.base import Agent, RandomAgent
from vico.agents.schedule import followers_of
from vico.io.plain_data import decode, encode
from vico.sim.config import SimConfig
from vico.sim.simulation import Simulation
from vico.world.public import PublicMap

Make = Callable[[], Mapping[str, Agent]]


def region(place: str, x: float) -> dict[str, Any]:
    return {"kind": "place", "name": place, "place": place, "centre": (x, 4.0, 0.0), "radius": 0.0}


def outdoors(x: float, y: float) -> dict[str, Any]:
    return {"kind": "outdoor", "name": "outside", "place": None, "centre": (x, y, 0.0), "radius": 4.0}


INSTRUCTIONS: list[dict[str, Any]] = [
    {
        "index": 0, "text": "bring it", "objects": ["red box"], "source": outdoors(0.0, -6.0),
        "destination": region(toy_city.SHOP, 5.0),
    },
    {
        "index": 1, "text": "fetch it", "objects": ["blue box"], "source": region(toy_city.CAFE, -5.0),
        "destination": outdoors(8.0, -6.0),
    },
]  # fmt: skip


def carried_on(sim: Simulation, make: Make, *, steps: int, every: int) -> tuple[set[str], int]:
    """Let agents act; every so often others are restored from their state, and asked beside them from then on.

    Returns the types of actions there were, and how many restored agents were followed.
    """
    going_on = make()
    restored: list[Mapping[str, Agent]] = []
    observations, infos = sim.observe()
    types: set[str] = set()
    for step in range(steps):
        if step % every == every // 2:
            fresh = make()
            for name, agent in fresh.items():
                agent.restore(decode(encode(going_on[name].state())))
            restored.append(fresh)
        actions = {name: agent.act(observations[name], infos[name]) for name, agent in going_on.items()}
        for others in restored:
            for name, agent in others.items():
                assert agent.act(observations[name], infos[name]) == actions[name], f"{name} at step {step}"
        types |= {str(action["type"]) for action in actions.values()}
        result = sim.step(actions)
        observations, infos = result.observations, result.infos
    return types, len(restored)


def test_residents() -> None:
    config = SimConfig(start=8 * 3600 - 20, observe=(), assistants=2)
    sim = Simulation(toy_city.world(), toy_city.community(), config)
    # Two who stand in the way: waits, steps aside, closed spots.
    sim.scenario.place_agent("assistant_0", (0.0, 3.9))
    sim.scenario.place_agent("assistant_1", (-5.0, 3.2))
    public_map = PublicMap.from_world(sim.world)
    types, count = carried_on(sim, lambda: followers_of(toy_city.community(), public_map), steps=300, every=30)
    assert count == 10
    assert {"move_forward", "turn_left", "exit", "enter", "wait"} <= types


def test_residents_who_look_at_pictures() -> None:
    sim = Simulation(toy_city.world(), toy_city.community(), SimConfig(start=8 * 3600 - 20, observe=None, image=64))
    public_map = PublicMap.from_world(sim.world)

    class Blindfold:
        """Hides what residents are told, so that they look at their pictures."""

        def __init__(self, agent: Agent) -> None:
            self.agent, self.state, self.restore = agent, agent.state, agent.restore

        def act(self, observation: dict[str, Any], info: dict[str, Any]) -> dict[str, Any]:
            return self.agent.act(observation, {name: value for name, value in info.items() if name != "in_view"})

    def make() -> dict[str, Agent]:
        return {name: Blindfold(agent) for name, agent in followers_of(toy_city.community(), public_map).items()}

    carried_on(sim, make, steps=120, every=20)


def test_random_agent() -> None:
    sim = Simulation(toy_city.world(), None, SimConfig(assistants=1, observe=()))
    types, _ = carried_on(sim, lambda: {"assistant_0": RandomAgent("assistant_0", seed=3)}, steps=200, every=40)
    assert "turn_left" in types


# That of `llm`, which asks a server, is in test_llm_planner.py.
@pytest.mark.parametrize("method", sorted(METHODS.keys() - {"llm"}))
def test_planners(method: str) -> None:
    sim = Simulation(toy_city.world(), None, SimConfig(assistants=1, observe=None, image=64))
    box = toy_city.quad([[-0.1, -0.1, 0.1], [0.1, -0.1, 0.1], [0.1, 0.1, 0.1], [-0.1, 0.1, 0.1]], (200, 20, 20), 0, "b")
    for name, position, room in (
        ("red box", (1.0, -6.0, 0.0), ""),
        ("blue box", (-7.0, 10.0, toy_city.FLOOR), "r_cafe"),
    ):
        sim.scenario.add_object(name, name, [box], position, room=room, size=np.array([0.2, 0.2, 0.2]))
    sim.scenario.place_agent("assistant_0", (0.0, -2.0))
    public_map = PublicMap.from_world(sim.world)
    types, _ = carried_on(
        sim, lambda: {"assistant_0": make_planner(method, INSTRUCTIONS, public_map, seed=1)}, steps=300, every=25
    )
    assert {"move_forward", "turn_left", "enter"} <= types
    if method == "heuristic":
        assert {"pick", "put", "task_complete"} <= types
