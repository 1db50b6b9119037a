"""Lanes of a SUMO network redrawn: bends and paths through junctions smoothed, sidewalks beside the carriageway.

netconvert takes the corners of the map as they are, and joins lanes by curves that meet them at an angle. A vehicle
that follows such a line jerks. It puts sidewalks beside the outermost lanes, where cars may park. The sidewalk on the
left of a one-way street is an edge of its own, which comes to lie in the middle of the street where netconvert has
joined one of the two with others. Sidewalks are moved out of what is carriageway, or closed where there is no other
place for them.
"""

from __future__ import annotations

import math
import re
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
import shapely
from defusedxml.ElementTree import fromstring
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geometry import arc_lengths, distance, distances, points_along, wrap_angle

Floats = NDArray[np.float64]

_RADIUS = 7.0  # of a rounded bend, metres, where there is room
_INWARD = 0.8  # metres that a rounded bend may lie within the corner: farther in is the kerb
_BEND = math.radians(6.0)  # less than this is no bend
_PIECE = math.radians(7.0)  # most that a rounded line turns at one point
_WOBBLE = 0.12  # metres off a line that are netconvert's, not the map's
_LEVEL = 0.03  # metres that a point may be off the straight line between those beside it
_JOINT = math.radians(8.0)  # at which a path through a junction is drawn anew
_TURNS_BACK = math.radians(110.0)
_WIDE = 12.0  # metres: a way that turns back over more does so in several bends
_SHORTEST = 0.3  # metres between the ends of a path that is worth a curve

_LANE_WITH_LENGTH = re.compile(rb'<lane id="([^"]*)"([^>]*?) length="[^"]*"([^>]*?) shape="[^"]*"')


@dataclass
class _Path:
    """A vehicle lane while it is smoothed: its line and, along it from 0 to 1, its heights if it has any."""

    line: Floats
    inside: bool
    heights: Floats | None
    changed: bool = False


def smooth_lanes(net: bytes) -> bytes:
    """Return a SUMO network whose lanes for vehicles bend smoothly; ends of street lanes stay where they are."""
    root = fromstring(net, forbid_dtd=True)
    paths = {
        str(lane.get("id")): _path(str(lane.get("shape")), inside=edge.get("function") == "internal")
        for edge in root.iter("edge")
        if edge.get("function", "normal") in ("normal", "internal")
        for lane in edge.findall("lane")
        if lane.get("allow", "") != "pedestrian"
    }
    for path in paths.values():
        if not path.inside:
            smooth = round_corners(path.line)
            path.changed, path.line = not np.array_equal(smooth, path.line), smooth
    for chain in _chains(root, paths):
        _join(chain, paths)
    return _LANE_WITH_LENGTH.sub(lambda found: _write_lane(found, paths), net)


def round_corners(line: Floats, radius: float = _RADIUS) -> Floats:
    """Round the corners of a line, metres, shape ``(n, 2)``; its ends and their directions stay.

    A corner is cut at most as far as the middle of the stretches beside it, and never by much.
    """
    line = shapely.get_coordinates(overlay.simplify(shapely.LineString(line), _WOBBLE))
    if len(line) < 3:
        return line
    step = np.diff(line, axis=0)
    size = np.hypot(*step.T)
    heading = np.arctan2(step[:, 1], step[:, 0])
    found = [line[:1]]
    for k in range(1, len(line) - 1):
        turn = abs(wrap_angle(float(heading[k] - heading[k - 1])))
        if turn < _BEND:
            found.append(line[k : k + 1])
            continue
        half = min(turn, 3.0) / 2
        cut = min(radius * math.tan(half), 2 * _INWARD / math.cos(half), 0.5 * float(size[k - 1]), 0.5 * float(size[k]))
        start = line[k] - step[k - 1] * (cut / size[k - 1])
        end = line[k] + step[k] * (cut / size[k])
        found.append(_arc(start, line[k], end, turn))
    found.append(line[-1:])
    joined = np.concatenate(found)
    keep = np.r_[True, np.hypot(*np.diff(joined, axis=0).T) > 0.01]
    keep[-1] = True
    return joined[keep]


