"""Roofs of buildings from afar: flat, with a ridge or with slopes all around, of few triangles."""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.geo import overlay
from vico.world.far_parts import CELL, FarPart
from vico.world.model import Building

_PARAPET = 0.6  # metres of a flat roof's rim above it, where the building is as high as that


def roof_over(building: Building, part: FarPart) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]:
    """Make the roof over a part of a building.

    Parameters
    ----------
    building
        The building, for the shape of its roof and its height.
    part
        The part.

    Returns
    -------
    eaves, roof, gables
        How high the walls end, metres; the roof's triangles, and those of the walls between its slopes, which face
        outward, metres, shape ``(n, 3, 3)`` each.
    """
    limit = building.base + building.height
    none = np.zeros((0, 3, 3))
    level = min(float(np.median(part.heights)), limit)
    depth = shapely.distance(part.outline.boundary, shapely.points(part.cells))
    near = part.lows[depth < 0.75 * CELL]
    eaves = float(np.quantile(near, 0.25)) if len(near) else level
    ridge = min(float(np.quantile(part.heights, 0.95)), limit)
    if building.roof_shape == "flat" or ridge - eaves < 1.0 or len(part.cells) < 4:
        level = min(level + _PARAPET, limit)
        return level, _lying(part.outline, level), none
    corners = shapely.get_coordinates(part.outline.exterior)[:-1]
    if len(corners) == 4 and not part.outline.interiors and building.roof_shape not in ("mansard", "dome"):
        ridge = min(float(np.quantile(part.heights, 0.99)) + 0.2, limit)
        return eaves, *_ridged(corners, eaves, ridge, hipped=building.roof_shape not in ("gabled", "gambrel"))
    widest = float(depth.max())
    inset = min(0.45 * widest, 3.0) if building.roof_shape in ("mansard", "dome") else 0.8 * widest
    flat = overlay.simplify(overlay.buffer(part.outline, -inset, join_style="mitre", mitre_limit=2.0), 0.5 * inset)
    deep = part.heights[depth >= inset]
    top = min(float(np.median(deep)), limit) if len(deep) else ridge
    if flat.is_empty or top - eaves < 0.5:
        level = min(level, limit)
        return level, _lying(part.outline, level), none
    slopes = _lying(overlay.difference(part.outline, flat, grid=None), eaves)
    inner = shapely.distance(part.outline.boundary, shapely.points(slopes[..., :2])) > 0.35 * inset
    slopes[..., 2] = np.where(inner, top, eaves)
    return eaves, np.concatenate([slopes, _lying(flat, top)]), none


def _lying(shape: Any, height: float) -> NDArray[np.float64]:
    """Return triangles that cover a shape at a height, counter-clockwise from above."""
    flat = shapely.get_coordinates(shapely.get_parts(shapely.constrained_delaunay_triangles(shape)))
    corners = np.full((len(flat) // 4, 3, 3), height)
    corners[..., :2] = flat.reshape(-1, 4, 2)[:, :3]
    (ax, ay), (bx, by) = (corners[:, 1] - corners[:, 0]).T[:2], (corners[:, 2] - corners[:, 0]).T[:2]
    clockwise = ax * by - ay * bx < 0.0
    corners[clockwise] = corners[clockwise][:, ::-1]
    return corners


def _ridged(
    corners: NDArray[np.float64], eaves: float, ridge: float, *, hipped: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the roof over four corners with a ridge along the longer sides, and its gables."""
    if np.linalg.norm(corners[1] - corners[0]) > np.linalg.norm(corners[2] - corners[1]):
        corners = np.roll(corners, -1, axis=0)  # the first side is a short one
    a, b, c, d = np.c_[corners, np.full(4, eaves)]
    first, last = np.r_[(a + b)[:2] / 2.0, ridge], np.r_[(c + d)[:2] / 2.0, ridge]
    if hipped:
        length = np.linalg.norm((last - first)[:2])
        pulled = min(float(np.linalg.norm(b - a)) / 2.0 / max(float(length), 1e-9), 0.49) * (last - first)
        first, last = first + pulled, last - pulled
    slopes = np.array([(b, c, last), (b, last, first), (d, a, first), (d, first, last)])
    ends = np.array([(a, b, first), (c, d, last)])
    return (np.concatenate([slopes, ends]), ends[:0]) if hipped else (slopes, ends)
