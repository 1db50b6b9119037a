"""Planes of charts: which way is right and up on them, and where points lie."""

from __future__ import annotations

import math

import numpy as np
import shapely
from numpy.typing import NDArray


def plane_axes(normal: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Right and up of planes as seen from outside: up is as near to the zenith as it gets."""
    up = np.array([0.0, 0.0, 1.0]) - normal * normal[:, 2:]
    level = np.linalg.norm(up, axis=1) < 1e-3
    up[level] = np.array([0.0, 1.0, 0.0]) - normal[level] * normal[level, 1:2]
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    return np.cross(up, normal), up


def projected(
    points: NDArray[np.float64],
    patch: NDArray[np.int64],
    base: NDArray[np.float64],
    right: NDArray[np.float64],
    up: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Coordinates of triangles' corners along right and up of the plane of each's patch, shape ``(n, 3)`` each."""
    away = points - base[patch][:, None]
    return np.einsum("nkc,nc->nk", away, right[patch]), np.einsum("nkc,nc->nk", away, up[patch])


def level_turns(
    x: NDArray[np.float64], y: NDArray[np.float64], patch: NDArray[np.int64], plane: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Angles that lay the charts of flat roofs along their longer sides; walls and slopes stand as they are."""
    turn = np.zeros(len(plane))
    level = plane[:, 2] > 0.995
    take = level[patch]
    if not take.any():
        return turn
    which = np.flatnonzero(level)
    compact = np.cumsum(level) - 1
    points = np.column_stack([x[take].ravel(), y[take].ravel()])
    hulls = shapely.oriented_envelope(shapely.multipoints(points, indices=np.repeat(compact[patch[take]], 3)))
    for k, hull in zip(which, hulls, strict=True):
        ring = shapely.get_coordinates(hull)
        if len(ring) == 5:
            sides = np.diff(ring, axis=0)[:2]
            along = sides[int(np.linalg.norm(sides[1]) > np.linalg.norm(sides[0]) + 1e-6)]
            angle = math.atan2(along[1], along[0])
            turn[k] = (angle + np.pi / 2) % np.pi - np.pi / 2
    return turn
