"""How long walks through a city are: from gate to gate, on cells of a metre at their ends."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.io.recent import Recent
from vico.world.city_gates import Ints, Reached, Window
from vico.world.city_routing import CityRouter
from vico.world.grid_search import nearest_free
from vico.world.model import Point2
from vico.world.routing import SNAP, walking_costs
from vico.world.walk_lengths import Walk, walk_of
from vico.world.walkable import WalkableMap

# Cells of a metre: walks between ends so near are looked for at once, so far around them; gates lie so far off at most.
_NEAR, _AROUND, _OFF = 400, 150, 3
# So many ends are remembered with their walks to the gates around them, some 600 bytes each, and so many tiles' cells.
_ENDS, _TILES = 32_768, 24


class CityWalkLengths:
    """Measures walks in a city: long ones by those between gates, which are known, and those at either end.

    Where cells of a metre leave no way through, the walk is found on the city's own.

    Parameters
    ----------
    router
        Of the city.
    side
        Cells of the city's map along a tile's side.
    """

    def __init__(self, router: CityRouter, side: int) -> None:
        self._router, self._side = router, side // 2
        self._fine = router.walkable
        self._n, self._cell = self._fine.n // 2, 2 * self._fine.cell
        self._cost, self._room = self._coarse()
        self._free = self._cost > 0
        self._ends: Recent[int, tuple[Ints, Reached]] = Recent(_ENDS)
        self._windows: Recent[tuple[int, int], Window] = Recent(_TILES)

    def _coarse(self) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """Return what walking costs on cells of a metre, and their room to walls, tile by tile."""
        cost, room = np.zeros((self._n, self._n), np.int32), np.zeros((self._n, self._n), np.float32)
        for row in range(0, self._n, self._side):
            for column in range(0, self._n, self._side):
                own = slice(row, row + self._side), slice(column, column + self._side)
                fine = tuple(slice(2 * part.start, 2 * part.stop) for part in own)
                four = np.ascontiguousarray(self._fine.cls[fine])
                if not four.any():
                    continue
                coarse = WalkableMap(four, 1.0, self._fine.cell).coarser().cls
                joined = np.asarray(self._fours(self._fine.connected[fine]).all(axis=(1, 3)))
                room[own] = self._fours(self._fine.clearance[fine]).min(axis=(1, 3))
                cost[own] = walking_costs(coarse, room[own], joined)
        return cost, room

    @staticmethod
    def _fours(cells: NDArray[Any]) -> NDArray[Any]:
        """Return cells as fours: a row, two in it, a column, two in it."""
        rows, columns = cells.shape
        return np.asarray(cells).reshape(rows // 2, 2, columns // 2, 2)

    def learn(self, point: Point2) -> None:
        """Do nothing: what is known of the ends of long walks is kept anyhow."""

    def between(self, start: Point2, goal: Point2) -> Walk:
        """Return the walk between two points, ENU metres."""
        first, last = self._nearest(start), self._nearest(goal)
        walk = None
        if first >= 0 and last >= 0:
            walk = self._near(first, last) if self._is_near(first, last) else self._far(first, last)
        return walk_of(self._router, start, goal) if walk is None else walk

    def _nearest(self, point: Point2) -> int:
        x, y = ((k + self._fine.half) / self._cell for k in point)
        found = int(nearest_free(self._free, x, y, int(SNAP / self._cell)))
        row, column = divmod(found, self._n)
        return found if math.hypot(column + 0.5 - x, row + 0.5 - y) * self._cell <= SNAP else -1

    def _is_near(self, first: int, last: int) -> bool:
        (row, column), (other_row, other_column) = divmod(first, self._n), divmod(last, self._n)
        return max(abs(row - other_row), abs(column - other_column)) <= _NEAR

    def _near(self, first: int, last: int) -> Walk | None:
        ends = zip(divmod(first, self._n), divmod(last, self._n), strict=True)
        rows, columns = (slice(max(0, min(k) - _AROUND), max(k) + _AROUND + 1) for k in ends)
        window = Window(np.ascontiguousarray(self._cost[rows, columns]), rows.start, columns.start, self._n)
        found = window.length(first, last, np.ascontiguousarray(self._room[rows, columns]), self._cell)
        return None if found is None else Walk(*found)

    def _far(self, first: int, last: int) -> Walk | None:
        graph = self._router.graph
        (leave, leaving), (arrive, arriving) = self._to_gates(first), self._to_gates(last)
        row, column = divmod(last, self._n)
        gates = graph.cheapest((leave, leaving.cost), (arrive, arriving.cost), 2 * row * self._fine.n + 2 * column)
        if not gates:
            return None
        ends = [(leaving, leave.tolist().index(gates[0])), (arriving, arrive.tolist().index(gates[-1]))]
        parts = [(float(one.metres[k]), int(one.corners[k])) for one, k in ends]
        parts += [graph.length(a, b) for a, b in pairwise(gates)]
        return Walk(sum(metres for metres, _ in parts), sum(corners for _, corners in parts))

    def _to_gates(self, cell: int) -> tuple[Ints, Reached]:
        """Return the gates of the tile that a cell lies in, and the walks there, at what they cost on finer cells."""
        known = self._ends.get(cell)
        if known is None:
            row, column = (k // self._side for k in divmod(cell, self._n))
            numbers, cells = self._gates((row, column))
            square = tuple(slice(k * self._side, (k + 1) * self._side) for k in (row, column))
            window = self._windows.get((row, column))
            if window is None:
                cost = np.ascontiguousarray(self._cost[square])
                window = Window(cost, square[0].start, square[1].start, self._n)
                self._windows.keep((row, column), window)
            reached = window.reached(cell, cells, np.ascontiguousarray(self._room[square]), self._cell)
            known = numbers, reached._replace(cost=np.where(reached.cost < 0, -1, 2 * reached.cost))
            self._ends.keep(cell, known)
        return known

    def _gates(self, tile: tuple[int, int]) -> tuple[Ints, Ints]:
        """Return a tile's gates that lie beside free cells of a metre, and these."""
        found: list[tuple[int, int]] = []
        for number in self._router.graph.of_tile(tile).tolist():
            row, column = (k // 2 for k in divmod(int(self._router.graph.cells[number]), self._fine.n))
            rows, columns = (
                slice(max(k - _OFF, low * self._side), min(k + _OFF + 1, (low + 1) * self._side))
                for k, low in zip((row, column), tile, strict=True)
            )
            free = np.argwhere(self._free[rows, columns]) + np.array([rows.start, columns.start])
            if len(free):
                near = free[np.argmin(((free - (row, column)) ** 2).sum(axis=1))]
                found.append((number, int(near[0]) * self._n + int(near[1])))
        both = np.array(found, np.int64).reshape(-1, 2)
        return both[:, 0].copy(), both[:, 1].copy()
