"""What kind of ground every spot is: one kind each, decided by the map in an order of precedence."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from vico.geo.osm import OsmData, polygons_of
from vico.worldgen.streets.levels import overpasses
from vico.worldgen.streets.streets import PAVINGS, StreetPolygons, number, on_the_ground

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


def ground_partition(osm: OsmData, streets: StreetPolygons, window: Polygon) -> dict[str, list[Polygon]]:
    """Divide the window among the kinds of ground, in order of precedence.

    Returns
    -------
    dict
        Polygons by kind; together they cover the window, and none overlap. Where the map says what a street or square
        is paved with, the kind goes on with it: ``sidewalk:setts``.
    """
    soft = mapped_areas(osm, window)
    square = _square(streets, soft)
    paved = shapely.union_all([streets.sidewalk, square, streets.cycleway], grid_size=_GRID)
    kerb = shapely.buffer(streets.carriageway, _CURB, quad_segs=2, join_style="mitre")
    kerb = shapely.difference(shapely.set_precision(kerb, _GRID), streets.carriageway, grid_size=_GRID)
    kerb = shapely.intersection(flat(kerb), flat(paved), grid_size=_GRID)
    ranked: list[tuple[str, BaseGeometry]] = [
        ("carriageway", streets.carriageway),
        ("kerb", kerb),
        ("steps", streets.steps),
        ("pedestrian", square),
        ("cycleway", streets.cycleway),
        ("sidewalk", streets.sidewalk),
        ("path", streets.path),
        ("parking", streets.parking),
    ]
    ranked += [(name, shapely.union_all(shapes, grid_size=_GRID)) for name, shapes in soft.items()]
    left: BaseGeometry = window
    result: dict[str, list[Polygon]] = {}
    for name, shape in ranked:
        shape = flat(shapely.set_precision(shape, _GRID))
        mine = polygons_of(shapely.intersection(shape, left, grid_size=_GRID), 0.02)
        if mine:
            result |= _by_paving(name, mine, streets.paved) if name in _PAVED_KINDS else {name: mine}
            left = flat(shapely.difference(left, shape, grid_size=_GRID))
    built = [area.polygon for area in osm.areas if area.tags.get("building", "no") != "no"]
    near = shapely.buffer(shapely.union_all([*built, streets.carriageway], grid_size=_GRID), 30.0, quad_segs=2)
    near = shapely.set_precision(near, _GRID)
    result["yard"] = polygons_of(shapely.intersection(left, near, grid_size=_GRID), 0.02)
    result["field"] = polygons_of(shapely.difference(left, near, grid_size=_GRID), 0.02)
    return {name: shapes for name, shapes in result.items() if shapes}


def _square(streets: StreetPolygons, soft: dict[str, list[BaseGeometry]]) -> BaseGeometry:
    """Squares without the lawns and ponds within them, which are beds; other greens end where the square begins."""
    square: BaseGeometry = streets.pedestrian
    shapely.prepare(square)
    inner = [
        bed
        for name in ("water", "garden", "grass", "woods", "playground")
        for bed in soft[name]
        if bed.area < 0.6 * square.area
        and square.intersects(bed)
        and shapely.intersection(bed, square).area > 0.9 * bed.area > 0.0
    ]
    if not inner:
        return square
    return shapely.difference(square, shapely.union_all(inner, grid_size=_GRID), grid_size=_GRID)


def water_pieces(osm: OsmData, streets: StreetPolygons, window: Polygon) -> list[Polygon]:
    """The waters of `ground_partition` alone."""
    soft = mapped_areas(osm, window)
    if not soft["water"]:
        return []
    water = flat(shapely.union_all(soft["water"], grid_size=_GRID))
    taken = [
        streets.carriageway,
        _square(streets, soft),
        streets.steps,
        streets.cycleway,
        streets.sidewalk,
        streets.path,
        streets.parking,
    ]
    near = shapely.union_all([shapely.intersection(flat(shape), water, grid_size=_GRID) for shape in taken])
    return polygons_of(shapely.difference(water, flat(near), grid_size=_GRID), 0.02)


def _by_paving(kind: str, shapes: list[Polygon], paved: dict[str, shapely.MultiPolygon]) -> dict[str, list[Polygon]]:
    """Part a kind's polygons by what they are paved with."""
    left: BaseGeometry = flat(shapely.MultiPolygon(shapes))
    parted: dict[str, list[Polygon]] = {}
    for name in dict.fromkeys(PAVINGS.values()):
        if name not in paved or left.is_empty:
            continue
        mine = polygons_of(shapely.intersection(left, paved[name], grid_size=_GRID), 0.02)
        if mine:
            parted[f"{kind}:{name}"] = mine
            left = flat(shapely.difference(left, paved[name], grid_size=_GRID))
    rest = polygons_of(left, 0.02)
    return {**({kind: rest} if rest else {}), **parted}


