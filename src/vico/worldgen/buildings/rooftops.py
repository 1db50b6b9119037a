"""What sits on, juts out of and holds up buildings: cornices, chimneys, penthouses, posts; closed solids each."""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from vico.exact import apply_matrix
from vico.geo import overlay
from vico.geo.overlay import polygons_of
from vico.world.model import Dropped
from vico.worldgen.buildings.chimneys import party_wall_stacks, ridge_chimneys
from vico.worldgen.buildings.solids import Mesh
from vico.worldgen.facades.catalogue import styles
from vico.worldgen.facts.expendable import expendable
from vico.worldgen.facts.outlines.plans import BuildingPlan, PartPlan
from vico.worldgen.facts.outlines.roof_shapes import Roof, rings_of

_CHIMNEYED = ("hipped", "gabled", "half-hipped", "mansard", "gambrel", "hipped-and-gabled")
_CORNICE_ABOVE = 0.03
_POST = 0.24  # metres: side of a post
_POST_EVERY = 6.0
_ROADWAY = 3.6  # metres from a street's centre line that stay free of posts


def rooftop_parts(
    plan: BuildingPlan,
    meshes: Sequence[Mesh],
    base: float,
    fronts: Sequence[NDArray[np.bool_]],
    random: np.random.Generator,
    *,
    region: str,
) -> list[PartPlan]:
    """Decide the small solids of a building's roof: penthouses and chimneys.

    Parameters
    ----------
    plan
        The building.
    meshes, fronts
        Of each part its solid, ENU metres, and the edges that show a front.
    base
        Height of the ground floor.
    random
        The building's own stream.
    region
        As `facades.catalogue.region_of` says.

    Returns
    -------
    list of PartPlan
        Without storeys; `finish` says what they are.
    """
    made: list[PartPlan] = []
    stacked = styles().region(region).chimneys == "on_party_walls"
    for part, mesh, front in zip(plan.parts, meshes, fronts, strict=True):
        if part.levels == 0 or part.eaves < 4.5 or part.polygon.area < 50.0:
            continue
        bare = part.roof.shape == "flat" and part.roof.height <= 0.0
        if bare or (part.low > 0.0 and part.roof.shape != "flat"):
            continue
        above = [other.polygon for other in plan.parts if other is not part and other.top > part.eaves + 0.3]
        free = overlay.difference(part.polygon, overlay.union_all(above)) if above else part.polygon
        if part.roof.shape == "flat":
            made += _penthouses(part, free, random)
        elif part.roof.shape in _CHIMNEYED and plan.use in ("residential", "hotel", "commercial", "civic"):
            if stacked:
                made += party_wall_stacks(part, free, mesh, base, front, random)
            else:
                made += ridge_chimneys(part, free, mesh, base, random)
    return made


def cornices(
    plans: Sequence[BuildingPlan],
    walls: Sequence[str],
    bases: Sequence[float],
    fronts: Sequence[Sequence[NDArray[np.bool_]] | None] | None = None,
    *,
    dropped: list[Dropped],
) -> list[list[PartPlan]]:
    """Ledges under the eaves of old-fashioned walls, cut where neighbours stand or have theirs.

    Parameters
    ----------
    plans
        All buildings, solids apart from each other.
    walls
        Facade material of each.
    bases
        Height of each one's ground floor, metres.
    fronts
        Of each part the edges that have one; None, for a building or for all: every edge.
    dropped
        Where it is told whose can't be made.

    Returns
    -------
    list of list of PartPlan
        One list a building.
    """
    rows = [(part, p) for p, plan in enumerate(plans) for part in plan.parts]
    shown = [None if fronts is None or (f := fronts[p]) is None else f[i]
             for p, plan in enumerate(plans) for i in range(len(plan.parts))]  # fmt: skip
    made: list[list[PartPlan]] = [[] for _ in plans]
    if not rows:
        return made
    tree = shapely.STRtree([part.polygon for part, _ in rows])
    of_part: dict[int, list[tuple[BaseGeometry, float, float]]] = {}
    for k, (part, p) in enumerate(rows):
        bare = part.roof.shape == "flat" and part.roof.height <= 0.0
        family = styles().families[walls[p]]
        if family.cornice == "none" or part.levels < 2 or bare or part.polygon.area < 50.0 or part.eaves < 4.5:
            continue
        if family.cornice == "under_flat_roofs" and part.roof.shape != "flat":
            continue
        with expendable(f"{plans[p].id} cornice", dropped):
            deep, out = family.cornice_size
            low, high = bases[p] + part.eaves - deep, bases[p] + part.eaves + _CORNICE_ABOVE
            outline = overlay.simplify(part.polygon, 0.2)
            outer = overlay.buffer(outline, out, join_style="mitre", mitre_limit=1.6)
            # Against the wall, not into it: an inner face would come to lie in the plane of some other wall.
            shape: BaseGeometry = overlay.difference(outer, part.polygon)
            edges = shown[k]
            if edges is not None and not edges.all():
                shape = overlay.intersection(shape, _before(part.polygon, edges, out + 0.01))
                if shape.is_empty:
                    continue
            taken: list[BaseGeometry] = []
            for j in sorted(tree.query(outer, predicate="dwithin", distance=out + 0.08).tolist()):
                other, q = rows[j]
                if j != k and bases[q] + other.top > low - 0.1 and bases[q] + other.low < high:
                    taken.append(other.polygon)
                taken += [
                    ledge for ledge, bottom, top in of_part.get(j, []) if top > low - 0.02 and bottom < high + 0.02
                ]
            if taken:
                # A finger's breadth clear of them, so that no two faces lie in one plane.
                shape = overlay.difference(shape, overlay.buffer(overlay.union_all(taken), 0.012, join_style="mitre"))
            # An opening takes away what is thinner than a hand.
            core = overlay.buffer(shape, -0.04, join_style="mitre")
            shape = overlay.intersection(overlay.buffer(core, 0.045, join_style="mitre", mitre_limit=2.0), shape)
            kept = polygons_of(shape, 0.12)
            finish = family.cornice_finishes[zlib.crc32(plans[p].id.encode()) % len(family.cornice_finishes)]
            of_part[k] = [(ledge, low, high) for ledge in kept]
            made[p] += [_solid(ledge, low - bases[p], high - bases[p], finish) for ledge in kept]
    return made


