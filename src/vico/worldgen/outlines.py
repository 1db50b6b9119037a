"""What buildings there are: outlines and parts from OpenStreetMap, with heights, uses and roofs decided.

Facts win; where OpenStreetMap says nothing, type, area and the neighbours decide, then a seeded draw of each
building's own. Spec section 1, buildings; OSM wiki, Simple 3D Buildings.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from vico.geo.osm import OsmArea, OsmData, Tags, polygons_of
from vico.world.model import Dropped
from vico.world.seeds import rng
from vico.worldgen.roofs import Roof, inradius, rings_of, shape_named
from vico.worldgen.streets import number, on_the_ground

STOREY = 3.2
"""Metres a storey, where only levels are known."""

_TOLERANCE = 0.12  # metres of outline detail that is not seen but costs triangles
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
_TALL = {"religious": 15.0, "transport": 9.0, "industrial": 7.5, "garage": 3.0}
_SMALL_KINDS = {"kiosk", "garage", "garages", "shed", "hut", "carport", "service", "toilets", "pavilion", "greenhouse"}
_OPEN_KINDS = {"roof", "carport", "canopy", "bridge"}
_LEAST_AREA = 4.0


@dataclass(frozen=True)
class PartPlan:
    """A solid to build, heights in metres above the building's base.

    Attributes
    ----------
    low
        Underside; 0 where it stands on the ground.
    eaves
        Where the roof begins.
    levels
        Storeys between ground (or underside) and eaves.
    finish
        Empty for what has rooms; else what kind of roof furniture it is: cornice, penthouse or chimney.
    """

    polygon: Polygon
    low: float
    eaves: float
    levels: int
    roof: Roof
    tags: Tags
    finish: str = ""

    @property
    def top(self) -> float:
        """The highest point."""
        return self.eaves + self.roof.height


@dataclass(frozen=True)
class BuildingPlan:
    """A building decided but not yet built.

    Attributes
    ----------
    shops
        Named shops, restaurants and the like inside it or at its walls.
    rooftop
        What sits on `parts`.
    """

    id: str
    name: str | None
    use: str
    tags: Tags
    outline: Polygon
    levels: int
    shops: int
    parts: list[PartPlan]
    rooftop: list[PartPlan] = field(default_factory=list)

    @property
    def solids(self) -> list[PartPlan]:
        """Everything to build."""
        return [*self.parts, *self.rooftop]


def use_of(tags: Mapping[str, str], shops: int, area: float) -> str:
    """What a building is used for, one of `model.Building.use`."""
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
    if kind in _SMALL_KINDS or kind in _OPEN_KINDS or area < 40.0:
        return "other"
    return "commercial" if shops >= 5 else "residential"


def _kept_areas(osm: OsmData, key: str, dropped: list[Dropped]) -> list[tuple[str, Polygon, Tags]]:
    """Polygons of the areas with `key` that touch the world's square, one row a connected piece."""
    square = shapely.box(-osm.half, -osm.half, osm.half, osm.half)
    rows: list[tuple[str, Polygon, Tags]] = []
    for area in osm.areas:
        if area.tags.get(key, "no") == "no" or (key == "building:part" and area.tags.get("building", "no") != "no"):
            continue
        if not shapely.intersects(area.polygon, square):
            continue
        if reason := _unwanted(area):
            dropped.append(Dropped(id=area.id, reason=reason))
            continue
        pieces = [
            piece
            for shape in polygons_of(area.polygon)
            for piece in polygons_of(shapely.simplify(shape, _TOLERANCE), _LEAST_AREA)
        ]
        if not pieces:
            dropped.append(Dropped(id=area.id, reason=f"smaller than {_LEAST_AREA:g} m2"))
        rows += [
            (area.id if len(pieces) == 1 else f"{area.id}.{k}", piece, area.tags) for k, piece in enumerate(pieces, 1)
        ]
    return rows


