"""Streets as several stages know them: their records, what tags say of lanes and widths, and bays along kerbs.

Bays where cars stand, along kerbs and in car parks, are painted and parked in by the same rules.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString, MultiPolygon, Polygon
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.quantities import quantity
from vico.geometry import distance
from vico.worldgen.facts.fault_isolation import NamedShape, drop_on_failure, union_named

LANE_WIDTH = 3.2
"""Metres; netconvert's default too, so that its lanes lie within the painted carriageway."""


_GUTTER = 0.35  # metres between the outermost lane and the kerb
_SERVICE_WIDTH = {"driveway": 3.0, "parking_aisle": 5.5, "alley": 3.2, "drive-through": 3.0}


class StreetClass(NamedTuple):
    """Defaults of a class of streets, for ways without tags.

    Attributes
    ----------
    lanes
        Lanes a direction.
    sidewalks
        Whether sidewalks are usual in a town.
    """

    lanes: int
    sidewalks: bool


DRIVABLE: dict[str, StreetClass] = {
    "motorway": StreetClass(2, False),
    "trunk": StreetClass(2, False),
    "primary": StreetClass(2, True),
    "secondary": StreetClass(1, True),
    "tertiary": StreetClass(1, True),
    "unclassified": StreetClass(1, True),
    "residential": StreetClass(1, True),
    "living_street": StreetClass(1, True),
    "road": StreetClass(1, True),
    "busway": StreetClass(1, False),
    "bus_guideway": StreetClass(1, False),
    "motorway_link": StreetClass(1, False),
    "trunk_link": StreetClass(1, False),
    "primary_link": StreetClass(1, True),
    "secondary_link": StreetClass(1, True),
    "tertiary_link": StreetClass(1, True),
    "service": StreetClass(1, False),
}
"""The values of `highway` that vehicles drive on."""

_UNKNOWN_CLASS = StreetClass(1, False)

PAVINGS: dict[str, str] = {
    **dict.fromkeys(("sett", "cobblestone", "unhewn_cobblestone", "cobblestone:flattened"), "setts"),
    **dict.fromkeys(("paving_stones", "paving_stones:lanes", "bricks", "brick"), "stones"),
    **dict.fromkeys(("concrete", "concrete:plates", "concrete:lanes"), "concrete"),
    **dict.fromkeys(("asphalt", "chipseal", "tartan", "rubber"), "asphalt"),
    **dict.fromkeys(("gravel", "fine_gravel", "compacted", "pebblestone", "unpaved"), "gravel"),
    **dict.fromkeys(("ground", "dirt", "earth", "mud", "woodchips"), "earth"),
    **dict.fromkeys(("grass", "grass_paver"), "grass"),
    **dict.fromkeys(("wood", "metal_grid"), "wood"),
    "sand": "sand",
}
"""What a way or area is paved with, by its `surface`; what is not here looks as its kind usually does."""


@dataclass(frozen=True)
class Street:
    """A drivable way and what is painted on it.

    Attributes
    ----------
    line
        Metres, shape ``(n, 2)``, in the direction of the way (and of traffic where `oneway`).
    width
        Of the carriageway, kerb to kerb, metres.
    kerbed
        Whether it lies below its surroundings, between kerbs.
    cycle_left, cycle_right
        Whether a lane for bicycles is painted on that side, seen along `line`.
    parking_left, parking_right
        Widths of the parking lanes at the kerbs, metres; `slanted` if cars stand across the street in them.
    tracks
        Whether trams run in it.
    setts
        Whether it is paved with natural stones, on which no lanes are painted.
    """

    way: int
    kind: str
    line: NDArray[np.float64]
    width: float
    lanes: int
    oneway: bool
    kerbed: bool = True
    cycle_left: bool = False
    cycle_right: bool = False
    parking_left: float = 0.0
    parking_right: float = 0.0
    slanted: bool = False
    tracks: bool = False
    setts: bool = False


@dataclass(frozen=True)
class Crossing:
    """Where walkers cross a carriageway.

    Attributes
    ----------
    id
        Of the way or point that maps it.
    start, end
        On the two kerbs, metres.
    width
        Across the walking direction, metres.
    painted
        Whether it is marked.
    marking
        How: zebra, lines, dashes, ladder, dots, broken_lines or studs.
    signals
        Whether lights stop the traffic there.
    """

    start: tuple[float, float]
    end: tuple[float, float]
    width: float
    painted: bool
    marking: str = "zebra"
    signals: bool = False
    id: str = ""

    @property
    def polygon(self) -> Polygon:
        """The strip between the kerbs."""
        return overlay.buffer(LineString([self.start, self.end]), self.width / 2, cap_style="flat")