def _before(polygon: Polygon, chosen: NDArray[np.bool_], out: float) -> BaseGeometry:
    """Return what lies before the chosen edges of an outline."""
    rings = rings_of(polygon)
    start = np.concatenate(rings)
    end = np.concatenate([np.roll(ring, -1, axis=0) for ring in rings])
    lines = shapely.linestrings(np.stack([start[chosen], end[chosen]], axis=1))
    merged = shapely.line_merge(overlay.union_all(lines))
    return overlay.buffer(merged, out, cap_style="flat", join_style="mitre", mitre_limit=1.7)


def posts(plan: BuildingPlan, streets: shapely.STRtree) -> list[PartPlan]:
    """Return what holds up the canopies of a building: posts inside their corners and along their edges.

    Parameters
    ----------
    plan
        The building; a part without storeys that begins above the ground is a canopy.
    streets
        Centre lines that posts keep clear of.

    Returns
    -------
    list of PartPlan
        From the ground up into the canopy.
    """
    made: list[PartPlan] = []
    for part in plan.parts:
        if part.levels > 0 or part.low < 1.5 or part.polygon.area < 4.0:
            continue
        others = [other.polygon for other in plan.parts if other is not part and other.low < part.low - 0.5]
        standing = overlay.union_all(others) if others else None
        inside = polygons_of(overlay.buffer(part.polygon, -0.5, join_style="mitre"), 0.01)
        for shape in inside or [part.polygon]:
            ring = shapely.segmentize(overlay.simplify(shape, 0.4).exterior, _POST_EVERY)
            for x, y in rings_of(Polygon(ring))[0]:
                foot = shapely.box(x - _POST / 2, y - _POST / 2, x + _POST / 2, y + _POST / 2)
                if standing is not None and standing.distance(foot) < 1.0:
                    continue
                if len(streets.query(foot, predicate="dwithin", distance=_ROADWAY)) or not part.polygon.contains(foot):
                    continue
                if any(foot.distance(post.polygon) < 1.5 for post in made):
                    continue
                made.append(_solid(foot, 0.0, part.low + 0.06, "post"))
    return made


def _penthouses(part: PartPlan, free: BaseGeometry, random: np.random.Generator) -> list[PartPlan]:
    """Lift and plant rooms: one for every 700 m2 of flat roof or so, well inside."""
    room = max(polygons_of(overlay.buffer(free, -4.0)), key=lambda shape: shape.area, default=None)
    if part.polygon.area < 180.0 or room is None:
        return []
    made: list[PartPlan] = []
    for size, at in zip(random.uniform(2.2, 6.5, (4, 2)), random.random((4, 2)), strict=True):
        if len(made) >= min(int(part.polygon.area / 700.0) + 1, 4):
            break
        box = _box(_spot(room, at), size, _main_direction(part.polygon))
        if free.contains(overlay.buffer(box, 1.0)) and not any(box.intersects(m.polygon) for m in made):
            made.append(_solid(box, part.eaves - 0.2, part.eaves + float(random.uniform(1.6, 3.0)), "penthouse"))
    return made


def _solid(polygon: Polygon, low: float, high: float, finish: str) -> PartPlan:
    return PartPlan(polygon, low, high, 0, Roof("flat", 0.0), {}, finish)


def _spot(room: Polygon, at: NDArray[np.float64]) -> NDArray[np.float64]:
    west, south, east, north = room.bounds
    return np.array([west + (east - west) * at[0], south + (north - south) * at[1]])


def _main_direction(polygon: Polygon) -> float:
    box = np.asarray(shapely.minimum_rotated_rectangle(polygon).exterior.coords)
    side = box[1] - box[0]
    return math.atan2(side[1], side[0])


def _box(centre: NDArray[np.float64], size: NDArray[np.float64], yaw: float) -> Polygon:
    c, s = np.cos(yaw), np.sin(yaw)
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * size / 2
    return Polygon(apply_matrix(corners, [[c, -s], [s, c]]) + centre)
