"""Road markings and lines of sports fields as flat quads: crossings, stop lines, lanes, bays; and rails let in.

Strokes of paint are strips along lines, and dashed lines.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.overlay import polygons_of
from vico.geometry import distance
from vico.worldgen.facts.fault_isolation import NamedShape, buffer_named, drop_on_failure
from vico.worldgen.facts.street_habits import Markings
from vico.worldgen.facts.streets import (
    LANE_WIDTH,
    Crossing,
    Street,
    StreetPolygons,
    bay_borders,
    free_pieces,
    is_perpendicular_parking,
    junction_zones,
    lot_rows,
)

_LEAST = 1e-4  # square metres of a cut quad that are worth drawing


def ribbon(line: NDArray[np.float64], offset: float, width: float) -> list[NDArray[np.float64]]:
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


def subdivide_line(line: NDArray[np.float64], longest: float | None) -> NDArray[np.float64]:
    """Divide a polyline into steps of at most `longest` metres; None leaves it as it is."""
    if longest is None:
        return line
    return np.asarray(shapely.segmentize(LineString(line), longest).coords)


def _dashed_strokes(line: LineString, dash: float, gap: float, width: float) -> list[NDArray[np.float64]]:
    """Draw dashes along a line, as many as fit, the same rest at both ends; none where not even two fit.

    One dash alone on the asphalt says nothing to a driver, and nobody paints it.
    """
    count = int((line.length + gap) / (dash + gap))
    if count < 2:
        return []
    first = (line.length - (count * (dash + gap) - gap)) / 2
    starts = first + (dash + gap) * np.arange(count)
    a = shapely.get_coordinates(shapely.line_interpolate_point(line, starts))
    b = shapely.get_coordinates(shapely.line_interpolate_point(line, starts + dash))
    return [quad for p, q in zip(a, b, strict=True) for quad in ribbon(np.array([p, q]), 0.0, width)]


def clip_quads(quads: Sequence[NDArray[np.float64]], window: Polygon) -> NDArray[np.float64]:
    """Return what of convex quads lies within a square, as quads, shape ``(n, 4, 2)``.

    What lies across its side ends there: the tile on the other side of it draws the rest.
    """
    if not len(quads):
        return np.zeros((0, 4, 2))
    corners = np.stack(quads)
    west, south, east, north = window.bounds
    low, high = corners.min(axis=1), corners.max(axis=1)
    inside = (low >= (west, south)).all(axis=1) & (high <= (east, north)).all(axis=1)
    meets = (high > (west, south)).all(axis=1) & (low < (east, north)).all(axis=1)
    across = corners[meets & ~inside]
    parts = overlay.intersection(shapely.polygons(across), window) if len(across) else ()
    rest = [quad for part in parts for shape in polygons_of(part, _LEAST) for quad in _quads_of(shape)]
    return np.concatenate([corners[inside], np.array(rest).reshape(-1, 4, 2)])


def _quads_of(shape: Polygon) -> list[NDArray[np.float64]]:
    """Divide a convex polygon into quads, counter-clockwise; of a triangle one has a corner amid a side."""
    ring = shapely.get_coordinates(shapely.orient_polygons(shape).exterior)[:-1]
    found: list[NDArray[np.float64]] = []
    for k in range(1, len(ring) - 1, 2):
        fan = ring[[0, *range(k, min(k + 3, len(ring)))]]
        found.append(fan if len(fan) == 4 else np.array([fan[0], fan[1], (fan[1] + fan[2]) / 2, fan[2]]))
    return found


_STRIPE = 0.5  # metres, breadth of a stripe of a zebra
_STRIPE_PERIOD = 1.0  # metres from stripe to stripe
# Rows of marks at both sides: metres from one to the next, along the walk and across it.
_ROWS = {
    "dashes": (1.0, 0.5, 0.4),
    "dots": (0.6, 0.25, 0.4),
    "broken_lines": (0.7, 0.5, 0.12),
    "studs": (0.45, 0.1, 0.1),
}


def _zebra(start: tuple[float, float], end: tuple[float, float], width: float) -> list[NDArray[np.float64]]:
    """Bars along the traffic, side by side along the walk, as many as fit with half a gap at either kerb."""
    a, b = np.array(start), np.array(end)
    length = distance(b, a)
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


def crossing_paint(crossing: Crossing) -> list[NDArray[np.float64]]:
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
        lines = [quad for side in sides for quad in ribbon(side, 0.0, 0.25)]
        return lines + bars if crossing.marking == "ladder" else lines
    step, size, wide = _ROWS[crossing.marking]
    length = distance(line[1], line[0])
    return [
        quad
        for side in sides
        for place in np.arange(0.1, length - size, step)
        for quad in ribbon(np.array([side[0] + along * place, side[0] + along * (place + size)]), 0.0, wide)
    ]


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
    return [quad for line in lines for quad in ribbon(line, 0.0, thick)]


_LEAST_SOLID = 6.0  # metres of a solid line between two junctions that are worth painting
_GAUGE = 1.435
_STRAIGHT = 0.001  # metres that points of a straight line may lie off it
_PAINT = (232, 232, 228)
_YELLOW = (226, 184, 70)
_FADED = (206, 205, 200)
_CYCLE_WIDTH = 1.5
_STEEL, _GROOVE, _SLEEPERS = (134, 131, 127), (46, 45, 44), (84, 77, 70)
_HEAD = 0.075  # metres, breadth of a rail's head
_GROOVE_WIDTH = 0.05  # metres, breadth of the groove beside it
_SLEEPER_GAP = 0.65  # metres from sleeper to sleeper
_SLEEPER = (0.26, 2.5)  # metres, a sleeper along and across the track
_LINED = {"motorway", "trunk", "primary", "secondary", "tertiary"}
_OVERPAINTED = 0.2  # share of a mark that lies on another crossing, above which it is left out
_AT_KERB = 0.8  # metres from a kerb within which lines follow it
_USUAL = Markings()


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
    habits: Markings = _USUAL,
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
        The square to keep within: marks end at its sides.
    habits
        How lines are painted where the place lies.
    tracks
        Railway lines beside the streets' own tram tracks, metres.
    longest
        Longest piece of a rail or a solid line, metres, so that it can follow sloping ground; None on level ground.
    left_driving
        Whether traffic keeps left.
    stepped
        Stairs built of real steps, which need no painted ones.
    """
    zebra = _crossing_marks(streets.crossings)
    zebra += _stop_lines(streets, left_driving, habits.stop)
    shapely.prepare(streets.carriageway)
    breaks = junction_zones(streets)
    parting = overlay.union_all([breaks, *_meetings(streets)])
    dashes: list[NDArray[np.float64]] = []
    yellow: list[NDArray[np.float64]] = []
    for street in streets.streets:
        with drop_on_failure(f"w{street.way}"):
            for between_directions, quads in _painted_lines(street, parting, habits, longest=longest):
                target = yellow if between_directions and habits.centre == "yellow" else dashes
                target += quads
    if habits.kerb_lines == "double_yellow":
        yellow += _kerb_lines(streets, parting, longest)
    beside, across = _split_at_streets(tracks, streets)
    # Trams have beds of their own, too: lawns and pavements higher than the street, where they lie as high.
    off_street, in_street = _split_at_streets(streets.rails, streets)
    rails, grooves = _rails([*in_street, *across], longest)
    flush, flush_grooves = _rails(off_street, longest)
    bare, sleepers = _rails(beside, longest)[0], _sleepers(tracks, streets)
    painted = streets.steps if stepped is None else overlay.difference(streets.steps, overlay.buffer(stepped, 0.1))
    treads: list[NDArray[np.float64]] = []
    for shape in polygons_of(painted, 0.5):
        with drop_on_failure(_name_at("stairs", shape)):
            treads += _treads(shape)
    lanes, edges = _kerbside(streets, breaks, longest, habits.line)
    bays: list[NDArray[np.float64]] = []
    for shape in streets.parking.geoms:
        with drop_on_failure(_name_at("car park", shape)):
            bays += [quad for row in lot_rows(shape) for line in row for quad in ribbon(line, 0.0, 0.1)]
    groups = [
        Quads(clip_quads(lanes if habits.cycle_lane else [], window), habits.cycle_lane or _PAINT, rank=0),
        Quads(clip_quads(zebra + dashes + edges, window), _PAINT),
        Quads(clip_quads(yellow, window), _YELLOW),
        Quads(clip_quads(sleepers, window), _SLEEPERS, low=False, rank=0),
        Quads(clip_quads(bare, window), _STEEL, low=False),
        Quads(clip_quads(grooves, window), _GROOVE),
        Quads(clip_quads(flush_grooves, window), _GROOVE, low=False),
        Quads(clip_quads(rails, window), _STEEL, rank=2),
        Quads(clip_quads(flush, window), _STEEL, low=False, rank=2),
        Quads(clip_quads(treads, window), (112, 108, 104), low=False),
        Quads(clip_quads(bays, window), _FADED, low=False),
    ]
    return [group for group in groups if len(group.corners)]


