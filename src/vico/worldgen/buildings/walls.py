"""Walls of buildings: the lines they stand on, what each faces, where its storeys lie, and walls cut at heights.

What a facade shows and what hangs on it agree on the storeys. Closed meshes are cut at heights, so that a wall can
change its picture there, with few triangles more.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.exact import apply_matrix
from vico.geo.osm import OsmData, OsmWay
from vico.worldgen.buildings.solids import Footing
from vico.worldgen.facades.facade_styles import styles
from vico.worldgen.facades.textures.walls import STOREYS
from vico.worldgen.facts.building_plans import BuildingPlan, PartPlan
from vico.worldgen.facts.roofs import rings_of
from vico.worldgen.facts.site import on_the_ground

_FRONT_REACH = 17.0  # metres from a street's centre line within which a wall faces it


class WallSide(IntEnum):
    """Kind of a wall, by what it faces."""

    BLANK = 0
    BACK = 1
    FRONT = 2
    SHOPFRONT = 3


@dataclass
class WallLines:
    """Wall lines of all parts.

    Attributes
    ----------
    start, end
        Of each line, ENU metres, shape ``(n, 2)``; the building lies on its left.
    style
        What the wall shows: a `WallSide`, shape ``(n,)``.
    first
        Where each part's lines begin, shape ``(parts + 1,)``.
    """

    start: NDArray[np.float64]
    end: NDArray[np.float64]
    style: NDArray[np.int64]
    first: NDArray[np.int64]


def wall_lines(plans: list[BuildingPlan], seats: list[Footing], osm: OsmData) -> WallLines:
    """Return every wall's line, and what it shows: nothing towards a neighbour, a front towards a street."""
    starts: list[NDArray[np.float64]] = []
    ends: list[NDArray[np.float64]] = []
    part_of: list[int] = []
    plan_of: list[int] = []
    parts: list[PartPlan] = []
    first = [0]
    for p, plan in enumerate(plans):
        for part in plan.solids:
            for ring in rings_of(part.polygon):
                starts.append(ring)
                ends.append(np.roll(ring, -1, axis=0))
            n = sum(len(s) for s in starts[-(1 + len(part.polygon.interiors)) :])
            part_of += [len(parts)] * n
            plan_of += [p] * n
            first.append(first[-1] + n)
            parts.append(part)
    if not parts:
        return WallLines(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0, np.int64), np.zeros(1, np.int64))
    start, end = np.concatenate(starts), np.concatenate(ends)
    along = end - start
    length = np.hypot(*along.T)
    outward = np.stack([along[:, 1], -along[:, 0]], axis=1) / np.maximum(length, 1e-9)[:, None]
    middle = (start + end) / 2
    style = np.full(len(start), WallSide.BACK, np.int64)
    streets = [shapely.LineString(way.line) for way in osm.ways if is_street(way)]
    if streets:
        near = shapely.STRtree(streets).query(
            shapely.points(middle + outward * 1.0), predicate="dwithin", distance=_FRONT_REACH
        )
        style[np.unique(near[0])] = WallSide.FRONT
    trading = np.array([plan.shops > 0 or plan.use in ("retail", "commercial") for plan in plans])[plan_of]
    style[(style == WallSide.FRONT) & trading & (length > 2.2)] = WallSide.SHOPFRONT
    # A wall against a neighbour's is a fire wall where it rises above it, and unseen where it does not.
    probes = shapely.points(middle + outward * 0.4)
    left, right = shapely.STRtree([part.polygon for part in parts]).query(probes, predicate="intersects")
    owner = np.array(plan_of)
    owner_of_part = np.array([p for p, plan in enumerate(plans) for _ in plan.solids])
    low = np.array([part.low for part in parts])
    top = np.array([seats[p].base for p in owner_of_part]) + np.array([part.eaves for part in parts])
    ground = np.array([seats[p].base for p in owner_of_part])
    mine = np.array(part_of)[left]
    # High above a low neighbour a wall has windows again; the few that are drawn below its roof are unseen.
    tall = top[right] - ground[mine] > 0.6 * (top[mine] - ground[mine])
    other = (owner[left] != owner_of_part[right]) & (low[right] <= 0.0) & tall
    style[left[other]] = WallSide.BLANK
    style[length < 1.3] = WallSide.BLANK
    for k, part in enumerate(parts):
        if part.finish:
            mine = style[first[k] : first[k + 1]]
            mine[:] = WallSide.BLANK
            finish = styles().finishes[part.finish]
            if finish.picture:
                mine[list(finish.shown) or slice(None)] = WallSide.FRONT
    return WallLines(start, end, style, np.array(first))


