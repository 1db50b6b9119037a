"""Mesh decimation: corners that their neighbours' heights foretell are taken out of a conforming plan."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled
from vico.worldgen.ground.mesh import Heights, PlanMesh

_STRAIGHT = 0.004  # metres that a border may bend
_LONGEST = 14.0  # metres: corners carry the large patches of colour
_ON_SIDE = 1e-4  # metres from a side of the plan within which a corner lies on it
_MOST_ABOUT = 40  # triangles about one corner
_PASSES = (0.2, 0.5, 1.0)  # the smoothest corners go first


def decimate_mesh(
    plan: PlanMesh, heights: Sequence[Heights], used: NDArray[np.int64], tolerance: NDArray[np.float64]
) -> PlanMesh:
    """Take corners out of a plan.

    Parameters
    ----------
    plan
        As `conforming` made it, with every edge parted.
    heights
        Kinds of heights that pieces lie at.
    used
        The kind each piece lies at, shape ``(pieces,)``.
    tolerance
        Metres by which a piece may come to lie off its heights, shape ``(pieces,)``.

    Returns
    -------
    PlanMesh
        The same pieces with the same outlines (to four millimetres), corners numbered as before. What lies along the
        sides of the whole stays there: another plan may go on beyond them.
    """
    if not len(plan.triangles):
        return plan
    corners, triangles = plan.corners, plan.triangles.copy()
    order = np.argsort(triangles.ravel(), kind="stable")
    # A fixed mixed order: one from west to east would make fans.
    turn = np.argsort((np.arange(len(corners)) * 2654435761) % 4294967291, kind="stable")
    mesh = _Mesh(
        xy=corners,
        z=np.stack([height(corners) for height in heights], axis=1),
        triangles=triangles,
        piece=plan.piece,
        sides=_sides(corners, triangles),
        used=used,
        owner=order // 3,
        first=np.searchsorted(triangles.ravel()[order], np.arange(len(corners) + 1)),
        alive=np.ones(len(triangles), np.bool_),
        error=np.zeros(len(triangles)),
        chain=np.full(len(corners), -1, np.int64),
        end=np.arange(len(corners)),
        gone=np.zeros(len(corners), np.bool_),
    )
    for share in _PASSES:
        _collapse_corners(mesh, tolerance * share, turn)
    return PlanMesh(corners, triangles[mesh.alive], plan.piece[mesh.alive])


def _sides(corners: NDArray[np.float64], triangles: NDArray[np.int64]) -> NDArray[np.int64]:
    """Tell which sides of the box around all triangles each corner lies on: a bit a side."""
    drawn = corners[triangles.ravel()]
    low, high = drawn.min(axis=0), drawn.max(axis=0)
    on = np.concatenate([corners <= low + _ON_SIDE, corners >= high - _ON_SIDE], axis=1)
    return np.asarray((on * np.array([1, 2, 4, 8])).sum(axis=1), np.int64)


class _Mesh(NamedTuple):
    """A plan that is being thinned.

    Attributes
    ----------
    xy
        Corners, metres, float64, shape ``(n, 2)``.
    z
        Their heights, metres, a column a kind of heights, float64, shape ``(n, kinds)``.
    triangles
        Corners of each triangle, int64, shape ``(m, 3)``.
    piece
        The piece of the plan each triangle belongs to, int64, shape ``(m,)``.
    sides
        Sides of the whole plan that each corner lies on, a bit a side, int64, shape ``(n,)``.
    used
        The kind of heights each piece lies at, int64, shape ``(pieces,)``.
    owner, first
        Triangles about each corner as the plan began: ``owner[first[v]:first[v + 1]]``.
    alive
        Whether a triangle is still there, bool, shape ``(m,)``.
    error
        How far a triangle may lie off its heights by what was taken out so far, metres, float64, shape ``(m,)``.
    chain
        The next corner that was drawn into the same one, -1 for none, int64, shape ``(n,)``.
    end
        The last of the chain that begins at a corner, int64, shape ``(n,)``.
    gone
        Whether a corner was taken out, bool, shape ``(n,)``.
    """

    xy: NDArray[np.float64]
    z: NDArray[np.float64]
    triangles: NDArray[np.int64]
    piece: NDArray[np.int64]
    sides: NDArray[np.int64]
    used: NDArray[np.int64]
    owner: NDArray[np.int64]
    first: NDArray[np.int64]
    alive: NDArray[np.bool_]
    error: NDArray[np.float64]
    chain: NDArray[np.int64]
    end: NDArray[np.int64]
    gone: NDArray[np.bool_]


class _Ring(NamedTuple):
    """Surroundings of one corner; room for the largest.

    Attributes
    ----------
    star
        The triangles about it.
    near
        The corners they have beside it.
    sides
        How many of the triangles lie at the edge to each of `near`.
    one, two
        The pieces on both sides of that edge; -1 where there is none.
    """

    star: NDArray[np.int64]
    near: NDArray[np.int64]
    sides: NDArray[np.int64]
    one: NDArray[np.int64]
    two: NDArray[np.int64]


@compiled
def _collapse_corners(mesh, tolerance, turn):
    """Collapse corners into neighbours where no triangle's height changes by more than its piece's tolerance."""
    ring = _Ring(
        np.empty(_MOST_ABOUT, np.int64),
        np.empty(_MOST_ABOUT + 2, np.int64),
        np.empty(_MOST_ABOUT + 2, np.int64),
        np.empty(_MOST_ABOUT + 2, np.int64),
        np.empty(_MOST_ABOUT + 2, np.int64),
    )
    for v in turn:
        if mesh.gone[v]:
            continue
        count = _gather_star(mesh, ring, v)
        if count < 2:
            continue
        size = _gather_ring(mesh, ring, v, count)
        if size < 0:
            continue
        free, one, two = _border_through(mesh, ring, v, size)
        if not free:
            continue
        best, error = _best_neighbour(mesh, tolerance, ring, v, (count, size), (one, two))
        if best >= 0:
            _collapse(mesh, ring, v, best, count, error)


@compiled(inline="always")
def _gather_star(mesh, ring, v):
    """Gather the triangles about a corner; returns how many, or -1 if there are too many."""
    first, owner, alive, triangles, chain = mesh.first, mesh.owner, mesh.alive, mesh.triangles, mesh.chain
    star = ring.star
    count, link = 0, v
    while link >= 0:
        for k in range(first[link], first[link + 1]):
            t = owner[k]
            if alive[t] and _has_corner(triangles, t, v):
                if count == _MOST_ABOUT:
                    return -1
                star[count] = t
                count += 1
        link = chain[link]
    return count


@compiled(inline="always")
def _has_corner(triangles, t, v):
    return triangles[t, 0] == v or triangles[t, 1] == v or triangles[t, 2] == v


@compiled(inline="always")
def _gather_ring(mesh, ring, v, count):
    """Gather a corner's neighbours, and the pieces on both sides of the edge to each; -1 if there are too many."""
    triangles, piece = mesh.triangles, mesh.piece
    star, near, sides = ring.star, ring.near, ring.sides
    one, two = ring.one, ring.two
    size = 0
    for k in range(count):
        t = star[k]
        for m in range(3):
            n = triangles[t, m]
            if n == v:
                continue
            at = _index_of(near, size, n)
            if at >= 0:
                sides[at] += 1
                two[at] = piece[t]
                continue
            if size == _MOST_ABOUT + 2:
                return -1
            near[size], sides[size], one[size], two[size] = n, 1, piece[t], -1
            size += 1
    return size


