"""Buildings of a place: outlines and parts from OpenStreetMap, with heights, uses and roofs decided.

Facts win; where OpenStreetMap says nothing, type, area and the neighbours decide, then a seeded draw of each
building's own. Spec section 1, buildings; OSM wiki, Simple 3D Buildings.

Solids of a town are made to fit: what hovers is held up or brought down, what overlaps is cut. Spikes and slits of
drawn outlines (thinner than a hand and no wall) are taken out: an outline that runs out to a point and back within a
hair of the same line has walls in one plane with its own or its neighbour's, and no roof comes out over it as drawn.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.buildings import RoofFacet
from vico.geo.osm import OsmArea, OsmData, Tags
from vico.geo.overlay import OverlayError, polygons_of
from vico.geo.quantities import Kind, quantity, read
from vico.seeds import rng
from vico.world.model import OPEN_KINDS, Dropped
from vico.worldgen.facts.building_heights import STOREY, level_estimates, tagged_height, tagged_levels, weighted_median
from vico.worldgen.facts.building_plans import (
    OUTLINE_TOLERANCE,
    SMALL_KINDS,
    BuildingOrigin,
    BuildingPlan,
    BuildingPlans,
    PartPlan,
    part_of,
    parts_of_roof,
)
from vico.worldgen.facts.fault_isolation import drop_on_failure
from vico.worldgen.facts.roofs import Roof, rings_of, shape_named
from vico.worldgen.facts.site import is_underground, on_the_ground

_LEAST_AREA = 2.0  # square metres
_GAP = 1.5  # metres between a solid and what it rests on that are a difference between two taggings
_RESTING = 0.3  # share of its area that must rest on others
_HELD = 0.2  # share of its outline that must be fixed to others' walls, where less of it rests
_TOUCHING = 0.003  # square metres that two outlines share where they only touch
_HEADROOM = 2.3  # metres below a part that people walk under
_SPANNED = 5.0  # metres of street beneath that make it a passage
_BARE = Roof("flat", 0.0)


def _support_floating_parts(plans: list[BuildingPlan], osm: OsmData, dropped: list[Dropped]) -> list[BuildingPlan]:
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
        with drop_on_failure(name[k], dropped):
            settled[k], below = _settle_part(parts[k], [settled[j] for j in near], crossed)
            carrying.update(near[j] for j in below)
            continue
        failed.add(name[k])
    # A parapet on what carries another solid would stand in that solid's wall.
    for j in carrying:
        if settled[j].roof.shape == "flat":
            settled[j] = replace(settled[j], roof=_BARE)
    rest = iter(settled)
    made = [replace(plan, parts=_extend_to_ground([next(rest) for _ in plan.parts])) for plan in plans]
    return [plan for plan in made if plan.id not in failed]


def _settle_part(part: PartPlan, near: list[PartPlan], crossed: list[shapely.LineString]) -> tuple[PartPlan, list[int]]:
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
    others = [near[j].polygon for j in under]
    resting = 0.0
    if others:
        resting = float(overlay.common_area(overlay.union_all(others, grid=0.001), part.polygon))
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


def _extend_to_ground(parts: list[PartPlan]) -> list[PartPlan]:
    """Return a building's parts; where nobody could walk below the lowest, it reaches the ground."""
    low = min(part.low for part in parts)
    if not 0.0 < low < _HEADROOM:
        return parts
    return [replace(part, low=0.0) if part.low == low and part.levels else part for part in parts]


def _carries(lower: PartPlan, upper: PartPlan) -> bool:
    """Whether a solid ends about where another, over a good share of it, begins."""
    return (
        lower.low < upper.low - 0.3
        and abs(lower.eaves - upper.low) < 2.0
        and overlay.common_area(lower.polygon, upper.polygon) > 0.25 * lower.polygon.area
    )


