"""Upright faces where two kinds of ground meet at different heights: the lines they hang from, and their surfaces."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.base import BaseGeometry

from vico.geo.overlay import polygons_of
from vico.world.mesh import Surface
from vico.worldgen.ground.conform import PlanMesh
from vico.worldgen.ground.drape import Curtain, Heights
from vico.worldgen.ground.pavings import GroundStyle, coloured, ground_material

_LONG = 12.0  # metres between points of a straight line


def hung(found: Curtain, look: GroundStyle, tile: float | None = None) -> list[Surface]:
    """Return the surface of a curtain in a style, none if it is empty."""
    if not len(found.triangles):
        return []
    return [
        Surface.from_triangles(
            found.positions,
            found.triangles,
            colour=coloured(look, found.positions[:, :2]),
            entity=look.entity,
            uv=found.uv / (tile or look.tile),
            normals=found.normals,
            material=ground_material(look.material),
        )
    ]


def faced_lines(shapes: Iterable[BaseGeometry], low: Heights, high: Heights, spacing: float) -> list[BaseGeometry]:
    """Outlines with the inside to their right, with as many points as their heights need."""
    rings = [
        ring
        for shape in shapes
        for polygon in polygons_of(shape, 0.05)
        for ring in (polygon.normalize().exterior, *polygon.normalize().interiors)
    ]
    if not rings:
        return []
    dense = shapely.segmentize(np.array(rings, object), spacing)
    points, owner = shapely.get_coordinates(dense, return_index=True)
    corner = np.zeros(len(points), bool)
    own = shapely.get_coordinates(rings)
    # Points of the rings themselves stay; of those between only where heights bend, and every few metres.
    keys = {(round(x, 6), round(y, 6)) for x, y in own.tolist()}
    corner[:] = [(round(x, 6), round(y, 6)) in keys for x, y in points.tolist()]
    bend = np.zeros(len(points))
    for heights in (low, high):
        z = heights(points)
        bend[1:-1] = np.maximum(bend[1:-1], np.abs(z[:-2] - 2 * z[1:-1] + z[2:]))
    kept = corner | (bend > 0.002)
    kept[1:] |= bend[:-1] > 0.002
    kept[:-1] |= bend[1:] > 0.002
    kept |= np.arange(len(points)) % max(round(_LONG / spacing), 1) == 0
    lines = []
    borders = [0, *(np.flatnonzero(owner[1:] != owner[:-1]) + 1).tolist(), len(owner)]
    for start, end in pairwise(borders):
        chosen = points[start:end][kept[start:end]]
        if len(chosen) > 1:
            lines.append(shapely.LineString(chosen))
    return lines


def border_chains(plan: PlanMesh, edges: NDArray[np.int64], reach: float) -> list[BaseGeometry]:
    """Edges of the plan joined to lines; those on the rim of what is drawn are left out."""
    pieces = plan.corners[edges]
    rim = np.abs(pieces).max(axis=2).min(axis=1) > reach - 0.01
    if rim.all():
        return []
    lines = shapely.multilinestrings([shapely.linestrings(pieces[~rim])])[0]
    return list(shapely.get_parts(shapely.line_merge(lines, directed=True)))


def lowered(heights: Heights, depth: float) -> Heights:
    """Return heights that lie so many metres below others."""
    return lambda xy: heights(xy) - depth


def parted_by(lines: Sequence[BaseGeometry], area: BaseGeometry) -> tuple[list[BaseGeometry], list[BaseGeometry]]:
    """Segments of lines that lie within an area, and the rest; directions kept."""
    if not len(lines):
        return [], []
    points, line = shapely.get_coordinates(list(lines), return_index=True)
    first = np.flatnonzero(line[:-1] == line[1:])
    shapely.prepare(area)
    inside = np.ones(len(first), bool)
    for share in (0.0, 0.5, 1.0):
        at = points[first] + share * (points[first + 1] - points[first])
        inside &= shapely.contains_xy(area, at[:, 0], at[:, 1])
    pieces = np.stack([points[first], points[first + 1]], axis=1)
    return list(shapely.linestrings(pieces[inside])), list(shapely.linestrings(pieces[~inside]))
