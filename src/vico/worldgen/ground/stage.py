"""The ground as people see it: streets, pavements, squares, lawns and water, draped on the terrain.

A partition: every spot belongs to one kind of surface, so nothing flickers. Only paint lies on top, two centimetres
up. Where two kinds meet at different heights an upright face closes the step: kerbs, quays, the edges of bridges. Into
the paving go ribbed fields before crossings, and pits of bare earth in which trees stand.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy import ndimage
from shapely import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.osm import OsmData
from vico.geo.overlay import polygons_of
from vico.geometry import distance
from vico.world.heights import HeightField
from vico.world.mesh import Material, Surface, merge_surfaces, quad_triangles
from vico.world.model import ENTITY_GROUND, ENTITY_ROAD
from vico.worldgen.facts.fault_isolation import NamedShape, drop_on_failure, named_parts, overlay_named, union_named
from vico.worldgen.facts.land_cover import ground_partition, mapped_areas, pieces_in
from vico.worldgen.facts.site import SiteFacts, on_the_ground
from vico.worldgen.facts.street_habits import street_habits
from vico.worldgen.facts.streets import StreetPolygons
from vico.worldgen.ground.bridges import spans_over_water
from vico.worldgen.ground.decimation import decimate_mesh
from vico.worldgen.ground.grade_separation import Bridges
from vico.worldgen.ground.grading import is_level
from vico.worldgen.ground.kerbs_and_banks import RAMP, Water, lowered_kerbs, open_water, piped_waters
from vico.worldgen.ground.markings import Quads, clip_quads, pitch_lines, road_markings
from vico.worldgen.ground.mesh import (
    CLOSE,
    NEAR,
    ROUGH,
    Grid,
    Heights,
    PlanMesh,
    border_chains,
    conforming_mesh,
    curtain,
    curtain_surface,
    lowered_heights,
    oriented_outlines,
    split_by_area,
    triangulate,
)
from vico.worldgen.ground.pavings import LOOKS, GroundStyle, ground_material, look_of, vertex_colours
from vico.worldgen.ground.polygons import region_above
from vico.worldgen.ground.stairs import Flights
from vico.worldgen.ground.yards import Yards

_FROM_KERB = 0.25  # metres from the kerb to ribbed slabs
_DEEP = 0.6  # metres on from there
_WIDEST = 3.0
_LEAST = 0.25  # square metres of a field worth laying


def street_bearing(streets: StreetPolygons) -> float:
    """Return the direction that most of the streets have, or are square to, radians from east within 45 degrees."""
    turn = 0j
    for street in streets.streets:
        steps = np.diff(street.line, axis=0)
        along = steps[:, 0] + 1j * steps[:, 1]
        length = np.abs(along)
        keep = length > 1e-6
        turn += complex((length[keep] * (along[keep] / length[keep]) ** 4).sum())
    return round(float(np.angle(turn)) / 4.0, 3) if abs(turn) > 1e-6 else 0.0


def tactile_fields(streets: StreetPolygons, window: Polygon) -> list[Polygon]:
    """Lay out ribbed fields at both ends of painted crossings: along the kerb, on the pavement, none over another."""
    pavement = overlay.union_all([streets.sidewalk, streets.pedestrian])
    shapely.prepare(pavement)
    found: list[BaseGeometry] = []
    for crossing in streets.crossings:
        if crossing.painted:
            with drop_on_failure(crossing.id):
                a, b = np.array(crossing.start), np.array(crossing.end)
                along = (b - a) / max(distance(b, a), 1e-9)
                reach = _FROM_KERB + _DEEP
                strips: list[BaseGeometry] = []
                for end, out in ((a, -along), (b, along)):
                    if not shapely.intersects_xy(pavement, *(end + out * (_FROM_KERB + _DEEP / 2))):
                        continue
                    # Slanting crossings meet the kerb before or behind their end.
                    middle = LineString([end - out * 1.5, end + out * 2.0])
                    strip = overlay.buffer(middle, min(crossing.width, _WIDEST) / 2, cap_style="flat")
                    x, y = end
                    road = shapely.clip_by_rect(streets.carriageway, x - 6.0, y - 6.0, x + 6.0, y + 6.0)
                    band = overlay.difference(
                        overlay.buffer(road, reach, quad_segs=3), overlay.buffer(road, _FROM_KERB, quad_segs=3)
                    )
                    field = overlay.areas_of(overlay.intersection(overlay.intersection(strip, band), pavement))
                    strips += [part for part in shapely.get_parts(field) if part.area > _LEAST]
                found += strips
    inside = [shape for shape in found if window.contains(shape)]
    return polygons_of(overlay.union_all(inside, grid=0.001), _LEAST) if inside else []


_KINDS_WITH_PITS = ("sidewalk", "pedestrian", "yard", "parking")
_FRAME = 1.7  # metres, outer side of a pit's frame
_EARTH = 1.4  # metres, outer side of its earth
_WHOLE = 0.98  # share of a pit's frame on paving
_STONE_COLOUR, _EARTH_COLOUR = (150, 147, 141), (86, 72, 56)


def tree_pits(trees: NDArray[np.float64], pieces: Mapping[str, Sequence[Polygon]], bearing: float) -> list[Quads]:
    """Lay out pits around the trees that stand on paving.

    Parameters
    ----------
    trees
        Their places, metres, shape ``(n, 2)``.
    pieces
        `ground_partition` of the map: a pit lies on paving as a whole, or there is none.
    bearing
        Direction of the paving, radians from east.
    """
    paved = [shape for name, shapes in pieces.items() if name.partition(":")[0] in _KINDS_WITH_PITS for shape in shapes]
    if not len(trees) or not paved:
        return []
    c, s = np.cos(bearing), np.sin(bearing)
    square = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]) @ np.array([[c, s], [-s, c]])
    frames = trees[:, None, :] + square * _FRAME
    squares = shapely.polygons(frames)
    covered = np.zeros(len(trees))
    for own, under in shapely.STRtree(paved).query(squares, predicate="intersects").T.tolist():
        covered[own] += overlay.common_area(squares[own], paved[under])
    kept = np.flatnonzero(covered > _WHOLE * _FRAME**2)
    if not len(kept):
        return []
    earth = trees[kept][:, None, :] + square * _EARTH
    return [
        Quads(frames[kept], _STONE_COLOUR, low=False, rank=0),
        Quads(earth, _EARTH_COLOUR, low=False, rank=1),
    ]


#: Metres of ground beyond the square of a world by itself: its edge is not in sight from within streets.
GROUND_APRON = 40.0
# Metres below: shows through nothing but the hairlines between two surfaces. Well below carriageways, too: it lies at
# another depth in a tile whose ground is not level.
_UNDERLAY, _UNDERLAY_SLOPED = 0.6, 3.0
_UNDER_STAIRS = 0.3
_LIFT = 0.02  # metres of paint above the ground
_LIFT_SLOPED = 0.035  # and where it slopes
_STEEP = 1.08  # slope from which bare ground is held by a wall
_SLOPING = 0.17  # ... and from which a yard is not paved
_SLOPE_CELL = 2.0
_SLOPE_MARGIN = 16.0
_NARROW = 0.8  # metres, half the width of the narrowest lawn on a hillside
_SLAB = 0.6  # thickness of a bridge's edge over water
_AT_EDGE = 0.06  # metres within which two outlines are the same edge
_OVERHANG = 6.0  # metres beside the ways of bridges where water that is hidden goes on
_SHOWN = 2.0  # metres along the window's sides where ground within buildings is drawn, too
_NO_TREES = np.zeros((0, 2))
_HELD = ("yard", "field", "grass", "garden", "woods", "sidewalk", "pedestrian", "path", "parking")
_BEFORE_CROSSINGS = ("sidewalk", "pedestrian")
_PAVED_KINDS = ("kerb", "tactile", "steps", "pedestrian", "cycleway", "sidewalk", "path", "parking")


def ground_from_osm(
    site: SiteFacts,
    terrain: HeightField,
    streets: StreetPolygons,
    bridges: Bridges,
    flights: Flights,
    yards: Yards,
    *,
    standing: Sequence[BaseGeometry] = (),
    trees: NDArray[np.float64] = _NO_TREES,
) -> list[Surface]:
    """Make the ground's surfaces.

    Parameters
    ----------
    site
        The map and its facts.
    terrain
        What the ground is draped on, as `graded` made it from the same streets.
    streets
        `road_polygons` of the same map.
    bridges
        `bridges_of` the same streets and terrain.
    flights
        `flights_of` the same streets and terrain.
    yards
        `yards_of` the same map: which of the open ground is not paved. The square they were decided in is drawn.
    standing
        Footprints of the buildings as they were built, where they stand on the ground: nobody sees what lies well
        within them, and it is not drawn.
    trees
        Where trees stand, metres, shape ``(n, 2)``: those on paving have pits.

    Returns
    -------
    list of Surface
        One a material, for the layer "ground"; entities tell ground, road, water and green apart.
    """
    osm = site.osm
    reach = yards.reach
    window = shapely.box(-reach, -reach, reach, reach)
    habits = street_habits(osm)
    bearing = street_bearing(streets)

    def look(kind: str) -> GroundStyle:
        return look_of(kind, habits.pavings, bearing)

    pieces, holes = ground_partition(site, streets, window), overlay.union_all(bridges.cuts)
    if bridges.cuts:
        pieces = {name: _without(shapes, holes, window) for name, shapes in pieces.items()}
    level = is_level(terrain)
    if terrain.steps is not None:
        pieces = _with_tactile(pieces, tactile_fields(streets, window), window)
    waters = open_water(site, terrain, pieces.get("water", [])) if terrain.steps is not None else []
    # Along the window's sides all is drawn: the tile beyond may know of other walls.
    hidden = overlay.intersection(
        _ground_under_buildings(osm, standing), overlay.buffer(window, -_SHOWN, join_style="mitre")
    )
    laid = _ground_pieces(pieces, terrain, waters, reach, hidden=hidden, stairs=flights.area, look=look, yards=yards)
    wet = overlay.union_all([water.polygon for water in waters])
    exact: list[BaseGeometry] = [
        shape for name, shapes in pieces.items() if name.partition(":")[0] in _PAVED_KINDS for shape in shapes
    ]
    grid = Grid.of(terrain, reach, NEAR, exact=exact, free=[wet, flights.area])
    street_grid = Grid.of(terrain, reach, np.inf, sunken=[streets.carriageway])
    # Streets at the lower heights by themselves, what lies at the upper ones in one go.
    cut = {
        number: shapes
        for own, low in ((street_grid, True), (grid, False))
        for chosen in [[k for k, piece in enumerate(laid) if piece.carriageway == low]]
        for number, shapes in zip(chosen, own.cut_each([laid[k].shapes for k in chosen]), strict=True)
    }
    parts = [triangulate(cut[number]) for number in range(len(laid))]
    plan = _decimated_plan(conforming_mesh(parts, _ends_of_kerbs(streets)), laid, terrain)
    surfaces = [
        _draped_surface(plan, number, piece, terrain)
        for number, piece in enumerate(laid)
        if (plan.piece == number).any()
    ]
    under = _under_bridges(site, wet, window) if waters else []
    dry = overlay.difference(window, overlay.buffer(overlay.union_all([wet, *under]), 0.6, quad_segs=1))
    dry = overlay.difference(dry, holes) if bridges.cuts else dry
    surfaces += _underlay(dry, terrain, reach)
    if terrain.steps is not None:
        surfaces += _kerbs(plan, laid, streets, terrain, reach, look("kerb"))
        surfaces += _banks(under, waters, plan, laid, terrain, window)
    surfaces += flights.surfaces()
    surfaces += bridges.surfaces(site, terrain, streets, window)
    quads = road_markings(
        streets,
        window,
        habits=habits.markings,
        tracks=_tracks(site),
        longest=None if level else 3.0,
        left_driving=site.left_driving,
        stepped=flights.area,
    )
    quads += _field_lines(osm, window)
    quads += tree_pits(trees, {**pieces, "yard": _without(pieces.get("yard", []), yards.green(), window)}, bearing)
    lift = _LIFT if level else _LIFT_SLOPED
    surfaces += [_paint_surface(group, terrain, lift=lift + 0.006 * group.rank) for group in quads]
    return merge_surfaces(surfaces)


def _decimated_plan(plan: PlanMesh, laid: Sequence[_Piece], terrain: HeightField) -> PlanMesh:
    """Leave out what the drawn ground doesn't need."""
    used = np.array([0 if piece.carriageway else 2 if piece.water >= 0 else 1 for piece in laid], np.int64)
    natural = np.array([piece.natural for piece in laid], bool)
    level: Heights = lambda xy: np.zeros(len(xy))  # noqa: E731
    return decimate_mesh(plan, (terrain.lower, terrain.upper, level), used, np.where(natural, NEAR, CLOSE))


