"""Lines at tills: spots with room between, one served after the other, and who walks away is out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import toy_city
from vico.agents.activities import Clerk
from vico.agents.indoor_walk import IndoorWalker
from vico.sim.bodies.seats import PRICE, SERVICE, SPACING
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.people.placement import place_in_room
from vico.world.world import World


def shop() -> World:
    """The toy city with a counter instead of the shop's table, its front to the south, with room behind it."""
    world = toy_city.world()
    objects = world.objects
    here = objects.room == "r_shop"
    world.__dict__["objects"] = replace(
        objects,
        kind=np.where(here, "counter", objects.kind),
        y=np.where(here, 12.4, objects.y),
        yaw=np.where(here, -np.pi / 2, objects.yaw),
        size_x=np.where(here, 0.8, objects.size_x),
        size_y=np.where(here, 1.6, objects.size_y),
    )
    return world


@pytest.fixture
def sim() -> Simulation:
    config = SimConfig(assistants=3, observe=(), transit=False)
    simulation = Simulation(shop(), None, config)
    simulation.state.people.cash[:] = 20.0
    return simulation


def test_people_are_served_one_after_the_other_in_the_order_they_came(sim: Simulation) -> None:
    state, names = sim.state, ["assistant_0", "assistant_1", "assistant_2"]
    (room,) = state.tills
    spots = state.tills[room].spots
    assert len(spots) >= 4
    assert np.allclose(np.hypot(*np.diff(spots, axis=0).T), SPACING)
    for name in names:
        place_in_room(names.index(name), room, state, near=spots[-1])
    order = [2, 0, 1]
    for k in order:
        told = sim.observe()[1][names[k]]["till"]
        assert told["before"] == order.index(k)
        state.people.position[k, :2] = told["stand"][:2]
        sim.step({names[k]: {"type": "queue"}})
        assert state.people.status[k] == 0
    assert state.lines.waiting(room) == order
    paid = []
    for _ in range(60):
        line = state.lines.waiting(room)
        for place, i in enumerate(line):
            state.people.position[i, :2] = spots[place]
        paid += [event.agent for event in sim.step({}).events if event.kind == "purchase"]
    assert paid == [names[k] for k in order]
    assert state.people.cash.tolist() == [20.0 - PRICE] * 3
    assert state.lines.served.tolist() == [1, 1, 1]
    assert 3 * SERVICE < 60


def test_who_is_far_off_or_has_no_money_is_told_so_and_who_walks_away_is_out(sim: Simulation) -> None:
    state = sim.state
    (room,) = state.tills
    spots = state.tills[room].spots
    place_in_room(0, room, state, near=spots[-1])
    state.people.position[0, :2] = spots[0] + (0.0, -3.0)
    sim.step({"assistant_0": {"type": "queue"}})
    assert state.people.reason[0] == "queue: the end of the line is 3.0 m away; 0.8 m or less is needed"
    state.people.position[0, :2], state.people.cash[0] = spots[0], 1.0
    sim.step({"assistant_0": {"type": "queue"}})
    assert state.people.reason[0] == "queue: one pays 5, and you have 1.00"
    state.people.cash[0] = 9.0
    sim.step({"assistant_0": {"type": "queue"}})
    assert state.lines.waiting(room) == [0]
    state.people.position[0, :2] = spots[0] + (0.0, -3.0)
    texts = [event.text for event in sim.step({}).events if event.kind == "queue"]
    assert texts == ["leaves the line"]
    sim.step({"assistant_1": {"type": "queue"}})
    assert state.people.reason[1] == "queue: there is no till in this room"


def test_somebody_who_works_there_goes_behind_the_till_and_is_the_only_one(sim: Simulation) -> None:
    state = sim.state
    (room,) = state.tills
    behind = np.array(state.tills[room].behind)
    for i in (0, 1):
        place_in_room(i, room, state, near=state.tills[room].spots[-1])
    walker = IndoorWalker()

    def walk(point: tuple[float, float, float], near: float, observation: dict, info: dict) -> dict | None:
        walker.notice(observation, info)
        return walker.towards(observation, point, near=near)

    clerk = Clerk(walk)
    for _ in range(60):
        observations, infos = sim.observe()
        action = clerk.towards("today", observations["assistant_0"], infos["assistant_0"])
        if action == {"type": "wait"}:
            break
        sim.step({"assistant_0": action})
    assert clerk.serves
    assert np.hypot(*(state.people.position[0, :2] - behind[:2])) < 0.25
    assert abs(state.people.yaw[0] - behind[2]) % (2 * np.pi) < 0.2
    infos = sim.observe()[1]
    assert "counter" in infos["assistant_0"]
    assert "counter" not in infos["assistant_1"]


def test_nobody_is_told_to_serve_behind_a_counter_that_there_is_no_way_around(sim: Simulation) -> None:
    (till,) = sim.state.tills.values()
    assert till.behind is not None
    indoor, (x, y, yaw, depth) = sim.state.indoor, till.counter
    across = np.array([[x, y, yaw, depth, 10.0]])  # from wall to wall
    first = indoor.furniture_start[till.room]
    shut = replace(
        indoor,
        furniture=np.insert(indoor.furniture, first, across, axis=0),
        furniture_start=indoor.furniture_start + (np.arange(len(indoor.furniture_start)) > till.room),
    )
    assert replace(till, _indoor=shut).behind is None