@dataclass(frozen=True)
class StreetPolygons:
    """Street surfaces, metres; pieces of one kind do not overlap, nor do kinds except as said.

    Attributes
    ----------
    carriageway
        Where vehicles drive, kerb to kerb, tunnels left out.
    sidewalk
        Paved ways for walkers beside carriageways or by themselves.
    crossing
        Parts of `carriageway` where walkers cross.
    pedestrian
        Squares and pedestrian streets.
    path
        Unpaved footways, in parks mostly.
    cycleway
        Tracks of their own for bicycles.
    steps
        Stairs outdoors.
    parking
        Open car parks.
    streets, crossings
        The lines and stripes the polygons came from.
    rails
        Centre lines of tram tracks in the street, metres.
    sunken
        Part of `carriageway` between kerbs: streets, without drives and yards.
    paved
        What the map says ways and squares are paved with: polygons by the names in `PAVINGS`, across kinds.
    """

    carriageway: MultiPolygon
    sidewalk: MultiPolygon
    crossing: MultiPolygon
    pedestrian: MultiPolygon
    path: MultiPolygon
    cycleway: MultiPolygon
    steps: MultiPolygon
    parking: MultiPolygon
    streets: list[Street]
    crossings: list[Crossing]
    rails: list[NDArray[np.float64]]
    sunken: MultiPolygon = field(default_factory=MultiPolygon)
    paved: dict[str, MultiPolygon] = field(default_factory=dict)

    def footways(self) -> BaseGeometry:
        """Return where walkers walk."""
        return overlay.union_all(
            [self.sidewalk, self.pedestrian, self.path, self.steps, self.cycleway, self.crossing], grid=None
        )


def lane_count(tags: Mapping[str, str]) -> int:
    """Lanes of a drivable way, both directions together."""
    said = quantity(tags, "lanes")
    if said is not None and 1 <= said <= 12:
        return int(said)
    per_direction = DRIVABLE.get(tags.get("highway", ""), _UNKNOWN_CLASS).lanes
    return per_direction if is_oneway(tags) else 2 * per_direction


def is_oneway(tags: Mapping[str, str]) -> bool:
    """Whether vehicles use a way in one direction only."""
    said = tags.get("oneway")
    if said in ("yes", "true", "1", "-1"):
        return True
    return said is None and (tags.get("junction") in ("roundabout", "circular") or tags.get("highway") == "motorway")


def carriageway_width(tags: Mapping[str, str]) -> float:
    """Kerb-to-kerb width of a drivable way, metres: `width` where believable, else lanes, class and parking lanes."""
    said = quantity(tags, "width")
    if said is not None and 2.0 <= said <= 40.0:
        return said
    kind = tags.get("highway", "")
    if kind == "service" and "lanes" not in tags:
        return _SERVICE_WIDTH.get(tags.get("service", ""), 4.0)
    if kind == "living_street" and "lanes" not in tags:
        return 5.0
    width = lane_count(tags) * LANE_WIDTH + 2 * _GUTTER
    for side in ("left", "right", "both"):
        lane = tags.get(f"parking:lane:{side}", tags.get(f"parking:{side}", ""))
        metres = {"parallel": 2.0, "lane": 2.0, "street_side": 2.2, "diagonal": 4.2, "perpendicular": 4.8}.get(
            lane, 0.0
        )
        width += metres * (2 if side == "both" else 1)
    return width


PARALLEL_PITCH, PERPENDICULAR_PITCH = 5.8, 2.6
"""Metres from bay to bay along a kerb, where cars stand along the street and where they stand across it."""
LOT_PITCH, LOT_DEPTH = 2.5, 5.0
"""Metres from bay to bay in a car park, and how deep they are."""
LEAST_PIECE = 3.0
"""Metres of a kerb or a line between two junctions that are worth painting."""

_WIDEST_PARALLEL = 3.0  # metres of a parking lane in which cars stand along the street
_AISLE = 5.4  # metres between the rows of a car park, at least
_INWARD = 0.1  # metres that a car along a kerb stands nearer to the street than the middle of its bay: for its mirrors


class Bay(NamedTuple):
    """Room for one car.

    Attributes
    ----------
    centre
        Its middle, metres.
    yaw
        Direction of its longer side, radians: along the street or into the bay.
    length, width
        Metres.
    """

    centre: tuple[float, float]
    yaw: float
    length: float
    width: float


def junction_zones(streets: StreetPolygons) -> BaseGeometry:
    """Where lines stop: around nodes that three or more street ends share, and at crossings."""
    ends: dict[tuple[float, float], list[float]] = {}
    for street in streets.streets:
        for k, point in enumerate(street.line):
            key = (round(float(point[0]), 2), round(float(point[1]), 2))
            share = [street.width] if k in (0, len(street.line) - 1) else [street.width, street.width]
            ends.setdefault(key, []).extend(share)
    zones: list[NamedShape] = []
    for point, widths in ends.items():
        if len(widths) >= 3:
            with drop_on_failure(name := f"junction at {point[0]:.1f}, {point[1]:.1f}"):
                zone = overlay.buffer(shapely.Point(point), max(widths) / 2 + 3.0, quad_segs=3)
                zones.append(NamedShape(name, zone))
    for crossing in streets.crossings:
        with drop_on_failure(crossing.id):
            zones.append(NamedShape(crossing.id, overlay.buffer(crossing.polygon, 1.2, join_style="mitre")))
    return union_named(zones)