@dataclass(frozen=True)
class _Piece:
    """Polygons of one look at heights of their own; `water` is the number of the water they are."""

    shapes: list[Polygon]
    look: GroundStyle
    heights: Heights
    carriageway: bool = False
    water: int = -1
    natural: bool = False


def _ground_pieces(
    pieces: dict[str, list[Polygon]],
    terrain: HeightField,
    waters: Sequence[Water],
    reach: float,
    *,
    hidden: BaseGeometry,
    stairs: BaseGeometry,
    look: Callable[[str], GroundStyle],
    yards: Yards,
) -> list[_Piece]:
    """Lay the pieces of the ground: the partition, walls where it is too steep to be bare, no paving on hillsides."""
    window = shapely.box(-reach, -reach, reach, reach)
    steep, sloping = _slopes(terrain, reach)
    laid: list[_Piece] = []
    walls: list[Polygon] = []
    hills: list[Polygon] = []
    open_ground: dict[str, list[Polygon]] = {}
    for name, shapes in pieces.items():
        base = name.partition(":")[0]
        if base in ("yard", "field"):
            shapes = _without(shapes, hidden, window)
        if name == "water" and waters:
            continue
        if base in _HELD and not steep.is_empty:
            walls += _within(shapes, steep, window)
            shapes = _without(shapes, steep, window)
        if name == "yard" and not sloping.is_empty:
            # A strip too narrow for a lawn stays as it is.
            wide = [shape for shape in _within(shapes, sloping, window) if not overlay.buffer(shape, -_NARROW).is_empty]
            hills += wide
            shapes = _without(shapes, shapely.MultiPolygon(wide), window)
        for kind, region in yards.by_look().items() if name in ("yard", "field") else ():
            open_ground.setdefault(kind, []).extend(_within(shapes, region, window))
            shapes = _without(shapes, region, window)
        if name == "steps":
            lower = _within(shapes, stairs, window)
            shapes = _without(shapes, stairs, window)
            laid.append(_Piece(lower, look(name), lambda xy: terrain.upper(xy) - _UNDER_STAIRS))
        street = base == "carriageway"
        natural = not street and base not in _PAVED_KINDS
        laid.append(_Piece(shapes, look(name), terrain.lower if street else terrain.upper, street, natural=natural))
    laid += [_Piece(shapes, LOOKS[kind], terrain.upper, natural=True) for kind, shapes in open_ground.items()]
    laid.append(_Piece(hills, LOOKS["field"], terrain.upper, natural=True))
    laid.append(_Piece(walls, LOOKS["wall"], terrain.upper, natural=True))
    laid += [_Piece([water.polygon], LOOKS["water"], water.level, water=k) for k, water in enumerate(waters)]
    return laid