def _arc(start: Floats, corner: Floats, end: Floats, turn: float) -> Floats:
    """Return points of the curve from `start` to `end` that touches both sides of a corner."""
    t = np.linspace(0.0, 1.0, max(math.ceil(turn / _PIECE), 2) + 1)[:, None]
    return (1 - t) ** 2 * start + 2 * t * (1 - t) * corner + t**2 * end


def _path(shape: str, *, inside: bool) -> _Path:
    parts = [point.split(",") for point in shape.split()]
    points = np.array([[*map(float, part), 0.0][:3] for part in parts])
    line = points[:, :2]
    # A height of nought is left out.
    return _Path(
        line, inside, np.c_[_shares_of_length(line), points[:, 2]] if any(len(part) > 2 for part in parts) else None
    )


def _shares_of_length(line: Floats) -> Floats:
    """Return how far along a line its points are, from 0 to 1."""
    along = arc_lengths(line)
    return along / max(float(along[-1]), 1e-9)


def _heading(line: Floats, end: int) -> float:
    """Heading of a line at its start (0) or its end (-1)."""
    a, b = (line[0], line[1]) if end == 0 else (line[-2], line[-1])
    return math.atan2(b[1] - a[1], b[0] - a[0])


def _chains(root: Any, paths: dict[str, _Path]) -> list[list[str]]:
    """Return the ways through junctions: a street lane, the lanes inside, a street lane."""
    after: dict[str, list[tuple[str, str]]] = defaultdict(list)
    for link in root.iter("connection"):
        start, end = f"{link.get('from')}_{link.get('fromLane')}", f"{link.get('to')}_{link.get('toLane')}"
        if start in paths and end in paths:
            after[start].append((link.get("via", ""), end))
    found = []
    for start in after:
        if paths[start].inside:
            continue
        for via, end in after[start]:
            chain = [start]
            while via in paths and via not in chain:
                chain.append(via)
                via = after[via][0][0] if via in after else ""
            found.append([*chain, end])
    return found


def _join(chain: list[str], paths: dict[str, _Path]) -> None:
    """Draw a way through a junction anew where it meets the streets' lanes at an angle, or has a kink."""
    before, *inner, after = (paths[name] for name in chain)
    if not inner or min(len(path.line) for path in (before, after, *inner)) < 2:
        return
    whole = np.concatenate([inner[0].line, *(path.line[1:] for path in inner[1:])])
    chord = distance(whole[-1], whole[0])
    start, end = _heading(before.line, -1), _heading(after.line, 0)
    turn = abs(wrap_angle(end - start))
    if chord < _SHORTEST or (turn > _TURNS_BACK and chord > _WIDE):
        return
    headings = [start, *np.arctan2(*np.diff(whole, axis=0)[np.hypot(*np.diff(whole, axis=0).T) > 0.01].T[::-1]), end]
    if max(abs(wrap_angle(b - a)) for a, b in pairwise(headings)) < _JOINT:
        return
    # So long are the handles of a curve that is nearly an arc.
    reach = chord * (2 / 3 * math.tan(turn / 4) / math.sin(turn / 2) if turn > 0.01 else 1 / 3)
    handles = whole[0] + reach * _unit(start), whole[-1] - reach * _unit(end)
    across = math.atan2(*(whole[-1] - whole[0])[::-1])
    bends = abs(wrap_angle(across - start)) + abs(wrap_angle(end - across))
    t = np.linspace(0.0, 1.0, math.ceil((1.7 * bends + 0.4) / _PIECE) + 2)[:, None]
    curve = (1 - t) ** 3 * whole[0] + 3 * t * (1 - t) ** 2 * handles[0]
    curve += 3 * t**2 * (1 - t) * handles[1] + t**3 * whole[-1]
    # Each lane gets its part of the curve, as long as it was.
    sizes = np.array([np.hypot(*np.diff(path.line, axis=0).T).sum() for path in inner])
    along = arc_lengths(curve)
    marks = np.concatenate([[0.0], np.cumsum(sizes)]) / sizes.sum() * along[-1]
    for path, low, high in zip(inner, marks, marks[1:], strict=False):
        at = np.concatenate([[low], along[(along > low + 0.05) & (along < high - 0.05)], [high]])
        path.line = points_along(curve, at, along)
        path.changed = True


