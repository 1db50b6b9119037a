"""Heights that no ground has: single pixels and small groups of them, far above or below all around them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

# Each rule leaves out a group of at most so many pixels (the first number) that stands on every side so many metres
# (the second), and so many times the distance between pixels (the third), above its neighbours, or lies below them. A
# cliff, a peak or a pass has neighbours of nearly its own height on some side, whatever the slope. What stands alone
# is held against the steepest ground there is: Devils Tower rises 265 m from a foot of 300 m, the Old Man of Hoy
# 137 m from one of 30 m, Ball's Pyramid 560 m from one of 300 m by 1,100 m. Holes with steep walls all round are wider.
_ABOVE = ((9, 200.0, 4.0), (400, 1000.0, 20.0))
_BELOW = ((9, 60.0, 3.0), (400, 500.0, 10.0))
_LEAST_AROUND = 3  # neighbours that are known
_MOST_ROUNDS = 8
# Large grids are gone through in overlapping tiles: a group wider than the overlap is none.
_STRIDE, _OVERLAP = 512, 128


def without_outliers(
    heights: NDArray[np.float64], spacing: float
) -> tuple[NDArray[np.float64], list[tuple[int, int, float]]]:
    """Leave out heights that no ground has.

    Parameters
    ----------
    heights
        Metres on a grid, NaN where unknown, shape ``(rows, columns)``.
    spacing
        Distance between neighbours, metres.

    Returns
    -------
    tuple
        The heights, NaN where one was left out; and row, column and height of each of these.
    """
    found: list[tuple[int, int, float]] = []
    rows, columns = heights.shape
    least = min(max(step, slope * spacing) for _, step, slope in (*_ABOVE, *_BELOW))
    for top in range(0, max(rows - _OVERLAP, 1), _STRIDE):
        for left in range(0, max(columns - _OVERLAP, 1), _STRIDE):
            tile = np.s_[top : top + _STRIDE + _OVERLAP, left : left + _STRIDE + _OVERLAP]
            # What is left out may have hidden another beside it.
            for _ in range(_MOST_ROUNDS):
                part = heights[tile]
                if not _largest_step(part) >= least:
                    break
                ends = (top == 0, top + len(part) == rows, left == 0, left + part.shape[1] == columns)
                bad = _outlying(part, spacing, ends)
                if not bad.any():
                    break
                down, across = np.nonzero(bad)
                found += zip((down + top).tolist(), (across + left).tolist(), part[bad].tolist(), strict=True)
                heights = heights.copy()
                heights[tile][bad] = np.nan
    return heights, found


def _largest_step(heights: NDArray[np.float64]) -> float:
    """Return the largest difference of pixels side by side, metres."""
    steps = [np.abs(np.diff(heights, axis=axis)) for axis in (0, 1)]
    return max(float(np.max(step, initial=0.0, where=np.isfinite(step))) for step in steps)


def _outlying(heights: NDArray[np.float64], spacing: float, ends: tuple[bool, ...]) -> NDArray[np.bool_]:
    """Whether heights are such that no ground has; `ends` tells whether the grid ends at top, bottom, left, right."""
    pairs = _neighbours(heights.shape)
    pairs = pairs[:, np.isfinite(heights.ravel()[pairs]).all(axis=0)]
    bad = np.zeros(heights.shape, bool)
    for sign, rules in ((1.0, _ABOVE), (-1.0, _BELOW)):
        for most, step, slope in rules:
            group, alone = _groups_alone(sign * heights.ravel(), pairs, max(step, slope * spacing), most)
            group = group.reshape(heights.shape)
            sides = (group[0], group[-1], group[:, 0], group[:, -1])
            for side, is_end in zip(sides, ends, strict=True):
                if not is_end:  # there it may go on
                    alone[side] = False
            bad |= alone[group]
    return bad & np.isfinite(heights)


def _groups_alone(
    heights: NDArray[np.float64], pairs: NDArray[np.int64], step: float, most: int
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Find groups of pixels between which there is no step.

    Parameters
    ----------
    heights
        Metres, shape ``(n,)``.
    pairs
        Numbers of pixels that touch each other, shape ``(2, m)``.
    step
        Metres that part two groups.
    most
        Pixels of a group that may be alone.

    Returns
    -------
    tuple
        The group of each pixel, shape ``(n,)``; and of each group, whether all pixels around it lie a step below it.
    """
    apart = np.abs(heights[pairs[0]] - heights[pairs[1]]) >= step
    joined = pairs[:, ~apart]
    links = coo_array((np.ones(joined.shape[1], bool), (joined[0], joined[1])), shape=(len(heights), len(heights)))
    count, group = connected_components(links, directed=False)
    one, two = pairs[:, apart]
    higher = np.where(heights[one] > heights[two], one, two)
    # Two pixels of one group may be as far apart, if a slope joins them: then it is no plain step.
    lower_of = np.bincount(group[one + two - higher], minlength=count)
    higher_of = np.bincount(group[higher], minlength=count)
    size = np.bincount(group, minlength=count)
    return group, (size <= most) & (lower_of == 0) & (higher_of >= _LEAST_AROUND)


def _neighbours(shape: tuple[int, ...]) -> NDArray[np.int64]:
    """Return numbers of pixels that touch each other by a side or a corner, shape ``(2, n)``."""
    number = np.arange(shape[0] * shape[1]).reshape(shape)
    return np.concatenate(
        [
            np.stack([number[:, :-1].ravel(), number[:, 1:].ravel()]),
            np.stack([number[:-1].ravel(), number[1:].ravel()]),
            np.stack([number[:-1, :-1].ravel(), number[1:, 1:].ravel()]),
            np.stack([number[:-1, 1:].ravel(), number[1:, :-1].ravel()]),
        ],
        axis=1,
    )
