"""What is painted on streets, as flat quads: zebra crossings, lane lines, the edges of steps; and rails."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from vico.worldgen.streets import LANE_WIDTH, Street, StreetPolygons

_STRIPE, _STRIPE_PERIOD = 0.5, 1.0  # of a zebra, metres along the walk
_DASH, _DASH_PERIOD = 3.0, 6.0
_LINE = 0.13
_GAUGE = 1.435
_PAINT = (232, 232, 228)
_YELLOW = (226, 184, 70)
_STEEL = (112, 108, 104)
_LINED = {"motorway", "trunk", "primary", "secondary", "tertiary"}


@dataclass(frozen=True)
class Quads:
    """Flat quadrilaterals, counter-clockwise seen from above, metres, shape ``(n, 4, 2)``, of one colour."""

    corners: NDArray[np.float64]
    colour: tuple[int, int, int]


def road_markings(
    streets: StreetPolygons,
    window: Polygon,
    *,
    yellow: bool = False,
    tracks: Sequence[NDArray[np.float64]] = (),
    longest: float | None = None,
) -> list[Quads]:
    """Everything painted on or let into the ground within a window.

    Parameters
    ----------
    streets
        The streets.
    window
        What to keep within.
    yellow
        Whether lines between opposite directions are yellow (the Americas).
    tracks
        Railway lines beside the streets' own tram tracks, metres.
    longest
        Longest piece of a rail or a solid line, metres, so that it can follow sloping ground; None on level ground.
    """
    zebra = [
        quad
        for crossing in streets.crossings
        if crossing.painted
        for quad in _zebra(crossing.start, crossing.end, crossing.width)
    ]
    shapely.prepare(streets.carriageway)
    breaks = _junction_zones(streets)
    dashes: list[NDArray[np.float64]] = []
    middles: list[NDArray[np.float64]] = []
    for street in streets.streets:
        for offset, between_directions in _lane_lines(street):
            line = shapely.offset_curve(LineString(street.line), offset) if offset else LineString(street.line)
            free = shapely.difference(line, breaks)
            target = middles if between_directions and yellow else dashes
            for piece in shapely.get_parts(free):
                if isinstance(piece, LineString) and piece.length > _DASH:
                    target += _dashes(piece, solid=between_directions and yellow, longest=longest)
    rails: list[NDArray[np.float64]] = []
    for line in (*streets.rails, *tracks):
        for side in (-0.5, 0.5):
            rails += _ribbon(_divided(line, longest), side * _GAUGE, 0.09)
    treads = [quad for shape in streets.steps.geoms for quad in _treads(shape)]
    groups = [
        Quads(_within(zebra + dashes, window), _PAINT),
        Quads(_within(middles, window), _YELLOW),
        Quads(_within(rails, window), _STEEL),
        Quads(_within(treads, window), (112, 108, 104)),
    ]
    return [group for group in groups if len(group.corners)]


def _within(quads: list[NDArray[np.float64]], window: Polygon) -> NDArray[np.float64]:
    if not quads:
        return np.zeros((0, 4, 2))
    corners = np.stack(quads)
    west, south, east, north = window.bounds
    low, high = corners.min(axis=1), corners.max(axis=1)
    return corners[(low[:, 0] > west) & (high[:, 0] < east) & (low[:, 1] > south) & (high[:, 1] < north)]


def _zebra(start: tuple[float, float], end: tuple[float, float], width: float) -> list[NDArray[np.float64]]:
    """Bars along the traffic, side by side along the walk, as many as fit with half a gap at either kerb."""
    a, b = np.array(start), np.array(end)
    length = float(np.hypot(*(b - a)))
    count = int((length - 0.2) / _STRIPE_PERIOD)
    if count < 2:
        return []
    along = (b - a) / length
    across = np.array([-along[1], along[0]]) * (width - 0.4) / 2
    first = (length - (count - 1) * _STRIPE_PERIOD - _STRIPE) / 2
    quads = []
    for k in range(count):
        near = a + along * (first + k * _STRIPE_PERIOD)
        far = near + along * _STRIPE
        quads.append(np.array([near - across, far - across, far + across, near + across]))
    return quads


def _lane_lines(street: Street) -> list[tuple[float, bool]]:
    """Offsets of a street's lines from its centre line (left positive), and whether opposite traffic passes there."""
    if street.kind not in _LINED and not (street.lanes >= 2 and street.oneway) and street.width < 6.4:
        return []
    if street.kind in ("service", "living_street") or street.lanes < 2:
        return []
    lane = min(LANE_WIDTH, street.width / street.lanes)
    lines = []
    for k in range(1, street.lanes):
        offset = (k - street.lanes / 2) * lane
        opposite = not street.oneway and k == (street.lanes + 1) // 2
        lines.append((offset if abs(offset) > 1e-6 else 0.0, opposite))
    return lines


