"""What is painted on streets, as flat quads: crossings, stop lines, lane lines, cycle lanes, bays; and rails."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.osm import polygons_of
from vico.worldgen.facts.bays import bay_borders, free_pieces, junction_zones, lot_rows, stands_across
from vico.worldgen.facts.expendable import expendable
from vico.worldgen.facts.streets import LANE_WIDTH, Crossing, Street, StreetPolygons

_STRIPE, _STRIPE_PERIOD = 0.5, 1.0  # of a zebra, metres along the walk
_DASH, _DASH_PERIOD = 3.0, 6.0
_LINE = 0.13
_GAUGE = 1.435
_PAINT = (232, 232, 228)
_YELLOW = (226, 184, 70)
_FADED = (206, 205, 200)
_CYCLE = (148, 92, 78)
_CYCLE_WIDTH = 1.5
_STOP = 0.4  # width of a stop line, metres
_STEEL = (112, 108, 104)
_LINED = {"motorway", "trunk", "primary", "secondary", "tertiary"}


@dataclass(frozen=True)
class Quads:
    """Flat quadrilaterals, counter-clockwise seen from above, metres, shape ``(n, 4, 2)``, of one colour.

    `low` says whether they lie on the carriageway rather than beside it; those of a higher `rank` lie on top.
    """

    corners: NDArray[np.float64]
    colour: tuple[int, int, int]
    low: bool = True
    rank: int = 1


def road_markings(
    streets: StreetPolygons,
    window: Polygon,
    *,
    yellow: bool = False,
    tracks: Sequence[NDArray[np.float64]] = (),
    longest: float | None = None,
    left_driving: bool = False,
    stepped: BaseGeometry | None = None,
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
    left_driving
        Whether traffic keeps left.
    stepped
        Stairs built of real steps, which need no painted ones.
    """
    zebra: list[NDArray[np.float64]] = []
    for crossing in streets.crossings:
        if crossing.painted:
            with expendable(crossing.id):
                zebra += _crossing(crossing)
    zebra += _stop_lines(streets, left_driving)
    shapely.prepare(streets.carriageway)
    breaks = junction_zones(streets)
    dashes: list[NDArray[np.float64]] = []
    middles: list[NDArray[np.float64]] = []
    for street in streets.streets:
        with expendable(f"w{street.way}"):
            for between_directions, quads in _painted_lines(street, breaks, yellow=yellow, longest=longest):
                target = middles if between_directions and yellow else dashes
                target += quads
    rails: list[NDArray[np.float64]] = []
    for line in (*streets.rails, *tracks):
        for side in (-0.5, 0.5):
            rails += _ribbon(_divided(line, longest), side * _GAUGE, 0.09)
    painted = streets.steps if stepped is None else overlay.difference(streets.steps, overlay.buffer(stepped, 0.1))
    treads: list[NDArray[np.float64]] = []
    for shape in polygons_of(painted, 0.5):
        with expendable(_placed("stairs", shape)):
            treads += _treads(shape)
    lanes, edges = _kerbside(streets, breaks, longest)
    bays: list[NDArray[np.float64]] = []
    for shape in streets.parking.geoms:
        with expendable(_placed("car park", shape)):
            bays += _car_park(shape)
    groups = [
        Quads(_within(lanes, window), _CYCLE, rank=0),
        Quads(_within(zebra + dashes + edges, window), _PAINT),
        Quads(_within(middles, window), _YELLOW),
        Quads(_within(rails, window), _STEEL),
        Quads(_within(treads, window), (112, 108, 104), low=False),
        Quads(_within(bays, window), _FADED, low=False),
    ]
    return [group for group in groups if len(group.corners)]


def _placed(what: str, shape: Polygon) -> str:
    """Name a piece of ground that several objects of the map may share."""
    x, y = shape.bounds[:2]
    return f"{what} at {x:.1f}, {y:.1f}"


def _painted_lines(
    street: Street, breaks: BaseGeometry, *, yellow: bool, longest: float | None
) -> list[tuple[bool, list[NDArray[np.float64]]]]:
    """Return a street's lines: whether each parts opposite directions, and its quads."""
    found: list[tuple[bool, list[NDArray[np.float64]]]] = []
    for offset, between_directions in _lane_lines(street):
        line = overlay.offset_curve(LineString(street.line), offset) if offset else LineString(street.line)
        for piece in shapely.get_parts(overlay.difference(line, breaks)):
            if isinstance(piece, LineString) and piece.length > _DASH:
                quads = _dashes(piece, solid=between_directions and yellow, longest=longest)
                found.append((between_directions, quads))
    return found


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


