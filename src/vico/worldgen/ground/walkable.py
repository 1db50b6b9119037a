"""The walkable map: buildings, water and things are closed; streets decide the class of what is left."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from vico.geo.overlay import polygons_of
from vico.world.objects import Objects
from vico.world.walkable import (
    BLOCKED,
    BODY,
    CROSSING,
    OPEN,
    ROADWAY,
    SIDEWALK,
    WalkableMap,
    fill_polygon,
    stroke,
)
from vico.worldgen.facts.fault_isolation import NamedShape, union_named
from vico.worldgen.facts.land_cover import mapped_areas
from vico.worldgen.facts.site import SiteFacts
from vico.worldgen.facts.streets import StreetPolygons


def walkable_from_site(
    site: SiteFacts, streets: StreetPolygons, solids: Sequence[BaseGeometry], objects: Objects
) -> WalkableMap:
    """Decide where people can walk, from what was made of a map: streets, what stands on the ground, things."""
    half = site.osm.half
    ground = mapped_areas(site, shapely.box(-half, -half, half, half))
    return walkable_map(
        half=half,
        solids=solids,
        roadway=union_named(
            [
                NamedShape("carriageways", streets.carriageway),
                NamedShape("car parks", streets.parking),
                *ground["ballast"],
            ],
            grid=None,
        ),
        sidewalk=streets.footways(),
        crossing=streets.crossing,
        water=union_named(ground["water"], grid=None),
        objects=objects,
    )


def walkable_map(
    *,
    half: float,
    solids: Sequence[BaseGeometry],
    roadway: BaseGeometry,
    sidewalk: BaseGeometry,
    crossing: BaseGeometry,
    water: BaseGeometry,
    objects: Objects,
    cell: float = 0.5,
) -> WalkableMap:
    """Rasterise what is solid and what the ground is.

    Parameters
    ----------
    half
        Half the side of the square, metres; a whole number of cells.
    solids
        Footprints of buildings that stand on the ground.
    roadway, sidewalk, crossing, water
        Polygons; crossings win over the roadway, ways of any kind (bridges) over water.
    objects
        Things; the solid ones outdoors are in the way with their feet.
    cell
        Side of a cell, metres.

    Returns
    -------
    WalkableMap
        A cell is blocked if anything solid comes within `BODY` of its centre.
    """
    n = round(2 * half / cell)
    grid = np.full((n, n), OPEN, np.uint8)
    _fill(grid, [water], half, cell, BLOCKED)
    _fill(grid, [roadway], half, cell, ROADWAY)
    _fill(grid, [sidewalk], half, cell, SIDEWALK)
    _fill(grid, [crossing], half, cell, CROSSING)
    _block(grid, polygons_of(shapely.geometrycollections(list(solids))), half, cell)
    standing = objects.where(objects.outdoors & objects.solid)
    _block(grid, [shapely.Polygon(corners) for corners in standing.feet()], half, cell)
    return WalkableMap(grid, half, cell)


def _rings(polygon: shapely.Polygon) -> list[NDArray[np.float64]]:
    return [np.asarray(ring.coords)[:-1, :2] for ring in (polygon.exterior, *polygon.interiors)]


def _fill(grid: NDArray[np.uint8], shapes: Iterable[BaseGeometry], half: float, cell: float, value: int) -> None:
    for shape in shapes:
        for polygon in polygons_of(shape):
            rings = _rings(polygon)
            points = np.concatenate(rings)
            starts = np.cumsum([0, *(len(ring) for ring in rings)])
            xs, ys = np.ascontiguousarray(points[:, 0]), np.ascontiguousarray(points[:, 1])
            fill_polygon(grid, xs, ys, starts, float(half), float(cell), value)


def _block(grid: NDArray[np.uint8], polygons: Sequence[shapely.Polygon], half: float, cell: float) -> None:
    """Close the cells within `BODY` of the polygons."""
    _fill(grid, polygons, half, cell, BLOCKED)
    for polygon in polygons:
        for ring in _rings(polygon):
            start = np.ascontiguousarray(ring)
            stroke(grid, start, np.roll(start, -1, axis=0), BODY, half, cell, BLOCKED)
