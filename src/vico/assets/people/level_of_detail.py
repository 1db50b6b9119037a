"""Lighter bodies for simulation: what other layers hide is left out, the rest is thinned by edge collapses.

A body is several surfaces (skin, clothes, hair) with doubled vertices where a colour ends. Vertices at one place are
collapsed together, so that no crack opens there; of each, the colours of both sides are kept (its *wedges*, as in
Hoppe, *New Quadric Metric for Simplifying Meshes with Appearance Attributes*, Visualization 1999). The order of the
collapses is that of Garland and Heckbert's quadric error (SIGGRAPH 1997) plus what would change in colour and in how
the place is carried by the joints; remaining vertices stay where they were, with their normals.
"""

from __future__ import annotations

from dataclasses import replace
from heapq import heapify, heappop, heappush
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.people.model import JOINTS, J, SkinnedBody
from vico.io.compiled import compiled

# Triangles of a light body.
LIGHT = 1900
# A place is hidden if something that moves with it lies within this many metres all around.
_COVER = 0.05
# What a change of colour by the whole range, and of all of a place's joints, is worth, in metres of displacement.
_COLOUR_METRES, _JOINT_METRES = 0.018, 0.010
# Layers nearer than this must not come through each other.
_LAYERS = 0.006
# Factors on what is lost at a place: faces are looked at.
_FACE, _HAIR = 30.0, 8.0
# How far the surface (or, at its rate, its colour) may move, metres: between layers, in a face, in a hand. More counts
# so many times.
_LAYERED_LIMIT, _FACE_LIMIT, _HAND_LIMIT = 0.0006, 0.0014, 0.0060
_BEYOND = 300.0

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
    place = place.ravel()
    welded = place[faces]
    sound = (welded[:, 0] != welded[:, 1]) & (welded[:, 1] != welded[:, 2]) & (welded[:, 2] != welded[:, 0])
    faces, welded = faces[sound], welded[sound]
    if len(faces) > triangles:
        at = points[first]
        care, limit = _care(body, points, faces, shares)
        quadrics, area = _quadrics(at, welded)
        traits = np.hstack([body.colour / 255.0 * _COLOUR_METRES, shares * _JOINT_METRES])[first]
        loss = _Loss(at, quadrics, area, traits, care[first], limit[first])
        faces = faces[_collapse(loss, welded, faces, triangles)]
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


def _quadrics(points: Array, faces: Array) -> tuple[Array, Array]:
    """Squared distances to the planes around each vertex, weighted by area, as 4x4 forms; and the areas."""
    quadrics, around = np.zeros((len(points), 4, 4)), np.zeros(len(points))
    a, b, c = (points[faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    normal /= np.maximum(area, 1e-15)[:, None]
    plane = np.column_stack([normal, -(normal * a).sum(1)])
    outer = plane[:, :, None] * plane[:, None, :] * area[:, None, None]
    for k in range(3):
        np.add.at(quadrics, faces[:, k], outer)
        np.add.at(around, faces[:, k], area / 3)
    # Open edges are held by planes across the surface.
    edges = np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)])
    ordered = np.sort(edges, axis=1)
    _, index, times = np.unique(ordered, axis=0, return_index=True, return_counts=True)
    rim = np.sort(index[times == 1])
    u, v = edges[rim, 0], edges[rim, 1]
    along = points[v] - points[u]
    across = np.cross(along, normal[rim % len(faces)])
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-15)
    fence = np.column_stack([across, -(across * points[u]).sum(1)])
    held = 2.0 * (along * along).sum(1)[:, None, None] * fence[:, :, None] * fence[:, None, :]
    np.add.at(quadrics, u, held)
    np.add.at(quadrics, v, held)
    return quadrics, around


class _Loss(NamedTuple):
    """What is known of each vertex to tell what its collapse loses."""

    points: Array  # metres, float64 (n, 3)
    quadrics: Array  # squared distances to the planes around, times their area, float64 (n, 4, 4)
    area: Array  # of the surface around, square metres, float64 (n,)
    traits: Array  # colour, then shares of joints, both in metres of displacement, float64 (n, k)
    care: Array  # factor on what is lost here, float64 (n,)
    limit: Array  # how far the surface may move here, metres, float64 (n,)