def _junction_zones(streets: StreetPolygons) -> BaseGeometry:
    """Where lines stop: around nodes that three or more street ends share, and at crossings."""
    ends: dict[tuple[float, float], list[float]] = {}
    for street in streets.streets:
        for k, point in enumerate(street.line):
            key = (round(float(point[0]), 2), round(float(point[1]), 2))
            share = [street.width] if k in (0, len(street.line) - 1) else [street.width, street.width]
            ends.setdefault(key, []).extend(share)
    zones = [
        shapely.buffer(shapely.Point(point), max(widths) / 2 + 3.0, quad_segs=3)
        for point, widths in ends.items()
        if len(widths) >= 3
    ]
    zones += [shapely.buffer(crossing.polygon, 1.2, join_style="mitre") for crossing in streets.crossings]
    return shapely.union_all(zones)


def _divided(line: NDArray[np.float64], longest: float | None) -> NDArray[np.float64]:
    if longest is None:
        return line
    return np.asarray(shapely.segmentize(LineString(line), longest).coords)


def _dashes(line: LineString, *, solid: bool, longest: float | None) -> list[NDArray[np.float64]]:
    if solid:
        path = _divided(np.asarray(line.coords), longest)
        return _ribbon(path, -0.12, _LINE) + _ribbon(path, 0.12, _LINE)
    count = max(int((line.length + _DASH_PERIOD - _DASH) / _DASH_PERIOD), 1)
    first = (line.length - ((count - 1) * _DASH_PERIOD + _DASH)) / 2
    starts = first + _DASH_PERIOD * np.arange(count)
    a = shapely.get_coordinates(shapely.line_interpolate_point(line, np.maximum(starts, 0.0)))
    b = shapely.get_coordinates(shapely.line_interpolate_point(line, starts + _DASH))
    return [quad for p, q in zip(a, b, strict=True) for quad in _ribbon(np.array([p, q]), 0.0, _LINE)]


def _ribbon(line: NDArray[np.float64], offset: float, width: float) -> list[NDArray[np.float64]]:
    """A strip along a polyline, `offset` to its left, mitred at the bends."""
    along = np.diff(line, axis=0)
    length = np.hypot(*along.T)
    keep = np.concatenate([[True], length > 1e-6])
    line = line[keep]
    if len(line) < 2:
        return []
    along = np.diff(line, axis=0)
    along /= np.hypot(*along.T)[:, None]
    left = np.stack([-along[:, 1], along[:, 0]], axis=1)
    at = np.concatenate([left[:1], left[:-1] + left[1:], left[-1:]])
    size = np.maximum((at**2).sum(axis=1, keepdims=True) / 2, 0.5)
    at[1:-1] /= size[1:-1]
    inner, outer = line + at * (offset - width / 2), line + at * (offset + width / 2)
    return [np.array([inner[i], inner[i + 1], outer[i + 1], outer[i]]) for i in range(len(line) - 1)]


def _treads(shape: Polygon) -> list[NDArray[np.float64]]:
    """The edges of steps: thin lines across the longer side of a flight."""
    box = np.asarray(shapely.minimum_rotated_rectangle(shape).exterior.coords)
    if len(box) < 5 or shape.area < 0.55 * shapely.minimum_rotated_rectangle(shape).area:
        return []
    u, v = box[1] - box[0], box[3] - box[0]
    if np.hypot(*u) < np.hypot(*v):
        u, v = v, u
    length = float(np.hypot(*u))
    if length < 1.0 or float(np.hypot(*v)) < 0.5:
        return []
    along = u / length
    shapely.prepare(shape)
    quads = []
    for place in np.arange(0.3, length - 0.2, 0.36):
        line = LineString([box[0] + along * place, box[0] + along * place + v])
        for piece in shapely.get_parts(shapely.intersection(line, shape)):
            if isinstance(piece, LineString) and piece.length > 0.5:
                quads += _ribbon(np.asarray(piece.coords), 0.0, 0.05)
    return quads
