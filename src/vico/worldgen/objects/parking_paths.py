"""Paths from streets into the free spots of car parks, and out of them, that a car can steer along.

The poses that a car reaches from the lanes about a car park, on bends of `_RADIUS`, are searched in layers of equal
length over a lattice of places and headings; so are those from which it reaches a lane. A spot's own bend into the
aisle, forwards into it and backwards out of it, is laid by itself and joined to them.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geometry import distance, distances
from vico.world.heights import HeightField
from vico.world.lanes import LaneGraph
from vico.world.model import ParkingSpot, WayIntoSpot, WaysOfSpot
from vico.world.objects import Objects
from vico.worldgen.facts.streets import StreetPolygons

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_LENGTH = 4.7  # m, of the largest car that parks
_WIDTH = 1.9  # m
_WHEELBASE = 2.78  # m
_LONGEST_WHEELBASE = 3.1  # m
_AIR = 0.12  # m between a car on its way and anything that stands
_DISCS = np.array([-1.76, -0.59, 0.59, 1.76])  # m from a car's middle: four discs cover it ...
_DISC = 1.12  # ... of this radius
_AXLES = np.array([-_WHEELBASE / 2, _WHEELBASE / 2])
_CELL = 0.25  # m, of the raster
_AROUND = 32.0  # m about a car park's bays
_STEP = 1.5  # m from pose to pose
_TURN = math.pi / 12  # rad from pose to pose: bends of 5.7 m radius
_RADIUS = _STEP / _TURN
_PLACE = 0.75  # m, cells of the lattice of poses
_HEADINGS = 24  # of the lattice, to a full turn
_LAYERS = 64  # steps of the search at most
_LEAST_RADIUS = 4.8  # m, where two poses are joined
_BENDS = (5.2, 6.0)  # m, radii into a bay
_STRAIGHT = (1.5, 2.2, 3.0, 4.0)  # m straight on before it
_BACK = _LONGEST_WHEELBASE + 0.9  # m straight back in the aisle, so that both axles have left the bend
_LANE_BAND = 1.2  # m to each side of a lane's middle that a way keeps off, but of the lane it begins or ends on
_FROM_START = 14.0  # m from a lane's beginning to the first pose on it
_TO_END = 22.0  # m from the last pose to its end
_EVERY = 2.0  # m from pose to pose on a lane
_SHORTEST = 40.0  # m, of a lane that is used
_NEAR = 0.7  # m between a bend's end and a pose that was reached
_NEAR_TURN = 0.2  # rad between the two
_JOINED = 14  # poses that are joined by one curve, at most
_TRIES = 10  # ways tried for a spot, in and out
_STEEPEST = 0.2  # slope of a way
_LEVEL = 1.0  # m that a lane may lie above or below the ground
_BESIDE = 7.0  # m beside car parks and drives that are open for a way where the map has none


class _Poses(NamedTuple):
    """x, y (metres) and headings (radians), and what led there: the pose before (-1: none), a lane's pose."""

    x: Floats
    y: Floats
    yaw: Floats
    before: Ints
    source: Ints
    layer: Ints


class _Lanes(NamedTuple):
    """Poses on lanes at which ways begin or end: lane and offset of each, and the poses."""

    lane: Ints
    offset: Floats
    pose: Floats


@dataclass(frozen=True)
class _Raster:
    """Obstacles about a car park, and drivable ground; cells of `_CELL` from a corner on."""

    corner: Floats
    clearance: Floats
    open: NDArray[np.bool_]
    lane: NDArray[np.int32]

    def cells(self, xy: Floats) -> tuple[Ints, Ints]:
        row = np.clip(((xy - self.corner) / _CELL).astype(np.int64), 0, np.array(self.open.shape) - 1)
        return row[..., 0], row[..., 1]

    def free(self, x: Floats, y: Floats, yaw: Floats, lane: Ints | int) -> NDArray[np.bool_]:
        """Return where a car may stand whose way begins or ends on a lane."""
        ahead = np.stack([np.cos(yaw), np.sin(yaw)], axis=-1)[:, None, :]
        middle = np.stack([x, y], axis=-1)[:, None, :]
        axles = self.open[self.cells(middle + ahead * _AXLES[:, None])].all(axis=1)
        discs = self.cells(middle + ahead * _DISCS[:, None])
        found = self.lane[discs]
        axles &= ((found == 0) | (found == np.reshape(lane, (-1, 1)) + 1)).all(axis=1)
        return np.asarray(axles & (self.clearance[discs] > _DISC + _AIR).all(axis=1))


