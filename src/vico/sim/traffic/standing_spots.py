"""Where pedestrians stand a while: before shop windows, in twos on wide sidewalks, and at stops of buses and trams.

Each spot leaves a lane of its walkway free, and is clear of doors, other walkways and whatever is solid.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.sim.traffic.records import NONE, SPOT, STOP, TALK, WINDOW, Records
from vico.sim.traffic.state import WalkwayNetwork
from vico.world.model import Category, Point2
from vico.world.walkable import CROSSING as CROSSING_CLASS
from vico.world.walkable import ROADWAY
from vico.world.walkways import SIDEWALK, Walkways
from vico.world.world import World

_BODY = 0.3  # m: a body's radius and a little air
_LANE_LEFT = 0.65  # m that the middles of others can be apart who pass beside somebody who stands
_FROM_WALL = 0.65  # m from a window to who looks in
_BESIDE_DOOR = (1.7, 2.6)  # m along the wall from a door to a window
_WALL_WITHIN = (0.35, 0.9)  # m to the wall of who looks in
# Metres around doors, around where passengers wait and around bicycle stations that stay free.
_DOOR_FREE, _STOP_FREE, _STATION_FREE = 1.0, 1.1, 2.5
_APART = 2 * _BODY + 0.1  # m between two who stand, at least
_CELL = 2.5  # m along a cell by which round places are found: none is wider to a side
_REACH = 6.0  # m from a walkway to a spot beside it
_OTHER_WALKWAYS = 0.9  # m to them
_PAIR_EVERY, _PAIR_APART = 30.0, 0.72  # m along a sidewalk between pairs, and between the two of a pair
_BEND = 0.05  # m by which that may differ
_AT_STOP, _STOP_GRID, _PER_STOP = 5.0, 0.5, 6  # m around where passengers wait, m between places tried, and people
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
        return math.floor(point[0] / _CELL), math.floor(point[1] / _CELL)


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
    return network._replace(spots=_sorted(spots), spot_first=_first(spots, len(walks)))


def _sorted(spots: Records) -> Records:
    """Return spots by walkway, with their partners' new numbers."""
    order = np.argsort(spots["walkway"], kind="stable")
    place = np.empty(len(order), np.int32)
    place[order] = np.arange(len(order))
    found = spots[order]
    paired = found["partner"] != NONE
    found["partner"][paired] = place[found["partner"][paired]]
    return found


def _first(spots: Records, walkways: int) -> NDArray[np.int32]:
    first = np.zeros(walkways + 1, np.int32)
    first[1:] = np.cumsum(np.bincount(spots["walkway"], minlength=walkways))
    return first


def _add_stops(site: _Site, world: World) -> None:
    """Add spots on free ground around where passengers wait for buses and trams, the nearest first, facing them.

    Stops are numbered as those of buses, then those of trams.
    """
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
