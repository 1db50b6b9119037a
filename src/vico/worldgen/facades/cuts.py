"""Closed meshes divided at heights, so that a wall can change its picture there, with few triangles more."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


def cut_at_heights(
    points: NDArray[np.float64], faces: NDArray[np.int64], owner: NDArray[np.int64], heights: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Cut closed meshes by a horizontal plane each, without opening them.

    Parameters
    ----------
    points, faces
        All meshes together, shapes ``(n, 3)`` and ``(m, 3)``; no two share points.
    owner
        The mesh each face belongs to, shape ``(m,)``.
    heights
        Where each mesh is cut, shape ``(meshes,)``; NaN leaves it whole.

    Returns
    -------
    tuple
        Points, faces and owners after the cut: no triangle crosses its mesh's plane, and every edge that does is
        divided at one point that both its triangles use.
    """
    level = np.full(len(points), np.nan)
    level[faces.ravel()] = np.repeat(heights[owner], 3)
    above = points[:, 2] - level
    side = np.where(np.isnan(above) | (np.abs(above) < 1e-4), 0, np.sign(np.nan_to_num(above))).astype(np.int64)
    corner = side[faces]
    crossing = (corner.max(axis=1) > 0) & (corner.min(axis=1) < 0)
    if not crossing.any():
        return points, faces, owner
    cut, cut_side, cut_owner = faces[crossing], corner[crossing], owner[crossing]
    # Turn each triangle so that its first corner is the one alone on its side, or the one on the plane.
    flat = (cut_side == 0).any(axis=1)
    alone = np.where(cut_side.sum(axis=1)[:, None] > 0, cut_side < 0, cut_side > 0)
    first = np.where(flat, np.argmax(cut_side == 0, axis=1), np.argmax(alone, axis=1))
    turn = (first[:, None] + np.arange(3)) % 3
    cut = np.take_along_axis(cut, turn, axis=1)
    a, b, c = cut.T
    pairs = np.concatenate(
        [
            np.stack([b[flat], c[flat]], axis=1),
            np.stack([a[~flat], b[~flat]], axis=1),
            np.stack([a[~flat], c[~flat]], axis=1),
        ]
    )
    low, high = pairs.min(axis=1), pairs.max(axis=1)
    keys, index = np.unique(low * np.int64(len(points)) + high, return_inverse=True)
    p, q = points[keys // len(points)], points[keys % len(points)]
    share = (level[keys // len(points)] - p[:, 2]) / (q[:, 2] - p[:, 2])
    new = p + (q - p) * share[:, None]
    new[:, 2] = level[keys // len(points)]
    index = index.ravel() + len(points)
    n_flat, n_split = int(flat.sum()), int((~flat).sum())
    on_bc, on_ab, on_ac = index[:n_flat], index[n_flat : n_flat + n_split], index[n_flat + n_split :]
    fa, fb, fc = cut[flat].T
    sa, sb, sc = cut[~flat].T
    made = np.concatenate(
        [
            np.stack([fa, fb, on_bc], axis=1),
            np.stack([fa, on_bc, fc], axis=1),
            np.stack([sa, on_ab, on_ac], axis=1),
            np.stack([on_ab, sb, sc], axis=1),
            np.stack([on_ab, sc, on_ac], axis=1),
        ]
    )
    whose = np.concatenate([*[cut_owner[flat]] * 2, *[cut_owner[~flat]] * 3])
    return (
        np.concatenate([points, new]),
        np.concatenate([faces[~crossing], made]),
        np.concatenate([owner[~crossing], whose]),
    )


def without_needless(
    points: NDArray[np.float64], faces: NDArray[np.int64], owner: NDArray[np.int64], first: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Take out points that a cut left in the middle of a flat wall, where the wall's diagonals crossed the cut.

    Parameters
    ----------
    points, faces, owner
        Closed meshes after `cut_at_heights`.
    first
        Number of points there were before: those from here on may go.

    Returns
    -------
    tuple
        Faces and their owners: as closed as before, fewer. A needless point is drawn along its cut into the next one.
    """
    corner = points[faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    size = np.linalg.norm(normal, axis=1)
    normal /= np.maximum(size, 1e-12)[:, None]
    candidates = _within_flat_walls(points, faces, normal, first)
    if not len(candidates):
        return faces, owner
    wanted = np.zeros(len(points), bool)
    wanted[candidates] = True
    near = np.unique(faces[wanted[faces].any(axis=1)])
    wanted[near] = True
    touched = np.flatnonzero(wanted[faces].any(axis=1))
    corners = np.unique(faces[touched])
    fan = _Fan(
        dict(zip(touched.tolist(), faces[touched].tolist(), strict=True)),
        {},
        dict(zip(corners.tolist(), points[corners].tolist(), strict=True)),
        dict(zip(touched.tolist(), normal[touched].tolist(), strict=True)),
    )
    for k, triangle in fan.triangles.items():
        for v in triangle:
            fan.around.setdefault(v, set()).add(k)
    for v in candidates.tolist():
        ring = fan.ring(v)
        for w in sorted(ring):
            if fan.spots[w][2] == fan.spots[v][2] and fan.drawn_into(v, w, ring):
                break
    left = np.array(list(fan.triangles), np.int64)
    changed, kept = faces.copy(), np.ones(len(faces), bool)
    kept[touched] = False
    kept[left] = True
    changed[left] = np.array(list(fan.triangles.values()), np.int64).reshape(-1, 3)
    return changed[kept], owner[kept]


def _within_flat_walls(
    points: NDArray[np.float64], faces: NDArray[np.int64], normal: NDArray[np.float64], first: int
) -> NDArray[np.int64]:
    """Return the points from `first` on all of whose faces lie in one plane."""
    candidates = np.arange(first, len(points))
    low, high = np.full((len(points), 3), np.inf), np.full((len(points), 3), -np.inf)
    for k in range(3):
        np.minimum.at(low, faces[:, k], normal)
        np.maximum.at(high, faces[:, k], normal)
    flat = (high[candidates] - low[candidates]).max(axis=1) < 1e-5
    return candidates[flat & np.isfinite(low[candidates, 0])]


@dataclass
class _Fan:
    """Triangles by number while points are taken out; which are around each point, where points are, and normals."""

    triangles: dict[int, list[int]]
    around: dict[int, set[int]]
    spots: dict[int, list[float]]
    facing: dict[int, list[float]]

    def ring(self, v: int) -> set[int]:
        """Return the points that share a triangle with one."""
        return {w for k in self.around[v] for w in self.triangles[k] if w != v}

    def drawn_into(self, v: int, w: int, ring: set[int]) -> bool:
        """Draw a point into one of its ring, if that leaves the mesh closed and no face turned over."""
        mine = self.around[v]
        gone = [k for k in mine if w in self.triangles[k]]
        if len(gone) != 2:
            return False
        if len(self.ring(w) & ring - {v}) != 2:  # else two sheets would be glued together
            return False
        kept = [k for k in mine if k not in gone]
        moved = [[w if u == v else u for u in self.triangles[k]] for k in kept]
        if any(_area([self.spots[u] for u in row], self.facing[k]) < 1e-6 for row, k in zip(moved, kept, strict=True)):
            return False
        for k in gone:
            for u in self.triangles.pop(k):
                if u != v:
                    self.around[u].discard(k)
        for k, row in zip(kept, moved, strict=True):
            self.triangles[k] = row
            self.around[w].add(k)
        self.around[v] = set()
        return True


def _area(corners: list[list[float]], normal: list[float]) -> float:
    """Twice a triangle's area, negative where it is turned over."""
    a, b, c = corners
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    return (uy * vz - uz * vy) * normal[0] + (uz * vx - ux * vz) * normal[1] + (ux * vy - uy * vx) * normal[2]
