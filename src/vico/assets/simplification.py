"""Mesh simplification: one implementation for people, robots and furniture, by half-edge collapses in compiled code.

Edges are collapsed in the order of Garland and Heckbert's quadric error (*Surface Simplification Using Quadric Error
Metrics*, SIGGRAPH 1997). Vertices that stay are where they were, so whatever else is known of them (normals, colours,
joints, morph targets) stays right. Of a place where surfaces of several kinds meet, each keeps its own corners (its
*wedges*, as in Hoppe, *New Quadric Metric for Simplifying Meshes with Appearance Attributes*, Visualization 1999), so
no crack opens there. Open edges, and edges between kinds, only slide along themselves.
"""

from __future__ import annotations

from heapq import heapify, heappop, heappush
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled

Array = NDArray[Any]

# More than a place's limit counts so many times.
_BEYOND = 300.0


class Loss(NamedTuple):
    """What is known of each vertex to tell what its collapse loses."""

    points: Array  # metres, float64 (n, 3)
    quadrics: Array  # squared distances to the planes around, times their area, float64 (n, 4, 4)
    area: Array  # of the surface around, square metres, float64 (n,)
    traits: Array  # colour, then shares of joints, both in metres of displacement, float64 (n, k)
    care: Array  # factor on what is lost here, float64 (n,)
    limit: Array  # how far the surface may move here, metres, float64 (n,)


@compiled
def _cost(loss: Loss, u: int, v: int, moves: bool) -> float:
    """Return what is lost if `u` moves to `v`, or both to where it costs least."""
    return _best_spot(loss, u, v)[1] if moves else _cost_of_move(loss, u, v)


@compiled
def _cost_of_move(loss: Loss, u: int, v: int) -> float:
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
def _collapse_kernel(loss: Loss, faces: Array, wedges: Array, triangles: int, vertices: int, moves: bool) -> Array:
    """Collapse edges in place until so many triangles or vertices are left; returns which triangles are.

    Where vertices may move, what remains of an edge goes where its quadric is least, and meshes of any topology reach
    the number asked for: where every collapse that is left folds something, they fold.
    """
    left, rest = len(faces), len(loss.points)
    mesh = _chain_corners(faces, wedges, rest)
    ring = _Ring(np.zeros(rest, np.int64), np.zeros(rest, np.int64), np.empty((8, 2), np.int64))
    here = np.ones(rest, np.bool_)
    stamp = np.zeros(rest, np.int64)
    heap = _all_offers(loss, mesh, stamp, moves)
    mark, forced = 0, False
    while left > triangles and rest > vertices:
        if len(heap) == 0:
            if not moves or forced:
                break
            forced = True
            heap = _all_offers(loss, mesh, stamp, moves)
            continue
        _, u, v, a, b = heappop(heap)
        if not (here[u] and here[v]) or stamp[u] != a or stamp[v] != b:
            continue
        mark += 2
        known = 0 if moves else _match_wedges(mesh, ring, loss.points, u, v, mark)
        if known < 0 or (moves and not _move_vertex(loss, mesh, u, v, forced)):
            continue
        left -= _merge(mesh, ring.pairs[:known], u, v)
        here[u] = False
        rest -= 1
        loss.quadrics[v] += loss.quadrics[u]
        loss.area[v] += loss.area[u]
        stamp[v] += 1
        _offer_around(loss, mesh, heap, stamp, v, moves)
    return mesh.alive


@compiled
def _match_wedges(mesh: _Corners, ring: _Ring, points: Array, u: int, v: int, mark: int) -> int:
    """Return how many wedges at `u` have one at `v` that takes their place, or -1 where `u` must not move to `v`."""
    shared, known = _look_around(mesh, ring, u, v, mark)
    if shared == 0 or shared > 2 or (shared != 1 and _on_open_edge(mesh, ring, u)):
        return -1
    # Link condition: the only common neighbours are those of the shared triangles.
    if _common_neighbours(mesh, ring, u, v, mark) != shared:
        return -1
    return known if _star_fits(mesh, points, ring.pairs[:known], u, v) else -1


@compiled
def _move_vertex(loss: Loss, mesh: _Corners, u: int, v: int, forced: bool) -> bool:
    """Move `v` to where it stands best for the edge between the two, unless that turns a triangle over."""
    spot, _ = _best_spot(loss, u, v)
    if not forced and (_folds(mesh, loss.points, u, v, spot) or _folds(mesh, loss.points, v, u, spot)):
        return False
    loss.points[v] = spot
    return True


