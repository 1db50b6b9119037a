"""Geometry that many rooms need: distances and polylines in the plane, quaternions and rotation matrices.

A polyline is an array of points; a position on it is the arc length from its start. Quaternions are w, x, y, z.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "arc_lengths",
    "direction",
    "distance",
    "distances",
    "points_along",
    "polyline_length",
    "quaternion_from_matrix",
    "rotate",
    "rotation_matrix",
    "wrap_angle",
    "yaw_quaternion",
]


def distance(a: NDArray[Any], b: NDArray[Any] | tuple[float, float]) -> float:
    """Return how far two points are apart, metres; each of shape ``(2,)``."""
    return float(np.hypot(*(a - b)))


def distances(points: NDArray[Any], to: NDArray[Any] | tuple[float, float]) -> NDArray[np.float64]:
    """Return how far points are from a point, or from as many others; shapes ``(n, 2)`` and ``(2,)`` or ``(n, 2)``."""
    found: NDArray[np.float64] = np.hypot(*(points - to).T)
    return found


def wrap_angle(angle: float) -> float:
    """Return the same direction as an angle of at least -pi and less than pi, radians."""
    return float((angle + math.pi) % (2.0 * math.pi) - math.pi)


def direction(yaw: float) -> NDArray[np.float64]:
    """Return the unit vector that points along a yaw, radians counter-clockwise from east; shape ``(2,)``."""
    return np.array([math.cos(yaw), math.sin(yaw)])


def rotate(points: NDArray[np.float64], yaw: float) -> NDArray[np.float64]:
    """Return points, shape ``(..., 2)``, turned about the origin by `yaw`, radians counter-clockwise."""
    c, s = math.cos(yaw), math.sin(yaw)
    x, y = points[..., 0], points[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


def polyline_length(points: NDArray[np.float64]) -> float:
    """Return the length of a polyline, metres; its points are east and north, shape ``(n, 2)``."""
    return float(np.hypot(*np.diff(points, axis=0).T).sum())


def arc_lengths(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far along a polyline each of its points lies.

    Parameters
    ----------
    points
        East and north, metres, shape ``(n, 2)``.

    Returns
    -------
    NDArray
        Metres from the first point, shape ``(n,)``; the last one is the length of the line.
    """
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])


def points_along(
    points: NDArray[np.float64], at: NDArray[np.float64], along: NDArray[np.float64] | None = None
) -> NDArray[np.float64]:
    """Return the points of a polyline at distances along it.

    Parameters
    ----------
    points
        East and north, metres, shape ``(n, 2)``.
    at
        Metres from the first point, shape ``(k,)``; beyond an end that end.
    along
        `arc_lengths` of the line, where they are known.

    Returns
    -------
    NDArray
        Shape ``(k, 2)``.
    """
    along = arc_lengths(points) if along is None else along
    return np.stack([np.interp(at, along, points[:, 0]), np.interp(at, along, points[:, 1])], axis=-1)


def yaw_quaternion(yaw: float) -> NDArray[np.float64]:
    """Return the quaternion of a turn about the vertical, radians counter-clockwise; shape ``(4,)``."""
    return np.array([math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)])


def rotation_matrix(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotation matrix of unit quaternions, shape ``(..., 4)`` to ``(..., 3, 3)``."""
    w, x, y, z = np.moveaxis(np.asarray(quaternion, np.float64), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def quaternion_from_matrix(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
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