def with_parking_paths(
    spots: Sequence[ParkingSpot],
    *,
    streets: StreetPolygons,
    lanes: LaneGraph,
    objects: Objects,
    solids: Sequence[BaseGeometry],
    height: HeightField,
) -> list[ParkingSpot]:
    """Return parking spots with the ways into the free ones of car parks that can be reached from a lane.

    Parameters
    ----------
    spots
        All of a world.
    streets
        Where one may drive: carriageways and car parks; beside them where no mapped way leads in.
    lanes
        From which ways begin and on which they end; no other one is crossed.
    objects
        What stands outdoors, parked cars among it.
    solids
        Footprints of buildings.
    height
        Ground heights.
    """
    lots: dict[str, list[int]] = defaultdict(list)
    for k, spot in enumerate(spots):
        if spot.kind == "lot":
            lots[spot.id.rpartition(".")[0]].append(k)
    found = list(spots)
    if not lots or not len(lanes):
        return found
    standing = objects.where(np.asarray(objects.outdoors & objects.solid, bool))
    things = [*solids, *(shapely.Polygon(corners) for corners in standing.feet())]
    ground = _Surroundings(things, streets, lanes, height)
    for rows in lots.values():
        if all(spots[k].car is not None for k in rows):
            continue
        for only_mapped in (True, False):
            ways = dict(_ways_of_car_park([spots[k] for k in rows], ground, only_mapped=only_mapped))
            for k in rows:
                if spots[k].id in ways:
                    found[k] = spots[k].model_copy(update={"ways": ways[spots[k].id]})
            if ways:
                break
    return found


@dataclass(frozen=True)
class _Surroundings:
    things: list[BaseGeometry]
    streets: StreetPolygons
    lanes: LaneGraph
    height: HeightField

    @cached_property
    def tree(self) -> shapely.STRtree:
        return shapely.STRtree(self.things)

    @cached_property
    def lane_lines(self) -> list[shapely.LineString]:
        return [shapely.LineString(self.lanes.line(k)) for k in range(len(self.lanes))]

    def near(self, box: BaseGeometry) -> list[BaseGeometry]:
        return [self.things[k] for k in np.sort(self.tree.query(box)).tolist()]


def _footprint(spot: ParkingSpot) -> shapely.Polygon:
    """Return the ground of a car in a spot."""
    return shapely.Polygon(_corners(*spot.position[:2], spot.yaw, _LENGTH / 2, _WIDTH / 2))


def _corners(x: float, y: float, yaw: float, a: float, b: float) -> Floats:
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([(x, y)]) + np.array([[-a, -b], [a, -b], [a, b], [-a, b]]) @ np.array([[c, s], [-s, c]])