@compiled
def _best_spot(loss: Loss, u: int, v: int) -> tuple[Array, float]:
    """Return where the vertex that stands for an edge goes, and what that costs."""
    points, q = loss.points, loss.quadrics[u] + loss.quadrics[v]
    middle = (points[u] + points[v]) / 2
    length = np.sqrt(((points[u] - points[v]) ** 2).sum())
    # Directions the planes leave open keep the middle's coordinate.
    scale = q[0, 0] + q[1, 1] + q[2, 2]
    hold = 1e-4 * scale + 1e-18
    spot = _solve_quadric(q, hold, hold * middle - q[:3, 3])
    if np.sqrt(((spot - middle) ** 2).sum()) > length:
        spot = middle
    cost = _distance(q, spot)
    for end in (u, v):
        there = _distance(q, points[end])
        if there < cost:
            spot, cost = points[end].copy(), there
    # A little of the length, so that flat places lose their shortest edges first.
    return spot, cost + 1e-6 * scale * length * length


@compiled
def _solve_quadric(q: Array, hold: float, b: Array) -> Array:
    """Solve the quadric's 3x3 part, with `hold` added to its diagonal, for a point (Cramer's rule)."""
    xx, yy, zz = q[0, 0] + hold, q[1, 1] + hold, q[2, 2] + hold
    xy, xz, yz = q[0, 1], q[0, 2], q[1, 2]
    # The matrix of minors is symmetric, too.
    mxx, myy, mzz = yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy
    mxy, mxz, myz = xz * yz - xy * zz, xy * yz - xz * yy, xy * xz - xx * yz
    det = xx * mxx + xy * mxy + xz * mxz
    out = np.empty(3)
    out[0] = (mxx * b[0] + mxy * b[1] + mxz * b[2]) / det
    out[1] = (mxy * b[0] + myy * b[1] + myz * b[2]) / det
    out[2] = (mxz * b[0] + myz * b[1] + mzz * b[2]) / det
    return out


@compiled
def _distance(q: Array, at: Array) -> float:
    """Return a quadric's value at a point."""
    x, y, z = at[0], at[1], at[2]
    total = x * (q[0, 0] * x + 2 * (q[0, 1] * y + q[0, 2] * z + q[0, 3]))
    total += y * (q[1, 1] * y + 2 * (q[1, 2] * z + q[1, 3])) + z * (q[2, 2] * z + 2 * q[2, 3]) + q[3, 3]
    return max(total, 0.0)


@compiled
def _folds(mesh: _Corners, points: Array, u: int, v: int, spot: Array) -> bool:
    """Whether a triangle at `u`, but not at `v`, turns over when `u` goes to a spot."""
    corner, folds = mesh.head[u], False
    while corner >= 0 and not folds:
        f = corner // 3
        folds = (
            mesh.alive[f] and not _has(mesh.faces, f, v) and _turns(points, mesh.faces, f, corner % 3, spot, 0.2, 0.0)
        )
        corner = mesh.following[corner]
    return folds


@compiled
def _chain_corners(faces: Array, wedges: Array, count: int) -> _Corners:
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
def _all_offers(loss: Loss, mesh: _Corners, stamp: Array, moves: bool) -> list[tuple[float, int, int, int, int]]:
    """Return a heap of all collapses: cost, who goes, who stays, and how often each had changed when it was offered."""
    heap = [(0.0, 0, 0, 0, 0)]
    for f in range(len(mesh.faces)):
        if mesh.alive[f]:
            for k in range(3):
                for turn in range(1, 3):
                    u, v = mesh.faces[f, k], mesh.faces[f, (k + turn) % 3]
                    heap.append((_cost(loss, u, v, moves), u, v, stamp[u], stamp[v]))
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
            fits = mapped and not _turns(points, mesh.faces, f, corner % 3, points[v], 0.25, 0.02)
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
    loss: Loss, mesh: _Corners, heap: list[tuple[float, int, int, int, int]], stamp: Array, v: int, moves: bool
) -> None:
    """Offer the collapses of `v` into its neighbours, and of those into it."""
    corner = mesh.head[v]
    while corner >= 0:
        f = corner // 3
        if mesh.alive[f]:
            for k in range(3):
                w = mesh.faces[f, k]
                if w != v:
                    forth, back = _cost(loss, v, w, moves), _cost(loss, w, v, moves)
                    heappush(heap, (forth, v, w, stamp[v], stamp[w]))
                    heappush(heap, (back, w, v, stamp[w], stamp[v]))
        corner = mesh.following[corner]


