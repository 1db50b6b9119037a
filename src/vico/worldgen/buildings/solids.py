"""Solids of planned buildings: seated on the ground, meshed, and as convex bodies to collide with.

A `Draft` is a building while it is being built: its plan on its seat, with its solids; `record_of` is what comes of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import mapbox_earcut
import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from vico.geo import overlay
from vico.geo.overlay import OverlayError, polygons_of
from vico.world.check.buildings import open_edges
from vico.world.heights import HeightField
from vico.world.mesh import Material, Surface
from vico.world.model import Building, BuildingSources, Dropped
from vico.worldgen.buildings.roofs import building_solid
from vico.worldgen.facades.facade_styles import FacadeStyle
from vico.worldgen.facts.building_plans import BuildingPlan, PartPlan
from vico.worldgen.facts.fault_isolation import drop_on_failure
from vico.worldgen.facts.roofs import rings_of, shape_named

_SKIRT = 0.3  # metres the walls reach below the lowest ground, so that no gap shows
_BESIDE = 0.5  # metres by which a part may reach over its building's outline and count as within


@dataclass(frozen=True)
class Footing:
    """Where a building stands: `bottom` of its walls and `base` (ground floor), metres."""

    bottom: float
    base: float


def seat_of(plan: BuildingPlan, terrain: HeightField) -> Footing:
    """Seat a building: walls down to the lowest ground under it, ground floor a little above that on a slope."""
    lowest, highest = _ground_along(plan.outline, terrain)
    base = lowest + min(0.4 * (highest - lowest), 1.5)
    for part in plan.parts:  # one that stands beside the outline it belongs to may stand lower
        corners = shapely.points(np.asarray(part.polygon.exterior.coords)[:, :2])
        if shapely.distance(plan.outline, corners).max() > _BESIDE:
            lowest = min(lowest, _ground_along(part.polygon, terrain)[0])
    return Footing(lowest - _SKIRT, base)


def _ground_along(polygon: Polygon, terrain: HeightField) -> tuple[float, float]:
    """Return the lowest and the highest ground along an outline, metres."""
    ground = terrain(np.asarray(shapely.segmentize(polygon.exterior, 3.0).coords)[:, :2])
    return float(ground.min()), float(ground.max())


def heights_of(part: PartPlan, seat: Footing) -> tuple[float, float]:
    """Underside and eaves of a part above sea level."""
    return (seat.bottom if part.low <= 0 else seat.base + part.low), seat.base + part.eaves


Mesh = tuple[NDArray[np.float64], NDArray[np.int64]]
"""Points, ENU metres, shape ``(n, 3)``, and faces, shape ``(m, 3)``, of one closed solid."""


@dataclass
class SolidMesh:
    """All solids together; `part` and `plan` say whose a face is, `parts` whose part is of which plan."""

    points: NDArray[np.float64]
    faces: NDArray[np.int64]
    part: NDArray[np.int64]
    plan_of_part: NDArray[np.int64]
    broken: list[int] = field(default_factory=list)


def part_mesh(part: PartPlan, seat: Footing) -> Mesh:
    """Return the solid of a part on its seat; without faces where nothing comes of it."""
    if part.mesh is not None:
        return part.mesh[0] + (0.0, 0.0, seat.base), part.mesh[1]
    low, eaves = heights_of(part, seat)
    # Solids are made near the origin and near height 0: the kernel's tolerance grows with coordinates.
    x, y = (round(v) for v in part.polygon.centroid.coords[0])

    def near_origin(xy: NDArray[np.float64]) -> NDArray[np.float64]:
        return xy - np.array([x, y])

    local, roof = shapely.transform(part.polygon, near_origin), part.roof.transform(near_origin)
    solid = building_solid(local, low - eaves, 0.0, roof).simplify(0.002)
    body = solid.to_mesh64()
    vertices = np.asarray(body.vert_properties, np.float64)[:, :3]
    triangles = np.asarray(body.tri_verts, np.int64)
    if solid.volume() <= 0:
        triangles = triangles[:0]
    return vertices + np.array([x, y, eaves]), triangles


def solid_meshes(plans: Sequence[BuildingPlan], seats: Sequence[Footing]) -> SolidMesh:
    """Mesh every solid of every plan, on its seat; one that can't be made has no faces."""
    meshes: list[list[Mesh]] = []
    for plan, seat in zip(plans, seats, strict=True):
        meshes.append([])
        for solid in plan.solids:
            mesh = np.zeros((0, 3)), np.zeros((0, 3), np.int64)
            with drop_on_failure(plan.id, []):  # the stage that builds it reports the failure
                mesh = part_mesh(solid, seat)
            meshes[-1].append(mesh)
    return merge_solids(meshes)


