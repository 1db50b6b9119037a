"""What is fixed about robots is built once and shared; only robots with a camera see."""

import hashlib
from dataclasses import replace

import numpy as np
import pytest

import robot_kinds
from robot_field import field
from vico.assets.robots import catalogue
from vico.errors import InputError
from vico.sim.bodies.arrays import Bodies
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.robots import RobotPopulation, RobotScene

PLACES = [[0, 0, 0], [0, 6, 0]]


def digest(robots: RobotPopulation) -> str:
    for robot in range(len(robots)):
        robots.drive(robot, (0.5, 0.0, 0.3))
    for _ in range(10):
        robots.advance(0.1, Bodies.none())
    found = hashlib.sha256()
    for name, array in robots.arrays().items():
        found.update(name.encode() + np.ascontiguousarray(array).tobytes())
    return found.hexdigest()


def test_populations_that_share_a_scene_are_as_if_each_had_its_own() -> None:
    world, kinds = field(), ["husky", "go2"]
    scene = RobotScene(world, kinds, packs=False)
    first, second = (RobotPopulation(world, kinds, PLACES, packs=False, scene=scene) for _ in range(2))
    own = RobotPopulation(world, kinds, PLACES, packs=False)
    assert first.engine is not second.engine
    assert digest(first) == digest(second) == digest(own)


def test_simulations_of_a_world_share_what_is_fixed() -> None:
    world = field()
    config = SimConfig(robots=("husky", "go2"), observe=())
    first, second = (Simulation(world, None, replace(config, seed=seed)) for seed in (1, 2))
    assert first.state.robots.scene is second.state.robots.scene


def test_a_scene_of_other_robots_is_refused() -> None:
    world = field()
    scene = RobotScene(world, ["husky"], packs=False)
    with pytest.raises(InputError, match="another world or other robots"):
        RobotPopulation(world, ["go2"], PLACES[:1], scene=scene)


def test_a_robot_without_a_camera_is_given_no_pictures() -> None:
    with robot_kinds.known():
        sim = Simulation(field(), None, SimConfig(robots=("chain", "rotors")))
        assert [sim.agents[i] for i in sim.seeing] == ["robot_1"]
        with pytest.raises(InputError, match="robot_0 has no camera"):
            Simulation(field(), None, SimConfig(robots=("chain", "rotors"), observe=("robot_0",)))
    assert "chain" not in catalogue.robot_names()


def test_a_robot_is_called_by_its_kind_whatever_its_action_space() -> None:
    sim = Simulation(field(), None, SimConfig(robots=("go2:velocity",), observe=()))
    entity = int(sim.state.robots.entities[0])
    assert sim.entity(entity)["name"] == "go2 0"