def _crossing_marks(crossings: Sequence[Crossing]) -> list[NDArray[np.float64]]:
    """Paint crossings; where the strips of two lie over each other, the one that comes later has no mark."""
    marks: list[NDArray[np.float64]] = []
    strips: list[BaseGeometry] = []
    for crossing in crossings:
        if not crossing.painted:
            continue
        with drop_on_failure(crossing.id):
            own, strip = crossing_paint(crossing), crossing.polygon
            under = [other for other in strips if other.intersects(strip)]
            if under and own:
                taken = overlay.union_all(under)
                shapes = shapely.polygons(own)
                covered = overlay.common_area(shapes, taken) > _OVERPAINTED * shapely.area(shapes)
                own = [quad for quad, hidden in zip(own, covered.tolist(), strict=True) if not hidden]
            marks += own
            strips.append(strip)
    return marks


def _rails(
    lines: Sequence[NDArray[np.float64]], longest: float | None
) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    """Return the heads of the rails of tracks, and the grooves beside them where they lie in streets."""
    rails: list[NDArray[np.float64]] = []
    grooves: list[NDArray[np.float64]] = []
    for line in lines:
        for side in (-0.5, 0.5):
            rails += ribbon(subdivide_line(line, longest), side * _GAUGE, _HEAD)
            grooves += ribbon(subdivide_line(line, longest), side * (_GAUGE - _HEAD - _GROOVE_WIDTH), _GROOVE_WIDTH)
    return rails, grooves