def fronts_of(plans: list[BuildingPlan], seats: list[Footing], osm: OsmData) -> list[list[NDArray[np.bool_]]]:
    """Return, of each plan's parts, which edges of the outline are fronts."""
    edges = wall_lines(plans, seats, osm)
    shown = (edges.style == WallSide.FRONT) | (edges.style == WallSide.SHOPFRONT)
    made, k = [], 0
    for plan in plans:
        row = []
        for _ in plan.solids:
            row.append(shown[edges.first[k] : edges.first[k + 1]])
            k += 1
        made.append(row)
    return made


def is_street(way: OsmWay) -> bool:
    """Return whether a way is a street that houses face."""
    return (
        way.tags.get("highway") not in (None, "steps", "corridor", "elevator", "platform", "service", "path")
        and "building" not in way.tags
        and on_the_ground(way.tags)
    )


def lines_of_faces(
    middle: NDArray[np.float64], normal: NDArray[np.float64], owner: NDArray[np.int64], edges: WallLines
) -> NDArray[np.int64]:
    """Return the wall line each upright triangle stands on; -1 for parapets' insides and all that is not upright."""
    result = np.full(len(middle), -1, np.int64)
    upright = np.flatnonzero(np.abs(normal[:, 2]) < 0.15)
    order = upright[np.argsort(owner[upright], kind="stable")]
    bounds = np.searchsorted(owner[order], np.arange(len(edges.first)))
    for part in range(len(edges.first) - 1):
        faces = order[bounds[part] : bounds[part + 1]]
        if not len(faces):
            continue
        a, b = (
            edges.start[edges.first[part] : edges.first[part + 1]],
            edges.end[edges.first[part] : edges.first[part + 1]],
        )
        along = b - a
        length = np.maximum(np.hypot(*along.T), 1e-9)
        along = along / length[:, None]
        outward = np.stack([along[:, 1], -along[:, 0]], axis=1)
        away = middle[faces][:, None, :2] - a[None]
        t = (away * along).sum(-1)
        off = np.abs((away * outward).sum(-1)) + np.maximum(np.maximum(-t, t - length), 0.0)
        off = np.where(apply_matrix(normal[faces][:, :2], outward) > 0.9, off, np.inf)
        best = off.argmin(axis=1)
        good = off[np.arange(len(faces)), best] < 0.06
        result[faces[good]] = edges.first[part] + best[good]
    return result


_HIGH_GROUND = ("retail", "commercial", "office", "civic", "hotel")


@dataclass(frozen=True)
class Storeys:
    """Storeys of a part, heights above the building's base.

    Attributes
    ----------
    bottom, top
        Between which its upper floors lie; the ground floor lies below `bottom`.
    count
        Upper floors, of one height each.
    """

    bottom: float
    top: float
    count: float

    def floor(self, k: int) -> float:
        """Floor of the k-th upper storey."""
        return self.bottom + (self.top - self.bottom) * k / self.count


def storeys_of(plan: BuildingPlan, part: PartPlan, *, hall: bool) -> Storeys:
    """Divide a part's height; a hall has one row of windows from a low base to the eaves."""
    if part.finish:
        return Storeys(part.eaves, part.eaves, float(max(part.levels, 1)))
    if hall:
        ground = min(2.4, 0.25 * part.eaves)
    else:
        ground = 4.0 if plan.use in _HIGH_GROUND or plan.shops > 0 else 3.5
    single = (part.levels <= 1 or part.eaves < 5.6) and not hall
    bottom = part.low if part.low > 0 else part.eaves if single else ground
    count = float(STOREYS) if hall else max(float(round((part.eaves - bottom) / 3.25)), 1.0)
    return Storeys(bottom, part.eaves, count)


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