def _without_needless_corners(polygon: Polygon) -> Polygon:
    """Drop corners of a polygon that are none: a wall is one line from corner to corner, so that its bays are whole."""
    rings = []
    for ring in rings_of(polygon):
        # From the farthest corner on: where a ring begins it is never made straighter.
        first = int(np.hypot(*(ring - ring.mean(axis=0)).T).argmax())
        rings.append(np.roll(ring, -first, axis=0))
    tidied = overlay.simplify(Polygon(rings[0], rings[1:]), 0.012)
    return tidied if isinstance(tidied, Polygon) and tidied.is_valid and tidied.area > 0.0 else polygon


def _separate_overlapping_solids(plans: list[BuildingPlan], dropped: list[Dropped]) -> list[BuildingPlan]:
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
        with drop_on_failure(plans[rows[i][0]].id, dropped):
            pieces = [parts[i]]
            for j in sorted(near.get(i, []), key=lambda j: int(rank[j])):
                for other in placed[j]:
                    pieces = [piece for mine in pieces for piece in _beside(mine, other)]
            placed[i] = [replace(piece, polygon=_without_needless_corners(piece.polygon)) for piece in pieces]
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


_THIN = 0.2  # metres: no wall is thinner
_TURN = np.radians(174.0)  # by which an outline turns round at the end of a spike or a slit
_STYLE = {"join_style": "mitre", "mitre_limit": 5.0}


def without_needles(polygon: Polygon) -> BaseGeometry:
    """Return an outline without spikes and slits, in one or several pieces; one that has none, or is one, as it is."""
    if not any(_turns_round(ring) for ring in rings_of(polygon)):
        return polygon
    half = 0.5 * _THIN
    filled = overlay.buffer(overlay.buffer(polygon, half, **_STYLE), -half, **_STYLE)
    opened = overlay.buffer(overlay.buffer(filled, -half, **_STYLE), half, **_STYLE)
    return polygon if opened.is_empty else overlay.simplify(overlay.on_grid(overlay.areas_of(opened)), 0.02)


def _turns_round(ring: NDArray[np.float64]) -> bool:
    """Whether a ring turns back at a corner, or at two that are as close as a needle is thin."""
    step = np.roll(ring, -1, axis=0) - ring
    length = np.hypot(*step.T)
    heading = np.arctan2(step[:, 1], step[:, 0])
    turn = (heading - np.roll(heading, 1) + np.pi) % (2 * np.pi) - np.pi
    both = turn + np.roll(turn, -1)
    return bool((np.abs(turn) > _TURN).any() or ((np.abs(both) > _TURN) & (length < _THIN)).any())


_COVERED = 0.85  # share of an outline that parts must cover for the outline to be dropped

_USES = {
    "residential": "apartments residential house detached terrace semidetached_house dormitory bungalow block villa "
    "cabin farm houseboat",
    "hotel": "hotel hostel guest_house",
    "retail": "retail supermarket kiosk mall shop pavilion department_store market",
    "office": "office",
    "commercial": "commercial mixed",
    "industrial": "industrial warehouse factory hangar manufacture works",
    "civic": "public civic government townhall embassy library museum theatre cinema courthouse police fire_station "
    "arts_centre community_centre",
    "religious": "church cathedral chapel mosque synagogue temple religious monastery shrine",
    "education": "school university college kindergarten",
    "health": "hospital clinic",
    "transport": "train_station station transportation tower bus_station",
    "garage": "garage garages parking carport",
}
_USE_OF = {value: use for use, values in _USES.items() for value in values.split()}


def use_of(tags: Mapping[str, str], shops: int, area: float) -> str:
    """Say what a building is used for, one of `model.Building.use`."""
    kind = tags.get("building", tags.get("building:part", "yes"))
    if kind in _USE_OF:
        return _USE_OF[kind]
    for key in ("amenity", "tourism", "shop", "office", "historic"):
        value = tags.get(key)
        if value in _USE_OF:
            return _USE_OF[value]
        if value == "place_of_worship":
            return "religious"
        if value and key in ("shop", "office"):
            return "retail" if key == "shop" else "office"
    if kind in SMALL_KINDS or kind in OPEN_KINDS or area < 40.0:
        return "other"
    return "commercial" if shops >= 5 else "residential"


_Row = tuple[str, Polygon, Tags]


