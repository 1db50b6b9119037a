"""A tiny random ACT policy, saved in a folder as LeRobot's training does."""

from __future__ import annotations

from pathlib import Path

import pytest

from torchvision_without_kernels import make_importable
from vico.agents.robot.increments import INCREMENTS, STATE
from vico.agents.robot.lerobot_policy import CAMERA


def saved_act(folder: Path, *, actions: int = len(INCREMENTS), camera: str = CAMERA) -> Path:
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
