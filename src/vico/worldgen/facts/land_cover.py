"""Land cover: what kind of ground every spot is; one kind each, decided by the map in an order of precedence."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from contextlib import nullcontext

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.osm import OsmArea, OsmData
from vico.geo.overlay import polygons_of
from vico.geo.quantities import quantity
from vico.worldgen.facts.fault_isolation import NamedShape, drop_on_failure, named_parts, overlay_named, union_named
from vico.worldgen.facts.site import SiteFacts, on_the_ground
from vico.worldgen.facts.streets import PAVINGS, StreetPolygons

_GRID = 0.001  # metres: overlays on a grid are robust where free ones fail on nearly coincident outlines
_CURB = 0.22  # width of a kerb's top stone, metres

_GRASS = {"grass", "meadow", "village_green", "recreation_ground", "cemetery", "allotments", "greenfield"}
_GARDENS = {"garden"}
_WOODS = {"wood", "scrub", "heath", "forest", "shrubbery", "fell"}
_PARKS = {"park", "golf_course", "dog_park", "common", "nature_reserve"}
_FIELDS = {"farmland", "farmyard", "orchard", "vineyard", "plant_nursery"}
_BARE = {"bare_rock", "scree", "shingle"}
_WORKS = {"construction", "brownfield", "landfill", "quarry"}
_SPORTS = {
    "tennis": "court",
    "basketball": "court",
    "netball": "court",
    "futsal": "court",
    "multi": "court",
    "volleyball": "court",
    "handball": "court",
    "skateboard": "concrete",
    "beachvolleyball": "sand",
    "soccer": "turf",
    "football": "turf",
    "american_football": "turf",
    "rugby": "turf",
    "cricket": "turf",
    "hockey": "turf",
    "field_hockey": "turf",
    "boules": "gravel",
}
_PAVED_KINDS = ("carriageway", "pedestrian", "cycleway", "sidewalk", "path", "parking")
_RAILS = ("rail", "light_rail", "narrow_gauge")
_BESIDE = 8.0  # metres from a mapped water within which the line of a stream is that water's
_BED = 2.6  # metres of ballast on each side of a track: tracks side by side share it
# Square metres: smaller pieces of ground are left out; smaller ones still at the window's edge.
_LEAST_PIECE = 0.02  # square metres of a piece within the window
_SPECK = 1e-4  # square metres of a piece at its edge


def ground_partition(site: SiteFacts, streets: StreetPolygons, window: Polygon) -> dict[str, list[Polygon]]:
    """Divide the window among the kinds of ground, in order of precedence.

    Returns
    -------
    dict
        Polygons by kind; together they cover the window, and none overlap. Where the map says what a street or square
        is paved with, the kind goes on with it: ``sidewalk:setts``.
    """
    soft = mapped_areas(site, window)
    square = _square(streets, soft)
    paved = overlay.union_all([streets.sidewalk, square, streets.cycleway], grid=_GRID)
    # Lawns have a stone where the street lies lower, pavements everywhere.
    kerb = overlay.intersection(_stones(streets.carriageway, streets), overlay.areas_of(paved), grid=_GRID)
    kerb = overlay.union(kerb, _stones(streets.sunken, streets), grid=_GRID)
    ranked: dict[str, BaseGeometry] = {
        "carriageway": streets.carriageway,
        "kerb": kerb,
        "steps": streets.steps,
        "pedestrian": square,
        "cycleway": streets.cycleway,
        "sidewalk": streets.sidewalk,
        "path": streets.path,
        "parking": streets.parking,
    }
    ranked |= {name: union_named(shapes, grid=_GRID) for name, shapes in soft.items()}
    left: BaseGeometry = window
    result: dict[str, list[Polygon]] = {}
    for name, shape in ranked.items():
        # A kind of ground that can't be laid stays a yard or a field; streets can't.
        with drop_on_failure(name) if name in soft else nullcontext():
            shape = overlay.areas_of(overlay.on_grid(shape, grid=_GRID))
            mine = pieces_in(overlay.intersection(shape, left, grid=_GRID), window)
            if mine:
                rest = overlay.areas_of(overlay.difference(left, shape, grid=_GRID))
                result |= _by_paving(name, mine, streets.paved, window) if name in _PAVED_KINDS else {name: mine}
                left = rest
    built = [NamedShape(area.id, area.polygon) for area in site.osm.areas if area.tags.get("building", "no") != "no"]
    near = union_named([*built, NamedShape("carriageway", streets.carriageway)], grid=_GRID)
    near = overlay.buffer(near, 30.0, quad_segs=2)
    near = overlay.on_grid(near, grid=_GRID)
    result["yard"] = pieces_in(overlay.intersection(left, near, grid=_GRID), window)
    result["field"] = pieces_in(overlay.difference(left, near, grid=_GRID), window)
    return {name: shapes for name, shapes in result.items() if shapes}


def _stones(road: BaseGeometry, streets: StreetPolygons) -> BaseGeometry:
    """Return the strip of kerb stones around a part of the carriageways."""
    strip = overlay.buffer(road, _CURB, quad_segs=2, join_style="mitre")
    strip = overlay.difference(overlay.on_grid(strip, grid=_GRID), streets.carriageway, grid=_GRID)
    return overlay.areas_of(strip)


def _square(streets: StreetPolygons, soft: dict[str, list[NamedShape]]) -> BaseGeometry:
    """Squares without the lawns and ponds within them, which are beds; other greens end where the square begins."""
    square: BaseGeometry = streets.pedestrian
    shapely.prepare(square)
    inner: list[NamedShape] = []
    for bed in (bed for name in ("water", "garden", "grass", "woods", "playground") for bed in soft[name]):
        with drop_on_failure(bed.id):
            if (
                bed.shape.area < 0.6 * square.area
                and square.intersects(bed.shape)
                and overlay.common_area(bed.shape, square) > 0.9 * bed.shape.area > 0.0
            ):
                inner.append(bed)
    if not inner:
        return square
    return overlay.difference(square, union_named(inner, grid=_GRID), grid=_GRID)


def water_pieces(site: SiteFacts, streets: StreetPolygons, window: Polygon) -> list[Polygon]:
    """Return the waters of `ground_partition` alone."""
    soft = mapped_areas(site, window)
    if not soft["water"]:
        return []
    water = overlay.areas_of(union_named(soft["water"], grid=_GRID))
    taken = [
        streets.carriageway,
        _square(streets, soft),
        streets.steps,
        streets.cycleway,
        streets.sidewalk,
        streets.path,
        streets.parking,
    ]
    near = overlay.union_all([overlay.intersection(overlay.areas_of(shape), water, grid=_GRID) for shape in taken])
    return pieces_in(overlay.difference(water, overlay.areas_of(near), grid=_GRID), window)


def pieces_in(shape: BaseGeometry, window: Polygon) -> list[Polygon]:
    """Return the polygons within a geometry that are large enough to be laid; at the window's edge any.

    What the edge cuts to a corner is a part of something larger: who draws the ground beyond the edge draws the rest.
    """
    return [
        part
        for part in polygons_of(shape, _SPECK)
        if part.area > _LEAST_PIECE or not shapely.contains_properly(window, part)
    ]


def _by_paving(
    kind: str, shapes: list[Polygon], paved: dict[str, shapely.MultiPolygon], window: Polygon
) -> dict[str, list[Polygon]]:
    """Part a kind's polygons by what they are paved with."""
    left: BaseGeometry = overlay.areas_of(shapely.MultiPolygon(shapes))
    parted: dict[str, list[Polygon]] = {}
    for name in dict.fromkeys(PAVINGS.values()):
        if name not in paved or left.is_empty:
            continue
        mine = pieces_in(overlay.intersection(left, paved[name], grid=_GRID), window)
        if mine:
            parted[f"{kind}:{name}"] = mine
            left = overlay.areas_of(overlay.difference(left, paved[name], grid=_GRID))
    rest = pieces_in(left, window)
    return {**({kind: rest} if rest else {}), **parted}