def flat(shape: BaseGeometry) -> shapely.MultiPolygon:
    """The polygons of an overlay: where outlines touch, it gives lines and points too, and then refuses them."""
    return shapely.MultiPolygon(polygons_of(shape))


def pitch_surface(tags: dict[str, str]) -> str:
    """What a sports pitch is covered with: turf, court, clay, sand, gravel or concrete."""
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
    """The kind of ground an area's tags mean."""
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
        return pitch_surface(tags)
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


def mapped_areas(osm: OsmData, window: Polygon) -> dict[str, list[BaseGeometry]]:
    """Mapped areas by kind of ground, in order of precedence."""
    order = ("water", "ballast", "playground", "court", "clay", "turf", "concrete", "sand", "gravel", "garden")
    found: dict[str, list[BaseGeometry]] = {name: [] for name in (*order, "grass", "woods", "farmland", "earth")}
    for area in osm.areas:
        tags = area.tags
        if not on_the_ground(tags) or tags.get("building", "no") != "no":
            continue
        kind = _kind_of(tags)
        if kind:
            found[kind] += polygons_of(shapely.intersection(area.polygon, window))
    above = overpasses(osm)
    found["ballast"] += [
        shapely.buffer(shapely.LineString(way.line), 1.8, cap_style="flat")
        for way in osm.ways
        if way.tags.get("railway") in _RAILS and on_the_ground(way.tags) and way.id not in above
    ]
    found["water"] += list(_streams(osm, window, found["water"]))
    # A pond within a park is water, a lawn within a wood is lawn: small before large comes with the kinds' order, but
    # the sea comes last of the waters and gives way to everything mapped on it (piers, moles).
    sea = sea_polygons(osm, window)
    if sea:
        land = shapely.union_all(
            [shape for name, shapes in found.items() if name != "water" for shape in shapes], grid_size=_GRID
        )
        found["water"].append(shapely.difference(shapely.union_all(sea), land, grid_size=_GRID))
    return found


def _streams(osm: OsmData, window: Polygon, mapped: list[BaseGeometry]) -> Iterable[Polygon]:
    """Rivers, canals and streams that are drawn as lines only."""
    usual = {"river": 8.0, "canal": 8.0, "stream": 1.6, "drain": 1.0, "ditch": 0.8}
    known = shapely.union_all([shape for shape in mapped if isinstance(shape, BaseGeometry)], grid_size=_GRID)
    for way in osm.ways:
        tags = way.tags
        if tags.get("waterway") not in usual or tags.get("tunnel", "no") != "no" or not on_the_ground(tags):
            continue
        line = shapely.LineString(way.line)
        if known.intersects(line) and shapely.intersection(known, line).length > 0.3 * line.length:
            continue
        width = min(max(number(tags.get("width")) or usual[tags["waterway"]], 0.6), 60.0)
        strip = shapely.buffer(line, width / 2, cap_style="flat", quad_segs=2)
        yield from polygons_of(shapely.intersection(strip, window))


def sea_polygons(osm: OsmData, window: Polygon) -> list[Polygon]:
    """The sea within the window: what lies to the right of the coastlines, which OSM draws with land on their left."""
    coast: list[NDArray[np.float64]] = [way.line for way in osm.ways if way.tags.get("natural") == "coastline"]
    lines = [shapely.LineString(line) for line in coast]
    touching = [line for line in lines if shapely.intersects(line, window)]
    if not touching:
        return []
    edges = shapely.node(shapely.union_all([*touching, window.exterior]))
    faces = [
        face
        for face in shapely.get_parts(shapely.polygonize(shapely.get_parts(edges)))
        if shapely.intersection(face, window).area > 1.0 and window.contains(face.representative_point())
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
