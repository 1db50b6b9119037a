"""Buses and bicycles in real streets: who gets on, what it costs, and where one gets off."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vico.sim.config import SimConfig
from vico.sim.simulation import Simulation
from vico.sim.transit import BIKE_ASTRAY, BIKE_RATE, FARE
from vico.world.folder import World, read_world
from vico.worldgen.pipeline import build_world
from vico.worldgen.request import BuildOptions

EXTRACT = Path(__file__).parents[2] / "src" / "vico" / "data" / "helsinki.osm.pbf"


@pytest.fixture(scope="module")
def city(tmp_path_factory: pytest.TempPathFactory) -> World:
    """800 m x 800 m of central Helsinki: large enough for a bus line and bicycle stations."""
    out = tmp_path_factory.mktemp("worlds") / "city"
    build_world(EXTRACT, lat=60.1690, lon=24.9435, half=400.0, seed=0, out=out, options=BuildOptions(previews=False))
    return read_world(out)


@pytest.fixture
def sim(city: World) -> Simulation:
    """Central Helsinki with its buses and bicycles, and one assistant with money."""
    simulation = Simulation(city, None, SimConfig(assistants=1, observe=()))
    simulation.state.people.cash[0] = 50.0
    return simulation


def act(sim: Simulation, **action: Any) -> dict[str, Any]:
    """Do one action; return the assistant's state."""
    state: dict[str, Any] = sim.step({"assistant_0": action}).observations["assistant_0"]["state"]
    return state


def at_the_bus(sim: Simulation) -> None:
    """Wait at a stop until a bus stands there."""
    transit = sim.state.transit
    assert transit is not None
    bus = next(b for b in range(transit.traffic.buses) if transit.stopped_at(b) is not None)
    sim.scenario.place_agent("assistant_0", transit.exit_spots(bus)[0])


def test_boarding_costs_the_fare_and_carries_one_along(sim: Simulation) -> None:
    at_the_bus(sim)
    state = act(sim, type="enter_bus")
    assert (state["action_status"], state["vehicle"], state["cash"]) == ("ok", "bus", 50.0 - FARE)
    before = sim.state.people.position[0].copy()
    for _ in range(600):
        act(sim, type="wait")
        if np.linalg.norm(sim.state.people.position[0] - before) > 20.0:
            break
    assert np.linalg.norm(sim.state.people.position[0] - before) > 20.0


def test_a_moving_bus_lets_nobody_off(sim: Simulation) -> None:
    at_the_bus(sim)
    act(sim, type="enter_bus")
    transit = sim.state.transit
    assert transit is not None
    bus = int(sim.state.people.vehicle_entity[0]) - transit.entity_of(0)
    for _ in range(600):
        if transit.stopped_at(bus) is None:
            break
        act(sim, type="wait")
    assert "moving" in act(sim, type="exit_bus")["action_reason"]


def test_at_a_stop_one_gets_off_beside_the_bus(sim: Simulation) -> None:
    at_the_bus(sim)
    act(sim, type="enter_bus")
    state = act(sim, type="exit_bus")
    assert (state["action_status"], state["vehicle"]) == ("ok", "")
    others = sim.state.obstacles_to(0)
    away = np.hypot(*(others.position[:, :2] - sim.state.people.position[0, :2]).T)
    assert away.min() > 0.5


def test_a_bicycle_is_ridden_away_and_left_astray_costs_more(sim: Simulation) -> None:
    transit = sim.state.transit
    assert transit is not None
    for bike in range(len(transit.bicycles.xy)):
        sim.scenario.place_agent("assistant_0", transit.bicycles.xy[bike])
        state = act(sim, type="enter_bike")
        if state["action_status"] == "ok":
            break
    assert state["vehicle"] == "bike"
    start = sim.state.people.position[0, :2].copy()
    chance = np.random.default_rng(0)
    for _ in range(200):
        state = act(sim, type="move_forward", distance=3.0)
        if state["action_status"] == "collision":
            act(sim, type="turn_left", degrees=float(chance.uniform(20, 160)))
        if np.linalg.norm(sim.state.people.position[0, :2] - start) > 12.0:
            break
    assert np.linalg.norm(sim.state.people.position[0, :2] - start) > 5.0
    bike = int(sim.state.people.vehicle_entity[0]) - transit.bicycles.first_entity
    assert transit.bicycles.xy[bike] == pytest.approx(sim.state.people.position[0, :2])
    state = act(sim, type="exit_bike")
    paid = 50.0 - state["cash"]
    minutes = round((paid % BIKE_ASTRAY) / BIKE_RATE)
    assert paid == pytest.approx(minutes * BIKE_RATE + (BIKE_ASTRAY if paid > BIKE_ASTRAY else 0.0))
    assert 1 <= minutes <= 7


def test_indoors_or_far_from_a_stop_nobody_boards(sim: Simulation) -> None:
    assert sim.state.transit is not None
    away = np.hypot(*(sim.state.transit.doors(0)[0] - sim.state.people.position[0, :2]))
    if away > 10.0:
        assert "door" in act(sim, type="enter_bus")["action_reason"]
    assert "not in a bus" in act(sim, type="exit_bus")["action_reason"]
