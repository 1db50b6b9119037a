"""Closing the gaps between neighbour tiles: vertices on their borders are brought together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree


def welded(
    positions: NDArray[np.float64], triangles: NDArray[np.int32], owner: NDArray[np.int64], reach: float
) -> NDArray[np.float64]:
    """Bring together the border vertices of neighbour tiles.

    Parameters
    ----------
    positions, triangles
        The mesh, shapes ``(n, 3)`` and ``(m, 3)``.
    owner
        The tile of each vertex, shape ``(n,)``.
    reach
        How far a vertex may move, metres.

    Returns
    -------
    ndarray
        Positions in which a vertex on the open border of a tile that has one of an earlier tile's border within reach
        lies where the nearest of those does.
    """
    # Corners that differ only in their texture coordinates are one place: an edge is open if no other triangle of its
    # tile has it.
    place = _places(np.concatenate([owner[:, None], np.round(positions * 1e4).astype(np.int64)], axis=1))
    edges = np.sort(place[triangles][:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges = edges[edges[:, 0] != edges[:, 1]]
    if not len(edges):
        return positions
    pairs, times = np.unique(edges[:, 0] * len(positions) + edges[:, 1], return_counts=True)
    unique = np.stack(np.divmod(pairs, len(positions)), axis=1)
    border = np.unique(unique[times == 1])
    if not len(border):
        return positions
    one = np.zeros(int(place.max()) + 1, np.int64)
    one[place] = np.arange(len(place))
    vertices = one[border]
    spots, tiles = positions[vertices], owner[vertices]
    distance, near = cKDTree(spots).query(spots, k=min(8, len(spots)), distance_upper_bound=reach)
    distance, near = np.atleast_2d(distance), np.atleast_2d(near)
    target = np.arange(len(spots))
    for column in range(near.shape[1] - 1, -1, -1):  # the nearest is looked at last and wins
        index = np.minimum(near[:, column], len(spots) - 1)
        earlier = np.isfinite(distance[:, column]) & (tiles[index] < tiles)
        target = np.where(earlier, index, target)
    while True:  # a target may itself have moved to an earlier tile
        further = target[target]
        if (further == target).all():
            break
        target = further
    moved = np.arange(int(place.max()) + 1)
    moved[border] = border[target]
    return positions[one[moved]][place]


def _places(rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return a number for each row; equal rows have the same one."""
    # One number a row is sorted many times faster than rows; the rare rows that share one by chance are told apart.
    mix = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9, 0x27D4EB2F165667C5], np.uint64)
    hashed = (rows.astype(np.uint64) * mix).sum(axis=1, dtype=np.uint64)
    _, first, place = np.unique(hashed ^ (hashed >> np.uint64(29)), return_index=True, return_inverse=True)
    if not np.array_equal(rows[first][place], rows):
        _, place = np.unique(rows, axis=0, return_inverse=True)
    return np.asarray(place.ravel(), np.int64)
