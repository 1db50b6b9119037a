"""Making meshes light: one implementation for people, robots and furniture.

Half-edge collapses in the order of Garland and Heckbert's quadric error (*Surface Simplification Using Quadric Error
Metrics*, SIGGRAPH 1997). Vertices that stay are where they were, so whatever else is known of them (normals, colours,
joints, morph targets) stays right. Of a place where surfaces of several kinds meet, each keeps its own corners (its
*wedges*, as in Hoppe, *New Quadric Metric for Simplifying Meshes with Appearance Attributes*, Visualization 1999), so
no crack opens there. Open edges, and edges between kinds, only slide along themselves.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.collapse import Loss, collapse

Array = NDArray[Any]

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


def collapsed(
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
    alive = collapse(loss, places.astype(np.int64), corners, triangles, vertices, False)
    return np.flatnonzero(alive), corners[alive]


def thinned(
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
    points, faces, kept = _welded(np.asarray(points, np.float64), np.asarray(faces, np.int64))
    worn = np.zeros(len(faces), np.int64) if kinds is None else np.asarray(kinds, np.int64)[kept]
    if len(faces) > triangles:
        loss = Loss(points, *_quadrics(points, faces, worn), *even_worth(len(points)))
        alive = collapse(loss, faces, faces.copy(), triangles, 0, True)
        faces, kept = faces[alive], kept[alive]
    used, index = np.unique(faces, return_inverse=True)
    return points[used], index.reshape(-1, 3), kept


def _welded(points: Array, faces: Array) -> tuple[Array, Array, Array]:
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
