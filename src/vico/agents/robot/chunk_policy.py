"""A learned policy of a mobile manipulator: from a picture, its joints and an instruction to the next second's actions.

The policy is a file of plain arrays (``.npz``): weights, scales and sizes; `scripts/train_chunk_policy.py` makes it. It
runs on torch (extra ``imitation``), which is imported when a policy is read.
"""

from __future__ import annotations

import json
import math
import re
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.agents.base import FieldState
from vico.agents.robot.increments import BASE, INCREMENTS, JOINTS, STATE, ChunkShape, arm_state, control_of
from vico.errors import InputError, MissingExtraError, MissingFileError, SchemaError
from vico.exact import apply_matrix, each
from vico.io.arrays import read_npz

Array = NDArray[np.float32]

_SCHEMA, _VERSION = "vico.chunk_policy", 1
_WEIGHT, _SHAPE = "weight/", "shape"
#: What pictures, states and actions are scaled by, as named in the file.
SCALES = ("state_mean", "state_std", "action_mean", "action_std")
_ARM = len(JOINTS)


def word_ids(instruction: str, shape: ChunkShape) -> NDArray[np.int64]:
    """Return the numbers of an instruction's words, 1 and up, then zeros; int64, shape ``(words,)``.

    A word's number is its CRC-32, so that none has to be known before.
    """
    words = re.findall(r"[^\W_]+", instruction.lower())[: shape.words]
    numbers = np.zeros(shape.words, np.int64)
    numbers[: len(words)] = [1 + zlib.crc32(word.encode()) % shape.vocabulary for word in words]
    return numbers


def downscale_picture(picture: NDArray[np.uint8], side: int) -> NDArray[np.uint8]:
    """Return a square picture at a smaller side, pixels: colours averaged.

    Raises
    ------
    InputError
        If it is smaller than that, or no square.
    """
    if picture.shape[0] != picture.shape[1] or len(picture) < side:
        raise InputError(
            f"picture: {picture.shape[1]} x {picture.shape[0]} pixels; give a square one of {side} or more"
        )
    if len(picture) == side:
        return picture
    return np.asarray(Image.fromarray(picture).resize((side, side), Image.Resampling.BOX))


def relative_chunk(states: Array, actions: Array) -> Array:
    """Return what a policy is taught for the first of some frames: actions as seen from there.

    Places of the servos count from where the joints are at the first frame, so that a chunk is one motion whatever the
    joints do meanwhile; ways of the base stay those of each period.

    Parameters
    ----------
    states, actions
        Of the frames, shapes ``(k, 20)`` and ``(k, 11)``, as a dataset holds them.
    """
    found = actions.copy()
    found[:, :_ARM] += states[:, :_ARM] - states[0, :_ARM]
    return found