def _mapped_rows(osm: OsmData, key: str, dropped: list[Dropped]) -> list[_Row]:
    """Polygons of the areas with `key`, in the order of their ids, one row a connected piece."""
    square = shapely.box(-osm.half, -osm.half, osm.half, osm.half)
    rows: list[_Row] = []
    for area in osm.areas:
        if area.tags.get(key, "no") == "no" or (key == "building:part" and area.tags.get("building", "no") != "no"):
            continue
        pieces: list[Polygon] = []
        with drop_on_failure(area.id, dropped):
            reason = _reason_to_skip(area)
            if reason is None:
                pieces = _pieces(area.polygon)
                reason = "" if pieces else f"smaller than {_LEAST_AREA:g} m2"
            if reason and shapely.intersects(area.polygon, square):
                dropped.append(Dropped(id=area.id, reason=reason))
        rows += [
            (area.id if len(pieces) == 1 else f"{area.id}.{k}", piece, area.tags) for k, piece in enumerate(pieces, 1)
        ]
    return sorted(rows, key=lambda row: _id_key(row[0]))


def _pieces(drawn: Polygon | MultiPolygon) -> list[Polygon]:
    """Return the connected pieces of an outline as drawn: valid, without needless corners, spikes and slits."""
    whole = drawn if drawn.is_valid else overlay.make_valid(drawn)
    return [
        piece
        for shape in polygons_of(whole)
        for simple in polygons_of(overlay.simplify(shape, OUTLINE_TOLERANCE), _LEAST_AREA)
        for piece in polygons_of(without_needles(simple), _LEAST_AREA)
    ]


def _within(osm: OsmData, outlines: list[_Row], parts: list[_Row], dropped: list[Dropped]) -> tuple[list[_Row], ...]:
    """Outlines whose middle lies within the world's square, and parts that belong to them or lie in it themselves."""
    square = shapely.box(-osm.half, -osm.half, osm.half, osm.half)

    def inside(row: _Row) -> bool:
        if square.contains(row[1].centroid):
            return True
        if square.intersects(row[1]):
            dropped.append(Dropped(id=row[0], reason="its middle lies outside the world's square"))
        return False

    stay = [inside(row) for row in outlines]
    owner = _owners(outlines, parts, dropped)
    return (
        [row for row, kept in zip(outlines, stay, strict=True) if kept],
        [row for k, row in enumerate(parts) if k in owner and (stay[of] if (of := owner[k]) >= 0 else inside(row))],
    )


def _reason_to_skip(area: OsmArea) -> str | None:
    tags = area.tags
    height, levels = quantity(tags, "height"), read(tags.get("building:levels"), Kind.STOREYS).value
    if is_underground(tags):
        return "underground"
    if tags.get("location") == "indoor" or tags.get("indoor", "no") != "no":
        return "indoors"
    if height is not None and height <= 0.5:
        return "no height above ground"
    if levels is not None and levels <= 0 and (quantity(tags, "building:levels:underground") or 0) > 0:
        return "underground"
    return None