def free_pieces(street: Street, offset: float, breaks: BaseGeometry) -> list[LineString]:
    """Return the pieces of a line beside a street's centre line (left positive, metres) outside of `breaks`."""
    line = overlay.offset_curve(LineString(street.line), offset)
    free = shapely.get_parts(overlay.difference(line, breaks))
    return [piece for piece in free if isinstance(piece, LineString) and piece.length > LEAST_PIECE]


def is_perpendicular_parking(street: Street, depth: float) -> bool:
    """Whether cars stand across the street in a parking lane of this width; the other side may be another."""
    return street.slanted and depth > _WIDEST_PARALLEL


def bay_borders(piece: LineString, *, slanted: bool) -> NDArray[np.float64]:
    """Metres along a piece of a parking lane's edge at which its bays begin, the end of the last with them."""
    return np.arange(1.0, piece.length - 1.0, PERPENDICULAR_PITCH if slanted else PARALLEL_PITCH)


def kerb_bays(street: Street, side: float, depth: float, breaks: BaseGeometry) -> list[Bay]:
    """Bays along one kerb of a street.

    Parameters
    ----------
    street
        The street; `Street.slanted` says how cars stand.
    side
        1.0 for the left kerb seen along its line, -1.0 for the right one.
    depth
        Width of the parking lane, metres.
    breaks
        Where nobody parks.
    """
    found: list[Bay] = []
    across = is_perpendicular_parking(street, depth)
    for piece in free_pieces(street, side * (street.width / 2 - depth), breaks):
        borders = bay_borders(piece, slanted=across)
        for low, high in pairwise(borders.tolist()):
            a, b = shapely.get_coordinates(shapely.line_interpolate_point(piece, [low, high]))
            run = distance(b, a)
            if run < 0.97 * (high - low):
                continue  # round a bend
            u = (b - a) / run
            out = side * np.array([-u[1], u[0]])
            x, y = (a + b) / 2 + out * (depth / 2 - (0.0 if across else _INWARD))
            towards = out if across else u
            size = (depth, run) if across else (run, depth)
            found.append(Bay((float(x), float(y)), math.atan2(towards[1], towards[0]), *size))
    return found


def lot_rows(shape: Polygon) -> list[list[NDArray[np.float64]]]:
    """Lines between the bays of a car park, row by row: shape ``(2, 2)`` each, from the row's back into the aisle.

    Rows lie along the two long sides, and in pairs between where there is room; lines that follow each other at
    `LOT_PITCH` have a bay between them.
    """
    box = shapely.minimum_rotated_rectangle(shape)
    if not isinstance(box, Polygon) or shape.area < 80.0:
        return []
    corner = np.asarray(box.exterior.coords)
    u, v = corner[1] - corner[0], corner[3] - corner[0]
    if np.hypot(*u) < np.hypot(*v):
        u, v = v, u
    length, depth = float(np.hypot(*u)), float(np.hypot(*v))
    u, v = u / length, v / depth
    reach = LOT_DEPTH
    rows = [(0.2, reach), (depth - 0.2, -reach)] if depth > 15.0 else [(0.2, reach)] if depth > 8.0 else []
    if depth > 31.0:
        for middle in np.arange(16.5, depth - 16.0, 16.0):
            rows += [(float(middle), reach), (float(middle), -reach)]
    inner = overlay.buffer(shape, -0.1)
    shapely.prepare(inner)
    spare = min(max((depth - 2 * reach - _AISLE) / 2, 0.0), 3.0) if depth <= 31.0 else 0.5
    across = np.arange(0.4, length - 0.3, LOT_PITCH)
    found: list[list[NDArray[np.float64]]] = []
    for start, deep in rows:
        # The outline seldom runs along the box: the row begins where most bays have room.
        best: list[NDArray[np.float64]] = []
        for back in np.arange(0.0, spare + 0.01, 0.5).tolist():
            a = corner[0] + u * across[:, None] + v * (start + math.copysign(back, deep))
            lines = np.stack([a, a + v * deep], axis=1)
            row = list(lines[shapely.contains(inner, shapely.linestrings(lines))])
            best = row if len(row) > len(best) else best
        found.append(best)
    return found


def lot_bays(shape: Polygon) -> list[Bay]:
    """Bays of a car park between its painted lines; their yaw leads out of the bay, into the aisle."""
    found: list[Bay] = []
    for row in lot_rows(shape):
        for one, other in pairwise(row):
            if np.hypot(*(other[0] - one[0])) > 1.01 * LOT_PITCH:
                continue
            x, y = (one + other).mean(axis=0) / 2
            ahead = one[1] - one[0]
            found.append(Bay((float(x), float(y)), math.atan2(ahead[1], ahead[0]), LOT_DEPTH, LOT_PITCH))
    return found
