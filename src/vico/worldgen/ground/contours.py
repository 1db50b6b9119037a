"""Where a grid of values lies above a level, with the smooth border that the values between the grid's points give."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

Floats = NDArray[np.float64]


def region_above(values: Floats, level: float, *, low: float, cell: float) -> BaseGeometry:
    """Return the region where values that are linear between points exceed a level.

    Parameters
    ----------
    values
        At the points of a square grid, shape ``(n, n)``, indexed ``[north, east]``; beyond it they go on as at its edge
        for one cell, and end there.
    level
        What they have to exceed.
    low
        East and north of the first point, metres.
    cell
        Spacing, metres.

    Returns
    -------
    shapely geometry
        A valid multipolygon, metres.

    Notes
    -----
    Every square is two triangles, so that no case is ambiguous. Each crossing of the level lies on one edge of the
    grid and is computed once: the pieces of border meet exactly, and `polygonize` closes them.
    """
    z = np.pad(np.pad(np.asarray(values, np.float64), 1, mode="edge") - level, 1, constant_values=-1.0)
    z[np.abs(z) < 1e-12] = -1e-12  # no border runs through a point of the grid
    z[1:-1, 1:-1] = np.clip(z[1:-1, 1:-1], -1e6, 1e6)
    n = len(z)
    axis: Floats = low + (np.arange(n, dtype=np.float64) - 2.0) * cell
    a, b, d, c = (_corner(z, axis, i, j) for i in (0, 1) for j in (0, 1))
    lines = [line for corners in ((a, b, c), (a, c, d)) for line in _borders(corners)]
    segments = np.concatenate(lines)
    if not len(segments):
        return shapely.MultiPolygon()
    faces = shapely.get_parts(shapely.polygonize(shapely.linestrings(segments)))
    inside = shapely.get_coordinates(shapely.point_on_surface(faces))
    return shapely.MultiPolygon(list(faces[_between(z, axis, cell, inside) > 0.0]))


def _corner(z: Floats, axis: Floats, i: int, j: int) -> tuple[Floats, Floats]:
    """Points, shape ``(m, 2)``, and values of one corner of every square."""
    n = len(z) - 1
    north, east = np.meshgrid(axis[i : i + n], axis[j : j + n], indexing="ij")
    return np.stack([east.ravel(), north.ravel()], axis=1), z[i : i + n, j : j + n].ravel()


def _borders(corners: tuple[tuple[Floats, Floats], ...]) -> list[Floats]:
    """Find the piece of border through each triangle that has one, shape ``(k, 2, 2)``, by the corner it cuts off."""
    found = []
    for k in range(3):
        (p, zp), (q, zq), (r, zr) = (corners[(k + m) % 3] for m in range(3))
        cut = ((zp > 0) != (zq > 0)) & ((zp > 0) != (zr > 0))
        found.append(
            np.stack([_crossing(p[cut], zp[cut], q[cut], zq[cut]), _crossing(p[cut], zp[cut], r[cut], zr[cut])], axis=1)
        )
    return found


def _crossing(p: Floats, zp: Floats, q: Floats, zq: Floats) -> Floats:
    """Where values between two points are nought; from the higher to the lower, whichever comes first."""
    up = (zp > zq)[:, None]
    first, last = np.where(up, p, q), np.where(up, q, p)
    high, below = np.maximum(zp, zq), np.minimum(zp, zq)
    return np.asarray(first + (high / (high - below))[:, None] * (last - first))


def _between(z: Floats, axis: Floats, cell: float, at: Floats) -> Floats:
    """Values at points, by the triangles that they lie in."""
    index = np.clip(np.floor((at - axis[0]) / cell).astype(np.int64), 0, len(z) - 2)
    u, v = ((at - axis[index]) / cell).T
    i, j = index[:, 1], index[:, 0]
    a, b, c, d = z[i, j], z[i, j + 1], z[i + 1, j + 1], z[i + 1, j]
    return np.asarray(np.where(u >= v, a + u * (b - a) + v * (c - b), a + v * (d - a) + u * (c - d)))
