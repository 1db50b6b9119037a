"""Stopping places: parking spots, edges of lanes for deliveries, and standing spots of pedestrians.

Each spot in a car park has a way of its own that leaves the lane, leads into the spot, and out of it again.
Pedestrians stand before shop windows, in twos on wide sidewalks, and at stops of buses and trams. Each standing spot
leaves a lane of its walkway free, and is clear of doors, other walkways and whatever is solid.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.sim.traffic.parking import WAY_LEAD
from vico.sim.traffic.path import PATH_POINT
from vico.sim.traffic.state import NONE, SPOT, STOP, STOPPING_PLACE, TALK, WINDOW, LaneNetwork, Records, WalkwayNetwork
from vico.world.lanes import LaneGraph
from vico.world.model import Category, ParkingSpot, Point2
from vico.world.walkable import CROSSING as CROSSING_CLASS
from vico.world.walkable import ROADWAY
from vico.world.walkways import CROSSING, SIDEWALK, Walkways
from vico.world.world import World

_BEYOND = 10.0  # m of lane after a way out that belong to it
_PAST_MIDDLE = 4.0  # m straight on beyond a spot's middle
_SPOT_END = 0.3  # m of a spot that a car leaves free
_OFF_LANE = 0.8  # m kept from the lane by who waits
_OFF_WALKWAY = 0.6  # m kept from the sidewalk by who waits
_NEAR_STREET = 14.0  # m of the way out before its end in which that place lies

Floats = NDArray[np.float64]


def places_in_car_parks(
    spots: Sequence[ParkingSpot], network: LaneNetwork, lanes: LaneGraph, walks: Walkways, tree: shapely.STRtree
) -> tuple[Records, Records]:
    """Return the places in car parks, dtype `STOPPING_PLACE`, and the points of their ways, dtype `PATH_POINT`.

    Parameters
    ----------
    tree
        Footprints nobody drives through.
    """
    rows: list[dict[str, Any]] = []
    points: list[Records] = []
    lots: dict[str, int] = {}
    lines = [shapely.LineString(walks.line(k)) for k in range(len(walks))]
    walkways = shapely.STRtree(lines)
    count = 0
    for spot in spots:
        if spot.kind != "lot" or spot.car is not None or spot.ways is None:
            continue
        ways = spot.ways
        ends = [lanes.index.get(way.lane) for way in (ways.into, ways.out)]
        if any(lane is None or network.lanes["closed"][lane] for lane in ends):
            continue
        first, last = int(ends[0] or 0), int(ends[1] or 0)
        driven = [shapely.LineString(line) for line in (ways.into.line, ways.back, ways.out.line)]
        if any(len(tree.query(line, predicate="intersects")) for line in driven):
            continue
        lead = lanes.at(first, ways.into.offset - np.arange(WAY_LEAD, 0.0, -0.5))[:, :2]
        after = lanes.at(last, ways.out.offset + np.arange(0.5, _BEYOND, 0.5))[:, :2]
        into = _path(np.concatenate([lead, _inwards(ways.into.line)]))
        back, out = _path(_inwards(ways.back)), _path(np.concatenate([ways.out.line, after]))
        joint = float(shapely.LineString(ways.out.line).length)
        row = {
            "lane": first,
            "middle": ways.into.offset,
            "side": _side(lanes, first, ways.into.offset, ways.into.line[-1]),
            "longest": spot.length - _SPOT_END,
            "lot": lots.setdefault(spot.id.rpartition(".")[0], len(lots)),
            "in_rest": into["s"][-1] - _PAST_MIDDLE,
            "back_rest": back["s"][-1] - _PAST_MIDDLE,
            "out_lane": last,
            "out_offset": ways.out.offset,
            "out_joint": joint,
            "out_side": -_side(lanes, last, ways.out.offset, ways.out.line[0]),
            "hold": _hold(out, joint, lanes, last, walkways, lines),
        }
        for name, path in (("in", into), ("back", back), ("out", out)):
            row[f"first_{name}"], row[f"end_{name}"] = count, count + len(path)
            points.append(path)
            count += len(path)
        rows.append(row)
    places = np.zeros(len(rows), STOPPING_PLACE)
    for k, row in enumerate(rows):
        for name, value in row.items():
            places[name][k] = value
    return places, np.concatenate(points) if points else np.zeros(0, PATH_POINT)


def _inwards(line: Sequence[tuple[float, float]]) -> Floats:
    """Return a line into a spot that goes straight on beyond its middle."""
    points = np.array(line, np.float64)
    ahead = points[-1] - points[-2]
    return np.concatenate([points, [points[-1] + ahead / np.hypot(*ahead) * _PAST_MIDDLE]])


def _path(points: Floats) -> Records:
    apart = np.r_[True, np.hypot(*np.diff(points, axis=0).T) > 1e-3]
    points = points[apart]
    path = np.zeros(len(points), PATH_POINT)
    path["x"], path["y"] = points.T
    path["s"][1:] = np.cumsum(np.hypot(*np.diff(points, axis=0).T))
    return path


def _side(lanes: LaneGraph, lane: int, offset: float, point: tuple[float, float]) -> float:
    """Return 1 for a point to the left of a lane, -1 to the right."""
    x, y, yaw = lanes.at(lane, offset)
    return 1.0 if np.cos(yaw) * (point[1] - y) - np.sin(yaw) * (point[0] - x) > 0.0 else -1.0


def _hold(
    out: Records, joint: float, lanes: LaneGraph, lane: int, walkways: shapely.STRtree, lines: list[shapely.LineString]
) -> float:
    """Return how far along a way out a car's front is where it waits: before the lane, and the sidewalk beside it."""
    line = shapely.LineString(lanes.line(lane))
    way = shapely.LineString(np.stack([out["x"], out["y"]], axis=1))
    offsets = np.arange(0.0, joint, 0.25)
    spots = shapely.line_interpolate_point(way, offsets)
    near = shapely.distance(spots, line) < lanes.width[lane] / 2 + _OFF_LANE
    # The way may begin near the lane: only its last stretch counts.
    away = np.flatnonzero(~near)
    hold = float(offsets[away[-1]]) if len(away) else 0.0
    rest = shapely.line_interpolate_point(way, np.arange(max(hold - _NEAR_STREET, 0.0), hold + 0.1, 0.25))
    if len(rest) > 1:
        last = shapely.LineString(shapely.get_coordinates(rest))
        for k in np.sort(walkways.query(last, predicate="intersects")).tolist():
            hit = shapely.intersection(last, lines[k])
            at = [way.project(shapely.Point(p)) for p in shapely.get_coordinates(hit)]
            hold = min(hold, min(at) - 1.0 - _OFF_WALKWAY)
    return max(hold, 0.0)


