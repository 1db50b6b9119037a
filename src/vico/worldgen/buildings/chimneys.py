"""Chimneys: by the ridge, or as stacks with pots on the walls between houses; no higher than they have to be."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from vico.exact import apply_matrix, dot
from vico.geo import overlay
from vico.geo.overlay import polygons_of
from vico.worldgen.buildings.roofs.eaves import edges_of
from vico.worldgen.buildings.solids import Mesh
from vico.worldgen.facts.outlines.plans import PartPlan
from vico.worldgen.facts.outlines.roof_shapes import Roof

_SIZE = (0.85, 0.5)  # metres
_STACK, _THICK = 1.7, 0.5  # metres along and across a wall between houses
_POTS, _POT = 0.38, 0.2  # metres: height and width of a row of pots
_CLEAR = 0.75  # metres by which a chimney stands above the roof around it, at least
_OVER_RIDGE = 0.5  # metres beyond which no chimney stands above its roof's ridge, unless it stands at it
_LEAST_WALL = 5.0  # metres of a wall that carries a stack


def ridge_chimneys(
    part: PartPlan, free: BaseGeometry, mesh: Mesh, base: float, random: np.random.Generator
) -> list[PartPlan]:
    """Return chimneys near a roof's ridge, one for every 210 m2 or so.

    Parameters
    ----------
    part, free
        What is roofed, and which of its outline nothing higher stands on.
    mesh, base
        Its solid, ENU metres, and the height of the building's ground floor: a chimney is as high as the roof asks
        where it stands.
    random
        The building's own stream.
    """
    # Towards the ridge: a chimney at the eaves would have to stand free as high as the roof.
    inset = max(1.2, 0.8 * part.polygon.area / part.polygon.exterior.length)
    pieces = polygons_of(overlay.buffer(free, -inset)) or polygons_of(overlay.buffer(free, -1.2))
    room = max(pieces, key=lambda shape: shape.area, default=None)
    count = min(int(part.polygon.area / 210.0) + 1, 4)
    draws = random.random((count, 3))
    if room is None:
        return []
    made: list[PartPlan] = []
    west, south, east, north = room.bounds
    for at in draws:
        centre = np.array([west + (east - west) * at[0], south + (north - south) * at[1]])
        box = _box(centre, np.array(_SIZE), _main_direction(part.polygon))
        if free.contains(box) and not any(box.intersects(m.polygon) for m in made):
            made.append(_chimney(part, box, mesh, base, 0.3 * float(at[2])))
    return made


def party_wall_stacks(
    part: PartPlan, free: BaseGeometry, mesh: Mesh, base: float, front: NDArray[np.bool_], random: np.random.Generator
) -> list[PartPlan]:
    """Return stacks of flues with rows of pots: inside the walls that run back from the street, at most two.

    Parameters
    ----------
    part, free, mesh, base, random
        As of `ridge_chimneys`.
    front
        Edges of the outline that face a street, shape ``(n,)``.
    """
    edges = edges_of(part.polygon)
    draws = random.random((2, 2))
    if not front.any():
        return ridge_chimneys(part, free, mesh, base, random)
    street = edges.along[int(np.where(front, edges.length, 0.0).argmax())]
    square = np.abs(dot(edges.along, street)) < 0.5
    sides = np.flatnonzero(square & ~front & (edges.length > _LEAST_WALL))
    longest = sides[np.argsort(-edges.length[sides], kind="stable")][:2]
    made: list[PartPlan] = []
    for k, (place, grow) in zip(longest.tolist(), draws.tolist(), strict=False):
        middle = edges.start[k] + edges.along[k] * edges.length[k] * (0.38 + 0.24 * place)
        centre = middle - edges.out[k] * (_THICK / 2 + 0.06)
        yaw = math.atan2(edges.along[k][1], edges.along[k][0])
        box = _box(centre, np.array([_STACK, _THICK]), yaw)
        if free.contains(box) and not any(box.intersects(m.polygon) for m in made):
            stack = _chimney(part, box, mesh, base, 0.35 * grow)
            pots = _box(centre, np.array([0.84 * _STACK, _POT]), yaw)
            made += [stack, PartPlan(pots, stack.eaves, stack.eaves + _POTS, 0, Roof("flat", 0.0), {}, "pots")]
    return made


def _chimney(part: PartPlan, box: Polygon, mesh: Mesh, base: float, more: float) -> PartPlan:
    around = max(height_of(mesh, xy) for xy in np.asarray(box.exterior.coords)[:4, :2]) - base
    top = max(min(around + _CLEAR + 0.8, part.top + _OVER_RIDGE), around + _CLEAR) + more
    # Its foot lies a little under the eaves: on them it would share a plane with other solids' tops.
    return PartPlan(box, part.eaves - 0.07, top, 0, Roof("flat", 0.0), {}, "chimney")


def height_of(mesh: Mesh, xy: NDArray[np.float64]) -> float:
    """Return how high a solid reaches at a point of its outline, metres; its top where no face is over the point."""
    points, faces = mesh
    a, b, c = (points[faces[:, k]] for k in range(3))
    # Barycentric coordinates in plan; faces seen from above only.
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    up = area > 1e-9
    a, b, c, area = a[up], b[up], c[up], area[up]
    v = ((xy[0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (xy[1] - a[:, 1]) * (c[:, 0] - a[:, 0])) / area
    w = ((b[:, 0] - a[:, 0]) * (xy[1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (xy[0] - a[:, 0])) / area
    inside = (v >= -1e-6) & (w >= -1e-6) & (v + w <= 1 + 1e-6)
    if not inside.any():
        return float(points[:, 2].max())
    height = a[:, 2] + v * (b[:, 2] - a[:, 2]) + w * (c[:, 2] - a[:, 2])
    return float(height[inside].max())


def _main_direction(polygon: Polygon) -> float:
    corners = edges_of(polygon)
    along = corners.along[int(corners.length.argmax())]
    return math.atan2(along[1], along[0])


def _box(centre: NDArray[np.float64], size: NDArray[np.float64], yaw: float) -> Polygon:
    c, s = np.cos(yaw), np.sin(yaw)
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * size / 2
    return Polygon(apply_matrix(corners, [[c, -s], [s, c]]) + centre)
