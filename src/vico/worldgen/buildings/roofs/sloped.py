"""Roofs over wings and courtyards: every edge cuts away what lies above the planes that climb from it.

Where two edges meet, their cuts make the hip; at a reflex corner a third piece makes the valley; edges that get no
cut become gables. A roof that bends (mansard, gambrel, round) is several planes an edge, all of them cut.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import manifold3d
import numpy as np
from manifold3d import Manifold
from numpy.typing import NDArray
from shapely import Polygon

from vico.exact import dot
from vico.worldgen.buildings.roofs.ridged import Profile, slope_of
from vico.worldgen.facts.outlines.roof_shapes import Roof, inradius, prism

_OVERLAP = 0.02  # metres by which cutters stick out of what they cut, so that no two faces coincide
_GABLED = ("gabled", "gambrel", "round", "half-hipped", "side_half-hipped", "side_hipped", "hipped-and-gabled")


@dataclass(frozen=True)
class _Plane:
    """Height `start` at the edge, `slope` per metre inwards; cut as far as `reach` metres."""

    start: float
    slope: float
    reach: float


def sloped_solid(polygon: Polygon, rings: list[NDArray[np.float64]], low: float, roof: Roof) -> Manifold:
    """Return the prism from `low` under slopes that climb from its edges; the eaves are at 0."""
    gables = _gable_ends(polygon, rings) if roof.shape in _GABLED else None
    deep = inradius(polygon) + 0.05
    if gables is None or not any(map(any, gables)):
        # A mitred corner is never farther from its edges than the widest circle inside is from them.
        shape = roof.shape if roof.shape in ("mansard", "quadruple_saltbox") else "hipped"
        return _cut(rings, low, roof.height, slope_of(shape, deep), gables, shape)
    # Between gables the ridge's distance from its eaves is not known before it is built. So planes climb gently
    # first; the height reached tells the distance.
    gentle = 1.35 * deep + 0.5
    probe = _cut(rings, low, roof.height, [(0.0, 0.0), (gentle, 1.0)], gables, "")
    if roof.shape == "gabled":
        return probe
    *_, top = probe.bounding_box()
    deep = min(max(top / roof.height * gentle, 0.1), gentle)
    slope = slope_of(roof.shape, deep)
    if roof.shape == "round":
        slope = slope[::2]  # half the facets: every one is cut along every edge
    return _cut(rings, low, roof.height, slope, gables, roof.shape)


def _planes(slope: Profile, rise: float) -> list[_Plane]:
    planes = []
    for (d0, z0), (d1, z1) in itertools.pairwise(slope):
        rate = (z1 - z0) * rise / max(d1 - d0, 1e-3)
        start = z0 * rise - rate * d0
        if rate > 1e-3:
            planes.append(_Plane(start, rate, (rise - start) / rate))
    return planes


def _cut(
    rings: list[NDArray[np.float64]],
    low: float,
    rise: float,
    slope: Profile,
    gables: list[list[bool]] | None,
    shape: str,
) -> Manifold:
    planes = _planes(slope, rise)
    ends: list[_Plane] = []
    if shape in ("half-hipped", "side_half-hipped"):
        rate = planes[0].slope
        ends = [_Plane(0.55 * rise, rate, 0.45 * rise / rate)]
    elif shape == "hipped-and-gabled":
        ends = [_Plane(0.0, planes[0].slope, 0.6 * rise / planes[0].slope)]
    elif shape == "side_hipped":
        ends = planes
    pieces: list[Manifold] = []
    hipped = 0
    for k, ring in enumerate(rings):
        n = len(ring)
        free = gables[k] if gables is not None else [False] * n
        for i in range(n):
            a, b = ring[i], ring[(i + 1) % n]
            mine = planes
            if free[i]:
                hipped += 1
                # Of a one-sided roof's ends every other is hipped.
                mine = [] if shape.startswith("side_") and hipped % 2 == 0 else ends
            pieces += [_wedge(a, b, rise, plane) for plane in mine]
            if free[i] or free[i - 1]:
                continue
            before, after = a - ring[i - 1], b - a
            before, after = before / np.hypot(*before), after / np.hypot(*after)
            if float(before[0] * after[1] - before[1] * after[0]) < -0.02:
                pieces += [_valley(a, before, after, rise, plane) for plane in planes]
    body = prism(rings, low, rise)
    return Manifold.batch_boolean([body, *pieces], manifold3d.OpType.Subtract) if pieces else body


def _wedge(a: NDArray[np.float64], b: NDArray[np.float64], rise: float, plane: _Plane) -> Manifold:
    """All above the plane that climbs from edge ab to the left, as far as it reaches and a little more."""
    along = (b - a) / np.hypot(*(b - a))
    inward = np.array([-along[1], along[0]])
    top = rise + 1.0
    profile = [
        (-_OVERLAP, plane.start - _OVERLAP * plane.slope),
        (plane.reach, plane.start + plane.reach * plane.slope),
        (plane.reach, top),
        (-_OVERLAP, top),
    ]
    ends = (a - along * 0.5 * _OVERLAP, b + along * 0.5 * _OVERLAP)
    return Manifold.hull_points(np.array([(*(end + inward * u), z) for end in ends for u, z in profile]))


def _valley(
    corner: NDArray[np.float64], before: NDArray[np.float64], after: NDArray[np.float64], rise: float, plane: _Plane
) -> Manifold:
    """All above both planes that meet at a reflex corner, between the wedges of its two edges."""
    left = np.array([-before[1], before[0]])
    right = np.array([-after[1], after[0]])
    cosine = max(float(dot(left, right)), -0.9)
    mitre = (left + right) / max(1.0 + cosine, 0.1)
    run = plane.reach
    height, top = plane.start + run * plane.slope, rise + 1.0
    start = corner - mitre * _OVERLAP
    points = [(*start, plane.start - _OVERLAP * plane.slope), (*start, top)]
    for foot in (corner + left * run, corner + right * run, corner + mitre * run):
        points += [(*foot, height), (*foot, top)]
    return Manifold.hull_points(np.array(points))


def _gable_ends(polygon: Polygon, rings: list[NDArray[np.float64]]) -> list[list[bool]]:
    """Which edges are gable ends: short outer edges that close a wing between two roughly parallel longer ones."""
    marks: list[list[bool]] = [[False] * len(ring) for ring in rings]
    ring = rings[0]
    n = len(ring)
    for i in range(n):
        side = ring[(i + 1) % n] - ring[i]
        before, after = ring[i] - ring[i - 1], ring[(i + 2) % n] - ring[(i + 1) % n]
        length, lb, la = (math.hypot(*edge) for edge in (side, before, after))
        parallel = float(dot(before, after)) < -0.85 * lb * la
        turns = before[0] * side[1] - before[1] * side[0] > 0 and side[0] * after[1] - side[1] * after[0] > 0
        marks[0][i] = parallel and bool(turns) and length < 18.0 and length < 1.05 * max(lb, la) and min(lb, la) > 1.5
    for i in range(n):
        # Two ends that share a corner would leave a plane standing: the shorter is the end.
        j = (i + 1) % n
        if marks[0][i] and marks[0][j]:
            first, second = (math.hypot(*(ring[(k + 1) % n] - ring[k])) for k in (i, j))
            marks[0][j if first <= second else i] = False
    return marks
