"""Stairs outdoors: agents slow down on them, pedestrians too, and treads decide nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import toy_city
from helsinki_traffic import network
from road_city import HALF
from vico.rules import STAIRS_SPEED
from vico.sim.bodies.arrays import Bodies
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.traffic import Traffic
from vico.world.heights import HeightField, Stairs


def treads_over(west: float, south: float, east: float, north: float) -> Stairs:
    """A tread over a rectangle that counts as 0.3 m deep: only where it is matters here."""
    return Stairs(
        np.array([[(west, south), (east, south), (east, north), (west, north)]]), np.zeros(1), np.full(1, 0.3)
    )


@pytest.mark.parametrize("distance", [1.0, 2.5])
def test_on_stairs_one_goes_half_a_metre_a_second(distance: float) -> None:
    world = toy_city.world()
    world.__dict__["height"] = replace(world.height, stairs=treads_over(-10.0, -20.0, 10.0, -10.0))
    sim = Simulation(world, None, SimConfig(assistants=1, observe=()))
    sim.scenario.place_agent("assistant_0", (-6.0, -15.0))
    sim.step({"assistant_0": {"type": "move_forward", "distance": distance}})
    assert sim.state.people.position[0, 0] == pytest.approx(-6.0 + STAIRS_SPEED)


def test_beside_stairs_one_walks_as_fast_as_elsewhere() -> None:
    world = toy_city.world()
    world.__dict__["height"] = replace(world.height, stairs=treads_over(-10.0, -14.0, 10.0, -10.0))
    sim = Simulation(world, None, SimConfig(assistants=1, observe=()))
    sim.scenario.place_agent("assistant_0", (-6.0, -15.0))
    sim.step({"assistant_0": {"type": "move_forward", "distance": 1.0}})
    assert sim.state.people.position[0, 0] == pytest.approx(-5.0)


def test_pedestrians_go_slower_on_stairs() -> None:
    def walked(height: HeightField) -> float:
        traffic = Traffic(network(), height, cars=0, pedestrians=20, seed=3, first_entity=1)
        for _ in range(100):
            traffic.advance(0.1, Bodies.none())
        return float(traffic.pedestrian_state.distance_walked.sum())

    level = HeightField.flat(HALF)
    everywhere = replace(level, stairs=treads_over(-HALF, -HALF, HALF, HALF))
    # 20 people, 10 s, and half a second of setting out.
    assert walked(everywhere) == pytest.approx(20 * 10.0 * STAIRS_SPEED, rel=0.1)
    assert walked(level) > 1.5 * walked(everywhere)
