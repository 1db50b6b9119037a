"""A building while it is being built: its plan on its seat, with its solids; and the record that comes of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from shapely import Polygon

from vico.geo import overlay
from vico.geo.overlay import OverlayError, polygons_of
from vico.world.heights import HeightField
from vico.world.mesh import Surface
from vico.world.model import Building, BuildingSources, Dropped
from vico.worldgen.buildings.solids import Footing, Mesh, collision_bodies, part_mesh, seat_of
from vico.worldgen.facades.looks import FacadeStyle
from vico.worldgen.facts.expendable import expendable
from vico.worldgen.facts.outlines.plans import BuildingPlan, PartPlan
from vico.worldgen.facts.outlines.roof_shapes import rings_of, shape_named

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


def drafted(plan: BuildingPlan, look: FacadeStyle, terrain: HeightField) -> Draft:
    """Seat a plan and make the solids of its parts.

    Raises
    ------
    OverlayError
        If its outline can't be cut, or nothing is left of it.
    """
    seat = seat_of(plan, terrain)
    meshes = [part_mesh(part, seat) for part in plan.parts]
    bodies = [body for part in plan.parts for body in collision_bodies(part, seat)]
    return Draft(plan, seat, look, _footprint(plan), meshes, bodies)


def with_rooftop(draft: Draft, rooftop: Sequence[PartPlan], dropped: list[Dropped]) -> Draft:
    """Add small solids to a building; one that can't be made is left out, with its reason."""
    kept, meshes, posts = [], [], []
    for solid in rooftop:
        with expendable(f"{draft.plan.id} {solid.finish}", dropped):
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


def _footprint(plan: BuildingPlan) -> Polygon:
    # A millimetre grid, so that the written outline is the valid one and not its rounding.
    merged = overlay.on_grid(overlay.union_all([part.polygon for part in standing_parts(plan)]), grid=0.001)
    pieces = polygons_of(merged)
    if not pieces:
        raise OverlayError("nothing is left of its outline; draw it anew")
    return max(pieces, key=lambda shape: shape.area)


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
