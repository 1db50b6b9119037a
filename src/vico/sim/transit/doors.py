"""Doors of buses and trams: how far they are open, and where their leaves are then."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vico.exact import product

#: Seconds that doors take to open or close.
DOOR_TIME = 1.6
_PLUG = 0.05  # metres that open leaves stand out from the side


def moved_doors(share: float, wanted: bool, dt: float) -> float:
    """Return how far doors are open, 0..1, that have opened (or closed, if that is wanted) for `dt` seconds more."""
    return min(max(share + (dt if wanted else -dt) / DOOR_TIME, 0.0), 1.0)


def leaf_transforms(
    bases: NDArray[np.float64], leaves: Sequence[tuple[float, float, float]], share: NDArray[np.float64], width: float
) -> NDArray[np.float64]:
    """Return where door leaves are, an open one before the wall beside its door.

    Parameters
    ----------
    bases
        Model to world of each vehicle, shape ``(n, 4, 4)``.
    leaves
        Of each leaf when closed the middle's x and y in the vehicle, metres, and which way along x it slides.
    share
        How far the doors of each vehicle are open, 0..1, shape ``(n,)``.
    width
        Metres that a leaf slides.

    Returns
    -------
    ndarray
        Shape ``(leaves * n, 4, 4)``, leaf by leaf.
    """
    n = len(bases)
    found = []
    for x, y, way in leaves:
        local = np.tile(np.eye(4), (n, 1, 1))
        local[:, 0, 3] = x + share * width * way
        local[:, 1, 3] = y + math.copysign(_PLUG, y) * np.minimum(share * 8.0, 1.0)
        found.append(product(bases, local))
    return np.concatenate(found) if found else np.zeros((0, 4, 4))
