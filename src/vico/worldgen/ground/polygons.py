"""Polygons computed exactly: parted along lines of equal east or north, and outlined where a grid exceeds a level.

Outlines of a grid's values have the smooth border that the values between the grid's points give.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay

Floats = NDArray[np.float64]

_STRAIGHT = 1e-8  # square metres: corners that turn the other way by less are straight


def split_polygons(
    polygons: NDArray[np.object_], middle: Floats, axis: int
) -> tuple[NDArray[np.object_], NDArray[np.object_]]:
    """Part polygons that lie on both sides of a line.

    Parameters
    ----------
    polygons
        Shape ``(n,)``.
    middle
        Where each one's line runs, metres, shape ``(n,)``.
    axis
        0: the line is one of equal east, 1: of equal north.

    Returns
    -------
    tuple
        What lies below and beyond, shape ``(n,)`` each; polygons, or collections of whatever the rest of an odd one is.
    """
    below, beyond = np.empty(len(polygons), object), np.empty(len(polygons), object)
    easy = shapely.get_num_interior_rings(polygons) == 0
    rings = _Rings.of(polygons[easy])
    easy[easy] = rings.convex() | rings.crossed_twice(middle[easy], axis)
    rings = _Rings.of(polygons[easy])
    below[easy] = rings.clip(middle[easy], axis, 1.0)
    beyond[easy] = rings.clip(middle[easy], axis, -1.0)
    hard = np.flatnonzero(~easy)
    if len(hard):
        box = shapely.bounds(polygons[hard])
        box += (-1.0, -1.0, 1.0, 1.0)  # so that only the line cuts
        for out, side in ((below, 2 + axis), (beyond, axis)):
            cut = box.copy()
            cut[:, side] = middle[hard]
            out[hard] = overlay.intersection(polygons[hard], shapely.box(*cut.T), grid=None)
    return below, beyond


@dataclass(frozen=True)
class _Rings:
    """Outer rings as edges from `a` to `b`, shape ``(n, 2)``, of the polygons `row`, which begin at `start`."""

    a: Floats
    b: Floats
    row: NDArray[np.int64]
    start: NDArray[np.int64]

    @classmethod
    def of(cls, polygons: NDArray[np.object_]) -> _Rings:
        points, row = shapely.get_coordinates(shapely.get_exterior_ring(polygons), return_index=True)
        edge = np.flatnonzero(row[1:] == row[:-1])
        row = row[edge]
        return cls(points[edge], points[edge + 1], row, np.searchsorted(row, np.arange(len(polygons))))

    def convex(self) -> NDArray[np.bool_]:
        """Which rings turn one way only."""
        if not len(self.start):
            return np.zeros(0, bool)
        along = self.b - self.a
        following = np.arange(1, len(self.row) + 1)
        following[np.r_[self.start[1:], len(self.row)] - 1] = self.start
        after = along[following]
        turn = along[:, 0] * after[:, 1] - along[:, 1] * after[:, 0]
        least, most = np.minimum.reduceat(turn, self.start), np.maximum.reduceat(turn, self.start)
        return np.asarray((least >= -_STRAIGHT) | (most <= _STRAIGHT))

    def crossed_twice(self, middle: Floats, axis: int) -> NDArray[np.bool_]:
        """Which rings a line crosses twice, far from their corners: both parts are in one piece then."""
        if not len(self.start):
            return np.zeros(0, bool)
        away, away_after = self.a[:, axis] - middle[self.row], self.b[:, axis] - middle[self.row]
        crossings = np.add.reduceat((away * away_after < 0.0).astype(np.int64), self.start)
        clear = np.minimum.reduceat(np.abs(away), self.start) > 1e-6
        return np.asarray(clear & (crossings == 2))

    def clip(self, middle: Floats, axis: int, side: float) -> NDArray[np.object_]:
        """Clip rings to what lies before a line, or beyond it, in one piece (Sutherland and Hodgman, 1974)."""
        at = middle[self.row]
        away, away_after = side * (self.a[:, axis] - at), side * (self.b[:, axis] - at)
        crosses = away * away_after < 0.0
        share = np.where(crosses, away / np.where(crosses, away - away_after, 1.0), 0.0)
        points = np.stack([self.a, self.a + share[:, None] * (self.b - self.a)], axis=1)
        points[:, 1, axis] = at
        kept = np.stack([away <= 0.0, crosses], axis=1)
        row = np.repeat(self.row, kept.sum(axis=1))
        # What has two corners is a line: no ring, and no area.
        enough = np.bincount(row, minlength=len(middle)) >= 3
        out = np.full(len(middle), shapely.Polygon(), object)
        if enough.any():
            used = enough[row]
            number = np.cumsum(enough) - 1
            out[enough] = shapely.polygons(shapely.linearrings(points[kept][used], indices=number[row[used]]))
        return out


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