def _pitch_surface(tags: dict[str, str]) -> str:
    """Say what a sports pitch is covered with: turf, court, clay, sand, gravel or concrete."""
    said = tags.get("surface", "")
    known = {
        "grass": "turf",
        "artificial_turf": "turf",
        "clay": "clay",
        "sand": "sand",
        "asphalt": "court",
        "tartan": "court",
        "acrylic": "court",
        "concrete": "concrete",
        "gravel": "gravel",
        "fine_gravel": "gravel",
    }
    if said in known:
        return known[said]
    return _SPORTS.get(tags.get("sport", "").split(";")[0], "gravel" if not tags.get("sport") else "court")


def _kind_of(tags: dict[str, str]) -> str | None:
    """Return the kind of ground an area's tags mean."""
    landuse, leisure, natural = tags.get("landuse"), tags.get("leisure"), tags.get("natural")
    if (
        natural == "water"
        or tags.get("waterway") in ("riverbank", "dock")
        or landuse in ("basin", "reservoir")
        or leisure == "swimming_pool"
        or tags.get("amenity") == "fountain"
    ):
        return "water"
    if leisure == "playground":
        return "playground"
    if natural in ("sand", "beach", "dune") or tags.get("golf") == "bunker":
        return "sand"
    if leisure in ("pitch", "track"):
        return _pitch_surface(tags)
    if natural in _BARE or landuse == "railway":
        return "ballast"
    if natural in _WOODS or landuse == "forest":
        return "woods"
    if leisure in _GARDENS or landuse == "flowerbed":
        return "garden"
    if landuse in _GRASS or leisure in _PARKS or natural in ("grassland", "wetland"):
        return "grass"
    if landuse in _FIELDS:
        return "farmland"
    return "earth" if landuse in _WORKS else None