def _raster(
    box: tuple[float, float, float, float], ground: _Surroundings, cars: list[BaseGeometry], *, only_mapped: bool
) -> _Raster:
    from scipy.ndimage import distance_transform_edt

    corner = np.array(box[:2])
    shape = tuple(np.ceil((np.array(box[2:]) - corner) / _CELL).astype(int))
    window = shapely.box(*box)
    x = corner[0] + (np.arange(shape[0])[:, None] + 0.5) * _CELL + np.zeros(shape)
    y = corner[1] + (np.arange(shape[1])[None, :] + 0.5) * _CELL + np.zeros(shape)

    def cover(shapes: Sequence[BaseGeometry]) -> NDArray[np.bool_]:
        found = np.zeros(shape, bool)
        for area in (overlay.intersection(one, window) for one in shapes):
            if area.is_empty:
                continue
            low, high = ((np.reshape(area.bounds, (2, 2)) - corner) / _CELL).astype(int)
            part = slice(low[0], high[0] + 1), slice(low[1], high[1] + 1)
            shapely.prepare(area)
            found[part] |= shapely.contains_xy(area, x[part], y[part])
        return found

    streets = ground.streets
    driven = [overlay.intersection(part, window) for part in (streets.carriageway, streets.parking)]
    if not only_mapped:
        drives = [shapely.LineString(s.line) for s in streets.streets if s.kind == "service"]
        beside = [
            overlay.buffer(part, _BESIDE)
            for part in (driven[1], *(overlay.intersection(one, window) for one in drives))
        ]
        driven += beside
    lane = np.zeros(shape, np.int32)
    for k, line in enumerate(ground.lane_lines):
        if line.intersects(window):
            inside = cover([overlay.buffer(line, _LANE_BAND, cap_style="flat")])
            lane[inside] = k + 1
    clearance = distance_transform_edt(~cover([*ground.near(window), *cars])) * _CELL
    return _Raster(corner, np.asarray(clearance, np.float64), cover(driven), lane)


def _lanes_about(ground: _Surroundings, box: tuple[float, float, float, float]) -> _Lanes:
    """Return the poses on street lanes within a box, away from their ends."""
    lanes, rows = ground.lanes, []
    usable = (lanes.inside < 0) & (lanes.zone < 0) & ~lanes.buses_only & (lanes.length > _SHORTEST)
    for k in np.flatnonzero(usable).tolist():
        points = slice(lanes.first[k], lanes.first[k + 1])
        if np.abs(lanes.z[points] - ground.height(lanes.points[points])).max() > _LEVEL:
            continue
        offsets = np.arange(_FROM_START, lanes.length[k] - _TO_END, _EVERY)
        poses = lanes.at(k, offsets).reshape(-1, 3)
        within = (poses[:, :2] > np.array(box[:2]) + 3.0).all(axis=1) & (poses[:, :2] < np.array(box[2:]) - 3.0).all(
            axis=1
        )
        rows += [(k, offset, *pose) for offset, pose in zip(offsets[within], poses[within], strict=True)]
    flat = np.array(rows, np.float64).reshape(-1, 5)
    return _Lanes(flat[:, 0].astype(np.int64), flat[:, 1], flat[:, 2:])


def _reachable_poses(raster: _Raster, lanes: _Lanes, way: int) -> _Poses:
    """Return the poses that are reached from lanes (`way` 1), or from which a lane is reached (-1)."""
    rows, columns = (int(np.ceil(n * _CELL / _PLACE)) + 1 for n in raster.open.shape)
    seen = np.zeros(rows * columns * _HEADINGS, bool)
    n = len(lanes.lane)
    x0, y0, yaw0 = lanes.pose[:, 0], lanes.pose[:, 1], lanes.pose[:, 2]
    layers = [_Poses(x0, y0, yaw0, np.full(n, -1), np.arange(n), np.zeros(n, np.int64))]
    total = 0
    for depth in range(1, _LAYERS):
        last = layers[-1]
        if not len(last.x):
            break
        bend = np.repeat([0.0, _TURN, -_TURN], len(last.x))
        x, y, yaw = (np.tile(column, 3) for column in (last.x, last.y, last.yaw))
        source = np.tile(last.source, 3)
        before = np.tile(np.arange(len(last.x)), 3) + total
        chord = _STEP * np.sinc(bend / 2 / np.pi)
        x = x + way * chord * np.cos(yaw + way * bend / 2)
        y = y + way * chord * np.sin(yaw + way * bend / 2)
        yaw = yaw + way * bend
        cell = ((np.stack([x, y], axis=1) - raster.corner) / _PLACE).astype(np.int64)
        inside = (cell > 0).all(axis=1) & (cell < np.array([rows, columns]) - 1).all(axis=1)
        heading = np.round(yaw / (2 * np.pi / _HEADINGS)).astype(np.int64) % _HEADINGS
        key = (np.clip(cell[:, 0], 0, rows - 1) * columns + np.clip(cell[:, 1], 0, columns - 1)) * _HEADINGS + heading
        keep = np.flatnonzero(inside & ~seen[key])
        keep = keep[raster.free(x[keep], y[keep], yaw[keep], lanes.lane[source[keep]])]
        keep = keep[np.sort(np.unique(key[keep], return_index=True)[1])]
        seen[key[keep]] = True
        total += len(last.x)
        layers.append(_Poses(x[keep], y[keep], yaw[keep], before[keep], source[keep], np.full(len(keep), depth)))
    return _Poses(*(np.concatenate(column) for column in zip(*layers, strict=True)))