@compiled
def _cost(loss: _Loss, u: int, v: int) -> float:
    """Return what is lost if `u` moves to `v`."""
    points, traits, area = loss.points, loss.traits, loss.area
    x, y, z = points[v, 0], points[v, 1], points[v, 2]
    total = 0.0
    for which in (u, v):
        q = loss.quadrics[which]
        total += x * (q[0, 0] * x + 2 * (q[0, 1] * y + q[0, 2] * z + q[0, 3]))
        total += y * (q[1, 1] * y + 2 * (q[1, 2] * z + q[1, 3])) + z * (q[2, 2] * z + 2 * q[2, 3]) + q[3, 3]
    total = max(total, 0.0)
    colour, change = 0.0, 0.0
    for k in range(3):
        colour += (traits[u, k] - traits[v, k]) ** 2
    for k in range(3, traits.shape[1]):
        change += (traits[u, k] - traits[v, k]) ** 2
    length = 0.0
    for k in range(3):
        length += (points[u, k] - points[v, k]) ** 2
    factor = max(loss.care[u], loss.care[v])
    if total + area[u] * colour > (area[u] + area[v]) * min(loss.limit[u], loss.limit[v]) ** 2:
        factor *= _BEYOND
    # A little of the length breaks ties on flat ground towards even triangles.
    return factor * (total + area[u] * (colour + change + 1e-3 * length))


class _Corners(NamedTuple):
    """Triangles, and the corners at each vertex in chains: corner ``3 f + k`` is triangle f's k-th; -1 ends a chain."""

    faces: Array  # vertices of each triangle, int64 (m, 3)
    wedges: Array  # its vertices before those at one place were joined, int64 (m, 3)
    alive: Array  # which triangles are left, bool (m,)
    head: Array  # first corner at each vertex, int64 (n,)
    tail: Array  # last corner at each vertex, int64 (n,)
    following: Array  # next corner at the same vertex, int64 (3 m,)


class _Ring(NamedTuple):
    """What is noted of the vertices around one that may go."""

    mark: Array  # number of the attempt in which a vertex was last met, int64 (n,)
    times: Array  # triangles of the ring that a marked vertex is in, int64 (n,)
    pairs: Array  # wedges at the vertex that goes, and those that take their place, int64 (8, 2)


@compiled(nogil=True)
def _collapse(loss: _Loss, faces: Array, wedges: Array, target: int) -> Array:
    """Collapse edges in place until `target` triangles are left; returns which are."""
    count, left = len(loss.points), len(faces)
    mesh = _chained(faces, wedges, count)
    ring = _Ring(np.zeros(count, np.int64), np.zeros(count, np.int64), np.empty((8, 2), np.int64))
    here = np.ones(count, np.bool_)
    stamp = np.zeros(count, np.int64)
    heap = _first_offers(loss, faces)
    mark = 0
    while left > target and len(heap):
        _, u, v, a, b = heappop(heap)
        if not (here[u] and here[v]) or stamp[u] != a or stamp[v] != b:
            continue
        mark += 2
        shared, known = _look_around(mesh, ring, u, v, mark)
        if shared == 0 or shared > 2 or (shared != 1 and _on_open_edge(mesh, ring, u)):
            continue
        # Link condition: the only common neighbours are those of the shared triangles.
        if _common_neighbours(mesh, ring, u, v, mark) != shared:
            continue
        if not _star_fits(mesh, loss.points, ring.pairs[:known], u, v):
            continue
        left -= _merge(mesh, ring.pairs[:known], u, v)
        here[u] = False
        loss.quadrics[v] += loss.quadrics[u]
        loss.area[v] += loss.area[u]
        stamp[v] += 1
        _offer_around(loss, mesh, heap, stamp, v)
    return mesh.alive


