"""Making furniture light: edges collapsed in rounds, the cheapest of each neighbourhood first, by quadric error.

Garland and Heckbert, "Surface Simplification Using Quadric Error Metrics" (SIGGRAPH 1997), done many edges at a time:
a round takes those that are cheaper than all others near, which don't touch one another. Borders of materials are held
by planes through them. Triangles keep who they were, so materials stay; texture coordinates are read again from the
nearest of the old triangles.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

Array = NDArray[Any]

_HOLD = 4.0  # weight of the planes that hold borders, of the squared length of an edge
_SHAPE = 1e-3  # weight of an edge's own length, so that flat places lose their shortest edges first
_AT_ONCE = 16  # of how many edges the cheapest may go in a round
_MOST_ROUNDS = 2000
_SAMPLES = 6000


def thinned(points: Array, faces: Array, paint: Array, triangles: int) -> tuple[Array, Array, Array]:
    """Collapse edges until at most `triangles` are left.

    Parameters
    ----------
    points
        Shape ``(n, 3)``.
    faces
        Shape ``(m, 3)``.
    paint
        Material of each face; edges between materials are kept in place.
    triangles
        How many may be left.

    Returns
    -------
    points, faces, kept
        `kept` names, for each remaining face, the one it was.
    """
    points, faces, kept = _welded(points, faces)
    quadrics = _quadrics(points, faces, paint[kept])
    blocked = np.zeros(0, np.int64)
    for turn in range(_MOST_ROUNDS):
        if len(faces) <= triangles:
            break
        pairs = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        keys = np.unique(pairs[:, 0] * len(points) + pairs[:, 1])
        free = keys[~np.isin(keys, blocked)]
        if not len(free):
            blocked, free = blocked[:0], keys
        forced = free is keys or 2 * turn > _MOST_ROUNDS
        edges = np.stack([free // len(points), free % len(points)], axis=1)
        spots, costs = _best_spots(points, quadrics, edges)
        rank = np.empty(len(edges), np.int64)
        rank[np.lexsort((free, costs))] = np.arange(len(edges))
        chosen = _apart(rank, edges, faces, len(points))
        # A part that touches no other has an edge that is cheapest there, however dear: it has to wait its turn.
        chosen = chosen[rank[chosen] <= len(rank) // _AT_ONCE]
        chosen = chosen[: max(1, (len(faces) - triangles + 1) // 2)]
        folded = np.zeros(len(chosen), bool) if forced else _folds(points, faces, edges[chosen], spots[chosen])
        blocked = np.concatenate([blocked if turn % 8 else blocked[:0], free[chosen[folded]]])
        chosen = chosen[~folded]
        goes, stays = edges[chosen, 1], edges[chosen, 0]
        points[stays] = spots[chosen]
        quadrics[stays] += quadrics[goes]
        into = np.arange(len(points))
        into[goes] = stays
        faces = into[faces]
        sound = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
        faces, kept = faces[sound], kept[sound]
    used, index = np.unique(faces, return_inverse=True)
    return points[used], index.reshape(-1, 3), kept


def _welded(points: Array, faces: Array) -> tuple[Array, Array, Array]:
    """One vertex a place; triangles that have an area, and one of those on the same three vertices."""
    points = np.asarray(points, np.float64)
    step = max(float(np.ptp(points, axis=0).max()), 1e-9) * 1e-5
    _, first, owner = np.unique(
        np.round(points / step).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    faces = np.asarray(owner).reshape(-1)[faces]
    sound = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    kept = np.flatnonzero(sound)
    _, one = np.unique(np.sort(faces[kept], axis=1), axis=0, return_index=True)
    kept = kept[np.sort(one)]
    return points[first], faces[kept], kept


def _planes(normals: Array, at: Array, weights: Array) -> Array:
    """Weighted squared distances to planes, as 4x4 quadrics."""
    plane = np.concatenate([normals, -np.einsum("ij,ij->i", normals, at)[:, None]], axis=1)
    return plane[:, :, None] * plane[:, None, :] * weights[:, None, None]


def _quadrics(points: Array, faces: Array, paint: Array) -> Array:
    corners = points[faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(cross, axis=1)
    normals = cross / np.maximum(size, 1e-18)[:, None]
    flat = _planes(normals, corners[:, 0], size / 2)
    quadrics = np.zeros((len(points), 4, 4))
    for k in range(3):
        np.add.at(quadrics, faces[:, k], flat)
    # Open edges, and edges between materials: a plane through them, across the triangle.
    ends = faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    face = np.repeat(np.arange(len(faces)), 3)
    low, high = ends.min(axis=1), ends.max(axis=1)
    order = np.lexsort((face, high, low))
    key = low[order] * len(points) + high[order]
    starts = np.flatnonzero(np.r_[True, key[1:] != key[:-1]])
    count = np.diff(np.r_[starts, len(key)])
    group = np.repeat(np.arange(len(starts)), count)
    worn = paint[face[order]]
    least, most = np.minimum.reduceat(worn, starts), np.maximum.reduceat(worn, starts)
    held = order[((count == 1) | (least != most))[group]]
    a, b = points[ends[held, 0]], points[ends[held, 1]]
    along = b - a
    across = np.cross(along, normals[face[held]])
    length = np.linalg.norm(across, axis=1)
    walls = _planes(across / np.maximum(length, 1e-18)[:, None], a, _HOLD * (along * along).sum(axis=1))
    for k in range(2):
        np.add.at(quadrics, ends[held, k], walls)
    return quadrics


def _best_spots(points: Array, quadrics: Array, edges: Array) -> tuple[Array, Array]:
    """Where the vertex that stands for each edge goes, and what that costs."""
    both = quadrics[edges[:, 0]] + quadrics[edges[:, 1]]
    a, b = points[edges[:, 0]], points[edges[:, 1]]
    middle, length = (a + b) / 2, np.linalg.norm(b - a, axis=1)
    # Directions the planes leave open keep the middle's coordinate.
    scale = np.trace(both[:, :3, :3], axis1=1, axis2=2)
    left = both[:, :3, :3] + (1e-4 * scale + 1e-18)[:, None, None] * np.eye(3)
    right = -both[:, :3, 3] + (1e-4 * scale + 1e-18)[:, None] * middle
    spots = np.linalg.solve(left, right[..., None])[..., 0]
    far = np.linalg.norm(spots - middle, axis=1) > length
    spots[far] = middle[far]

    def cost(where: Array) -> Array:
        full = np.concatenate([where, np.ones((len(where), 1))], axis=1)
        return np.maximum(np.einsum("ni,nij,nj->n", full, both, full), 0.0)

    trials = np.stack([spots, a, b])
    costs = np.stack([cost(spots), cost(a), cost(b)])
    best = np.argmin(costs, axis=0)
    rows = np.arange(len(edges))
    mean = scale * length * length
    return trials[best, rows], costs[best, rows] + _SHAPE * _SHAPE * mean


def _apart(rank: Array, edges: Array, faces: Array, count: int) -> Array:
    """Edges that are the best of all that touch a triangle at either end, the best first."""
    worst = len(rank)
    near = np.full(count, worst)
    np.minimum.at(near, edges[:, 0], rank)
    np.minimum.at(near, edges[:, 1], rank)
    around = near[faces].min(axis=1)
    ring = near.copy()
    for k in range(3):
        np.minimum.at(ring, faces[:, k], around)
    best = np.flatnonzero((ring[edges[:, 0]] >= rank) & (ring[edges[:, 1]] >= rank))
    return best[np.argsort(rank[best])]


def _folds(points: Array, faces: Array, edges: Array, spots: Array) -> Array:
    """Whether collapsing each edge turns a triangle over."""
    owner = np.full(len(points), -1)
    owner[edges[:, 0]] = owner[edges[:, 1]] = np.arange(len(edges))
    whose = owner[faces]
    touched = (whose >= 0).sum(axis=1) == 1  # with two corners on the edge the triangle goes
    here, who = faces[touched], whose[touched].max(axis=1)
    before = points[here]
    after = np.where((whose[touched] >= 0)[..., None], spots[who][:, None, :], before)
    old = np.cross(before[:, 1] - before[:, 0], before[:, 2] - before[:, 0])
    new = np.cross(after[:, 1] - after[:, 0], after[:, 2] - after[:, 0])
    turned = np.einsum("ij,ij->i", old, new) < 0.2 * np.linalg.norm(old, axis=1) * np.linalg.norm(new, axis=1)
    folded = np.zeros(len(edges), bool)
    folded[who[turned]] = True
    return folded


def textured_again(
    points: Array, faces: Array, paint: Array, old_points: Array, old_faces: Array, old_uv: Array, old_paint: Array
) -> Array:
    """Texture coordinates of thinned triangles: the map of the nearest old triangle of the same material goes on.

    Returns
    -------
    uv
        float64, shape ``(m, 3, 2)``.
    """
    uv = np.zeros((len(faces), 3, 2))
    corners = old_points[old_faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(cross, axis=1) / 2
    centres = points[faces].mean(axis=1)
    ours = np.cross(points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]])
    ours /= np.maximum(np.linalg.norm(ours, axis=1, keepdims=True), 1e-18)
    reach = 0.05 * float(np.ptp(old_points, axis=0).max())
    for number in np.unique(paint).tolist():
        there = np.flatnonzero((old_paint == number) & (area > 1e-14) & np.isfinite(old_uv).all(axis=(1, 2)))
        here = np.flatnonzero(paint == number)
        if not len(there):
            continue
        # Places spread evenly over the old surface, with the way it faces, so that neighbours round a corner differ.
        ends = np.cumsum(area[there])
        who = there[np.searchsorted(ends, (np.arange(_SAMPLES) + 0.5) / _SAMPLES * ends[-1])]
        u, v = np.modf(np.arange(1, _SAMPLES + 1)[:, None] * np.array([0.7548776662, 0.5698402910]))[0].T
        over = u + v > 1
        u, v = np.where(over, 1 - u, u), np.where(over, 1 - v, v)
        first, second, third = corners[who, 0], corners[who, 1], corners[who, 2]
        spots = first + u[:, None] * (second - first) + v[:, None] * (third - first)
        facing = cross[who] / (2 * area[who, None])
        tree = cKDTree(np.concatenate([spots, facing * reach], axis=1))
        _, nearest = tree.query(np.concatenate([centres[here], ours[here] * reach], axis=1))
        source = who[nearest]
        a, b, c = (corners[source, k][:, None, :] for k in range(3))
        p = points[faces[here]] - a
        e, f = b - a, c - a
        ee, ef, ff = (e * e).sum(-1), (e * f).sum(-1), (f * f).sum(-1)
        pe, pf = (p * e).sum(-1), (p * f).sum(-1)
        size = np.maximum(ee * ff - ef * ef, 1e-30)
        s, t = (ff * pe - ef * pf) / size, (ee * pf - ef * pe) / size
        old = old_uv[source]
        uv[here] = old[:, :1] + s[..., None] * (old[:, 1:2] - old[:, :1]) + t[..., None] * (old[:, 2:3] - old[:, :1])
    return uv