def _curve(a: Floats, b: Floats) -> Floats | None:
    """Return points of a smooth curve between two poses, shape ``(n, 2)``; None if it bends too much."""
    run = distance(b[:2], a[:2])
    if run < 0.3:
        return None
    t = np.linspace(0.0, 1.0, max(int(run / 0.4), 5))[:, None]
    ends = [np.array([math.cos(pose[2]), math.sin(pose[2])]) * run for pose in (a, b)]
    points = (
        (2 * t**3 - 3 * t**2 + 1) * a[:2]
        + (t**3 - 2 * t**2 + t) * ends[0]
        + (3 * t**2 - 2 * t**3) * b[:2]
        + (t**3 - t**2) * ends[1]
    )
    along = np.diff(points, axis=0)
    yaw = np.arctan2(along[:, 1], along[:, 0])
    turn = np.abs((np.diff(yaw) + np.pi) % (2 * np.pi) - np.pi)
    size = np.hypot(along[:, 0], along[:, 1])
    bend = turn / ((size[1:] + size[:-1]) / 2)
    outer = [abs(math.remainder(float(y - pose[2]), 2 * math.pi)) for y, pose in ((yaw[0], a), (yaw[-1], b))]
    is_smooth = bend.max(initial=0.0) < 1 / _LEAST_RADIUS and max(outer) < 0.12
    return points if is_smooth else None


def _smooth_line(poses: Floats, raster: _Raster, lane: int, *, at_end: bool) -> Floats | None:
    """Return a smooth line through poses, of which it leaves out what it can, shape ``(n, 2)``; None for none.

    Near its spot, `at_end` or at the start, it may lie in ground that belongs to the spot: what a car sweeps there is
    looked at as a whole, later.
    """
    spot = poses[-1 if at_end else 0, :2]
    line, i = [poses[0, :2]], 0
    while i < len(poses) - 1:
        for j in range(min(len(poses) - 1, i + _JOINED), i, -1):
            points = _curve(poses[i], poses[j])
            if points is None:
                continue
            along = np.diff(points, axis=0)
            yaw = np.arctan2(along[:, 1], along[:, 0])
            near = distances(points[1:], spot) < 3.0
            clear = raster.free(points[1:, 0], points[1:, 1], yaw, lane)
            if (clear | near).all():
                line.extend(points[1:])
                i = j
                break
        else:
            return None
    return np.array(line)


def _bends(spot: ParkingSpot) -> Iterator[Floats]:
    """Lines backwards out of a spot: straight, and on a bend to one side."""
    x, y = spot.position[:2]
    out = spot.yaw  # it leads out of the bay
    for straight in _STRAIGHT:
        for radius in _BENDS:
            for side in (1.0, -1.0):
                start = np.array([x + straight * math.cos(out), y + straight * math.sin(out)])
                angle = np.linspace(0.0, math.pi / 2, 19)
                left = np.array([-math.sin(out), math.cos(out)]) * side
                ahead = np.array([math.cos(out), math.sin(out)])
                arc = start + radius * (np.sin(angle)[:, None] * ahead + (1.0 - np.cos(angle))[:, None] * left)
                yield np.concatenate([[[x, y]], arc])


