"""The ground as people see it: streets, pavements, squares, lawns and water, draped on the terrain.

A partition: every spot belongs to one kind of surface, so nothing flickers. Only paint lies on top, two centimetres up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mapbox_earcut
import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from vico.geo.osm import OsmData, polygons_of
from vico.world.heights import HeightField
from vico.world.mesh import Material, Surface, joined
from vico.world.model import ENTITY_GREEN, ENTITY_GROUND, ENTITY_ROAD, ENTITY_WATER
from vico.worldgen.markings import Quads, road_markings
from vico.worldgen.roofs import rings_of
from vico.worldgen.streets import StreetPolygons, on_the_ground
from vico.worldgen.textures import material

Rgb = tuple[int, int, int]

_SLOPED_CELL = 8.0  # metres between the mesh's own points where the ground is not level
_FLAT_CELL = 50.0  # there only to keep triangles compact
_UNDERLAY = 0.12  # metres below: shows through nothing but the hairlines between two surfaces
_KERB = 0.22
_GRID = 0.001  # metres: overlays on a grid are robust where free ones fail on nearly coincident outlines

_GRASS = {"grass", "meadow", "village_green", "recreation_ground", "cemetery", "flowerbed", "allotments", "orchard"}
_WOODS = {"wood", "scrub", "heath", "grassland", "forest", "shrubbery", "fell"}
_PARKS = {"park", "garden", "golf_course", "dog_park", "common", "nature_reserve"}


@dataclass(frozen=True)
class _Kind:
    """How a kind of ground looks: material, metres a texture covers, tint, entity."""

    material: str
    tile: float
    tint: Rgb
    entity: int


_KINDS: dict[str, _Kind] = {
    "carriageway": _Kind("asphalt", 9.0, (255, 255, 255), ENTITY_ROAD),
    "parking": _Kind("asphalt", 9.0, (255, 250, 244), ENTITY_ROAD),
    "cycleway": _Kind("asphalt", 9.0, (255, 206, 188), ENTITY_ROAD),
    "kerb": _Kind("blank_stone", 2.4, (206, 204, 200), ENTITY_GROUND),
    "sidewalk": _Kind("paving", 4.0, (236, 236, 236), ENTITY_GROUND),
    "pedestrian": _Kind("setts", 3.2, (255, 246, 236), ENTITY_GROUND),
    "steps": _Kind("paving", 4.0, (214, 208, 200), ENTITY_GROUND),
    "path": _Kind("grit", 5.0, (255, 252, 246), ENTITY_GROUND),
    "playground": _Kind("grit", 5.0, (255, 240, 214), ENTITY_GROUND),
    "ballast": _Kind("grit", 5.0, (166, 156, 148), ENTITY_GROUND),
    "pitch": _Kind("grit", 5.0, (214, 150, 122), ENTITY_GROUND),
    "grass": _Kind("grass", 10.0, (255, 255, 255), ENTITY_GREEN),
    "woods": _Kind("grass", 10.0, (200, 206, 180), ENTITY_GREEN),
    "water": _Kind("water", 14.0, (255, 255, 255), ENTITY_WATER),
    "yard": _Kind("paving", 4.0, (204, 202, 198), ENTITY_GROUND),
    "field": _Kind("grass", 10.0, (238, 236, 214), ENTITY_GREEN),
}


def ground_from_osm(
    osm: OsmData, terrain: HeightField, half: float, streets: StreetPolygons, *, apron: float = 40.0
) -> list[Surface]:
    """Make the ground's surfaces.

    Parameters
    ----------
    osm
        The extract.
    terrain
        What the ground is draped on.
    half
        Half side of the world's square, metres.
    streets
        `streets.road_polygons` of the same extract.
    apron
        How far the ground is drawn beyond the square, metres, so that its edge is not in sight from within streets.

    Returns
    -------
    list of Surface
        One a material, for the layer "ground"; entities tell ground, road, water and green apart.
    """
    reach = half + apron
    window = shapely.box(-reach, -reach, reach, reach)
    pieces = ground_partition(osm, streets, window)
    level = terrain.heights.size == 4 or float(np.ptp(terrain.heights)) < 0.01
    cell = _FLAT_CELL if level else _SLOPED_CELL
    surfaces = [_draped(shapes, _KINDS[name], terrain, reach, cell) for name, shapes in pieces.items()]
    underlay = _draped([window], _KINDS["yard"], terrain, reach, cell, lift=-_UNDERLAY)
    rails = [
        way.line
        for way in osm.ways
        if way.tags.get("railway") in ("rail", "light_rail", "narrow_gauge") and on_the_ground(way.tags)
    ]
    quads = road_markings(streets, window, yellow=osm.frame.lon < -30.0, tracks=rails, longest=None if level else 3.0)
    return joined([*surfaces, underlay, *(_painted(group, terrain, lift=0.025 if level else 0.04) for group in quads)])


def ground_partition(osm: OsmData, streets: StreetPolygons, window: Polygon) -> dict[str, list[Polygon]]:
    """Divide the window among the kinds of ground, in order of precedence.

    Returns
    -------
    dict
        Polygons by kind (a key of the look-up table above); together they cover the window, and none overlap.
    """
    soft = mapped_areas(osm, window)
    # Lawns and ponds that lie within a square are beds in it; other greens end where the square begins.
    square: BaseGeometry = streets.pedestrian
    beds = [shape for name in ("water", "grass", "woods", "playground") for shape in soft[name]]
    inner = [
        bed
        for bed in beds
        if bed.area < 0.6 * square.area and shapely.intersection(bed, square).area > 0.9 * bed.area > 0.0
    ]
    if inner:
        square = shapely.difference(square, shapely.union_all(inner, grid_size=_GRID), grid_size=_GRID)
    paved = shapely.union_all([streets.sidewalk, square, streets.cycleway], grid_size=_GRID)
    kerb = shapely.buffer(streets.carriageway, _KERB, quad_segs=2, join_style="mitre")
    kerb = shapely.difference(shapely.set_precision(kerb, _GRID), streets.carriageway, grid_size=_GRID)
    kerb = shapely.intersection(_flat(kerb), _flat(paved), grid_size=_GRID)
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
        shape = _flat(shapely.set_precision(shape, _GRID))
        mine = polygons_of(shapely.intersection(shape, left, grid_size=_GRID), 0.02)
        if mine:
            result[name] = mine
            left = _flat(shapely.difference(left, shape, grid_size=_GRID))
    built = [area.polygon for area in osm.areas if area.tags.get("building", "no") != "no"]
    near = shapely.buffer(shapely.union_all([*built, streets.carriageway], grid_size=_GRID), 30.0, quad_segs=2)
    near = shapely.set_precision(near, _GRID)
    result["yard"] = polygons_of(shapely.intersection(left, near, grid_size=_GRID), 0.02)
    result["field"] = polygons_of(shapely.difference(left, near, grid_size=_GRID), 0.02)
    return {name: shapes for name, shapes in result.items() if shapes}


def _flat(shape: BaseGeometry) -> shapely.MultiPolygon:
    """The polygons of an overlay: where outlines touch, it gives lines and points too, and then refuses them."""
    return shapely.MultiPolygon(polygons_of(shape))


def mapped_areas(osm: OsmData, window: Polygon) -> dict[str, list[BaseGeometry]]:
    """Mapped areas by kind of ground, in order of precedence."""
    found: dict[str, list[BaseGeometry]] = {
        name: [] for name in ("water", "ballast", "playground", "pitch", "grass", "woods")
    }
    for area in osm.areas:
        tags = area.tags
        if not on_the_ground(tags) or tags.get("building", "no") != "no":
            continue
        landuse, leisure, natural = tags.get("landuse"), tags.get("leisure"), tags.get("natural")
        kind = None
        if (
            natural == "water"
            or tags.get("waterway") == "riverbank"
            or landuse in ("basin", "reservoir")
            or leisure == "swimming_pool"
            or tags.get("amenity") == "fountain"
        ):
            kind = "water"
        elif leisure == "playground" or natural in ("sand", "beach", "shingle") or tags.get("golf") == "bunker":
            kind = "playground"
        elif leisure == "pitch":
            kind = "grass" if tags.get("surface") in ("grass", "artificial_turf") else "pitch"
        elif natural in _WOODS or landuse == "forest":
            kind = "woods"
        elif landuse in _GRASS or leisure in _PARKS:
            kind = "grass"
        elif landuse == "railway":
            kind = "ballast"
        if kind:
            found[kind] += polygons_of(shapely.intersection(area.polygon, window))
    found["ballast"] += [
        shapely.buffer(shapely.LineString(way.line), 1.8, cap_style="flat")
        for way in osm.ways
        if way.tags.get("railway") in ("rail", "light_rail", "narrow_gauge") and on_the_ground(way.tags)
    ]
    # A pond within a park is water, a lawn within a wood is lawn: small before large comes with the kinds' order, but
    # the sea comes last of the waters and gives way to everything mapped on it (piers, moles).
    sea = sea_polygons(osm, window)
    if sea:
        land = shapely.union_all(
            [shape for name, shapes in found.items() if name != "water" for shape in shapes], grid_size=_GRID
        )
        found["water"].append(shapely.difference(shapely.union_all(sea), land, grid_size=_GRID))
    return found


def sea_polygons(osm: OsmData, window: Polygon) -> list[Polygon]:
    """The sea within the window: what lies to the right of the coastlines, which OSM draws with land on their left."""
    coast = [way.line for way in osm.ways if way.tags.get("natural") == "coastline"]
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


def _cut_to_cells(shapes: Sequence[BaseGeometry], reach: float, cell: float) -> list[Polygon]:
    """Cut polygons along a square grid, halving again and again so that large outlines are clipped few times."""
    count = max(int(np.ceil(2 * reach / cell)), 1)
    edges = np.linspace(-reach, reach, count + 1)
    done: list[Polygon] = []
    pending: list[tuple[Polygon, int, int, int, int]] = [
        (polygon, 0, count, 0, count) for shape in shapes for polygon in polygons_of(shape, 1e-4)
    ]
    while pending:
        polygons = np.array([row[0] for row in pending], object)
        bounds = np.array([row[1:] for row in pending])
        box = shapely.bounds(polygons)
        # Shrink each range of cells to those its polygon touches.
        bounds[:, 0] = np.maximum(bounds[:, 0], np.searchsorted(edges, box[:, 0] + 1e-9, "right") - 1)
        bounds[:, 1] = np.minimum(bounds[:, 1], np.maximum(np.searchsorted(edges, box[:, 2] - 1e-9), bounds[:, 0] + 1))
        bounds[:, 2] = np.maximum(bounds[:, 2], np.searchsorted(edges, box[:, 1] + 1e-9, "right") - 1)
        bounds[:, 3] = np.minimum(bounds[:, 3], np.maximum(np.searchsorted(edges, box[:, 3] - 1e-9), bounds[:, 2] + 1))
        wide, tall = bounds[:, 1] - bounds[:, 0], bounds[:, 3] - bounds[:, 2]
        whole = (wide <= 1) & (tall <= 1)
        done += polygons[whole].tolist()
        rest, limits = polygons[~whole], bounds[~whole]
        if not len(rest):
            break
        across = (wide >= tall)[~whole]
        low = np.where(across, limits[:, 0], limits[:, 2])
        high = np.where(across, limits[:, 1], limits[:, 3])
        middle = (low + high) // 2
        at = edges[np.clip(middle, 0, count)]
        big = 2 * reach
        first = shapely.box(
            np.full(len(rest), -big), np.full(len(rest), -big), np.where(across, at, big), np.where(across, big, at)
        )
        second = shapely.box(
            np.where(across, at, -big), np.where(across, -big, at), np.full(len(rest), big), np.full(len(rest), big)
        )
        pending = []
        for halves, side in ((shapely.intersection(rest, first), 0), (shapely.intersection(rest, second), 1)):
            for shape, limit, is_across, cut in zip(
                halves, limits.tolist(), across.tolist(), middle.tolist(), strict=True
            ):
                k = (0 if is_across else 2) + (1 - side)
                kept = [*limit[:k], cut, *limit[k + 1 :]]
                pending += [(polygon, kept[0], kept[1], kept[2], kept[3]) for polygon in polygons_of(shape, 1e-4)]
    return done


def _draped(
    shapes: Sequence[BaseGeometry], kind: _Kind, terrain: HeightField, reach: float, cell: float, *, lift: float = 0.0
) -> Surface:
    """Triangulate polygons cell by cell and lay them on the terrain."""
    points: list[NDArray[np.float64]] = []
    triangles: list[NDArray[np.int64]] = []
    count = 0
    for polygon in _cut_to_cells(shapes, reach, cell):
        rings = rings_of(polygon)
        corners = np.concatenate(rings)
        ends = np.cumsum([len(ring) for ring in rings]).astype(np.uint32)
        found = mapbox_earcut.triangulate_float64(corners, ends).reshape(-1, 3).astype(np.int64)
        if len(found):
            points.append(corners)
            triangles.append(found + count)
            count += len(corners)
    stuff = material(kind.material)
    if not points:
        return Surface.from_triangles(
            np.zeros((0, 3)), np.zeros((0, 3), np.int32), normals=np.zeros((0, 3)), material=stuff
        )
    flat = np.concatenate(points)
    faces = np.concatenate(triangles)
    ux, uy = (flat[faces[:, 1]] - flat[faces[:, 0]]).T
    vx, vy = (flat[faces[:, 2]] - flat[faces[:, 0]]).T
    turn = ux * vy - uy * vx
    faces = np.where((turn < 0)[:, None], faces[:, [0, 2, 1]], faces)[np.abs(turn) > 1e-9]
    return Surface.from_triangles(
        np.c_[flat, terrain(flat) + lift],
        faces,
        colour=kind.tint,
        entity=kind.entity,
        uv=flat / kind.tile,
        normals=terrain_normals(terrain, flat),
        material=stuff,
    )


def terrain_normals(terrain: HeightField, xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit normals of the ground at points, by central differences over a metre."""
    east, north = np.array([0.5, 0.0]), np.array([0.0, 0.5])
    dx, dy = terrain(xy + east) - terrain(xy - east), terrain(xy + north) - terrain(xy - north)
    normal = np.stack([-dx, -dy, np.ones(len(xy))], axis=1)
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True), np.float64)


def _painted(quads: Quads, terrain: HeightField, *, lift: float) -> Surface:
    """Paint and rails: quads a little above the ground."""
    corners = quads.corners.reshape(-1, 2)
    n = len(quads.corners)
    first = 4 * np.arange(n)[:, None]
    triangles = (
        np.concatenate([first + np.array([0, 1, 2]), first + np.array([0, 2, 3])]) if n else np.zeros((0, 3), np.int32)
    )
    return Surface.from_triangles(
        np.c_[corners, terrain(corners) + lift],
        triangles,
        colour=quads.colour,
        entity=ENTITY_ROAD,
        normals=terrain_normals(terrain, corners),
        material=Material("paint"),
    )
