"""Lighter bodies for simulation: what other layers hide is left out, the rest is thinned by `assets.simplify`.

A body is several surfaces (skin, clothes, hair) with doubled vertices where a colour ends: these are the wedges of a
place. Beside the shape it counts what would change in colour and in how the place is carried by the joints.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.assets.people.model import JOINTS, J, SkinnedBody
from vico.assets.simplify import Worth, collapsed, is_sound
from vico.io.compiled import compiled

# Triangles of a light body, and of one that is seen from far away; procedural ones are a tenth darker in pictures with
# as few as the others (`tests/sim/test_detail.py`).
LIGHT, FAR, FAR_PROCEDURAL = 1900, 600, 900
# A place is hidden if something that moves with it lies within this many metres all around.
_COVER = 0.05
# What a change of colour by the whole range, and of all of a place's joints, is worth, in metres of displacement.
_COLOUR_METRES, _JOINT_METRES = 0.018, 0.010
# Layers nearer than this must not come through each other.
_LAYERS = 0.006
# Factors on what is lost at a place: faces are looked at.
_FACE, _EARS, _HAIR = 30.0, 60.0, 8.0
# How far the surface (or, at its rate, its colour) may move, metres: between layers, in a face, in a hand.
_LAYERED_LIMIT, _FACE_LIMIT, _HAND_LIMIT = 0.0006, 0.0014, 0.0060

Array = NDArray[Any]


def lightened(body: SkinnedBody, triangles: int = LIGHT) -> SkinnedBody:
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
    faces = faces[~_hidden(points, faces, shares)]
    _, first, place = np.unique(np.round(points, 5), axis=0, return_index=True, return_inverse=True)
    places = place.ravel()[faces]
    sound = is_sound(places)
    faces, places = faces[sound], places[sound]
    if len(faces) > triangles:
        care, limit = _care(body, points, faces, shares)
        traits = np.hstack([body.colour / 255.0 * _COLOUR_METRES, shares * _JOINT_METRES])
        worth = Worth(traits[first], care[first], limit[first])
        _, faces = collapsed(points[first], places, faces, worth, triangles=triangles)
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
    touching = np.unique(faces[_layered(points[faces], _components(faces, len(points))[faces[:, 0]])])
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
def _layered(corners: Array, layer: Array) -> Array:
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


def _hidden(points: Array, faces: Array, shares: Array) -> NDArray[np.bool_]:
    """Which triangles can't be seen from anywhere, whatever the pose."""
    corners = points[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-15)
    low, high = corners.min(1), corners.max(1)
    order = np.argsort(low[:, 2], kind="stable")
    tallest = float((high - low)[:, 2].max())
    carried = shares[faces].mean(1)
    return _covered(corners, normals, low, high, order, tallest, carried)


@compiled(nogil=True)
def _covered(
    corners: Array, normals: Array, low: Array, high: Array, order: Array, tallest: float, carried: Array
) -> Array:
    count = len(corners)
    hidden = np.zeros(count, np.bool_)
    floors = low[order, 2]
    found = np.empty(count, np.int64)
    for f in range(count):
        n = normals[f]
        nearby = 0
        k = np.searchsorted(floors, low[f, 2] - _COVER - tallest)
        while k < count and floors[k] <= high[f, 2] + _COVER:
            g = order[k]
            k += 1
            if g == f or low[g, 0] > high[f, 0] + _COVER or high[g, 0] < low[f, 0] - _COVER:
                continue
            if low[g, 1] > high[f, 1] + _COVER or high[g, 1] < low[f, 1] - _COVER or high[g, 2] < low[f, 2] - _COVER:
                continue
            found[nearby] = g
            nearby += 1
        # Most triangles are seen straight from outside: only for the rest it matters who moves with them.
        middle = (corners[f, 0] + corners[f, 1] + corners[f, 2]) / 3
        if not _leaves(middle, n, corners, normals, found[:nearby]):
            continue
        kept = 0
        for k in range(nearby):
            together = 0.0
            for j in range(carried.shape[1]):
                together += min(carried[f, j], carried[found[k], j])
            if together > 0.5:
                found[kept] = found[k]
                kept += 1
        nearby = kept
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
                seen = not _leaves(start, way, corners, normals, found[:nearby])
                if seen:
                    break
            if seen:
                break
        hidden[f] = not seen
    return hidden


@compiled
def _leaves(start: Array, way: Array, corners: Array, normals: Array, among: Array) -> bool:
    """Whether a ray comes out of one of some triangles, close by (Moeller and Trumbore's test)."""
    for g in among:
        if normals[g, 0] * way[0] + normals[g, 1] * way[1] + normals[g, 2] * way[2] < 0.05:
            continue
        a, b, c = corners[g, 0], corners[g, 1], corners[g, 2]
        e1x, e1y, e1z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        e2x, e2y, e2z = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        px, py, pz = way[1] * e2z - way[2] * e2y, way[2] * e2x - way[0] * e2z, way[0] * e2y - way[1] * e2x
        det = e1x * px + e1y * py + e1z * pz
        if abs(det) < 1e-14:
            continue
        tx, ty, tz = start[0] - a[0], start[1] - a[1], start[2] - a[2]
        s = (tx * px + ty * py + tz * pz) / det
        qx, qy, qz = ty * e1z - tz * e1y, tz * e1x - tx * e1z, tx * e1y - ty * e1x
        t = (way[0] * qx + way[1] * qy + way[2] * qz) / det
        if s < -1e-6 or t < -1e-6 or s + t > 1 + 1e-6:
            continue
        far = (e2x * qx + e2y * qy + e2z * qz) / det
        if 1e-4 < far < _COVER:
            return True
    return False
