"""Keeping a way while it is the best one known: what planning anew at every step would come to, for less."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.navigation.search import (
    BOUND,
    LAYERS,
    STRAIGHT,
    SearchMemory,
    bound,
    search,
    search_memory,
)
from vico.agents.navigation.voxel_kernels import FREE_COST
from vico.agents.state import AgentState
from vico.io.compiled import compiled

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
            As `vico.agents.navigation.search.search` takes them.

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
        self._cells, self.reached = search((costs, masks), memory, np.array(start), target, climb)
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
        return bool(_keeps(costs, self._planned, changed, self._cells[first:], (left, target)))

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
def _keeps(costs, planned, changed, cells, goal):  # type: ignore[no-untyped-def]
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
        if there + bound(x0 + dx, y0 + dy, target) < left - 1.0:
            return False
    return True
