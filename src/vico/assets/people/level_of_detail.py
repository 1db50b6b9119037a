"""Lighter bodies for simulation: what other layers hide is left out, the rest is thinned by `assets.simplify`.

A body is several surfaces (skin, clothes, hair) with doubled vertices where a colour ends: these are the wedges of a
place. Beside the shape it counts what would change in colour and in how the place is carried by the joints.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.people.model import JOINTS, J, SkinnedBody
from vico.assets.simplification import Worth, collapse_edges, is_sound
from vico.io.compiled import compiled

# Triangles of a body.
LIGHT = 1900
FAR = 600  # seen from far away
FAR_PROCEDURAL = 900  # with as few as the others they are a tenth darker in pictures (`tests/sim/test_detail.py`)
# A place is hidden if something that moves with it lies within this many metres all around.
_COVER = 0.05
# Boxes are this much larger than what is looked for in them, metres: more than rounding makes of a hit.
_SLACK = 1e-4
# What a change of colour by the whole range, and of all of a place's joints, is worth, in metres of displacement.
_COLOUR_METRES, _JOINT_METRES = 0.018, 0.010
# Layers nearer than this must not come through each other.
_LAYERS = 0.006
# Factors on what is lost at a place: faces are looked at.
_FACE = 30.0
_EARS = 60.0
_HAIR = 8.0
# How far the surface (or, at its rate, its colour) may move, metres.
_LAYERED_LIMIT = 0.0006  # between layers
_FACE_LIMIT = 0.0014
_HAND_LIMIT = 0.0060

Array = NDArray[Any]


def simplify_body(body: SkinnedBody, triangles: int = LIGHT) -> SkinnedBody:
    """Make a body with at most about `triangles` triangles that looks the same from two metres on.

    Parameters
    ----------
    body
        Any body; it is left as it is.
    triangles
        Triangles wanted.

    Returns
    -------
    SkinnedBody
        With a subset of the vertices, same joints.
    """
    points = body.vertices.astype(np.float64)
    shares = np.zeros((len(points), len(JOINTS)))
    for k in range(4):
        np.add.at(shares, (np.arange(len(points)), body.weight_joints[:, k]), body.weights[:, k].astype(np.float64))
    faces = body.triangles.astype(np.int64)
    faces = faces[~_hidden_triangles(points, faces, shares)]
    _, first, place = np.unique(np.round(points, 5), axis=0, return_index=True, return_inverse=True)
    places = place.ravel()[faces]
    sound = is_sound(places)
    faces, places = faces[sound], places[sound]
    if len(faces) > triangles:
        care, limit = _care(body, points, faces, shares)
        traits = np.hstack([body.colour / 255.0 * _COLOUR_METRES, shares * _JOINT_METRES])
        worth = Worth(traits[first], care[first], limit[first])
        _, faces = collapse_edges(points[first], places, faces, worth, triangles=triangles)
    used, faces = np.unique(faces, return_inverse=True)
    return replace(
        body,
        vertices=body.vertices[used],
        normals=body.normals[used],
        triangles=faces.reshape(-1, 3).astype(np.int32),
        colour=body.colour[used],
        weight_joints=body.weight_joints[used],
        weights=body.weights[used],
    )


def _care(body: SkinnedBody, points: Array, faces: Array, shares: Array) -> tuple[Array, Array]:
    """How much each vertex matters, and how far the surface may move there."""
    care, limit = np.ones(len(points)), np.full(len(points), np.inf)
    fingers = [j for j in range(len(JOINTS)) if j > J["right_eye"]]
    limit[shares[:, fingers].sum(1) > 0.4] = _HAND_LIMIT
    eyes = body.rest_joints[[J["left_eye"], J["right_eye"]]].astype(np.float64)
    size = (body.height - eyes[:, 2].mean()) / 0.475
    middle = eyes.mean(0) + np.array([0.0, 0.0, -0.12 * size])
    near = np.linalg.norm((points - middle) / size * np.array([1.0, 1.0, 0.85]), axis=1) < 0.38
    near &= points[:, 0] > eyes[:, 0].min() - 0.10 * size
    care[shares[:, J["head"]] > 0.5] = _HAIR
    ears = (np.abs(points[:, 1]) > 0.30 * size) & (np.abs(points[:, 2] - middle[2] - 0.06 * size) < 0.15 * size)
    care[ears & (shares[:, J["head"]] > 0.5)] = _EARS
    care[near] = _FACE
    touching = np.unique(faces[_layered_triangles(points[faces], _components(faces, len(points))[faces[:, 0]])])
    limit[touching] = _LAYERED_LIMIT
    limit[near] = _FACE_LIMIT
    return care, limit


@compiled(nogil=True)
def _components(faces: Array, count: int) -> Array:
    """Return a number for each vertex, the same for all that hang together."""
    owner = np.arange(count)
    for f in range(len(faces)):
        for k in range(1, 3):
            a, b = faces[f, 0], faces[f, k]
            while owner[a] != a:
                owner[a] = owner[owner[a]]
                a = owner[a]
            while owner[b] != b:
                owner[b] = owner[owner[b]]
                b = owner[b]
            owner[max(a, b)] = min(a, b)
    for v in range(count):
        a = v
        while owner[a] != a:
            a = owner[a]
        owner[v] = a
    return owner


@compiled(nogil=True)
def _layered_triangles(corners: Array, layer: Array) -> Array:
    """Which triangles lie closely over or under a triangle of another layer."""
    count = len(corners)
    close = np.zeros(count, np.bool_)
    low, high = np.empty((count, 3)), np.empty((count, 3))
    for f in range(count):
        for axis in range(3):
            low[f, axis] = min(corners[f, 0, axis], corners[f, 1, axis], corners[f, 2, axis]) - _LAYERS / 2
            high[f, axis] = max(corners[f, 0, axis], corners[f, 1, axis], corners[f, 2, axis]) + _LAYERS / 2
    order = np.argsort(low[:, 2], kind="mergesort")
    for k in range(count):
        f = order[k]
        for other in range(k + 1, count):
            g = order[other]
            if low[g, 2] > high[f, 2]:
                break
            if layer[f] == layer[g] or low[g, 0] > high[f, 0] or high[g, 0] < low[f, 0]:
                continue
            if low[g, 1] > high[f, 1] or high[g, 1] < low[f, 1] or (close[f] and close[g]):
                continue
            if _over(corners[f], corners[g]) or _over(corners[g], corners[f]):
                close[f] = close[g] = True
    return close


@compiled
def _over(a: Array, b: Array) -> bool:
    """Whether a corner or the middle of triangle `a` lies within the layers' distance above or below triangle `b`."""
    e, f = b[1] - b[0], b[2] - b[0]
    n = np.cross(e, f)
    size = (n * n).sum()
    if size < 1e-18:
        return False
    for k in range(4):
        p = (a[k] if k < 3 else (a[0] + a[1] + a[2]) / 3) - b[0]
        if (p * n).sum() ** 2 > size * _LAYERS**2:
            continue
        s, t = (np.cross(p, f) * n).sum() / size, (np.cross(e, p) * n).sum() / size
        if s > -0.02 and t > -0.02 and s + t < 1.02:
            return True
    return False


