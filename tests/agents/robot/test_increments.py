"""Increments and the actions that they stand for."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from felt_arm import sensors
from vico.agents.robot.increments import INCREMENTS, JOINTS, PERIOD, STATE, arm_state, control_of, increments_of
from vico.assets.robots import robot_model
from vico.errors import InputError


def test_names_are_those_of_the_models_motors() -> None:
    assert tuple(name.partition(".")[2] for name in INCREMENTS) == robot_model("manipulator").motors
    assert robot_model("manipulator").joints == JOINTS


def test_the_state_holds_joints_and_speeds_of_the_base_in_its_own_frame() -> None:
    state = arm_state({"sensors": sensors()})
    assert len(state) == len(STATE) == 20
    assert state[:9] == pytest.approx(np.linspace(-0.5, 0.5, 9))
    assert state[9:18] == pytest.approx(np.linspace(1.0, 2.0, 9))
    assert state[18:] == pytest.approx([0.4, 0.3])


def test_a_control_comes_back_from_its_increments() -> None:
    state = arm_state({"sensors": sensors()})
    control = [*np.linspace(-0.4, 0.6, 9).tolist(), 0.25, -0.7]
    increments = increments_of(control, state)
    assert increments[9:] == pytest.approx([0.25 * PERIOD, -0.7 * PERIOD])
    assert increments[:9] == pytest.approx(0.1 * np.ones(9), abs=1e-6)
    assert control_of(increments, state) == {"type": "control", "vector": pytest.approx(control, abs=1e-6)}


def test_the_base_is_told_no_more_than_it_can() -> None:
    vector = control_of([*[0.0] * 9, 5.0, -5.0], arm_state({"sensors": sensors()}))["vector"]
    assert vector[9:] == [0.8, -1.2]


@pytest.mark.parametrize("vector", [[0.0] * 10, [float("nan")] * 11, 1.0])
def test_what_is_no_action_is_refused(vector: Any) -> None:
    with pytest.raises(InputError, match="give 11 finite numbers"):
        control_of(vector, arm_state({"sensors": sensors()}))


def test_other_robots_have_no_such_state() -> None:
    with pytest.raises(InputError, match="a robot of 12 joints"):
        arm_state({"sensors": sensors(12)})
