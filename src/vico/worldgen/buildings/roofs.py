"""Watertight building solids: an outline raised to its eaves under its roof.

Simple 3D Buildings' roofs are built three ways. Over an outline that about fills its box, ridged roofs are the prism
within one or two profiles drawn across the box (`_profiled_solid`). Over wings and courtyards every edge cuts away what
lies above the plane that climbs from it (`sloped_solid`): where two edges meet, their cuts make the hip; at a reflex
corner a third piece makes the valley; edges that get no cut become gables; a roof that bends (mansard, gambrel, round)
is several planes an edge. Pyramids, domes and onions are the outline's ring drawn together towards a point above it.
What comes out is closed, because it is made of closed solids, and as high as asked.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace

import manifold3d
import numpy as np
import shapely
from manifold3d import CrossSection, Manifold, Mesh64
from numpy.typing import NDArray
from shapely import Polygon

from vico.exact import dot
from vico.geo import overlay
from vico.geometry import distances
from vico.worldgen.facts.roofs import Roof, inradius, measured_solid, prism, rings_of

_DOME = [(math.cos(a), math.sin(a)) for a in np.linspace(0.0, math.pi / 2, 8)[1:-1]]
# Width and height of an onion's rings. It swells out to the drum's walls, not beyond: a bulge past the outline would
# stand in what is next to it.
_ONION = [
    (0.80, 0.0),
    (0.90, 0.05),
    (0.98, 0.13),
    (1.0, 0.21),
    (0.97, 0.30),
    (0.87, 0.40),
    (0.70, 0.50),
    (0.48, 0.60),
    (0.29, 0.70),
    (0.15, 0.80),
    (0.06, 0.90),
]


def _drawn_together(polygon: Polygon, rings: list[NDArray[np.float64]], low: float, roof: Roof) -> Manifold | None:
    """Return the solid from `low` under a pyramid, dome or onion; the eaves are at 0.

    None for a pyramid over an outline that is not seen whole from any point of it.
    """
    steps = {"dome": _DOME, "onion": _ONION}.get(roof.shape, [])
    for point in (polygon.centroid, polygon.representative_point()):
        centre = np.asarray(point.coords[0])
        if _sees_all(rings[0], centre):
            if len(rings) == 1:
                return _loft(rings[0], centre, low, steps, roof.height)
            # What stands in the middle (a lantern, a spire) is cut out of the roof and doesn't change it.
            return prism(rings, low, roof.height) ^ _loft(rings[0], centre, low - 1.0, steps, roof.height)
    if not steps:
        return None
    # Over wings the vault spans the hull, and the outline is cut out of it.
    hull = shapely.convex_hull(polygon)
    ring = rings_of(overlay.buffer(hull, 0.02, join_style="mitre"))[0]
    vault = _loft(ring, np.asarray(hull.centroid.coords[0]), low - 1.0, steps, roof.height)
    return prism(rings, low, roof.height) ^ vault


def _sees_all(ring: NDArray[np.float64], centre: NDArray[np.float64]) -> bool:
    a = ring - centre
    b = np.roll(a, -1, axis=0)
    cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    # A hand's breadth of every edge's line: a roof that is nearly folded over itself is none.
    return bool((cross > 0.1 * np.maximum(distances(b, a), 1e-9)).all())


def _loft(
    ring: NDArray[np.float64],
    centre: NDArray[np.float64],
    low: float,
    steps: list[tuple[float, float]],
    rise: float,
) -> Manifold:
    """Rings about a centre that sees all of them, stacked from `low`, closed by a point above and a face below."""
    n = len(ring)
    scales = [(1.0, low), (1.0, 0.0), *((width, height * rise) for width, height in steps)]
    points = [np.c_[centre + (ring - centre) * width, np.full(n, z)] for width, z in scales]
    points += [np.array([[*centre, low], [*centre, rise]])]
    i = np.arange(n)
    j = (i + 1) % n
    faces = [np.stack([np.full(n, n * len(scales)), j, i], axis=1)]
    for k in range(len(scales) - 1):
        lower, upper = k * n, (k + 1) * n
        faces += [
            np.stack([lower + i, lower + j, upper + j], axis=1),
            np.stack([lower + i, upper + j, upper + i], axis=1),
        ]
    last = (len(scales) - 1) * n
    faces.append(np.stack([last + i, last + j, np.full(n, n * len(scales) + 1)], axis=1))
    mesh = Mesh64(
        vert_properties=np.ascontiguousarray(np.concatenate(points), np.float64),
        tri_verts=np.ascontiguousarray(np.concatenate(faces), np.uint64),
    )
    return Manifold(mesh)


Profile = list[tuple[float, float]]
"""Corners of a roof's outline in section, left to right: distance, and height as a share of the whole."""

