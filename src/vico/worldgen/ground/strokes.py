"""Strokes of paint as flat quads: strips along lines, and broken lines."""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString


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