#: Length, width, overhang and wheelbase of the largest car that parks, and of the van, metres.
_CAR, _VAN = (4.7, 1.9, 0.92, 2.78), (5.1, 1.98, 0.95, 3.1)
_SPARE = 0.5  # m of a spot that a car leaves free
_RADIUS, _LEAST_TAPER = 6.0, 8.0  # m, of the bend into a place, and of lane it takes
_AIR = 0.12  # m between a car on its way into a place and anything that stands
_BEFORE, _AFTER = 6.0, 7.0  # m of lane before that way and after it, where others wait for a junction
_STEP = 0.5  # m between outlines of the way
_DELIVERY_ENDS = 35.0  # m from a lane's ends to the first place
_DELIVERY_EVERY = 20.0  # m between places
_DELIVERY_LANE = 80.0  # m of lane, at least
_EDGE, _INWARDS = 0.15, 0.5  # m that a van keeps to its lane's edge; how far it leaves the middle
_CROSSING = 10.0  # m kept to crossings
_STOP = 25.0  # m kept to stops
_RAILS = 4.0  # m kept to rails


class _Place(NamedTuple):
    lane: int
    middle: float
    side: float
    longest: float
    taper: float
    reverse: bool
    delivery: bool


def with_stopping_places(
    network: LaneNetwork, lanes: LaneGraph, walks: Walkways, world: World, solids: Sequence[shapely.Polygon]
) -> LaneNetwork:
    """Return the lanes with the places of a world where cars stop.

    Parameters
    ----------
    network
        The lanes, without such places.
    lanes, walks
        Lanes and walkways as the world has them, in the network's order.
    solids
        Footprints nobody drives through.
    """
    if not len(lanes):
        return network
    tree = shapely.STRtree(list(solids))
    found = [*_parking(world, network, lanes, tree), *_deliveries(world, network, lanes, walks, tree)]
    places = np.zeros(len(found), STOPPING_PLACE)
    places["lot"] = NONE
    for name, column in zip(_Place._fields, zip(*sorted(found), strict=True), strict=False):
        places[name] = column
    parks, points = places_in_car_parks(world.parking, network, lanes, walks, tree)
    places = np.concatenate([places, parks])
    places = places[np.argsort(places["lane"], kind="stable")]
    return with_places(network, places)._replace(way_points=points)


