"""Rules of buildings: closed, seated in the ground, and apart from one another.

Edges that are not closed, and faces that lie in one another's plane and overlap, are found by pure functions of
triangles, so that the builder and the checker of a finished world ask the same questions.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.geo import overlay
from vico.io.compiled import compiled
from vico.world.glb import read_glb
from vico.world.heights import HeightField
from vico.world.mesh import Surface
from vico.world.model import OPEN_KINDS, Building, WorldFinding
from vico.world.world import World

_PLANE = 0.004  # metres within which two faces count as one plane
_TURN = 0.004  # most difference of their unit normals' components
_SLACK = 0.002  # metres by which faces may reach over one another's border without being looked at


@dataclass(frozen=True)
class CoplanarPairs:
    """Pairs of triangles that lie in one plane and overlap.

    Attributes
    ----------
    first, second
        Indices of the triangles, shape ``(n,)``, `first` below `second`.
    area
        Overlap, square metres, shape ``(n,)``.
    same
        True where both face the same way: these flicker. False where they face each other, as the two sides of a
        party wall do: each hides the other, and neither is seen.
    """

    first: NDArray[np.int64]
    second: NDArray[np.int64]
    area: NDArray[np.float64]
    same: NDArray[np.bool_]

    def where(self, which: NDArray[np.bool_]) -> CoplanarPairs:
        """Return some of the pairs; `which` has shape ``(n,)``."""
        return CoplanarPairs(self.first[which], self.second[which], self.area[which], self.same[which])

    @property
    def flickering(self) -> int:
        """Pairs that are seen to flicker."""
        return int(self.same.sum())

    @property
    def touching(self) -> int:
        """Pairs that face each other, hidden."""
        return int((~self.same).sum())


def coplanar_overlaps(
    corners: NDArray[np.floating],
    *,
    least: float = 0.01,
    among: NDArray[np.bool_] | None = None,
    facing: bool = True,
) -> CoplanarPairs:
    """Find triangles that overlap in one plane.

    Parameters
    ----------
    corners
        Corners of the triangles, metres, shape ``(n, 3, 3)``.
    least
        Overlaps smaller than this many square metres don't count.
    among
        Triangles to look at, shape ``(n,)``; None: all.
    facing
        Whether pairs that face each other are told; without them it is done in half the time, as party walls are most
        of what lies in one plane.

    Returns
    -------
    CoplanarPairs
        Every pair once, in the order of its triangles.

    Notes
    -----
    Triangles are put in bins of plane (normal and offset, each rounded twice, half a bin apart, so that neighbours in
    value share a bin); a bin's triangles are laid flat side by side and met through one search tree.
    """
    points = np.asarray(corners, np.float64)
    normal = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    size = np.linalg.norm(normal, axis=1)
    kept = np.flatnonzero((size > 2.0 * least) & (True if among is None else among))
    none = np.zeros(0, np.int64)
    if len(kept) < 2:
        return CoplanarPairs(none, none, np.zeros(0), np.zeros(0, bool))
    points, normal = points[kept], normal[kept] / size[kept, None]
    # One plane, one sign: the largest component of the normal is made positive (near ties: by a fixed skew).
    skew = normal @ np.array([1.0, 1.3171, 1.7331])
    sign = np.where(skew < 0, -1.0, 1.0)
    plane = normal * sign[:, None]
    offset = np.einsum("ni,ni->n", plane, points.mean(axis=1))
    pairs: list[NDArray[np.int64]] = []
    for turn in (0.0, 0.5):
        for shift in (0.0, 0.5):
            steps = [np.floor(plane[:, k] / (4 * _TURN) + turn) for k in range(3)]
            steps.append(np.floor(offset / (4 * _PLANE) + shift))
            bin_, count = _bin_rows([*steps, np.zeros(len(kept)) if facing else sign])
            pairs.append(_overlapping_pairs(points, plane, bin_, count))
    met = np.unique(np.concatenate(pairs))
    first, second = met // len(kept), met % len(kept)
    away = np.abs(np.einsum("nki,ni->nk", points[second], plane[first]) - offset[first, None]).max(axis=1)
    close = (away < _PLANE) & (np.abs(plane[first] - plane[second]).max(axis=1) < _TURN)
    first, second = first[close], second[close]
    # The area that two triangles of a plane share; 0 where it is certainly not more than `least`.
    across, up = _axes(plane[first])
    one, two = (
        np.stack([np.einsum("nki,ni->nk", points[which], across), np.einsum("nki,ni->nk", points[which], up)], axis=-1)
        for which in (first, second)
    )
    area = np.zeros(len(first))
    near = np.flatnonzero((_most_common(one, two) > least) & (_most_common(two, one) > least))
    shapes = (shapely.polygons(flat[near]) for flat in (one, two))
    area[near] = np.asarray(overlay.common_area(*shapes), np.float64)
    real = area > least
    first, second, area = first[real], second[real], area[real]
    return CoplanarPairs(kept[first], kept[second], area, sign[first] == sign[second])


def _bin_rows(values: list[NDArray[np.float64]]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Give rows of whole numbers a number each, equal rows the same; and count how many have each."""
    key = np.zeros(len(values[0]), np.int64)
    for value in values:
        whole = value.astype(np.int64) - int(value.min())
        key = key * (int(whole.max()) + 1) + whole
    _, bin_, count = np.unique(key, return_inverse=True, return_counts=True)
    return bin_.ravel(), count


