"""Who is near: one grid over the ground for all that ask, instead of looking at all pairs."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled

Array = NDArray[Any]


class NeighbourGrid(NamedTuple):
    """Points hashed by the square cell they lie in; made anew when they have moved farther than `spread` allows.

    Attributes
    ----------
    cell
        Side of a cell, metres.
    spread
        How much farther than its reach a search looks, metres: what bodies stick out of their cells, and what they
        move while the grid is used.
    column, row
        Cell of each point, int64, shape ``(n,)``.
    start, order
        Points of bucket ``b`` of the hash: ``order[start[b]:start[b + 1]]``.
    """

    cell: float
    spread: float
    column: Array
    row: Array
    start: Array
    order: Array


@compiled
def _bucket(column, row, buckets):  # type: ignore[no-untyped-def]
    # The primes of Teschner et al.: Optimized spatial hashing for collision detection of deformable objects (2003).
    return ((column * 73856093) ^ (row * 19349663)) & (buckets - 1)


@compiled
def neighbour_grid(x, y, cell, spread):  # type: ignore[no-untyped-def]
    """Return a grid of the points x, y, shape ``(n,)`` each; `cell` and `spread` as in `NeighbourGrid`."""
    n = len(x)
    buckets = 64
    while buckets < 2 * n:
        buckets *= 2
    column, row = np.empty(n, np.int64), np.empty(n, np.int64)
    start = np.zeros(buckets + 1, np.int64)
    for k in range(n):
        column[k], row[k] = math.floor(x[k] / cell), math.floor(y[k] / cell)
        start[_bucket(column[k], row[k], buckets) + 1] += 1
    for b in range(buckets):
        start[b + 1] += start[b]
    order = np.empty(n, np.int64)
    filled = start[:-1].copy()
    for k in range(n):
        b = _bucket(column[k], row[k], buckets)
        order[filled[b]] = k
        filled[b] += 1
    return NeighbourGrid(cell, spread, column, row, start, order)


@compiled
def search(grid, x, y, reach, buffer):  # type: ignore[no-untyped-def]
    """Write the points that may be within `reach` metres of (x, y) into `buffer`, in ascending order.

    Returns
    -------
    ndarray
        The part of `buffer` (int64, as long as there are points) that is used: all points in the cells that the
        square of side ``2 * (reach + spread)`` touches.
    """
    far = reach + grid.spread
    first, last = math.floor((x - far) / grid.cell), math.floor((x + far) / grid.cell)
    low, high = math.floor((y - far) / grid.cell), math.floor((y + far) / grid.cell)
    n, buckets = 0, len(grid.start) - 1
    for row in range(low, high + 1):
        for column in range(first, last + 1):
            b = _bucket(column, row, buckets)
            for at in range(grid.start[b], grid.start[b + 1]):
                k = grid.order[at]
                if grid.column[k] == column and grid.row[k] == row:
                    # What is done with neighbours may depend on their order, and must not depend on the hash. They
                    # are few, and those of a cell come in order: sorted at once.
                    at_place = n
                    while at_place > 0 and buffer[at_place - 1] > k:
                        buffer[at_place] = buffer[at_place - 1]
                        at_place -= 1
                    buffer[at_place] = k
                    n += 1
    return buffer[:n]
