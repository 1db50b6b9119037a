"""Rules of buildings: closed, seated in the ground, and apart from one another."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import shapely

from vico.world.check.finding import WorldFinding
from vico.world.check.solids import coplanar_overlaps
from vico.world.folder import World
from vico.world.mesh import Surface, read_glb
from vico.world.model import Building

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
    flat = np.ascontiguousarray(corners.reshape(-1, 3) + np.float32(0.0))
    _, index = np.unique(flat.view(np.dtype((np.void, 12))).ravel(), return_inverse=True)
    index = index.reshape(-1, 3).astype(np.int64)
    count = int(index.max()) + 1 if len(index) else 0
    starts, ends = index.ravel(), np.roll(index, -1, axis=1).ravel()
    owner = np.repeat(entity, 3).astype(np.int64)
    real = starts != ends
    starts, ends, owner = starts[real], ends[real], owner[real]
    # Each edge counts +1 in one direction and -1 in the other: what does not cancel is open.
    forward = starts < ends
    key = (owner * count + np.where(forward, starts, ends)) * count + np.where(forward, ends, starts)
    unique, inverse = np.unique(key, return_inverse=True)
    balance = np.bincount(inverse, weights=np.where(forward, 1.0, -1.0))
    open_edges: dict[int, int] = {}
    for number in (unique[balance != 0] // count // count).tolist():
        open_edges[number] = open_edges.get(number, 0) + 1
    points = corners.astype(np.float64)
    numbers, where = np.unique(entity, return_inverse=True)
    # Volumes about a corner of each body: coordinates far from the origin would drown them in rounding.
    reference = np.zeros((len(numbers), 3))
    reference[where] = points[:, 0]
    points = points - reference[where][:, None, :]
    signed = np.einsum("ni,ni->n", points[:, 0], np.cross(points[:, 1], points[:, 2])) / 6.0
    volume = np.bincount(where, weights=signed, minlength=len(numbers))
    return open_edges, dict(zip(numbers.tolist(), volume.tolist(), strict=True))


def check_buildings_seated(world: World) -> Iterator[WorldFinding]:
    """Check that walls reach the ground (unless the whole building hangs), and ground floors lie at its level."""
    lowest: dict[int, float] = {}
    for body in world.surfaces("collision"):
        number = int(body.entity[0])
        lowest[number] = min(lowest.get(number, math.inf), float(body.positions[:, 2].min()))
    for building in world.buildings:
        ground = world.height(np.array(building.footprint[0]))
        low = lowest.get(building.entity, math.inf)
        canopy = building.tags.get("building") == "roof"  # open below, however low it is
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
    pairs = coplanar_overlaps(corners, least=_FLICKER, among=np.isin(entity, list(numbers)))
    areas: dict[tuple[int, int], float] = {}
    for a, b, area in zip(pairs.first[pairs.same], pairs.second[pairs.same], pairs.area[pairs.same], strict=True):
        key = (min(int(entity[a]), int(entity[b])), max(int(entity[a]), int(entity[b])))
        areas[key] = areas.get(key, 0.0) + float(area)
    for (one, other), area in sorted(areas.items()):
        if area < _SEEN:
            continue
        whom = "itself" if one == other else numbers[other]
        yield WorldFinding(
            "building faces overlap", numbers[one], f"{area:.2f} m2 lie in one plane with faces of {whom}"
        )
