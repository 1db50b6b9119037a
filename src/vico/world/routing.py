"""Walking routes on the walkable map: A* with integer costs, then pulled straight."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from vico.world.grid_search import (
    CELL,
    EVERYWHERE,
    NEVER,
    RING,
    STRAIGHT,
    Costs,
    SearchMemory,
    backtrack,
    goal_at,
    nearest_free,
    search,
    string_pull,
)
from vico.world.walkable import CROSSING, OPEN, ROADWAY, SIDEWALK, WalkableMap

#: How much longer a metre on each surface counts than on a sidewalk, in hundredths.
WEIGHTS = {SIDEWALK: 100, CROSSING: 110, OPEN: 120, ROADWAY: 400}

# Walls are given a berth where there is room: cells closer than this cost a quarter more.
_BERTH = 0.6
# So are roadways, beside which a kerb's edge is: cells that touch them cost a quarter more, too.
_NEIGHBOURS = np.ones((3, 3), np.bool_)
SNAP = 6.0
"""Metres a start or goal may lie off what can be walked on."""

# Costs from landmarks are worth their making (a search of the whole map each) to who searches this often.
_LANDMARKS = 6
_WORTH_LANDMARKS = 40


def walking_costs(
    surfaces: NDArray[np.uint8], clearance: NDArray[np.float32], connected: NDArray[np.bool_]
) -> NDArray[np.int32]:
    """Return what a cell's width of walking costs in each cell of a map, hundredths; 0 where nobody walks."""
    table = np.zeros(5, np.int32)
    for surface, weight in WEIGHTS.items():
        table[surface] = weight
    cost = table[surfaces]
    cost[clearance < _BERTH] = cost[clearance < _BERTH] * 5 // 4
    beside = ndimage.binary_dilation(surfaces == ROADWAY, _NEIGHBOURS)
    beside &= np.isin(surfaces, (SIDEWALK, OPEN))
    cost[beside] = cost[beside] * 5 // 4
    cost[~connected] = 0
    return np.ascontiguousarray(cost, np.int32)


