"""Plane geometry that many rooms need: polylines, and how far along them something lies."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


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


__all__ = ["arc_lengths", "points_along"]
