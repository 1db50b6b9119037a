"""How vehicles stand on slopes: on their axles."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def axle_transforms(xy: Floats, yaw: Floats, half: Floats, heights: Callable[[Floats], Floats]) -> NDArray[np.float32]:
    """Return model to world of vehicles, whose pitch follows the ground between their axles.

    Parameters
    ----------
    xy
        Centres, ENU metres, shape ``(n, 2)``.
    yaw
        Headings, radians counter-clockwise from east, shape ``(n,)``.
    half
        Half of each one's wheelbase, metres, shape ``(n,)``.
    heights
        Gives the height of the ground at points ``(n, 2)``, one for each vehicle, metres.

    Returns
    -------
    ndarray
        Shape ``(n, 4, 4)``.
    """
    n = len(xy)
    c, s = np.cos(yaw), np.sin(yaw)
    along = np.column_stack([c, s]) * half[:, None]
    front, back = (heights(xy + side) for side in (along, -along))
    slope = (front - back) / (2 * half) if n else np.zeros(0)
    size = np.sqrt(1.0 + slope**2)
    transforms = np.zeros((n, 4, 4), np.float32)
    forward = np.column_stack([c / size, s / size, slope / size])
    left = np.column_stack([-s, c, np.zeros(n)])
    transforms[:, :3, 0], transforms[:, :3, 1] = forward, left
    transforms[:, :3, 2] = np.cross(forward, left)
    transforms[:, :2, 3], transforms[:, 2, 3] = xy, (front + back) / 2
    transforms[:, 3, 3] = 1.0
    return transforms