def _crossing(crossing: Crossing) -> list[NDArray[np.float64]]:
    """Paint a crossing by its kind."""
    bars = _zebra(crossing.start, crossing.end, crossing.width)
    if crossing.marking == "zebra" or not bars:
        return bars
    a, b = np.array(crossing.start), np.array(crossing.end)
    along = (b - a) / np.hypot(*(b - a))
    across = np.array([-along[1], along[0]]) * (crossing.width / 2 - 0.2)
    line = np.array([a + 0.3 * along, b - 0.3 * along])
    sides = [line + across, line - across]
    if crossing.marking in ("lines", "ladder"):
        lines = [quad for side in sides for quad in _ribbon(side, 0.0, 0.25)]
        return lines + bars if crossing.marking == "ladder" else lines
    step, size = (1.0, 0.5) if crossing.marking == "dashes" else (0.6, 0.25)
    length = float(np.hypot(*(line[1] - line[0])))
    return [
        quad
        for side in sides
        for place in np.arange(0.1, length - size, step)
        for quad in _ribbon(np.array([side[0] + along * place, side[0] + along * (place + size)]), 0.0, 0.4)
    ]


def _stop_lines(streets: StreetPolygons, left_driving: bool) -> list[NDArray[np.float64]]:
    """Lines across the lanes that come to a crossing with signals, or to a painted one of a main street."""
    if not streets.streets:
        return []
    lines = [LineString(street.line) for street in streets.streets]
    tree = shapely.STRtree(lines)
    found: list[NDArray[np.float64]] = []
    for crossing in streets.crossings:
        if not crossing.painted:
            continue
        walk = LineString([crossing.start, crossing.end])
        for k in np.sort(tree.query(walk, predicate="intersects")):
            street, line = streets.streets[int(k)], lines[int(k)]
            if street.kind != "service" and (crossing.signals or street.kind in _LINED):
                with expendable(crossing.id):
                    found += _stop_lines_of(crossing, street, line, walk, left_driving)
    return found


def _stop_lines_of(
    crossing: Crossing, street: Street, line: LineString, walk: LineString, left_driving: bool
) -> list[NDArray[np.float64]]:
    """Lines on both sides of a crossing (`walk`) of one street (`line`), or on the one that its traffic comes from."""
    found: list[NDArray[np.float64]] = []
    place = float(line.project(overlay.crossing(walk, line).centroid))
    for ahead in (1.0,) if street.oneway else (1.0, -1.0):
        at = place - ahead * (crossing.width / 2 + 1.1)
        if not 0.5 < at < line.length - 0.5:
            continue
        here, there = (np.asarray(line.interpolate(v).coords[0]) for v in (at, at + 0.2))
        u = (there - here) / max(float(np.hypot(*(there - here))), 1e-9) * ahead
        right = np.array([u[1], -u[0]]) * (-1.0 if left_driving else 1.0)
        inner = -street.width / 2 + 0.3 if street.oneway else 0.1
        ends = np.array([here + right * inner, here + right * (street.width / 2 - 0.3)])
        found += _ribbon(ends, 0.0, _STOP)
    return found


def _kerbside(
    streets: StreetPolygons, breaks: BaseGeometry, longest: float | None
) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    """Cycle lanes as coloured strips, and the lines that part them and parking lanes from the traffic, with bays."""
    lanes: list[NDArray[np.float64]] = []
    edges: list[NDArray[np.float64]] = []
    for street in streets.streets:
        with expendable(f"w{street.way}"):
            own_lanes, own_edges = _kerbside_of(street, breaks, longest)
            lanes += own_lanes
            edges += own_edges
    return lanes, edges


def _kerbside_of(
    street: Street, breaks: BaseGeometry, longest: float | None
) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    """Lanes and edges along the kerbs of one street."""
    lanes: list[NDArray[np.float64]] = []
    edges: list[NDArray[np.float64]] = []
    for side, parking, cycle in (
        (1.0, street.parking_left, street.cycle_left),
        (-1.0, street.parking_right, street.cycle_right),
    ):
        if not parking and not cycle:
            continue
        outer = street.width / 2 - parking
        for piece in free_pieces(street, side * outer, breaks):
            path = _divided(np.asarray(piece.coords), longest)
            if parking:
                edges += _ribbon(path, 0.0, 0.1)
                for place in bay_borders(piece, slanted=stands_across(street, parking)):
                    a, b = (np.asarray(piece.interpolate(v).coords[0]) for v in (place, place + 0.1))
                    u = (b - a) / max(float(np.hypot(*(b - a))), 1e-9)
                    out = side * np.array([-u[1], u[0]])
                    edges += _ribbon(np.array([a, a + out * (parking - 0.2)]), 0.0, 0.1)
        if cycle:
            for piece in free_pieces(street, side * (outer - _CYCLE_WIDTH / 2 - 0.1), breaks):
                path = _divided(np.asarray(piece.coords), longest)
                lanes += _ribbon(path, 0.0, _CYCLE_WIDTH)
                edges += _ribbon(path, -side * (_CYCLE_WIDTH / 2), _LINE)
    return lanes, edges