def mapped_areas(site: SiteFacts, window: Polygon) -> dict[str, list[NamedShape]]:
    """Return mapped areas by kind of ground, in order of precedence, under the ids of what maps them."""
    osm, above = site.osm, site.levels.above
    order = ("water", "ballast", "playground", "court", "clay", "turf", "concrete", "sand", "gravel", "garden")
    found: dict[str, list[NamedShape]] = {name: [] for name in (*order, "grass", "woods", "farmland", "earth")}
    for area in osm.areas:
        tags = area.tags
        if not on_the_ground(tags) or tags.get("building", "no") != "no":
            continue
        kind = _kind_of(tags)
        if kind:
            with drop_on_failure(area.id):
                found[kind] += named_parts(area.id, polygons_of(overlay.intersection(area.polygon, window)))
    for way in osm.ways:
        if way.tags.get("railway") in _RAILS and on_the_ground(way.tags) and way.id not in above:
            with drop_on_failure(f"w{way.id}"):
                strip = overlay.buffer(shapely.LineString(way.line), _BED, cap_style="flat")
                found["ballast"].append(NamedShape(f"w{way.id}", strip))
    found["water"] += _streams(osm, window)
    # A pond within a park is water, a lawn within a wood is lawn: small before large comes with the kinds' order, but
    # the sea comes last of the waters and gives way to everything mapped on it (piers, moles).
    sea: list[Polygon] = []
    with drop_on_failure("sea"):
        if osm.sea is None:
            sea = sea_polygons(osm, window)
        else:
            sea = [part for whole in osm.sea for part in polygons_of(overlay.intersection(whole, window))]
    if sea:
        land = union_named([shape for name, shapes in found.items() if name != "water" for shape in shapes], grid=_GRID)
        with drop_on_failure("sea"):
            found["water"].append(NamedShape("sea", overlay.difference(overlay.union_all(sea), land, grid=_GRID)))
    return found


def water_of_map(osm: OsmData, window: Polygon) -> list[NamedShape]:
    """Return all that is mapped as water in a window, the sea with everything that is mapped on it."""
    found: list[NamedShape] = []
    for area in osm.areas:
        if _is_water(area):
            with drop_on_failure(area.id):
                found += named_parts(area.id, polygons_of(overlay.intersection(area.polygon, window)))
    found += _streams(osm, window)
    with drop_on_failure("sea"):
        sea = sea_polygons(osm, window) if osm.sea is None else osm.sea
        found += named_parts(
            "sea", [part for whole in sea for part in polygons_of(overlay.intersection(whole, window))]
        )
    return found


def _is_water(area: OsmArea) -> bool:
    tags = area.tags
    return _kind_of(tags) == "water" and on_the_ground(tags) and tags.get("building", "no") == "no"