_OUT = 0.05  # metres a profile reaches beyond the outline, so that no two faces coincide
_SNAP = math.radians(20.0)  # a tagged direction this near to a side's means that side's

# Slopes that fall to all sides look wrong over a box that the outline fills badly; a plain ridge forgives more.
_FILL = {"hipped": 0.93, "mansard": 0.93, "quadruple_saltbox": 0.93, "side_hipped": 0.8, "hipped-and-gabled": 0.8}
_ALWAYS = ("saltbox", "double_saltbox", "crosspitched", "gabled_row", "sawtooth", "butterfly")


@dataclass(frozen=True)
class BoxFrame:
    """A box around an outline: `along` the ridge (unit vector), half sizes along and across it, metres."""

    centre: NDArray[np.float64]
    along: NDArray[np.float64]
    half_length: float
    half_width: float

    def suits(self, shape: str, polygon: Polygon, *, holes: bool) -> bool:
        """Whether a roof of this shape over this outline is drawn in the box's section."""
        if shape in _ALWAYS:
            return True
        fill = polygon.area / max(4.0 * self.half_length * self.half_width, 1e-9)
        return not holes and fill > _FILL.get(shape, 0.83)


def _box_frame(polygon: Polygon, direction: float | None) -> BoxFrame:
    """Return the smallest box around an outline, turned to `direction` (the ridge's yaw) unless a side agrees."""
    corners = np.asarray(shapely.minimum_rotated_rectangle(polygon).exterior.coords)[:3]
    sides = np.diff(corners, axis=0)
    side = sides[int(np.hypot(*sides.T).argmax())]
    yaw = math.atan2(side[1], side[0])
    if direction is not None:
        quarter = round((direction - yaw) / (math.pi / 2))
        snapped = yaw + quarter * math.pi / 2
        yaw = snapped if abs(direction - snapped) < _SNAP else direction
    along = np.array([math.cos(yaw), math.sin(yaw)])
    across = np.array([-along[1], along[0]])
    ring = np.asarray(polygon.exterior.coords)[:, :2]
    u, v = dot(ring, along), dot(ring, across)
    centre = along * (u.min() + u.max()) / 2 + across * (v.min() + v.max()) / 2
    return BoxFrame(centre, along, float(np.ptp(u)) / 2, float(np.ptp(v)) / 2)


def slope_of(shape: str, deep: float) -> Profile:
    """How a roof climbs from its eaves: distance inwards up to `deep` metres, share of the height."""
    if shape == "mansard":
        steep = min(1.6, 0.4 * deep)
        return [(0.0, 0.0), (steep, 0.72 if deep < 8.0 else 0.86), (deep, 1.0)]
    if shape == "gambrel":
        return [(0.0, 0.0), (0.34 * deep, 0.62), (deep, 1.0)]
    if shape in ("double_saltbox", "quadruple_saltbox"):
        return [(0.0, 0.0), (0.55 * deep, 1.0), (deep, 1.0)]
    if shape == "round":
        angles = np.linspace(0.0, math.pi / 2, 7)
        return [(float(deep * (1 - math.cos(a))), float(math.sin(a))) for a in angles]
    return [(0.0, 0.0), (deep, 1.0)]


def _both_sides(slope: Profile, half: float) -> Profile:
    left = [(d - half, z) for d, z in slope]
    if slope[-1][0] < half - 1e-6:
        left.append((0.0, slope[-1][1]))
    return left + [(-x, z) for x, z in reversed(left) if x < -1e-9]


def _row(half: float, tooth: Profile, count: int) -> Profile:
    width = 2 * half / count
    return [(-half + width * (k + x), z) for k in range(count) for x, z in tooth]


