"""Buildings as closed solids on the terrain, with their records and collision bodies; then what covers them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from vico.geo.osm import OsmData
from vico.seeds import rng
from vico.world.heights import HeightField
from vico.world.mesh import Surface
from vico.world.model import FIRST_BUILDING, Building, Dropped
from vico.worldgen.buildings.details import details_of
from vico.worldgen.buildings.drafts import Draft, bodies_of, drafted, record_of, with_rooftop
from vico.worldgen.buildings.dressing import dressed
from vico.worldgen.buildings.proving import proven
from vico.worldgen.buildings.roofs.customs import is_flat_town, with_customary_roofs
from vico.worldgen.buildings.solids import Footing, SolidMesh, leaky
from vico.worldgen.buildings.wall_lines import fronts_of, is_street, wall_lines
from vico.worldgen.facades import looks
from vico.worldgen.facades.catalogue import region_of
from vico.worldgen.facades.looks import FacadeStyle
from vico.worldgen.facts.expendable import expendable
from vico.worldgen.facts.outlines.plans import RULES, BuildingPlan, BuildingPlans, PartPlan

_TALL = 2.2  # metres: what begins higher up is walked under


@dataclass(frozen=True)
class Bare:
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
    """What covers buildings: layers "buildings" and "roofs", together closed, part by part."""

    walls: list[Surface]
    roofs: list[Surface]


@dataclass(frozen=True)
class BuildingsResult:
    """What the stage made.

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
    bare: Bare
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
        return looks.look_of(
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
        with expendable(plan.id, dropped):
            look = look_of(plan, plan.parts[0].tags)
            random = rng(seed, "roof customs", plan.id)
            roofed = with_customary_roofs(plan, look.wall, streets, region=region, flat_town=flat, random=random)
            drafts.append(drafted(roofed, look, terrain))
    drafts = _told_apart(drafts)
    fronts = fronts_of([draft.plan for draft in drafts], [draft.seat for draft in drafts], osm)
    details = details_of(drafts, fronts, streets, dropped, region=region, seed=seed)
    drafts = [with_rooftop(draft, small, dropped) for draft, small in zip(drafts, details, strict=True)]
    drafts, mesh = proven(drafts, terrain, dropped)
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
    bare = Bare(mesh, [_without_meshes(plan) for plan in plans], seats, dress)
    return BuildingsResult(records, bare, collision, dropped, len(plans) - len(leaky(mesh)), rules)


def clad(bare: Bare, osm: OsmData, *, seed: int) -> Cladding:
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
    return Cladding(*dressed(bare.mesh, lines, bare.plans, bare.seats, bare.looks, seed))


def _without_meshes(plan: BuildingPlan) -> BuildingPlan:
    """Return a plan without the meshes of its small solids: all solids are in one mesh by now."""
    return replace(plan, rooftop=[replace(part, mesh=None) for part in plan.rooftop])


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


def _told_apart(drafts: list[Draft]) -> list[Draft]:
    """No two houses side by side in the same clothes, unless the map says so."""
    outlines = np.array([draft.plan.outline for draft in drafts], object)
    left, right = shapely.STRtree(outlines).query(outlines, predicate="dwithin", distance=1.0)
    pairs = sorted((i, j) for i, j in zip(left.tolist(), right.tolist(), strict=True) if i < j)
    free = [not any("colo" in key and key.startswith("building:") for key in draft.plan.tags) for draft in drafts]
    worn = looks.told_apart([draft.look for draft in drafts], pairs, free)
    return [replace(draft, look=look) for draft, look in zip(drafts, worn, strict=True)]
