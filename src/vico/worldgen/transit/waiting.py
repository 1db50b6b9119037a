"""Where people wait for buses: off the carriageway, on the pavement."""

from __future__ import annotations

import shapely

from vico.geo import overlay
from vico.world.heights import HeightField
from vico.world.model import Transit
from vico.worldgen.facts.streets import StreetPolygons

_FARTHEST = 5.0  # metres that a waiting place is moved
_FROM_EDGE = 0.7  # metres between a waiting place and the pavement's edge


def waiting_off_the_road(transit: Transit, streets: StreetPolygons, height: HeightField) -> Transit:
    """Move waiting places from the carriageway to the pavement near by: streets may be wider than their lanes."""
    pavement = overlay.buffer(overlay.union_all([streets.sidewalk, streets.pedestrian], grid=None), -_FROM_EDGE)
    if pavement.is_empty:
        return transit
    shapely.prepare(streets.carriageway)
    stops = []
    for stop in transit.stops:
        here = shapely.Point(stop.wait[:2])
        if streets.carriageway.contains(here):
            x, y = shapely.shortest_line(here, pavement).coords[-1]
            if here.distance(shapely.Point(x, y)) <= _FARTHEST:
                wait = (round(x, 3), round(y, 3), round(float(height((x, y))), 3))
                stop = stop.model_copy(update={"wait": wait})
        stops.append(stop)
    return transit.model_copy(update={"stops": stops})
