"""Orientations of rigid bodies: quaternions w, x, y, z and rotation matrices."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray


def upright(yaw: float) -> NDArray[np.float64]:
    """Return the quaternion of a turn about the vertical, radians counter-clockwise; shape ``(4,)``."""
    return np.array([math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)])


def matrix_of(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotation matrix of unit quaternions, shape ``(..., 4)`` to ``(..., 3, 3)``."""
    w, x, y, z = np.moveaxis(np.asarray(quaternion, np.float64), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def quaternion_of(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the unit quaternion of a rotation matrix, shape ``(3, 3)`` to ``(4,)``, with w not below 0.

    The largest of the four numbers is computed first, so that none is lost near half a turn (Shepperd, "Quaternion
    from rotation matrix", 1978).
    """
    r = [[float(value) for value in row] for row in rotation]
    trace = r[0][0] + r[1][1] + r[2][2]
    squares = [trace, r[0][0], r[1][1], r[2][2]]
    largest = squares.index(max(squares))
    size = math.sqrt(max(1.0 + 2.0 * squares[largest] - trace, 0.0)) if largest else math.sqrt(max(1.0 + trace, 0.0))
    found = [0.0] * 4
    found[largest] = size / 2
    if largest == 0:
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            found[i + 1] = (r[k][j] - r[j][k]) / (2 * size)
    else:
        i, j, k = largest - 1, largest % 3, (largest + 1) % 3
        found[0] = (r[k][j] - r[j][k]) / (2 * size)
        found[j + 1] = (r[j][i] + r[i][j]) / (2 * size)
        found[k + 1] = (r[k][i] + r[i][k]) / (2 * size)
    sign = -1.0 if found[0] < 0.0 else 1.0
    length = math.sqrt(sum(value * value for value in found))
    return np.array([sign * value / length for value in found])
