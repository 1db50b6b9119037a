"""Walks through a whole city: from gate to gate of its tiles, then cell by cell within each.

Where two tiles meet there are gates, and each tile knows what a walk between its gates costs. A long walk is looked for
on the gates first; only the cells of the tiles it leads through are looked at. A walk that stays within some hundred
metres is looked for on all cells around its ends, as in a world of one tile.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.io.npz import read_npz
from vico.world.grid_search import CELL, DIAGONAL, RING, STRAIGHT, SearchMemory, backtrack, search
from vico.world.routing import SNAP, WEIGHTS, Router
from vico.world.walkable import ROADWAY, WalkableMap

Ints = NDArray[np.int64]

# Cells: a gate for so many side by side; walks between ends so near are looked for at once, so far around them.
_GATE, _NEAR, _AROUND = 64, 800, 300
# How often a walk is looked for anew where something closed is in the way of the last.
_TRIES = 40


@dataclass(frozen=True)
class Gates:
    """Gates of a city's tiles.

    Attributes
    ----------
    cells
        The cell on one side of a border of each, number in the city's map, int64, shape ``(n,)``.
    start, end, cost
        What it costs to walk from gate to gate: within a tile, or over a border, int64, shape ``(m,)``; each pair once.
    """

    cells: Ints
    start: Ints
    end: Ints
    cost: Ints

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return them as named arrays, for a file."""
        return {name: getattr(self, name) for name in self.__dataclass_fields__}

    @classmethod
    def read(cls, path: Path) -> Gates:
        """Read what was written of `arrays`."""
        arrays = read_npz(path.read_bytes())
        return cls(*(np.ascontiguousarray(arrays[name], np.int64) for name in cls.__dataclass_fields__))


