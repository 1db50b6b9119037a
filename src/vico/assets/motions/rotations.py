"""Rotations of many frames at once: matrices of shape ``(..., 3, 3)`` and axis-angle vectors of shape ``(..., 3)``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Matrices = NDArray[np.float64]


def matrices_of(vectors: NDArray[Any]) -> Matrices:
    """Return rotation matrices of axis-angle vectors, radians."""
    flat = Rotation.from_rotvec(np.asarray(vectors, np.float64).reshape(-1, 3)).as_matrix()
    return flat.reshape(*vectors.shape[:-1], 3, 3)


def vectors_of(matrices: Matrices) -> NDArray[np.float32]:
    """Return axis-angle vectors of rotation matrices, radians, the shorter way."""
    flat = Rotation.from_matrix(matrices.reshape(-1, 3, 3)).as_rotvec()
    return np.asarray(flat, np.float32).reshape(*matrices.shape[:-2], 3)


def from_quaternions(quaternions: NDArray[Any]) -> Matrices:
    """Return rotation matrices of quaternions x, y, z, w, shape ``(..., 4)``."""
    flat = Rotation.from_quat(np.asarray(quaternions, np.float64).reshape(-1, 4)).as_matrix()
    return flat.reshape(*quaternions.shape[:-1], 3, 3)


def from_angles(angles: NDArray[np.float64], axes: Sequence[str]) -> Matrices:
    """Return the product of rotations about axes in the order they are named.

    Parameters
    ----------
    angles
        Degrees, shape ``(t, k)``.
    axes
        ``"X"``, ``"Y"`` or ``"Z"`` for each column.
    """
    found = np.broadcast_to(np.eye(3), (len(angles), 3, 3))
    for k, axis in enumerate(axes):
        found = found @ Rotation.from_euler(axis.lower(), angles[:, k : k + 1], degrees=True).as_matrix()
    return np.asarray(found)


def turning(a: NDArray[np.float64], b: NDArray[np.float64]) -> Matrices:
    """Return the smallest rotation that turns one direction into another, shape ``(3, 3)``."""
    u, v = a / np.linalg.norm(a), b / np.linalg.norm(b)
    axis, cosine = np.cross(u, v), float(u @ v)
    if cosine < -0.999999:  # any axis across it
        across = np.cross(u, [1.0, 0.0, 0.0] if abs(u[0]) < 0.9 else [0.0, 1.0, 0.0])
        return np.asarray(Rotation.from_rotvec(np.pi * across / np.linalg.norm(across)).as_matrix())
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + cross + cross @ cross / (1.0 + cosine)