def _car_park(shape: Polygon) -> list[NDArray[np.float64]]:
    """Lines between the bays of a car park."""
    return [quad for row in lot_rows(shape) for line in row for quad in _ribbon(line, 0.0, 0.1)]


def pitch_lines(shape: Polygon, sport: str) -> list[NDArray[np.float64]]:
    """Lay out the lines of a sports field, fitted into its outline; empty for sports without."""
    box = shapely.minimum_rotated_rectangle(shape)
    if not isinstance(box, Polygon) or shape.area < 0.75 * box.area or shape.area < 80.0:
        return []
    corner = np.asarray(box.exterior.coords)[:4]
    u, v = corner[1] - corner[0], corner[3] - corner[0]
    if np.hypot(*u) < np.hypot(*v):
        u, v = v, u
    length, width = float(np.hypot(*u)), float(np.hypot(*v))
    u, v = u / length, v / width
    middle = corner.mean(axis=0)

    def at(points: list[tuple[float, float]]) -> NDArray[np.float64]:
        return np.array([middle + u * x + v * y for x, y in points])

    def frame(x0: float, y0: float, x1: float, y1: float) -> NDArray[np.float64]:
        return at([(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)])

    def circle(x: float, radius: float, start: float = 0.0, end: float = 360.0) -> NDArray[np.float64]:
        turn = np.radians(np.linspace(start, end, 25))
        return at([(x + radius * float(np.cos(t)), radius * float(np.sin(t))) for t in turn])

    name = sport.split(";")[0]
    if name == "tennis":
        a, b = min(length / 2 - 0.5, 11.885), min(width / 2 - 0.5, 5.485)
        s, net = b * 0.75, a * 0.5385
        lines = [frame(-a, -b, a, b), frame(-a, -s, a, s), frame(-net, -s, net, s), at([(-net, 0), (net, 0)])]
        lines.append(at([(0, -b), (0, b)]))
        thick = 0.06
    elif name in ("basketball", "multi", "netball", "streetball"):
        a, b = min(length / 2 - 0.4, 14.0), min(width / 2 - 0.4, 7.5)
        lines = [frame(-a, -b, a, b), at([(0, -b), (0, b)]), circle(0.0, min(1.8, b / 2))]
        for side in (-1.0, 1.0):
            basket, key = side * (a - 1.575), min(5.8, a * 0.45)
            lines.append(frame(side * a, -min(2.45, b), side * (a - key), min(2.45, b)))
            first = 90.0 if side > 0 else -90.0
            lines.append(circle(basket, min(6.75, b - 0.3), first, first + 180.0))
        thick = 0.07
    elif name in ("soccer", "football", "futsal", "handball"):
        a, b = length / 2 - 1.0, width / 2 - 1.0
        lines = [frame(-a, -b, a, b), at([(0, -b), (0, b)]), circle(0.0, min(9.15, 0.27 * b))]
        for side in (-1.0, 1.0):
            for deep, broad in ((16.5, 20.16), (5.5, 9.16)):
                deep, broad = min(deep, 0.32 * a), min(broad, broad / 34.0 * b)
                lines.append(frame(side * a, -broad, side * (a - deep), broad))
        thick = 0.12
    else:
        return []
    return [quad for line in lines for quad in _ribbon(line, 0.0, thick)]


def _lane_lines(street: Street) -> list[tuple[float, bool]]:
    """Offsets of a street's lines from its centre line (left positive), and whether opposite traffic passes there."""
    if street.kind not in _LINED and not (street.lanes >= 2 and street.oneway) and street.width < 6.4:
        return []
    if street.kind in ("service", "living_street") or street.lanes < 2:
        return []
    # Parking and cycle lanes at the kerbs are not the traffic's.
    left = street.parking_left + (1.7 if street.cycle_left else 0.0)
    right = street.parking_right + (1.7 if street.cycle_right else 0.0)
    lane = min(LANE_WIDTH, (street.width - left - right) / street.lanes)
    lines = []
    for k in range(1, street.lanes):
        offset = (k - street.lanes / 2) * lane + (right - left) / 2
        opposite = not street.oneway and k == (street.lanes + 1) // 2
        lines.append((offset if abs(offset) > 1e-6 else 0.0, opposite))
    return lines


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
    """Make a strip along a polyline, `offset` to its left, mitred at the bends."""
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
    """Draw the edges of steps: thin lines across the longer side of a flight."""
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
        for piece in shapely.get_parts(overlay.intersection(line, shape)):
            if isinstance(piece, LineString) and piece.length > 0.5:
                quads += _ribbon(np.asarray(piece.coords), 0.0, 0.05)
    return quads
