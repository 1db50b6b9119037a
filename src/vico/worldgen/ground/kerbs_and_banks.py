"""The sharp edges of the ground as a `Steps` field: kerbs, lowered where people cross, and the banks of open water.

Of open water it is decided which bodies there are, how high their surfaces lie, and which pieces of them are seen.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import MultiLineString, Polygon
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.osm import OsmData
from vico.geo.overlay import polygons_of
from vico.geometry import distance
from vico.io.compiled import compiled
from vico.world.heights import EDGE_RANGE, HeightField, Steps
from vico.world.walkable import fill_polygon
from vico.worldgen.facts.fault_isolation import NamedShape, named_parts, overlay_named, union_named
from vico.worldgen.facts.roofs import rings_of
from vico.worldgen.facts.site import SiteFacts, WaterBody, on_the_ground
from vico.worldgen.facts.streets import Crossing, StreetPolygons

Floats = NDArray[np.float64]

_FREEBOARD = 1.3  # metres from banks down to waters
_FREEBOARD_SMALL = 0.4  # to ponds
_BRIM = 0.12  # to basins
_SMALL = 2500.0  # square metres, of ponds at most
_BASIN = 150.0  # and of basins
_PARTED = 24.0  # metres between pieces that only a bridge parts
_CORNER = 1.0  # metres
_MOST_SAMPLES = 400  # points of a body's banks
_MOST_OF_CITY = 1000


@dataclass(frozen=True)
class Water:
    """A piece of open water.

    Attributes
    ----------
    polygon
        Where it is seen, metres.
    body
        What it is a piece of.
    """

    polygon: Polygon
    body: WaterBody

    def level(self, xy: Floats) -> Floats:
        """Height of the surface at points, shape ``(n, 2)``, metres."""
        return self.body.level(xy)


def piped_waters(osm: OsmData) -> list[NamedShape]:
    """Waters that the map has under the ground: under bridges too, where what flows on is the same water."""
    return [
        NamedShape(area.id, area.polygon)
        for area in osm.areas
        if area.tags.get("natural") == "water" and not on_the_ground(area.tags)
    ]


def open_water(site: SiteFacts, height: HeightField, pieces: Sequence[Polygon]) -> list[Water]:
    """Return the waters of a map with their surfaces: level, or as gently sloped as their banks.

    Parameters
    ----------
    site
        The map. Of a part of a city it knows the bodies of water of all the city: theirs the pieces are.
    height
        The smooth ground counts, for what no known body holds.
    pieces
        `ground_partition`'s waters. Pieces that only a bridge parts belong together.
    """
    if not pieces:
        return []
    known = list(site.waters or [])
    outlines = [body.outline for body in known] or _outlines([*named_parts("water", pieces), *piped_waters(site.osm)])
    bodies = dict(enumerate(known))
    tree = shapely.STRtree(outlines)
    waters = []
    for piece in pieces:
        # Sharp corners reach a little out of the outlines, which are rounded.
        hits = tree.query_nearest(piece.representative_point(), max_distance=_CORNER)
        if not len(hits):
            waters.append(Water(piece, _body(height, piece, _MOST_SAMPLES)))
            continue
        number = int(hits.min())
        if number not in bodies:
            bodies[number] = _body(height, outlines[number], _MOST_SAMPLES)
        waters.append(Water(piece, bodies[number]))
    return waters


def water_bodies(height: HeightField, waters: Sequence[NamedShape]) -> list[WaterBody]:
    """Return the bodies that mapped waters are, those under the ground among them; their banks lie on `height`."""
    return [_body(height, outline, _MOST_OF_CITY) for outline in _outlines(waters)]


def _outlines(waters: Sequence[NamedShape]) -> list[Polygon]:
    wide = overlay_named(waters, lambda shapes: overlay.buffer(shapes, _PARTED / 2, quad_segs=2))
    return polygons_of(overlay.buffer(union_named(wide), 0.5 - _PARTED / 2, quad_segs=2))


def _body(height: HeightField, outline: Polygon, most: int) -> WaterBody:
    """Find how high a body's banks lie, at so many points, and how far below them its surface."""
    reach = height.half - 1.0
    inside = overlay.intersection(outline, shapely.box(-reach, -reach, reach, reach))
    spacing = min(max(outline.exterior.length / 200.0, 2.0), 12.0)
    shore = shapely.get_coordinates(
        shapely.segmentize(inside.boundary if not inside.is_empty else outline.boundary, spacing)
    )
    levels = height.smooth(shore)
    drop = _FREEBOARD if outline.area > _SMALL else _FREEBOARD_SMALL if outline.area > _BASIN else _BRIM
    if float(np.ptp(levels)) < 2.0 or outline.area < _SMALL:
        lowest = levels.min(keepdims=True) if outline.area < _SMALL else np.percentile(levels, [15.0])
        return WaterBody(outline, shore[:1], lowest, drop)
    step = max(len(shore) // most, 1)
    return WaterBody(outline, shore[::step], levels[::step], drop)


KERB = 0.12
"""Metres a sidewalk lies above the carriageway."""

RAMP = 1.3
"""Metres over which a sidewalk comes down to a crossing."""

_FADE = 1.5  # metres over which a kerb runs out beside a drive
_FLUSH = 0.01  # metres that stay of a lowered kerb
_GRID = 0.001
_MOST_NODES = 32_000  # millimetres


def lowered_kerbs(crossings: Iterable[Crossing]) -> MultiLineString:
    """Return the stretches of kerb at both ends of crossings, metres."""
    lines = []
    for crossing in crossings:
        a, b = np.array(crossing.start), np.array(crossing.end)
        along = (b - a) / max(distance(b, a), 1e-9)
        across = np.array([-along[1], along[0]]) * crossing.width / 2
        lines += [[a - across, a + across], [b - across, b + across]]
    return shapely.MultiLineString(lines)


def steps_field(smooth: HeightField, streets: StreetPolygons, waters: Sequence[Water], *, cell: float) -> Steps | None:
    """Lay kerbs and banks on a field.

    Parameters
    ----------
    smooth
        The ground without them.
    streets
        The streets: their `sunken` part lies `KERB` lower than what is beside it.
    waters
        Open water, not overlapping the carriageways.
    cell
        Spacing of the result, metres, about.

    Returns
    -------
    Steps or None
        None where the ground has no such edge.
    """
    if streets.sunken.is_empty and not waters:
        return None
    half = smooth.half
    n = round(2 * half / cell) + 1
    cell = 2 * half / (n - 1)
    # Carriageways and water lie below their surroundings: their outline is where kerbs and banks are.
    water = overlay.on_grid(np.array([water.polygon for water in waters], object), grid=_GRID)
    region = overlay.union_all([streets.carriageway, *water], grid=_GRID)
    inside = nodes_in_polygons(polygons_of(region), n, half, cell)
    near = _near(region, n, half, cell, EDGE_RANGE)
    edge = np.where(inside, -near, near)
    sunk = _near(streets.sunken, n, half, cell, 2 * _FADE)
    sunk[nodes_in_polygons(polygons_of(streets.sunken), n, half, cell)] = 0.0
    low = np.full((n, n), -KERB)
    # Only on drives the carriageway comes up: beyond the kerbs its height does not matter, and stays even.
    drives = polygons_of(overlay.buffer(overlay.difference(streets.carriageway, streets.sunken), 1.2, quad_segs=2))
    rising = nodes_in_polygons(drives, n, half, cell) & ~nodes_in_polygons(polygons_of(streets.sunken), n, half, cell)
    low[rising] = (-KERB * np.clip(1.0 - sunk / _FADE, 0.0, 1.0))[rising]
    ramp = _near(lowered_kerbs(streets.crossings), n, half, cell, RAMP)
    high = -(KERB - _FLUSH) * np.clip(1.0 - ramp / RAMP, 0.0, 1.0) * np.clip(2.0 - sunk / _FADE, 0.0, 1.0)
    if waters:
        # The level goes on a little beyond the bank, where look-ups still need the lower side.
        owner = np.full((n, n), -1.0, np.float32)
        for own in (False, True):
            for k, water in enumerate(waters):
                beyond = overlay.simplify(overlay.buffer(water.polygon, 2 * cell, quad_segs=2), 0.2)
                _fill(owner, [water.polygon] if own else polygons_of(beyond), half, cell, float(k))
        owner[nodes_in_polygons(polygons_of(streets.carriageway), n, half, cell)] = -1.0
        for k, water in enumerate(waters):
            rows, columns = np.nonzero(owner == k)
            at = np.stack([columns * cell - half, rows * cell - half], axis=1)
            low[rows, columns] = water.level(at) - smooth(at)
    return Steps(
        np.round(edge * (127.0 / EDGE_RANGE)).astype(np.int8),
        np.clip(np.round(low * 1000.0), -_MOST_NODES, _MOST_NODES).astype(np.int16),
        np.round(high * 1000.0).astype(np.int16),
    )


def nodes_in_polygons(polygons: Sequence[Polygon], n: int, half: float, cell: float) -> NDArray[np.bool_]:
    """Which nodes of a grid lie in polygons."""
    grid = np.zeros((n, n), np.uint8)
    _fill(grid, polygons, half, cell, 1)
    return grid == 1


def _fill(
    grid: NDArray[np.uint8] | NDArray[np.float32], polygons: Sequence[Polygon], half: float, cell: float, value: float
) -> None:
    # What fills cells by their centres fills nodes where the cells are shifted by half of one.
    for polygon in polygons:
        rings = rings_of(polygon)
        points = np.concatenate(rings)
        starts = np.cumsum([0, *(len(ring) for ring in rings)])
        xs, ys = np.ascontiguousarray(points[:, 0]), np.ascontiguousarray(points[:, 1])
        fill_polygon(grid, xs, ys, starts, float(half + cell / 2), float(cell), value)


def _near(shape: BaseGeometry, n: int, half: float, cell: float, reach: float) -> NDArray[np.float32]:
    """Distance of a grid's nodes from the lines or outlines of a shape, at most `reach`."""
    grid = np.full((n, n), reach, np.float32)
    lines = shapely.get_parts(shape if isinstance(shape, MultiLineString) else shapely.boundary(shape))
    lines = shapely.get_parts(lines)
    if len(lines):
        points, line = shapely.get_coordinates(lines, return_index=True)
        first = np.flatnonzero(line[:-1] == line[1:])
        a, b = points[first], points[first + 1]
        _approach(grid, a[:, 0].copy(), a[:, 1].copy(), b[:, 0].copy(), b[:, 1].copy(), half, cell, reach)
    return grid


@compiled
def _approach(grid, x0, y0, x1, y1, half, cell, reach):
    """Lower a grid's values to the distances of its nodes from segments."""
    n = grid.shape[0]
    for k in range(len(x0)):
        i0 = max(0, int(np.ceil((min(x0[k], x1[k]) - reach + half) / cell)))
        i1 = min(n - 1, int(np.floor((max(x0[k], x1[k]) + reach + half) / cell)))
        j0 = max(0, int(np.ceil((min(y0[k], y1[k]) - reach + half) / cell)))
        j1 = min(n - 1, int(np.floor((max(y0[k], y1[k]) + reach + half) / cell)))
        dx, dy = x1[k] - x0[k], y1[k] - y0[k]
        square = dx * dx + dy * dy
        for j in range(j0, j1 + 1):
            y = j * cell - half
            for i in range(i0, i1 + 1):
                x = i * cell - half
                t = 0.0
                if square > 0.0:
                    t = min(1.0, max(0.0, ((x - x0[k]) * dx + (y - y0[k]) * dy) / square))
                away = np.hypot(x - x0[k] - t * dx, y - y0[k] - t * dy)
                grid[j, i] = min(grid[j, i], away)
