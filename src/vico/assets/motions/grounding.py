"""Motions set on the ground: where feet are lowest, they stand."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from vico.assets.motions.clip import HIP_HEIGHT, MotionClip
from vico.assets.motions.rotations import matrices_of
from vico.assets.people import PARENTS, Appearance, J, body_of

_FEET = tuple(J[f"{side}_{part}"] for side in ("left", "right") for part in ("ankle", "foot"))
# Of all frames so many have a foot on the ground, at least, percent.
_STANDING = 4.0


def places_of(clip: MotionClip, joints: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return where a body's joints are in every frame, metres, shape ``(t, 55, 3)``.

    Parameters
    ----------
    joints
        Of the body in the T-pose, the soles at z = 0, metres, shape ``(55, 3)``.
    """
    turned = np.concatenate([clip.orientation[:, None], clip.pose], axis=1).astype(np.float64)
    world = matrices_of(turned)
    placed = np.empty((len(clip), len(joints), 3))
    placed[:, 0] = clip.position.astype(np.float64) * (joints[0, 2] / HIP_HEIGHT)
    for k in range(1, len(joints)):
        parent = PARENTS[k]
        placed[:, k] = placed[:, parent] + world[:, parent] @ (joints[k] - joints[parent])
        world[:, k] = world[:, parent] @ world[:, k]
    return placed


def grounded(clip: MotionClip) -> MotionClip:
    """Return a motion moved up or down so that feet stand on the ground where they are lowest.

    Files tell neither how high the soles are below the ankles nor, some of them, where the ground is.
    """
    joints = _reference()
    feet = list(_FEET)
    above = places_of(clip, joints)[:, feet, 2] - joints[feet, 2]
    sunk = float(np.percentile(above.min(axis=1), _STANDING)) * HIP_HEIGHT / float(joints[0, 2])
    return replace(clip, position=clip.position - np.array([0.0, 0.0, sunk], np.float32))


@cache
def _reference() -> NDArray[np.float64]:
    """Return the joints of an average body in the T-pose, shape ``(55, 3)``."""
    return body_of(Appearance(), source="procedural").joints.astype(np.float64)