@compiled
def _turns(points: Array, faces: Array, f: int, moved: int, to: Array, least: float, slim: float) -> bool:
    """Whether a triangle turns too far, or becomes a sliver, when one corner moves."""
    a, b, c = points[faces[f, moved]], points[faces[f, (moved + 1) % 3]], points[faces[f, (moved + 2) % 3]]
    old, new = np.cross(b - a, c - a), np.cross(b - to, c - to)
    before, after = np.sqrt((old * old).sum()), np.sqrt((new * new).sum())
    longest = max(((b - to) ** 2).sum(), ((c - to) ** 2).sum(), ((b - c) ** 2).sum())
    return (old * new).sum() < least * before * after or after < slim * longest


# Points nearer than this share of a mesh's size are one place.
_WELD = 1e-5


class Worth(NamedTuple):
    """What else is lost at each vertex when it goes, beyond the shape.

    Attributes
    ----------
    traits
        What is seen of a vertex besides its place, in metres of displacement, float64 ``(n, k)``. The first three are
        its colour.
    care
        Factor on what is lost here, float64 ``(n,)``.
    limit
        How far the surface (or, at its rate, its colour) may move here, metres, float64 ``(n,)``; beyond, all counts
        300 times.
    """

    traits: Array
    care: Array
    limit: Array


def even_worth(count: int) -> Worth:
    """Return the worth of vertices that are all alike."""
    return Worth(np.zeros((count, 3)), np.ones(count), np.full(count, np.inf))


def collapse_edges(
    points: Array,
    places: Array,
    corners: Array,
    worth: Worth,
    *,
    triangles: int = 0,
    vertices: int = 0,
) -> tuple[Array, Array]:
    """Collapse edges until at most so many triangles, or so many vertices, are left, or no collapse is sound.

    Parameters
    ----------
    points
        Places, metres, float64 ``(n, 3)``.
    places
        Triangles between them, int64 ``(m, 3)``.
    corners
        The same triangles by what lies at those places, any numbers, int64 ``(m, 3)``: corners of one number are one
        wedge. A wedge only goes where a triangle shows which other takes its place.
    worth
        What else is lost at each place.
    triangles, vertices
        How many may be left; the first that is reached counts.

    Returns
    -------
    kept
        Which of the triangles are left, ascending, int64 ``(k,)``.
    corners
        Their corners now, int64 ``(k, 3)``.
    """
    loss = Loss(points, *_quadrics(points, places, np.zeros(len(places), np.int64)), *worth)
    corners = corners.astype(np.int64)
    alive = _collapse_kernel(loss, places.astype(np.int64), corners, triangles, vertices, False)
    return np.flatnonzero(alive), corners[alive]


def simplify_mesh(
    points: Array, faces: Array, triangles: int, *, kinds: Array | None = None
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Thin a mesh whose vertices are places and nothing else: they move to where they stand best for what is gone.

    Parameters
    ----------
    points
        Metres, shape ``(n, 3)``. Those at one place count as one.
    faces
        Shape ``(m, 3)``.
    triangles
        How many may be left.
    kinds
        A number for each triangle, of its material say; lines between kinds stay where they are.

    Returns
    -------
    points
        Those in use, float64 ``(v, 3)``.
    faces
        Triangles between them, int64 ``(k, 3)``.
    kept
        Which triangle of `faces` each of them was, int64 ``(k,)``.
    """
    points, faces, kept = _weld(np.asarray(points, np.float64), np.asarray(faces, np.int64))
    worn = np.zeros(len(faces), np.int64) if kinds is None else np.asarray(kinds, np.int64)[kept]
    if len(faces) > triangles:
        loss = Loss(points, *_quadrics(points, faces, worn), *even_worth(len(points)))
        alive = _collapse_kernel(loss, faces, faces.copy(), triangles, 0, True)
        faces, kept = faces[alive], kept[alive]
    used, index = np.unique(faces, return_inverse=True)
    return points[used], index.reshape(-1, 3), kept


def _weld(points: Array, faces: Array) -> tuple[Array, Array, Array]:
    """One vertex a place; triangles that have an area, and one of those on the same three vertices."""
    step = max(float(np.ptp(points, axis=0).max()), 1e-9) * _WELD
    _, first, owner = np.unique(
        np.round(points / step).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    faces = np.asarray(owner).reshape(-1)[faces]
    kept = np.flatnonzero(is_sound(faces))
    _, one = np.unique(np.sort(faces[kept], axis=1), axis=0, return_index=True)
    kept = kept[np.sort(one)]
    return points[first], faces[kept], kept


def is_sound(faces: Array) -> NDArray[np.bool_]:
    """Tell which triangles have three corners that differ."""
    return (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])


def _quadrics(points: Array, faces: Array, kinds: Array) -> tuple[Array, Array]:
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
    # Open edges, and those between kinds, are held by planes across the surface.
    edges = np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)])
    ordered = np.column_stack([np.sort(edges, axis=1), np.tile(kinds, 3)])
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
