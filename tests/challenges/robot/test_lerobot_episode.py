"""A folder that LeRobot saved a policy in plays an episode of `vico eval robot`, as a user would type it."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tiny_act import saved_act
from vico.agents.robot.lerobot_policy import LeRobotActor
from vico.challenges.assistant.tasks import Start
from vico.challenges.robot.arm_policies import policy_setting
from vico.challenges.robot.challenge import play_robot_task
from vico.challenges.robot.generate import generate_robot_task
from vico.challenges.robot.tasks import RESIDENTS
from vico.challenges.robot_episodes import world_and_people

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        importlib.util.find_spec("lerobot") is None, reason="needs pip install 'virtual-community[lerobot]'"
    ),
    # Of torch and its kin, which the project's own warnings-are-errors is not about.
    pytest.mark.filterwarnings("ignore"),
]


def test_a_lerobot_folder_plays_an_episode(
    helsinki_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The robot begins before the thing, so that the policy soon has the arm; a random one never picks it."""
    setting = {**policy_setting("vla", str(saved_act(tmp_path / "pretrained_model"))), "period": 0.1}
    world, people = world_and_people(helsinki_path, RESIDENTS)
    task = generate_robot_task(world, people, "deliver", seed=1, steps=8)
    x, y = task.thing.position[:2]
    task = task.model_copy(update={"manipulator": Start(position=(x - 1.0, y), yaw=0.0)})
    asked: list[tuple[str, list[float]]] = []
    act = LeRobotActor.act

    def watched(self: LeRobotActor, observation: Any, instruction: str) -> dict[str, Any]:
        action = act(self, observation, instruction)
        asked.append((instruction, action["vector"]))
        return action

    monkeypatch.setattr(LeRobotActor, "act", watched)
    record = play_robot_task(world, people, task, method="vla", setting=setting, recording=tmp_path / "run")
    assert (record.fault_counts, record.steps, record.metrics["SR"]) == ({}, 8, 0.0)
    assert record.parts[0].cause == "not grasped"
    assert len(asked) > 20  # twenty times a second
    assert asked[0][0] == f"Pick up the {task.thing.name} and put it on the table."
    vectors = np.array([vector for _, vector in asked])
    assert vectors.shape[1] == 11
    assert np.isfinite(vectors).all()
    assert np.ptp(vectors, axis=0)[:9].min() > 0.0
    again = play_robot_task(world, people, task, method="vla", setting=setting)
    assert again.state_hash == record.state_hash
