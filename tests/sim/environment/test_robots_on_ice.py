"""Robots grip wet, snowy and icy ground less: measured beside the same drive on dry ground."""

from __future__ import annotations

import numpy as np
import pytest

import toy_city
from robot_field import field
from vico.sim.bodies.arrays import Bodies
from vico.sim.config import SimConfig
from vico.sim.environment import Agenda, Environment, EventSites, Sky
from vico.sim.loop.simulation import Simulation
from vico.sim.robots import RobotPopulation, RobotStatus
from vico.world.world import World


def grip_in(kind: str) -> float:
    agenda = Agenda(EventSites(toy_city.world()))
    return Environment(
        Sky.over(60.17, 24.94, "2026-01-15"), kind, seed=0, second=12 * 3600.0, agenda=agenda
    ).conditions.grip


def robot_in(kind: str, weather: str) -> RobotPopulation:
    robots = RobotPopulation(field(), [kind], [[0, 0, 0]], packs=False)
    robots.set_grip(grip_in(weather))
    return robots


def run(robots: RobotPopulation, seconds: float) -> None:
    for _ in range(round(seconds * 10)):
        robots.advance(0.1, Bodies.none())


def stopping_distance(kind: str, weather: str) -> float:
    """How far a robot at walking speed goes after it was told to stop, metres."""
    robots = robot_in(kind, weather)
    robots.drive(0, (0.8, 0.0, 0.0))
    run(robots, 4.0)
    before = robots.bodies().position[0].copy()
    robots.stop(0)
    run(robots, 4.0)
    assert robots.status[0] != RobotStatus.FALLEN
    return float(np.hypot(*(robots.bodies().position[0] - before)[:2]))


def test_grip_is_a_share_of_that_on_dry_ground() -> None:
    assert grip_in("clear") == 1.0
    assert grip_in("rain") == pytest.approx(0.55 / 0.9)
    assert grip_in("snow") == pytest.approx(0.25 / 0.9)
    assert grip_in("freezing_rain") == pytest.approx(0.1 / 0.9)


@pytest.mark.parametrize("kind", ["husky", "go2"])
def test_robots_slide_on_ice_before_they_stand(kind: str) -> None:
    dry, snow, ice = (stopping_distance(kind, weather) for weather in ("clear", "snow", "freezing_rain"))
    # Both brake by less than what packed snow allows (2 m/s^2 and more); ice allows 0.8 m/s^2.
    assert snow == pytest.approx(dry, abs=0.05)
    assert ice > dry + 0.1


def test_dry_ground_is_as_if_nobody_had_told() -> None:
    told, other = robot_in("husky", "clear"), RobotPopulation(field(), ["husky"], [[0, 0, 0]], packs=False)
    for robots in (told, other):
        robots.drive(0, (0.8, 0.0, 0.3))
        run(robots, 2.0)
    for name, array in told.arrays().items():
        np.testing.assert_array_equal(array, other.arrays()[name], err_msg=name)


def test_two_runs_of_one_scene_each_keep_their_own_ground() -> None:
    dry = robot_in("husky", "clear")
    icy = RobotPopulation(dry.world, ["husky"], [[0, 0, 0]], packs=False, scene=dry.scene)
    icy.set_grip(grip_in("freezing_rain"))
    alone = robot_in("husky", "clear")
    for robots in (dry, icy, alone):
        robots.drive(0, (1.0, 0.0, 0.0))
    for _ in range(20):
        for robots in (icy, dry, alone):
            robots.advance(0.1, Bodies.none())
    np.testing.assert_array_equal(dry.base_poses(), alone.base_poses())
    assert icy.base_poses()[0, 0] < dry.base_poses()[0, 0] - 0.01


def test_robots_go_on_exactly_from_a_snapshot_while_it_freezes(helsinki: World) -> None:
    config = SimConfig(robots=("husky", "go2"), errands=True, observe=(), date="2026-01-15", weather="clear", seed=2)
    one, other = (Simulation(helsinki, None, config) for _ in range(2))
    one.state.environment.change_weather("freezing_rain", over=10.0)
    one.state.environment.arrays()["ground"][:] = 0.0, 0.0, 0.2
    for _ in range(4):
        one.step({})
    other.restore(one.snapshot())
    for _ in range(6):
        assert one.step({}).hash == other.step({}).hash
    assert one.state.environment.conditions.grip < 0.5
