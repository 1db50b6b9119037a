"""Texture coordinates of facades: whole bays along a wall, whole storeys up it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.worldgen.facades.textures.walls import BAYS, STOREYS


def bays(length: NDArray[np.float64], wished: NDArray[np.float64]) -> NDArray[np.float64]:
    """How many bays walls of these lengths get: whole numbers, at least one."""
    return np.maximum(np.round(length / wished), 1.0)


def bay_coordinates(
    along: NDArray[np.float64], length: NDArray[np.float64], count: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Horizontal texture coordinate at a distance along a wall, in sheets of `BAYS` bays."""
    return along / length * count / BAYS


def storey_coordinates(
    z: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64], count: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Vertical texture coordinate of upper floors between two heights, in sheets of `STOREYS` storeys."""
    return (z - low) / (high - low) * count / STOREYS
