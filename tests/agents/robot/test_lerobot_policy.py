"""Policies that LeRobot saved act in the real simulation; what is none, or for another robot, is refused in words."""

from __future__ import annotations

import importlib.util
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tiny_act import saved_act
from vico.agents.robot.increments import INCREMENTS, arm_state
from vico.agents.robot.lerobot_policy import CAMERA, LeRobotActor
from vico.challenges.pick_place.episode import play
from vico.challenges.pick_place.tasks import draw_task
from vico.errors import MissingExtraError, MissingFileError, SchemaError

HAS_LEROBOT = importlib.util.find_spec("lerobot") is not None
needs_lerobot = pytest.mark.skipif(not HAS_LEROBOT, reason="needs pip install 'virtual-community[lerobot]'")
# Of torch and its kin, which the project's own warnings-are-errors is not about.
pytestmark = pytest.mark.filterwarnings("ignore")


@pytest.fixture(scope="module")
def policy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return saved_act(tmp_path_factory.mktemp("act") / "pretrained_model")


def observation() -> dict[str, Any]:
    found: list[dict[str, Any]] = []

    class Once:
        def act(self, observation: dict[str, Any], instruction: str) -> None:
            found.append(observation)

    play(draw_task(0, seconds=1), None, Once(), side=64, outputs=("rgb",))
    return found[0]


@needs_lerobot
def test_a_policy_acts_in_the_simulation_by_its_own_pipelines(policy: Path) -> None:
    import torch

    actor = LeRobotActor.read(policy)
    assert actor.cameras == {CAMERA: (64, 64)}
    played = play(draw_task(0, seconds=1), None, actor, side=64, outputs=("rgb",))
    assert played.cause == "out of time"
    assert played.actions.shape == (20, len(INCREMENTS))
    assert 0.0 < np.abs(played.actions).max() < 0.2
    # The first of them is what the network says, scaled back by the pipeline: 0.01 a unit.
    seen = observation()
    actor.reset()
    batch = {
        CAMERA: (torch.from_numpy(seen["rgb"]).permute(2, 0, 1)[None] / 255.0 - 0.5) / 0.25,
        "observation.state": torch.from_numpy(arm_state(seen))[None],
    }
    with torch.inference_mode():
        raw = actor._policy.predict_action_chunk(batch)[0, 0].numpy()
    assert played.actions[0] == pytest.approx(0.01 * raw, abs=1e-4)


@needs_lerobot
def test_policies_for_other_robots_are_refused(tmp_path: Path) -> None:
    with pytest.raises(SchemaError, match=r"has action of shape \(7,\), the manipulator \(11,\)"):
        LeRobotActor.read(saved_act(tmp_path / "seven", actions=7))


@needs_lerobot
def test_what_does_not_fit_its_config_is_refused(policy: Path, tmp_path: Path) -> None:
    other = shutil.copytree(policy, tmp_path / "other")
    config = json.loads((other / "config.json").read_text())
    (other / "config.json").write_text(json.dumps(config | {"dim_model": 64}))
    with pytest.raises(SchemaError, match="do not fit its config"):
        LeRobotActor.read(other)
    (other / "config.json").write_text("{")
    with pytest.raises(SchemaError, match="not the config of a LeRobot policy"):
        LeRobotActor.read(other)


def test_pickled_weights_and_empty_folders_are_refused(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match="no such folder"):
        LeRobotActor.read(tmp_path / "nowhere")
    with pytest.raises(MissingFileError, match=r"holds no model\.safetensors"):
        LeRobotActor.read(tmp_path)
    (tmp_path / "pytorch_model.bin").write_bytes(b"\x80\x04N.")
    with pytest.raises(SchemaError, match="pickled weights can run code and are never read"):
        LeRobotActor.read(tmp_path)
    (tmp_path / "model.safetensors").write_bytes(b"")
    with pytest.raises(MissingFileError, match=r"holds no config\.json"):
        LeRobotActor.read(tmp_path)


@pytest.mark.skipif(HAS_LEROBOT, reason="lerobot is installed")
def test_without_lerobot_it_is_said_what_to_type(tmp_path: Path) -> None:
    for name in ("model.safetensors", "config.json", "policy_preprocessor.json", "policy_postprocessor.json"):
        (tmp_path / name).write_text("{}")
    with pytest.raises(MissingExtraError, match=r"pip install 'virtual-community\[lerobot\]'"):
        LeRobotActor.read(tmp_path)
