"""Policies that LeRobot saved act in the real simulation; what is none, or for another robot, is refused in words."""

from __future__ import annotations

import importlib.util
import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from torchvision_without_kernels import make_importable
from vico.agents.robot.increments import INCREMENTS, STATE, arm_state
from vico.agents.robot.lerobot_policy import CAMERA, LeRobotActor
from vico.challenges.pick_place.episode import play
from vico.challenges.pick_place.task import draw_task
from vico.errors import MissingExtraError, MissingFileError, SchemaError

HAS_LEROBOT = importlib.util.find_spec("lerobot") is not None
needs_lerobot = pytest.mark.skipif(not HAS_LEROBOT, reason="needs pip install 'virtual-community[lerobot]'")
# Of torch and its kin, which the project's own warnings-are-errors is not about.
pytestmark = pytest.mark.filterwarnings("ignore")


def saved(folder: Path, *, actions: int = len(INCREMENTS), camera: str = CAMERA) -> Path:
    """Save a tiny random ACT policy as LeRobot's training does."""
    if why := make_importable():
        pytest.skip(f"lerobot needs a torchvision that can be imported beside this torch ({why})")
    import torch
    from lerobot.configs.types import FeatureType, PolicyFeature
    from lerobot.policies.act.configuration_act import ACTConfig
    from lerobot.policies.act.modeling_act import ACTPolicy
    from lerobot.policies.factory import make_pre_post_processors

    torch.manual_seed(0)
    small = {"dim_model": 32, "n_heads": 2, "dim_feedforward": 32, "n_encoder_layers": 1, "n_vae_encoder_layers": 1}
    config = ACTConfig(
        input_features={
            camera: PolicyFeature(FeatureType.VISUAL, (3, 64, 64)),
            "observation.state": PolicyFeature(FeatureType.STATE, (len(STATE),)),
        },
        output_features={"action": PolicyFeature(FeatureType.ACTION, (actions,))},
        chunk_size=4,
        n_action_steps=2,
        pretrained_backbone_weights=None,
        device="cpu",
        push_to_hub=False,
        **small,
    )
    statistics = {
        "observation.state": {"mean": torch.zeros(len(STATE)), "std": torch.ones(len(STATE))},
        "action": {"mean": torch.zeros(actions), "std": torch.full((actions,), 0.01)},
        camera: {"mean": torch.full((3, 1, 1), 0.5), "std": torch.full((3, 1, 1), 0.25)},
    }
    ACTPolicy(config).save_pretrained(folder)
    for pipeline in make_pre_post_processors(config, dataset_stats=statistics):
        pipeline.save_pretrained(folder)
    return folder


@pytest.fixture(scope="module")
def policy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return saved(tmp_path_factory.mktemp("act") / "pretrained_model")


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
        LeRobotActor.read(saved(tmp_path / "seven", actions=7))


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
