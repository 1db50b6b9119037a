"""Who is in view of whom, by sight lines."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import toy_city
from vico.agents.schedule import followers_of
from vico.runner.gather import Gatherer
from vico.sim.bodies.arrays import Bodies
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.perception import OUTDOORS, SIGHT, InView, OpaqueGrid, Viewpoints, in_view, opaque_grid
from vico.world.public import PublicMap


def wall() -> OpaqueGrid:
    """A wall 6 m high along x = 5, from y = -5 to y = 4."""
    level = np.zeros((200, 200), np.uint16)
    level[90:108, 110:112] = 1
    return OpaqueGrid(level, np.array([-np.inf, 6.0], np.float32), half=50.0)


def person(x: float, y: float, z: float = 0.0) -> Bodies:
    """A passer-by."""
    one = np.ones(1)
    return Bodies(
        np.array([7], np.int32), np.array([6], np.int8), np.array([[x, y, z]]), 0 * one, 0.25 * one, 0.25 * one,
        1.7 * one, np.zeros((1, 2)),
    )  # fmt: skip


def seen(bodies: Bodies, *, yaw: float = 0.0, space: int = OUTDOORS, theirs: int = OUTDOORS) -> InView:
    """What somebody at the origin sees."""
    eyes = Viewpoints(np.array([[0.0, 0.0, 1.6]]), np.array([yaw]), np.array([1], np.int32), np.array([space]))
    return in_view(
        eyes, bodies, np.full(len(bodies), theirs), wall(), {7: {"kind": "pedestrian", "name": "Ann", "agent": "ann"}}
    ).of(0)


@pytest.mark.parametrize(
    ("x", "y", "visible"),
    [
        (4.0, 0.0, True),
        (10.0, 0.0, False),  # behind the wall
        (10.0, 20.0, False),  # beyond the angle of view
        (10.0, 9.0, True),  # the line passes the wall's end
        (-4.0, 0.0, False),  # behind the back
        (SIGHT + 1.0, SIGHT + 1.0, False),
    ],
)
def test_walls_angle_and_distance_decide_who_is_seen(x: float, y: float, visible: bool) -> None:
    assert len(seen(person(x, y))) == visible


def test_one_sees_over_a_wall_from_above_and_a_drone_over_it() -> None:
    assert len(seen(person(10.0, 0.0, z=30.0))) == 1


def test_another_room_is_out_of_view_and_the_own_one_has_no_buildings_in_it() -> None:
    assert len(seen(person(4.0, 0.0), space=3)) == 0
    assert len(seen(person(10.0, 0.0), space=3, theirs=3)) == 1


def test_what_is_seen_tells_who_and_how_far() -> None:
    view = seen(Bodies.joined([person(4.0, 0.0), replace(person(3.0, 0.0), entity=np.array([8], np.int32))]))
    assert [(body.entity, body.name, body.distance) for body in view] == [(8, "", 3.0), (7, "Ann", 4.0)]
    assert [body.entity for body in view.within(3.5)] == [8]
    assert list(view.agents_within(10.0)) == ["ann"]
    assert list(view.agents_within(3.5)) == []
    assert view.nearest(("pedestrian",)) == 3.0
    assert view.nearest(("car",)) == math.inf


def test_the_tops_of_buildings_lie_over_their_outlines() -> None:
    world = toy_city.world()
    grid = opaque_grid(world)
    assert grid is opaque_grid(world)
    building = world.buildings[0]
    x, y = np.mean(building.footprint[0], axis=0)
    column, row = (int((value + grid.half) / grid.cell) for value in (x, y))
    assert grid.tops[grid.level[row, column]] == pytest.approx(building.base + building.height)


def day(observe: tuple[str, ...] | None, steps: int) -> list[str]:
    """State hashes of a morning in the toy city."""
    world, people = toy_city.world(), toy_city.community()
    config = SimConfig(start=7 * 3600 + 59 * 60, observe=observe, cars=0, pedestrians=0, image=32)
    sim = Simulation(world, people, config)
    agents = Gatherer(followers_of(people, PublicMap.from_world(world)))
    observations: dict[str, dict[str, Any]]
    observations, infos = sim.observe()
    hashes = []
    for _ in range(steps):
        gathered = agents.gather(observations, infos)
        result = sim.step(gathered.actions, gathered.agent_faults)
        observations, infos = result.observations, result.infos
        hashes.append(result.hash)
    assert not gathered.agent_faults
    return hashes


def test_a_day_is_the_same_whether_anybody_s_view_is_rendered_or_not() -> None:
    assert day((), 150) == day(None, 150)
