"""Robots' spaces: vectors in real units within real bounds, and room for what their sensors give."""

from collections.abc import Iterator

import numpy as np
import pytest

import robot_kinds
import toy_city
import vico
from vico.assets.robots import robot_model
from vico.envs import CommunityEnv
from vico.envs.check import check_env

KINDS = ("go2", "husky", "go2:velocity", "chain", "rotors")


@pytest.fixture(scope="module")
def env() -> Iterator[CommunityEnv]:
    with robot_kinds.known():
        yield vico.make(toy_city.world(), toy_city.community(), residents=0, robots=KINDS, observe="none", max_steps=3)


def vector_space(env: CommunityEnv, robot: int):
    return env.action_space(f"robot_{robot}")["vector"]


def test_go2_can_be_told_to_stand(env: CommunityEnv) -> None:
    rest = robot_model("go2").rest
    assert rest.min() == -1.5
    assert vector_space(env, 0).contains(rest.astype(np.float32))


@pytest.mark.parametrize(
    ("robot", "low", "high"),
    [
        (0, [-1.0472, -1.5708, -2.7227], [1.0472, 3.4907, -0.8378]),  # Unitree's description of Go2, front left leg
        (1, [-8.0] * 3, [8.0] * 3),  # rad/s of Husky's wheels
        (2, [-0.9, -0.4, -1.0], [0.9, 0.4, 1.0]),
        (3, [-1.0, -0.95, -0.9], [0.4, 0.45, 0.5]),
        (4, [0.0] * 3, [8.0] * 3),
    ],
)
def test_bounds_are_those_of_the_model_in_its_units(
    env: CommunityEnv, robot: int, low: list[float], high: list[float]
) -> None:
    space = vector_space(env, robot)
    assert space.low[:3] == pytest.approx(low, abs=1e-6)
    assert space.high[:3] == pytest.approx(high, abs=1e-6)


def test_spaces_are_as_wide_as_each_robots_own(env: CommunityEnv) -> None:
    assert [vector_space(env, k).shape for k in range(5)] == [(12,), (4,), (3,), (13,), (4,)]


def test_a_vector_arrives_unscaled(env: CommunityEnv) -> None:
    env.reset(seed=0)
    rest = robot_model("go2").rest
    env.step({"robot_0": {"vector": rest.astype(np.float32)}})
    assert env.sim.state.robots.run.arrays.command[0, :12] == pytest.approx(rest, abs=1e-6)


def test_another_space_is_named_in_the_action(env: CommunityEnv) -> None:
    env.reset(seed=0)
    observations, *_ = env.step({"robot_0": {"type": "control", "space": "velocity", "vector": [0.5, 0.0, 0.0]}})
    assert observations["robot_0"]["state"]["action_status"] == "ok"
    observations, *_ = env.step({"robot_0": {"type": "control", "space": "wings", "vector": [0.5, 0.0, 0.0]}})
    assert "joints, velocity" in observations["robot_0"]["state"]["action_reason"]


def test_observations_hold_the_sensors_and_fit_their_space(env: CommunityEnv) -> None:
    observations, _ = env.reset(seed=0)
    for name in env.agents:
        assert env.observation_space(name).contains(observations[name])
    sensors = [set(observations[f"robot_{k}"]["sensors"]) for k in range(5)]
    assert sensors[0] >= {"joint_position", "joint_velocity", "angular_velocity", "gravity", "fallen"}
    assert "base_pose" not in sensors[3]
    assert "joint_position" not in sensors[4]


def test_the_environment_keeps_its_promises(env: CommunityEnv) -> None:
    assert check_env(env, max_steps=3) == []
