"""Bays where cars stand: along kerbs and in car parks, as they are painted and as cars are parked in them."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString, Polygon
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geometry import distance
from vico.worldgen.facts.expendable import NamedShape, expendable, united
from vico.worldgen.facts.streets import Street, StreetPolygons

PARALLEL_PITCH, ACROSS_PITCH = 5.8, 2.6
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
            with expendable(name := f"junction at {point[0]:.1f}, {point[1]:.1f}"):
                zone = overlay.buffer(shapely.Point(point), max(widths) / 2 + 3.0, quad_segs=3)
                zones.append(NamedShape(name, zone))
    for crossing in streets.crossings:
        with expendable(crossing.id):
            zones.append(NamedShape(crossing.id, overlay.buffer(crossing.polygon, 1.2, join_style="mitre")))
    return united(zones)


def free_pieces(street: Street, offset: float, breaks: BaseGeometry) -> list[LineString]:
    """Return the pieces of a line beside a street's centre line (left positive, metres) outside of `breaks`."""
    line = overlay.offset_curve(LineString(street.line), offset)
    free = shapely.get_parts(overlay.difference(line, breaks))
    return [piece for piece in free if isinstance(piece, LineString) and piece.length > LEAST_PIECE]


def stands_across(street: Street, depth: float) -> bool:
    """Whether cars stand across the street in a parking lane of this width; the other side may be another."""
    return street.slanted and depth > _WIDEST_PARALLEL


def bay_borders(piece: LineString, *, slanted: bool) -> NDArray[np.float64]:
    """Metres along a piece of a parking lane's edge at which its bays begin, the end of the last with them."""
    return np.arange(1.0, piece.length - 1.0, ACROSS_PITCH if slanted else PARALLEL_PITCH)


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
    across = stands_across(street, depth)
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
