"""Every kind of robot feels its joints, its motion, what it touches, how full its battery is and whether it lies."""

import numpy as np
import pytest

from robot_field import field
from vico.assets.robots import robot_names
from vico.sim.bodies.arrays import Bodies
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.robots import RobotPopulation, commands
from vico.sim.robots.hardware import EXCHANGE, watch_batteries
from vico.world.walkable import CROSSING, ROADWAY, SIDEWALK

KINDS = tuple(robot_names())
JOINTS = {"husky": 4, "go2": 12, "drone": 4, "manipulator": 9, "h1": 10}
CONTACTS = {"husky": 5, "go2": 4, "drone": 1, "manipulator": 2, "h1": 2}


@pytest.fixture(scope="module")
def robots() -> RobotPopulation:
    """One of each kind, after a second of standing."""
    made = RobotPopulation(field(), KINDS, [[0, 4 * k, 0] for k in range(len(KINDS))], packs=False)
    run(made, 1.0)
    return made


def run(robots: RobotPopulation, seconds: float) -> list[tuple[int, str]]:
    found = []
    for _ in range(round(seconds * 10)):
        robots.advance(0.1, Bodies.none())
        found += [(event.robot, event.kind) for event in robots.events()]
    return found


def test_all_kinds_feel_the_same_things(robots: RobotPopulation) -> None:
    assert len(KINDS) == 5
    for robot, kind in enumerate(KINDS):
        felt = robots.observation(robot)
        assert {name: array.shape for name, array in felt.items()} == {
            name: reading.shape for name, reading in robots.readings(robot).items()
        }
        assert felt["joint_position"].shape == felt["joint_velocity"].shape == (JOINTS[kind],)
        assert felt["angular_velocity"].shape == felt["specific_force"].shape == felt["gravity"].shape == (3,)
        assert felt["contacts"].shape == (CONTACTS[kind],)
        assert 0.9 < felt["battery"][0] <= 1.0
        assert felt["fallen"] == [0]
        assert felt["specific_force"] == pytest.approx([0, 0, 9.81], abs=0.5)


def test_what_stands_feels_its_weight_where_it_touches_the_ground(robots: RobotPopulation) -> None:
    weights = {"husky": 50.0, "go2": 15.0, "drone": 2.06, "h1": 51.4}
    for kind, mass in weights.items():
        felt = robots.observation(KINDS.index(kind))["contacts"]
        assert felt.sum() == pytest.approx(mass * 9.81, rel=0.1), kind


def test_work_drains_a_battery_and_rotors_are_the_joints_of_a_drone(robots: RobotPopulation) -> None:
    husky, drone = KINDS.index("husky"), KINDS.index("drone")
    used = []
    for speed in (0.0, 1.0):
        robots.drive(husky, (speed, 0, 0))
        run(robots, 1.0)
        before = robots.observation(husky)["battery"][0]
        run(robots, 1.0)
        used.append((before - robots.observation(husky)["battery"][0]) * 24.0 * 20.0 * 3600.0)
    # 50 W of computer and motors; wheels that drive it do work.
    assert used[0] == pytest.approx(50.0, abs=1.0)
    assert 55.0 < used[1] < 150.0
    robots.stop(husky)
    robots.fly_to(drone, robots.run.position(drone) + np.array([0.0, 0.0, 2.0]))
    run(robots, 1.0)
    felt = robots.observation(drone)
    assert np.abs(felt["joint_velocity"]) == pytest.approx(felt["rotor_speed"])
    assert sorted(np.sign(felt["joint_velocity"])) == [-1, -1, 1, 1]
    robots.land(drone)


def test_an_empty_battery_stops_a_robot_until_it_is_exchanged() -> None:
    sim = Simulation(field(), None, SimConfig(robots=("husky",), observe=(), seed=1))
    robots = sim.state.robots
    assert isinstance(robots, RobotPopulation)
    robots.drive(0, (0.8, 0, 0))
    robots.run.arrays.charge[0] = 0.1 + 1e-6
    sim.advance(1.0)
    robots.run.arrays.charge[0] = 1e-6
    sim.advance(1.0)
    assert [event.text for event in sim.state.events.log][-2:] == ["battery_low", "battery_empty"]
    told = sim.step({"robot_0": {"type": "go_to", "target": [5.0, 5.0, 0.0]}}).observations["robot_0"]
    assert told["sensors"]["battery"] == [0.0]
    assert told["state"]["action_code"] == "not_able"
    assert "the battery is empty" in told["state"]["action_reason"]
    robots.drive(0, (0.8, 0, 0))  # nor do those obey who are told past the actions
    sim.advance(1.0)
    here = robots.run.position(0).copy()
    sim.advance(1.0)
    assert np.allclose(robots.run.position(0), here, atol=1e-3)
    for _ in range(round(EXCHANGE)):
        watch_batteries(robots.run, 1.0)
    assert robots.observation(0)["battery"] == pytest.approx([1.0], abs=1e-3)
    assert robots.events()[-1].kind == "recharged"


def test_who_stands_idle_with_a_low_battery_gets_a_full_one_and_who_goes_on_does_not() -> None:
    made = RobotPopulation(field(), ("husky", "husky"), [[0, 0, 0], [0, 4, 0]], packs=False)
    arrays = made.run.arrays
    arrays.charge[:] = 0.05
    made.drive(1, (0.5, 0, 0))
    for _ in range(round(EXCHANGE)):
        watch_batteries(made.run, 1.0)
    assert arrays.charge[0] == 1.0
    assert arrays.charge[1] < 0.05
    assert [(event.robot, event.kind) for event in made.events()] == [(0, "recharged")]


def test_errands_end_with_a_low_battery_but_not_where_vehicles_drive(monkeypatch: pytest.MonkeyPatch) -> None:
    made = RobotPopulation(field(), ("husky",), [[0, 0, 0]], packs=False)
    made.run.arrays.errand[0] = 1
    asked = []
    monkeypatch.setattr(commands, "errand_path", lambda run, robot: asked.append(robot))
    ground = made.run.scene.world.walkable
    for charge, below, goes in ((0.5, SIDEWALK, 1), (0.05, SIDEWALK, 0), (0.05, ROADWAY, 1), (0.05, CROSSING, 1)):
        monkeypatch.setattr(type(ground), "class_of", lambda self, x, y, below=below: below)
        made.run.arrays.charge[0] = charge
        asked.clear()
        commands._rest(made.run, 0, 6.0)
        assert len(asked) == goes
