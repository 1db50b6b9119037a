"""Waiting places for buses and trams: on the pavement if people can board from there, else beside the vehicle.

Streets may be wider than the lanes that are driven: then the pavement is out of reach of the doors.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import shapely

from vico.geo import overlay
from vico.rules import (
    BUS_DOOR_BEHIND_FRONT,
    BUS_DOOR_REACH,
    BUS_DOORS_BEHIND_FRONT,
    BUS_WIDTH,
    TRAM_SECTIONS,
    TRAM_WIDTH,
)
from vico.world.heights import HeightField
from vico.world.lanes import LaneGraph
from vico.world.model import Point2, Point3
from vico.world.transit import TRAM_DOORS, Stop, Track, TramLine, TramStop, Transit, tram_door
from vico.worldgen.facts.streets import StreetPolygons

# Metres between a waiting place and the pavement's edge: as much as there is room for.
_FROM_EDGE = (0.7, 0.35)
# A waiting place is so near to the front door, metres: in bends a bus does not stand quite along its lane.
_REACH = BUS_DOOR_REACH - 0.5
# And so far from the bus's side and from walls.
_FROM_BUS = 0.8  # metres from a bus to those that wait
_FROM_WALL = 0.4  # metres from walls to them
# Buses stop where so much room is left there, square metres in one piece: for a few people.
_LEAST_ROOM = 1.5
# So far from the middle of a track.
_FROM_TRACK = TRAM_WIDTH / 2 + 0.5
# A stop that nothing serves is on the pavement if that is so near, metres.
_NOT_SERVED = 8.0
# The pavement of a city is looked at in parts as large as this at most.
_PART = 100.0


def front_door(lanes: LaneGraph, lane: str, offset: float) -> Point2:
    """Return where the front door is of a bus that stands at a stop, ENU metres."""
    return _bus_door(lanes, lane, offset, BUS_DOOR_BEHIND_FRONT)[0]


def _bus_door(lanes: LaneGraph, lane: str, offset: float, behind: float) -> tuple[Point2, Point2]:
    """Return where a door is of a bus that stands at a stop, metres behind its front, and the way out of it."""
    x, y, yaw = lanes.at(lanes.index[lane], offset - behind)
    aside = -1.0 if lanes.lefthand else 1.0
    outward = float(math.sin(yaw) * aside), float(-math.cos(yaw) * aside)
    return (float(x + outward[0] * BUS_WIDTH / 2), float(y + outward[1] * BUS_WIDTH / 2)), outward


def can_wait(lanes: LaneGraph, lane: int, offset: float, walls: shapely.STRtree) -> bool:
    """Return whether there is room for people beside a door of a bus that stands on a lane, clear of walls.

    Parameters
    ----------
    lane
        Its number.
    offset
        Where the bus's front is, metres along the lane.
    walls
        What nobody stands in.
    """
    for behind in BUS_DOORS_BEHIND_FRONT:
        door, outward = _bus_door(lanes, lanes.ids[lane], offset, behind)
        if not len(walls.query(shapely.Point(door), predicate="dwithin", distance=_REACH + _FROM_WALL)):
            return True
        room = _room_to_wait(door, outward, walls)
        if max((part.area for part in overlay.polygons_of(room)), default=0.0) >= _LEAST_ROOM:
            return True
    return False


def _room_to_wait(door: Point2, outward: Point2, walls: shapely.STRtree) -> shapely.Geometry:
    """Return where one can stand within reach of a door, beyond the side of its vehicle and clear of walls."""
    along = shapely.Point(door[0] + outward[0] * _FROM_BUS, door[1] + outward[1] * _FROM_BUS)
    beside = overlay.intersection(overlay.buffer(shapely.Point(door), _REACH), _half_plane(along, outward), grid=None)
    return overlay.difference(beside, _near_walls(beside, walls), grid=None)


def _near_walls(area: shapely.Geometry, walls: shapely.STRtree) -> shapely.Geometry:
    near = walls.query(overlay.buffer(area, _FROM_WALL)).tolist()
    return overlay.union_all([overlay.buffer(walls.geometries[k], _FROM_WALL) for k in near], grid=None)


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
    finder = _Finder(streets, lanes, solids, [line.track for line in transit.tram_lines])
    served = {stop for line in transit.lines for stop in line.stops}

    def wait(stop: Stop | TramStop, spot: Point2) -> dict[str, Point3]:
        if spot == (stop.wait[0], stop.wait[1]):
            return {}
        x, y = round(spot[0], 3), round(spot[1], 3)
        return {"wait": (x, y, round(float(height((x, y))), 3))}

    stops = [stop.model_copy(update=wait(stop, finder.place(stop, served=stop.id in served))) for stop in transit.stops]
    lines = {stop: line for line in reversed(transit.tram_lines) for stop in line.stops}
    tram_stops = [
        stop.model_copy(update=wait(stop, finder.place_for_tram(stop, lines[stop.id]))) if stop.id in lines else stop
        for stop in transit.tram_stops
    ]
    return transit.model_copy(update={"stops": stops, "tram_stops": tram_stops})


class _Finder:
    def __init__(
        self,
        streets: StreetPolygons,
        lanes: LaneGraph,
        solids: Sequence[shapely.Polygon],
        tracks: Sequence[Sequence[Point2]],
    ) -> None:
        rails = overlay.union_all([shapely.LineString(track).buffer(_FROM_TRACK) for track in tracks], grid=None)
        pavement = overlay.union_all([streets.sidewalk, streets.pedestrian], grid=None)
        inside = [overlay.buffer(pavement, -inset) for inset in _FROM_EDGE]
        self._pavements = [_SplitArea(overlay.difference(area, rails, grid=None)) for area in inside]
        self._carriageway, self._lanes = streets.carriageway, lanes
        self._walls = shapely.STRtree(list(solids))
        shapely.prepare(self._carriageway)

    def place(self, stop: Stop, *, served: bool) -> Point2:
        """Return where people wait for a bus that stands at a stop: one that a line serves can be boarded there."""
        here = shapely.Point(stop.wait[:2])
        rooms = []
        for behind in BUS_DOORS_BEHIND_FRONT:
            rooms.append(_room_to_wait(*_bus_door(self._lanes, stop.lane, stop.offset, behind), self._walls))
        found = self._on_pavement(here, rooms)
        if found is not None:
            return found
        widest = self._pavements[-1]
        if not served:
            near = widest.within(overlay.buffer(here, _NOT_SERVED))
            near = overlay.difference(near, _near_walls(near, self._walls), grid=None)
            if not near.is_empty:
                return _nearest(near, here)
        room = next((area for area in rooms if not area.is_empty), rooms[0])
        if room.is_empty:
            (x, y), (u, v) = _bus_door(self._lanes, stop.lane, stop.offset, BUS_DOOR_BEHIND_FRONT)
            return x + u * _FROM_BUS, y + v * _FROM_BUS
        # The pavement is out of reach: as near to it as one can board from.
        return _nearest(room, here if widest.whole.is_empty else widest.whole)

    def place_for_tram(self, stop: TramStop, line: TramLine) -> Point2:
        """Return where people wait for a tram of a line: beside a door on the side of the kerb, off the roadway."""
        here = shapely.Point(stop.wait[:2])
        track, offset = Track(line.track), line.offsets[line.stops.index(stop.id)]
        side = -1.0 if self._lanes.lefthand else 1.0
        rooms = []
        for k in sorted(range(TRAM_SECTIONS * len(TRAM_DOORS)), key=lambda k: abs(k - 1)):
            door, middle = tram_door(track, offset, k, side)
            half = TRAM_WIDTH / 2
            outward = (door[0] - middle[0]) / half, (door[1] - middle[1]) / half
            rooms.append(_room_to_wait(door, outward, self._walls))
        if any(room.covers(here) for room in rooms) and not self._carriageway.contains(here):
            return stop.wait[0], stop.wait[1]
        found = self._on_pavement(here, rooms)
        return (stop.wait[0], stop.wait[1]) if found is None else found

    def _on_pavement(self, here: shapely.Point, rooms: Sequence[shapely.Geometry]) -> Point2 | None:
        """Return the place off the roadway in the first of several areas that has one; None without any."""
        if not self._carriageway.contains(here) and rooms[0].covers(here):
            return here.x, here.y
        for room in rooms:
            for pavement in self._pavements:
                found = pavement.within(room)
                if not found.is_empty:
                    return _nearest(found, here)
        return None


class _SplitArea:
    """An area as large as a city, cut into squares: what of it lies somewhere is found without all the rest."""

    def __init__(self, whole: shapely.Geometry) -> None:
        self.whole = whole
        self._tree = shapely.STRtree(_split_area(whole))

    def within(self, other: shapely.Geometry) -> shapely.Geometry:
        """Return what lies in another area."""
        near = sorted(self._tree.query(other).tolist())
        parts = [overlay.intersection(self._tree.geometries[k], other, grid=None) for k in near]
        return overlay.union_all(parts, grid=None)


def _split_area(area: shapely.Geometry) -> list[shapely.Polygon]:
    """Halve an area until its parts are small."""
    if area.is_empty:
        return []
    west, south, east, north = area.bounds
    if max(east - west, north - south) <= _PART:
        return overlay.polygons_of(area)
    if east - west > north - south:
        middle = (west + east) / 2
        halves = (west, south, middle, north), (middle, south, east, north)
    else:
        middle = (south + north) / 2
        halves = (west, south, east, middle), (west, middle, east, north)
    return [part for half in halves for part in _split_area(shapely.clip_by_rect(area, *half))]


def _half_plane(start: shapely.Point, outward: Point2) -> shapely.Polygon:
    """Return what lies beyond a line through `start`, as far as a stop reaches."""
    (x, y), (u, v), far = (start.x, start.y), outward, 2 * BUS_DOOR_REACH
    a, b = (x - v * far, y + u * far), (x + v * far, y - u * far)
    return shapely.Polygon([a, b, (b[0] + u * far, b[1] + v * far), (a[0] + u * far, a[1] + v * far)])


def _nearest(area: shapely.Geometry, other: shapely.Geometry) -> Point2:
    """Return the point of an area that is nearest to something else."""
    x, y = shapely.shortest_line(area, other).coords[0]
    return float(x), float(y)