def with_places(network: LaneNetwork, places: Records) -> LaneNetwork:
    """Return the lanes with some places, dtype `STOPPING_PLACE`, in the order of their lanes."""
    records = network.lanes.copy()
    records["first_place"] = np.searchsorted(places["lane"], np.arange(len(records)), side="left")
    records["end_place"] = np.searchsorted(places["lane"], np.arange(len(records)), side="right")
    return network._replace(lanes=records, places=places)


def without_deliveries(network: LaneNetwork, lanes: NDArray[np.int32]) -> LaneNetwork:
    """Return the network without places for deliveries on some lanes."""
    places = network.places
    return with_places(network, places[~(places["delivery"] & np.isin(places["lane"], lanes))])


def _parking(world: World, network: LaneNetwork, lanes: LaneGraph, tree: shapely.STRtree) -> Iterator[_Place]:
    """Free spots along kerbs that a car gets out of forwards."""
    for spot in world.parking:
        lane = lanes.index.get(spot.lane) if spot.lane is not None else None
        if spot.car is not None or spot.kind != "kerb" or lane is None or network.lanes["closed"][lane]:
            continue
        taper = max(_LEAST_TAPER, float(np.sqrt(6.0 * abs(spot.side) * _RADIUS)))
        place = _Place(lane, spot.offset, spot.side, spot.length - _SPARE, taper, True, False)
        if not _fits_lane(place, _CAR, lanes):
            continue
        ways = [_swept(place, _CAR, lanes, ahead=ahead) for ahead in (True, False)]
        clear = [not len(tree.query(way, predicate="intersects")) for way in ways]
        if not clear[0]:
            continue
        yield place._replace(reverse=not clear[1])


def _deliveries(
    world: World, network: LaneNetwork, lanes: LaneGraph, walks: Walkways, tree: shapely.STRtree
) -> Iterator[_Place]:
    """Places at the kerb side of streets that have another lane, away from crossings, stops and rails."""
    transit = world.transit
    crossings = [shapely.LineString(walks.line(int(k))) for k in np.flatnonzero(walks.kind == CROSSING)]
    stops = [shapely.Point(stop.wait[:2]) for stop in transit.stops]
    stops += [shapely.Point(stop.wait[:2]) for stop in transit.tram_stops]
    rails = [shapely.LineString(line.track) for line in transit.tram_lines]
    kept = [
        (shapely.STRtree(shapes), away) for shapes, away in ((crossings, _CROSSING), (stops, _STOP), (rails, _RAILS))
    ]
    records = network.lanes
    kerb, beside = (lanes.left, lanes.right) if lanes.lefthand else (lanes.right, lanes.left)
    usable = (records["inside"] < 0) & (records["junction"] < 0) & ~records["closed"] & (lanes.length > _DELIVERY_LANE)
    usable &= (kerb < 0) & (beside >= 0) & ~records["closed"][np.maximum(beside, 0)]
    for lane in np.flatnonzero(usable).tolist():
        side = min(max(float(lanes.width[lane]) / 2 - _VAN[1] / 2 - _EDGE, 0.0), _INWARDS)
        side = side if lanes.lefthand else -side
        for middle in np.arange(_DELIVERY_ENDS, lanes.length[lane] - _DELIVERY_ENDS, _DELIVERY_EVERY).tolist():
            place = _Place(lane, middle, side, 6.0, _LEAST_TAPER, False, True)
            way = _swept(place, _VAN, lanes, ahead=False)
            near = any(len(shapes.query(way, predicate="dwithin", distance=away)) for shapes, away in kept)
            if not near and not len(tree.query(way, predicate="intersects")):
                yield place