def building_plans(
    osm: OsmData,
    *,
    seed: int,
    measured: Mapping[str, tuple[RoofFacet, ...]] | None = None,
    origins: Mapping[str, BuildingOrigin] | None = None,
) -> BuildingPlans:
    """Decide every building of an extract that touches the world's square.

    Parameters
    ----------
    osm
        The extract.
    seed
        Decides, building by building, what neither tags nor neighbours do.
    measured
        Surfaces of roofs by the building's id, heights above its ground.
    origins
        Where facts are from, by the building's id, where other sources than the map were asked.

    Returns
    -------
    BuildingPlans
        Plans, and what was left out, with reasons.
    """
    dropped: list[Dropped] = []
    outlines, parts = _within(
        osm,
        _without_twins(_mapped_rows(osm, "building", dropped), dropped),
        _mapped_rows(osm, "building:part", dropped),
        dropped,
    )
    owned = _owners(outlines, parts, dropped)
    parts, owner = [parts[k] for k in owned], list(owned.values())
    shapes = [row[1] for row in outlines]
    # Shops, restaurants and services are mapped as points, too.
    trade = {"restaurant", "cafe", "bar", "pub", "fast_food", "bank", "pharmacy", "ice_cream", "cinema", "theatre"}
    trading = [n.xy for n in osm.nodes if "shop" in n.tags or n.tags.get("amenity") in trade]
    points = np.array(trading).reshape(-1, 2)
    shops = np.zeros(len(outlines), int)
    if len(points) and shapes:
        hits = shapely.STRtree(shapes).query(shapely.points(points), predicate="dwithin", distance=1.5)
        np.add.at(shops, hits[1], 1)
    tallest, typical = _part_levels(len(outlines), parts, owner)
    uses = [use_of(tags, int(n), outline.area) for (_, outline, tags), n in zip(outlines, shops, strict=True)]
    levels, rules = level_estimates(outlines, tallest, typical, uses, osm.frame.lon)
    flat = _flat_is_usual(outlines, parts, osm.frame.lon)
    own_parts: dict[int, list[_Row]] = {}
    for row, of in zip(parts, owner, strict=True):
        own_parts.setdefault(of, []).append(row)
    plans: list[BuildingPlan] = []
    for k, (name, outline, tags) in enumerate(outlines):
        with drop_on_failure(name, dropped):
            random = rng(seed, "building", name)
            main = part_of(outline, tags, {}, uses[k], int(levels[k]), flat, random)
            solids, rule = [main], "height tag" if tagged_height(tags) else rules[k]
            if own := own_parts.get(k):
                solids = [part_of(p, part_tags, tags, uses[k], main.levels, flat, random) for _, p, part_tags in own]
                if all(tagged_levels(part_tags) for _, _, part_tags in own) and rule != "height tag":
                    rule = "parts"
                solids = _rest_of_outline(main, solids) + solids
            plan = BuildingPlan(
                name,
                tags.get("name"),
                uses[k],
                tags,
                outline,
                max(s.levels for s in solids),
                int(shops[k]),
                solids,
                rule=rule,
            )
            plans.append(_with_sources(plan, measured or {}, origins, dropped))
    for name, outline, tags in own_parts.get(-1, []):
        with drop_on_failure(name, dropped):
            random = rng(seed, "building", name)
            use = use_of(tags, 0, outline.area)
            part = part_of(outline, tags, {}, use, 3, flat, random)
            rule = "height tag" if tagged_height(tags) else "levels tag" if tagged_levels(tags) else "town"
            lone = BuildingPlan(name, tags.get("name"), use, tags, outline, part.levels, 0, [part], rule=rule)
            plans.append(_with_sources(lone, {}, origins, dropped))
    return BuildingPlans(_separate_overlapping_solids(_support_floating_parts(plans, osm, dropped), dropped), dropped)


def _with_sources(
    plan: BuildingPlan,
    measured: Mapping[str, tuple[RoofFacet, ...]],
    origins: Mapping[str, BuildingOrigin] | None,
    dropped: list[Dropped],
) -> BuildingPlan:
    """Return a building under its measured roof, if it has one, with where its facts are from."""
    if origins is None:
        return plan
    name = plan.id.partition(".")[0]
    origin = origins.get(name, BuildingOrigin("osm"))
    if facets := measured.get(name):
        try:
            parts = parts_of_roof(plan.outline, facets, plan.parts[0].tags)
            plan = replace(plan, parts=parts, levels=max(part.levels for part in parts))
        except OverlayError as error:
            dropped.append(Dropped(id=f"{plan.id} roof", reason=f"fitted instead of built: {error}"))
            origin = replace(origin, roof=origin.roof.replace(" surfaces", " fitted"))
    return replace(plan, origin=origin)