def _slopes(terrain: HeightField, reach: float) -> tuple[BaseGeometry, BaseGeometry]:
    """Where the ground is too steep to be bare, and where it is too steep to be paved: regions with round borders."""
    none = shapely.MultiPolygon()
    if is_level(terrain):
        return none, none
    # A little further than is drawn: what lies beyond decides how steep the edge is, and a tile's neighbour knows it.
    reach = min(reach + _SLOPE_MARGIN, terrain.half)
    n = round(2 * reach / _SLOPE_CELL)
    cell = 2 * reach / n
    axis = (np.arange(n) + 0.5) * cell - reach
    z = terrain.smooth(np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2)).reshape(n, n)
    found = []
    for spread, most, close in ((0.3, _STEEP, 1.2), (2.0, _SLOPING, 4.0)):
        north, east = np.gradient(ndimage.gaussian_filter(z, spread, mode="nearest"), cell)
        bent = overlay.simplify(region_above(np.hypot(north, east), most, low=float(axis[0]), cell=cell), 0.1)
        opened = overlay.buffer(overlay.buffer(bent, close, quad_segs=3), -2 * close, quad_segs=3)
        rounded = overlay.simplify(overlay.buffer(opened, close, quad_segs=3), 0.15)
        found.append(overlay.on_grid(rounded, grid=0.001))
    steep, sloping = found
    return steep, sloping


