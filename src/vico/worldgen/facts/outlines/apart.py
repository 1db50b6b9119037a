"""Solids of a town made to fit: what hovers is held up or brought down, what overlaps is cut."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.osm import OsmData
from vico.geo.overlay import polygons_of
from vico.world.model import Dropped
from vico.worldgen.facts.expendable import expendable
from vico.worldgen.facts.outlines.heights import STOREY
from vico.worldgen.facts.outlines.plans import BuildingPlan, PartPlan
from vico.worldgen.facts.outlines.roof_shapes import Roof, rings_of
from vico.worldgen.facts.tags import on_the_ground

_LEAST_AREA = 2.0  # square metres
_GAP = 1.5  # metres between a solid and what it rests on that are a difference between two taggings
_RESTING = 0.3  # share of its area that must rest on others
_HELD = 0.2  # share of its outline that must be fixed to others' walls, where less of it rests
_TOUCHING = 0.003  # square metres that two outlines share where they only touch
_HEADROOM = 2.3  # metres below a part that people walk under
_SPANNED = 5.0  # metres of street beneath that make it a passage
_BARE = Roof("flat", 0.0)


def supported(plans: list[BuildingPlan], osm: OsmData, dropped: list[Dropped]) -> list[BuildingPlan]:
    """Bring down what would hover: mappers give an upper part its first level and forget what is below.

    A part that begins above the ground stays where it is if enough of its area rests on other solids, enough of its
    outline is fixed to their walls (an oriel, a bridge), or a street passes beneath it. One that ends a little above
    what it rests on is let down on it. Else it reaches down to the highest solid below, or to the ground.
    """
    parts = [part for plan in plans for part in plan.parts]
    name = [plan.id for plan in plans for _ in plan.parts]
    raised = [k for k, part in enumerate(parts) if part.low > 0.0 and part.levels > 0]
    if not raised:
        return plans
    tree = shapely.STRtree([part.polygon for part in parts])
    ways = [shapely.LineString(way.line) for way in osm.ways if way.tags.get("highway") and on_the_ground(way.tags)]
    passages = shapely.STRtree(ways)
    settled = list(parts)
    carrying: set[int] = set()
    failed: set[str] = set()
    # From below upwards, so that what a part rests on has come to rest itself.
    for k in sorted(raised, key=lambda k: (parts[k].low, k)):
        near = [j for j in sorted(tree.query(parts[k].polygon, predicate="intersects").tolist()) if j != k]
        crossed = [ways[j] for j in passages.query(parts[k].polygon, predicate="intersects").tolist()]
        with expendable(name[k], dropped):
            settled[k], below = _settled(parts[k], [settled[j] for j in near], crossed)
            carrying.update(near[j] for j in below)
            continue
        failed.add(name[k])
    # A parapet on what carries another solid would stand in that solid's wall.
    for j in carrying:
        if settled[j].roof.shape == "flat":
            settled[j] = replace(settled[j], roof=_BARE)
    rest = iter(settled)
    made = [replace(plan, parts=_grounded([next(rest) for _ in plan.parts])) for plan in plans]
    return [plan for plan in made if plan.id not in failed]


def _settled(part: PartPlan, near: list[PartPlan], crossed: list[shapely.LineString]) -> tuple[PartPlan, list[int]]:
    """Let a part that begins above the ground come to rest, if nothing holds it up there.

    Parameters
    ----------
    part
        The part.
    near
        The other solids over or under it or at its walls, settled as far as they lie lower.
    crossed
        Streets that pass through its outline.

    Returns
    -------
    tuple
        The part, and the indices in `near` of what carries it.
    """
    under = [j for j, other in enumerate(near) if other.low < part.low - 0.3 and other.top > part.low - _GAP]
    resting = _shared(part.polygon, [near[j].polygon for j in under])
    if resting >= _RESTING * part.polygon.area:
        tops = [
            near[j].eaves
            for j in under
            if near[j].roof.shape == "flat"
            and overlay.common_area(near[j].polygon, part.polygon) > 0.2 * part.polygon.area
        ]
        carried = [j for j in under if _carries(near[j], part)]
        return (replace(part, low=min(tops)) if tops and min(tops) < part.low else part), carried
    beside = [other for other in near if other.low < part.low - 0.3 and other.top > part.low + 2.0]
    walls = overlay.buffer(overlay.union_all([other.polygon for other in beside]), 0.1)
    held = overlay.common_length(part.polygon.exterior, walls) if beside else 0.0
    if held >= _HELD * part.polygon.exterior.length:
        return part, []
    if held > 0.0 and sum(overlay.common_length(way, part.polygon) for way in crossed) >= _SPANNED:
        return part, []
    below = [
        other.eaves
        for other in near
        if other.eaves < part.low and overlay.common_area(other.polygon, part.polygon) > 0.7 * part.polygon.area
    ]
    low = max(below, default=0.0)
    return replace(part, low=low, levels=max(round((part.eaves - low - 0.6) / STOREY), 1)), []


def _grounded(parts: list[PartPlan]) -> list[PartPlan]:
    """Return a building's parts; where nobody could walk below the lowest, it reaches the ground."""
    low = min(part.low for part in parts)
    if not 0.0 < low < _HEADROOM:
        return parts
    return [replace(part, low=0.0) if part.low == low and part.levels else part for part in parts]


