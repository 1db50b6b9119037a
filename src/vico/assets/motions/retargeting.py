"""Motions of other skeletons on ours: joints are turned by how the bones rest."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from vico.assets.motions.clip import HIP_HEIGHT, MotionClip
from vico.assets.motions.grounding import grounded
from vico.assets.motions.rotations import Matrices, turning, vectors_of
from vico.assets.motions.skeleton import Skeleton, joints_by_name
from vico.assets.people import FINGERS, JOINTS, PARENTS, J
from vico.errors import InputError

# Where bones point in the T-pose from the joint of this name to the next one along the limb.
_DOWN, _LEFT = np.array([0.0, 0.0, -1.0]), np.array([0.0, 1.0, 0.0])
_LIMBS = {
    "hip": ("knee", _DOWN),
    "knee": ("ankle", _DOWN),
    "shoulder": ("elbow", _LEFT),
    "elbow": ("wrist", _LEFT),
    "wrist": ("middle1", _LEFT),
    **{f"{finger}{k}": (f"{finger}{k + 1}", _LEFT) for finger in FINGERS[:-1] for k in (1, 2)},
}


def retargeted(
    skeleton: Skeleton, turned: Matrices, root: NDArray[np.float64], rate: float, *, name: str, source: str
) -> MotionClip:
    """Return the motion of another skeleton on ours, its feet on the ground.

    Parameters
    ----------
    turned
        How each joint is turned from its rest, in the file's axes, shape ``(t, n, 3, 3)``.
    root
        Where the joint that stands for the pelvis is, in the file's axes and unit, shape ``(t, 3)``.
    rate
        Frames a second.
    source
        The file, for errors.

    Raises
    ------
    InputError
        If the skeleton is no person's.
    """
    joints = joints_by_name(skeleton, source=source)
    axes, hips = _frame(skeleton, joints, source)
    rest = _resting(skeleton, joints, axes)
    frames = len(turned)
    world = np.empty((frames, len(JOINTS), 3, 3))
    for k, ours in enumerate(JOINTS):
        if ours in joints:
            world[:, k] = axes @ turned[:, joints[ours]] @ axes.T @ rest[k]
        else:
            world[:, k] = world[:, PARENTS[k]] if k else np.eye(3)
    local = np.swapaxes(world[:, PARENTS[1:]], -1, -2) @ world[:, 1:]
    position = (root @ axes.T) * (HIP_HEIGHT / hips)
    return grounded(
        MotionClip(name, rate, np.asarray(position, np.float32), vectors_of(world[:, 0]), vectors_of(local))
    )


def _frame(skeleton: Skeleton, joints: dict[str, int], source: str) -> tuple[Matrices, float]:
    """Return the rotation from the file's axes to forward, left, up, and how high the hips are above the soles."""
    at = {name: skeleton.places[k] for name, k in joints.items()}
    hips = (at["left_hip"] + at["right_hip"]) / 2
    left, up = at["left_hip"] - at["right_hip"], at["head"] - hips
    forward = np.cross(left, up)
    height = float(np.linalg.norm(up))
    if min(np.linalg.norm(left), np.linalg.norm(forward)) < 1e-3 * height or height <= 0:
        raise InputError(f"{source}: its skeleton at rest is no standing person; export it with a T-pose at rest")
    # The file's own axes are upright: the nearest of them to where the head and the left are.
    rough = [forward, left, up]
    axes = np.zeros((3, 3))
    for row, way in ((2, up), (1, left)):
        free = [k for k in range(3) if not axes[:, k].any()]
        k = max(free, key=lambda axis: abs(way[axis]))
        axes[row, k] = np.sign(way[k])
    axes[0] = np.cross(axes[1], axes[2])
    if float(axes[0] @ rough[0]) <= 0:
        raise InputError(f"{source}: its skeleton at rest is twisted; export it with a T-pose at rest")
    legs = [
        sum(float(np.linalg.norm(at[a] - at[b])) for a, b in pairwise(way))
        for side in ("left", "right")
        if (way := [f"{side}_{part}" for part in ("hip", "knee", "ankle") if f"{side}_{part}" in at])
    ]
    length = float(np.mean(legs)) * (1.08 if "left_ankle" in at else 2.0)
    if length <= 0:
        raise InputError(f"{source}: its legs have no length; export it with its bones' offsets")
    return axes, length


def _resting(skeleton: Skeleton, joints: dict[str, int], axes: Matrices) -> NDArray[np.float64]:
    """Return how each of our joints has to be turned from the T-pose to rest as the file's do, shape ``(55, 3, 3)``."""
    rest = np.broadcast_to(np.eye(3), (len(JOINTS), 3, 3)).copy()
    for k, ours in enumerate(JOINTS[1:], start=1):
        inherited = rest[PARENTS[k]]
        rest[k] = inherited
        side, _, part = ours.partition("_")
        if part not in _LIMBS or ours not in joints or f"{side}_{_LIMBS[part][0]}" not in joints:
            continue
        following, way = _LIMBS[part]
        theirs = axes @ (skeleton.places[joints[f"{side}_{following}"]] - skeleton.places[joints[ours]])
        if np.linalg.norm(theirs) > 0:
            mine = inherited @ (way * (-1.0 if side == "right" and way is _LEFT else 1.0))
            rest[k] = turning(mine, theirs) @ inherited
    # Feet and toes stand as they are: they point forward in every rest pose.
    for side in ("left", "right"):
        for part in ("ankle", "foot"):
            rest[J[f"{side}_{part}"]] = np.eye(3)
    return rest