def _hidden_triangles(points: Array, faces: Array, shares: Array) -> NDArray[np.bool_]:
    """Which triangles can't be seen from anywhere, whatever the pose."""
    corners = points[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-15)
    low, high = corners.min(1), corners.max(1)
    # Cells of a grid as large as what is looked through, and which triangles reach into each.
    origin = low.min(0, initial=np.inf)
    lowest, highest = (np.floor((ends - origin) / _COVER).astype(np.int64) for ends in (low, high))
    shape = highest.max(0, initial=0) + 1
    first, member = _members(lowest, highest, shape)
    carried = shares[faces].mean(1)
    return _covered_triangles(corners, normals, low, high, _Grid(origin, shape, first, member), carried)


class _Grid(NamedTuple):
    """Which boxes reach into each cell: `member` from `first` of the cell to `first` of the next."""

    origin: Array
    shape: Array
    first: Array
    member: Array


@compiled(nogil=True)
def _members(lowest: Array, highest: Array, shape: Array) -> tuple[Array, Array]:
    """Return where the boxes of each cell begin, int64 ``(cells + 1,)``, and their numbers."""
    first = np.zeros(shape[0] * shape[1] * shape[2] + 1, np.int64)
    for fill in range(2):
        if fill:
            member = np.empty(first[-1], np.int64)
        for f in range(len(lowest) - 1, -1, -1):
            for i in range(lowest[f, 0], highest[f, 0] + 1):
                for j in range(lowest[f, 1], highest[f, 1] + 1):
                    for k in range(lowest[f, 2], highest[f, 2] + 1):
                        cell = (i * shape[1] + j) * shape[2] + k
                        if fill:
                            first[cell] -= 1
                            member[first[cell]] = f
                        else:
                            first[cell] += 1
        if not fill:
            first = np.cumsum(first)
    return first, member


