"""Cutting meshes along a field and thinning them out, such that every vertex stays a mixture of original ones."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, vstack

from vico.assets.simplify import collapsed, even_worth


def cut(
    rows: csr_matrix, triangles: NDArray[np.int64], field: NDArray[np.float64]
) -> tuple[csr_matrix, NDArray[np.int64]]:
    """Keep the part of a mesh where a field is positive, cutting triangles along its zero line.

    Parameters
    ----------
    rows
        Each vertex as a mixture of original vertices, shape ``(v, originals)``.
    triangles
        Shape ``(m, 3)``.
    field
        One value a vertex.

    Returns
    -------
    rows, triangles
        The same for what is left; unused vertices are gone.
    """
    inside = field > 0
    faces: list[tuple[int, int, int]] = []
    crossings: dict[tuple[int, int], int] = {}
    parts: list[tuple[int, int, float]] = []

    def crossing(a: int, b: int) -> int:
        key = (min(a, b), max(a, b))
        if key not in crossings:
            low, high = key
            crossings[key] = len(field) + len(parts)
            parts.append((low, high, float(field[low] / (field[low] - field[high]))))
        return crossings[key]

    for triangle in triangles.tolist():
        count = int(inside[triangle].sum())
        if count == 0:
            continue
        if count == 3:
            faces.append((triangle[0], triangle[1], triangle[2]))
            continue
        # Turn the odd one out to the front; the rest follows in order, so orientation is kept.
        odd = next(k for k in range(3) if inside[triangle[k]] == (count == 1))
        a, b, c = triangle[odd], triangle[(odd + 1) % 3], triangle[(odd + 2) % 3]
        ab, ac = crossing(a, b), crossing(a, c)
        if count == 1:
            faces.append((a, ab, ac))
        else:
            faces += [(ab, b, c), (ab, c, ac)]
    if parts:
        table = np.array(parts)
        low, high, share = table[:, 0].astype(int), table[:, 1].astype(int), table[:, 2]
        rows = vstack([rows, rows[low].multiply(1 - share[:, None]) + rows[high].multiply(share[:, None])]).tocsr()
    used, compact = np.unique(np.array(faces, np.int64).reshape(-1, 3), return_inverse=True)
    return rows[used], compact.reshape(-1, 3)


def decimated(
    points: NDArray[np.float64], triangles: NDArray[np.int64], target: int, importance: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Thin a mesh to a subset of its vertices.

    Parameters
    ----------
    points
        Shape ``(v, 3)``.
    triangles
        Shape ``(m, 3)``.
    target
        Vertices wanted.
    importance
        Factor on each vertex's error: places to keep detail at.

    Returns
    -------
    kept, triangles
        Which vertices are left, and triangles that index them.
    """
    worth = even_worth(len(points))._replace(care=importance)
    _, left = collapsed(points, triangles, triangles, worth, vertices=target)
    kept, index = np.unique(left, return_inverse=True)
    return kept, index.reshape(-1, 3)


def _open_edges(triangles: NDArray[np.int64]) -> list[tuple[int, int, int]]:
    """Edges with one triangle: from, to (in its order), triangle."""
    seen: dict[tuple[int, int], tuple[int, int, int]] = {}
    doubled: set[tuple[int, int]] = set()
    for index, (a, b, c) in enumerate(triangles.tolist()):
        for u, v in ((a, b), (b, c), (c, a)):
            key = (min(u, v), max(u, v))
            if key in seen:
                doubled.add(key)
            seen[key] = (u, v, index)
    return [edge for key, edge in seen.items() if key not in doubled]


def open_loops(triangles: NDArray[np.int64]) -> NDArray[np.int64]:
    """Open edges in their triangles' direction, shape ``(k, 2)``."""
    return np.array([(u, v) for u, v, _ in _open_edges(triangles)], np.int64).reshape(-1, 2)
