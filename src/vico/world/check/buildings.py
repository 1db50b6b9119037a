"""Rules of buildings: closed, seated in the ground, and apart from one another."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.world.check.finding import WorldFinding
from vico.world.check.solids import CoplanarPairs, coplanar_overlaps
from vico.world.glb import read_glb
from vico.world.heights import HeightField
from vico.world.mesh import Surface
from vico.world.model import OPEN_KINDS, Building
from vico.world.world import World

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
        yield from unseated(building, lowest.get(building.entity, math.inf), world.height)


def unseated(building: Building, low: float, height: HeightField) -> Iterator[WorldFinding]:
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
    return {(int(keys[k, 0]), int(keys[k, 1])): pairs.chosen(index.ravel() == k) for k in np.flatnonzero(seen).tolist()}