def _touches(things: shapely.STRtree, line: Floats) -> bool:
    """Return whether a car whose axles follow a line touches anything."""
    path = shapely.LineString(line)
    back = np.arange(0.0, max(path.length - _WHEELBASE, 0.0) + 0.5, 0.5)
    rear = shapely.get_coordinates(shapely.line_interpolate_point(path, back))
    front = shapely.get_coordinates(shapely.line_interpolate_point(path, np.minimum(back + _WHEELBASE, path.length)))
    yaw = np.arctan2(*(front - rear)[:, ::-1].T)
    middle = (front + rear) / 2
    a, b = _LENGTH / 2 + _AIR, _WIDTH / 2 + _AIR
    outlines = [_corners(x, y, h, a, b) for (x, y), h in zip(middle.tolist(), yaw.tolist(), strict=True)]
    return bool(things.query(np.asarray(shapely.polygons(np.array(outlines)), object), predicate="intersects").size)


@dataclass(frozen=True)
class _Index:
    """Poses that were reached, to be found by where they are."""

    poses: _Poses
    tree: Any

    @classmethod
    def of(cls, poses: _Poses) -> _Index:
        from scipy.spatial import cKDTree

        return cls(poses, cKDTree(np.stack([poses.x, poses.y], axis=1)))

    def matching(self, wanted: Sequence[Floats]) -> Iterator[tuple[float, int, int]]:
        """Pairs of a wanted pose and one near it, by their numbers, after what it costs to take that: metres."""
        poses = self.poses
        near = self.tree.query_ball_point(np.array(wanted).reshape(-1, 3)[:, :2], _NEAR)
        for k, found in enumerate(near):
            nodes = np.array(found, np.int64)
            turn = np.abs((poses.yaw[nodes] - wanted[k][2] + np.pi) % (2 * np.pi) - np.pi)
            alike = (turn < _NEAR_TURN) & (poses.layer[nodes] > 2)
            nodes, turn = nodes[alike], turn[alike]
            away = np.hypot(poses.x[nodes] - wanted[k][0], poses.y[nodes] - wanted[k][1])
            cost = poses.layer[nodes] * _STEP + 8.0 * away + 20.0 * turn
            yield from zip(cost.tolist(), [k] * len(nodes), nodes.tolist(), strict=True)

    def chain(self, k: int) -> Floats:
        """Return the poses from the one before pose k to a lane's, shape ``(n, 3)``."""
        poses, found = self.poses, [k]
        while poses.before[found[-1]] >= 0:
            found.append(int(poses.before[found[-1]]))
        rows = found[1:]
        return np.stack([poses.x[rows], poses.y[rows], poses.yaw[rows]], axis=1)


class _CarPark(NamedTuple):
    ground: _Surroundings
    box: tuple[float, float, float, float]
    raster: _Raster
    lanes: _Lanes
    into: _Index
    away: _Index
    cars: list[ParkingSpot]  # free spots, which others may take


def _ways_of_car_park(
    spots: list[ParkingSpot], ground: _Surroundings, *, only_mapped: bool
) -> Iterator[tuple[str, WaysOfSpot]]:
    middles = np.array([spot.position[:2] for spot in spots])
    low, high = middles.min(axis=0) - _AROUND, middles.max(axis=0) + _AROUND
    box = (float(low[0]), float(low[1]), float(high[0]), float(high[1]))
    lanes = _lanes_about(ground, box)
    if not len(lanes.lane):
        return
    free = [spot for spot in spots if spot.car is None]
    raster = _raster(box, ground, [_footprint(spot) for spot in free], only_mapped=only_mapped)
    into, away = (_Index.of(_reachable_poses(raster, lanes, way)) for way in (1, -1))
    park = _CarPark(ground, box, raster, lanes, into, away, free)
    for spot in free:
        ways = _ways_of_spot(spot, park)
        if ways is not None:
            yield spot.id, ways


def _ways_of_spot(spot: ParkingSpot, park: _CarPark) -> WaysOfSpot | None:
    others = [_footprint(other) for other in park.cars if other.id != spot.id]
    things = shapely.STRtree([*park.ground.near(shapely.box(*park.box)), *others])
    bends = [line for line in _bends(spot) if not _touches(things, _beyond(line))]
    into = _way_in(spot, park, bends, things)
    if into is None:
        return None
    out = _way_out(spot, park, bends, things)
    if out is None:
        return None
    return WaysOfSpot(into=into, back=out[0], out=out[1])


