"""People of teaming tasks: whom they listen to, that they go in and come out, and whom they follow how far."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import toy_city
from vico.agents.base import Agent
from vico.agents.schedule import followers_of
from vico.agents.teaming.people import GAVE_UP, I_FOLLOW, LETS_GO, THANKS, WAIT_FOR_ME, Newcomer, Visitor
from vico.io.plain_data import decode, encode
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.world.public import PublicMap

CLEO, ROBOT = "resident_2", "robot_0"
CALL = {"type": "communicate", "text": "Cleo, please come along."}


class Outing:
    """Cleo stands before the house, and a Husky 3 m from her."""

    def __init__(self, person: str, **how: Any) -> None:
        config = SimConfig(start=9 * 3600, observe=(), robots=("husky",), robot_places={ROBOT: (3.0, -4.0, 0.0)})
        community = toy_city.community()
        self.sim = Simulation(toy_city.world(), community, config)
        self.sim.scenario.place_agent(CLEO, (0.0, -4.0), yaw=0.0)
        self.map = PublicMap.from_world(self.sim.world)
        self.person, self.how = person, how
        self.others: dict[str, Agent] = dict(followers_of(community, self.map, seed=1))
        self.others.pop(CLEO)
        self.cleo = self.made()
        self.observations, self.infos = self.sim.observe()
        self.said: list[str] = []

    def made(self) -> Any:
        resident = toy_city.community().resident_by_id[CLEO].model_copy(update={"home": toy_city.PARK})
        if self.person == "visitor":
            return Visitor(resident, self.map, place=toy_city.SHOP, pace=1.0, seed=1, **self.how)
        return Newcomer(resident, self.map, pace=1.0, within=7.0, gives_up=20.0, seed=1, **self.how)

    def step(self, robot: dict[str, Any] | None = None) -> dict[str, Any]:
        """Let everybody act; Cleo as who is restored from what she remembers each time."""
        fresh = self.made()
        fresh.restore(decode(encode(self.cleo.state())))
        self.cleo = fresh
        action = dict(self.cleo.act(self.observations[CLEO], self.infos[CLEO]))
        actions = {name: agent.act(self.observations[name], self.infos[name]) for name, agent in self.others.items()}
        if action["type"] == "communicate":
            self.said.append(action["text"])
        result = self.sim.step(actions | {CLEO: action, ROBOT: robot or {"type": "wait"}})
        self.observations, self.infos = result.observations, result.infos
        return action

    def until(self, seconds: int, text: str) -> bool:
        return any(self.step() is not None and text in self.said for _ in range(seconds))

    @property
    def at(self) -> np.ndarray:
        return self.sim.ground_truth.agent_position(CLEO)

    def apart(self) -> float:
        robots = self.sim.state.robots
        assert robots is not None
        return math.dist(self.at[:2], robots.bodies().position[0, :2])


def test_a_visitor_waits_to_be_called_goes_in_and_comes_out_again() -> None:
    outing = Outing("visitor", stay=8.0)
    at = outing.at
    for _ in range(4):
        assert outing.step({"type": "communicate", "text": "Ada, please come along."}) == {"type": "wait"}
    assert np.allclose(outing.at, at)
    outing.step(CALL)
    outing.step()
    assert outing.said == [LETS_GO]
    truth = outing.sim.ground_truth
    assert any(outing.step() is not None and truth.agent_place(CLEO) == toy_city.SHOP for _ in range(40))
    assert not any(outing.step() is None or truth.agent_room(CLEO) is None for _ in range(7))
    assert outing.until(30, THANKS)
    assert truth.agent_room(CLEO) is None


def test_a_visitor_who_stays_stays() -> None:
    outing = Outing("visitor", stay=None)
    outing.step(CALL)
    for _ in range(60):
        outing.step()
    assert outing.sim.ground_truth.agent_place(CLEO) == toy_city.SHOP
    assert outing.said == [LETS_GO]


def test_a_newcomer_follows_a_robot_that_is_near_and_stops_on_the_way() -> None:
    outing = Outing("newcomer", pauses=[(3.0, 2.0)])
    outing.step()
    assert outing.step() == {"type": "wait"}
    outing.step(CALL)
    outing.step({"type": "go_to", "target": [22.0, -4.0, 0.0]})
    assert outing.said == [I_FOLLOW]
    waited = 0
    for _ in range(45):
        waited += outing.step()["type"] == "wait"
    assert waited >= 2
    assert outing.at[0] > 12.0
    assert 0.9 < outing.apart() < 3.5


def test_a_newcomer_calls_who_is_too_far_ahead_and_gives_up_who_is_gone() -> None:
    outing = Outing("newcomer", pauses=[])
    outing.step(CALL)
    outing.step()
    outing.sim.scenario.place_agent(CLEO, (-9.0, -4.0), yaw=0.0)
    outing.observations, outing.infos = outing.sim.observe()
    at = outing.at
    assert outing.until(4, WAIT_FOR_ME)
    assert np.allclose(outing.at, at)
    assert GAVE_UP not in outing.said
    outing.sim.scenario.place_agent(CLEO, (0.0, 25.0), yaw=math.pi / 2)  # behind the house
    outing.observations, outing.infos = outing.sim.observe()
    assert not outing.until(18, GAVE_UP)
    assert outing.until(5, GAVE_UP)
    assert outing.step() == {"type": "wait"}


@pytest.mark.parametrize("person", ["visitor", "newcomer"])
def test_who_is_far_off_is_not_called(person: str) -> None:
    outing = Outing(person, **({"stay": None} if person == "visitor" else {"pauses": []}))
    outing.sim.scenario.place_agent(CLEO, (-20.0, -4.0), yaw=0.0)
    outing.observations, outing.infos = outing.sim.observe()
    outing.step(CALL)
    assert outing.step() == {"type": "wait"}
    assert outing.said == []