def _ends_of_kerbs(streets: StreetPolygons) -> NDArray[np.float64]:
    """Points of kerbs where they begin to come down to a crossing, and where they are down, shape ``(n, 2)``."""
    lowered = lowered_kerbs(streets.crossings)
    outline = shapely.boundary(streets.carriageway)
    found = [
        overlay.intersection(shapely.boundary(overlay.buffer(lowered, away, quad_segs=6)), outline)
        for away in (0.05, RAMP)
    ]
    points = shapely.get_parts(shapely.get_parts(found))
    return shapely.get_coordinates(points[shapely.get_type_id(points) == 0])


def _underlay(dry: BaseGeometry, terrain: HeightField, reach: float) -> list[Surface]:
    """Make what shows through hairlines between surfaces instead of the sky."""
    below = _UNDERLAY if is_level(terrain) else _UNDERLAY_SLOPED
    flat, faces = triangulate(Grid.of(terrain, reach, ROUGH).cut([dry]))
    if not len(faces):
        return []
    return [_surface(flat, terrain.smooth(flat) - below, terrain_normals(terrain, flat), faces, LOOKS["yard"])]


def _ground_under_buildings(osm: OsmData, standing: Sequence[BaseGeometry]) -> BaseGeometry:
    """Ground well within buildings, which nobody sees."""
    if not len(standing):
        return shapely.MultiPolygon()
    built = [
        NamedShape(area.id, area.polygon)
        for area in osm.areas
        if area.tags.get("building", "no") not in ("no", "roof", "carport", "bridge", "ruins", "construction")
        and not any(key in area.tags for key in ("min_height", "building:min_level"))
        and on_the_ground(area.tags)
    ]
    deep = overlay_named(built, lambda shapes: overlay.buffer(shapes, -1.5, join_style="mitre"))
    mapped = union_named([one for one in deep if not one.shape.is_empty], grid=0.01)
    # Not every building of the map is built whole, or at all: people walk on what is left of its ground.
    whole = union_named(overlay_named(named_parts("buildings", standing), overlay.make_valid), grid=0.01)
    both = overlay.intersection(mapped, overlay.buffer(whole, -1.5, join_style="mitre"), grid=0.01)
    return shapely.MultiPolygon(polygons_of(both))


