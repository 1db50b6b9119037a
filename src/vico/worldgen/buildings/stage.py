"""Buildings as closed solids on the terrain, with their records and collision bodies; then what covers them.

Roofs that nobody mapped take the shape that houses of their family and region have. `details_of` decides everything
small that is built on plans: eaves, dormers, chimneys, cornices, balconies, fire escapes and the like.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.osm import OsmData
from vico.geo.quantities import quantity
from vico.seeds import rng
from vico.world.heights import HeightField
from vico.world.mesh import Surface
from vico.world.model import FIRST_BUILDING, Building, Dropped
from vico.worldgen.buildings.cladding import textured_surfaces
from vico.worldgen.buildings.details import cornices, posts, projections, rooftop_parts, water_tank
from vico.worldgen.buildings.repair import repair_buildings
from vico.worldgen.buildings.roof_details import dormers, eaves, edges_of, stepped_gables
from vico.worldgen.buildings.solids import (
    Draft,
    Footing,
    SolidMesh,
    bodies_of,
    draft_building,
    leaky_plans,
    record_of,
    with_rooftop,
)
from vico.worldgen.buildings.walls import fronts_of, is_street, wall_lines
from vico.worldgen.facades import facade_styles
from vico.worldgen.facades.facade_styles import FacadeStyle, draw_by_share, region_of, styles
from vico.worldgen.facts.building_plans import RULES, BuildingPlan, BuildingPlans, PartPlan
from vico.worldgen.facts.fault_isolation import drop_on_failure
from vico.worldgen.facts.roofs import Roof, inradius, shape_named

_SUPPOSED = ("gabled", "hipped", "half-hipped", "mansard")
_STREETS = 3  # storeys from which on a house belongs to a street, and its region's roofs
_WIDEST = 1.3  # of its depth, the width of a house up to which it turns its gable to the street
_DEEPEST = 18.0  # metres of a house whose ridge is turned along the street
_REACH = 25.0  # metres within which a street counts
_SHORTEST = 2.5  # metres of a side that may be a house's front
_PITCHED = range(2, 8)  # storeys of houses that have pitched roofs in a town of them
_SLOPE = 0.62  # metres a metre: of roofs without a height
_PARAPET = 0.6  # metres
_GARRET = 3.4  # metres: a mansard without a height is a storey high


def with_customary_roofs(
    plan: BuildingPlan,
    wall: str,
    streets: shapely.STRtree,
    *,
    region: str,
    flat_town: bool = False,
    random: np.random.Generator,
) -> BuildingPlan:
    """Return a building whose supposed roofs have the shape of its family's, else of its region's.

    Parameters
    ----------
    plan
        The building. Roofs that are mapped or measured stay as they are.
    wall
        Its family of facades.
    streets
        Centre lines of streets: a ridge goes by the side of the house that lies nearest to one.
    region
        As `facades.facade_styles.region_of` says.
    flat_town
        Whether houses have flat roofs here (`is_flat_town`): then those that were supposed stay flat.
    random
        The building's own stream.

    Notes
    -----
    A stated height stays; else walls keep their height, and the roof is as high as its shape is.
    """
    draw = float(random.random())
    family = styles().families[wall]
    shapes = family.roofs or (styles().region(region).pitched if plan.levels >= _STREETS else {})
    if not shapes or (plan.origin is not None and plan.origin.roof):
        return plan
    shape = draw_by_share(list(shapes.items()), draw)
    told = plan.rule == "height tag"
    # What is flat among several parts may carry another.
    flat_too = not flat_town and len(plan.parts) == 1 and shape != "flat"
    parts = [
        _with_roof(part, shape, _street_side(part, streets) if family.ridge else None, family.ridge, told=told)
        if _is_roof_supposed(part, flat_too=flat_too)
        else part
        for part in plan.parts
    ]
    return replace(plan, parts=parts)


def is_flat_town(plans: Sequence[BuildingPlan]) -> bool:
    """Return whether most houses of several storeys have flat roofs, as mapped or supposed."""
    shapes = [part.roof.shape for plan in plans for part in plan.parts[:1] if plan.levels >= _STREETS]
    return 2 * shapes.count("flat") > len(shapes)


def _is_roof_supposed(part: PartPlan, *, flat_too: bool) -> bool:
    """Return whether nobody said what roof a part has; a flat one among pitched ones only where it has the room."""
    tags = part.tags
    said = shape_named(tags.get("roof:shape")) or quantity(tags, "roof:height")
    if said or quantity(tags, "roof:levels") is not None or part.roof.facets or part.levels < 1:
        return False
    if part.roof.shape != "flat":
        return part.roof.shape in _SUPPOSED
    return flat_too and part.levels in _PITCHED and part.low <= 0.0 and 1.5 < inradius(part.polygon) < _DEEPEST / 2


def _with_roof(part: PartPlan, shape: str, street: NDArray[np.float64] | None, ridge: str, *, told: bool) -> PartPlan:
    if shape == "flat":
        # A stated height is that of the walls; else only the roof goes.
        return replace(part, eaves=part.top if told else part.eaves, roof=Roof("flat", _PARAPET))
    direction, height = part.roof.direction, part.roof.height
    if part.roof.shape == "flat":
        deep = inradius(part.polygon)
        height = min(_SLOPE * deep, 5.5)
        if told:  # the stated height is that of the ridge
            height = min(height, 0.4 * part.eaves)
            part = replace(part, eaves=part.eaves - height)
    if street is not None and shape == "gabled":
        yaw, wide = math.atan2(float(street[1]), float(street[0])), float(np.hypot(*street))
        deep = part.polygon.area / wide
        if ridge == "across" and wide < _WIDEST * deep:
            direction = yaw + math.pi / 2
            height = height if told else min(max(height, 0.57 * wide), 7.0)
        elif ridge == "along" and deep < _DEEPEST:
            direction = yaw
            height = height if told else min(max(0.32 * deep, 1.2), 5.5)
    if not told and shape == "mansard":
        height = min(_GARRET, 1.2 * inradius(part.polygon))
    return replace(part, roof=Roof(shape, height, direction))


def _street_side(part: PartPlan, streets: shapely.STRtree) -> NDArray[np.float64] | None:
    """Return the edge that lies nearest to a street as a vector, metres; None where none is near."""
    edges = edges_of(part.polygon)
    middle = edges.start + (edges.length / 2)[:, None] * edges.along + edges.out
    found, distance = streets.query_nearest(
        shapely.points(middle), max_distance=_REACH, return_distance=True, all_matches=False
    )
    near = np.full(len(middle), np.inf)
    near[found[0]] = distance
    near[edges.length < _SHORTEST] = np.inf
    k = int(near.argmin())
    return edges.along[k] * edges.length[k] if np.isfinite(near[k]) else None


_LANE = 3.2  # metres from a street's centre line over which nothing hangs


def details_of(
    drafts: Sequence[Draft],
    fronts: Sequence[list[NDArray[np.bool_]]],
    streets: shapely.STRtree,
    dropped: list[Dropped],
    *,
    region: str,
    seed: int,
) -> list[list[PartPlan]]:
    """Decide the small solids of buildings.

    Parameters
    ----------
    drafts
        All buildings, solids apart from each other.
    fronts
        Of each part the edges that show a front.
    streets
        Centre lines of streets.
    dropped
        Where it is told whose details can't be made.
    region
        As `facades.facade_styles.region_of` says.
    seed
        Decides what is there; each building's draws are its own.

    Returns
    -------
    list of list of PartPlan
        One list a building.
    """
    plans, bases = [draft.plan for draft in drafts], [draft.seat.base for draft in drafts]
    looks, meshes = [draft.look for draft in drafts], [draft.meshes for draft in drafts]
    # A cornice goes round a house whose back is like its front, and else along the street.
    streetward = [None if look.back == look.wall else shown for look, shown in zip(looks, fronts, strict=True)]
    ledges = cornices(plans, [look.wall for look in looks], bases, streetward, dropped=dropped)
    reaches, finishes = [look.reach for look in looks], [look.eaves for look in looks]
    fringes = eaves(plans, meshes, bases, reaches, finishes, streets, dropped=dropped)
    rows = [(part, p) for p, plan in enumerate(plans) for part in (*plan.parts, *ledges[p], *fringes[p])]
    tree = shapely.STRtree([part.polygon for part, _ in rows])
    outlines = shapely.STRtree([plan.outline for plan in plans])
    hanging: list[list[PartPlan]] = [[] for _ in plans]
    made: list[list[PartPlan]] = []
    families = styles().families
    for p, plan in enumerate(plans):
        base = bases[p]
        beside = outlines.query(plan.outline, predicate="dwithin", distance=3.0).tolist()
        theirs = [(piece, q) for q in sorted(beside) if q < p for piece in hanging[q]]

        def free(
            box: Polygon,
            low: float,
            high: float,
            base: float = base,
            theirs: list[tuple[PartPlan, int]] = theirs,
        ) -> bool:
            inner = overlay.buffer(box, -0.06, join_style="mitre")
            if len(streets.query(inner, predicate="dwithin", distance=_LANE)):
                return False
            near = [rows[j] for j in tree.query(box, predicate="dwithin", distance=0.3).tolist()]
            for part, q in (*near, *theirs):
                stands = bases[q] + part.low < base + high + 0.2 and bases[q] + part.top > base + low - 0.2
                if stands and part.polygon.distance(inner) < 0.02:
                    return False
            return True

        made.append([*ledges[p], *fringes[p]])
        with drop_on_failure(f"{plan.id} details", dropped):
            sitting = rooftop_parts(plan, meshes[p], base, fronts[p], rng(seed, "rooftop", plan.id), region=region)
            tanks = water_tank(plan, region, rng(seed, "tank", plan.id))
            sitting = [solid for solid in sitting if not any(solid.polygon.distance(t.polygon) < 0.5 for t in tanks)]
            sitting += tanks
            windows = dormers(plan, meshes[p], base, sitting, region, rng(seed, "dormers", plan.id))
            hanging[p] = projections(plan, looks[p], fronts[p], free, region, rng(seed, "projections", plan.id))
            gables = stepped_gables(plan, fronts[p]) if families[looks[p].wall].gable else []
            made[p] += [*sitting, *windows, *gables, *hanging[p], *posts(plan, streets)]
    return made


_TALL = 2.2  # metres: what begins higher up is walked under


@dataclass(frozen=True)
class UncladBuildings:
    """Buildings before anything covers them.

    Attributes
    ----------
    mesh
        Their solids.
    plans, seats
        What was decided, and where each stands.
    looks
        What each solid of each is to wear.
    """

    mesh: SolidMesh
    plans: list[BuildingPlan]
    seats: list[Footing]
    looks: list[FacadeStyle]


@dataclass(frozen=True)
class Cladding:
    """Surfaces of buildings: layers "buildings" and "roofs", together closed, part by part."""

    walls: list[Surface]
    roofs: list[Surface]


@dataclass(frozen=True)
class BuildingsResult:
    """Product of the stage.

    Attributes
    ----------
    records
        One a building, in the order of their entities; none is accessible yet.
    bare
        The same buildings, to be clad.
    collision
        Convex prisms of the walls, one surface each, vertices shared.
    dropped
        What the map had and the world has not, with reasons.
    watertight
        Buildings all of whose solids are closed and face outwards.
    rules
        How many heights each rule decided (`outlines_plans.RULES`).
    """

    records: list[Building]
    bare: UncladBuildings
    collision: list[Surface]
    dropped: list[Dropped]
    watertight: int
    rules: dict[str, int] = field(default_factory=dict)

    @property
    def collision_faces(self) -> int:
        """Triangles of all collision bodies."""
        return sum(len(surface.triangles) for surface in self.collision)

    def standing(self, terrain: HeightField) -> list[BaseGeometry]:
        """Return what stands in people's way: footprints of convex pieces that begin lower than a person is tall."""
        solids: list[BaseGeometry] = []
        for body in self.collision:
            points = np.asarray(body.positions, np.float64)
            ring = points[: len(points) // 2]
            if float(ring[0, 2]) < float(terrain(ring[:, :2]).max()) + _TALL:
                solids.append(shapely.Polygon(ring[:, :2]))
        return solids


def buildings_from_plans(decided: BuildingPlans, osm: OsmData, terrain: HeightField, *, seed: int) -> BuildingsResult:
    """Build what was decided for a place.

    Parameters
    ----------
    decided
        The buildings.
    osm
        The map they come from: its streets decide which walls are fronts.
    terrain
        What the buildings stand on.
    seed
        Decides what the map leaves open: colours, windows, details.

    Returns
    -------
    BuildingsResult
        Records, solids and collision bodies.
    """
    region = region_of(osm.frame.lat, osm.frame.lon)

    def look_of(plan: BuildingPlan, tags: Mapping[str, str]) -> FacadeStyle:
        return facade_styles.facade_style_of(
            plan.use,
            {**plan.tags, **tags},
            levels=plan.levels,
            area=plan.outline.area,
            region=region,
            random=rng(seed, "facade", plan.id),
        )

    dropped = list(decided.dropped)
    drafts: list[Draft] = []
    streets = shapely.STRtree([shapely.LineString(way.line) for way in osm.ways if is_street(way)])
    flat = is_flat_town(decided.plans)
    for plan in decided.plans:
        with drop_on_failure(plan.id, dropped):
            look = look_of(plan, plan.parts[0].tags)
            random = rng(seed, "roof customs", plan.id)
            roofed = with_customary_roofs(plan, look.wall, streets, region=region, flat_town=flat, random=random)
            drafts.append(draft_building(roofed, look, terrain))
    # No two houses side by side look the same, unless the map says so.
    outlines = np.array([draft.plan.outline for draft in drafts], object)
    left, right = shapely.STRtree(outlines).query(outlines, predicate="dwithin", distance=1.0)
    pairs = sorted((i, j) for i, j in zip(left.tolist(), right.tolist(), strict=True) if i < j)
    free = [not any("colo" in key and key.startswith("building:") for key in draft.plan.tags) for draft in drafts]
    worn = facade_styles.distinct_styles([draft.look for draft in drafts], pairs, free)
    drafts = [replace(draft, look=look) for draft, look in zip(drafts, worn, strict=True)]
    fronts = fronts_of([draft.plan for draft in drafts], [draft.seat for draft in drafts], osm)
    details = details_of(drafts, fronts, streets, dropped, region=region, seed=seed)
    drafts = [with_rooftop(draft, small, dropped) for draft, small in zip(drafts, details, strict=True)]
    drafts, mesh = repair_buildings(drafts, terrain, dropped)
    plans, seats = [draft.plan for draft in drafts], [draft.seat for draft in drafts]
    # A part that is said to be of another colour or stuff is dressed by itself, with the building's own draws.
    dress = [
        draft.look if part.finish or not _dressed_apart(part, draft.plan) else look_of(draft.plan, part.tags)
        for draft in drafts
        for part in draft.plan.solids
    ]
    records = [record_of(draft, entity) for entity, draft in enumerate(drafts, FIRST_BUILDING)]
    collision = [body for entity, draft in enumerate(drafts, FIRST_BUILDING) for body in bodies_of(draft, entity)]
    rules = {rule: count for rule in RULES if (count := sum(plan.rule == rule for plan in plans))}
    # All solids are in one mesh by now: plans need none of their own.
    plain = [replace(plan, rooftop=[replace(part, mesh=None) for part in plan.rooftop]) for plan in plans]
    bare = UncladBuildings(mesh, plain, seats, dress)
    return BuildingsResult(records, bare, collision, dropped, len(plans) - len(leaky_plans(mesh)), rules)


def clad(bare: UncladBuildings, osm: OsmData, *, seed: int) -> Cladding:
    """Cover the buildings of a place.

    Parameters
    ----------
    bare
        The buildings.
    osm
        The map they come from: its streets decide which walls are fronts.
    seed
        Decides where on its sheet each wall begins.
    """
    lines = wall_lines(bare.plans, bare.seats, osm)
    return Cladding(*textured_surfaces(bare.mesh, lines, bare.plans, bare.seats, bare.looks, seed))


_DRESS_KEYS = (
    "building:colour",
    "building:color",
    "building:material",
    "building:facade:material",
    "roof:colour",
    "roof:color",
    "roof:material",
)


def _dressed_apart(part: PartPlan, plan: BuildingPlan) -> bool:
    first = plan.parts[0].tags
    return any(part.tags.get(key) != first.get(key) for key in _DRESS_KEYS)
