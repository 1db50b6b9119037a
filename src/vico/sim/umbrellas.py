"""How people lean their umbrellas so that two of them never pass through each other."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vico.exact import each

_APART = 0.04  # metres between two rims
_STEEPEST = 0.6  # radians


def lean_apart(
    canopies: NDArray[np.float64], radius: NDArray[np.float64], shaft: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return how far umbrellas lean, each about its fist: away from those that theirs would touch.

    A rim of radius r on a shaft of length h, leant by t, reaches r cos t - h sin t towards the other side; each of two
    neighbours leans so far that its rim ends short of where they share out what is between them.

    Parameters
    ----------
    canopies
        Their middles when nobody leans, ENU metres, shape ``(n, 3)``.
    radius, shaft
        Of each, metres, shape ``(n,)``.

    Returns
    -------
    NDArray[np.float64]
        Horizontal direction times angle, radians, ENU, shape ``(n, 2)``.
    """
    lean = np.zeros((len(canopies), 2))
    if len(canopies) < 2:
        return lean
    pairs = cKDTree(canopies).query_pairs(2.0 * (float(radius.max()) + _APART), output_type="ndarray")
    first, second = np.concatenate([pairs, pairs[:, ::-1]]).T
    away = canopies[first, :2] - canopies[second, :2]
    distance = np.hypot(*away.T)
    share = radius[first] / (radius[first] + radius[second])
    reach = np.hypot(radius, shaft)[first]
    may = np.clip((distance * share - _APART / 2) / reach, -1.0, 1.0)
    angle = np.maximum(each(math.acos, may) - each(math.atan2, shaft, radius)[first], 0.0)
    np.add.at(lean, first, away * (angle / np.maximum(distance, 1e-6))[:, None])
    steep = np.hypot(*lean.T)
    return lean * np.minimum(1.0, _STEEPEST / np.maximum(steep, 1e-9))[:, None]
