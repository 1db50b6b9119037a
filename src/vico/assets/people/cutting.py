"""Cutting meshes along a field and thinning them out, such that every vertex stays a mixture of original ones."""

from __future__ import annotations

import heapq

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, vstack


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
    """Thin a mesh by half-edge collapses in the order of their quadric error.

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

    Notes
    -----
    Garland and Heckbert, *Surface Simplification Using Quadric Error Metrics*, SIGGRAPH 1997, restricted to existing
    vertices. Open edges are held by planes perpendicular to the surface, and only slide along themselves.
    """
    mesh = _Thinning(points, triangles, importance)
    left = len(points)
    while left > target and mesh.offers:
        _, gone, stays, *stamps = heapq.heappop(mesh.offers)
        if mesh.is_current(gone, stays, stamps) and mesh.may_collapse(gone, stays):
            mesh.collapse(gone, stays)
            left -= 1
    return mesh.rest()


class _Thinning:
    """A mesh that is thinned, and the collapses on offer in it, the cheapest first."""

    def __init__(
        self, points: NDArray[np.float64], triangles: NDArray[np.int64], importance: NDArray[np.float64]
    ) -> None:
        count = len(points)
        self.points = points
        self.homogeneous = np.column_stack([points, np.ones(count)])
        self.quadrics = _quadrics(points, triangles) * importance[:, None, None]
        self.border = _border(triangles, count)
        self.faces = [list(face) for face in triangles.tolist()]
        self.around: list[set[int]] = [set() for _ in range(count)]
        for index, face in enumerate(self.faces):
            for vertex in face:
                self.around[vertex].add(index)
        self.alive = np.ones(count, bool)
        self.stamp = np.zeros(count, np.int64)
        # Cost, who goes, who stays, and their stamps: an offer made before one of them changed is void.
        self.offers: list[tuple[float, int, int, int, int]] = []
        for vertex in range(count):
            for other in sorted(self.neighbours(vertex)):
                self.offer(vertex, other)

    def neighbours(self, vertex: int) -> set[int]:
        """Return the vertices that share a triangle with this one."""
        found = {v for index in self.around[vertex] for v in self.faces[index]}
        found.discard(vertex)
        return found

    def offer(self, gone: int, stays: int) -> None:
        """Offer a collapse at its cost, unless it would pull an open edge inwards."""
        if self.border[gone] and not self.border[stays]:
            return
        q = self.quadrics[gone] + self.quadrics[stays]
        p = self.homogeneous[stays]
        length = float(((self.points[gone] - self.points[stays]) ** 2).sum())
        # A little of the length breaks ties on flat ground towards even triangles.
        cost = float(p @ q @ p) + 1e-7 * length
        heapq.heappush(self.offers, (cost, gone, stays, int(self.stamp[gone]), int(self.stamp[stays])))

    def is_current(self, gone: int, stays: int, stamps: list[int]) -> bool:
        """Whether both vertices are left, and as they were when the collapse was offered."""
        if not (self.alive[gone] and self.alive[stays]):
            return False
        return bool(self.stamp[gone] == stamps[0] and self.stamp[stays] == stamps[1])

    def may_collapse(self, gone: int, stays: int) -> bool:
        """Whether the surface stays one (the link condition), open edges stay where they are, and nothing flips."""
        shared = self.around[gone] & self.around[stays]
        if not shared or (self.border[gone] and len(shared) != 1):
            return False
        if len(self.neighbours(gone) & self.neighbours(stays)) != len(shared):
            return False
        return not _flips(self.points, self.faces, self.around[gone] - shared, gone, stays)

    def collapse(self, gone: int, stays: int) -> None:
        """Move a vertex to another, and offer anew what lies around."""
        for index in self.around[gone] & self.around[stays]:
            for vertex in self.faces[index]:
                self.around[vertex].discard(index)
        for index in self.around[gone]:
            self.faces[index] = [stays if vertex == gone else vertex for vertex in self.faces[index]]
            self.around[stays].add(index)
        self.alive[gone] = False
        self.quadrics[stays] += self.quadrics[gone]
        self.stamp[stays] += 1
        for other in sorted(self.neighbours(stays)):
            self.offer(stays, other)
            self.offer(other, stays)

    def rest(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the vertices that are left, and the triangles between them."""
        # A vertex that lost all its triangles is of no use.
        count = len(self.points)
        kept = np.array([v for v in range(count) if self.alive[v] and self.around[v]], np.int64)
        place = np.full(count, -1, np.int64)
        place[kept] = np.arange(len(kept))
        live = sorted({index for vertex in kept for index in self.around[vertex]})
        return kept, place[np.array([self.faces[index] for index in live], np.int64)]


def _quadrics(points: NDArray[np.float64], triangles: NDArray[np.int64]) -> NDArray[np.float64]:
    quadrics = np.zeros((len(points), 4, 4))
    a, b, c = (points[triangles[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1, keepdims=True)
    normal /= np.maximum(area, 1e-15)
    plane = np.column_stack([normal, -(normal * a).sum(1)])
    outer = plane[:, :, None] * plane[:, None, :] * area[:, :, None]
    for k in range(3):
        np.add.at(quadrics, triangles[:, k], outer)
    for u, v, face in _open_edges(triangles):
        edge = points[v] - points[u]
        across = np.cross(edge, normal[face])
        across /= max(float(np.linalg.norm(across)), 1e-15)
        fence = np.append(across, -across @ points[u])
        held = 20 * float(edge @ edge) * np.outer(fence, fence)
        quadrics[u] += held
        quadrics[v] += held
    return quadrics


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


def _border(triangles: NDArray[np.int64], count: int) -> NDArray[np.bool_]:
    border = np.zeros(count, bool)
    for u, v, _ in _open_edges(triangles):
        border[u] = border[v] = True
    return border


def _flips(points: NDArray[np.float64], faces: list[list[int]], indices: set[int], gone: int, stays: int) -> bool:
    for index in indices:
        before = points[faces[index]]
        after = points[[stays if vertex == gone else vertex for vertex in faces[index]]]
        old = np.cross(before[1] - before[0], before[2] - before[0])
        new = np.cross(after[1] - after[0], after[2] - after[0])
        if old @ new < 0.2 * np.sqrt((old @ old) * (new @ new)):
            return True
    return False


def open_loops(triangles: NDArray[np.int64]) -> NDArray[np.int64]:
    """Open edges in their triangles' direction, shape ``(k, 2)``."""
    return np.array([(u, v) for u, v, _ in _open_edges(triangles)], np.int64).reshape(-1, 2)