@compiled
def _chained(faces: Array, wedges: Array, count: int) -> _Corners:
    """Chain the corners at each of `count` vertices."""
    corners = 3 * len(faces)
    head, tail, following = np.full(count, -1), np.full(count, -1), np.full(corners, -1)
    for corner in range(corners):
        v = faces[corner // 3, corner % 3]
        if head[v] < 0:
            head[v] = corner
        else:
            following[tail[v]] = corner
        tail[v] = corner
    return _Corners(faces, wedges, np.ones(len(faces), np.bool_), head, tail, following)


@compiled
def _first_offers(loss: _Loss, faces: Array) -> list[tuple[float, int, int, int, int]]:
    """Return a heap of all collapses: cost, who goes, who stays, and how often each had changed when it was offered."""
    heap = [(0.0, 0, 0, 0, 0)]
    for f in range(len(faces)):
        for k in range(3):
            for turn in range(1, 3):
                u, v = faces[f, k], faces[f, (k + turn) % 3]
                heap.append((_cost(loss, u, v), u, v, 0, 0))
    heap = heap[1:]
    heapify(heap)
    return heap


@compiled
def _has(faces: Array, f: int, v: int) -> bool:
    """Whether a triangle has a vertex."""
    return bool(faces[f, 0] == v or faces[f, 1] == v or faces[f, 2] == v)


@compiled
def _look_around(mesh: _Corners, ring: _Ring, u: int, v: int, mark: int) -> tuple[int, int]:
    """Mark the neighbours of `u`, and pair its wedges with those of `v` where they share a triangle.

    Returns how many triangles they share, and how many pairs there are.
    """
    faces, wedges = mesh.faces, mesh.wedges
    corner, shared, known = mesh.head[u], 0, 0
    while corner >= 0:
        f = corner // 3
        if mesh.alive[f]:
            mate = -1
            for k in range(3):
                w = faces[f, k]
                if w == v:
                    mate = k
                if w != u:
                    if ring.mark[w] != mark:
                        ring.mark[w] = mark
                        ring.times[w] = 0
                    ring.times[w] += 1
            if mate >= 0:
                shared += 1
                if known < len(ring.pairs):
                    ring.pairs[known, 0], ring.pairs[known, 1] = wedges[f, corner % 3], wedges[f, mate]
                    known += 1
        corner = mesh.following[corner]
    return shared, known


@compiled
def _on_open_edge(mesh: _Corners, ring: _Ring, u: int) -> bool:
    """Whether a neighbour of `u` shares but one triangle with it."""
    corner, found = mesh.head[u], False
    while corner >= 0:
        f = corner // 3
        if mesh.alive[f]:
            for k in range(3):
                w = mesh.faces[f, k]
                found |= w != u and ring.times[w] == 1
        corner = mesh.following[corner]
    return found


@compiled
def _common_neighbours(mesh: _Corners, ring: _Ring, u: int, v: int, mark: int) -> int:
    """Return how many neighbours of `v` are marked as neighbours of `u`; each is marked as counted."""
    corner, common = mesh.head[v], 0
    while corner >= 0:
        f = corner // 3
        if mesh.alive[f]:
            for k in range(3):
                w = mesh.faces[f, k]
                if w != v and w != u and ring.mark[w] == mark:
                    ring.mark[w] = mark + 1
                    common += 1
        corner = mesh.following[corner]
    return common


@compiled
def _star_fits(mesh: _Corners, points: Array, pairs: Array, u: int, v: int) -> bool:
    """Whether every side of a seam at `u` has its like at `v`, and no triangle turns over."""
    corner, fits = mesh.head[u], True
    while corner >= 0 and fits:
        f = corner // 3
        if mesh.alive[f] and not _has(mesh.faces, f, v):
            mapped = False
            for k in range(len(pairs)):
                mapped |= pairs[k, 0] == mesh.wedges[f, corner % 3]
            fits = mapped and not _turns(points, mesh.faces, f, corner % 3, v)
        corner = mesh.following[corner]
    return fits


@compiled
def _merge(mesh: _Corners, pairs: Array, u: int, v: int) -> int:
    """Move the corners at `u` to `v`; returns how many triangles vanish."""
    corner, vanished = mesh.head[u], 0
    while corner >= 0:
        f, k = corner // 3, corner % 3
        if mesh.alive[f]:
            if _has(mesh.faces, f, v):
                mesh.alive[f] = False
                vanished += 1
            else:
                mesh.faces[f, k] = v
                for pair in range(len(pairs)):
                    if pairs[pair, 0] == mesh.wedges[f, k]:
                        mesh.wedges[f, k] = pairs[pair, 1]
                        break
        corner = mesh.following[corner]
    mesh.following[mesh.tail[v]] = mesh.head[u]
    mesh.tail[v] = mesh.tail[u]
    return vanished


@compiled
def _offer_around(
    loss: _Loss, mesh: _Corners, heap: list[tuple[float, int, int, int, int]], stamp: Array, v: int
) -> None:
    """Offer the collapses of `v` into its neighbours, and of those into it."""
    corner = mesh.head[v]
    while corner >= 0:
        f = corner // 3
        if mesh.alive[f]:
            for k in range(3):
                w = mesh.faces[f, k]
                if w != v:
                    forth, back = _cost(loss, v, w), _cost(loss, w, v)
                    heappush(heap, (forth, v, w, stamp[v], stamp[w]))
                    heappush(heap, (back, w, v, stamp[w], stamp[v]))
        corner = mesh.following[corner]


@compiled
def _turns(points: Array, faces: Array, f: int, moved: int, to: int) -> bool:
    """Whether a triangle turns too far, or becomes a sliver, when one corner moves to another vertex."""
    a, b, c = points[faces[f, moved]], points[faces[f, (moved + 1) % 3]], points[faces[f, (moved + 2) % 3]]
    old, new = np.cross(b - a, c - a), np.cross(b - points[to], c - points[to])
    before, after = np.sqrt((old * old).sum()), np.sqrt((new * new).sum())
    longest = max(((b - points[to]) ** 2).sum(), ((c - points[to]) ** 2).sum(), ((b - c) ** 2).sum())
    return (old * new).sum() < 0.25 * before * after or after < 0.02 * longest
