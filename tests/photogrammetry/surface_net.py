"""The surface inside a volume of densities: naive surface nets, one vertex a cell that the surface passes through."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_CORNERS = np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)])
_EDGES = np.array(
    [(a, b) for a in range(8) for b in range(a + 1, 8) if int(np.abs(_CORNERS[a] - _CORNERS[b]).sum()) == 1]
)


def surface_net(density: NDArray[np.float32], level: float = 0.5) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Mesh the border between what is denser than `level` and what is not.

    Parameters
    ----------
    density
        Values at grid points, float32, shape ``(nx, ny, nz)``. At the sides of the volume the surface is open.
    level
        The value on the surface.

    Returns
    -------
    tuple
        Vertices in grid steps, float64, shape ``(n, 3)``, in the order of their cells; triangles, counter-clockwise
        seen from the thin side, int32, shape ``(m, 3)``.

    Notes
    -----
    Gibson (1998), without the relaxation: each vertex is the mean of where the surface crosses its cell's edges.
    """
    inside = density > level
    count = np.zeros(tuple(n - 1 for n in density.shape), np.uint8)
    views = [
        (slice(i, density.shape[0] - 1 + i), slice(j, density.shape[1] - 1 + j), slice(k, density.shape[2] - 1 + k))
        for i, j, k in _CORNERS.tolist()
    ]
    for view in views:
        count += inside[view]
    cells = np.argwhere((count > 0) & (count < 8))
    if not len(cells):
        return np.zeros((0, 3)), np.zeros((0, 3), np.int32)
    number = np.full(count.shape, -1, np.int32)
    number[tuple(cells.T)] = np.arange(len(cells), dtype=np.int32)
    values = np.stack([density[tuple((cells + corner).T)] for corner in _CORNERS], axis=1).astype(np.float64) - level
    total, hits = np.zeros((len(cells), 3)), np.zeros(len(cells))
    for a, b in _EDGES.tolist():
        crossing = (values[:, a] > 0) != (values[:, b] > 0)
        share = np.where(crossing, values[:, a] / np.where(crossing, values[:, a] - values[:, b], 1.0), 0.0)
        total += np.where(crossing[:, None], _CORNERS[a] + share[:, None] * (_CORNERS[b] - _CORNERS[a]), 0.0)
        hits += crossing
    vertices = cells + total / hits[:, None]
    quads: list[NDArray[np.int32]] = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        first = [slice(None)] * 3
        second = [slice(None)] * 3
        first[axis], second[axis] = slice(None, -1), slice(1, None)
        # Edges on the volume's sides have no four cells around them.
        for other in (u, v):
            first[other] = second[other] = slice(1, -1)
        low, high = inside[tuple(first)], inside[tuple(second)]
        at = np.argwhere(low != high)
        leaving = low[tuple(at.T)]
        at[:, u] += 1
        at[:, v] += 1
        step_u, step_v = np.eye(3, dtype=np.int64)[u], np.eye(3, dtype=np.int64)[v]
        ring = [at - step_u - step_v, at - step_v, at, at - step_u]
        quad = np.stack([number[tuple(cell.T)] for cell in ring], axis=1)
        quads.append(np.where(leaving[:, None], quad, quad[:, ::-1]))
    four = np.concatenate(quads)
    triangles = np.concatenate([four[:, [0, 1, 2]], four[:, [0, 2, 3]]])
    return vertices, triangles.astype(np.int32)
