"""Robots steered by hand: a Husky drives, a drone flies, and an arm's hand goes where it is led."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import robot_field
from vico.agents.human import HeldInput, HumanAgent, Mailbox
from vico.assets.robots import robot_model
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.viewer.play import hints_of
from vico.viewer.teleoperation import HAND_SPEED, HandTeleoperation, steering_of


class Driven:
    """A robot on an open field, with somebody at the keys."""

    def __init__(self, model: str) -> None:
        config = SimConfig(
            robots=(model,), robot_places={"robot_0": (0.0, 0.0, 0.0)}, periods={"robot_0": 0.1}, observe=()
        )
        self.sim = Simulation(robot_field.field(), None, config)
        self.mailbox = Mailbox(clock=lambda: 0.0)
        self.steer = steering_of(model)
        self.human = HumanAgent(self.mailbox, steer=self.steer)
        self._seq = 0

    def hold(self, *keys: str, seconds: float, **axes: float) -> None:
        self._seq += 1
        self.mailbox.hold(HeldInput(self._seq, frozenset(keys), None, None, axes))
        for _ in range(round(seconds * 10)):
            observations, infos = self.sim.observe(self.sim.due)
            action = self.human.act(observations["robot_0"], infos["robot_0"])
            result = self.sim.step({"robot_0": action})
            assert result.observations["robot_0"]["state"]["action_status"] == "ok"

    @property
    def position(self) -> Any:
        assert self.sim.state.robots is not None
        return self.sim.state.robots.bodies().position[0].copy()

    @property
    def yaw(self) -> float:
        assert self.sim.state.robots is not None
        return float(self.sim.state.robots.bodies().yaw[0])

    @property
    def hand(self) -> Any:
        """Where an arm's hand is, in the base's frame."""
        assert isinstance(self.steer, HandTeleoperation)
        assert self.sim.state.robots is not None
        return self.steer.pose_of(np.asarray(self.sim.state.robots.joint_positions()[0][:7], np.float64))[:, 3]


def test_a_husky_drives_ahead_turns_and_stops() -> None:
    robot = Driven("husky")
    robot.hold("forward", seconds=3)
    assert robot.position[0] > 1.0
    robot.hold("turn_left", seconds=2)
    assert robot.yaw > 0.5
    robot.hold(seconds=1.5)
    before = robot.position
    robot.hold(seconds=1)
    assert np.linalg.norm(robot.position - before) < 0.05


def test_a_drone_climbs_and_flies_ahead() -> None:
    robot = Driven("drone")
    robot.hold("up", seconds=3)
    assert robot.position[2] > 2.0
    height = robot.position[2]
    robot.hold("forward", seconds=3)
    assert robot.position[0] > 3.0
    assert abs(robot.position[2] - height) < 1.5
    assert [hint["text"] for hint in hints_of(robot.sim, "robot_0")] == ["land"]


@pytest.mark.parametrize(("axis", "k"), [("hand_x", 0), ("hand_y", 1), ("hand_z", 2)])
def test_an_arms_hand_goes_where_it_is_led_and_stays(axis: str, k: int) -> None:
    robot = Driven("manipulator")
    robot.hold(seconds=1)
    start = robot.hand
    way = -1.0 if axis == "hand_z" else 1.0
    robot.hold(seconds=1.5, **{axis: way})
    robot.hold(seconds=1)
    moved = robot.hand - start
    assert way * moved[k] > 0.3 * HAND_SPEED * 1.5
    assert np.abs(np.delete(moved, k)).max() < 0.12
    still = robot.hand
    robot.hold(seconds=1)
    assert np.linalg.norm(robot.hand - still) < 0.02


def test_an_arm_on_wheels_drives_and_opens_its_grip() -> None:
    robot = Driven("manipulator")
    robot.hold("forward", "grip_open", seconds=3)
    assert robot.position[0] > 0.5
    assert robot.sim.state.robots is not None
    fingers = robot.sim.state.robots.joint_positions()[0][7:9]
    assert (np.asarray(fingers) > 0.1).all()


def test_every_model_has_a_way_to_be_steered() -> None:
    for name in ("husky", "go2", "h1", "drone", "manipulator"):
        assert callable(steering_of(name))
    assert isinstance(steering_of("manipulator"), HandTeleoperation)
    assert robot_model("manipulator").name == "manipulator"