def _unwanted(area: OsmArea) -> str | None:
    tags = area.tags
    layer, height, levels = number(tags.get("layer")), number(tags.get("height")), number(tags.get("building:levels"))
    if tags.get("location") == "underground" or tags.get("tunnel") == "yes":
        return "underground"
    if layer is not None and layer < 0:
        return "below ground (layer < 0)"
    if height is not None and height <= 0.5:
        return "no height above ground"
    if levels is not None and levels <= 0 and (number(tags.get("building:levels:underground")) or 0) > 0:
        return "underground"
    return None


def _shop_points(osm: OsmData) -> NDArray[np.float64]:
    """Where shops, restaurants and services are mapped as points."""
    trade = {"restaurant", "cafe", "bar", "pub", "fast_food", "bank", "pharmacy", "ice_cream", "cinema", "theatre"}
    points = [n.xy for n in osm.nodes if "shop" in n.tags or n.tags.get("amenity") in trade]
    return np.array(points).reshape(-1, 2)


def building_plans(osm: OsmData, *, seed: int) -> tuple[list[BuildingPlan], list[Dropped]]:
    """Decide every building of an extract that touches the world's square.

    Parameters
    ----------
    osm
        The extract.
    seed
        Decides, building by building, what neither tags nor neighbours do.

    Returns
    -------
    tuple
        Plans in the order of their ids, without overlaps among their solids; and what was left out, with reasons.
    """
    dropped: list[Dropped] = []
    outlines = sorted(_kept_areas(osm, "building", dropped), key=lambda row: _id_key(row[0]))
    parts = sorted(_kept_areas(osm, "building:part", dropped), key=lambda row: _id_key(row[0]))
    outlines = _without_twins(outlines, dropped)
    owner = _owners(outlines, parts)
    shapes = [row[1] for row in outlines]
    points = _shop_points(osm)
    shops = np.zeros(len(outlines), int)
    if len(points) and shapes:
        hits = shapely.STRtree(shapes).query(shapely.points(points), predicate="dwithin", distance=1.5)
        np.add.at(shops, hits[1], 1)
    tallest = np.zeros(len(outlines), int)
    for (_, _, tags), of in zip(parts, owner, strict=True):
        if of >= 0:
            tallest[of] = max(tallest[of], _said_levels(tags) or 0)
    levels = _level_estimates(outlines, tallest, osm.frame.lon)
    flat = _flat_is_usual(outlines, parts, osm.frame.lon)
    plans: list[BuildingPlan] = []
    for k, (name, outline, tags) in enumerate(outlines):
        random = rng(seed, "building", name)
        own = [row for row, of in zip(parts, owner, strict=True) if of == k]
        use = use_of(tags, int(shops[k]), outline.area)
        main = _part(outline, tags, {}, use, int(levels[k]), flat, random)
        if own:
            solids = [_part(p, part_tags, tags, use, main.levels, flat, random) for _, p, part_tags in own]
            solids = _rest_of_outline(main, solids) + solids
        else:
            solids = [main]
        plans.append(
            BuildingPlan(
                name, tags.get("name"), use, tags, outline, max(s.levels for s in solids), int(shops[k]), solids
            )
        )
    for (name, outline, tags), of in zip(parts, owner, strict=True):
        if of < 0:
            random = rng(seed, "building", name)
            use = use_of(tags, 0, outline.area)
            part = _part(outline, tags, {}, use, 3, flat, random)
            plans.append(BuildingPlan(name, tags.get("name"), use, tags, outline, part.levels, 0, [part]))
    return _apart(_supported(plans, osm), dropped), dropped


def _rest_of_outline(main: PartPlan, parts: list[PartPlan]) -> list[PartPlan]:
    """What an outline still stands for beside its parts.

    Nothing where parts that stand on the ground cover it. Else what they leave; under parts that begin higher up it
    ends where those begin.
    """
    standing = shapely.union_all([part.polygon for part in parts if part.low <= 0.0], grid_size=0.001)
    if shapely.intersection(standing, main.polygon).area >= _COVERED * main.polygon.area:
        return []
    rest: BaseGeometry = shapely.difference(main.polygon, standing, grid_size=0.001)
    solids: list[PartPlan] = []
    for part in sorted((p for p in parts if p.low > 2.0 and p.levels > 0), key=lambda p: p.low):
        under = shapely.intersection(rest, part.polygon)
        if under.area < 6.0:
            continue
        eaves = min(main.eaves, part.low)
        low = replace(main, eaves=eaves, levels=max(round(eaves / STOREY), 1), roof=Roof("flat", 0.0))
        solids += [replace(low, polygon=piece) for piece in polygons_of(under, 6.0)]
        rest = shapely.difference(rest, part.polygon, grid_size=0.001)
    return [replace(main, polygon=piece) for piece in polygons_of(rest, 6.0)] + solids