@compiled(nogil=True)
def _covered_triangles(corners: Array, normals: Array, low: Array, high: Array, grid: Any, carried: Array) -> Array:
    count = len(corners)
    hidden = np.zeros(count, np.bool_)
    near, found, asked = np.empty(count, np.int64), np.empty(count, np.int64), np.full(count, -1, np.int64)
    for f in range(count):
        n = normals[f]
        middle = (corners[f, 0] + corners[f, 1] + corners[f, 2]) / 3
        end = middle + _COVER * n
        # Most triangles are seen straight from outside: only for the rest it matters who moves with them.
        nearby = _nearby(np.minimum(middle, end) - _SLACK, np.maximum(middle, end) + _SLACK, grid, near, asked, 2 * f)
        if not _leaves(middle, n, corners, normals, low, high, near[:nearby], f):
            continue
        kept = 0
        for g in near[: _nearby(low[f] - _COVER, high[f] + _COVER, grid, near, asked, 2 * f + 1)]:
            if g == f:
                continue
            together = 0.0
            for j in range(carried.shape[1]):
                together += min(carried[f, j], carried[g, j])
            if together > 0.5:
                found[kept] = g
                kept += 1
        # Two directions across the normal, to tilt rays by.
        axis = 0 if abs(n[0]) < 0.6 else 1
        e = np.zeros(3)
        e[axis] = 1.0
        u = np.cross(n, e)
        u /= np.sqrt((u * u).sum())
        v = np.cross(n, u)
        seen = False
        for s in range(4):
            start = middle if s == 3 else 0.95 * corners[f, s] + 0.05 * middle
            for d in range(5):
                way = n.copy()
                if d > 0:
                    tilt = u if d < 3 else v
                    way = 0.5 * n + (0.866 if d % 2 else -0.866) * tilt
                seen = not _leaves(start, way, corners, normals, low, high, found[:kept], f)
                if seen:
                    break
            if seen:
                break
        hidden[f] = not seen
    return hidden


@compiled
def _nearby(low: Array, high: Array, grid: Any, near: Array, asked: Array, question: int) -> int:
    """Note in `near` who reaches into cells of a box, each once by the question's number; return how many."""
    origin, shape, first, member = grid.origin, grid.shape, grid.first, grid.member
    begin, end = np.empty(3, np.int64), np.empty(3, np.int64)
    for axis in range(3):
        begin[axis] = max(int(np.floor((low[axis] - origin[axis]) / _COVER)), 0)
        end[axis] = min(int(np.floor((high[axis] - origin[axis]) / _COVER)), shape[axis] - 1)
    count = 0
    for i in range(begin[0], end[0] + 1):
        for j in range(begin[1], end[1] + 1):
            row = (i * shape[1] + j) * shape[2]
            for m in range(first[row + begin[2]], first[row + end[2] + 1]):
                g = member[m]
                if asked[g] != question:
                    asked[g] = question
                    near[count] = g
                    count += 1
    return count


@compiled
def _leaves(
    start: Array, way: Array, corners: Array, normals: Array, low: Array, high: Array, among: Array, but: int
) -> bool:
    """Whether a ray comes out of one of some triangles, all but one, close by (Moeller and Trumbore's test)."""
    x, y, z = start[0], start[1], start[2]
    wx, wy, wz = way[0], way[1], way[2]
    ends = x + _COVER * wx, y + _COVER * wy, z + _COVER * wz
    west, east = min(x, ends[0]) - _SLACK, max(x, ends[0]) + _SLACK
    south, north = min(y, ends[1]) - _SLACK, max(y, ends[1]) + _SLACK
    bottom, top = min(z, ends[2]) - _SLACK, max(z, ends[2]) + _SLACK
    for g in among:
        if low[g, 0] > east or high[g, 0] < west or low[g, 1] > north or high[g, 1] < south:
            continue
        if low[g, 2] > top or high[g, 2] < bottom or g == but:
            continue
        if normals[g, 0] * wx + normals[g, 1] * wy + normals[g, 2] * wz < 0.05:
            continue
        a, b, c = corners[g, 0], corners[g, 1], corners[g, 2]
        e1x, e1y, e1z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        e2x, e2y, e2z = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        px, py, pz = wy * e2z - wz * e2y, wz * e2x - wx * e2z, wx * e2y - wy * e2x
        det = e1x * px + e1y * py + e1z * pz
        if abs(det) < 1e-14:
            continue
        tx, ty, tz = x - a[0], y - a[1], z - a[2]
        s = (tx * px + ty * py + tz * pz) / det
        qx, qy, qz = ty * e1z - tz * e1y, tz * e1x - tx * e1z, tx * e1y - ty * e1x
        t = (wx * qx + wy * qy + wz * qz) / det
        if s < -1e-6 or t < -1e-6 or s + t > 1 + 1e-6:
            continue
        far = (e2x * qx + e2y * qy + e2z * qz) / det
        if 1e-4 < far < _COVER:
            return True
    return False