class ChunkPolicy:
    """A policy that was read.

    Parameters
    ----------
    shape
        Its sizes.
    scales
        Mean and spread of states, shape ``(state,)``, and actions, shape ``(chunk, action)``; see `SCALES`.
    network
        A `vico.agents.robot._chunk_network.ChunkNetwork`.
    """

    def __init__(self, shape: ChunkShape, scales: Mapping[str, Array], network: Any) -> None:
        self.shape, self.scales, self.network = shape, dict(scales), network
        network.eval()

    @classmethod
    def read(cls, path: Path) -> ChunkPolicy:
        """Read a policy.

        Raises
        ------
        MissingExtraError
            If torch is not installed.
        MissingFileError
            If there is no such file.
        SchemaError
            If it is no file of plain arrays, or they do not fit each other or the robot.
        """
        arrays = _arrays_of(path)
        shape = _shape_of(arrays, path)
        torch, network = new_network(shape)
        expected = network.state_dict()
        weights = {name.removeprefix(_WEIGHT): value for name, value in arrays.items() if name.startswith(_WEIGHT)}
        for name, value in expected.items():
            found = weights.pop(name, None)
            if found is None or found.shape != tuple(value.shape) or not np.isfinite(found).all():
                shaped = "missing" if found is None else f"of shape {found.shape}"
                raise SchemaError(f"{path}: weight {name} is {shaped}, not finite {tuple(value.shape)}; train it anew")
            expected[name] = torch.from_numpy(np.ascontiguousarray(found, np.float32))
        if weights:
            raise SchemaError(f"{path}: no weight is called {min(weights)}; train it anew")
        network.load_state_dict(expected)
        sizes = {"state": (shape.state,), "action": (shape.chunk, shape.action)}
        for name in SCALES:
            size = sizes[name.partition("_")[0]]
            if name not in arrays or arrays[name].shape != size or not np.isfinite(arrays[name]).all():
                raise SchemaError(f"{path}: {name} is not {size} finite numbers; train it anew")
        return cls(shape, {name: arrays[name].astype(np.float32) for name in SCALES}, network)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return all of it as arrays, as `read` wants the file."""
        about = {"schema_name": _SCHEMA, "version": _VERSION, **asdict(self.shape)}
        weights = {f"{_WEIGHT}{name}": value.cpu().numpy() for name, value in self.network.state_dict().items()}
        return {_SHAPE: np.frombuffer(json.dumps(about).encode(), np.uint8), **self.scales, **weights}

    def chunk(self, picture: NDArray[np.uint8], state: Array, instruction: str) -> Array:
        """Return the coming actions, as `relative_chunk` has them, float32, shape ``(chunk, action)``.

        Parameters
        ----------
        picture
            What the robot's camera shows, square, of the policy's side or more, uint8.
        state
            Of `arm_state`.
        instruction
            In words.
        """
        import torch

        scaled = (state - self.scales["state_mean"]) / self.scales["state_std"]
        with torch.inference_mode():
            found = self.network(
                torch.from_numpy(np.array(downscale_picture(picture, self.shape.side)))[None],
                torch.from_numpy(scaled.astype(np.float32))[None],
                torch.from_numpy(word_ids(instruction, self.shape))[None],
            )[0].numpy()
        return np.asarray(found * self.scales["action_std"] + self.scales["action_mean"], np.float32)


class ChunkActor(FieldState):
    """Acts with a policy, twenty times a second.

    Parameters
    ----------
    policy
        That it asks.
    every
        Actions after which it is asked anew; at most as many as a chunk has.
    ensemble
        Temporal ensembling, as ACT has it (there 0.01): the policy is asked before each action, and all that it said of
        that action is averaged, the oldest with a weight of 1, the i-th after it with ``exp(-ensemble * i)``; None for
        none.

    Raises
    ------
    InputError
        If `every` is no number of actions of a chunk, or `ensemble` is negative.
    """

    # Chunks, the newest first, each with the arm's places as it was asked, and how many actions ago that was.
    _chunks: NDArray[np.float32]
    _ages: NDArray[np.int64]

    def __init__(self, policy: ChunkPolicy, *, every: int = 10, ensemble: float | None = None) -> None:
        every = 1 if ensemble is not None else every
        if not 1 <= every <= policy.shape.chunk:
            raise InputError(f"chunk policy: asked every {every} actions; give 1 to {policy.shape.chunk}")
        if ensemble is not None and not ensemble >= 0.0:
            raise InputError(f"chunk policy: ensemble {ensemble}; give 0 or more")
        self._policy, self._every, self._ensemble = policy, every, ensemble
        self.reset()

    def reset(self) -> None:
        """Forget what was to be done: a new episode begins."""
        shape = self._policy.shape
        self._chunks = np.zeros((0, shape.chunk, shape.action), np.float32)
        self._ages = np.zeros(0, np.int64)

    def act(self, observation: Mapping[str, Any], instruction: str) -> dict[str, Any]:
        """Return the action for the coming period.

        Parameters
        ----------
        observation
            With ``rgb`` and ``sensors``.
        instruction
            In words.
        """
        state = arm_state(observation)
        if not len(self._ages) or self._ages[0] >= self._every:
            chunk = self._policy.chunk(observation["rgb"], state, instruction)
            chunk[:, :_ARM] += state[:_ARM]
            kept = slice(0, None if self._ensemble is not None else 0)
            self._chunks = np.concatenate([chunk[None], self._chunks[kept]])
            self._ages = np.concatenate([[0], self._ages[kept]])
        alive = self._ages < self._policy.shape.chunk
        self._chunks, self._ages = self._chunks[alive], self._ages[alive]
        weights = each(math.exp, -(self._ensemble or 0.0) * (self._ages.max() - self._ages))
        said = self._chunks[np.arange(len(self._ages)), self._ages].astype(np.float64)
        action = apply_matrix(weights / weights.sum(), said.T)
        self._ages += 1
        action[:_ARM] -= state[:_ARM]
        return control_of(action, state)


def new_network(shape: ChunkShape) -> tuple[Any, Any]:
    """Return torch, and an untrained network of some sizes.

    Raises
    ------
    MissingExtraError
        If torch is not installed.
    """
    try:
        import torch
    except ImportError:
        raise MissingExtraError(
            "chunk policy: torch is not installed: pip install 'virtual-community[imitation]'"
        ) from None
    from vico.agents.robot._chunk_network import ChunkNetwork

    return torch, ChunkNetwork(shape)


def _arrays_of(path: Path) -> dict[str, NDArray[Any]]:
    try:
        return read_npz(path.read_bytes())
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such file; train it with scripts/train_chunk_policy.py") from None
    except (ValueError, OSError, EOFError, zipfile.BadZipFile, zlib.error):
        raise SchemaError(
            f"{path}: not a policy: policies are archives of plain arrays (.npz), and pickled weights, which could run "
            "code, are never read; train one with scripts/train_chunk_policy.py"
        ) from None


def _shape_of(arrays: Mapping[str, NDArray[Any]], path: Path) -> ChunkShape:
    try:
        about = json.loads(arrays[_SHAPE].astype(np.uint8).tobytes())
        if (about.pop("schema_name"), about.pop("version")) != (_SCHEMA, _VERSION):
            raise ValueError("of another kind or version")
        shape = ChunkShape(**about)
    except (KeyError, ValueError, TypeError, AttributeError) as error:
        raise SchemaError(f"{path}: says no sizes of a policy ({error}); train it anew") from None
    whole = {name: value for name, value in asdict(shape).items() if name != "dropout"}
    if any(type(value) is not int or not 1 <= value <= 4096 for value in whole.values()) or shape.width % shape.heads:
        raise SchemaError(f"{path}: sizes {whole} are out of range; train it anew")
    if (shape.state, shape.action) != (len(STATE), len(INCREMENTS)):
        raise SchemaError(
            f"{path}: for {shape.state} numbers of state and {shape.action} of action; the manipulator has "
            f"{len(STATE)} and {len(INCREMENTS)} ({_ARM} joints and fingers, {' and '.join(BASE)})"
        )
    return shape
