"""Strokes of paint as flat quads: strips along lines, and broken lines."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString, Polygon

from vico.geo import overlay
from vico.geo.overlay import polygons_of

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


def divided(line: NDArray[np.float64], longest: float | None) -> NDArray[np.float64]:
    """Divide a polyline into steps of at most `longest` metres; None leaves it as it is."""
    if longest is None:
        return line
    return np.asarray(shapely.segmentize(LineString(line), longest).coords)


def broken(line: LineString, dash: float, gap: float, width: float) -> list[NDArray[np.float64]]:
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


def cut_to(quads: Sequence[NDArray[np.float64]], window: Polygon) -> NDArray[np.float64]:
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