def _id_key(name: str) -> tuple[str, int, int]:
    number_, _, piece = name[1:].partition(".")
    return name[0], int(number_), int(piece or 0)


def _without_twins(rows: list[tuple[str, Polygon, Tags]], dropped: list[Dropped]) -> list[tuple[str, Polygon, Tags]]:
    """Leave out outlines that were mapped twice, keeping the one with more to say."""
    if not rows:
        return rows
    shapes = np.array([row[1] for row in rows])
    left, right = shapely.STRtree(shapes).query(shapes, predicate="intersects")
    gone: set[int] = set()
    for i, j in sorted(zip(left.tolist(), right.tolist(), strict=True)):
        if i >= j or i in gone or j in gone:
            continue
        common = shapely.intersection(shapes[i], shapes[j]).area
        if common > 0.9 * max(shapes[i].area, shapes[j].area):
            loser = i if len(rows[i][2]) < len(rows[j][2]) else j
            gone.add(loser)
            dropped.append(Dropped(id=rows[loser][0], reason=f"same outline as {rows[i + j - loser][0]}"))
    return [row for k, row in enumerate(rows) if k not in gone]


def _owners(outlines: list[tuple[str, Polygon, Tags]], parts: list[tuple[str, Polygon, Tags]]) -> list[int]:
    """For every part the outline that holds most of it; -1 where none holds a third."""
    if not outlines or not parts:
        return [-1] * len(parts)
    tree = shapely.STRtree([row[1] for row in outlines])
    owner: list[int] = []
    for _, polygon, _ in parts:
        near = sorted(tree.query(polygon, predicate="intersects").tolist())
        shared = [(shapely.intersection(outlines[k][1], polygon).area, -outlines[k][1].area, k) for k in near]
        best = max(shared, default=(0.0, 0.0, -1))
        owner.append(best[2] if best[0] > 0.34 * polygon.area else -1)
    return owner


def _said_levels(tags: Mapping[str, str]) -> int | None:
    levels = number(tags.get("building:levels"))
    if levels is not None and 1 <= levels <= 150:
        return max(round(levels), 1)
    height = number(tags.get("height")) or number(tags.get("building:height"))
    return max(round((height - 1.0) / STOREY), 1) if height and height > 2 else None


def _level_estimates(
    outlines: list[tuple[str, Polygon, Tags]], tallest: NDArray[np.int64], lon: float
) -> NDArray[np.int64]:
    """Storeys of every outline: said, else like the nearest that say, else by how dense the town stands.

    `tallest` are the most storeys any part of each is said to have (0: none): an outline's own tag often means the
    lowest part.
    """
    if not outlines:
        return np.zeros(0, np.int64)
    areas = np.array([row[1].area for row in outlines])
    centres = np.array([row[1].centroid.coords[0] for row in outlines])
    said = np.array([_said_levels(row[2]) or 0 for row in outlines])
    example = np.maximum(said, tallest)
    known = np.flatnonzero((example > 0) & (areas > 120.0))
    reach = shapely.box(*(f(centres[:, k]) for f in (np.min, np.max) for k in (0, 1)))
    dense = areas.sum() / max(reach.area, 1.0) > 0.22
    usual = (5 if lon > -30 else 4) if dense else 2
    result = np.empty(len(outlines), np.int64)
    tree = cKDTree(centres[known]) if len(known) else None
    for k in range(len(outlines)):
        if said[k]:
            result[k] = said[k]
            continue
        if areas[k] < 45.0:
            result[k] = 1
            continue
        near: list[int] = []
        if tree is not None:
            distance, index = tree.query(centres[k], k=min(7, len(known)))
            pairs = zip(np.atleast_1d(distance).tolist(), np.atleast_1d(index).tolist(), strict=True)
            near = [int(example[known[i]]) for d, i in pairs if d < 220.0]
        estimate = round(float(np.median(near))) if len(near) >= 2 else usual
        result[k] = min(estimate, 2 if areas[k] < 90.0 else 3 if areas[k] < 140.0 else 12)
    return result


