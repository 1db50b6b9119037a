"""What is wrong with drawn solids: edges that are not closed, and faces that lie in one another's plane and overlap.

Pure functions of triangles, so that the builder and the checker of a finished world ask the same questions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.geo import overlay
from vico.io.compiled import compiled

_PLANE = 0.004  # metres within which two faces count as one plane
_TURN = 0.004  # most difference of their unit normals' components
_SLACK = 0.002  # metres by which faces may reach over one another's border without being looked at


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

    def chosen(self, which: NDArray[np.bool_]) -> CoplanarPairs:
        """Return some of the pairs; `which` has shape ``(n,)``."""
        return CoplanarPairs(self.first[which], self.second[which], self.area[which], self.same[which])

    @property
    def flickering(self) -> int:
        """Pairs that are seen to flicker."""
        return int(self.same.sum())

    @property
    def touching(self) -> int:
        """Pairs that face each other, hidden."""
        return int((~self.same).sum())


def coplanar_overlaps(
    corners: NDArray[np.floating],
    *,
    least: float = 0.01,
    among: NDArray[np.bool_] | None = None,
    facing: bool = True,
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
    facing
        Whether pairs that face each other are told; without them it is done in half the time, as party walls are most
        of what lies in one plane.

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
            steps = [np.floor(plane[:, k] / (4 * _TURN) + turn) for k in range(3)]
            steps.append(np.floor(offset / (4 * _PLANE) + shift))
            bin_, count = _binned([*steps, np.zeros(len(kept)) if facing else sign])
            pairs.append(_met(points, plane, bin_, count))
    met = np.unique(np.concatenate(pairs))
    first, second = met // len(kept), met % len(kept)
    away = np.abs(np.einsum("nki,ni->nk", points[second], plane[first]) - offset[first, None]).max(axis=1)
    close = (away < _PLANE) & (np.abs(plane[first] - plane[second]).max(axis=1) < _TURN)
    first, second = first[close], second[close]
    area = _common(points, plane, first, second, least)
    real = area > least
    first, second, area = first[real], second[real], area[real]
    return CoplanarPairs(kept[first], kept[second], area, sign[first] == sign[second])


def _binned(values: list[NDArray[np.float64]]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Give rows of whole numbers a number each, equal rows the same; and count how many have each."""
    key = np.zeros(len(values[0]), np.int64)
    for value in values:
        whole = value.astype(np.int64) - int(value.min())
        key = key * (int(whole.max()) + 1) + whole
    _, bin_, count = np.unique(key, return_inverse=True, return_counts=True)
    return bin_.ravel(), count


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
    """Pairs of a bin whose flat boxes overlap, shape ``(m,)``: the first's index times ``n`` and the second's."""
    members = np.flatnonzero(count[bin_] > 1)
    if not len(members):
        return np.zeros(0, np.int64)
    # Level and steep planes are each laid flat along fixed world axes, the same for all of a bin.
    bins, leader = np.unique(bin_[members], return_index=True)
    of = np.searchsorted(bins, bin_[members])
    across, up = (axis[of] for axis in _axes(plane[members[leader]]))
    u = np.einsum("nki,ni->nk", points[members], across)
    v = np.einsum("nki,ni->nk", points[members], up)
    # What is thinner than the slack keeps its place.
    boxes = np.concatenate([np.sort([at.min(axis=1) + _SLACK, at.max(axis=1) - _SLACK], axis=0) for at in (u, v)])
    order = np.lexsort((boxes[0], of))
    a, b = _boxes_met(of[order], boxes[:, order])
    a, b = members[order[a]], members[order[b]]
    return np.asarray(np.minimum(a, b) * len(points) + np.maximum(a, b), np.int64)


@compiled
def _boxes_met(bin_: NDArray[np.int64], boxes: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of boxes of one bin that overlap; boxes are sorted by bin and then by their first row, u from.

    The rows are u from, u to, v from, v to; shape ``(4, n)``.
    """
    count = 0
    first = np.empty(4 * len(bin_), np.int64)
    second = np.empty(4 * len(bin_), np.int64)
    for i in range(len(bin_)):
        j = i + 1
        while j < len(bin_) and bin_[j] == bin_[i] and boxes[0, j] <= boxes[1, i]:
            if boxes[0, i] <= boxes[1, j] and boxes[2, i] <= boxes[3, j] and boxes[2, j] <= boxes[3, i]:
                if count == len(first):
                    first = np.concatenate((first, np.empty(count, np.int64)))
                    second = np.concatenate((second, np.empty(count, np.int64)))
                first[count], second[count] = i, j
                count += 1
            j += 1
    return first[:count], second[:count]


def _common(
    points: NDArray[np.float64],
    plane: NDArray[np.float64],
    first: NDArray[np.int64],
    second: NDArray[np.int64],
    least: float,
) -> NDArray[np.float64]:
    """Area two triangles of a plane share; 0 where it is certainly not more than `least`."""
    across, up = _axes(plane[first])
    one, two = (
        np.stack([np.einsum("nki,ni->nk", points[which], across), np.einsum("nki,ni->nk", points[which], up)], axis=-1)
        for which in (first, second)
    )
    area = np.zeros(len(first))
    near = np.flatnonzero((_most_common(one, two) > least) & (_most_common(two, one) > least))
    shapes = (shapely.polygons(flat[near]) for flat in (one, two))
    area[near] = np.asarray(overlay.common_area(*shapes), np.float64)
    return area


def _most_common(one: NDArray[np.float64], two: NDArray[np.float64]) -> NDArray[np.float64]:
    """Bound the area that pairs of triangles share, by how far the second reaches over each edge of the first.

    What they share lies in a strip along the edge, as deep as that and no longer than the second is wide.
    """
    side = np.roll(one, -1, axis=1) - one
    side /= np.maximum(np.linalg.norm(side, axis=2, keepdims=True), 1e-12)
    turn = side[:, 0, 0] * side[:, 1, 1] - side[:, 0, 1] * side[:, 1, 0]
    inward = np.stack([-side[..., 1], side[..., 0]], axis=-1) * np.where(turn < 0, -1.0, 1.0)[:, None, None]
    depth = np.einsum("neci,nei->nec", two[:, None] - one[:, :, None], inward).max(axis=2).min(axis=1)
    wide = np.linalg.norm(np.ptp(two, axis=1), axis=1)
    return np.asarray(np.maximum(depth, 0.0) * wide, np.float64)


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
