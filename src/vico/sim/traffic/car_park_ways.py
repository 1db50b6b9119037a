"""Ways into the free spots of a world's car parks as traffic takes them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.sim.traffic.path import PATH_POINT
from vico.sim.traffic.records import STOPPING_PLACE, Records
from vico.sim.traffic.state import LaneNetwork
from vico.sim.traffic.stopping import WAY_LEAD
from vico.world.lanes import LaneGraph
from vico.world.street_model import ParkingSpot
from vico.world.walkways import Walkways

_BEYOND = 10.0  # m of lane after a way out that belong to it
_INWARDS = 4.0  # m straight on beyond a spot's middle
_SPARE = 0.3  # m of a spot that a car leaves free
_OFF_LANE, _OFF_WALKWAY, _NEAR_STREET = 0.8, 0.6, 14.0  # m kept from lane and sidewalk by who waits; of way before it

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
        if any(len(tree.query(shapely.LineString(line), predicate="intersects")) for line in _lines_of(spot)):
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
            "longest": spot.length - _SPARE,
            "lot": lots.setdefault(spot.id.rpartition(".")[0], len(lots)),
            "in_rest": into["s"][-1] - _INWARDS,
            "back_rest": back["s"][-1] - _INWARDS,
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


def _lines_of(spot: ParkingSpot) -> list[list[tuple[float, float]]]:
    return [] if spot.ways is None else [spot.ways.into.line, spot.ways.back, spot.ways.out.line]


def _inwards(line: Sequence[tuple[float, float]]) -> Floats:
    """Return a line into a spot that goes straight on beyond its middle."""
    points = np.array(line, np.float64)
    ahead = points[-1] - points[-2]
    return np.concatenate([points, [points[-1] + ahead / np.hypot(*ahead) * _INWARDS]])


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