def _flat_is_usual(
    outlines: list[tuple[str, Polygon, Tags]], parts: list[tuple[str, Polygon, Tags]], lon: float
) -> bool:
    """Whether untagged town roofs are flat here: as the tagged ones are, else as on either side of the Atlantic."""
    said = [shape for _, _, tags in (*outlines, *parts) if (shape := shape_named(tags.get("roof:shape")))]
    if len(said) >= 20:
        return said.count("flat") > 0.5 * len(said)
    return lon < -30.0


def _part(
    polygon: Polygon, tags: Tags, outer: Tags, use: str, levels: int, flat: bool, random: np.random.Generator
) -> PartPlan:
    """Decide one solid: heights above the base, storeys, roof."""
    draw = random.random(4)
    merged = {**{k: v for k, v in outer.items() if k in _INHERITED}, **tags}
    kind = tags.get("building", tags.get("building:part", "yes"))
    open_below = kind in _OPEN_KINDS or tags.get("wall") == "no"
    said = _said_levels(tags)
    storeys = said or levels
    if said is None and kind in _SMALL_KINDS:
        storeys = 1
    elif said is None and not outer and storeys >= 3 and number(tags.get("height")) is None:
        storeys += -1 if draw[0] < 0.2 else 1 if draw[0] > 0.8 else 0
    roof = _roof(polygon, merged, use, storeys, flat, draw, open_below)
    allowance = 0.8 if use in ("retail", "commercial", "office", "civic", "hotel") else 0.4
    height = number(tags.get("height")) or number(tags.get("building:height"))
    if height is not None and 0.5 < height < 900.0:
        if number(tags.get("roof:height")) is None:
            roof = replace(roof, height=min(roof.height, 0.4 * height))
        roof = replace(roof, height=min(roof.height, max(height - 0.5, 0.0)))
        eaves = height - (roof.height if roof.shape != "flat" else 0.0)
    elif open_below:
        eaves = 4.4
    elif said is None and use in _TALL:
        eaves = _TALL[use]
        storeys = 1 if use == "religious" else max(round(eaves / STOREY), 1)
    else:
        eaves = storeys * STOREY + allowance
        eaves = max(eaves, 2.6)
    low = number(tags.get("min_height"))
    if low is None:
        bottom = number(tags.get("building:min_level")) or number(tags.get("min_level"))
        # The same allowance as for eaves, so that what is stacked meets and does not overlap.
        low = bottom * STOREY + allowance if bottom else 0.0
    if open_below and low <= 0.0:
        low = max(eaves - 0.45, 0.5)
        storeys = 0
    low = min(max(low, 0.0), eaves - 0.3) if low > 0 else 0.0
    if said is None and storeys and use != "religious":
        storeys = max(round((eaves - low - 0.6) / STOREY), 1)
    return PartPlan(polygon, low, eaves, storeys, roof, merged)


_INHERITED = {
    "building",
    "building:colour",
    "building:material",
    "building:facade:material",
    "roof:shape",
    "roof:colour",
    "roof:material",
    "name",
}