@compiled(inline="always")
def _index_of(values, count, wanted):
    for k in range(count):
        if values[k] == wanted:
            return k
    return -1


@compiled(inline="always")
def _border_through(mesh, ring, v, size):
    """Tell whether a corner may go, and the two neighbours along the straight border it lies on (-1 for none)."""
    near, sides, left, right = ring.near, ring.sides, ring.one, ring.two
    borders, one, two = 0, -1, -1
    for j in range(size):
        if sides[j] > 2:
            return False, one, two
        if left[j] != right[j]:
            borders += 1
            one, two = (near[j], two) if one < 0 else (one, near[j])
    if borders == 0:
        return True, -1, -1
    if borders != 2:
        return False, one, two
    if mesh.sides[v] & mesh.sides[one] & mesh.sides[two] != mesh.sides[v]:
        return False, one, two
    xy = mesh.xy
    length = np.hypot(xy[two, 0] - xy[one, 0], xy[two, 1] - xy[one, 1])
    cross = (xy[two, 0] - xy[one, 0]) * (xy[v, 1] - xy[one, 1]) - (xy[two, 1] - xy[one, 1]) * (xy[v, 0] - xy[one, 0])
    return length != 0.0 and abs(cross) <= _STRAIGHT * length, one, two


@compiled(inline="always")
def _best_neighbour(mesh, tolerance, ring, v, counts, border):
    """Find the neighbour that a corner is drawn into with the least error, -1 for none; and that error.

    `counts` are of triangles and neighbours about it; of a corner on a `border` only the neighbours along it count.
    """
    count, size = counts
    one, two = border
    error, star, near = mesh.error, ring.star, ring.near
    before = 0.0
    for k in range(count):
        before = max(before, error[star[k]])
    best, least = -1, 1e9
    for j in range(size):
        u = near[j]
        if one >= 0 and u != one and u != two:
            continue
        off = _error_after(mesh, tolerance, star, count, (v, u), before)
        if off >= 0.0 and off < least:
            best, least = u, off
    return best, least


