"""An agent that is restored from its state acts on exactly as the one that went on."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from itertools import count
from typing import Any

import pytest

import toy_city
from vico.agents.assistant import METHODS, make_planner
from vico.agents.base import Agent, RandomAgent
from vico.agents.requester import Requester
from vico.agents.schedule import followers_of
from vico.assets.models.movable import movable_kinds, movable_surfaces
from vico.io.plain_data import decode, encode
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.world.public import PublicMap

Make = Callable[[], Mapping[str, Agent]]


def region(place: str, x: float) -> dict[str, Any]:
    return {"kind": "place", "name": place, "place": place, "centre": (x, 4.0, 0.0), "radius": 0.0, "surface": None}


def outdoors(x: float, y: float) -> dict[str, Any]:
    return {
        "kind": "outdoor", "name": "outside", "place": None, "centre": (x, y, 0.0), "radius": 6.0, "surface": None
    }  # fmt: skip


def by_table(place: str, x: float, room: str, entity: int) -> dict[str, Any]:
    return region(place, x) | {"surface": {"room": room, "kind": "table", "entity": entity}}


def asked(index: int, category: str, things: list[str], sources: list[Any], destination: Any) -> dict[str, Any]:
    return {
        "index": index, "category": category, "text": "help me", "objects": things, "sources": sources,
        "destination": destination, "person": {"agent": "resident_2", "name": "Cleo Ek", "looks": "a woman"},
    }  # fmt: skip


IN_SHOP, IN_CAFE = region(toy_city.SHOP, 5.0), region(toy_city.CAFE, -5.0)
INSTRUCTIONS: dict[str, list[dict[str, Any]]] = {
    "delivery": [
        asked(0, "delivery", ["red box"], [outdoors(0.0, -6.0)], by_table(toy_city.SHOP, 5.0, "r_shop", 200_003)),
        asked(1, "delivery", ["blue box"], [IN_SHOP, IN_CAFE], outdoors(8.0, -6.0)),
    ],
    "search": [
        asked(0, "search", ["blue box"], [IN_CAFE, IN_SHOP], None),
        asked(1, "search", ["red box"], [outdoors(0.0, -6.0)], None),
    ],
    "carry": [asked(0, "carry", ["red box"], [outdoors(0.0, -4.0), IN_SHOP], IN_CAFE)],
}


def carried_on(
    sim: Simulation, make: Make, *, steps: int, every: int, until: Collection[str] = ()
) -> tuple[set[str], int]:
    """Let agents act; every so often others are restored from their state, and asked beside them from then on.

    It ends after some steps, or some after there were all actions of some types.

    Returns the types of actions there were, and how many restored agents were followed.
    """
    going_on = make()
    restored: list[Mapping[str, Agent]] = []
    observations, infos = sim.observe()
    types: set[str] = set()
    for step in count():
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
        if until and types.issuperset(until):
            steps, until = min(steps, step + 3 * every), ()
        if step == steps - 1:
            break
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
    types, followed = carried_on(sim, lambda: followers_of(toy_city.community(), public_map), steps=300, every=30)
    assert followed == 10
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


#: What each category's planner has done in the end, if it is any good.
DONE = {
    "delivery": {"pick", "put", "task_complete"},
    "search": {"task_complete"},
    "carry": {"communicate", "put", "task_complete"},
}


def scene(category: str) -> tuple[Simulation, dict[str, Agent], PublicMap]:
    """A red box outdoors, with Carry in Cleo's hand, and a blue one in the café; and Cleo, if she is needed."""
    community = toy_city.community() if category == "carry" else None
    config = SimConfig(start=8 * 3600 - 20, assistants=1, observe=("assistant_0",), image=128)
    sim = Simulation(toy_city.world(), community, config)
    red, blue = (movable_surfaces("parcel", colour) for colour in ("red", "blue"))
    size = movable_kinds()["parcel"].size
    if category == "carry":
        sim.scenario.hand_object("red box", "red box", red, "resident_2", size=size)
    else:
        sim.scenario.add_object("red box", "red box", red, (1.0, -6.0, 0.0), size=size)
    sim.scenario.add_object("blue box", "blue box", blue, (-7.0, 10.0, toy_city.FLOOR), room="r_cafe", size=size)
    sim.scenario.place_agent("assistant_0", (0.0, -2.0))
    public_map = PublicMap.from_world(sim.world)
    people: dict[str, Agent] = {}
    if community is not None:
        people = dict(followers_of(community, public_map))
        people["resident_2"] = Requester(people["resident_2"], community.resident_by_id["resident_2"], public_map)
    return sim, people, public_map


@pytest.mark.parametrize("category", sorted(INSTRUCTIONS))
# That of `llm`, which asks a server, is in test_llm_planner.py.
@pytest.mark.parametrize("method", sorted(METHODS.keys() - {"llm"}))
def test_planners(method: str, category: str) -> None:
    sim, _, public_map = scene(category)

    def make() -> dict[str, Agent]:
        planner = make_planner(method, INSTRUCTIONS[category], public_map, seed=1)
        return scene(category)[1] | {"assistant_0": planner} if category == "carry" else {"assistant_0": planner}

    able = method in ("heuristic", "ours")
    # To the end of the task, or as long as it takes to see that nothing of the state is lost.
    types, _ = carried_on(sim, make, steps=300 if able else 120, every=15, until=DONE[category] if able else ())
    assert "move_forward" in types
    assert types & {"turn_left", "turn_right"}
    if able:
        assert DONE[category] <= types
