"""How paving lies by the streets: the direction of stones, and ribbed fields before crossings."""

from __future__ import annotations

import numpy as np
import shapely
from shapely import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.overlay import polygons_of
from vico.geometry import distance
from vico.worldgen.facts.expendable import expendable
from vico.worldgen.facts.streets import Crossing, StreetPolygons

_FROM_KERB, _DEEP = 0.25, 0.6  # metres: behind the kerb stone, and on from there
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
            with expendable(crossing.id):
                found += _fields(crossing, streets.carriageway, pavement)
    inside = [shape for shape in found if window.contains(shape)]
    return polygons_of(overlay.union_all(inside, grid=0.001), _LEAST) if inside else []


def _fields(crossing: Crossing, carriageway: BaseGeometry, pavement: BaseGeometry) -> list[BaseGeometry]:
    a, b = np.array(crossing.start), np.array(crossing.end)
    along = (b - a) / max(distance(b, a), 1e-9)
    reach = _FROM_KERB + _DEEP
    found: list[BaseGeometry] = []
    for end, out in ((a, -along), (b, along)):
        if not shapely.intersects_xy(pavement, *(end + out * (_FROM_KERB + _DEEP / 2))):
            continue
        # Slanting crossings meet the kerb before or behind their end.
        strip = overlay.buffer(
            LineString([end - out * 1.5, end + out * 2.0]), min(crossing.width, _WIDEST) / 2, cap_style="flat"
        )
        x, y = end
        road = shapely.clip_by_rect(carriageway, x - 6.0, y - 6.0, x + 6.0, y + 6.0)
        band = overlay.difference(
            overlay.buffer(road, reach, quad_segs=3), overlay.buffer(road, _FROM_KERB, quad_segs=3)
        )
        field = overlay.areas_of(overlay.intersection(overlay.intersection(strip, band), pavement))
        found += [part for part in shapely.get_parts(field) if part.area > _LEAST]
    return found
