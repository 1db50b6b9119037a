"""Walks through a whole city: from gate to gate of its tiles, then cell by cell within each.

A long walk is looked for on the gates first (`vico.world.city_gates`); only the cells of the tiles it leads through are
looked at. A walk that stays within some hundred metres is looked for on all cells around its ends, as in a world of one
tile.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from threading import Lock

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.io.recent import Recent
from vico.world.city_gates import Gates, Ints, Window
from vico.world.gate_graph import GateGraph
from vico.world.grid_search import STRAIGHT
from vico.world.routing import SNAP, Router
from vico.world.walkable import WalkableMap

# Cells: walks between ends so near are looked for at once, so far around them.
_NEAR, _AROUND = 800, 300
# How often a walk is looked for anew where something closed is in the way of the last.
_TRIES = 40
# Kept: costs from so many ends to the gates around them, and so many walks between gates, 8 bytes a cell.
_ENDS, _LEGS = 4096, 1024


class CityRouter(Router):
    """Finds walks in a city; threads that share it wait for each other.

    Parameters
    ----------
    walkable
        The city's map.
    cost
        Of its cells, int32, shape ``(n, n)``; only what is looked at is read.
    gates
        Of its tiles.
    side
        Cells along a tile's side.
    """

    def __init__(self, walkable: WalkableMap, cost: NDArray[np.int32], gates: Gates, side: int) -> None:
        self.walkable = walkable
        self._cost, self._clearance, self._free = cost, walkable.clearance, walkable.connected
        self.graph = GateGraph(gates, walkable.n, side)
        self._side = side
        # By the room that is needed beside one.
        self._ends: Recent[tuple[float, int], Ints] = Recent(_ENDS)
        self._legs: Recent[tuple[float, int, int], tuple[NDArray[np.int32], NDArray[np.int32]]] = Recent(_LEGS)
        self._shut = np.zeros(cost.shape, np.bool_)
        self._nothing = np.zeros((0, 0), np.bool_)
        self._lock = Lock()

    def learn_landmarks(self) -> None:
        """Do nothing: gates are landmarks enough."""

    def learn_costs(self, point: ArrayLike) -> None:
        """Do nothing: costs to everywhere would be those of a whole city."""

    def path(
        self,
        start: ArrayLike,
        goal: ArrayLike,
        *,
        blocked: NDArray[np.bool_] | None = None,
        closed: Sequence[tuple[float, float, float]] = (),
        room: float = 0.0,
    ) -> NDArray[np.float64] | None:
        """Find a walk; as `Router.path`."""
        a, b = np.asarray(start, np.float64)[:2], np.asarray(goal, np.float64)[:2]
        with self._lock, self._closed(closed):
            first, last = (self._nearest_cell(point, self._free, SNAP) for point in (a, b))
            if first < 0 or last < 0:
                return None
            ask = _Ask(self._cost, self._clearance, blocked, room, self._side, closing=bool(closed))
            walk = self._near(ask, first, last) or self._far(ask, first, last)
            if walk is None:
                return None
            shut = self._shut if blocked is None else blocked | self._shut
            return self._pulled(a, b, first, last, walk, shut if closed or blocked is not None else None)

    def _near(self, ask: _Ask, first: int, last: int) -> tuple[Ints, Ints] | None:
        """Look for a walk on all cells around its ends, if these are near each other."""
        n = self.walkable.n
        rows, columns = zip(divmod(first, n), divmod(last, n), strict=True)
        if max(max(rows) - min(rows), max(columns) - min(columns)) > _NEAR:
            return None
        part = tuple(slice(max(0, min(k) - _AROUND), max(k) + _AROUND + 1) for k in (rows, columns))
        return ask.window((part[0], part[1])).walk(first, last)

    def _far(self, ask: _Ask, first: int, last: int) -> tuple[Ints, Ints] | None:
        """Look for a walk from gate to gate; where what is closed makes one dearer than it was, anew."""
        ends = self._to_gates(ask, first), self._to_gates(ask, last)
        changed: dict[tuple[int, int], int] = {}
        for _ in range(_TRIES):
            gates = self.graph.cheapest(*ends, last, changed)
            if not gates:
                return None
            cells = [first, *self.graph.cells[gates].tolist(), last]
            parts, costs, so_far, dearer = [np.array([first])], [np.array([0])], 0, False
            for k, (a, b) in enumerate(pairwise(cells)):
                told = self.graph.cost(*gates[k - 1 : k + 1]) if 0 < k < len(gates) else -1
                if ask.tile(a) == ask.tile(b):
                    found = self._leg(ask, a, b, kept=told >= 0)
                    if told >= 0 and (found is None or found[1][-1] > told):
                        cost = -1 if found is None else int(found[1][-1])
                        changed[gates[k - 1], gates[k]] = changed[gates[k], gates[k - 1]] = cost
                        dearer = True
                        break
                    if found is None:
                        return None
                    # Of a walk that begins in a gate nothing is left here.
                    parts.append(found[0][1:])
                    costs.append(found[1][1:] + so_far)
                    so_far += int(found[1][-1])
                else:
                    so_far += told
                    parts.append(np.array([b]))
                    costs.append(np.array([so_far]))
            if not dearer:
                return np.concatenate(parts).astype(np.int64), np.concatenate(costs)
        return None

    def _to_gates(self, ask: _Ask, cell: int) -> tuple[Ints, Ints]:
        """Return the gates of the tile that a cell lies in, and what walks from the cell to them cost."""
        gates = self.graph.of_tile(ask.tile(cell))
        known = self._ends.get((ask.room, cell)) if ask.usual else None
        if known is None:
            known = ask.window(ask.square(cell)).costs(cell, self.graph.cells[gates])
            if ask.usual:
                self._ends.keep((ask.room, cell), known)
        return gates, known

    def _leg(self, ask: _Ask, a: int, b: int, *, kept: bool) -> tuple[Ints, Ints] | None:
        """Return the walk between two cells of a tile; that between gates is kept for others."""
        if not (kept and ask.usual):
            return ask.window(ask.square(a)).walk(a, b)
        known = self._legs.get((ask.room, a, b))
        if known is None:
            found = ask.window(ask.square(a)).walk(a, b)
            if found is None:
                return None
            known = found[0].astype(np.int32), found[1].astype(np.int32)
            self._legs.keep((ask.room, a, b), known)
        return known[0].astype(np.int64), known[1].astype(np.int64)

    def distance_field(self, goal: ArrayLike, *, blocked: NDArray[np.bool_] | None = None) -> NDArray[np.float32]:
        """Cost of the walk to `goal` from every cell within some hundred metres of it; infinite beyond."""
        n = self.walkable.n
        field = np.full((n, n), np.inf, np.float32)
        first = self._nearest_cell(np.asarray(goal, np.float64)[:2], self._free, SNAP)
        if first >= 0:
            row, column = divmod(first, n)
            part = tuple(slice(max(0, k - _NEAR), min(n, k + _NEAR + 1)) for k in (row, column))
            with self._lock:
                ask = _Ask(self._cost, self._clearance, blocked, 0.0, self._side, closing=False)
                cells = (np.arange(n)[part[0], None] * n + np.arange(n)[None, part[1]]).ravel()
                costs = ask.window((part[0], part[1])).costs(first, cells)
            metre = self.walkable.cell / (100 * STRAIGHT)
            field[part] = np.where(costs < 0, np.inf, costs * metre).reshape(field[part].shape)
        return field


class _Ask:
    """One search for a walk: what may be walked on, window by window.

    Attributes
    ----------
    room
        What is needed beside one, metres.
    usual
        Whether all may be walked on that has the room, so that what is found is found again.
    """

    def __init__(
        self,
        cost: NDArray[np.int32],
        clearance: NDArray[np.float32],
        blocked: NDArray[np.bool_] | None,
        room: float,
        side: int,
        *,
        closing: bool,
    ) -> None:
        self._cost, self._clearance, self._blocked, self.room, self._side = cost, clearance, blocked, room, side
        self.usual = blocked is None and not closing
        self._windows: dict[tuple[int, int, int, int], Window] = {}

    def tile(self, cell: int) -> tuple[int, int]:
        """Return the row and column of the tile that a cell lies in."""
        row, column = divmod(cell, self._cost.shape[1])
        return row // self._side, column // self._side

    def square(self, cell: int) -> tuple[slice, slice]:
        """Return the rows and columns of the tile that a cell lies in."""
        row, column = (k * self._side for k in self.tile(cell))
        return slice(row, row + self._side), slice(column, column + self._side)

    def window(self, part: tuple[slice, slice]) -> Window:
        """Return what searches a part of the map."""
        rows, columns = part
        key = rows.start, rows.stop, columns.start, columns.stop
        if key not in self._windows:
            cost = np.ascontiguousarray(self._cost[part])
            if self._blocked is not None:
                cost = np.where(self._blocked[part], np.int32(0), cost)
            if self.room:
                cost = np.where(self._clearance[part] < self.room, np.int32(0), cost)
            self._windows[key] = Window(cost, rows.start, columns.start, self._cost.shape[1])
        return self._windows[key]
