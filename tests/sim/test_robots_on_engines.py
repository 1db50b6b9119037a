"""The same robots do the same on every physics engine, as far as two models of contact agree."""

from typing import Any

import numpy as np
import pytest

from robot_field import ENGINES, field, people
from vico.errors import InputError
from vico.sim.bodies.arrays import Bodies
from vico.sim.config import PHYSICS_ENGINES, SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.physics import engine
from vico.sim.robots import RobotPopulation, RobotScene, RobotStatus

KINDS = ("husky", "go2", "drone", "manipulator")
PLACES = [[0, 0, 0], [0, 6, 0], [0, 12, 0], [0, -6, 0]]
HUSKY, GO2, DRONE, MANIPULATOR = range(4)
WORLD = field()


@pytest.fixture(scope="module", params=ENGINES)
def scene(request: Any) -> RobotScene:
    return RobotScene(WORLD, KINDS, packs=False, physics=request.param)


@pytest.fixture
def robots(scene: RobotScene) -> RobotPopulation:
    return RobotPopulation(WORLD, KINDS, PLACES, packs=False, scene=scene)


def run(robots: RobotPopulation, seconds: float, bodies: Bodies | None = None) -> list[tuple[int, str]]:
    found = []
    for _ in range(round(seconds * 10)):
        robots.advance(0.1, bodies if bodies is not None else Bodies.none())
        found += [(event.robot, event.kind) for event in robots.events()]
    return found


def test_they_stand_where_they_are_put(robots: RobotPopulation) -> None:
    assert run(robots, 2.0) == []
    bases = [robots.engine.base(robot) for robot in range(4)]
    heights = [base.position[2] for base in bases]
    # Husky's wheels and Go2's feet sink by what each engine's contact lets them.
    assert heights == pytest.approx([0.132, 0.30, 0.227, 0.1], abs=0.035)
    assert min(base.rotation[2, 2] for base in bases) > 0.99
    assert np.abs([base.position[:2] for base in bases] - np.array(PLACES)[:, :2]).max() < 0.05
    assert robots.observation(GO2)["contacts"].sum() == pytest.approx(15.0 * 9.81, rel=0.1)
    assert robots.observation(HUSKY)["specific_force"] == pytest.approx([0, 0, 9.81], abs=0.2)


def test_they_drive_walk_and_turn_as_fast_as_they_are_told(robots: RobotPopulation) -> None:
    robots.drive(HUSKY, (0.8, 0, 0))
    robots.drive(GO2, (0.6, 0, 0))
    robots.drive(MANIPULATOR, (0.4, 0, 0.3))
    run(robots, 2.0)
    before = robots.bodies()
    x, yaw = before.position[:, 0].copy(), before.yaw.copy()
    assert run(robots, 3.0) == []
    moved = robots.bodies().position[:, 0] - x
    assert moved[HUSKY] == pytest.approx(2.4, rel=0.05)
    assert 1.2 < moved[GO2] < 2.1
    assert robots.bodies().yaw[MANIPULATOR] - yaw[MANIPULATOR] == pytest.approx(0.9, abs=0.15)
    assert robots.engine.base(GO2).rotation[2, 2] > 0.95


def test_go2_turns_and_stops(robots: RobotPopulation) -> None:
    robots.drive(GO2, (0.0, 0.0, 0.8))
    run(robots, 1.0)
    before = robots.engine.base(GO2).yaw
    run(robots, 2.0)
    assert robots.engine.base(GO2).yaw - before == pytest.approx(1.6, abs=0.3)
    robots.stop(GO2)
    assert run(robots, 1.5) == []
    here = robots.run.position(GO2).copy()
    run(robots, 1.0)
    assert np.linalg.norm(robots.run.position(GO2) - here) < 0.03


def test_they_stop_before_a_person_and_do_not_touch_them(robots: RobotPopulation) -> None:
    ahead = people((3.5, 0.0), (3.0, 6.0))
    robots.drive(HUSKY, (0.8, 0, 0))
    robots.drive(GO2, (0.6, 0, 0))
    run(robots, 7.0, ahead)
    for robot, person in ((HUSKY, 3.5), (GO2, 3.0)):
        nose = robots.bodies().position[robot, 0] + robots.models[robot].half_length
        assert 0.2 < person - 0.25 - nose < 1.5
        assert robots.status[robot] == RobotStatus.WAITING


def test_a_drone_flies_to_a_point_and_lands(robots: RobotPopulation) -> None:
    robots.fly_to(DRONE, [2, 12, 3])
    assert run(robots, 6.0) == [(DRONE, "arrived")]
    assert robots.run.position(DRONE) == pytest.approx([2, 12, 3], abs=0.1)
    robots.land(DRONE)
    assert run(robots, 12.0) == [(DRONE, "landed")]


def test_a_population_restored_on_its_way_goes_on_bit_for_bit(scene: RobotScene, robots: RobotPopulation) -> None:
    other = RobotPopulation(WORLD, KINDS, PLACES, packs=False, scene=scene)
    person = people((2.5, 0.2), velocity=(0.0, 0.05))
    robots.go_to(HUSKY, (6, 1))
    robots.drive(GO2, (0.5, 0, 0.2))
    robots.fly_to(DRONE, [1, 12, 2])
    run(robots, 1.3, person)
    other.restore({name: array.copy() for name, array in robots.arrays().items()})
    for _ in range(8):
        robots.advance(0.1, person)
        other.advance(0.1, person)
    mine, theirs = robots.arrays(), other.arrays()
    assert [name for name in mine if not np.array_equal(mine[name], theirs[name])] == []


def test_engines_that_are_not_there_are_told_in_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    assert tuple(engine.known_engines()) == PHYSICS_ENGINES
    with pytest.raises(InputError, match="no physics 'bullet'; choose among mujoco, genesis"):
        SimConfig(physics="bullet")
    monkeypatch.setattr(engine, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"'genesis' needs the package genesis.*pip install '.*\[genesis\]'"):
        Simulation(WORLD, None, SimConfig(robots=("husky",), physics="genesis", observe=()))