def _axes(plane: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Two unit directions in each plane, shape ``(n, 3)`` each."""
    level = np.stack([-plane[:, 1], plane[:, 0], np.zeros(len(plane))], axis=1)
    length = np.linalg.norm(level, axis=1, keepdims=True)
    across = np.where(length > 0.05, level / np.maximum(length, 1e-9), (1.0, 0.0, 0.0))
    up = np.cross(plane, across)
    return across, up / np.linalg.norm(up, axis=1, keepdims=True)


def _overlapping_pairs(
    points: NDArray[np.float64], plane: NDArray[np.float64], bin_: NDArray[np.int64], count: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Pairs of a bin whose flat boxes overlap, shape ``(m,)``: the first's index times ``n`` and the second's."""
    members = np.flatnonzero(count[bin_] > 1)
    if not len(members):
        return np.zeros(0, np.int64)
    # Level and steep planes are each laid flat along fixed world axes, the same for all of a bin.
    bins, leader = np.unique(bin_[members], return_index=True)
    of = np.searchsorted(bins, bin_[members])
    across, up = (axis[of] for axis in _axes(plane[members[leader]]))
    u = np.einsum("nki,ni->nk", points[members], across)
    v = np.einsum("nki,ni->nk", points[members], up)
    # What is thinner than the slack keeps its place.
    boxes = np.concatenate([np.sort([at.min(axis=1) + _SLACK, at.max(axis=1) - _SLACK], axis=0) for at in (u, v)])
    order = np.lexsort((boxes[0], of))
    a, b = _overlapping_boxes(of[order], boxes[:, order])
    a, b = members[order[a]], members[order[b]]
    return np.asarray(np.minimum(a, b) * len(points) + np.maximum(a, b), np.int64)


@compiled
def _overlapping_boxes(
    bin_: NDArray[np.int64], boxes: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of boxes of one bin that overlap; boxes are sorted by bin and then by their first row, u from.

    The rows are u from, u to, v from, v to; shape ``(4, n)``.
    """
    count = 0
    first = np.empty(4 * len(bin_), np.int64)
    second = np.empty(4 * len(bin_), np.int64)
    for i in range(len(bin_)):
        j = i + 1
        while j < len(bin_) and bin_[j] == bin_[i] and boxes[0, j] <= boxes[1, i]:
            if boxes[0, i] <= boxes[1, j] and boxes[2, i] <= boxes[3, j] and boxes[2, j] <= boxes[3, i]:
                if count == len(first):
                    first = np.concatenate((first, np.empty(count, np.int64)))
                    second = np.concatenate((second, np.empty(count, np.int64)))
                first[count], second[count] = i, j
                count += 1
            j += 1
    return first[:count], second[:count]


def _most_common(one: NDArray[np.float64], two: NDArray[np.float64]) -> NDArray[np.float64]:
    """Bound the area that pairs of triangles share, by how far the second reaches over each edge of the first.

    What they share lies in a strip along the edge, as deep as that and no longer than the second is wide.
    """
    side = np.roll(one, -1, axis=1) - one
    side /= np.maximum(np.linalg.norm(side, axis=2, keepdims=True), 1e-12)
    turn = side[:, 0, 0] * side[:, 1, 1] - side[:, 0, 1] * side[:, 1, 0]
    inward = np.stack([-side[..., 1], side[..., 0]], axis=-1) * np.where(turn < 0, -1.0, 1.0)[:, None, None]
    depth = np.einsum("neci,nei->nec", two[:, None] - one[:, :, None], inward).max(axis=2).min(axis=1)
    wide = np.linalg.norm(np.ptp(two, axis=1), axis=1)
    return np.asarray(np.maximum(depth, 0.0) * wide, np.float64)


def open_edges(faces: NDArray[np.integer]) -> NDArray[np.bool_]:
    """Triangles with an edge that has not exactly one counterpart, shape ``(n,)``.

    Parameters
    ----------
    faces
        Vertex indices, shape ``(n, 3)``; solids don't share vertices, and a solid's equal corners are one vertex.

    Returns
    -------
    ndarray of bool
        All False for closed solids of one orientation.
    """
    triangles = np.asarray(faces, np.int64)
    if not len(triangles):
        return np.zeros(0, bool)
    start, end = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    size = np.int64(triangles.max()) + 1
    forward, backward = start * size + end, end * size + start
    one, other = np.sort(forward), np.sort(backward)
    if np.array_equal(one, other) and (np.diff(one) > 0).all():
        return np.zeros(len(triangles), bool)
    _, index, counts = np.unique(forward, return_inverse=True, return_counts=True)
    bad = ~np.isin(forward, other) | (counts[index.ravel()] > 1)
    return np.asarray(bad.reshape(-1, 3).any(axis=1))


_SEATED = 0.5  # metres a ground floor may lie above the highest ground at its walls
_FLICKER = 0.05  # square metres of two triangles in one plane that count
_SEEN = 0.5  # square metres of two buildings in one plane that an eye would see


def outline_of(building: Building) -> shapely.Polygon:
    """Return the footprint of a building, metres."""
    return shapely.Polygon(building.footprint[0], building.footprint[1:])


def check_buildings_closed(world: World) -> Iterator[WorldFinding]:
    """Check that walls and roof of each building close (each edge once in each direction) around a positive volume."""
    walls = world.surfaces("buildings") if world.path is None else read_glb(world.file("meshes/buildings.glb"))["walls"]
    surfaces = [*walls, *world.surfaces("roofs")]
    open_edges, volume = closedness(surfaces)
    for building in world.buildings:
        if building.entity not in volume:
            yield WorldFinding("building without mesh", building.id, "no triangle has its entity")
        elif open_edges.get(building.entity):
            yield WorldFinding(
                "building leaks", building.id, f"{open_edges[building.entity]} edges have no counterpart"
            )
        elif volume[building.entity] <= 0.0:
            yield WorldFinding("building inside out", building.id, f"its volume is {volume[building.entity]:.1f} m3")


def closedness(surfaces: list[Surface]) -> tuple[dict[int, int], dict[int, float]]:
    """Return open edges and volume (m3) by entity; corners are one where they are equal in the file."""
    if not surfaces:
        return {}, {}
    corners = np.concatenate([s.positions[s.triangles] for s in surfaces])
    entity = np.concatenate([s.entity[s.triangles[:, 0]] for s in surfaces])
    return open_edges_of(corners, entity), volumes_of(corners, entity)


def open_edges_of(corners: NDArray[np.float32], owner: NDArray[np.integer]) -> dict[int, int]:
    """Count edges that are not there once in each direction.

    Parameters
    ----------
    corners
        Corners of triangles, metres, shape ``(n, 3, 3)``; equal ones are one.
    owner
        Whose each triangle is, a small number, shape ``(n,)``.

    Returns
    -------
    dict
        Open edges by owner, where there are any.
    """
    flat = np.ascontiguousarray(corners.reshape(-1, 3) + np.float32(0.0))
    _, index = np.unique(flat.view(np.dtype((np.void, 12))).ravel(), return_inverse=True)
    index = index.reshape(-1, 3).astype(np.int64)
    count = int(index.max()) + 1 if len(index) else 0
    starts, ends = index.ravel(), np.roll(index, -1, axis=1).ravel()
    whose = np.repeat(owner, 3).astype(np.int64)
    real = starts != ends
    starts, ends, whose = starts[real], ends[real], whose[real]
    # Each edge counts +1 in one direction and -1 in the other: what does not cancel is open.
    forward = starts < ends
    key = (whose * count + np.where(forward, starts, ends)) * count + np.where(forward, ends, starts)
    unique, inverse = np.unique(key, return_inverse=True)
    balance = np.bincount(inverse, weights=np.where(forward, 1.0, -1.0))
    open_edges: dict[int, int] = {}
    for number in (unique[balance != 0] // count // count).tolist():
        open_edges[number] = open_edges.get(number, 0) + 1
    return open_edges


def volumes_of(corners: NDArray[np.floating], owner: NDArray[np.integer]) -> dict[int, float]:
    """Return the volumes that triangles of one owner each enclose, m3; see `open_edges_of`."""
    points = corners.astype(np.float64)
    numbers, where = np.unique(owner, return_inverse=True)
    # Volumes about a corner of each body: coordinates far from the origin would drown them in rounding.
    reference = np.zeros((len(numbers), 3))
    reference[where] = points[:, 0]
    points = points - reference[where][:, None, :]
    signed = np.einsum("ni,ni->n", points[:, 0], np.cross(points[:, 1], points[:, 2])) / 6.0
    volume = np.bincount(where, weights=signed, minlength=len(numbers))
    return dict(zip(numbers.tolist(), volume.tolist(), strict=True))


def check_buildings_seated(world: World) -> Iterator[WorldFinding]:
    """Check that walls reach the ground (unless the whole building hangs), and ground floors lie at its level."""
    lowest: dict[int, float] = {}
    for body in world.surfaces("collision"):
        number = int(body.entity[0])
        lowest[number] = min(lowest.get(number, math.inf), float(body.positions[:, 2].min()))
    for building in world.buildings:
        yield from seating_findings(building, lowest.get(building.entity, math.inf), world.height)


def seating_findings(building: Building, low: float, height: HeightField) -> Iterator[WorldFinding]:
    """Find what is wrong with how a building stands.

    Parameters
    ----------
    building
        Its record.
    low
        Where its lowest wall begins, metres; infinite where it has none.
    height
        The ground.
    """
    ground = height(np.array(building.footprint[0]))
    canopy = building.tags.get("building") in OPEN_KINDS
    if ground.min() + 0.05 < low < ground.min() + 2.2 and not canopy:
        yield WorldFinding(
            "building floats", building.id, f"its walls begin at {low:.2f} m, the ground at {ground.min():.2f} m"
        )
    if not building.base <= ground.max() + _SEATED:
        yield WorldFinding(
            "building not seated",
            building.id,
            f"its ground floor is at {building.base:.2f} m, the ground at its walls at most {ground.max():.2f} m",
        )
    if building.height <= 0:
        yield WorldFinding("building flat", building.id, f"its height is {building.height} m")
    if not outline_of(building).is_valid:
        yield WorldFinding("building outline", building.id, "its footprint crosses itself")


def check_buildings_apart(world: World) -> Iterator[WorldFinding]:
    """Check that no two drawn faces overlap in one plane and face the same way: they would flicker."""
    surfaces = [*world.surfaces("buildings"), *world.surfaces("roofs")]
    if not surfaces:
        return
    numbers = {building.entity: building.id for building in world.buildings}
    corners = np.concatenate([s.positions[s.triangles] for s in surfaces])
    entity = np.concatenate([s.entity[s.triangles[:, 0]] for s in surfaces])
    for (one, other), pairs in overlapping_faces(corners, entity, among=np.isin(entity, list(numbers))).items():
        whom = "itself" if one == other else numbers[other]
        area = sum(pairs.area.tolist())
        yield WorldFinding(
            "building faces overlap", numbers[one], f"{area:.2f} m2 lie in one plane with faces of {whom}"
        )


def overlapping_faces(
    corners: NDArray[np.floating], owner: NDArray[np.integer], *, among: NDArray[np.bool_] | None = None
) -> dict[tuple[int, int], CoplanarPairs]:
    """Find whose faces overlap in one plane, facing the same way, so much that it is seen.

    Parameters
    ----------
    corners
        Corners of triangles, metres, shape ``(n, 3, 3)``.
    owner
        Whose each triangle is, shape ``(n,)``.
    among
        Triangles to look at, shape ``(n,)``; None: all.

    Returns
    -------
    dict
        Pairs of triangles by their two owners, the smaller first and the same twice where it is one.
    """
    pairs = coplanar_overlaps(corners, least=_FLICKER, among=among, facing=False)
    one, other = owner[pairs.first], owner[pairs.second]
    whose = np.stack([np.minimum(one, other), np.maximum(one, other)], axis=1)
    keys, index = np.unique(whose, axis=0, return_inverse=True)
    seen = np.bincount(index.ravel(), weights=pairs.area, minlength=len(keys)) >= _SEEN
    return {(int(keys[k, 0]), int(keys[k, 1])): pairs.where(index.ravel() == k) for k in np.flatnonzero(seen).tolist()}