class Router:
    """Finds walks on a map; threads that share it wait for each other.

    After some searches it learns the costs from a few landmarks, by which later ones are several times as fast and find
    the same walks.

    Parameters
    ----------
    walkable
        The map; only cells connected with its edge are walked on.
    """

    def __init__(self, walkable: WalkableMap) -> None:
        self.walkable = walkable
        self._clearance = np.ascontiguousarray(walkable.clearance)
        self._cost = walking_costs(walkable.cls, self._clearance, walkable.connected)
        self._free = self._cost > 0
        cells = self._cost.size
        self._work = SearchMemory(np.zeros(cells, CELL), np.empty(RING, np.int32))
        self._generation = 0
        self._searches = 0
        self._landmarks = np.zeros((cells, 0), np.int32)
        self._learned: dict[int, NDArray[np.int32]] = {}
        self._lock = Lock()
        self._nothing = np.zeros((0, 0), np.bool_)
        self._shut = np.zeros(self._cost.shape, np.bool_)
        self._narrow: dict[float, NDArray[np.bool_]] = {}

    def learn_landmarks(self) -> None:
        """Learn the costs from landmarks now, where many searches are to come, and not at one of the first of them."""
        with self._lock:
            if self._searches < _WORTH_LANDMARKS:
                self._searches = _WORTH_LANDMARKS
                self._landmarks = self._placed_landmarks()

    def learn_costs(self, point: ArrayLike) -> None:
        """Learn the costs between a point and everywhere, where many searches are to begin or end.

        It takes as long as some twenty searches; those that begin or end there take a tenth from then on, and find the
        same walks. 4 bytes a cell are kept.
        """
        with self._lock:
            cell = self._nearest_cell(np.asarray(point, np.float64)[:2], self._free, SNAP)
            if cell >= 0 and cell not in self._learned:
                self._run(self._cost, cell, -1, self._landmarks)
                self._learned[cell] = np.where(self._is_final, self._work.cells["g"], NEVER).astype(np.int32)

    def nearest_walkable(self, xy: ArrayLike, *, within: float = 30.0) -> NDArray[np.float64] | None:
        """Centre of the nearest connected cell, ENU metres; None if there is none within `within` metres.

        A point that lies in such a cell already is returned as it is.
        """
        point = np.asarray(xy, np.float64)[:2]
        if bool(self.walkable.is_connected(point)):
            return point.copy()
        index = self._nearest_cell(point, self._free, within)
        return None if index < 0 else self._centre(index)

    def path(
        self,
        start: ArrayLike,
        goal: ArrayLike,
        *,
        blocked: NDArray[np.bool_] | None = None,
        closed: Sequence[tuple[float, float, float]] = (),
        room: float = 0.0,
        often: bool = False,
    ) -> NDArray[np.float64] | None:
        """Find a walk that prefers sidewalks and crossings and keeps 0.3 m from walls, and off kerbs' edges if it can.

        Parameters
        ----------
        start, goal
            ENU metres. A point that can't be walked on is led to the nearest one that can, up to 6 m off.
        blocked
            Cells that are closed besides, bool, shape ``(n, n)``.
        closed
            Squares that are closed besides, as x, y and half their side, metres: quicker than `blocked` where they are
            few and small.
        room
            Metres to walls and to the map's edge at corners and ends of the walk, for what needs them to turn; straight
            on it leads through narrower places, too.
        often
            Whether many walks begin and end at these very points: the router of a city keeps what it finds around them.
            Of walks that cost the same it may be another one.

        Returns
        -------
        ndarray or None
            Corner points from start to goal, shape ``(k, 2)``, ``k >= 1``; None if there is no way.
        """
        a, b = np.asarray(start, np.float64)[:2], np.asarray(goal, np.float64)[:2]
        with self._lock:
            self._count_search()
            with self._close_squares(closed):
                if blocked is None and room == 0.0:
                    return self._path(a, b, self._cost, self._shut if closed else None)
                shut = self._shut if blocked is None else blocked | self._shut
                not_searched = shut | self._narrower(room) if room else shut
                return self._path(a, b, np.where(not_searched, np.int32(0), self._cost), shut)

    def _narrower(self, room: float) -> NDArray[np.bool_]:
        """Return the cells with less room to walls and to the map's edge than so many metres."""
        if room not in self._narrow:
            narrow, edge = self._clearance < room, math.ceil(room / self.walkable.cell)
            narrow[:edge] = narrow[-edge:] = narrow[:, :edge] = narrow[:, -edge:] = True
            self._narrow[room] = narrow
        return self._narrow[room]

    def _path(
        self, a: NDArray[np.float64], b: NDArray[np.float64], cost: NDArray[np.int32], shut: NDArray[np.bool_] | None
    ) -> NDArray[np.float64] | None:
        """Find a walk where `cost` is above 0; `shut` are the cells in which it is 0 for this walk only."""
        free = self._free if cost is self._cost else cost > 0
        first, last = self._nearest_cell(a, free, SNAP), self._nearest_cell(b, free, SNAP)
        costs = None if first < 0 or last < 0 else self._costs_from(first, last, cost, closing=shut is not None)
        if costs is None:
            return None
        cells = backtrack(cost, costs, first, last)
        return self._pull_string(a, b, first, last, (cells, costs[0][cells].astype(np.int64)), shut)

    def _pull_string(
        self,
        a: NDArray[np.float64],
        b: NDArray[np.float64],
        first: int,
        last: int,
        walk: tuple[NDArray[np.int64], NDArray[np.int64]],
        shut: NDArray[np.bool_] | None,
    ) -> NDArray[np.float64]:
        """Pull a walk straight, given as cells and the costs up to each; let it begin and end where it was asked."""
        cells, g = walk
        n = self.walkable.n
        points = np.column_stack([cells % n, cells // n]) + 0.5
        checks = shut is not None
        kept = string_pull(self._cost, self._clearance, self._nothing if shut is None else shut, checks, points, g)
        route = points[kept] * self.walkable.cell - self.walkable.half
        # The exact ends, where they lie in the cells the search began and ended in.
        if self._flat(a) == first:
            if len(route) > 1:
                route[0] = a
            else:
                route = np.vstack([a, route])
        if self._flat(b) == last:
            if len(route) > 1:
                route[-1] = b
            else:
                route = b[None]
        return route

    def _costs_from(self, first: int, last: int, cost: NDArray[np.int32], *, closing: bool) -> Costs | None:
        """Return the costs from one cell to all cells of the cheapest walks to another; None if there is no walk."""
        learned = self._learned.get(first)
        if learned is not None and not closing:
            final = np.broadcast_to(np.int32(0), learned.shape)
            return None if learned[last] < 0 else (learned, final, 0)
        # Costs to the goal itself are the best landmark there is; where cells are closed, they are still a bound.
        known = self._learned.get(last)
        if not self._run(cost, first, last, self._landmarks if known is None else known[:, None]):
            return None
        return self._work.cells["g"], self._work.cells["stamp"], self._generation + 1

    @contextmanager
    def _close_squares(self, squares: Sequence[tuple[float, float, float]]) -> Iterator[None]:
        """Close squares for a while; writing all cells anew would take as long as a search."""
        kept = []
        for x, y, reach in squares:
            part = self._square(x, y, reach)
            kept.append((part, self._cost[part].copy()))
            self._cost[part], self._free[part], self._shut[part] = 0, False, True
        try:
            yield
        finally:
            # Backwards, for squares may overlap.
            for part, cost in reversed(kept):
                self._cost[part], self._free[part], self._shut[part] = cost, cost > 0, False

    def _square(self, x: float, y: float, reach: float) -> tuple[slice, slice]:
        """Return rows and columns of the cells of a square, given by its middle and half its side, metres."""
        column, row = (int(k) for k in self.walkable.cell_of((x, y)))
        cells = math.ceil(reach / self.walkable.cell)
        return slice(max(0, row - cells), row + cells + 1), slice(max(0, column - cells), column + cells + 1)

    def length(self, start: ArrayLike, goal: ArrayLike) -> float:
        """Metres of the walk; infinite if there is none."""
        route = self.path(start, goal)
        return math.inf if route is None else float(np.linalg.norm(np.diff(route, axis=0), axis=1).sum())

    def seconds(self, start: ArrayLike, goal: ArrayLike, speed: float = 1.0) -> float:
        """Seconds the walk takes at `speed` metres a second; infinite if there is none."""
        return self.length(start, goal) / speed

    def distance_field(self, goal: ArrayLike, *, blocked: NDArray[np.bool_] | None = None) -> NDArray[np.float32]:
        """Cost of the walk from every cell to `goal`, in metres of sidewalk; float32, shape ``(n, n)``; inf: no way."""
        cost = self._cost if blocked is None else np.where(blocked, np.int32(0), self._cost)
        free = self._free if blocked is None else cost > 0
        first = self._nearest_cell(np.asarray(goal, np.float64)[:2], free, SNAP)
        shape = self._cost.shape
        if first < 0:
            return np.full(shape, np.inf, np.float32)
        metre = self.walkable.cell / (100 * STRAIGHT)
        with self._lock:
            self._run(cost, first, -1, self._landmarks)
            return np.where(self._is_final, self._work.cells["g"] * metre, np.inf).astype(np.float32).reshape(shape)

    def _run(self, cost: NDArray[np.int32], first: int, last: int, landmarks: NDArray[np.int32]) -> bool:
        self._generation += 2
        goals = goal_at(last, self.walkable.n) if last >= 0 else EVERYWHERE
        return int(search(cost, self._work, first, goals, self._generation, landmarks)) >= 0

    @property
    def _is_final(self) -> NDArray[np.bool_]:
        """Which cells the last search has the cost of."""
        return np.asarray(self._work.cells["stamp"] == self._generation + 1)

    def _count_search(self) -> None:
        """Learn the costs from landmarks when that is worth it; nothing may be closed meanwhile."""
        self._searches += 1
        if self._searches == _WORTH_LANDMARKS:
            self._landmarks = self._placed_landmarks()

    def _placed_landmarks(self) -> NDArray[np.int32]:
        """Return what it costs from each cell to cells at the edges of the map, each as far from the others as can be.

        Shape ``(cells, landmarks)``; 0 where there is no way.
        """
        costs = np.zeros((self._cost.size, _LANDMARKS), np.int32)
        nearest = np.where(self._free.ravel(), np.iinfo(np.int32).max, 0)
        source = int(np.flatnonzero(nearest)[0])
        for k in range(_LANDMARKS):
            self._run(self._cost, source, -1, self._landmarks)
            final = self._is_final
            costs[final, k] = self._work.cells["g"][final]
            # Of the first search only the farthest cell is wanted, for it lies at an edge.
            nearest = np.where(final, np.minimum(nearest, costs[:, k]) if k else costs[:, k], nearest)
            source = int(nearest.argmax())
        return costs

    def _flat(self, xy: NDArray[Any]) -> int:
        half, cell, last = self.walkable.half, self.walkable.cell, self.walkable.n - 1
        ix, iy = (min(max(math.floor((float(v) + half) / cell), 0), last) for v in xy)
        return iy * self.walkable.n + ix

    def _centre(self, index: int) -> NDArray[np.float64]:
        return self.walkable.centre_of([index % self.walkable.n, index // self.walkable.n])

    def _nearest_cell(self, xy: NDArray[Any], free: NDArray[np.bool_], within: float) -> int:
        # In plain numbers: two of these are a good part of a short search.
        half, cell, n = self.walkable.half, self.walkable.cell, self.walkable.n
        x, y = float(xy[0]), float(xy[1])
        index = int(nearest_free(free, (x + half) / cell, (y + half) / cell, int(within / cell)))
        if index < 0:
            return -1
        away = math.hypot((index % n + 0.5) * cell - half - x, (index // n + 0.5) * cell - half - y)
        return index if away <= within else -1