def _tracks(site: SiteFacts) -> list[NDArray[np.float64]]:
    """Railways at ground level, cut where a street's bridge lies over them."""
    osm, above = site.osm, site.levels.above
    spans = spans_over_water(site)
    found: list[NDArray[np.float64]] = []
    for way in osm.ways:
        tags = way.tags
        if tags.get("railway") not in ("rail", "light_rail", "narrow_gauge") or not on_the_ground(tags):
            continue
        if way.id in above:
            continue
        line: BaseGeometry = shapely.LineString(way.line)
        with drop_on_failure(f"w{way.id}"):
            if tags.get("bridge", "no") == "no":
                line = overlay.difference(line, spans)
            found += [np.asarray(part.coords) for part in shapely.get_parts(line) if part.geom_type == "LineString"]
    return [line for line in found if len(line) > 1]


def _field_lines(osm: OsmData, window: Polygon) -> list[Quads]:
    """Lay out the lines of sports fields."""
    lines: list[NDArray[np.float64]] = []
    for area in osm.areas:
        if area.tags.get("leisure") == "pitch" and on_the_ground(area.tags) and window.intersects(area.polygon):
            with drop_on_failure(area.id):
                sport = area.tags.get("sport", "")
                lines += [quad for shape in polygons_of(area.polygon) for quad in pitch_lines(shape, sport)]
    corners = clip_quads(lines, window)
    return [Quads(corners, (236, 236, 230), low=False)] if len(corners) else []


