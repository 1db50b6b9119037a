"""One mesh of many: triangles of neighbouring pieces get each other's corners, so that no crack opens between them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from vico.geometry import distances

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Heights = Callable[[Floats], Floats]

_WELD = 1000.0  # corners within a millimetre are one
_ON_EDGE = 0.0015  # metres from an edge within which a corner lies on it


@dataclass(frozen=True)
class PlanMesh:
    """Triangles in plan that share their corners.

    Attributes
    ----------
    corners
        Metres, shape ``(n, 2)``.
    triangles
        Counter-clockwise, shape ``(m, 3)``.
    piece
        The piece each triangle belongs to, shape ``(m,)``.
    """

    corners: Floats
    triangles: Ints
    piece: Ints

    def border(self, pieces: Ints, outline: BaseGeometry) -> Ints:
        """Edges of some pieces that lie on an outline, the pieces to their left, shape ``(k, 2)``."""
        mine = _edges(self.triangles[np.isin(self.piece, pieces)])
        mine = mine[~np.isin(_keys(mine), _keys(mine[:, ::-1]))]
        lines, line = shapely.get_coordinates(shapely.get_parts(shapely.get_parts([outline])), return_index=True)
        if not len(mine) or not len(line):
            return mine[:0]
        first = np.flatnonzero(line[1:] == line[:-1])
        tree = shapely.STRtree(shapely.linestrings(np.stack([lines[first], lines[first + 1]], axis=1)))
        middle = shapely.points(self.corners[mine].mean(axis=1))
        return mine[np.unique(tree.query(middle, predicate="dwithin", distance=2 * _ON_EDGE)[0])]


def conforming(parts: list[tuple[Floats, Ints]], extra: Floats | None = None) -> PlanMesh:
    """Join triangulated pieces that lie side by side.

    Parameters
    ----------
    parts
        Corners and triangles of each piece; the pieces don't overlap.
    extra
        Further points that edges on pieces' borders are to be parted at, shape ``(n, 2)``.

    Returns
    -------
    PlanMesh
        Where a corner of one triangle lies on another's edge, that one is parted there.
    """
    offsets = np.cumsum([0, *(len(flat) for flat, _ in parts)])
    flat = np.concatenate([flat for flat, _ in parts]) if parts else np.zeros((0, 2))
    faces = [np.asarray(faces, np.int64) + start for (_, faces), start in zip(parts, offsets[:-1], strict=True)]
    triangles = np.concatenate(faces) if faces else np.zeros((0, 3), np.int64)
    piece = np.repeat(np.arange(len(parts)), [len(own) for own in faces]) if faces else np.zeros(0, np.int64)
    if extra is not None:
        flat = np.concatenate([flat, extra])
    grid = np.round(flat * _WELD).astype(np.int64)
    order = np.lexsort((grid[:, 1], grid[:, 0]))
    fresh = np.r_[True, (np.diff(grid[order], axis=0) != 0).any(axis=1)] if len(order) else np.zeros(0, bool)
    number = np.empty(len(flat), np.int64)
    number[order] = np.cumsum(fresh) - 1
    corners = flat[order[fresh]]
    triangles = number[triangles]
    whole = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    triangles, piece = triangles[whole], piece[whole]
    added = number[len(flat) - len(extra) :] if extra is not None else np.zeros(0, np.int64)
    triangles, piece = _parted(corners, triangles, piece, added)
    turn = _turn(corners, triangles)
    kept = turn > 1e-9
    return PlanMesh(corners, triangles[kept], piece[kept])


def _turn(corners: Floats, triangles: Ints) -> Floats:
    """Twice the areas of triangles."""
    a, b, c = (corners[triangles[:, k]] for k in range(3))
    return np.asarray((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])


def _edges(triangles: Ints) -> Ints:
    return np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])


def _keys(edges: Ints) -> Ints:
    return np.asarray(edges[:, 0] << 32 | edges[:, 1])


def _parted(corners: Floats, triangles: Ints, piece: Ints, added: Ints) -> tuple[Ints, Ints]:
    """Part triangles at corners that lie on their edges."""
    edges = _edges(triangles)
    alone = edges[~np.isin(_keys(edges), _keys(edges[:, ::-1]))]
    ends = np.unique(np.r_[alone.ravel(), added])
    if not len(alone):
        return triangles, piece
    tree = shapely.STRtree(shapely.points(corners[ends]))
    edge, point = tree.query(shapely.linestrings(corners[alone]), predicate="dwithin", distance=_ON_EDGE)
    point = ends[point]
    a, b = corners[alone[edge, 0]], corners[alone[edge, 1]]
    along = ((corners[point] - a) * (b - a)).sum(axis=1) / ((b - a) ** 2).sum(axis=1)
    margin = 0.5 / _WELD / distances(b, a)
    inside = (along > margin) & (along < 1.0 - margin) & (point != alone[edge, 0]) & (point != alone[edge, 1])
    edge, point, along = edge[inside], point[inside], along[inside]
    order = np.lexsort((along, edge))
    edge, point = edge[order], point[order]
    # Edges with corners on them, and where their corners begin in `point`.
    busy, start, count = np.unique(edge, return_index=True, return_counts=True)
    keys = _keys(alone[busy])
    by_key = np.argsort(keys)
    keys, start, count = keys[by_key], start[by_key], count[by_key]
    for _ in range(3):
        if not len(keys):
            break
        own = np.stack([_keys(triangles[:, [k, (k + 1) % 3]]) for k in range(3)], axis=1)
        place = np.minimum(np.searchsorted(keys, own), len(keys) - 1)
        hit = keys[place] == own
        chosen = np.flatnonzero(hit.any(axis=1))
        if not len(chosen):
            break
        side = hit[chosen].argmax(axis=1)
        turned = triangles[chosen[:, None], (side[:, None] + np.arange(3)) % 3]
        which = place[chosen, side]
        pieces = count[which] + 1
        row = np.repeat(np.arange(len(chosen)), pieces)
        step = np.arange(len(row)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
        at = start[which][row] + step
        first = np.where(step == 0, turned[row, 0], point[np.maximum(at - 1, 0)])
        last = np.where(step == pieces[row] - 1, turned[row, 1], point[np.minimum(at, len(point) - 1)])
        fan = np.stack([first, last, turned[row, 2]], axis=1)
        rest = np.ones(len(triangles), bool)
        rest[chosen] = False
        triangles = np.concatenate([triangles[rest], fan])
        piece = np.concatenate([piece[rest], piece[chosen][row]])
    return triangles, piece
