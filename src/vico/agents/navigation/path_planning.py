"""Path planning on a grid of costs that wraps around: A* to a box, straight pieces of a path, and replanning.

`PathKeeper` keeps a path while it is the best one known: it comes to what planning anew at every step would, for less.
The loops are compiled.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.agents.base import AgentState
from vico.agents.navigation.voxels import FREE_COST, NEAR_COST, SIDE, VOXEL, lowest_level
from vico.io.compiled import compiled

#: Length of a step along an axis; and of one across, a little less than sqrt 2 times as long.
STRAIGHT = 5
DIAGONAL = 7
#: Distances bound costs from below when taken so many times.
BOUND = 0.98
# Levels a walker may step up or down from column to column, and how steeply unseen ground may climb, levels a column.
_STEP_LEVELS, _SLOPE = 3, 0.9
_AT_LEVEL = 5  # levels that a target may lie above or below who has reached it
_LEVEL_COST = STRAIGHT * FREE_COST / _SLOPE
_NO_LEVEL = -1000.0
# Columns of `Target.values`: middle, yaw, half of length and width, how near one has to come, and level.
_X, _Y, _YAW, _HALF_LENGTH, _HALF_WIDTH, _NEAR, _LEVEL = range(7)
# Who touches something gets free of it within so many columns, or not at all.
_WAY_OUT_CELLS = 3
# Where no way leads there, a level that is left counts as so many columns.
_LEVELS_COUNT = 3.0
# A straight line may cost so many times what the cells of a way do, and two free columns more; after so many of
# them that it does not lead to, no more are tried.
_HARDLY_MORE, _ROUNDING, _MISSES = 1.1, 2 * STRAIGHT * FREE_COST, 12
#: Heights at which unseen ground may be come to in one search, by how many levels are left to the target's.
LAYERS, _LAYER_LEVELS = 4, 8.0


@dataclass(frozen=True)
class Target:
    """Where to go: to within so many metres of an oriented box; a box without extent makes it a disc.

    Attributes
    ----------
    x, y
        Its middle, ENU metres.
    yaw, half_length, half_width
        How it lies, radians and metres.
    near
        Metres from the box at which one is there.
    z
        Height at which one has to arrive, metres; it matters on stairs only.
    """

    x: float
    y: float
    yaw: float = 0.0
    half_length: float = 0.0
    half_width: float = 0.0
    near: float = 0.0
    z: float | None = None

    @classmethod
    def disc(cls, point: ArrayLike, near: float) -> Target:
        """Return the disc around a point of two or three coordinates."""
        values = [float(value) for value in np.asarray(point, np.float64).ravel()]
        return cls(values[0], values[1], near=near, z=values[2] if len(values) > 2 else None)

    def away(self, x: float, y: float) -> float:
        """Metres from a point to the box, whatever is near enough."""
        dx, dy = x - self.x, y - self.y
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        return math.hypot(
            max(abs(c * dx + s * dy) - self.half_length, 0.0), max(abs(c * dy - s * dx) - self.half_width, 0.0)
        )

    def values(self, base: float) -> NDArray[np.float64]:
        """Return it as the search takes it: in columns, its height as a level above `base`; shape ``(7,)``."""
        level = _NO_LEVEL if self.z is None else (self.z - base) / VOXEL
        sizes = np.array([self.half_length, self.half_width, self.near]) / VOXEL
        return np.array([self.x / VOXEL, self.y / VOXEL, self.yaw, *sizes, level])


class SearchMemory(NamedTuple):
    """Working memory of searches, for cells up to half its side `m` away from the start.

    On ground that climbs a cell may be come to at several heights, as far as is known: it has a layer for each. Shapes
    are ``(layers * m, m)``.

    Attributes
    ----------
    cost
        Least cost to a cell, int32; valid where `stamp` is the search's.
    parent
        Direction one came from, and 16 times the layer; 8 for the start; int8.
    stamp
        Search that saw the cell, twice; one more where its cost is final; int32.
    low, high
        Between which levels the ground is there, float32: the same where it was seen.
    searches
        Searches so far, twice, shape ``(1,)``.
    """

    cost: NDArray[np.int32]
    parent: NDArray[np.int8]
    stamp: NDArray[np.int32]
    low: NDArray[np.float32]
    high: NDArray[np.float32]
    searches: NDArray[np.int32]


def search_memory(m: int = SIDE, *, layers: int = 1) -> SearchMemory:
    """Return memory for ways on `m` x `m` cells, a power of 2; `layers`: 1 to `LAYERS`."""
    whole = (layers * m, m)
    return SearchMemory(
        np.zeros(whole, np.int32),
        np.zeros(whole, np.int8),
        np.zeros(whole, np.int32),
        np.zeros(whole, np.float32),
        np.zeros(whole, np.float32),
        np.zeros(1, np.int32),
    )


@compiled(inline="always")
def box_distance(x, y, target):
    """Return cells from a point to a box (`Target.values`)."""
    dx, dy = x - target[_X], y - target[_Y]
    c, s = math.cos(target[_YAW]), math.sin(target[_YAW])
    across = max(abs(c * dx + s * dy) - target[_HALF_LENGTH], 0.0)
    along = max(abs(c * dy - s * dx) - target[_HALF_WIDTH], 0.0)
    return math.sqrt(across * across + along * along)


@compiled(inline="always")
def cost_bound(i, j, target):
    """Return the least that any way from a cell to a target costs."""
    left = max(box_distance(i + 0.5, j + 0.5, target) - target[_NEAR], 0.0)
    return int(BOUND * STRAIGHT * FREE_COST * left)


@compiled
def search_path(grid, memory, start, target, climb):
    """Run A* from a cell to the first cell within a target.

    Parameters
    ----------
    grid
        Costs, 0 where blocked, and masks, from which floors are found where `climb`; ``[iy, ix]``, wrapping around.
    memory
        `SearchMemory`.
    start
        Column, row, and level.
    target
        `Target.values`.
    climb
        Whether the ground climbs: then only steps of 0.3 m up or down are made, and the target's level counts.

    Returns
    -------
    cells, reached
        From the start on, with the cost up to each, int64, shape ``(k, 3)``; whether they lead into the target: else to
        the nearest cell to it.
    """
    costs, masks = grid
    m = memory.cost.shape[1]
    wrap, inner, middle, layers = costs.shape[0] - 1, m - 1, m // 2, memory.cost.shape[0] // m
    x0, y0 = int(start[0]), int(start[1])
    memory.searches[0] += 2
    stamp = memory.searches[0]
    b, a = y0 & inner, x0 & inner
    memory.cost[b, a], memory.parent[b, a], memory.stamp[b, a] = 0, 8, stamp
    memory.low[b, a] = memory.high[b, a] = start[2]
    queue = [_queue_entry(_estimated_cost(x0, y0, (start[2], start[2]), target, climb), middle, middle, 0)]
    best_away, best_x, best_y, best_layer = np.inf, x0, y0, 0
    while len(queue) > 0:
        packed = heapq.heappop(queue)
        layer = (packed >> 24) & 3
        x, y = x0 + ((packed >> 12) & 4095) - middle, y0 + (packed & 4095) - middle
        b, a = layer * m + (y & inner), x & inner
        if memory.stamp[b, a] != stamp:
            continue
        memory.stamp[b, a] = stamp + 1
        here, blocked = memory.cost[b, a], costs[y & wrap, x & wrap] == 0
        levels = (memory.low[b, a], memory.high[b, a])
        away = box_distance(x + 0.5, y + 0.5, target) - target[_NEAR]
        off = _levels_off(levels, target) if climb else 0.0
        if away <= 0.0 and off == 0.0:
            return _backtrack(memory, x, y, layer), True
        away = max(away, 0.0) + _LEVELS_COUNT * off
        if away < best_away and not blocked:
            best_away, best_x, best_y, best_layer = away, x, y, layer
        for direction in range(8):
            i, j = x + _dx(direction), y + _dy(direction)
            if abs(i - x0) >= middle - 1 or abs(j - y0) >= middle - 1:
                continue
            cost = np.int64(costs[j & wrap, i & wrap])
            if cost == 0:
                # A start that touches what is around it may still be left.
                if not blocked or max(abs(i - x0), abs(j - y0)) > _WAY_OUT_CELLS:
                    continue
                cost = np.int64(2 * NEAR_COST)
            up, on = levels, 0
            if climb:
                mask = masks[j & wrap, i & wrap]
                up = _levels_at(mask, levels)
                if up[0] > levels[1] + _STEP_LEVELS or up[1] < levels[0] - _STEP_LEVELS:
                    continue
                if not mask:
                    on = min(math.ceil(_levels_off(up, target) / _LAYER_LEVELS), layers - 1)
            d, c = on * m + (j & inner), i & inner
            if memory.stamp[d, c] == stamp + 1:
                continue
            new = here + cost * (STRAIGHT if i == x or j == y else DIAGONAL)
            if memory.stamp[d, c] != stamp or new < memory.cost[d, c]:
                memory.cost[d, c], memory.parent[d, c], memory.stamp[d, c] = new, direction + 16 * layer, stamp
                memory.low[d, c], memory.high[d, c] = up
                guess = _estimated_cost(i, j, up, target, climb)
                heapq.heappush(queue, _queue_entry(new + guess, i - x0 + middle, j - y0 + middle, on))
    return _backtrack(memory, best_x, best_y, best_layer), False


@compiled(inline="always")
def _queue_entry(cost, i, j, layer):
    """Pack an entry of the queue: ties are broken by position."""
    return (np.int64(cost) << np.int64(26)) | (np.int64(layer) << np.int64(24)) | (np.int64(i) << np.int64(12)) | j


@compiled(inline="always")
def _dx(direction):
    return (1, -1, 0, 0, 1, -1, 1, -1)[direction]


@compiled(inline="always")
def _dy(direction):
    return (0, 0, 1, -1, 1, -1, -1, 1)[direction]


@compiled(inline="always")
def _estimated_cost(i, j, levels, target, climb):
    least = cost_bound(i, j, target)
    if climb:
        least = max(least, int(_LEVEL_COST * _levels_off(levels, target)))
    return least


@compiled(inline="always")
def _levels_off(levels, target):
    """Return how many levels are left to climb or to go down to a target; 0 where its height is told by nobody."""
    if target[_LEVEL] == _NO_LEVEL:
        return 0.0
    return max(levels[0] - target[_LEVEL] - _AT_LEVEL, target[_LEVEL] - levels[1] - _AT_LEVEL, 0.0)


@compiled(inline="always")
def _levels_at(mask, levels):
    """Return between which levels the ground is in a column, coming from one beside it."""
    if mask:
        level = np.float32(lowest_level(mask))
        return level, level
    return np.float32(levels[0] - _SLOPE), np.float32(levels[1] + _SLOPE)


@compiled
def _backtrack(memory, x, y, layer):
    """Return the cells from the start to ``(x, y)``, with what each costs to get to."""
    m = memory.cost.shape[1]
    found = []
    while True:
        b, a = layer * m + (y & (m - 1)), x & (m - 1)
        found.append((x, y, np.int64(memory.cost[b, a])))
        came = memory.parent[b, a]
        if came == 8:
            break
        x, y, layer = x - _dx(came & 7), y - _dy(came & 7), came >> 4
    cells = np.empty((len(found), 3), np.int64)
    for k in range(len(found)):
        cells[len(found) - 1 - k, 0], cells[len(found) - 1 - k, 1], cells[len(found) - 1 - k, 2] = found[k]
    return cells


@compiled
def furthest_straight_cell(costs, cells, x, y, most):
    """Return the last cell of a way that a straight line leads to for hardly more than the way itself costs.

    Parameters
    ----------
    costs
        As `search` has them.
    cells
        As `search` returns them.
    x, y
        Where the line begins, in cells.
    most
        Cells that it may be long.

    Returns
    -------
    which, limit
        Index of the cell, 0 for the first; and the greatest cost on the line, 255 where it is blocked.
    """
    best, best_limit, misses = 0, 0, 0
    for k in range(1, len(cells)):
        dx, dy = cells[k, 0] + 0.5 - x, cells[k, 1] + 0.5 - y
        length = math.sqrt(dx * dx + dy * dy)
        if k > 1 and (length > most or misses > _MISSES):
            break
        limit, total = _line_cost(costs, x, y, dx, dy)
        if k == 1 or (limit < 255 and total <= _HARDLY_MORE * (cells[k, 2] - cells[0, 2]) + _ROUNDING):
            best, best_limit, misses = k, limit, 0
        else:
            misses += 1
    return best, best_limit


@compiled(inline="always")
def _line_cost(costs, x, y, dx, dy):
    """Return the greatest cost of a cell on a line, 255 for blocked ones, and the whole line's as a way's."""
    wrap = costs.shape[0] - 1
    length = math.sqrt(dx * dx + dy * dy)
    samples = int(length * 2.0) + 1
    limit, total = np.int64(0), np.int64(0)
    for s in range(1, samples + 1):
        column, row = math.floor(x + dx * s / samples), math.floor(y + dy * s / samples)
        cost = np.int64(costs[row & wrap, column & wrap])
        if cost == 0:
            cost = np.int64(255)
        if cost > limit:
            limit = cost
        total += cost
    return limit, STRAIGHT * length * total / samples


#: Side of the cells that ways on stairs are found on, around who walks there.
ON_STAIRS = 256


class PathKeeper:
    """Finds the best way to a target at every step, and searches only where the last one may not be it any more.

    A way is kept while one stands on it, none of its cells got costlier, and no cell that got cheaper since it was
    found lies so that a way through it could be cheaper than what is left: as the crow flies there, and on to the
    target, over nothing but free cells.

    Parameters
    ----------
    n
        Side of the grid, cells, a power of 2: indices wrap around.
    """

    def __init__(self, n: int) -> None:
        self._memory: SearchMemory = search_memory(n)
        # Stairs are few, and short.
        self._memory_on_stairs: SearchMemory | None = None
        self._planned = np.zeros((n, n), np.uint8)
        self._cells = np.zeros((0, 3), np.int64)
        self._target = np.zeros(0)
        self.reached = False
        self.searches = 0

    def way(
        self,
        costs: NDArray[np.uint8],
        masks: NDArray[np.uint64],
        start: tuple[int, int, float],
        target: NDArray[np.float64],
        *,
        climb: bool = False,
    ) -> NDArray[np.int64]:
        """Return the best way known.

        Parameters
        ----------
        costs, masks, start, target, climb
            As `vico.agents.navigation.path_planning.search_path` takes them.

        Returns
        -------
        ndarray
            Cells from the start on, column, row and cost up to there, shape ``(k, 3)``. `reached` tells whether they
            lead into the target; else they lead to the nearest cell to it.
        """
        first = -1 if climb else self._place_on_way(start)
        if first >= 0 and np.array_equal(target, self._target) and self._still_best(costs, first, target):
            self._cells = self._cells[first:]
            return self._cells
        self.searches += 1
        self._planned[:] = costs
        self._target = target.copy()
        memory = self._memory
        if climb:
            self._memory_on_stairs = self._memory_on_stairs or search_memory(ON_STAIRS, layers=LAYERS)
            memory = self._memory_on_stairs
        self._cells, self.reached = search_path((costs, masks), memory, np.array(start), target, climb)
        return self._cells

    def forget(self) -> None:
        """Search anew next time."""
        self._cells = np.zeros((0, 3), np.int64)

    def _place_on_way(self, start: tuple[int, int, float]) -> int:
        on = np.flatnonzero((self._cells[:, 0] == start[0]) & (self._cells[:, 1] == start[1]))
        return int(on[0]) if len(on) else -1

    def _still_best(self, costs: NDArray[np.uint8], first: int, target: NDArray[np.float64]) -> bool:
        (changed,) = np.nonzero(costs.ravel() != self._planned.ravel())
        if not len(changed):
            return True
        left = float(self._cells[-1, 2] - self._cells[first, 2]) if self.reached else np.inf
        return bool(_is_still_best(costs, self._planned, changed, self._cells[first:], (left, target)))

    def state(self, costs: NDArray[np.uint8]) -> AgentState:
        """Return the way, and which of the costs it was found with were others than now."""
        kept = len(self._cells) > 0
        changed = np.flatnonzero(costs.ravel() != self._planned.ravel()) if kept else np.zeros(0, np.int64)
        return {
            "cells": self._cells.astype(np.int32),
            "target": self._target.copy(),
            "reached": self.reached,
            "changed": changed.astype(np.int32),
            "planned": self._planned.ravel()[changed],
        }

    def restore(self, state: Mapping[str, Any], costs: NDArray[np.uint8]) -> None:
        """Keep the way that another one kept, given what cells cost now."""
        self._cells = np.asarray(state["cells"], np.int64).reshape(-1, 3)
        self._target = np.array(state["target"], np.float64)
        self.reached = bool(state["reached"])
        self._planned[:] = costs
        self._planned.ravel()[np.asarray(state["changed"], np.int64)] = np.asarray(state["planned"], np.uint8)


@compiled
def _is_still_best(costs, planned, changed, cells, goal):
    """Tell whether a way is still the best one, given the cells whose cost is another than when it was found."""
    left, target = goal
    n = costs.shape[0]
    wrap, middle = n - 1, n // 2
    x0, y0 = cells[0, 0], cells[0, 1]
    for k in range(1, len(cells)):
        b, a = cells[k, 1] & wrap, cells[k, 0] & wrap
        if costs[b, a] != planned[b, a]:
            return False
    # Whether a start that is blocked may be left hangs on its own cost, too.
    if costs[y0 & wrap, x0 & wrap] != planned[y0 & wrap, x0 & wrap]:
        return False
    for k in range(len(changed)):
        b, a = changed[k] // n, changed[k] % n
        now, then = costs[b, a], planned[b, a]
        if now == 0 or (then != 0 and now >= then):
            continue
        dx, dy = ((a - x0 + middle) & wrap) - middle, ((b - y0 + middle) & wrap) - middle
        there = BOUND * STRAIGHT * FREE_COST * np.sqrt(np.float64(dx * dx + dy * dy))
        # The bounds are rounded: an equal way is no reason to change.
        if there + cost_bound(x0 + dx, y0 + dy, target) < left - 1.0:
            return False
    return True