@compiled(inline="always")
def _error_after(mesh, tolerance, star, count, move, before):
    """Error of a corner's triangles once it lies in another (`move` has both), metres; -1 where that can't be."""
    v, u = move
    xy, z, triangles, piece, used = mesh.xy, mesh.z, mesh.triangles, mesh.piece, mesh.used
    worst = 0.0
    for k in range(count):
        t = star[k]
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        if a == u or b == u or c == u:
            if tolerance[piece[t]] < before:
                return -1.0
            continue
        if b == v:
            b, c = c, a
        elif c == v:
            b, c = a, b
        off = _height_off(xy, z, used[piece[t]], v, u, b, c)
        if off < 0.0 or off + before > tolerance[piece[t]]:
            return -1.0
        worst = max(worst, off)
    return worst + before


@compiled(inline="always")
def _height_off(xy, z, kind, v, u, b, c):
    """How far `v` lies off the triangle ``u b c``, 0 beside it; -1 if the triangle is turned over, thin or long."""
    ux, uy = xy[u, 0], xy[u, 1]
    area = (xy[b, 0] - ux) * (xy[c, 1] - uy) - (xy[b, 1] - uy) * (xy[c, 0] - ux)
    x0, x1 = np.hypot(xy[b, 0] - ux, xy[b, 1] - uy), np.hypot(xy[c, 0] - ux, xy[c, 1] - uy)
    if area <= 0.002 * max(x0, x1) or x0 > _LONGEST or x1 > _LONGEST:
        return -1.0
    sb = ((xy[v, 0] - ux) * (xy[c, 1] - uy) - (xy[v, 1] - uy) * (xy[c, 0] - ux)) / area
    sc = ((xy[b, 0] - ux) * (xy[v, 1] - uy) - (xy[b, 1] - uy) * (xy[v, 0] - ux)) / area
    if sb >= -1e-3 and sc >= -1e-3 and sb + sc <= 1.001:
        return abs(z[v, kind] - z[u, kind] - sb * (z[b, kind] - z[u, kind]) - sc * (z[c, kind] - z[u, kind]))
    return 0.0


@compiled(inline="always")
def _collapse(mesh, ring, v, u, count, error):
    """Draw a corner into its neighbour `u`."""
    star, triangles, alive = ring.star, mesh.triangles, mesh.alive
    for k in range(count):
        t = star[k]
        if _has_corner(triangles, t, u):
            alive[t] = False
            continue
        for m in range(3):
            if triangles[t, m] == v:
                triangles[t, m] = u
        mesh.error[t] = error
    mesh.gone[v] = True
    mesh.chain[mesh.end[u]] = v
    mesh.end[u] = mesh.end[v]