def _unit(heading: float) -> Floats:
    return np.array([math.cos(heading), math.sin(heading)])


def _write_lane(found: re.Match[bytes], paths: dict[str, _Path]) -> bytes:
    """Return a lane's element with its new shape and length, or as it was."""
    path = paths.get(found.group(1).decode())
    if path is None or not path.changed:
        return found.group(0)
    points = path.line
    if path.heights is not None:
        # Where the points of the line are too few for its heights, there are more.
        size = float(np.hypot(*np.diff(points, axis=0).T).sum())
        profile = overlay.simplify(shapely.LineString(path.heights * [size, 1.0]), _LEVEL)
        own = _shares_of_length(points)
        at = np.union1d(own, shapely.get_coordinates(profile)[:, 0] / max(size, 1e-9))
        at = at[np.r_[True, np.diff(at) * size > 0.01]]
        points = np.stack([*(np.interp(at, own, points[:, k]) for k in (0, 1)), np.interp(at, *path.heights.T)], axis=1)
    shape = " ".join(",".join(f"{value:.3f}" for value in point) for point in points.tolist())
    length = max(float(np.hypot(*np.diff(path.line, axis=0).T).sum()), 0.1)
    return b'<lane id="%s"%s length="%.3f"%s shape="%s"' % (
        found.group(1), found.group(2), length, found.group(3), shape.encode(),
    )  # fmt: skip


_BESIDE = 0.75  # metres from the kerb to the line that walkers follow
_LEAST = 0.2  # metres that a line lies within the carriageway to be moved
_MOST = 5.0  # metres beyond which something else is wrong
_STEP = 4.0
_WALL = 0.4  # metres from walls; where there is no room for a sidewalk beside the carriageway it stays where it is
_ACROSS = 15.0  # metres at most from where a sidewalk lies to its place beside the lanes of its street
_IN_LANES = 0.5  # share of a sidewalk's length in lanes from which on it is closed
_SAME_LEVEL = 3.0  # metres; farther above or below lie other streets

_LANE_WITH_SHAPE = re.compile(rb'(<lane id="([^"]*)"[^>]*? shape=")([^"]*)(")')
_ALLOWED = re.compile(rb'(<lane id="([^"]*)"[^>]*? )allow="pedestrian"')


@dataclass(frozen=True)
class CarriagewayEdges:
    """Edges that limit where sidewalks can be.

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


def move_sidewalks(net: bytes, kerbs: CarriagewayEdges, *, left_driving: bool) -> bytes:
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
            moved[name.encode()] = _shape_text(shapely.get_coordinates(line), sidewalk.points)
        near = [int(k) for k in np.sort(bands.query(line, predicate="intersects"))]
        near = [k for k in near if abs(lanes[k].height - sidewalk.height) < _SAME_LEVEL]
        if near:
            covered = overlay.common_length(overlay.union_all(bands.geometries[near]), line)
            if covered > _IN_LANES * line.length:
                closed.add(name.encode())
    net = _LANE_WITH_SHAPE.sub(
        lambda found: found.group(1) + moved.get(found.group(2), found.group(3)) + found.group(4), net
    )
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


def _shape_text(line: Floats, before: Floats) -> bytes:
    """Return a line as a shape, with heights where the line before had them."""
    if before.shape[1] > 2:
        z = np.interp(_shares_of_length(line), _shares_of_length(before[:, :2]), before[:, 2])
        return " ".join(f"{x:.3f},{y:.3f},{h:.3f}" for (x, y), h in zip(line, z, strict=True)).encode()
    return " ".join(f"{x:.3f},{y:.3f}" for x, y in line).encode()


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
