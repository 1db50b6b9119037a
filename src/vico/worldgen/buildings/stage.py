"""Buildings as closed solids on the terrain, dressed, with their records and collision bodies."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.osm import OsmData, polygons_of
from vico.seeds import rng
from vico.world.heights import HeightField
from vico.world.mesh import Surface
from vico.world.model import FIRST_BUILDING, Building, Dropped
from vico.worldgen.buildings.details import detailed
from vico.worldgen.buildings.dressing import dressed
from vico.worldgen.buildings.solids import (
    Mesh,
    Seat,
    collision_bodies,
    leaky,
    part_mesh,
    seat_of,
    solid_meshes,
)
from vico.worldgen.buildings.wall_lines import fronts_of, is_street, wall_lines
from vico.worldgen.facades import looks
from vico.worldgen.facades.catalogue import region_of
from vico.worldgen.facades.looks import FacadeStyle
from vico.worldgen.facts.expendable import expendable
from vico.worldgen.facts.outlines.plans import RULES, BuildingPlan, BuildingPlans, PartPlan
from vico.worldgen.facts.outlines.roof_shapes import rings_of

_TALL = 2.2  # metres: what begins higher up is walked under
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
class BuildingsResult:
    """What the stage made.

    Attributes
    ----------
    records
        One a building, in the order of their entities; none is accessible yet.
    walls, roofs
        Layers "buildings" and "roofs": together closed, part by part.
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
    walls: list[Surface]
    roofs: list[Surface]
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
        Records, meshes and collision bodies.
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

    plans: list[BuildingPlan] = []
    seats: list[Seat] = []
    worn: list[FacadeStyle] = []
    meshes: list[list[Mesh]] = []
    bodies: list[list[Surface]] = []
    dropped = list(decided.dropped)
    for plan in decided.plans:
        with expendable(plan.id, dropped):
            seat = seat_of(plan, terrain)
            entity = FIRST_BUILDING + len(plans)
            look = look_of(plan, plan.parts[0].tags)
            solids = [part_mesh(part, seat) for part in plan.parts]
            collided = [body for part in plan.parts for body in collision_bodies(part, seat, entity)]
            plans.append(plan)
            seats.append(seat)
            worn.append(look)
            meshes.append(solids)
            bodies.append(collided)
    worn = _told_apart(worn, plans)
    streets = shapely.STRtree([shapely.LineString(way.line) for way in osm.ways if is_street(way)])
    bases = [seat.base for seat in seats]
    plans = detailed(plans, meshes, worn, bases, fronts_of(plans, seats, osm), streets, region=region, seed=seed)
    mesh = solid_meshes(plans, seats, meshes)
    edges = wall_lines(plans, seats, osm)
    # A part that is said to be of another colour or stuff is dressed by itself, with the building's own draws.
    dress = [
        look if part.finish or not _dressed_apart(part, plan) else look_of(plan, part.tags)
        for plan, look in zip(plans, worn, strict=True)
        for part in plan.solids
    ]
    walls, roofs = dressed(mesh, edges, plans, seats, dress, seed)
    records = [
        _record(plan, FIRST_BUILDING + k, seat, look)
        for k, (plan, seat, look) in enumerate(zip(plans, seats, worn, strict=True))
    ]
    collision = [
        body
        for k, (plan, seat) in enumerate(zip(plans, seats, strict=True))
        for body in (
            *bodies[k],
            *(
                post
                for solid in plan.rooftop
                if solid.finish == "post"
                for post in collision_bodies(solid, seat, FIRST_BUILDING + k)
            ),
        )
    ]
    rules = {rule: count for rule in RULES if (count := sum(plan.rule == rule for plan in plans))}
    return BuildingsResult(records, walls, roofs, collision, dropped, len(plans) - len(leaky(mesh)), rules)


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


def _told_apart(worn: list[FacadeStyle], plans: list[BuildingPlan]) -> list[FacadeStyle]:
    """No two houses side by side in the same clothes, unless the map says so."""
    outlines = np.array([plan.outline for plan in plans], object)
    left, right = shapely.STRtree(outlines).query(outlines, predicate="dwithin", distance=1.0)
    pairs = sorted((i, j) for i, j in zip(left.tolist(), right.tolist(), strict=True) if i < j)
    free = [not any("colo" in key and key.startswith("building:") for key in plan.tags) for plan in plans]
    return looks.told_apart(worn, pairs, free)


def _record(plan: BuildingPlan, entity: int, seat: Seat, look: FacadeStyle) -> Building:
    standing = [part.polygon for part in plan.parts if part.low < 2.5] or [part.polygon for part in plan.parts]
    # A millimetre grid, so that the written outline is the valid one and not its rounding.
    merged = polygons_of(overlay.on_grid(overlay.union_all(standing), grid=0.001))
    footprint = max(merged, key=lambda shape: shape.area)
    rings = [[(round(float(x), 3), round(float(y), 3)) for x, y in ring] for ring in rings_of(footprint)]
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
        colour="#{:02x}{:02x}{:02x}".format(*look.tint),
        accessible=False,
        tags={key: plan.tags[key] for key in _KEPT_TAGS if key in plan.tags},
    )
