"""Ridged roofs over outlines that about fill a box: the prism within profiles drawn across the box."""

from __future__ import annotations

import math
from dataclasses import dataclass

import manifold3d
import numpy as np
import shapely
from manifold3d import CrossSection, Manifold
from numpy.typing import NDArray
from shapely import Polygon

from vico.exact import dot
from vico.worldgen.facts.outlines.roof_shapes import Roof, prism

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


def box_frame(polygon: Polygon, direction: float | None) -> BoxFrame:
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


def profiled_solid(rings: list[NDArray[np.float64]], low: float, roof: Roof, frame: BoxFrame) -> Manifold:
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