def _streams(osm: OsmData, window: Polygon) -> list[NamedShape]:
    """Rivers, canals and streams where they are drawn as lines only.

    Where a line runs through a mapped water or close beside it, it is that water. Decided stretch by stretch: what lies
    far away has no say, so that parts of a map agree on what they share.
    """
    usual = {"river": 8.0, "canal": 8.0, "stream": 1.6, "drain": 1.0, "ditch": 0.8}
    ways = [
        way
        for way in osm.ways
        if way.tags.get("waterway") in usual and way.tags.get("tunnel", "no") == "no" and on_the_ground(way.tags)
    ]
    lines = np.array([shapely.LineString(way.line) for way in ways], object)
    tree = shapely.STRtree(lines)
    mapped = [
        NamedShape(area.id, area.polygon)
        for area in osm.areas
        if _is_water(area) and len(tree.query(area.polygon, predicate="dwithin", distance=_BESIDE))
    ]
    known = union_named(overlay_named(mapped, lambda shapes: overlay.buffer(shapes, _BESIDE, quad_segs=2)))
    found: list[NamedShape] = []
    for k in np.sort(tree.query(window, predicate="intersects")).tolist():
        way, line = ways[k], lines[k]
        with drop_on_failure(f"w{way.id}"):
            stretch = line
            if known.intersects(line):
                # Up to the mapped water, which may begin a little later than the line leaves what is close to it.
                parts = shapely.get_parts(overlay.difference(line, known))
                apart = shapely.MultiLineString([part for part in parts if part.length > _BESIDE])
                stretch = overlay.intersection(overlay.buffer(apart, 1.5 * _BESIDE), line)
            width = min(max(quantity(way.tags, "width") or usual[way.tags["waterway"]], 0.6), 60.0)
            strip = overlay.buffer(stretch, width / 2, cap_style="flat", quad_segs=2)
            found += named_parts(f"w{way.id}", polygons_of(overlay.intersection(strip, window)))
    return found


def sea_polygons(osm: OsmData, window: Polygon) -> list[Polygon]:
    """Find the sea within the window: what lies right of the coastlines, which OSM draws with land on their left.

    A coastline that ends within goes straight on to the nearest edge.
    """
    coast: list[NDArray[np.float64]] = [way.line for way in osm.ways if way.tags.get("natural") == "coastline"]
    touching = [line for line in map(shapely.LineString, coast) if shapely.intersects(line, window)]
    if not touching:
        return []
    faces = [
        face
        for face in overlay.polygonize([*touching, *_to_edge(touching, window), window.exterior])
        if overlay.common_area(face, window) > 1.0 and window.contains(face.representative_point())
    ]
    starts = np.concatenate([line[:-1] for line in coast])
    ends = np.concatenate([line[1:] for line in coast])
    sea: list[Polygon] = []
    for face in faces:
        point = np.asarray(face.representative_point().coords[0])
        along = ends - starts
        share = np.clip(((point - starts) * along).sum(1) / np.maximum((along**2).sum(1), 1e-9), 0, 1)
        away = point - (starts + along * share[:, None])
        distance = np.hypot(*away.T)
        # Beside a convex corner two segments are equally near; the one the point is most square to decides.
        near = np.flatnonzero(distance < distance.min() + 1e-6)
        cross = along[near, 0] * away[near, 1] - along[near, 1] * away[near, 0]
        cross = cross / np.maximum(np.hypot(*along[near].T), 1e-9)
        if cross[np.abs(cross).argmax()] < 0:
            sea.append(face)
    return sea


def sea_of_map(osm: OsmData, window: Polygon) -> list[Polygon]:
    """Find the sea in a window that may be larger than the map: from the edge of what it covers it goes straight on."""
    if osm.covered is None:
        return sea_polygons(osm, window)
    known = shapely.clip_by_rect(window, *osm.covered)
    if known.is_empty:
        return []
    sea = sea_polygons(osm, known)
    low, high, far = np.array(known.bounds[:2]), np.array(known.bounds[2:]), np.array(window.bounds).reshape(2, 2)
    for axis in (0, 1):  # eastwards and westwards, then what that made as well northwards and southwards
        for edge, beyond in ((low, far[0]), (high, far[1])):
            side = np.array([low, high]) if axis == 0 else np.array([[far[0, 0], low[1]], [far[1, 0], high[1]]])
            side[:, axis] = edge[axis]
            for part in shapely.get_parts(overlay.intersection(overlay.union_all(sea), shapely.LineString(side))):
                if part.length > 0.0 and edge[axis] != beyond[axis]:
                    box = np.array(part.bounds).reshape(2, 2)
                    box[:, axis] = sorted((edge[axis], beyond[axis]))
                    sea.append(shapely.box(*box.ravel()))
    return sea


def _to_edge(lines: Sequence[shapely.LineString], window: Polygon) -> list[shapely.LineString]:
    """Return straight lines from where lines end within a window to its nearest edge."""
    ends = Counter(tuple(point) for line in lines for point in (line.coords[0], line.coords[-1]))
    alone = [shapely.Point(end) for end, times in ends.items() if times == 1]
    return [shapely.shortest_line(end, window.exterior) for end in alone if window.contains(end)]