def _ends(shape: str, frame: BoxFrame, run: float) -> Profile | None:
    """Return the section along the ridge: None for plain gables."""
    half = frame.half_length
    if shape in ("hipped", "side_hipped", "mansard", "quadruple_saltbox"):
        slope = slope_of(shape, run)
        reach = min(slope[-1][0], half)
        height = float(np.interp(reach, [d for d, _ in slope], [z for _, z in slope]))
        near = [*((d, z) for d, z in slope if d < reach), (reach, height)]
    elif shape in ("half-hipped", "side_half-hipped"):
        reach = min(0.45 * run, half)
        near = [(0.0, 0.55), (reach, 0.55 + reach / run)]
    elif shape == "hipped-and-gabled":
        reach = min(0.6 * run, 0.8 * half)
        near = [(0.0, 0.0), (reach, reach / run), (reach, 1.0)]
    else:
        return None
    right = [(half - d, z) for d, z in reversed(near)]
    left = [(-half, 1.0)] if shape.startswith("side_") else [(d - half, z) for d, z in near]
    return left + right


def _profiled_solid(rings: list[NDArray[np.float64]], low: float, roof: Roof, frame: BoxFrame) -> Manifold:
    """Return the prism from `low` under a ridged roof whose eaves are at 0."""
    half = frame.half_width
    rise = roof.height
    if roof.shape == "sawtooth":
        count = max(round(frame.half_length / 4.0), 2)
        limits = [_sheet(frame, _row(frame.half_length, [(0.0, 0.0), (0.999, 1.0)], count), rise, low, across=True)]
    elif roof.shape == "gabled_row":
        count = max(round(frame.half_length / max(half, 4.0)), 2)
        limits = [_sheet(frame, [*_row(frame.half_length, [(0.0, 0.0), (0.5, 1.0)], count), (frame.half_length, 0.0)],
                         rise, low, across=True)]  # fmt: skip
    elif roof.shape == "butterfly":
        limits = [_sheet(frame, [(-half, 1.0), (0.0, 0.0), (half, 1.0)], rise, low)]
    elif roof.shape == "saltbox":
        limits = [_sheet(frame, [(-half, 0.52), (-0.35 * half, 1.0), (half, 0.0)], rise, low)]
    elif roof.shape == "crosspitched":
        main = _sheet(frame, _both_sides([(0.0, 0.0), (half, 1.0)], half), rise, low)
        wing: Profile = [(-frame.half_length, 0.0), (-half, 0.0), (0.0, 1.0), (half, 0.0), (frame.half_length, 0.0)]
        limits = [main + _sheet(frame, wing if frame.half_length > half + 0.01 else wing[1:4], rise, low, across=True)]
    else:
        limits = [_sheet(frame, _both_sides(slope_of(roof.shape, half), half), rise, low)]
        ends = _ends(roof.shape, frame, half)
        if ends is not None:
            limits.append(_sheet(frame, ends, rise, low, across=True))
    return Manifold.batch_boolean([prism(rings, low, rise), *limits], manifold3d.OpType.Intersect)


def _sheet(frame: BoxFrame, profile: Profile, rise: float, low: float, *, across: bool = False) -> Manifold:
    """All under a profile over the whole box; `across`: the profile runs along the ridge, extruded across it."""
    top = np.array(profile) * (1.0, rise)
    first, last = top[0], top[-1]
    # Where the profile ends it goes on at its end's slope for a little, and what is highest is left to the prism.
    before, after = _slope(top[:2]), _slope(top[-2:])
    ring = np.concatenate(
        [
            [(first[0] - _OUT, low - 1.0)],
            [(last[0] + _OUT, low - 1.0)],
            [(last[0] + _OUT, last[1] + _OUT * after)],
            top[::-1],
            [(first[0] - _OUT, first[1] - _OUT * before)],
        ]
    )
    half = (frame.half_width if across else frame.half_length) + 1.0
    sheet = CrossSection([ring], manifold3d.FillRule.Positive).extrude(2 * half).translate((0.0, 0.0, -half))
    along, side = frame.along, np.array([-frame.along[1], frame.along[0]])
    # The section's x, its height, and the way it is drawn out, as columns: right-handed either way.
    x, out = (along, -side) if across else (side, along)
    matrix = np.array(
        [[x[0], 0.0, out[0], frame.centre[0]], [x[1], 0.0, out[1], frame.centre[1]], [0.0, 1.0, 0.0, 0.0]]
    )
    return sheet.transform(matrix)


def _slope(pair: NDArray[np.float64]) -> float:
    step = pair[1] - pair[0]
    return float(step[1] / step[0]) if abs(step[0]) > 1e-6 else 0.0


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