def _roof(
    polygon: Polygon, tags: Tags, use: str, storeys: int, flat: bool, draw: NDArray[np.float64], open_below: bool
) -> Roof:
    """The roof that is tagged, else one that suits use, size and region."""
    shape = shape_named(tags.get("roof:shape"))
    area = polygon.area
    deep = inradius(polygon)
    if shape is None:
        shape = "flat" if open_below else _usual_roof(use, storeys, flat, area, deep, float(draw[1]))
    direction = _direction(polygon, tags)
    if shape == "flat":
        return Roof("flat", 0.0 if open_below or area < 60.0 else 0.5 + 0.5 * float(draw[2]))
    if shape in ("gabled", "round", "dome") and deep < 0.8:
        return Roof("flat", 0.0)
    height = number(tags.get("roof:height"))
    if height is None:
        tiers = number(tags.get("roof:levels"))
        angle = number(tags.get("roof:angle"))
        if tiers:
            height = 2.8 * min(tiers, 4.0)
        elif angle and 3.0 < angle < 75.0:
            height = deep * math.tan(math.radians(angle))
        elif shape == "mansard":
            height = 2.6 + 0.8 * float(draw[2])
        elif shape == "dome":
            height = deep
        elif shape == "round":
            height = 0.6 * deep
        elif shape == "skillion":
            height = 0.35 * deep
        else:
            pitch = 52.0 if use == "religious" else 28.0 + 12.0 * float(draw[2])
            height = min(deep * math.tan(math.radians(pitch)), 12.0 if use == "religious" else 5.5)
    return Roof(shape, float(np.clip(height, 0.3, 60.0)), direction)


def _usual_roof(use: str, storeys: int, flat: bool, area: float, deep: float, draw: float) -> str:
    if use == "religious":
        return "gabled"
    if area < 45.0 or storeys >= 8 or use in ("industrial", "retail", "garage", "transport", "other") or deep > 24.0:
        return "flat"
    if storeys <= 2 and area < 260.0:
        return "gabled" if draw < 0.65 else "hipped"
    if flat:
        return "flat"
    if use in ("office", "commercial"):
        return "flat" if draw < 0.45 else "mansard" if draw < 0.65 else "hipped"
    return "hipped" if draw < 0.5 else "mansard" if draw < 0.7 else "gabled" if draw < 0.88 else "flat"


_COMPASS = "N NNE NE ENE E ESE SE SSE S SSW SW WSW W WNW NW NNW"
_POINTS = {name: 22.5 * k for k, name in enumerate(_COMPASS.split(" "))}


def _direction(polygon: Polygon, tags: Tags) -> float | None:
    """Yaw of a gabled roof's ridge or of a skillion's fall; tags give compass bearings of the fall."""
    said = tags.get("roof:direction")
    bearing = None
    if said:
        bearing = _POINTS.get(said.strip().upper(), number(said))
    skillion = shape_named(tags.get("roof:shape")) == "skillion"
    if bearing is not None:
        yaw = math.radians(90.0 - bearing)
        return yaw if skillion else yaw + math.pi / 2
    box = np.asarray(shapely.minimum_rotated_rectangle(polygon).exterior.coords)
    sides = np.diff(box[:3], axis=0)
    long = sides[int(np.hypot(*sides.T).argmax())]
    yaw = math.atan2(long[1], long[0])
    if skillion:
        return yaw + math.pi / 2
    return yaw + math.pi / 2 if tags.get("roof:orientation") == "across" else None


def _supported(plans: list[BuildingPlan], osm: OsmData) -> list[BuildingPlan]:
    """Bring down to the ground what would hover: mappers give an upper part its first level and forget what is below.

    What has half its area on other solids stays up, and so does what a street or path passes under.
    """
    rows = [(part, p) for p, plan in enumerate(plans) for part in plan.parts]
    ways = [shapely.LineString(way.line) for way in osm.ways if way.tags.get("highway") and on_the_ground(way.tags)]
    if not rows or not ways:
        return plans
    tree, passages = shapely.STRtree([part.polygon for part, _ in rows]), shapely.STRtree(ways)
    result: list[BuildingPlan] = []
    carrying: set[int] = set()
    for plan in plans:
        parts: list[PartPlan] = []
        for part in plan.parts:
            if part.low <= 0.0 or part.levels == 0:
                parts.append(part)
                continue
            near = [rows[k][0] for k in sorted(tree.query(part.polygon, predicate="intersects").tolist())]
            under = [other.polygon for other in near if other.low < part.low - 0.5 and other.top > part.low - 1.5]
            resting = (
                shapely.intersection(shapely.union_all(under, grid_size=0.001), part.polygon).area if under else 0.0
            )
            crossing = sum(
                shapely.intersection(ways[k], part.polygon).length
                for k in passages.query(part.polygon, predicate="intersects").tolist()
            )
            hovers = resting < 0.5 * part.polygon.area and crossing < 5.0
            if not (resting < 0.5 * part.polygon.area and crossing < 5.0):
                carrying.update(id(other) for other in near if _carries(other, part))
            grounded = replace(part, low=0.0, levels=max(round((part.eaves - 0.6) / STOREY), 1))
            parts.append(grounded if hovers else part)
        result.append(replace(plan, parts=parts))
    # A parapet on what carries another solid would stand in that solid's wall.
    bare = Roof("flat", 0.0)
    return [
        replace(
            p, parts=[replace(s, roof=bare) if id(s) in carrying and s.roof.shape == "flat" else s for s in p.parts]
        )
        for p in result
    ]


