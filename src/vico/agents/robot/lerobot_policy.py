"""Runs a user's LeRobot policy (ACT, diffusion, SmolVLA, pi0, ...) on the mobile manipulator (extra ``lerobot``).

A policy is a folder as LeRobot 0.4 saves one: ``config.json``, ``model.safetensors``, and the pipelines that scale what
goes in and what comes out (``policy_preprocessor.json``, ``policy_postprocessor.json``). It is read from the disk, not
from a hub, and never from pickled weights, which could run code.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.agents.robot.increments import INCREMENTS, STATE, arm_state, control_of
from vico.errors import InputError, MissingExtraError, MissingFileError, SchemaError, sentence_of
from vico.seeds import rng

#: What our datasets call the robot's camera, and LeRobot the state and the actions.
CAMERA, _STATE, _ACTION = "observation.images.ego", "observation.state", "action"
_NO_CAMERA = "empty_camera"
_CONFIG, _WEIGHTS = "config.json", "model.safetensors"
_PROCESSORS = ("policy_preprocessor.json", "policy_postprocessor.json")
_PICKLED = (".bin", ".pt", ".pth", ".pkl", ".pickle", ".ckpt")


class LeRobotActor:
    """Acts with a LeRobot policy, twenty times a second; it keeps its own chunk of actions.

    Parameters
    ----------
    policy
        A ``PreTrainedPolicy``.
    preprocess, postprocess
        Its pipelines, as ``make_pre_post_processors`` returns them.
    seed
        Decides what a policy leaves to chance, as diffusion does.

    Attributes
    ----------
    cameras
        Height and width of the picture that it looks at, by what it calls it; empty if it looks at none.

    Raises
    ------
    SchemaError
        If the policy is for another robot: another state, or other actions.
    """

    def __init__(self, policy: Any, preprocess: Any, postprocess: Any, *, seed: int = 0) -> None:
        self._policy, self._preprocess, self._postprocess, self._seed = policy, preprocess, postprocess, seed
        self.cameras = _camera_sizes(policy.config, "policy")
        self.reset()

    @classmethod
    def read(cls, folder: Path, *, device: str = "cpu", seed: int = 0) -> LeRobotActor:
        """Read a policy.

        Parameters
        ----------
        folder
            That LeRobot's training saved it in: ``.../checkpoints/last/pretrained_model``.
        device
            That it runs on, as torch calls it.
        seed
            Decides what it leaves to chance.

        Raises
        ------
        MissingExtraError
            If lerobot is not installed.
        MissingFileError
            If the folder, or a file in it, is not there.
        SchemaError
            If it is none of LeRobot's policies, its weights do not fit it, or it is for another robot.
        """
        _check_files(folder)
        factory, configs = _lerobot()
        try:
            config = configs.PreTrainedConfig.from_pretrained(folder, local_files_only=True)
        except Exception as error:  # draccus, json and LeRobot itself each have errors of their own
            raise SchemaError(
                f"{folder / _CONFIG}: not the config of a LeRobot policy ({sentence_of(error)})"
            ) from None
        _camera_sizes(config, str(folder))
        config.device = device
        # Weights of the whole network are in the folder; those that a backbone began with would come from a hub.
        if getattr(config, "pretrained_backbone_weights", None) is not None:
            config.pretrained_backbone_weights = None
        try:
            kind = factory.get_policy_class(config.type)
            with redirect_stdout(sys.stderr):  # it prints
                policy = kind.from_pretrained(folder, config=config, local_files_only=True, strict=True)
            place = {"device_processor": {"device": device}}
            processors = factory.make_pre_post_processors(config, str(folder), preprocessor_overrides=place)
        except ImportError as error:
            raise MissingExtraError(f"{folder}: {config.type} needs more than lerobot alone: {error}") from None
        except Exception as error:  # wrong shapes and damaged files end in many kinds of errors
            raise SchemaError(
                f"{folder}: its weights or pipelines do not fit its config ({sentence_of(error)}); save the policy anew"
            ) from None
        return cls(policy, *processors, seed=seed)

    def reset(self) -> None:
        """Forget what was to be done: a new episode begins."""
        self._step = 0
        self._policy.reset()
        for pipeline in (self._preprocess, self._postprocess):
            if callable(getattr(pipeline, "reset", None)):
                pipeline.reset()

    def act(self, observation: Mapping[str, Any], instruction: str) -> dict[str, Any]:
        """Return the action for the coming period.

        Parameters
        ----------
        observation
            With ``rgb`` and ``sensors``.
        instruction
            In words.

        Raises
        ------
        InputError
            If what the policy returns is no action of the manipulator.
        """
        import torch

        state = arm_state(observation)
        batch: dict[str, Any] = {
            _STATE: torch.from_numpy(state)[None],
            "task": instruction,
            "robot_type": "manipulator",
        }
        for name, size in self.cameras.items():
            picture = torch.from_numpy(resize_picture(observation["rgb"], size)).permute(2, 0, 1).contiguous()
            batch[name] = picture[None].float() / 255.0
        chance = rng(self._seed, "lerobot policy", self._step)
        self._step += 1
        with torch.inference_mode(), torch.random.fork_rng(devices=()):
            torch.manual_seed(int(chance.integers(2**31)))
            chosen = self._postprocess(self._policy.select_action(self._preprocess(batch)))
        vector = np.asarray(chosen.detach().to("cpu", torch.float32)).reshape(-1)
        try:
            return control_of(vector, state)
        except InputError as error:
            raise InputError(f"LeRobot policy: {error}") from None


def resize_picture(picture: NDArray[np.uint8], size: tuple[int, int]) -> NDArray[np.uint8]:
    """Return a picture in another height and width, pixels."""
    if picture.shape[:2] == size:
        return np.array(picture)
    return np.array(Image.fromarray(picture).resize(size[::-1], Image.Resampling.BOX))


def _check_files(folder: Path) -> None:
    if not folder.is_dir():
        raise MissingFileError(f"{folder}: no such folder; give the one that LeRobot saved a policy in")
    if not (folder / _WEIGHTS).exists():
        pickled = sorted(path.name for path in folder.iterdir() if path.suffix in _PICKLED)
        if pickled:
            raise SchemaError(
                f"{folder / pickled[0]}: pickled weights can run code and are never read; save the policy as {_WEIGHTS}"
            )
        raise MissingFileError(f"{folder}: holds no {_WEIGHTS}; give the folder that LeRobot saved a policy in")
    for name in (_CONFIG, *_PROCESSORS):
        if not (folder / name).exists():
            raise MissingFileError(
                f"{folder}: holds no {name}, which LeRobot 0.4 saves beside the weights; with an older policy run "
                "lerobot's migrate_policy_normalization first"
            )


def _lerobot() -> tuple[Any, Any]:
    os.environ.setdefault("HF_HUB_OFFLINE", "1")  # what is missing is an error, not a download
    try:
        import lerobot.configs.policies as configs
        import lerobot.policies.factory as factory
    except (ImportError, RuntimeError) as error:  # the latter of a torchvision that does not fit torch
        raise MissingExtraError(
            f"LeRobot policy: lerobot cannot be imported ({error}): pip install 'virtual-community[lerobot]'"
        ) from None
    return factory, configs


def _camera_sizes(config: Any, where: str) -> dict[str, tuple[int, int]]:
    """Return height and width of the pictures that a policy looks at, by name.

    Raises
    ------
    SchemaError
        If it asks for what the manipulator does not have.
    """
    given, made = dict(config.input_features or {}), dict(config.output_features or {})
    for name, wanted, found in ((_STATE, len(STATE), given), (_ACTION, len(INCREMENTS), made)):
        shape = tuple(found[name].shape) if name in found else None
        if shape != (wanted,) and not (name == _STATE and shape is None):
            raise SchemaError(
                f"{where}: the policy has {name} of shape {shape}, the manipulator {(wanted,)}; train it on what "
                "vico dataset build --challenge pick_place makes"
            )
    cameras: dict[str, tuple[int, int]] = {}
    for name, feature in given.items():
        shape = tuple(feature.shape)
        if name == _STATE or _NO_CAMERA in name:  # the policy itself fills in for cameras that are not there
            continue
        if "image" not in name or len(shape) != 3 or shape[0] != 3:
            raise SchemaError(f"{where}: the policy asks for {name} of shape {shape}; the manipulator has {CAMERA}")
        cameras[name] = shape[1:]
    if len(cameras) > 1:
        raise SchemaError(
            f"{where}: the policy asks for {', '.join(cameras)}; the manipulator has one camera, {CAMERA}"
        )
    return cameras
