"""Posed bodies in a scene's mesh: room for them behind all that never moves, and where they are now."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.render.arrays import PosedAvatars
from vico.render.compiled import kernel
from vico.render.geometry import Mesh
from vico.render.limbs import LIMBS
from vico.render.records import SPAN


def no_avatars() -> PosedAvatars:
    """Return nobody."""
    none = np.zeros((0, 3), np.float32)
    return PosedAvatars(none, none.copy(), np.zeros(0, SPAN), np.zeros((0, len(LIMBS), 7), np.float32))


def with_room(mesh: Mesh, used: tuple[int, int], vertices: int, triangles: int) -> Mesh:
    """Return a copy of the static part with space for avatars behind it."""
    t, v = used

    def grown(values: NDArray[Any], keep: int, extra: int) -> NDArray[Any]:
        return np.concatenate([values[:keep], np.zeros((extra, *values.shape[1:]), values.dtype)])

    return Mesh(
        grown(mesh.x, v, vertices),
        grown(mesh.y, v, vertices),
        grown(mesh.z, v, vertices),
        grown(mesh.vertex, v, vertices),
        grown(mesh.triangle, t, triangles),
        grown(mesh.entity, t, triangles),
    )


@kernel
def pose_avatars(
    mesh: Mesh,
    vertices: NDArray[np.float32],
    normals: NDArray[np.float32],
    first_vertex: int,
    span: NDArray[np.void],
    low: NDArray[np.float32],
    high: NDArray[np.float32],
) -> bool:
    """Write positions, normals and bounds; return False if a position is not finite."""
    xs, ys, zs, records = mesh.x, mesh.y, mesh.z, mesh.vertex
    total = np.float32(0.0)
    for body in range(len(span)):
        first, end = span[body].first_vertex, span[body].end_vertex
        for k in range(first, end):
            i = k - first_vertex
            x, y, z = vertices[i, 0], vertices[i, 1], vertices[i, 2]
            xs[k], ys[k], zs[k] = x, y, z
            # Zero for finite numbers, else none.
            total += (x - x) + (y - y) + (z - z)
            position, normal = records[k].position, records[k].normal
            position[0], position[1], position[2] = x, y, z
            normal[0], normal[1], normal[2] = normals[i, 0], normals[i, 1], normals[i, 2]
        for axis in range(3):
            line = xs if axis == 0 else (ys if axis == 1 else zs)
            smallest = largest = line[first]
            for v in range(first, end):
                smallest, largest = min(smallest, line[v]), max(largest, line[v])
            low[body, axis], high[body, axis] = smallest, largest
    return bool(total == 0.0)