def _split_at_streets(
    tracks: Sequence[NDArray[np.float64]], streets: StreetPolygons
) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    """Return what of tracks lies beside streets, as high as what is there, and what leads across them, let in."""
    parts: tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]] = ([], [])
    for line in tracks:
        fine = subdivide_line(line, 1.0)
        inside = shapely.contains_xy(streets.carriageway, *((fine[1:] + fine[:-1]) / 2).T)
        if not inside.any():
            parts[0].append(line)
            continue
        cuts = [0, *(np.flatnonzero(inside[1:] != inside[:-1]) + 1).tolist(), len(inside)]
        for first, last in pairwise(cuts):
            # What was divided to be looked at goes on in whole pieces.
            part = overlay.simplify(LineString(fine[first : last + 1]), _STRAIGHT)
            parts[int(inside[first])].append(np.asarray(part.coords))
    return parts


def _sleepers(tracks: Sequence[NDArray[np.float64]], streets: StreetPolygons) -> list[NDArray[np.float64]]:
    """Return the sleepers of tracks, but where a street or a footway leads across."""
    found = [quad for line in tracks for quad in _across(line)]
    if not found:
        return []
    x, y = np.mean(found, axis=1).T
    paved = [shapely.contains_xy(shape, x, y) for shape in (streets.carriageway, streets.sidewalk, streets.pedestrian)]
    return [quad for quad, covered in zip(found, np.any(paved, axis=0).tolist(), strict=True) if not covered]