def _cut(
    rings: list[NDArray[np.float64]],
    low: float,
    rise: float,
    slope: Profile,
    gables: list[list[bool]] | None,
    shape: str,
) -> Manifold:
    planes = []
    for (d0, z0), (d1, z1) in itertools.pairwise(slope):
        climb = (z1 - z0) * rise / max(d1 - d0, 1e-3)
        start = z0 * rise - climb * d0
        if climb > 1e-3:
            planes.append(_Plane(start, climb, (rise - start) / climb))
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


_SPECK = 0.002  # metres: detail that the kernel makes and that is too small to be seen


def building_solid(polygon: Polygon, low: float, eaves: float, roof: Roof) -> Manifold:
    """Return the closed solid of a building or a part of one.

    Parameters
    ----------
    polygon
        Outline, metres; valid, near the origin for precision.
    low, eaves
        Heights of its underside and of where the roof begins, metres.
    roof
        What covers it; a measured one's facets near the origin, too.

    Returns
    -------
    Manifold
        Watertight, normals outward; empty where the outline is.

    Notes
    -----
    OSM wiki, Simple 3D Buildings and Key:roof:shape.
    """
    if roof.facets:
        return measured_solid(polygon, low - eaves, roof.facets).translate((0.0, 0.0, eaves))
    rings = rings_of(polygon)
    if roof.shape == "flat":
        return _with_parapet(polygon, low, eaves, roof.height) if roof.height > 0.05 else prism(rings, low, eaves)
    if roof.height <= 0.05:
        return prism(rings, low, eaves)
    # The roof is made over eaves at 0: its highest point is then stretch to the height asked, exactly.
    if roof.shape == "skillion":
        yaw = roof.direction if roof.direction is not None else 0.0
        fall = np.array([math.cos(yaw), math.sin(yaw)])
        reach = [float(v) for ring in rings for v in dot(ring, fall)]
        first, last = min(reach), max(reach)
        body = prism(rings, low - eaves, roof.height)
        slope = roof.height / max(last - first, 0.1)
        normal = np.array([-fall[0] * slope, -fall[1] * slope, -1.0])
        # Kept is what lies under the plane z = (last - p.fall) * slope.
        solid = body.trim_by_plane(tuple(normal), -last * slope / math.hypot(*normal))
    elif roof.shape in ("dome", "onion", "pyramidal"):
        made = _drawn_together(polygon, rings, low - eaves, roof)
        solid = made if made is not None else sloped_solid(polygon, rings, low - eaves, replace(roof, shape="hipped"))
    else:
        frame: BoxFrame = _box_frame(polygon, roof.direction)
        if frame.suits(roof.shape, polygon, holes=len(rings) > 1):
            solid = _profiled_solid(rings, low - eaves, roof, frame)
        else:
            solid = sloped_solid(polygon, rings, low - eaves, roof)
    solid = solid.simplify(_SPECK)
    if len(rings) == 1 or roof.shape not in ("dome", "onion", "pyramidal"):
        # A dome's or a pyramid's top may lie over a hole: what is left of it stays as it would be without.
        solid = _as_high_as(solid, roof.height)
    return solid.translate((0.0, 0.0, eaves))


def _as_high_as(solid: Manifold, height: float) -> Manifold:
    """Stretch what lies above 0 so that its top is at `height`."""
    *_, top = (0.0,) if solid.is_empty() else solid.bounding_box()
    if top < 0.01 or abs(top - height) < 0.002:
        return solid
    share = height / top

    def stretch(points: NDArray[np.float64]) -> NDArray[np.float64]:
        result = np.array(points, np.float64)
        result[:, 2] = np.where(result[:, 2] > 0.0, result[:, 2] * share, result[:, 2])
        return result

    return solid.warp_batch(stretch)


def _with_parapet(polygon: Polygon, low: float, eaves: float, height: float) -> Manifold:
    rings = rings_of(polygon)
    inner = overlay.buffer(polygon, -0.35, join_style="mitre", mitre_limit=2.0)
    pools = [part for part in shapely.get_parts(inner) if part.geom_type == "Polygon" and part.area > 4.0]
    if not pools:
        return prism(rings, low, eaves)
    hollow = [prism(rings_of(pool), eaves, eaves + height + 1.0) for pool in pools]
    return Manifold.batch_boolean([prism(rings, low, eaves + height), *hollow], manifold3d.OpType.Subtract)
