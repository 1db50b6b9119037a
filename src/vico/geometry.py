"""Plane geometry that many rooms need: distances, and polylines with how far along them something lies."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def distance(a: NDArray[Any], b: NDArray[Any] | tuple[float, float]) -> float:
    """Return how far two points are apart, metres; each of shape ``(2,)``."""
    return float(np.hypot(*(a - b)))


def distances(points: NDArray[Any], to: NDArray[Any] | tuple[float, float]) -> NDArray[np.float64]:
    """Return how far points are from a point, or from as many others; shapes ``(n, 2)`` and ``(2,)`` or ``(n, 2)``."""
    found: NDArray[np.float64] = np.hypot(*(points - to).T)
    return found


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


__all__ = ["arc_lengths", "distance", "distances", "points_along"]
