"""Sidewalks of the lane network, moved out of what is carriageway, or closed where there is no other place for them.

netconvert puts them beside the outermost lanes, where cars may park. The sidewalk on the left of a one-way street is an
edge of its own, which comes to lie in the middle of the street where netconvert has joined one of the two with others.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element

import numpy as np
import shapely
from defusedxml.ElementTree import fromstring
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geometry import arc_lengths, distances

Floats = NDArray[np.float64]

_BESIDE = 0.75  # metres from the kerb to the line that walkers follow
_LEAST, _MOST = 0.2, 5.0  # metres that a line lies within the carriageway to be moved; beyond, something else is wrong
_STEP = 4.0
_WALL = 0.4  # metres from walls; where there is no room for a sidewalk beside the carriageway it stays where it is
_ACROSS = 15.0  # metres at most from where a sidewalk lies to its place beside the lanes of its street
_IN_LANES = 0.5  # share of a sidewalk's length in lanes from which on nobody walks there
_SAME_LEVEL = 3.0  # metres; farther above or below lie other streets

_LANE = re.compile(rb'(<lane id="([^"]*)"[^>]*? shape=")([^"]*)(")')
_ALLOWED = re.compile(rb'(<lane id="([^"]*)"[^>]*? )allow="pedestrian"')


@dataclass(frozen=True)
class CarriagewayEdges:
    """What says where sidewalks can be.

    Attributes
    ----------
    carriageway
        Kerb to kerb, metres.
    solids
        Footprints of buildings: no sidewalk is moved into them.
    """

    carriageway: BaseGeometry
    solids: Sequence[BaseGeometry]


@dataclass(frozen=True, eq=False)
class _Strip:
    """A lane of a street: its line, shape ``(n, 2)`` or with heights ``(n, 3)``, and its width, metres."""

    points: Floats
    width: float

    @property
    def line(self) -> shapely.LineString:
        """Where it lies."""
        return shapely.LineString(self.points[:, :2])

    @property
    def height(self) -> float:
        """How high it lies, metres; 0 where that is left out."""
        return float(self.points[:, 2].mean()) if self.points.shape[1] > 2 else 0.0


@dataclass(frozen=True, eq=False)
class _Sidewalk(_Strip):
    """A sidewalk, and the lane of vehicles whose left side it is on, if it is an edge of its own."""

    lane: _Strip | None


def sidewalks_beside(net: bytes, kerbs: CarriagewayEdges, *, left_driving: bool) -> bytes:
    """Return a SUMO network whose sidewalks lie beside the carriageway as it is painted.

    Parameters
    ----------
    net
        ``roads.net.xml``, still without heights.
    kerbs
        Where carriageways end and walls stand.
    left_driving
        Whether traffic keeps left, and sidewalks lie to the left of their lanes.

    Returns
    -------
    bytes
        The network. A sidewalk for which there is no place beside the lanes is closed: nobody may use its lane.
    """
    sidewalks, lanes = _streets(net)
    shapely.prepare(kerbs.carriageway)
    walls = shapely.STRtree(list(kerbs.solids))
    out = 1.0 if left_driving else -1.0
    moved: dict[bytes, bytes] = {}
    closed: set[bytes] = set()
    bands = shapely.STRtree([overlay.buffer(lane.line, lane.width / 2, cap_style="flat") for lane in lanes])
    for name, sidewalk in sidewalks.items():
        before = line = sidewalk.line
        if sidewalk.lane is not None:
            line = _offset(line, _to_lane_side(line, sidewalk, sidewalk.lane, out), out, walls)
        line = _offset(line, _to_kerb(line, kerbs.carriageway, out), out, walls)
        if line is not before:
            moved[name.encode()] = _written(shapely.get_coordinates(line), sidewalk.points)
        near = [int(k) for k in np.sort(bands.query(line, predicate="intersects"))]
        near = [k for k in near if abs(lanes[k].height - sidewalk.height) < _SAME_LEVEL]
        if near:
            covered = overlay.common_length(overlay.union_all(bands.geometries[near]), line)
            if covered > _IN_LANES * line.length:
                closed.add(name.encode())
    net = _LANE.sub(lambda found: found.group(1) + moved.get(found.group(2), found.group(3)) + found.group(4), net)
    return _ALLOWED.sub(lambda f: f.group(1) + b'disallow="all"' if f.group(2) in closed else f.group(0), net)


def _streets(net: bytes) -> tuple[dict[str, _Sidewalk], list[_Strip]]:
    """Return the sidewalks of a network's streets by id, and the streets' other lanes."""
    edges = [e for e in fromstring(net, forbid_dtd=True).iter("edge") if e.get("function", "normal") == "normal"]
    driven: dict[tuple[str | None, str | None], list[_Strip]] = defaultdict(list)
    lanes: list[_Strip] = []
    for edge in edges:
        strips = [_Strip(*_read(lane)) for lane in edge.findall("lane") if lane.get("allow", "") != "pedestrian"]
        lanes += strips
        if strips:
            driven[edge.get("to"), edge.get("from")].append(strips[-1])
    sidewalks: dict[str, _Sidewalk] = {}
    for edge in edges:
        own = edge.findall("lane")
        alone = len(own) == 1
        if alone and edge.get("type") == "highway.pedestrian":
            continue
        for lane in own:
            if lane.get("allow", "") == "pedestrian":
                points, width = _read(lane)
                beside = driven[edge.get("from"), edge.get("to")] if alone else []
                line = shapely.LineString(points[:, :2])
                nearest = min(beside, key=lambda strip: float(strip.line.distance(line)), default=None)
                sidewalks[str(lane.get("id"))] = _Sidewalk(points, width, nearest)
    return sidewalks, lanes


def _read(lane: Element) -> tuple[Floats, float]:
    """Return the points of a lane and its width, metres."""
    split = [point.split(",") for point in str(lane.get("shape")).split()]
    high = any(len(point) > 2 for point in split)  # a height of nought is left out
    points = np.array([[*map(float, point), 0.0][: 3 if high else 2] for point in split])
    return points, float(lane.get("width", 3.2))


def _written(line: Floats, before: Floats) -> bytes:
    """Return a line as a shape, with heights where the line before had them."""
    if before.shape[1] > 2:
        z = np.interp(_shares(line), _shares(before[:, :2]), before[:, 2])
        return " ".join(f"{x:.3f},{y:.3f},{h:.3f}" for (x, y), h in zip(line, z, strict=True)).encode()
    return " ".join(f"{x:.3f},{y:.3f}" for x, y in line).encode()


def _shares(line: Floats) -> Floats:
    """How far along a line its points are, from 0 to 1."""
    along = arc_lengths(line)
    return along / max(float(along[-1]), 1e-9)


def _offset(line: shapely.LineString, shift: float, out: float, walls: shapely.STRtree) -> shapely.LineString:
    """Return a line moved outwards (`out`: to its left) by so many metres, itself where there is no room for that."""
    if shift == 0.0:
        return line
    beside = overlay.offset_curve(line, out * shift)
    if beside.geom_type != "LineString" or beside.is_empty or beside.length < 0.5 * line.length:
        return line
    return line if len(walls.query(beside, predicate="dwithin", distance=_WALL)) else beside


def _to_lane_side(line: shapely.LineString, sidewalk: _Strip, lane: _Strip, out: float) -> float:
    """Metres to move a sidewalk outwards so that it lies beside a lane, 0 where it does or is too far away."""
    at, normal = _points_along(line, out)
    nearest = shapely.line_interpolate_point(lane.line, shapely.line_locate_point(lane.line, shapely.points(at)))
    beyond = ((at - shapely.get_coordinates(nearest)) * normal).sum(axis=1)
    shift = (lane.width + sidewalk.width) / 2 - float(np.median(beyond))
    return shift if _LEAST < shift < _ACROSS else 0.0


def _to_kerb(line: shapely.LineString, carriageway: BaseGeometry, out: float) -> float:
    """Metres to move a sidewalk outwards so that it lies beyond the kerb, 0 where it does or has nowhere to go."""
    deep = float(np.median(_depths(*_points_along(line, out), carriageway)))
    return deep + _BESIDE if _LEAST < deep < _MOST else 0.0


def _points_along(line: shapely.LineString, out: float) -> tuple[Floats, Floats]:
    """Return points along a line and the unit vectors outwards there, each of shape ``(n, 2)``."""
    count = max(int(line.length / _STEP), 1)
    along = (np.arange(count) + 0.5) * (line.length / count)
    at = shapely.get_coordinates(shapely.line_interpolate_point(line, along))
    on = shapely.get_coordinates(shapely.line_interpolate_point(line, np.minimum(along + 0.1, line.length)))
    step = (on - at) / np.maximum(distances(on, at), 1e-9)[:, None]
    return at, out * np.stack([-step[:, 1], step[:, 0]], axis=1)


def _depths(at: Floats, normal: Floats, carriageway: BaseGeometry) -> Floats:
    """How far points lie within an area, along their normals, metres; 0 outside of it."""
    reach = np.arange(0.0, _MOST + 0.26, 0.25)
    points = at[:, None, :] + reach[None, :, None] * normal[:, None, :]
    outside = ~shapely.contains_xy(carriageway, points[..., 0], points[..., 1])
    return reach[np.where(outside.any(axis=1), outside.argmax(axis=1), len(reach) - 1)]