def _fits_lane(place: _Place, size: tuple[float, float, float, float], lanes: LaneGraph) -> bool:
    """Return whether the ways into a place and out of it are on its lane."""
    length, _, _, wheelbase = size
    begin = place.middle - length / 2 - place.taper
    end = place.middle + length / 2 + place.taper + wheelbase
    return bool(begin > _BEFORE and end < lanes.length[place.lane] - _AFTER)


def _swept(
    place: _Place, size: tuple[float, float, float, float], lanes: LaneGraph, *, ahead: bool
) -> shapely.Geometry:
    """Return the ground that a vehicle takes on its way out of a place (`ahead`), or forwards into it."""
    length, width, overhang, wheelbase = size
    rest = place.middle + length / 2
    reach = place.taper + wheelbase
    fronts = np.arange(rest, rest + reach + _STEP, _STEP) if ahead else np.arange(rest - reach, rest + _STEP, _STEP)
    axles = np.stack([fronts - overhang, fronts - overhang - wheelbase])
    done = (axles - (rest - overhang)) if ahead else (rest - overhang - wheelbase - axles)
    share = np.clip(done / max(place.taper, 1e-6), 0.0, 1.0)
    x, y, yaw = np.moveaxis(lanes.at(np.int64(place.lane), axles.ravel()), -1, 0)
    off = (place.side * (1.0 - share * share * (3.0 - 2.0 * share))).ravel()
    xy = np.stack([x - np.sin(yaw) * off, y + np.cos(yaw) * off], axis=-1).reshape(2, -1, 2)
    along = (xy[0] - xy[1]) / np.linalg.norm(xy[0] - xy[1], axis=1)[:, None]
    centre = xy[0] + along * (overhang - length / 2)
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    corners = [
        centre + a * (length / 2 + _AIR) * along + b * (width / 2 + _AIR) * across
        for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    return shapely.union_all(shapely.polygons(np.stack(corners, axis=1)))


_BODY = 0.3  # m: a body's radius and a little air
_LANE_LEFT = 0.65  # m that the middles of others can be apart who pass beside somebody who stands
_FROM_WALL = 0.65  # m from a window to who looks in
_BESIDE_DOOR = (1.7, 2.6)  # m along the wall from a door to a window
_WALL_WITHIN = (0.35, 0.9)  # m to the wall of who looks in
_DOOR_FREE = 1.0  # m around doors that stay free
_STOP_FREE = 1.1  # m around where passengers wait
_STATION_FREE = 2.5  # m around bicycle stations
_APART = 2 * _BODY + 0.1  # m between two who stand, at least
_SPOT_CELL = 2.5  # m along a cell by which round places are found: none is wider to a side
_REACH = 6.0  # m from a walkway to a spot beside it
_OTHER_WALKWAYS = 0.9  # m to them
_PAIR_EVERY, _PAIR_APART = 30.0, 0.72  # m along a sidewalk between pairs, and between the two of a pair
_BEND = 0.05  # m by which that may differ
_AT_STOP = 5.0  # m around where passengers wait
_STOP_GRID = 0.5  # m between places that are tried there
_PER_STOP = 6  # people at most
_STOP_ROOM, _FROM_LANE = 0.35, 1.9  # m around who waits, and from there to the middle of the lane or track
_STOP_REACH = 9.0  # m from a walkway to who waits
_WAY = 1.5  # m along the walkway that the way to a spot takes
_LEAST_LENGTH = 8.0  # m of sidewalk on which people stop
_RAISED = 0.5  # m above the ground: on decks nobody stops
_END = 1.5  # m at a walkway's ends that stay free


class _Discs:
    """Round places that stay free: a city has tens of thousands, so each is known by the cell its middle is in."""

    def __init__(self) -> None:
        self._by_cell: dict[tuple[int, int], list[tuple[float, float, float]]] = {}

    def add(self, middle: Point2, radius: float) -> None:
        """Add one; a radius is `_CELL` at most."""
        self._by_cell.setdefault(self._cell(middle), []).append((*middle, radius))

    def hold(self, point: Point2) -> bool:
        """Return whether a point is in any of them."""
        column, row = self._cell(point)
        return any(
            math.hypot(x - point[0], y - point[1]) < radius
            for cell in product(range(column - 1, column + 2), range(row - 1, row + 2))
            for x, y, radius in self._by_cell.get(cell, ())
        )

    @staticmethod
    def _cell(point: Point2) -> tuple[int, int]:
        return math.floor(point[0] / _SPOT_CELL), math.floor(point[1] / _SPOT_CELL)


@dataclass
class _Site:
    """What spots have to keep clear of."""

    walks: Walkways
    solids: shapely.STRtree
    kept_free: _Discs
    usable: NDArray[np.bool_]
    rows: list[tuple[object, ...]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.lines = [shapely.LineString(self.walks.line(k)) for k in range(len(self.walks))]
        self.tree = shapely.STRtree(self.lines)

    def nearest(self, point: Point2, reach: float = _REACH) -> tuple[int, float] | None:
        """Return the sidewalk nearest to a point on which people stop, and metres along it."""
        near = self.tree.query(shapely.Point(point), predicate="dwithin", distance=reach)
        near = [int(k) for k in sorted(near) if self.usable[k]]
        if not near:
            return None
        away = [float(shapely.distance(self.lines[k], shapely.Point(point))) for k in near]
        best = near[int(np.argmin(away))]
        return best, float(shapely.line_locate_point(self.lines[best], shapely.Point(point)))

    def at(self, walkway: int, offset: float, aside: float) -> tuple[float, float, float]:
        """Return the point so far left of a walkway's middle, and the walkway's direction there."""
        here = np.array(self.lines[walkway].interpolate(offset).coords[0])
        ahead = np.array(self.lines[walkway].interpolate(offset + 0.3).coords[0])
        behind = np.array(self.lines[walkway].interpolate(max(offset - 0.3, 0.0)).coords[0])
        yaw = math.atan2(*(ahead - behind)[::-1])
        return float(here[0] - np.sin(yaw) * aside), float(here[1] + np.cos(yaw) * aside), yaw

    def aside(self, walkway: int, offset: float, point: Point2) -> float:
        """Return how far left of a walkway's middle a point is, metres."""
        x, y, yaw = self.at(walkway, offset, 0.0)
        return float(-np.sin(yaw) * (point[0] - x) + np.cos(yaw) * (point[1] - y))

    def fits(self, walkway: int, offset: float, point: Point2) -> bool:
        """Return whether somebody may stand at a point beside a walkway, and can get there."""
        if not _END <= offset <= float(self.walks.length[walkway]) - _END:
            return False
        aside = self.aside(walkway, offset, point)
        room = self.walks.room_at(walkway, offset)
        side, other = (room[0], room[1]) if aside > 0 else (room[1], room[0])
        blocks = abs(aside) < side + 2 * _BODY
        if blocks and min(side, abs(aside) - 2 * _BODY) + other < _LANE_LEFT:
            return False
        here = shapely.Point(point)
        near = self.tree.query(here, predicate="dwithin", distance=_OTHER_WALKWAYS)
        if any(k != walkway for k in near):
            return False
        # One leaves the walkway a little before, and comes back to it a little beyond.
        ends = [self.at(walkway, offset + along, 0.0)[:2] for along in (-_WAY, _WAY)]
        way = shapely.Polygon([*ends, point])
        if len(self.solids.query(way, predicate="dwithin", distance=_BODY)):
            return False
        return not self.kept_free.hold(point)

    def add(self, spots: Sequence[tuple[Point2, float, int, float]], kind: int, stop: int = NONE) -> None:
        """Add spots: point, yaw, walkway and metres along it; two of them are partners."""
        first = len(self.rows)
        for k, ((x, y), yaw, walkway, offset) in enumerate(spots):
            partner = first + 1 - k if kind == TALK else NONE
            self.rows.append((x, y, yaw, walkway, offset, kind, partner, stop))
            self.kept_free.add((x, y), _APART)


def with_spots(
    network: WalkwayNetwork, walks: Walkways, world: World, solids: Iterable[shapely.Polygon]
) -> WalkwayNetwork:
    """Return the walkways with the spots of a world at which people stand.

    Parameters
    ----------
    walks
        The walkways as the world has them, in the network's order.
    solids
        Footprints nobody walks through.
    """
    if not len(walks):
        return network
    kept = _Discs()
    for entrance in world.entrances:
        kept.add(entrance.approach, _DOOR_FREE)
    for wait in [stop.wait for stop in world.transit.stops] + [stop.wait for stop in world.transit.tram_stops]:
        kept.add(wait[:2], _STOP_FREE)
    for station in world.transit.bike_stations:
        kept.add(station.position[:2], _STATION_FREE)
    on_ground = np.abs(walks.z - world.height(walks.points)) < _RAISED
    rows = np.repeat(np.arange(len(walks)), np.diff(walks.first))
    usable = np.bincount(rows, weights=~on_ground, minlength=len(walks)) == 0
    usable &= (walks.kind == SIDEWALK) & (walks.length >= _LEAST_LENGTH)
    site = _Site(walks, shapely.STRtree(list(solids)), kept, usable)
    _add_stops(site, world)
    _add_windows(site, world)
    _add_pairs(site)
    spots = np.array(site.rows, SPOT) if site.rows else np.zeros(0, SPOT)
    # They are sorted by walkway, so partners get new numbers.
    order = np.argsort(spots["walkway"], kind="stable")
    place = np.empty(len(order), np.int32)
    place[order] = np.arange(len(order))
    spots = spots[order]
    paired = spots["partner"] != NONE
    spots["partner"][paired] = place[spots["partner"][paired]]
    first = np.zeros(len(walks) + 1, np.int32)
    first[1:] = np.cumsum(np.bincount(spots["walkway"], minlength=len(walks)))
    return network._replace(spots=spots, spot_first=first)


def _add_stops(site: _Site, world: World) -> None:
    """Add spots on free ground around where passengers wait for buses and trams, the nearest first, facing them."""
    transit, lanes = world.transit, world.lanes
    served = {stop for line in transit.lines for stop in line.stops}
    tracks = [shapely.LineString(line.track) for line in transit.tram_lines]
    for number, stop in enumerate(transit.stops):
        if stop.id in served and stop.lane in lanes.index:
            _add_stop(site, world, stop.wait[:2], lanes.at(lanes.index[stop.lane], stop.offset), number, tracks)
    tram_stops = {stop.id: (k, stop) for k, stop in enumerate(transit.tram_stops, len(transit.stops))}
    done: set[str] = set()
    for line, track in zip(transit.tram_lines, tracks, strict=True):
        for name, offset in zip(line.stops, line.offsets, strict=True):
            if name in done:
                continue
            done.add(name)
            number, tram_stop = tram_stops[name]
            door = min(float(track.project(shapely.Point(tram_stop.wait[:2]))), offset)
            ahead, here = (np.array(track.interpolate(along).coords[0]) for along in (door + 0.5, door - 0.5))
            pose = np.array([*here, math.atan2(*(ahead - here)[::-1])])
            _add_stop(site, world, tram_stop.wait[:2], pose, number, tracks)


def _add_stop(
    site: _Site,
    world: World,
    wait: Point2,
    pose: NDArray[np.float64],
    number: int,
    tracks: Sequence[shapely.LineString],
) -> None:
    """Add spots around a place to wait, beside the line of a bus or tram that has a pose there, off all tracks."""
    steps = np.arange(-_AT_STOP, _AT_STOP + 0.01, _STOP_GRID)
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    points = grid[np.lexsort((grid[:, 1], grid[:, 0], np.round(np.hypot(*grid.T), 3)))] + np.array(wait)
    free = (world.walkable.clearance_at(points) >= _STOP_ROOM) & world.walkable.is_connected(points)
    free &= ~np.isin(world.walkable.class_at(points), (ROADWAY, CROSSING_CLASS))
    beside = -np.sin(pose[2]) * (points[:, 0] - pose[0]) + np.cos(pose[2]) * (points[:, 1] - pose[1])
    free &= np.abs(beside) > _FROM_LANE
    spots = shapely.points(points)
    for track in tracks:
        free &= shapely.distance(track, spots) > _FROM_LANE
    count = 0
    for (x, y), away in zip(points[free].tolist(), beside[free].tolist(), strict=True):
        found = site.nearest((x, y), _STOP_REACH)
        if found is None or not site.fits(*found, (x, y)):
            continue
        site.add([((x, y), float(pose[2]) - np.sign(away) * np.pi / 2, *found)], STOP, number)
        count += 1
        if count == _PER_STOP:
            break


def _add_windows(site: _Site, world: World) -> None:
    """Add spots beside the doors of shops, cafés and restaurants, facing the wall."""
    trade = {place.entrance for place in world.places if place.category in (Category.FOOD, Category.STORE)}
    doors = [entrance for entrance in world.entrances if entrance.id in trade]
    for door in doors:
        normal = np.array([np.cos(door.facing), np.sin(door.facing)])
        tangent = np.array([-normal[1], normal[0]])
        for along in (side * metres for side in (1, -1) for metres in _BESIDE_DOOR):
            x, y = (np.array(door.position[:2]) + along * tangent + _FROM_WALL * normal).tolist()
            solid = site.solids.query_nearest(shapely.Point(x, y))
            near = float(shapely.distance(site.solids.geometries[solid[0]], shapely.Point(x, y))) if len(solid) else 9.0
            found = site.nearest((x, y))
            if found is None or not _WALL_WITHIN[0] <= near <= _WALL_WITHIN[1]:
                continue
            if site.fits(*found, (x, y)):
                site.add([((x, y), door.facing + np.pi, *found)], WINDOW)
                break


def _add_pairs(site: _Site) -> None:
    """Add spots for two who talk, at the side of sidewalks, facing each other."""
    for walkway in np.flatnonzero(site.usable).tolist():
        length = float(site.walks.length[walkway])
        for number, offset in enumerate(np.arange(length / 2 % _PAIR_EVERY, length, _PAIR_EVERY)):
            left = (walkway + number) % 2 == 0
            for side in (1, -1) if left else (-1, 1):
                aside = side * float(site.walks.room_at(walkway, float(offset))[0 if side > 0 else 1])
                ends = [offset - _PAIR_APART / 2, offset + _PAIR_APART / 2]
                places = [site.at(walkway, end, aside) for end in ends]
                between = np.hypot(places[0][0] - places[1][0], places[0][1] - places[1][1])
                # On the inside of a bend they would be too near.
                is_straight = abs(between - _PAIR_APART) < _BEND
                if is_straight and all(
                    site.fits(walkway, end, place[:2]) for end, place in zip(ends, places, strict=True)
                ):
                    yaws = [places[0][2], places[1][2] + np.pi]
                    both = [(p[:2], yaw, walkway, end) for p, yaw, end in zip(places, yaws, ends, strict=True)]
                    site.add(both, TALK)
                    break