def _across(line: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Return the sleepers of a track."""
    lengths = np.hypot(*np.diff(line, axis=0).T)
    ends = np.cumsum(lengths)
    at = np.arange(_SLEEPER_GAP / 2, ends[-1], _SLEEPER_GAP)
    piece = np.minimum(np.searchsorted(ends, at), len(lengths) - 1)
    along = np.diff(line, axis=0)[piece] / np.maximum(lengths[piece], 1e-9)[:, None]
    middle = line[piece] + along * (at - ends[piece] + lengths[piece])[:, None]
    forward, left = along * _SLEEPER[0] / 2, np.stack([-along[:, 1], along[:, 0]], axis=1) * _SLEEPER[1] / 2
    return list(
        np.stack(
            [middle - forward - left, middle + forward - left, middle + forward + left, middle - forward + left], axis=1
        )
    )


def _name_at(what: str, shape: Polygon) -> str:
    """Name a piece of ground that several objects of the map may share."""
    x, y = shape.bounds[:2]
    return f"{what} at {x:.1f}, {y:.1f}"


def _painted_lines(
    street: Street, breaks: BaseGeometry, habits: Markings, *, longest: float | None
) -> list[tuple[bool, list[NDArray[np.float64]]]]:
    """Return a street's lines: whether each parts opposite directions, and its quads."""
    found: list[tuple[bool, list[NDArray[np.float64]]]] = []
    for offset, between_directions in _lane_lines(street):
        line = overlay.offset_curve(LineString(street.line), offset) if offset else LineString(street.line)
        for piece in shapely.get_parts(overlay.difference(line, breaks)):
            if not isinstance(piece, LineString):
                continue
            if not (between_directions and habits.solid_centre):
                found.append((between_directions, _dashed_strokes(piece, habits.dash, habits.gap, habits.line)))
            elif piece.length > _LEAST_SOLID:
                path = subdivide_line(np.asarray(piece.coords), longest)
                quads = [quad for side in (-1.0, 1.0) for quad in ribbon(path, side * habits.line, habits.line)]
                found.append((True, quads))
    return found


def _meetings(streets: StreetPolygons) -> list[BaseGeometry]:
    """Where the carriageways of two streets that meet at a junction lie over each other: neither has lines there."""
    ends: dict[tuple[float, float], set[int]] = {}
    for k, street in enumerate(streets.streets):
        for point in street.line[[0, -1]]:
            ends.setdefault((round(float(point[0]), 2), round(float(point[1]), 2)), set()).add(k)
    pairs = sorted({pair for meeting in ends.values() if len(meeting) > 2 for pair in combinations(sorted(meeting), 2)})
    if not pairs:
        return []
    lines = [NamedShape(f"w{street.way}.{k}", LineString(street.line)) for k, street in enumerate(streets.streets)]
    widths = np.array([street.width / 2 for street in streets.streets])
    strips = {one.id: one.shape for one in buffer_named(lines, widths, cap_style="flat")}
    found: list[BaseGeometry] = []
    for a, b in pairs:
        one, other = strips.get(lines[a].id), strips.get(lines[b].id)
        if one is not None and other is not None:
            with drop_on_failure(f"w{streets.streets[a].way}"):
                found.append(overlay.areas_of(overlay.intersection(one, other)))
    return found


def _kerb_lines(streets: StreetPolygons, breaks: BaseGeometry, longest: float | None) -> list[NDArray[np.float64]]:
    """Two lines along the kerbs of main streets, but where cars may park, and where there is no kerb after all."""
    kerb = overlay.buffer(shapely.boundary(streets.carriageway), _AT_KERB, quad_segs=1)
    found: list[NDArray[np.float64]] = []
    for street in streets.streets:
        if street.kind.removesuffix("_link") not in _LINED or not street.kerbed:
            continue
        with drop_on_failure(f"w{street.way}"):
            for side, parking in ((1.0, street.parking_left), (-1.0, street.parking_right)):
                for piece in free_pieces(street, side * (street.width / 2 - 0.3), breaks) if not parking else ():
                    for part in shapely.get_parts(overlay.intersection(piece, kerb)):
                        if isinstance(part, LineString) and part.length > _LEAST_SOLID:
                            path = subdivide_line(np.asarray(overlay.simplify(part, 0.03).coords), longest)
                            found += [quad for shift in (-0.1, 0.1) for quad in ribbon(path, shift, 0.1)]
    return found


def _stop_lines(streets: StreetPolygons, left_driving: bool, thick: float) -> list[NDArray[np.float64]]:
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
                with drop_on_failure(crossing.id):
                    # On both sides of the crossing, or on the one that the street's traffic comes from
                    stop_lines: list[NDArray[np.float64]] = []
                    place = float(line.project(overlay.crossing(walk, line).centroid))
                    for ahead in (1.0,) if street.oneway else (1.0, -1.0):
                        at = place - ahead * (crossing.width / 2 + 1.1)
                        if not 0.5 < at < line.length - 0.5:
                            continue
                        here, there = (np.asarray(line.interpolate(v).coords[0]) for v in (at, at + 0.2))
                        u = (there - here) / max(distance(there, here), 1e-9) * ahead
                        right = np.array([u[1], -u[0]]) * (-1.0 if left_driving else 1.0)
                        inner = -street.width / 2 + 0.3 if street.oneway else 0.1
                        ends = np.array([here + right * inner, here + right * (street.width / 2 - 0.3)])
                        stop_lines += ribbon(ends, 0.0, thick)
                    found += stop_lines
    return found


def _kerbside(
    streets: StreetPolygons, breaks: BaseGeometry, longest: float | None, thick: float
) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    """Cycle lanes as coloured strips, and the lines that part them and parking lanes from the traffic, with bays."""
    lanes: list[NDArray[np.float64]] = []
    edges: list[NDArray[np.float64]] = []
    for street in streets.streets:
        with drop_on_failure(f"w{street.way}"):
            own_lanes: list[NDArray[np.float64]] = []
            own_edges: list[NDArray[np.float64]] = []
            for side, parking, cycle in (
                (1.0, street.parking_left, street.cycle_left),
                (-1.0, street.parking_right, street.cycle_right),
            ):
                if not parking and not cycle:
                    continue
                outer = street.width / 2 - parking
                for piece in free_pieces(street, side * outer, breaks):
                    path = subdivide_line(np.asarray(piece.coords), longest)
                    if parking:
                        own_edges += ribbon(path, 0.0, 0.1)
                        for place in bay_borders(piece, slanted=is_perpendicular_parking(street, parking)):
                            a, b = (np.asarray(piece.interpolate(v).coords[0]) for v in (place, place + 0.1))
                            u = (b - a) / max(distance(b, a), 1e-9)
                            out = side * np.array([-u[1], u[0]])
                            own_edges += ribbon(np.array([a, a + out * (parking - 0.2)]), 0.0, 0.1)
                if cycle:
                    for piece in free_pieces(street, side * (outer - _CYCLE_WIDTH / 2 - 0.1), breaks):
                        path = subdivide_line(np.asarray(piece.coords), longest)
                        own_lanes += ribbon(path, 0.0, _CYCLE_WIDTH)
                        own_edges += ribbon(path, -side * (_CYCLE_WIDTH / 2), thick)
            lanes += own_lanes
            edges += own_edges
    return lanes, edges


def _lane_lines(street: Street) -> list[tuple[float, bool]]:
    """Offsets of a street's lines from its centre line (left positive), and whether opposite traffic passes there."""
    if street.kind not in _LINED and not (street.lanes >= 2 and street.oneway) and street.width < 6.4:
        return []
    if street.kind in ("service", "living_street") or street.lanes < 2 or street.setts:
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
                quads += ribbon(np.asarray(piece.coords), 0.0, 0.05)
    return quads
