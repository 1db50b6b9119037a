"""Normals for meshes that come without any."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.world.mesh import Surface

Array = NDArray[Any]


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