def _beyond(line: Floats) -> Floats:
    """Return a line out of a spot with the wheelbase inwards of the spot's middle added, in the direction inwards."""
    inwards = (line[0] - line[1]) / np.hypot(*(line[0] - line[1]))
    return np.concatenate([line[::-1], [line[0] + inwards * _WHEELBASE / 2]])


def _pose(line: Floats, k: int, *, inwards: bool) -> Floats:
    """Return the pose of a car at point k of a line out of a spot, headed into it or away from it."""
    a, b = line[max(k - 1, 0)], line[max(k, 1)]
    yaw = math.atan2(*(a - b)[::-1]) if inwards else math.atan2(*(b - a)[::-1])
    return np.array([*line[k], yaw])


def _way_in(spot: ParkingSpot, park: _CarPark, bends: list[Floats], things: shapely.STRtree) -> WayIntoSpot | None:
    ends = [(line, k) for line in bends for k in range(1, len(line), 3)]
    wanted = [_pose(line, k, inwards=True) for line, k in ends]
    for _, end, node in sorted(park.into.matching(wanted))[:_TRIES]:
        source = int(park.into.poses.source[node])
        lane = int(park.lanes.lane[source])
        bend, k = ends[end]
        line = _smooth_line(
            np.concatenate([park.into.chain(node)[::-1], [wanted[end]]]), park.raster, lane, at_end=True
        )
        if line is None:
            continue
        whole = np.concatenate([line, bend[:k][::-1]])
        if _is_clear(whole, park, things):
            return _record(whole, park.ground.lanes.ids[lane], float(park.lanes.offset[source]))
    return None


def _way_out(
    spot: ParkingSpot, park: _CarPark, bends: list[Floats], things: shapely.STRtree
) -> tuple[list[tuple[float, float]], WayIntoSpot] | None:
    backs, fronts = [], []
    for line in bends:
        end = _pose(line, len(line) - 1, inwards=True)
        back = end[:2] - np.array([math.cos(end[2]), math.sin(end[2])]) * np.array([[_BACK / 2], [_BACK]])
        whole = np.concatenate([line, back])
        if not _touches(things, whole[::-1]):
            backs.append(whole)
            fronts.append(end)
    for _, b, node in sorted(park.away.matching(fronts))[:_TRIES]:
        source = int(park.away.poses.source[node])
        lane = int(park.lanes.lane[source])
        # The car stands with its axles on the straight part, and goes on from its end towards the bend.
        onwards = _smooth_line(np.concatenate([[fronts[b]], park.away.chain(node)]), park.raster, lane, at_end=False)
        if onwards is None:
            continue
        out = np.concatenate([backs[b][-1:], onwards])
        if _is_clear(out, park, things):
            record = _record(out, park.ground.lanes.ids[lane], float(park.lanes.offset[source]))
            return _points(backs[b][::-1]), record
    return None


def _is_clear(line: Floats, park: _CarPark, things: shapely.STRtree) -> bool:
    """Return whether a car can follow a line: it touches nothing, and is not too steep."""
    if _touches(things, line):
        return False
    path = shapely.LineString(line)
    points = shapely.get_coordinates(shapely.line_interpolate_point(path, np.arange(0.0, path.length, 2.0)))
    return bool(np.abs(np.diff(park.ground.height(points))).max(initial=0.0) < 2.0 * _STEEPEST)


def _points(line: Floats) -> list[tuple[float, float]]:
    kept = shapely.get_coordinates(overlay.simplify(shapely.LineString(line), 0.01))
    return [(round(float(x), 3), round(float(y), 3)) for x, y in kept]


def _record(line: Floats, lane: str, offset: float) -> WayIntoSpot:
    return WayIntoSpot(lane=lane, offset=round(offset, 3), line=_points(line))