def _part_levels(count: int, parts: list[_Row], owner: list[int]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """For every outline the most storeys its parts are said to have, and what most of their area has; 0: nothing."""
    tallest, typical = np.zeros(count, np.int64), np.zeros(count, np.int64)
    told: dict[int, list[tuple[int, float]]] = {}
    for (_, polygon, tags), of in zip(parts, owner, strict=True):
        if of >= 0 and (said := tagged_levels(tags)):
            told.setdefault(of, []).append((said, polygon.area))
    for of, rows in told.items():
        values, areas = np.array([row[0] for row in rows]), np.array([row[1] for row in rows])
        tallest[of], typical[of] = values.max(), weighted_median(values, areas)
    return tallest, typical


def _rest_of_outline(main: PartPlan, parts: list[PartPlan]) -> list[PartPlan]:
    """Return what an outline still stands for beside its parts.

    Nothing where parts that stand on the ground cover it. Else what they leave; under parts that begin higher up it
    ends where those begin.
    """
    standing = overlay.union_all([part.polygon for part in parts if part.low <= 0.0], grid=0.001)
    if overlay.common_area(standing, main.polygon) >= _COVERED * main.polygon.area:
        return []
    rest = overlay.areas_of(overlay.difference(main.polygon, standing, grid=0.001))
    solids: list[PartPlan] = []
    for part in sorted((p for p in parts if p.low > 2.0 and p.levels > 0), key=lambda p: p.low):
        under = overlay.intersection(rest, part.polygon)
        if under.area < 6.0:
            continue
        eaves = min(main.eaves, part.low)
        if eaves > main.low + 0.3:  # else the outline itself begins higher up, and nothing of it is below the part
            low = replace(main, eaves=eaves, levels=max(round(eaves / STOREY), 1), roof=Roof("flat", 0.0))
            pieces = without_slivers(under, main.polygon)
            solids += [replace(low, polygon=piece) for piece in pieces if piece.area > 6.0]
        rest = overlay.areas_of(overlay.difference(rest, part.polygon, grid=0.001))
    pieces = [piece for piece in without_slivers(rest, main.polygon) if piece.area > 6.0]
    return [replace(main, polygon=piece) for piece in pieces] + solids


def _id_key(name: str) -> tuple[str, int, int]:
    number_, _, piece = name[1:].partition(".")
    return name[0], int(number_), int(piece or 0)


def _without_twins(rows: list[_Row], dropped: list[Dropped]) -> list[_Row]:
    """Leave out outlines that were mapped twice, keeping the one with more to say."""
    if not rows:
        return rows
    shapes = np.array([row[1] for row in rows])
    left, right = shapely.STRtree(shapes).query(shapes, predicate="intersects")
    gone: set[int] = set()
    for i, j in sorted(zip(left.tolist(), right.tolist(), strict=True)):
        if i >= j or i in gone or j in gone:
            continue
        with drop_on_failure(rows[j][0], dropped):
            if overlay.common_area(shapes[i], shapes[j]) > 0.9 * max(shapes[i].area, shapes[j].area):
                loser = i if len(rows[i][2]) < len(rows[j][2]) else j
                gone.add(loser)
                dropped.append(Dropped(id=rows[loser][0], reason=f"same outline as {rows[i + j - loser][0]}"))
            continue
        gone.add(j)  # it can't be compared
    return [row for k, row in enumerate(rows) if k not in gone]


def _owners(outlines: list[_Row], parts: list[_Row], dropped: list[Dropped]) -> dict[int, int]:
    """For every part the outline that holds most of it; -1 where none holds a third."""
    tree = shapely.STRtree([row[1] for row in outlines])
    owner: dict[int, int] = {}
    for part, (name, polygon, _) in enumerate(parts):
        with drop_on_failure(name, dropped):
            near = sorted(tree.query(polygon, predicate="intersects").tolist())
            shared = [(overlay.common_area(outlines[k][1], polygon), -outlines[k][1].area, k) for k in near]
            best = max(shared, default=(0.0, 0.0, -1))
            owner[part] = best[2] if best[0] > 0.34 * polygon.area else -1
    return owner


def _flat_is_usual(outlines: list[_Row], parts: list[_Row], lon: float) -> bool:
    """Whether untagged town roofs are flat here: as the tagged ones are, else as on either side of the Atlantic."""
    said = [shape for _, _, tags in (*outlines, *parts) if (shape := shape_named(tags.get("roof:shape")))]
    if len(said) >= 20:
        return said.count("flat") > 0.5 * len(said)
    return lon < -30.0
