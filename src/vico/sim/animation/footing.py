"""The ground under people's feet: where each foot stands or comes down, how high it is there and how it slopes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled
from vico.sim.animation.blending import is_gait, is_seated
from vico.sim.animation.gait import foothold, gait_of_run, gait_of_walk
from vico.sim.animation.limbs import ANKLE, stance
from vico.sim.animation.names import RUN
from vico.sim.animation.rotations import Y
from vico.sim.animation.seated import seated_foot
from vico.sim.animation.stride import stride_length
from vico.sim.animation.style import KERNEL_STYLE

# Heel and ball of a foot, shares of its length behind the ankle and before it.
_HEEL, _BALL = 1.0, 1.05
# Steeper than this under one foot is an edge: the foot stands on it.
_EDGE = 0.22


def ground_under_feet(
    clip: NDArray[Any],
    phase: NDArray[Any],
    speed: NDArray[Any],
    style: NDArray[Any],
    place: tuple[NDArray[np.float64], NDArray[np.float64]],
    height: Callable[[NDArray[np.float64]], NDArray[np.float64]],
) -> NDArray[np.float64]:
    """Return the ground where people's feet stand and where they come down next.

    Parameters
    ----------
    clip, phase, speed, style
        As in `vico.sim.animation.pose`.
    place
        Feet, ENU metres, shape ``(n, 3)``, and headings, radians, shape ``(n,)``.
    height
        Heights of the ground, or of the deck that is nearest, at points of shape ``(m, 3)``.

    Returns
    -------
    ndarray
        For each left and right foot, where it is or was last and where it comes down next: height above where the
        person is, metres, and slope, radians, toes down; shape ``(n, 2, 2, 2)``.
    """
    position, yaw = place
    people = style.astype(KERNEL_STYLE)
    numbers = np.ascontiguousarray(clip, np.int64)
    stride = stride_length(numbers, np.asarray(speed, np.float64), people["height"])
    ends = np.empty((len(people), 2, 2, 2, 2))  # foot; here, next; heel, ball; x, y
    _feet(numbers, np.ascontiguousarray(phase, np.float64), stride, people, ends)
    c, s = np.cos(yaw)[:, None, None, None], np.sin(yaw)[:, None, None, None]
    points = np.empty((*ends.shape[:-1], 3))
    points[..., 0] = c * ends[..., 0] - s * ends[..., 1] + position[:, 0, None, None, None]
    points[..., 1] = s * ends[..., 0] + c * ends[..., 1] + position[:, 1, None, None, None]
    points[..., 2] = position[:, 2, None, None, None]
    found = height(points.reshape(-1, 3)).reshape(points.shape[:-1]) - position[:, 2, None, None, None]
    rise, run = found[..., 1] - found[..., 0], ends[..., 1, 0] - ends[..., 0, 0]
    edge = np.abs(rise) > _EDGE * run
    behind = (_HEEL * people["heel_length"][:, None, None]) / run
    ground = np.empty((len(people), 2, 2, 2))
    ground[..., 0] = np.where(edge, found.max(axis=-1), found[..., 0] + rise * behind)
    ground[..., 1] = np.where(edge, 0.0, -np.arctan2(rise, run))
    return ground


@compiled
def _feet(clip: Any, phase: Any, stride: Any, style: Any, ends: Any) -> None:
    """Write heel and ball of every foot where it stands and where it comes down, body frame, metres."""
    for i in range(len(clip)):
        one = style[i]
        for side in range(2):
            if is_gait(clip[i]):
                gait = gait_of_run(stride[i], one) if clip[i] == RUN else gait_of_walk(stride[i], one)
                ankle = one.joints[ANKLE[side]]
                y = ankle[Y] * (0.6 if clip[i] == RUN else one.foot_spread)
                here, after = foothold((phase[i] + 0.5 * side) % 1.0, gait)
                here, after = here + ankle[0], after + ankle[0]
            elif is_seated(clip[i]):
                here, y = seated_foot(one, side)
                after = here
            else:
                here, y = stance(one, side)
                after = here
            for k, x in enumerate((here, after)):
                ends[i, side, k, 0, 0], ends[i, side, k, 1, 0] = x - _HEEL * one.heel_length, x + _BALL * one.toe_length
                ends[i, side, k, 0, 1] = ends[i, side, k, 1, 1] = y
