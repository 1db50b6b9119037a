"""Making a heavy mesh light: vertices clustered on a grid, each cluster's vertex placed by its quadric.

Quadrics as in Lindstrom, "Out-of-core simplification of large polygonal models" (SIGGRAPH 2000): the vertex that
stands for a cell minimises the distance to the planes of the triangles that met there, so edges and corners stay.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.world.mesh import Surface

Array = NDArray[Any]


def clustered(points: Array, faces: Array, cell: float) -> tuple[Array, Array]:
    """Merge the vertices of every grid cell of side `cell` into one; returns the remaining points and triangles."""
    origin = points.min(axis=0) - cell / 2
    keys = np.floor((points - origin) / cell).astype(np.int64)
    span = keys.max(axis=0) + 1
    flat = (keys[:, 0] * span[1] + keys[:, 1]) * span[2] + keys[:, 2]
    _, owner = np.unique(flat, return_inverse=True)
    count = int(owner.max()) + 1
    corners = points[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(normals, axis=1)
    unit = normals / np.maximum(area, 1e-18)[:, None]
    mass = np.zeros(count)
    centre = np.zeros((count, 3))
    quadric = np.zeros((count, 3, 3))
    target = np.zeros((count, 3))
    outer = unit[:, :, None] * unit[:, None, :] * area[:, None, None]
    pull = unit * (np.einsum("ij,ij->i", unit, corners[:, 0]) * area)[:, None]
    for k in range(3):
        cells = owner[faces[:, k]]
        np.add.at(mass, cells, area)
        np.add.at(centre, cells, corners[:, k] * area[:, None])
        np.add.at(quadric, cells, outer)
        np.add.at(target, cells, pull)
    loose = mass <= 0
    counts = np.bincount(owner, minlength=count)
    mean = np.stack([np.bincount(owner, points[:, k], count) for k in range(3)], axis=1) / counts[:, None]
    centre = np.where(loose[:, None], mean, centre / np.maximum(mass, 1e-18)[:, None])
    # Directions the planes leave open (flat or straight places) keep the centre's coordinate.
    values, vectors = np.linalg.eigh(quadric)
    gap = target - np.einsum("nij,nj->ni", quadric, centre)
    along = np.einsum("nji,nj->ni", vectors, gap)
    strong = values > 1e-2 * np.maximum(values[:, 2:], 1e-18)
    step = np.einsum("nij,nj->ni", vectors, np.where(strong, along / np.where(strong, values, 1.0), 0.0))
    far = np.linalg.norm(step, axis=1, keepdims=True)
    step *= np.minimum(1.0, cell / np.maximum(far, 1e-18))
    merged = owner[faces]
    keep = (merged[:, 0] != merged[:, 1]) & (merged[:, 1] != merged[:, 2]) & (merged[:, 2] != merged[:, 0])
    return centre + step, merged[keep]


def decimated(points: Array, faces: Array, triangles: int) -> tuple[Array, Array]:
    """Reduce a mesh to at most `triangles` triangles; a lighter one is returned as it is."""
    points = np.asarray(points, np.float64)
    faces = np.asarray(faces, np.int64)
    if len(faces) <= triangles:
        return points, faces
    extent = float(np.ptp(points, axis=0).max())
    fine, coarse = extent / 2000, extent
    best = clustered(points, faces, coarse)
    for _ in range(18):
        cell = float(np.sqrt(fine * coarse))
        trial = clustered(points, faces, cell)
        lean = _without_doubles(*trial)
        if len(lean[1]) <= triangles:
            best, coarse = lean, cell
        else:
            fine = cell
    return best


def _without_doubles(points: Array, faces: Array) -> tuple[Array, Array]:
    """Drop all but one of triangles on the same vertices, and vertices nobody uses."""
    order = np.sort(faces, axis=1)
    _, first = np.unique(order, axis=0, return_index=True)
    kept = faces[np.sort(first)]
    used, index = np.unique(kept, return_inverse=True)
    return points[used], index.reshape(-1, 3)


def shaded(points: Array, faces: Array, colour: tuple[int, int, int], *, crease: float = 40.0) -> Surface:
    """Make a surface whose normals are smooth except across edges sharper than `crease` degrees."""
    corners = points[faces]
    weighted = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(weighted, axis=1, keepdims=True)
    unit = weighted / np.maximum(size, 1e-18)
    vertex = faces.ravel()
    face = np.repeat(np.arange(len(faces)), 3)
    order = np.argsort(vertex, kind="stable")
    starts = np.searchsorted(vertex[order], np.arange(len(points) + 1))
    normals = np.zeros((len(vertex), 3))
    limit = np.cos(np.radians(crease))
    for v in range(len(points)):
        around = order[starts[v] : starts[v + 1]]
        if len(around):
            near = unit[face[around]] @ unit[face[around]].T > limit
            normals[around] = near @ weighted[face[around]]
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    normals = np.where(length > 1e-15, normals / np.maximum(length, 1e-18), unit[face])
    return Surface.from_triangles(points[vertex], np.arange(len(vertex)).reshape(-1, 3), colour=colour, normals=normals)