def merge_solids(meshes: Sequence[Sequence[Mesh]]) -> SolidMesh:
    """Put the solids of buildings into one mesh.

    Parameters
    ----------
    meshes
        The solids of each building.
    """
    points: list[NDArray[np.float64]] = []
    faces: list[NDArray[np.int64]] = []
    owner: list[NDArray[np.int64]] = []
    plan_of_part: list[int] = []
    broken: list[int] = []
    count = 0
    for p, solids in enumerate(meshes):
        for vertices, triangles in solids:
            if not len(triangles):
                broken.append(p)
            points.append(vertices)
            faces.append(triangles + count)
            owner.append(np.full(len(triangles), len(plan_of_part), np.int64))
            count += len(vertices)
            plan_of_part.append(p)
    if not points:
        return SolidMesh(np.zeros((0, 3)), np.zeros((0, 3), np.int64), np.zeros(0, np.int64), np.zeros(0, np.int64))
    return SolidMesh(
        np.concatenate(points), np.concatenate(faces), np.concatenate(owner), np.array(plan_of_part), broken
    )


def leaky_plans(mesh: SolidMesh) -> set[int]:
    """Plans with a solid that is empty, inside out, or has an edge without its exact counterpart."""
    return set(mesh.broken) | set(mesh.plan_of_part[mesh.part[open_edges(mesh.faces)]].tolist())


def collision_bodies(part: PartPlan, seat: Footing) -> list[Surface]:
    """Convex prisms that fill a part's walls, up to half the height of a pitched roof; of entity 0."""
    low, eaves = heights_of(part, seat)
    top = eaves + (part.roof.height if part.roof.shape == "flat" else 0.5 * part.roof.height)
    bodies: list[Surface] = []
    for shape in polygons_of(overlay.simplify(part.polygon, 0.25), 0.5):
        for ring in convex_pieces(shape):
            n = len(ring)
            points = np.concatenate([np.c_[ring, np.full(n, low)], np.c_[ring, np.full(n, top)]])
            i = np.arange(n)
            j = (i + 1) % n
            fan = np.arange(1, n - 1)
            triangles = np.concatenate(
                [
                    np.stack([i, j, n + j], axis=1),
                    np.stack([i, n + j, n + i], axis=1),
                    np.stack([np.zeros_like(fan), fan + 1, fan], axis=1),
                    np.stack([np.full_like(fan, n), n + fan, n + fan + 1], axis=1),
                ]
            )
            out = points - points.mean(axis=0)
            normals = out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-9)
            bodies.append(Surface.from_triangles(points, triangles, normals=normals, material=Material("collision")))
    return bodies


def convex_pieces(polygon: Polygon) -> list[NDArray[np.float64]]:
    """Divide a polygon into convex ones: ears, then merged across every diagonal that is not needed.

    Returns
    -------
    list of ndarray
        Counter-clockwise rings, not closed, shape ``(n, 2)``.

    Notes
    -----
    Hertel and Mehlhorn (1983): at most four times the least number of pieces.
    """
    rings = rings_of(polygon)
    points = np.concatenate(rings)
    ends = np.cumsum([len(ring) for ring in rings]).astype(np.uint32)
    triangles = mapbox_earcut.triangulate_float64(points, ends).reshape(-1, 3).astype(int)
    pieces: dict[int, list[int]] = {}
    side: dict[tuple[int, int], int] = {}
    for k, (a, b, c) in enumerate(triangles.tolist()):
        (ux, uy), (vx, vy) = points[b] - points[a], points[c] - points[a]
        area = float(ux * vy - uy * vx)
        if abs(area) < 1e-9:
            continue
        pieces[k] = [a, b, c] if area > 0 else [a, c, b]
        for i in range(3):
            side[pieces[k][i], pieces[k][(i + 1) % 3]] = k
    for a, b in sorted(side):
        first, second = side.get((a, b)), side.get((b, a))
        if first is None or second is None or first == second:
            continue
        one, two = pieces[first], pieces[second]
        i, j = one.index(a), two.index(b)
        ring = one[i + 1 :] + one[: i + 1]
        # Walk the first from b round to a, then the second's corners between a and b.
        rest = two[j:] + two[:j]
        merged = ring + [v for v in rest if v not in (a, b)]
        if not _is_convex(points[merged]):
            continue
        pieces[first] = merged
        del pieces[second]
        for u, v in [key for key, of in side.items() if of == second]:
            side[u, v] = first
    return [points[ring] for ring in pieces.values()]