def _without(shapes: Sequence[Polygon], area: BaseGeometry, window: Polygon) -> list[Polygon]:
    return pieces_in(overlay.difference(shapely.MultiPolygon(list(shapes)), area), window)


def _within(shapes: Sequence[Polygon], area: BaseGeometry, window: Polygon) -> list[Polygon]:
    return pieces_in(overlay.intersection(shapely.MultiPolygon(list(shapes)), area), window)


def _surface(
    flat: NDArray[np.float64],
    z: NDArray[np.float64],
    normals: NDArray[np.float64],
    faces: NDArray[np.int64],
    look: GroundStyle,
    uv: NDArray[np.float64] | None = None,
) -> Surface:
    return Surface.from_triangles(
        np.c_[flat, z],
        faces,
        colour=vertex_colours(look, flat),
        entity=look.entity,
        uv=look.uv(flat) if uv is None else uv / look.tile,
        normals=normals,
        material=ground_material(look.material),
    )


def _draped_surface(plan: PlanMesh, number: int, piece: _Piece, terrain: HeightField) -> Surface:
    """Lay a piece of the plan on its heights."""
    # Points that no triangle of the piece uses are left out.
    kept, index = np.unique(plan.triangles[plan.piece == number], return_inverse=True)
    flat, faces = plan.corners[kept], index.reshape(-1, 3)
    z = piece.heights(flat)
    if piece.water >= 0:
        up = np.broadcast_to((0.0, 0.0, 1.0), (len(flat), 3))
        return _surface(flat, z, np.asarray(up), faces, piece.look)
    normals = terrain_normals(terrain, flat)
    if piece.look is not LOOKS["wall"]:
        return _surface(flat, z, normals, faces, piece.look)
    # Courses run level, along the wall's nearer axis.
    corners = np.c_[flat, z][faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    corner = faces.ravel()
    east = np.repeat(np.abs(across[:, 1]) > np.abs(across[:, 0]), 3)
    uv = np.stack([np.where(east, flat[corner, 0], flat[corner, 1]), z[corner]], axis=1)
    own = np.arange(len(corner)).reshape(-1, 3)
    return _surface(flat[corner], z[corner], normals[corner], own, piece.look, uv)


def _kerbs(
    plan: PlanMesh,
    laid: Sequence[_Piece],
    streets: StreetPolygons,
    terrain: HeightField,
    reach: float,
    look: GroundStyle,
) -> list[Surface]:
    """Make the faces of kerb stones: between the very corners of what lies on both sides."""
    numbers = np.array([k for k, piece in enumerate(laid) if piece.carriageway], np.int64)
    lines = border_chains(plan, plan.border(numbers, shapely.boundary(streets.carriageway))[:, ::-1], reach)
    return curtain_surface(curtain(lines, terrain.lower, terrain.upper, least=0.004), look)


def _under_bridges(site: SiteFacts, wet: BaseGeometry, window: Polygon) -> list[Polygon]:
    """Water that goes on under bridges, beside what of it is in sight (`wet`).

    What a bridge carries is wider than its ways: pavements and strips between two carriageways hide water too. Some
    maps call what flows under a bridge a tunnel.
    """
    shapes = [*mapped_areas(site, window)["water"], *piped_waters(site.osm)]
    below = union_named(overlay_named(shapes, lambda each: overlay.on_grid(each, grid=0.001)))
    hidden = overlay.difference(overlay.intersection(below, window), overlay.buffer(wet, 0.001))
    spans = spans_over_water(site)
    beneath = overlay.intersection(hidden, overlay.buffer(spans, _OVERHANG, quad_segs=2))
    return [shape for shape in polygons_of(beneath, 1.0) if shape.intersects(spans)]


def _banks(
    under: Sequence[Polygon],
    waters: Sequence[Water],
    plan: PlanMesh,
    laid: Sequence[_Piece],
    terrain: HeightField,
    window: Polygon,
) -> list[Surface]:
    """Quays and banks, and `under` bridges the water that goes on there and the edges of the deck."""
    found: list[Surface] = []
    if not waters:
        return found
    tree = shapely.STRtree([water.polygon for water in waters])
    dry = overlay.union_all([water.polygon for water in waters])
    outline = shapely.boundary(dry)
    over_spans = overlay.buffer(overlay.union_all(under), _AT_EDGE)
    for number, piece in enumerate(laid):
        if piece.water < 0:
            continue
        water = waters[piece.water]
        rims = plan.border(np.array([number]), outline)
        over, bank = split_by_area(border_chains(plan, rims[:, ::-1], window.bounds[2]), over_spans)
        found += curtain_surface(curtain(bank, lowered_heights(water.level, 0.3), terrain.upper), LOOKS["quay"])
        found += curtain_surface(curtain(over, lambda xy: terrain.upper(xy) - _SLAB, terrain.upper), LOOKS["kerb"])
    for shape in under:
        water = waters[int(tree.nearest(shape))]
        flat, faces = triangulate([shape])
        up = np.broadcast_to((0.0, 0.0, 1.0), (len(flat), 3))
        found.append(_surface(flat, water.level(flat), np.asarray(up), faces, LOOKS["water"]))
        found.append(_surface(flat, terrain.smooth(flat) - _SLAB, -np.asarray(up), faces[:, ::-1], LOOKS["kerb"]))
        edges = oriented_outlines([shape], water.level, terrain.smooth, 3.0)
        _, walls = split_by_area(edges, overlay.buffer(dry, _AT_EDGE))
        found += curtain_surface(
            curtain(walls, lowered_heights(water.level, 0.3), lambda xy: terrain.smooth(xy) - _SLAB + 0.02),
            LOOKS["quay"],
        )
    return found


def _with_tactile(
    pieces: dict[str, list[Polygon]], fields: Sequence[Polygon], window: Polygon
) -> dict[str, list[Polygon]]:
    """Lay ribbed slabs into the paving before painted crossings."""
    slabs = shapely.MultiPolygon(list(fields))
    laid = {name: shapes for name, shapes in pieces.items() if name.partition(":")[0] in _BEFORE_CROSSINGS}
    found = [slab for shapes in laid.values() for slab in _within(shapes, slabs, window)]
    if not found:
        return pieces
    return {**pieces, **{name: _without(shapes, slabs, window) for name, shapes in laid.items()}, "tactile": found}


def terrain_normals(terrain: HeightField, xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return unit normals of the smooth ground at points, by central differences over a metre."""
    east, north = np.array([0.5, 0.0]), np.array([0.0, 0.5])
    dx = terrain.smooth(xy + east) - terrain.smooth(xy - east)
    dy = terrain.smooth(xy + north) - terrain.smooth(xy - north)
    normal = np.stack([-dx, -dy, np.ones(len(xy))], axis=1)
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True), np.float64)


def _paint_surface(quads: Quads, terrain: HeightField, *, lift: float) -> Surface:
    """Paint and rails: quads a little above the ground."""
    corners = quads.corners.reshape(-1, 2)
    triangles = quad_triangles(4 * np.arange(len(quads.corners)), by_halves=True)
    ground = terrain.lower(corners) if quads.low else terrain.upper(corners)
    return Surface.from_triangles(
        np.c_[corners, ground + lift],
        triangles,
        colour=quads.colour,
        entity=ENTITY_ROAD if quads.low else ENTITY_GROUND,
        normals=terrain_normals(terrain, corners),
        material=Material("paint"),
    )
