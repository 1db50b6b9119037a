"""Robots that nobody has seen before are told, drawn, felt, saved and recorded by what their models say alone."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

import robot_kinds
from robot_field import field
from vico.assets.robots import ActionSpace, SkidSteering, register_robot, robot_model
from vico.assets.shapes import box
from vico.errors import InputError
from vico.sim.bodies.arrays import Bodies
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.robots import RobotPopulation, RobotStatus

PLACES = [[0, 0, 0], [5, 0, 0.5]]


@pytest.fixture(autouse=True)
def _known() -> Iterator[None]:
    with robot_kinds.known():
        yield


@pytest.fixture
def robots() -> RobotPopulation:
    return RobotPopulation(field(), ["chain", "rotors"], PLACES, packs=False)


def run(robots: RobotPopulation, seconds: float) -> None:
    for _ in range(round(seconds * 10)):
        robots.advance(0.1, Bodies.none())


def test_each_joint_follows_its_own_number(robots: RobotPopulation) -> None:
    targets = np.linspace(-0.3, 0.3, 13)
    robots.command(0, targets)
    run(robots, 2.0)
    assert robots.joint_positions()[0] == pytest.approx(targets, abs=0.06)
    assert robots.joint_names(0) == robot_kinds.JOINTS


def test_vectors_are_clipped_to_each_joints_own_bounds(robots: RobotPopulation) -> None:
    robots.command(0, np.full(13, 9.0))
    assert robots.run.arrays.command[0, :13] == pytest.approx(np.linspace(0.4, 1.0, 13))


def test_four_rotors_lift_what_has_no_joints(robots: RobotPopulation) -> None:
    robots.command(1, [3.0, 3.0, 3.0, 3.0])  # 12 N against 9.8 N
    run(robots, 2.0)
    assert robots.bodies().position[1, 2] > 1.0
    assert robots.status[1] != RobotStatus.FALLEN
    assert robots.joint_positions()[1].shape == (0,)


def test_a_robot_that_flies_is_a_body_where_it_flies(robots: RobotPopulation) -> None:
    robots.command(1, [4.0, 4.0, 4.0, 4.0])
    run(robots, 2.0)
    bottom = robots.engine.base(1).position[2] - 0.04
    assert robots.bodies().position[1, 2] == pytest.approx(bottom)


def test_robots_without_a_controller_follow_no_velocities(robots: RobotPopulation) -> None:
    with pytest.raises(InputError, match="follows no velocities"):
        robots.drive(0, (1.0, 0.0, 0.0))
    with pytest.raises(InputError, match="follows no velocities"):
        robots.follow(1, [(0, 0), (5, 0)])


def test_they_feel_what_their_models_name(robots: RobotPopulation) -> None:
    chain, rotors = robots.observation(0), robots.observation(1)
    assert chain["joint_position"].shape == chain["joint_velocity"].shape == (13,)
    assert "base_pose" not in chain
    assert "joint_position" not in rotors
    assert rotors["base_pose"].shape == (7,)


def test_they_are_saved_and_restored_exactly(robots: RobotPopulation) -> None:
    robots.command(0, np.linspace(-0.3, 0.3, 13))
    robots.command(1, [2.6, 2.5, 2.5, 2.6])
    run(robots, 0.5)
    saved = robots.arrays()
    run(robots, 0.5)
    expected = robots.arrays()
    robots.restore(saved)
    run(robots, 0.5)
    found = robots.arrays()
    assert all(np.array_equal(found[name], expected[name]) for name in expected)


def test_a_deck_is_where_the_model_says() -> None:
    sim = Simulation(field(), None, SimConfig(assistants=1, robots=("chain",), seed=2, observe=()))
    x, y, _ = sim.state.robots.bodies().position[0]
    sim.scenario.place_agent("assistant_0", (x + 0.9, y, 0.0))
    where = sim.state.people.position[0]
    thing = sim.scenario.add_object("parcel", "parcel", [box((0.1, 0.1, 0.1), (0, 0, 0.05))], where, size=[0.1] * 3)
    sim.step({"assistant_0": {"type": "pick", "hand": 0, "object": thing}})
    deck = int(sim.state.robots.entities[0])
    told = sim.step({"assistant_0": {"type": "put", "hand": 0, "target": deck}}).observations["assistant_0"]["state"]
    assert told["action_status"] == "ok"
    base = sim.state.robots.engine.base(0)
    place = base.rotation.T @ (sim.state.objects.position[0] - base.position)
    assert 0.1 <= place[0] <= 0.3
    assert place[2] == pytest.approx(0.1, abs=1e-9)


def test_a_simulation_takes_their_vectors_and_refuses_others() -> None:
    sim = Simulation(field(), None, SimConfig(robots=("chain", "rotors"), observe=()))
    good = {"type": "control", "vector": [0.1] * 13}
    result = sim.step({"robot_0": good, "robot_1": {"type": "control", "vector": [0.1] * 13}})
    told = {name: seen["state"] for name, seen in result.observations.items()}
    assert told["robot_0"]["action_status"] == "ok"
    assert told["robot_1"]["action_code"] == "wrong_size"
    assert "thrust" in told["robot_1"]["action_reason"]
    result = sim.step({"robot_0": {"type": "go_to", "target": [3.0, 3.0, 0.0]}})
    assert result.observations["robot_0"]["state"]["action_code"] == "not_able"


def test_an_agent_acts_as_often_as_its_robots_model_asks_and_is_obeyed_at_once() -> None:
    config = SimConfig(robots=("chain", "rotors"), observe=(), periods={"robots": "model"})
    sim = Simulation(field(), None, config)
    assert sim.due == ["robot_0", "robot_1"]
    heights = []
    for k in range(40):
        push = 4.0 if k < 20 else 0.0
        actions = {name: {"type": "control", "vector": [push] * 4} for name in sim.due if name == "robot_1"}
        result = sim.step(actions)
        heights.append(float(sim.state.robots.base_poses()[1, 2]))
    assert sim.state.tick - sim.periods.start == 40  # hundredths of a second
    assert set(result.observations) == {"robot_0", "robot_1"}
    rising = np.diff(heights)
    # 16 N against 9.8 N lift it faster and faster; without them it slows down from the first frame on.
    assert np.all(np.diff(rising[10:19]) > 0.0)
    assert np.all(np.diff(rising[19:39]) < 0.0)


def test_a_model_whose_parts_do_not_fit_is_refused() -> None:
    model = robot_kinds.chain(False)
    with pytest.raises(InputError, match="12 servos for 13 motors"):
        replace(model, servos=("position",) * 12)
    short = ActionSpace("motors", ("a",), ("rad",), np.zeros(1), np.ones(1))
    with pytest.raises(InputError, match="needs 13 entries"):
        replace(model, action_spaces={"joints": short})
    with pytest.raises(InputError, match="no multiple of"):
        replace(model, control_period=0.015)
    with pytest.raises(InputError, match="go together"):
        replace(model, controller=SkidSteering(0.1, 0.2, 1.0))


def test_names_are_taken_once_and_spaces_are_checked() -> None:
    with pytest.raises(InputError, match="is there already"):
        register_robot("husky", robot_kinds.chain)
    with pytest.raises(InputError, match="no action space 'legs'; choose among joints, velocity"):
        robot_model("go2:legs", packs=False)
    assert robot_model("go2:velocity", packs=False).default_space == "velocity"
