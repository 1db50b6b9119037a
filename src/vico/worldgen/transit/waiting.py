"""Where people wait for buses: on the pavement if they can board from there, else at the kerb's side of the lane.

Streets may be wider than the lanes that are driven: then the pavement is out of reach of the doors.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import shapely

from vico.geo import overlay
from vico.rules import BUS_DOOR_BEHIND_FRONT, BUS_DOOR_REACH, BUS_WIDTH
from vico.world.heights import HeightField
from vico.world.lanes import LaneGraph
from vico.world.model import Point2, Stop, Transit
from vico.worldgen.facts.streets import StreetPolygons

# Metres between a waiting place and the pavement's edge: as much as there is room for.
_FROM_EDGE = (0.7, 0.35)
# A waiting place is so near to the front door, metres: in bends a bus does not stand quite along its lane.
_REACH = BUS_DOOR_REACH - 0.5
# And so far from the bus's side and from walls.
_FROM_BUS, _FROM_WALL = 0.8, 0.4


def front_door(lanes: LaneGraph, lane: str, offset: float) -> Point2:
    """Return where the front door is of a bus that stands at a stop, ENU metres."""
    x, y, yaw = lanes.at(lanes.index[lane], offset - BUS_DOOR_BEHIND_FRONT)
    aside = BUS_WIDTH / 2 * (-1.0 if lanes.lefthand else 1.0)
    return float(x + math.sin(yaw) * aside), float(y - math.cos(yaw) * aside)


def waiting_places(
    transit: Transit,
    streets: StreetPolygons,
    lanes: LaneGraph,
    height: HeightField,
    solids: Sequence[shapely.Polygon] = (),
) -> Transit:
    """Move waiting places off the carriageway and to where the bus can be boarded from.

    Parameters
    ----------
    streets
        Pavement and carriageway.
    lanes
        The stops' lanes.
    height
        Of the ground.
    solids
        What nobody stands in.

    Returns
    -------
    Transit
        With other waiting places; those that are good stay.
    """
    finder = _Finder(streets, lanes, solids)
    stops = []
    for stop in transit.stops:
        here = stop.wait[0], stop.wait[1]
        x, y = finder.place(stop)
        if (x, y) != here:
            x, y = round(x, 3), round(y, 3)
            stop = stop.model_copy(update={"wait": (x, y, round(float(height((x, y))), 3))})
        stops.append(stop)
    return transit.model_copy(update={"stops": stops})


class _Finder:
    def __init__(self, streets: StreetPolygons, lanes: LaneGraph, solids: Sequence[shapely.Polygon]) -> None:
        pavement = overlay.union_all([streets.sidewalk, streets.pedestrian], grid=None)
        self._pavements = [overlay.buffer(pavement, -inset) for inset in _FROM_EDGE]
        self._carriageway, self._lanes = streets.carriageway, lanes
        self._walls = shapely.STRtree(list(solids))
        shapely.prepare(self._carriageway)

    def place(self, stop: Stop) -> Point2:
        """Return where people wait for a bus that stands at a stop."""
        door = front_door(self._lanes, stop.lane, stop.offset)
        middle = self._lanes.at(self._lanes.index[stop.lane], stop.offset - BUS_DOOR_BEHIND_FRONT)
        outward = ((door[0] - middle[0]) / (BUS_WIDTH / 2), (door[1] - middle[1]) / (BUS_WIDTH / 2))
        # Within reach of the door, and beyond the side of the bus.
        along = shapely.Point(door[0] + outward[0] * _FROM_BUS, door[1] + outward[1] * _FROM_BUS)
        reach = overlay.buffer(shapely.Point(door), _REACH)
        beside = overlay.intersection(reach, _half_plane(along, outward), grid=None)
        room = overlay.difference(beside, self._near_walls(beside), grid=None)
        here = shapely.Point(stop.wait[:2])
        if not self._carriageway.contains(here) and room.covers(here):
            return stop.wait[0], stop.wait[1]
        for pavement in self._pavements:
            found = overlay.intersection(room, pavement, grid=None)
            if not found.is_empty:
                return _nearest(found, here)
        if room.is_empty:
            return along.x, along.y
        # The pavement is out of reach: as near to it as one can board from.
        widest = self._pavements[-1]
        return _nearest(room, here if widest.is_empty else widest)

    def _near_walls(self, area: shapely.Geometry) -> shapely.Geometry:
        near = self._walls.query(overlay.buffer(area, _FROM_WALL)).tolist()
        return overlay.union_all([overlay.buffer(self._walls.geometries[k], _FROM_WALL) for k in near], grid=None)


def _half_plane(start: shapely.Point, outward: Point2) -> shapely.Polygon:
    """Return what lies beyond a line through `start`, as far as a stop reaches."""
    (x, y), (u, v), far = (start.x, start.y), outward, 2 * BUS_DOOR_REACH
    a, b = (x - v * far, y + u * far), (x + v * far, y - u * far)
    return shapely.Polygon([a, b, (b[0] + u * far, b[1] + v * far), (a[0] + u * far, a[1] + v * far)])


def _nearest(area: shapely.Geometry, other: shapely.Geometry) -> Point2:
    """Return the point of an area that is nearest to something else."""
    x, y = shapely.shortest_line(area, other).coords[0]
    return float(x), float(y)
