"""The walkable map: buildings, water and things are closed; streets decide the class of what is left."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from vico.geo.osm import polygons_of
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
            after = np.roll(ring, -1, axis=0)
            x0, y0 = np.ascontiguousarray(ring[:, 0]), np.ascontiguousarray(ring[:, 1])
            x1, y1 = np.ascontiguousarray(after[:, 0]), np.ascontiguousarray(after[:, 1])
            stroke(grid, x0, y0, x1, y1, BODY, half, cell, BLOCKED)