def _is_convex(ring: NDArray[np.float64]) -> bool:
    before, after = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
    return bool((before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0] > -1e-9).all())


_STANDING = 2.5  # metres above the ground floor from which on a part is no footprint
_KEPT_TAGS = (
    "building",
    "building:levels",
    "height",
    "roof:shape",
    "addr:street",
    "addr:housenumber",
    "amenity",
    "shop",
    "office",
    "tourism",
    "start_date",
    "wikidata",
)


@dataclass(frozen=True)
class Draft:
    """A building as far as it is built.

    Attributes
    ----------
    plan
        What was decided.
    seat
        Where it stands.
    look
        What it wears.
    footprint
        Its outline at the ground.
    meshes
        One a solid of the plan, in their order; ENU metres.
    bodies
        Convex prisms to collide with; their entity is given later.
    """

    plan: BuildingPlan
    seat: Footing
    look: FacadeStyle
    footprint: Polygon
    meshes: list[Mesh]
    bodies: list[Surface]


def draft_building(plan: BuildingPlan, look: FacadeStyle, terrain: HeightField) -> Draft:
    """Seat a plan and make the solids of its parts.

    Raises
    ------
    OverlayError
        If its outline can't be cut, or nothing is left of it.
    """
    seat = seat_of(plan, terrain)
    meshes = [part_mesh(part, seat) for part in plan.parts]
    bodies = [body for part in plan.parts for body in collision_bodies(part, seat)]
    # A millimetre grid, so that the written outline is the valid one and not its rounding.
    merged = overlay.on_grid(overlay.union_all([part.polygon for part in standing_parts(plan)]), grid=0.001)
    pieces = polygons_of(merged)
    if not pieces:
        raise OverlayError("nothing is left of its outline; draw it anew")
    return Draft(plan, seat, look, max(pieces, key=lambda shape: shape.area), meshes, bodies)


def with_rooftop(draft: Draft, rooftop: Sequence[PartPlan], dropped: list[Dropped]) -> Draft:
    """Add small solids to a building; one that can't be made is left out, with its reason."""
    kept, meshes, posts = [], [], []
    for solid in rooftop:
        with drop_on_failure(f"{draft.plan.id} {solid.finish}", dropped):
            mesh = part_mesh(solid, draft.seat)
            body = collision_bodies(solid, draft.seat) if solid.finish == "post" else []
            kept.append(solid)
            meshes.append(mesh)
            posts += body
    plan = replace(draft.plan, rooftop=kept)
    return replace(draft, plan=plan, meshes=[*draft.meshes, *meshes], bodies=[*draft.bodies, *posts])


def standing_parts(plan: BuildingPlan) -> list[PartPlan]:
    """Return the parts of a building that make its footprint: those at the ground, or all where there are none."""
    return [part for part in plan.parts if part.low < _STANDING] or plan.parts


def record_of(draft: Draft, entity: int) -> Building:
    """Return the record of a building."""
    plan, seat = draft.plan, draft.seat
    rings = [[(round(float(x), 3), round(float(y), 3)) for x, y in ring] for ring in rings_of(draft.footprint)]
    highest = max(plan.parts, key=lambda part: part.top)
    return Building(
        id=plan.id,
        entity=entity,
        name=plan.name,
        use=plan.use,
        footprint=rings,
        base=round(seat.base, 3),
        height=round(highest.top, 3),
        levels=max(plan.levels, 1),
        roof_shape=highest.roof.shape,
        colour="#{:02x}{:02x}{:02x}".format(*draft.look.tint),
        accessible=False,
        tags={key: plan.tags[key] for key in _KEPT_TAGS if key in plan.tags},
        sources=_sources_of(plan, highest),
    )


_RULES = {"height tag": "osm height tag", "levels tag": "osm levels tag", "parts": "osm parts"}


def _sources_of(plan: BuildingPlan, highest: PartPlan) -> BuildingSources | None:
    """Return where a building's facts are from; None where only the map was asked."""
    origin = plan.origin
    if origin is None:
        return None
    tagged = shape_named(highest.tags.get("roof:shape")) is not None
    return BuildingSources(
        footprint=origin.footprint,
        height=origin.height or _RULES.get(plan.rule, f"rule: {plan.rule}"),
        roof=origin.roof or ("osm roof:shape tag" if tagged else "rule: use, size and region"),
    )


def bodies_of(draft: Draft, entity: int) -> list[Surface]:
    """Give what a building collides with its entity, and return it."""
    for body in draft.bodies:
        body.entity[:] = entity
    return draft.bodies
