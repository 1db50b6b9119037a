"""Watertight building solids: an outline raised to its eaves and cut by its roof.

Every pitched roof is a prism minus wedges, one an edge: what lies above the plane that rises from that edge. Where
two edges meet, their wedges make the hip; at a reflex corner a third piece makes the valley; edges that get no wedge
become gables. So one rule covers outlines of any shape, courtyards among them, and what comes out is closed because
it is a difference of closed solids.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import manifold3d
import numpy as np
import shapely
from manifold3d import CrossSection, Manifold
from numpy.typing import NDArray
from shapely import Polygon

_OVERLAP = 0.02  # metres by which cutters stick out of what they cut, so that no two faces coincide

SHAPES = ("flat", "gabled", "hipped", "pyramidal", "skillion", "mansard", "dome", "round")

# What OSM calls them, and the nearest of what is built here.
_NAMES = {
    "flat": "flat",
    "gabled": "gabled",
    "gambrel": "gabled",
    "saltbox": "gabled",
    "double_saltbox": "gabled",
    "quadruple_saltbox": "hipped",
    "gabled_row": "gabled",
    "hipped": "hipped",
    "half-hipped": "hipped",
    "side_hipped": "hipped",
    "side_half-hipped": "hipped",
    "hipped-and-gabled": "hipped",
    "crosspitched": "hipped",
    "cross_gabled": "hipped",
    "pyramidal": "pyramidal",
    "cone": "pyramidal",
    "conical": "pyramidal",
    "skillion": "skillion",
    "lean_to": "skillion",
    "mansard": "mansard",
    "dome": "dome",
    "onion": "dome",
    "round": "round",
    "barrel": "round",
}


def shape_named(tag: str | None) -> str | None:
    """The roof shape built for a `roof:shape` tag; None where the tag is absent or says nothing usable."""
    return _NAMES.get(tag.strip().lower().replace(" ", "_")) if tag else None


@dataclass(frozen=True)
class Roof:
    """A roof over an outline.

    Attributes
    ----------
    shape
        One of `SHAPES`.
    height
        From the eaves to the highest point, metres; for a flat roof the parapet's height (0: none).
    direction
        Skillion: yaw towards which it falls, radians. Gabled: yaw of the ridge; None: along the longer side.
    """

    shape: str
    height: float
    direction: float | None = None


def rings_of(polygon: Polygon) -> list[NDArray[np.float64]]:
    """Outer ring counter-clockwise, holes clockwise, not closed, each shape ``(n, 2)``."""
    oriented = shapely.orient_polygons(polygon)
    return [np.asarray(ring.coords)[:-1, :2] for ring in (oriented.exterior, *oriented.interiors)]


def prism(rings: list[NDArray[np.float64]], low: float, high: float) -> Manifold:
    """The outline between two heights."""
    return CrossSection(rings, manifold3d.FillRule.Positive).extrude(high - low).translate((0.0, 0.0, low))


def building_solid(polygon: Polygon, low: float, eaves: float, roof: Roof) -> Manifold:
    """The closed solid of a building or a part of one.

    Parameters
    ----------
    polygon
        Outline, metres; valid, near the origin for precision.
    low, eaves
        Heights of its underside and of where the roof begins, metres.
    roof
        What covers it.

    Returns
    -------
    Manifold
        Watertight, normals outward; empty where the outline is.
    """
    rings = rings_of(polygon)
    if roof.shape == "flat" or roof.height <= 0.05:
        body = prism(rings, low, eaves)
        return _with_parapet(body, polygon, eaves, roof.height) if roof.shape == "flat" and roof.height > 0.05 else body
    if roof.shape in ("dome", "round"):
        return _vaulted(polygon, rings, low, eaves, roof)
    if roof.shape == "skillion":
        return _skillion(rings, low, eaves, roof)
    cutters = _cutters(polygon, rings, eaves, roof)
    body = prism(rings, low, eaves + roof.height)
    return Manifold.batch_boolean([body, *cutters], manifold3d.OpType.Subtract)


def inradius(polygon: Polygon) -> float:
    """Distance from the outline to the point inside that is farthest from it, metres."""
    return float(shapely.length(shapely.maximum_inscribed_circle(polygon, tolerance=0.5)))


def _with_parapet(body: Manifold, polygon: Polygon, eaves: float, height: float) -> Manifold:
    inner = shapely.buffer(polygon, -0.35, join_style="mitre", mitre_limit=2.0)
    pools = [part for part in shapely.get_parts(inner) if part.geom_type == "Polygon" and part.area > 4.0]
    raised = prism(rings_of(polygon), 0.0, height).translate((0.0, 0.0, eaves))
    hollow = [prism(rings_of(pool), eaves - 1.0, eaves + height + 1.0) for pool in pools]
    if not hollow:
        return body
    rim = Manifold.batch_boolean([raised, *hollow], manifold3d.OpType.Subtract)
    return body + rim


def _cutters(polygon: Polygon, rings: list[NDArray[np.float64]], eaves: float, roof: Roof) -> list[Manifold]:
    deep = inradius(polygon)
    pieces: list[Manifold] = []
    centre = np.asarray(polygon.representative_point().coords[0])
    convex = len(rings) == 1 and polygon.area > 0.97 * shapely.convex_hull(polygon).area
    if convex:
        centre = np.asarray(polygon.centroid.coords[0])
    if roof.shape == "mansard":
        run = min(1.3, 0.5 * deep)
        return _ring_cutters(rings, eaves, run, roof.height, None)
    if roof.shape == "pyramidal" and convex:
        for a, b in _edges(rings[0]):
            along = (b - a) / np.hypot(*(b - a))
            run = float(np.dot(centre - a, (-along[1], along[0])))
            if run > 0.1:
                pieces.append(_wedge(a, b, eaves, run, roof.height))
        return pieces
    gables = _gable_ends(polygon, rings, roof) if roof.shape == "gabled" else None
    run = deep
    if gables is not None and any(any(row) for row in gables):
        # Without the end walls' wedges the ridge lies where the long sides' planes meet: half the wing's width.
        run = max(deep, 0.5 * _width(polygon))
    return _ring_cutters(rings, eaves, run, roof.height, gables)


def _width(polygon: Polygon) -> float:
    box = np.asarray(shapely.minimum_rotated_rectangle(polygon).exterior.coords)
    sides = np.hypot(*np.diff(box[:3], axis=0).T)
    return float(min(sides)) if len(sides) else 0.0


def _edges(ring: NDArray[np.float64]) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    return [(ring[i], ring[(i + 1) % len(ring)]) for i in range(len(ring))]


def _ring_cutters(
    rings: list[NDArray[np.float64]], eaves: float, run: float, rise: float, gables: list[list[bool]] | None
) -> list[Manifold]:
    """Wedges over all edges (but the gables'), and valley pieces at the reflex corners between them."""
    pieces: list[Manifold] = []
    for k, ring in enumerate(rings):
        n = len(ring)
        free = gables[k] if gables is not None else [False] * n
        for i in range(n):
            a, b = ring[i], ring[(i + 1) % n]
            if not free[i]:
                pieces.append(_wedge(a, b, eaves, run, rise))
            if free[i] or free[i - 1]:
                continue
            before, after = a - ring[i - 1], b - a
            before, after = before / np.hypot(*before), after / np.hypot(*after)
            turn = float(before[0] * after[1] - before[1] * after[0])
            if turn < -0.02:
                pieces.append(_valley(a, before, after, eaves, run, rise))
    return pieces


def _wedge(a: NDArray[np.float64], b: NDArray[np.float64], eaves: float, run: float, rise: float) -> Manifold:
    """All above the plane that climbs from edge ab to the left, as far as the plane's top and a little more."""
    along = (b - a) / np.hypot(*(b - a))
    inward = np.array([-along[1], along[0]])
    slope = rise / run
    out, top = -_OVERLAP, eaves + rise + 1.0
    profile = [
        (out, eaves + out * slope),
        (run, eaves + rise),
        (run + _OVERLAP, top),
        (out, top),
    ]
    ends = (a - along * 0.5 * _OVERLAP, b + along * 0.5 * _OVERLAP)
    return Manifold.hull_points(np.array([(*(end + inward * u), z) for end in ends for u, z in profile]))


def _valley(
    corner: NDArray[np.float64],
    before: NDArray[np.float64],
    after: NDArray[np.float64],
    eaves: float,
    run: float,
    rise: float,
) -> Manifold:
    """All above both planes that meet at a reflex corner, between the wedges of its two edges."""
    left = np.array([-before[1], before[0]])
    right = np.array([-after[1], after[0]])
    middle = left + right
    cosine = max(float(np.dot(left, right)), -0.9)
    mitre = middle / max(1.0 + cosine, 0.1)
    start = corner - mitre * _OVERLAP
    feet = [corner + left * run, corner + right * run, corner + mitre * run]
    top = eaves + rise + 1.0
    points = [(*start, eaves - _OVERLAP * rise / run), (*start, top)]
    for foot in feet:
        points += [(*foot, eaves + rise), (*foot, top)]
    return Manifold.hull_points(np.array(points))


def _gable_ends(polygon: Polygon, rings: list[NDArray[np.float64]], roof: Roof) -> list[list[bool]]:
    """Which edges are gable ends: short outer edges between two roughly parallel longer ones, across the ridge."""
    box = np.asarray(shapely.minimum_rotated_rectangle(polygon).exterior.coords)
    sides = np.diff(box[:3], axis=0)
    lengths = np.hypot(*sides.T)
    compact = len(rings) == 1 and polygon.area > 0.72 * float(lengths.prod())
    ridge = sides[int(lengths.argmax())] / max(float(lengths.max()), 1e-9)
    if roof.direction is not None:
        ridge = np.array([math.cos(roof.direction), math.sin(roof.direction)])
    marks: list[list[bool]] = []
    for k, ring in enumerate(rings):
        n = len(ring)
        ends = [False] * n
        for i in range(n):
            side = ring[(i + 1) % n] - ring[i]
            length = float(np.hypot(*side))
            if compact:
                ends[i] = abs(float(np.dot(side, ridge))) < 0.5 * length
                continue
            if k > 0:
                continue
            before, after = ring[i] - ring[i - 1], ring[(i + 2) % n] - ring[(i + 1) % n]
            lb, la = float(np.hypot(*before)), float(np.hypot(*after))
            parallel = float(np.dot(before, after)) < -0.85 * lb * la
            square = before[0] * side[1] - before[1] * side[0] > 0 and side[0] * after[1] - side[1] * after[0] > 0
            ends[i] = parallel and bool(square) and length < 16.0 and length < 0.9 * min(lb, la)
        marks.append(ends)
    return marks


def _skillion(rings: list[NDArray[np.float64]], low: float, eaves: float, roof: Roof) -> Manifold:
    yaw = roof.direction if roof.direction is not None else 0.0
    fall = np.array([math.cos(yaw), math.sin(yaw)])
    reach = [float(v) for ring in rings for v in ring @ fall]
    first, last = min(reach), max(reach)
    body = prism(rings, low, eaves + roof.height)
    slope = roof.height / max(last - first, 0.1)
    normal = np.array([-fall[0] * slope, -fall[1] * slope, -1.0])
    # Kept is what lies under the plane z = eaves + (last - p.fall) * slope.
    offset = -(eaves + last * slope)
    return body.trim_by_plane(tuple(normal), offset / float(np.linalg.norm(normal)))


def _vaulted(polygon: Polygon, rings: list[NDArray[np.float64]], low: float, eaves: float, roof: Roof) -> Manifold:
    """A dome over the outline's box, or a barrel along its longer side."""
    box = np.asarray(shapely.minimum_rotated_rectangle(polygon).exterior.coords)[:4]
    middle = box.mean(axis=0)
    u, v = box[1] - box[0], box[3] - box[0]
    if np.hypot(*u) < np.hypot(*v):
        u, v = v, -u
    yaw = math.degrees(math.atan2(u[1], u[0]))
    a, b = float(np.hypot(*u)) / 2, float(np.hypot(*v)) / 2
    if roof.shape == "dome":
        # A circle's own box is as wide as the circle, so the dome meets the walls; it is widened a little for others.
        vault = Manifold.sphere(1.0, 24).scale((a * 1.02, b * 1.02, roof.height))
    else:
        vault = Manifold.cylinder(2 * a + 1.0, 1.0, 1.0, 24, True).rotate((0.0, 90.0, 0.0))
        vault = vault.scale((1.0, b * 1.02, roof.height))
    vault = vault.rotate((0.0, 0.0, yaw)).translate((float(middle[0]), float(middle[1]), eaves))
    cap = prism(rings, eaves - 0.5, eaves + roof.height + 0.5) ^ vault
    return prism(rings, low, eaves) + cap
