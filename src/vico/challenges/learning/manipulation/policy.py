"""Trained policies as plain arrays: dense layers with ELU between them, run by numpy alone."""

from __future__ import annotations

import math
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import MissingFileError, SchemaError
from vico.exact import apply_matrix, each
from vico.io.files import new_file
from vico.io.npz import read_npz

Numbers = NDArray[np.float32]

_KNOWN = ("weight_", "bias_")


@dataclass(frozen=True)
class ArrayPolicy:
    """A network from observations to actions.

    Attributes
    ----------
    weights, biases
        Of its layers, float32, shapes ``(outputs, inputs)`` and ``(outputs,)``.
    mean, deviation
        Observations are shifted and scaled by these first, shape ``(inputs,)``.
    """

    weights: tuple[Numbers, ...]
    biases: tuple[Numbers, ...]
    mean: Numbers
    deviation: Numbers

    @property
    def inputs(self) -> int:
        """How many numbers an observation has."""
        return int(self.weights[0].shape[1])

    @property
    def outputs(self) -> int:
        """How many numbers an action has."""
        return int(self.weights[-1].shape[0])

    def act(self, observation: NDArray[Any]) -> Numbers:
        """Return actions, float32, shape ``(..., outputs)``, each number from -1 to 1.

        Parameters
        ----------
        observation
            Shape ``(..., inputs)``.

        Raises
        ------
        SchemaError
            If observations have another number of entries.
        """
        x = np.asarray(observation, np.float32)
        if x.shape[-1:] != (self.inputs,):
            raise SchemaError(
                f"policy: an observation of shape {x.shape} for a network of {self.inputs} inputs; make the "
                "environment with the task and observation that it was trained on"
            )
        x = np.asarray((x - self.mean) / self.deviation, np.float32)
        for layer, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            x = np.asarray(apply_matrix(x, weight) + bias, np.float32)
            if layer < len(self.weights) - 1:
                x = np.where(x > 0.0, x, each(math.expm1, np.minimum(x, 0.0)).astype(np.float32))
        return np.clip(x, -1.0, 1.0).astype(np.float32)


def write_policy(path: Path, policy: ArrayPolicy) -> None:
    """Write a policy as an archive of plain arrays.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    layers = zip(policy.weights, policy.biases, strict=True)
    arrays = {name: a for k, (w, b) in enumerate(layers) for name, a in ((f"weight_{k}", w), (f"bias_{k}", b))}
    with new_file(path) as temporary, temporary.open("wb") as file:
        np.savez(file, allow_pickle=False, mean=policy.mean, deviation=policy.deviation, **arrays)


def read_policy(path: Path | str, *, inputs: int | None = None, outputs: int | None = None) -> ArrayPolicy:
    """Read a policy; nothing in the file is ever run.

    Parameters
    ----------
    inputs, outputs
        What it is to have.

    Raises
    ------
    MissingFileError
        If there is no such file.
    SchemaError
        If it is no archive of plain arrays, or its arrays do not fit each other or what was asked for.
    """
    path = Path(path)
    try:
        arrays = read_npz(path.read_bytes())
    except FileNotFoundError:
        raise MissingFileError(f"policy: {path}: no such file") from None
    except (ValueError, OSError, EOFError, zipfile.BadZipFile, zlib.error):
        raise SchemaError(
            f"policy: {path} is no archive of plain arrays (pickled objects are refused); write it with "
            "scripts/train_manipulation.py"
        ) from None
    policy = _policy_of(path, arrays)
    for what, has, wanted in (("inputs", policy.inputs, inputs), ("outputs", policy.outputs, outputs)):
        if wanted is not None and has != wanted:
            raise SchemaError(
                f"policy: {path} has {has} {what}, not {wanted}: it was trained on another task or observation"
            )
    return policy


def _policy_of(path: Path, arrays: Mapping[str, NDArray[Any]]) -> ArrayPolicy:
    count = sum(name.startswith("weight_") for name in arrays)
    names = {f"{kind}{k}" for kind in _KNOWN for k in range(count)} | {"mean", "deviation"}
    if not count or names != set(arrays):
        raise SchemaError(f"policy: {path} holds {', '.join(sorted(arrays))[:200] or 'nothing'}; expected weight_0, "
                          "bias_0, weight_1 and on, mean and deviation")  # fmt: skip
    for name, array in arrays.items():
        if array.dtype != np.float32 or not np.isfinite(array).all():
            raise SchemaError(f"policy: {path}: {name} is {array.dtype}, or holds NaN; all have to be finite float32")
    weights = tuple(arrays[f"weight_{k}"] for k in range(count))
    biases = tuple(arrays[f"bias_{k}"] for k in range(count))
    width = arrays["mean"].shape
    for k, (weight, bias) in enumerate(zip(weights, biases, strict=True)):
        if weight.ndim != 2 or weight.shape[1:] != width or bias.shape != weight.shape[:1]:
            raise SchemaError(
                f"policy: {path}: weight_{k} has shape {weight.shape} and bias_{k} {bias.shape} after {width}; "
                "layers have to fit each other"
            )
        width = bias.shape
    if arrays["deviation"].shape != arrays["mean"].shape or not (arrays["deviation"] > 0.0).all():
        raise SchemaError(f"policy: {path}: deviation has to have the shape of mean, and to be above 0")
    return ArrayPolicy(weights, biases, arrays["mean"], arrays["deviation"])