def _shared(polygon: Polygon, others: list[Polygon]) -> float:
    if not others:
        return 0.0
    return float(overlay.common_area(overlay.union_all(others, grid=0.001), polygon))


def _carries(lower: PartPlan, upper: PartPlan) -> bool:
    """Whether a solid ends about where another, over a good share of it, begins."""
    return (
        lower.low < upper.low - 0.3
        and abs(lower.eaves - upper.low) < 2.0
        and overlay.common_area(lower.polygon, upper.polygon) > 0.25 * lower.polygon.area
    )


def tidy(polygon: Polygon) -> Polygon:
    """Drop corners of a polygon that are none: a wall is one line from corner to corner, so that its bays are whole."""
    rings = []
    for ring in rings_of(polygon):
        # From the farthest corner on: where a ring begins it is never made straighter.
        first = int(np.hypot(*(ring - ring.mean(axis=0)).T).argmax())
        rings.append(np.roll(ring, -first, axis=0))
    tidied = overlay.simplify(Polygon(rings[0], rings[1:]), 0.012)
    return tidied if isinstance(tidied, Polygon) and tidied.is_valid and tidied.area > 0.0 else polygon


def apart(plans: list[BuildingPlan], dropped: list[Dropped]) -> list[BuildingPlan]:
    """Cut solids that overlap in plan and height.

    The taller keeps its ground and the lower gets what is left of it. Under a taller one that begins above the ground
    the lower goes on, up to where that begins.
    """
    rows = [(p, k) for p, plan in enumerate(plans) for k in range(len(plan.parts))]
    parts = [plans[p].parts[k] for p, k in rows]
    if not parts:
        return plans
    order = sorted(range(len(parts)), key=lambda i: (-round(parts[i].top, 2), -round(parts[i].polygon.area, 2), i))
    rank = np.empty(len(parts), int)
    rank[order] = np.arange(len(parts))
    tree = shapely.STRtree([part.polygon for part in parts])
    left, right = tree.query([part.polygon for part in parts], predicate="intersects")
    near: dict[int, list[int]] = {}
    for i, j in zip(left.tolist(), right.tolist(), strict=True):
        if rank[j] < rank[i]:
            near.setdefault(i, []).append(j)
    placed: dict[int, list[PartPlan]] = {}
    failed: set[int] = set()
    for i in order:
        placed[i] = []
        if rows[i][0] in failed:
            continue
        with expendable(plans[rows[i][0]].id, dropped):
            pieces = [parts[i]]
            for j in sorted(near.get(i, []), key=lambda j: int(rank[j])):
                for other in placed[j]:
                    pieces = [piece for mine in pieces for piece in _beside(mine, other)]
            placed[i] = [replace(piece, polygon=tidy(piece.polygon)) for piece in pieces]
            continue
        failed.add(rows[i][0])
    result: list[BuildingPlan] = []
    first = 0
    for p, plan in enumerate(plans):
        solids = [piece for i in range(first, first + len(plan.parts)) for piece in placed[i]]
        first += len(plan.parts)
        if p in failed:
            continue
        if not solids:
            dropped.append(Dropped(id=plan.id, reason="lies within taller buildings"))
            continue
        result.append(replace(plan, parts=solids))
    return result


def _beside(part: PartPlan, other: PartPlan) -> list[PartPlan]:
    """Return what is left of a solid beside and under another that keeps its ground."""
    if other.low >= part.top - 0.02 or part.low >= other.top - 0.02:
        return [part]
    common = overlay.intersection(part.polygon, other.polygon)
    if common.area <= _TOUCHING:
        return [part]
    rest = [
        replace(part, polygon=piece)
        for piece in without_slivers(overlay.difference(part.polygon, other.polygon), part.polygon)
    ]
    if other.low > part.low + 0.3:
        levels = max(round((other.low - part.low - 0.6) / STOREY), 1) if part.levels else 0
        under = replace(part, eaves=other.low, levels=levels, roof=_BARE)
        rest += [replace(under, polygon=piece) for piece in without_slivers(common, part.polygon)]
    return rest


def without_slivers(shape: BaseGeometry, whole: Polygon) -> list[Polygon]:
    """Pieces of a cut outline without the slivers that are left between two outlines that nearly agree."""
    areas = overlay.areas_of(shape)
    opened = overlay.buffer(overlay.buffer(areas, -0.15, join_style="mitre"), 0.15, join_style="mitre", mitre_limit=2.5)
    kept = overlay.intersection(overlay.areas_of(overlay.intersection(opened, areas)), whole)
    return polygons_of(overlay.simplify(kept, 0.02), _LEAST_AREA)
