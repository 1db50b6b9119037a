"""Statistics as formats of trainers want them: exact, of vectors and of pictures, for an episode and for all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Shares whose quantiles are told, by name.
QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}

Statistics = dict[str, list[Any]]


def vector_statistics(values: NDArray[Any]) -> Statistics:
    """Return min, max, mean, std, count and quantiles of each column.

    Parameters
    ----------
    values
        Shape ``(n,)`` or ``(n, d)``, n at least 1; a single column is told as a list of one.
    """
    columns = np.asarray(values, np.float64).reshape(len(values), -1)
    found = {
        "min": columns.min(axis=0),
        "max": columns.max(axis=0),
        "mean": columns.mean(axis=0),
        "std": columns.std(axis=0),
    }
    found |= {name: np.quantile(columns, share, axis=0) for name, share in QUANTILES.items()}
    return {name: numbers.tolist() for name, numbers in found.items()} | {"count": [len(columns)]}


def colour_counts(pictures: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Return how many pixels have each value, int64, shape ``(3, 256)``; pictures of any leading shape."""
    pixels = pictures.reshape(-1, 3)
    return np.stack([np.bincount(pixels[:, channel], minlength=256) for channel in range(3)]).astype(np.int64)


def colour_statistics(counts: NDArray[np.int64], pictures: int) -> Statistics:
    """Return statistics of colours in 0..1, each a list of shape ``(3, 1, 1)``; exact, for bytes have 256 values.

    Parameters
    ----------
    counts
        Of `colour_counts`, added up over all pictures.
    pictures
        How many they were.
    """
    values = np.arange(256) / 255.0
    total = counts.sum(axis=1)
    mean = counts @ values / total
    variance = np.maximum(counts @ values**2 / total - mean**2, 0.0)
    below = np.cumsum(counts, axis=1)
    found = {"min": _first(counts > 0), "max": 255 - _first(counts[:, ::-1] > 0)}
    columns = {name: place / 255.0 for name, place in found.items()} | {"mean": mean, "std": np.sqrt(variance)}
    for name, share in QUANTILES.items():
        columns[name] = _first(below >= share * total[:, None]) / 255.0
    return {name: numbers.reshape(3, 1, 1).tolist() for name, numbers in columns.items()} | {"count": [pictures]}


def _first(mask: NDArray[np.bool_]) -> NDArray[np.int64]:
    return np.argmax(mask, axis=1)


def depth_moments(pictures: NDArray[np.float32]) -> Mapping[str, float]:
    """Return sums over the pixels at which something is, from which `depth_statistics` are made."""
    seen = pictures[pictures > 0.0].astype(np.float64)  # 0 stands for nothing
    if not len(seen):
        return {"pixels": 0.0, "sum": 0.0, "squares": 0.0, "min": float("inf"), "max": 0.0}
    return {
        "pixels": float(len(seen)),
        "sum": float(seen.sum()),
        "squares": float((seen**2).sum()),
        "min": float(seen.min()),
        "max": float(seen.max()),
    }


def depth_statistics(moments: Sequence[Mapping[str, float]], pictures: int) -> Statistics:
    """Return min, max, mean and std of depth, metres, over the pixels at which something is; shape ``(1, 1)`` each."""
    pixels = sum(one["pixels"] for one in moments)
    if not pixels:
        return {name: [[0.0]] for name in ("min", "max", "mean", "std")} | {"count": [pictures]}
    mean = sum(one["sum"] for one in moments) / pixels
    variance = max(sum(one["squares"] for one in moments) / pixels - mean**2, 0.0)
    found = {
        "min": min(one["min"] for one in moments),
        "max": max(one["max"] for one in moments),
        "mean": mean,
        "std": variance**0.5,
    }
    return {name: [[number]] for name, number in found.items()} | {"count": [pictures]}
