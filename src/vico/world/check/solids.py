"""What is wrong with drawn solids: edges that are not closed, and faces that lie in one another's plane and overlap.

Pure functions of triangles, so that the builder and the checker of a finished world ask the same questions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.geo import overlay

_PLANE = 0.004  # metres within which two faces count as one plane
_TURN = 0.004  # most difference of their unit normals' components


@dataclass(frozen=True)
class CoplanarPairs:
    """Pairs of triangles that lie in one plane and overlap.

    Attributes
    ----------
    first, second
        Indices of the triangles, shape ``(n,)``, `first` below `second`.
    area
        Overlap, square metres, shape ``(n,)``.
    same
        True where both face the same way: these flicker. False where they face each other, as the two sides of a
        party wall do: each hides the other, and neither is seen.
    """

    first: NDArray[np.int64]
    second: NDArray[np.int64]
    area: NDArray[np.float64]
    same: NDArray[np.bool_]

    @property
    def flickering(self) -> int:
        """Pairs that are seen to flicker."""
        return int(self.same.sum())

    @property
    def touching(self) -> int:
        """Pairs that face each other, hidden."""
        return int((~self.same).sum())


def coplanar_overlaps(
    corners: NDArray[np.floating], *, least: float = 0.01, among: NDArray[np.bool_] | None = None
) -> CoplanarPairs:
    """Find triangles that overlap in one plane.

    Parameters
    ----------
    corners
        Corners of the triangles, metres, shape ``(n, 3, 3)``.
    least
        Overlaps smaller than this many square metres don't count.
    among
        Triangles to look at, shape ``(n,)``; None: all.

    Returns
    -------
    CoplanarPairs
        Every pair once, in the order of its triangles.

    Notes
    -----
    Triangles are put in bins of plane (normal and offset, each rounded twice, half a bin apart, so that neighbours in
    value share a bin); a bin's triangles are laid flat side by side and met through one search tree.
    """
    points = np.asarray(corners, np.float64)
    normal = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    size = np.linalg.norm(normal, axis=1)
    kept = np.flatnonzero((size > 2.0 * least) & (True if among is None else among))
    none = np.zeros(0, np.int64)
    if len(kept) < 2:
        return CoplanarPairs(none, none, np.zeros(0), np.zeros(0, bool))
    points, normal = points[kept], normal[kept] / size[kept, None]
    # One plane, one sign: the largest component of the normal is made positive (near ties: by a fixed skew).
    skew = normal @ np.array([1.0, 1.3171, 1.7331])
    sign = np.where(skew < 0, -1.0, 1.0)
    plane = normal * sign[:, None]
    offset = np.einsum("ni,ni->n", plane, points.mean(axis=1))
    pairs: list[NDArray[np.int64]] = []
    for turn in (0.0, 0.5):
        for shift in (0.0, 0.5):
            key = np.concatenate(
                [np.floor(plane / (4 * _TURN) + turn), np.floor(offset / (4 * _PLANE) + shift)[:, None]], axis=1
            ).astype(np.int64)
            _, bin_, count = np.unique(key, axis=0, return_inverse=True, return_counts=True)
            pairs.append(_met(points, plane, bin_.ravel(), count))
    found = np.unique(np.concatenate(pairs), axis=0)
    first, second = found[:, 0], found[:, 1]
    away = np.abs(np.einsum("nki,ni->nk", points[second], plane[first]) - offset[first, None]).max(axis=1)
    close = (away < _PLANE) & (np.abs(plane[first] - plane[second]).max(axis=1) < _TURN)
    first, second = first[close], second[close]
    area = _common(points, plane, first, second)
    real = area > least
    first, second, area = first[real], second[real], area[real]
    return CoplanarPairs(kept[first], kept[second], area, sign[first] == sign[second])


def _axes(plane: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Two unit directions in each plane, shape ``(n, 3)`` each."""
    level = np.stack([-plane[:, 1], plane[:, 0], np.zeros(len(plane))], axis=1)
    length = np.linalg.norm(level, axis=1, keepdims=True)
    across = np.where(length > 0.05, level / np.maximum(length, 1e-9), (1.0, 0.0, 0.0))
    up = np.cross(plane, across)
    return across, up / np.linalg.norm(up, axis=1, keepdims=True)


def _met(
    points: NDArray[np.float64], plane: NDArray[np.float64], bin_: NDArray[np.int64], count: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Pairs of a bin whose flat boxes overlap, shape ``(n, 2)``."""
    members = np.flatnonzero(count[bin_] > 1)
    if not len(members):
        return np.zeros((0, 2), np.int64)
    # Level and steep planes are each laid flat along fixed world axes, the same for all of a bin.
    bins, leader = np.unique(bin_[members], return_index=True)
    of = np.searchsorted(bins, bin_[members])
    across, up = (axis[of] for axis in _axes(plane[members[leader]]))
    u = np.einsum("nki,ni->nk", points[members], across)
    v = np.einsum("nki,ni->nk", points[members], up)
    reach = max(float(np.ptp(u)), float(np.ptp(v))) + 1.0
    u = u + (of * reach)[:, None]
    slack = 0.002
    boxes = shapely.box(u.min(axis=1) + slack, v.min(axis=1) + slack, u.max(axis=1) - slack, v.max(axis=1) - slack)
    a, b = shapely.STRtree(boxes).query(boxes)
    a, b = a[a < b], b[a < b]
    return np.stack([members[a], members[b]], axis=1)


def _common(
    points: NDArray[np.float64], plane: NDArray[np.float64], first: NDArray[np.int64], second: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Area two triangles of a plane share."""
    if not len(first):
        return np.zeros(0)
    across, up = _axes(plane[first])
    shapes = []
    for which in (first, second):
        flat = np.stack(
            [np.einsum("nki,ni->nk", points[which], across), np.einsum("nki,ni->nk", points[which], up)], axis=-1
        )
        shapes.append(shapely.polygons(flat))
    return np.asarray(overlay.common_area(shapes[0], shapes[1]), np.float64)


def open_edges(faces: NDArray[np.integer]) -> NDArray[np.bool_]:
    """Triangles with an edge that has not exactly one counterpart, shape ``(n,)``.

    Parameters
    ----------
    faces
        Vertex indices, shape ``(n, 3)``; solids don't share vertices, and a solid's equal corners are one vertex.

    Returns
    -------
    ndarray of bool
        All False for closed solids of one orientation.
    """
    triangles = np.asarray(faces, np.int64)
    if not len(triangles):
        return np.zeros(0, bool)
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    size = np.int64(triangles.max()) + 1
    forward, backward = start * size + end, end * size + start
    one, other = np.sort(forward), np.sort(backward)
    if np.array_equal(one, other) and (np.diff(one) > 0).all():
        return np.zeros(len(triangles), bool)
    _, index, counts = np.unique(forward, return_inverse=True, return_counts=True)
    bad = ~np.isin(forward, other) | (counts[index.ravel()] > 1)
    return np.asarray(bad.reshape(-1, 3).any(axis=1))