def border_gates(mine: NDArray[np.int32], theirs: NDArray[np.int32]) -> list[int]:
    """Return where gates are along a border, given the costs of the cells on both sides of it.

    Returns
    -------
    list of int
        Numbers of cells along it: the middle of each stretch that can be walked over without stepping on a roadway, and
        of stretches that are roadway all along.
    """
    step = np.where((mine > 0) & (theirs > 0), np.maximum(mine, theirs), 0)
    found: list[int] = []
    for start, end in _runs(step > 0):
        walkways = [(start + a, start + b) for a, b in _runs(step[start:end] < WEIGHTS[ROADWAY])]
        for a, b in walkways or [(start, end)]:
            pieces = max(1, math.ceil((b - a) / _GATE))
            found += [a + (b - a) * (2 * k + 1) // (2 * pieces) for k in range(pieces)]
    return found


def _runs(on: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return where stretches of True begin and end."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], on.astype(np.int8), [0]])))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


class Window:
    """Searches the cells of a rectangle of a map.

    Parameters
    ----------
    cost
        Of its cells, int32, contiguous.
    row, column
        Of its south-western cell in the map.
    width
        Of the map, cells.
    """

    def __init__(self, cost: NDArray[np.int32], row: int, column: int, width: int) -> None:
        self._cost, self._row, self._column, self._width = cost, row, column, width
        self._memory = SearchMemory(np.zeros(cost.size, CELL), np.empty(RING, np.int32))
        self._landmarks = np.zeros((cost.size, 0), np.int32)
        self._generation = 0

    def own(self, cells: Ints) -> Ints:
        """Return the numbers in the window of cells of the map."""
        rows, columns = cells // self._width - self._row, cells % self._width - self._column
        return np.asarray(rows * self._cost.shape[1] + columns, np.int64)

    def costs(self, start: int, goals: Ints) -> Ints:
        """Return what walks from a cell of the map to others cost; -1 where there is none."""
        self._search(start, -1)
        own = self.own(goals)
        final = self._memory.cells["stamp"][own] == self._generation + 1
        return np.where(final, self._memory.cells["g"][own], -1)

    def walk(self, start: int, goal: int) -> tuple[Ints, Ints] | None:
        """Return the cells of the cheapest walk between two cells of the map, and its cost up to each."""
        if not self._search(start, goal):
            return None
        first, last = self.own(np.array([start, goal])).tolist()
        known = self._memory.cells["g"], self._memory.cells["stamp"], self._generation + 1
        cells = backtrack(self._cost, known, first, last)
        side = self._cost.shape[1]
        numbers = (cells // side + self._row) * self._width + cells % side + self._column
        return numbers, self._memory.cells["g"][cells].astype(np.int64)

    def _search(self, start: int, goal: int) -> bool:
        self._generation += 2
        first, last = self.own(np.array([start, max(goal, 0)])).tolist()
        last = last if goal >= 0 else -1
        return bool(search(self._cost, self._memory, first, last, self._generation, self._landmarks))


def tile_gates(cost: NDArray[np.int32], square: tuple[slice, slice]) -> Gates:
    """Find a tile's gates, what walks between them cost, and the steps over its eastern and northern border.

    Parameters
    ----------
    cost
        Of all cells of the city.
    square
        Rows and columns of the tile.
    """
    height, width = cost.shape
    (bottom, top), (left, right) = ((part.start, part.stop) for part in square)
    sides = [
        ((slice(bottom, top), right - 1), (0, 1)),
        ((top - 1, slice(left, right)), (1, 0)),
        ((slice(bottom, top), left), (0, -1)),
        ((bottom, slice(left, right)), (-1, 0)),
    ]
    own: list[int] = []
    steps: list[tuple[int, int, int]] = []
    for (rows, columns), (up, aside) in sides:
        there = tuple(_shifted(part, by) for part, by in ((rows, up), (columns, aside)))
        if not all(_within(part, size) for part, size in zip(there, (height, width), strict=True)):
            continue
        mine, theirs = cost[rows, columns], cost[there]
        for k in border_gates(mine, theirs):
            row = rows.start + k if isinstance(rows, slice) else rows
            column = columns.start + k if isinstance(columns, slice) else columns
            own.append(row * width + column)
            if up + aside > 0:
                other = (row + up) * width + column + aside
                steps.append((own[-1], other, STRAIGHT * (int(mine[k]) + int(theirs[k])) // 2))
    cells = np.unique(np.array(own, np.int64))
    window = Window(np.ascontiguousarray(cost[square]), bottom, left, width)
    for k, cell in enumerate(cells.tolist()):
        rest = cells[k + 1 :]
        costs = window.costs(cell, rest)
        steps += [(cell, other, far) for other, far in zip(rest.tolist(), costs.tolist(), strict=True) if far >= 0]
    start, end, far = np.array(steps, np.int64).reshape(-1, 3).T
    return Gates(cells, start, end, far)


def _shifted(part: slice | int, by: int) -> slice | int:
    return slice(part.start + by, part.stop + by) if isinstance(part, slice) else part + by


def _within(part: slice | int, size: int) -> bool:
    return part.start >= 0 and part.stop <= size if isinstance(part, slice) else 0 <= part < size


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
        self._gates, self._side = gates, side
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
            ask = _Ask(self._cost, self._clearance, blocked, room, self._side)
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
        known: dict[tuple[int, int], int] = {}
        for _ in range(_TRIES):
            stations = self._stations(ask, first, last, known)
            if stations is None:
                return None
            cells, costs = [np.array([first])], [np.array([0])]
            dearer = False
            for a, b in pairwise(stations):
                if ask.tile(a) == ask.tile(b):
                    found = ask.window(ask.square(a)).walk(a, b)
                    told = known.get((a, b), self._graph.get(a, {}).get(b, -1))
                    if found is None or (told >= 0 and found[1][-1] > told):
                        known[a, b] = known[b, a] = -1 if found is None else int(found[1][-1])
                        dearer = True
                        break
                    cells.append(found[0][1:])
                    costs.append(found[1][1:] + costs[-1][-1])
                else:
                    cells.append(np.array([b]))
                    costs.append(costs[-1][-1:] + self._graph[a][b])
            if not dearer:
                return np.concatenate(cells), np.concatenate(costs)
        return None

    @cached_property
    def _graph(self) -> dict[int, dict[int, int]]:
        """What it costs from gate to gate."""
        graph: dict[int, dict[int, int]] = {}
        gates = self._gates
        for a, b, cost in zip(gates.start.tolist(), gates.end.tolist(), gates.cost.tolist(), strict=True):
            graph.setdefault(a, {})[b] = cost
            graph.setdefault(b, {})[a] = cost
        return graph

    @cached_property
    def _by_tile(self) -> dict[tuple[int, int], Ints]:
        found: dict[tuple[int, int], list[int]] = {}
        n, side = self.walkable.n, self._side
        for cell in self._gates.cells.tolist():
            found.setdefault((cell // n // side, cell % n // side), []).append(cell)
        return {tile: np.array(cells, np.int64) for tile, cells in found.items()}

    def _stations(self, ask: _Ask, first: int, last: int, known: Mapping[tuple[int, int], int]) -> list[int] | None:
        """Return the start, gates and the goal of the cheapest walk as far as it is known."""
        nothing = np.zeros(0, np.int64)
        ends: list[dict[int, int]] = []
        for cell in (first, last):
            gates = self._by_tile.get(ask.tile(cell), nothing)
            costs = ask.window(ask.square(cell)).costs(cell, gates)
            ends.append({g: c for g, c in zip(gates.tolist(), costs.tolist(), strict=True) if c >= 0})
        leave, arrive = ends
        best, came = {first: 0}, {}
        done: set[int] = set()
        queue = [(self._least(first, last), first)]
        while queue:
            _, cell = heapq.heappop(queue)
            if cell == last:
                break
            if cell in done:
                continue
            done.add(cell)
            onward = dict(leave if cell == first else self._graph.get(cell, {}))
            if cell in arrive:
                onward[last] = arrive[cell]
            for other, cost in onward.items():
                now = known.get((cell, other), cost)
                if now < 0 or other in done:
                    continue
                value = best[cell] + now
                if value < best.get(other, value + 1):
                    best[other], came[other] = value, cell
                    heapq.heappush(queue, (value + self._least(other, last), other))
        if last not in best:
            return None
        stations = [last]
        while stations[-1] != first:
            stations.append(came[stations[-1]])
        return stations[::-1]

    def _least(self, a: int, b: int) -> int:
        """Return a cost that no walk between two cells is below."""
        n = self.walkable.n
        dx, dy = abs(a % n - b % n), abs(a // n - b // n)
        return 100 * (STRAIGHT * max(dx, dy) + (DIAGONAL - STRAIGHT) * min(dx, dy))

    def distance_field(self, goal: ArrayLike, *, blocked: NDArray[np.bool_] | None = None) -> NDArray[np.float32]:
        """Cost of the walk to `goal` from every cell within some hundred metres of it; infinite beyond."""
        n = self.walkable.n
        field = np.full((n, n), np.inf, np.float32)
        first = self._nearest_cell(np.asarray(goal, np.float64)[:2], self._free, SNAP)
        if first >= 0:
            row, column = divmod(first, n)
            part = tuple(slice(max(0, k - _NEAR), min(n, k + _NEAR + 1)) for k in (row, column))
            with self._lock:
                ask = _Ask(self._cost, self._clearance, blocked, 0.0, self._side)
                cells = (np.arange(n)[part[0], None] * n + np.arange(n)[None, part[1]]).ravel()
                costs = ask.window((part[0], part[1])).costs(first, cells)
            metre = self.walkable.cell / (100 * STRAIGHT)
            field[part] = np.where(costs < 0, np.inf, costs * metre).reshape(field[part].shape)
        return field


class _Ask:
    """One search for a walk: what may be walked on, window by window."""

    def __init__(
        self,
        cost: NDArray[np.int32],
        clearance: NDArray[np.float32],
        blocked: NDArray[np.bool_] | None,
        room: float,
        side: int,
    ) -> None:
        self._cost, self._clearance, self._blocked, self._room, self._side = cost, clearance, blocked, room, side
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
            if self._room:
                cost = np.where(self._clearance[part] < self._room, np.int32(0), cost)
            self._windows[key] = Window(cost, rows.start, columns.start, self._cost.shape[1])
        return self._windows[key]
