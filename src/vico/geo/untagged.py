"""Voids that a height grid does not tag as such: patches of one repeated value, far from the ground at their border."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

_LEAST = 10  # pixels; fewer are judged as outliers
_MOST_VALUES = 8  # repeated values that are looked at
_RING = 3  # pixels from a patch to the ground that it is held against: resampling mixes the two in between
_LEAST_RING = 8
_SEA_LEVEL = 2.0  # metres around 0: geoids differ
_NEARLY_ALL = 0.95
_MIXED, _MANY_MIXED = 0.8, 0.1  # of the step, below which a pixel beside a void is a mixture; share of these
# What nearly all of the ring stands above the patch or below it, metres and times the distance between pixels: where
# the patch is left out, and where it is told of and kept. No lake has walls of 69 degrees along its whole shore. At 0
# there is the sea, with cliffs of 214 m over kilometres (Moher). Stacks and towers have a flat top on a coarse grid.
_LAKE, _SEA, _TOP = ((100.0, 8.0), (100.0, 8.0)), ((250.0, 8.0), (30.0, 3.0)), ((300.0, 8.0), (100.0, 8.0))
_TOUCHING = np.ones((3, 3), bool)


@dataclass(frozen=True)
class Patch:
    """Pixels of one value in one piece.

    Attributes
    ----------
    row, column
        One of them, near the middle.
    value
        Their height, metres.
    pixels
        How many they are.
    step
        By how much the ground around is higher, metres, in the median; negative where it is lower.
    """

    row: int
    column: int
    value: float
    pixels: int
    step: float


def without_voids(heights: NDArray[np.float64], spacing: float) -> tuple[NDArray[np.float64], list[Patch], list[Patch]]:
    """Leave out patches of one value, 0 or another, that stand far above or below nearly everything around them.

    Files lose the word for no data when they are reprojected or cut; what is left is a number like any other. A patch
    of most of the grid is kept: then it is the rest that stands out, as islands do.

    Parameters
    ----------
    heights
        Metres on a grid, NaN where unknown, shape ``(rows, columns)``.
    spacing
        Distance between neighbours, metres.

    Returns
    -------
    tuple
        The heights, NaN where a patch was left out, also where resampling mixed it with the ground; the patches left
        out; and patches that may be a void, or a sea below cliffs or the top of a tower, and were kept.
    """
    voids: list[Patch] = []
    doubtful: list[Patch] = []
    known = int(np.isfinite(heights).sum())
    given = heights
    for value in _repeated(given, spacing):
        labels, _ = ndimage.label(given == value, _TOUCHING)
        sizes = np.bincount(labels.ravel())
        for number, box in enumerate(ndimage.find_objects(labels), 1):
            if not _LEAST <= sizes[number] <= known / 2:
                continue
            reach = tuple(slice(max(side.start - _RING, 0), side.stop + _RING) for side in box)
            patch = labels[reach] == number
            steps = _steps(given[reach], patch, value)
            if steps is None:
                continue
            row, column = _middle(patch)
            found = Patch(
                row + reach[0].start, column + reach[1].start, value, int(sizes[number]), float(np.median(steps))
            )
            left_out, told = _TOP if found.step < 0.0 else _SEA if abs(value) <= _SEA_LEVEL else _LAKE
            if _far(steps, left_out, spacing):
                heights = heights.copy() if heights is given else heights
                heights[reach][_with_mixed(given[reach], patch, value)] = np.nan
                voids.append(found)
            elif _far(steps, told, spacing):
                doubtful.append(found)
    return heights, voids, doubtful


def _repeated(heights: NDArray[np.float64], spacing: float) -> list[float]:
    """Return values that pixels beside a step have in common with a neighbour, the most frequent first."""
    least = max(_SEA[1][0], _SEA[1][1] * spacing) / _RING
    found = []
    for grid in (heights, heights.T):
        steep = np.abs(np.diff(grid, axis=0)) >= least  # NaN is not
        same = np.diff(grid, axis=1) == 0.0
        level = np.zeros(grid.shape, bool)
        level[:, 1:] |= same
        level[:, :-1] |= same
        found += [grid[:-1][steep & level[:-1]], grid[1:][steep & level[1:]]]
    values, counts = np.unique(np.concatenate(found), return_counts=True)
    order = np.argsort(-counts, kind="stable")[:_MOST_VALUES]
    return [float(value) for value in values[order]]


def _steps(heights: NDArray[np.float64], patch: NDArray[np.bool_], value: float) -> NDArray[np.float64] | None:
    """How much higher the ring around a patch is, metres; None where too little of it is known."""
    outside = ndimage.binary_dilation(patch, _TOUCHING, _RING) & ~ndimage.binary_dilation(patch, _TOUCHING, _RING - 1)
    steps = heights[outside] - value
    steps = steps[np.isfinite(steps)]
    return steps if len(steps) >= _LEAST_RING else None


def _far(steps: NDArray[np.float64], least: tuple[float, float], spacing: float) -> bool:
    """Whether nearly all of the ring is on one side, and so far."""
    bound = max(least[0], least[1] * spacing)
    return max(float(np.mean(steps >= bound)), float(np.mean(steps <= -bound))) >= _NEARLY_ALL


def _with_mixed(heights: NDArray[np.float64], patch: NDArray[np.bool_], value: float) -> NDArray[np.bool_]:
    """Return a patch, with all pixels beside it if many of them lie between it and the ground behind them."""
    away = np.where(np.isfinite(heights), np.abs(heights - value), 0.0)
    ground = ndimage.maximum_filter(away, 2 * _RING - 1)
    near = ndimage.binary_dilation(patch, _TOUCHING, _RING - 1)
    beside = near & ~patch & np.isfinite(heights)
    mixed = beside & (away < _MIXED * ground)
    return near if mixed.sum() > _MANY_MIXED * beside.sum() else patch


def _middle(patch: NDArray[np.bool_]) -> tuple[int, int]:
    """Return the row and column of the pixel of a patch that is nearest to its middle."""
    places = np.argwhere(patch)
    nearest = np.argmin(((places - places.mean(axis=0)) ** 2).sum(axis=1))
    return int(places[nearest, 0]), int(places[nearest, 1])