def _carries(lower: PartPlan, upper: PartPlan) -> bool:
    """Whether a solid ends about where another, over a good share of it, begins."""
    return (
        lower.low < upper.low - 0.5
        and abs(lower.eaves - upper.low) < 2.0
        and shapely.intersection(lower.polygon, upper.polygon).area > 0.25 * lower.polygon.area
    )


def _tidy(polygon: Polygon) -> Polygon:
    """A polygon without corners that are none: a wall is one line from corner to corner, so that its bays are whole."""
    rings = []
    for ring in rings_of(polygon):
        before, after = np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0)
        base = after - before
        offset = np.abs(base[:, 0] * (ring - before)[:, 1] - base[:, 1] * (ring - before)[:, 0])
        kept = ring[offset > 0.012 * np.maximum(np.hypot(*base.T), 1e-9)]
        rings.append(kept if len(kept) >= 3 else ring)
    tidied = Polygon(rings[0], rings[1:])
    return tidied if tidied.is_valid and tidied.area > 0.0 else polygon


def _apart(plans: list[BuildingPlan], dropped: list[Dropped]) -> list[BuildingPlan]:
    """Cut solids that overlap: the taller keeps its ground, the lower gets what is left of it."""
    rows = [(p, k) for p, plan in enumerate(plans) for k in range(len(plan.parts))]
    parts = [plans[p].parts[k] for p, k in rows]
    if not parts:
        return plans
    order = sorted(range(len(parts)), key=lambda i: (-round(parts[i].top, 2), -round(parts[i].polygon.area, 2), i))
    rank = np.empty(len(parts), int)
    rank[order] = np.arange(len(parts))
    tree = shapely.STRtree([part.polygon for part in parts])
    shapes: dict[int, list[Polygon]] = {}
    for i in order:
        part = parts[i]
        shape: BaseGeometry = part.polygon
        for j in sorted(tree.query(part.polygon, predicate="intersects").tolist(), key=lambda j: int(rank[j])):
            other = parts[j]
            if rank[j] >= rank[i] or other.low > part.low + 0.1 or not shapes[j]:
                continue
            for piece in shapes[j]:
                if shapely.intersection(shape, piece).area > 0.02:
                    shape = shapely.difference(shape, piece)
        if shape is part.polygon:
            shapes[i] = [part.polygon]
            continue
        # What is left between two outlines that nearly agree are slivers; an opening takes them away.
        opened = shapely.buffer(
            shapely.buffer(shape, -0.15, join_style="mitre"), 0.15, join_style="mitre", mitre_limit=2.5
        )
        shapes[i] = polygons_of(shapely.simplify(shapely.intersection(opened, shape), 0.05), _LEAST_AREA)
    result: list[BuildingPlan] = []
    for p, plan in enumerate(plans):
        mine = [i for i, row in enumerate(rows) if row[0] == p]
        solids = [replace(parts[i], polygon=_tidy(piece)) for i in mine for piece in shapes[i]]
        if not solids:
            dropped.append(Dropped(id=plan.id, reason="lies within taller buildings"))
            continue
        result.append(replace(plan, parts=solids))
    return result
