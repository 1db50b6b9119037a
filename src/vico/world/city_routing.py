"""Walks through a whole city, and how long they are: from gate to gate of its tiles, then cell by cell within each.

A long walk is looked for on the gates first (`vico.world.city_gates`); only the cells of the tiles it leads through are
looked at. A walk that stays within some hundred metres is looked for on all cells around its ends, as in a world of one
tile. Lengths alone are measured on the gates, and on cells of a metre at both ends.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise, product
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.errors import SchemaError
from vico.io.arrays import drop_pages
from vico.io.memory import LruCache
from vico.world.city import STEPS
from vico.world.city_gates import GateGraph, Gates, Ints, ReachedCells, Scratch, WindowSearch
from vico.world.grid_search import STRAIGHT, cells_along, nearest_free
from vico.world.model import Point2
from vico.world.routing import SNAP, Router, walking_costs
from vico.world.walk_lengths import Walk, walk_of
from vico.world.walkable import WalkableMap

_NEAR = 800  # cells; walks between ends so near are looked for at once
_AROUND = 300  # cells around both ends in which they are looked for
# How often a walk is looked for anew where something closed is in the way of the last.
_TRIES = 40
_ENDS = 8192  # ends whose costs to the gates around them are kept, 8 bytes a gate
_LEGS = 8192  # walks to or from a gate that are kept, 8 bytes a cell
# Tiles that are read before the memory that the map is read into is given back: some 4 MB each at 400 m a tile. What is
# given back has to be mapped again: five minutes of 27 km2 took 16 million page faults with 24, 2.4 million with this.
_TILES = 96
_FAR = np.int64(1) << 60
_NO_WALK = np.zeros(0, np.int32), np.zeros(0, np.int32)


class CityRouter(Router):
    """Finds walks in a city; threads that share it wait for each other.

    Parameters
    ----------
    walkable
        The city's map.
    cost
        Of its cells, int16, shape ``(n, n)``; only what is looked at is read.
    gates
        Of its tiles.
    side
        Cells along a tile's side.
    """

    def __init__(self, walkable: WalkableMap, cost: NDArray[Any], gates: Gates, side: int) -> None:
        self.walkable = walkable
        self._cost, self._clearance, self._free = cost, walkable.clearance, walkable.connected
        self.graph = GateGraph(gates, walkable.n, side)
        self._side = side
        # By the room that is needed beside one.
        self._ends: LruCache[tuple[float, int], Ints] = LruCache(_ENDS)
        self._legs: LruCache[tuple[float, int, int], tuple[NDArray[np.int32], NDArray[np.int32]]] = LruCache(_LEGS)
        self._shut = np.zeros(cost.shape, np.bool_)
        self._nothing = np.zeros((0, 0), np.bool_)
        self._scratch = Scratch()
        self._read: set[tuple[int, int]] = set()
        self._is_closing = False  # whether some cells are closed for the walk that is being looked for
        self._lock = Lock()

    def learn_landmarks(self) -> None:
        """Do nothing: gates are landmarks enough."""

    def learn_costs(self, point: ArrayLike) -> None:
        """Do nothing: costs to everywhere would be those of a whole city."""

    def drop_pages(self) -> None:
        """Give back the memory that the map and its walks are read into, once no walk is being looked for."""
        with self._lock:
            for array in (self._cost, self._clearance, self._free, self.graph.steps):
                drop_pages(array)
            self._read.clear()

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
        """Find a walk; as `Router.path`."""
        a, b = np.asarray(start, np.float64)[:2], np.asarray(goal, np.float64)[:2]
        with self._lock, self._close_squares(closed):
            ask = self._ask(blocked, room, closed)
            first, last = (self._end_near(ask, point) for point in (a, b))
            if first < 0 or last < 0:
                return None
            walk = self._near(ask, first, last) or self._far(ask, first, last, often=often)
            if walk is None:
                return None
            shut = self._shut if blocked is None else blocked | self._shut
            return self._pull_string(a, b, first, last, walk, shut if closed or blocked is not None else None)

    @contextmanager
    def _close_squares(self, squares: Sequence[tuple[float, float, float]]) -> Iterator[None]:
        self._is_closing = len(squares) > 0
        try:
            with super()._close_squares(squares):
                yield
        finally:
            self._is_closing = False

    def _end_near(self, ask: _WalkQuery, point: NDArray[np.float64]) -> int:
        """Return the nearest cell within reach that this walk may begin or end in; -1 if there is none."""
        cell, n, reach = self.walkable.cell, self.walkable.n, math.ceil(SNAP / self.walkable.cell)
        x, y = ((float(k) + self.walkable.half) / cell for k in point)
        column, row = (min(max(int(k), 0), n - 1) - reach for k in (x, y))
        rows, columns = (slice(max(k, 0), min(k + 2 * reach + 1, n)) for k in (row, column))
        free = np.zeros((2 * reach + 1, 2 * reach + 1), np.bool_)
        free[rows.start - row : rows.stop - row, columns.start - column : columns.stop - column] = (
            ask.costs((rows, columns)) > 0
        )
        found = int(nearest_free(free, x - column, y - row, reach))
        if found < 0:
            return -1
        below, left = divmod(found, len(free))
        away = math.hypot(left + column + 0.5 - x, below + row + 0.5 - y) * cell
        return (row + below) * n + column + left if away <= SNAP else -1

    def _near(self, ask: _WalkQuery, first: int, last: int) -> tuple[Ints, Ints] | None:
        """Look for a walk on all cells around its ends, if these are near each other."""
        n = self.walkable.n
        rows, columns = zip(divmod(first, n), divmod(last, n), strict=True)
        if max(max(rows) - min(rows), max(columns) - min(columns)) > _NEAR:
            return None
        part = tuple(slice(max(0, min(k) - _AROUND), max(k) + _AROUND + 1) for k in (rows, columns))
        return ask.window((part[0], part[1])).walk(first, last)

    def _ask(
        self, blocked: NDArray[np.bool_] | None, room: float, closed: Sequence[tuple[float, float, float]]
    ) -> _WalkQuery:
        tiles = self._tiles_of(closed)
        return _WalkQuery(self._cost, self._clearance, blocked, room, self._side, tiles, self._scratch, self._open)

    def _open(self, tiles: set[tuple[int, int]]) -> None:
        """Note which tiles are read: with time all of a city's map would come to be in memory.

        Not while cells are closed: that is written into the pages, and would be lost with them.
        """
        if len(self._read | tiles) > _TILES and not self._is_closing:
            drop_pages(self._cost)
            drop_pages(self._clearance)
            self._read.clear()
        self._read |= tiles

    def _tiles_of(self, closed: Sequence[tuple[float, float, float]]) -> set[tuple[int, int]]:
        """Return the rows and columns of the tiles in which squares lie."""
        return set().union(*(_tiles_in(self._square(x, y, reach), self._side) for x, y, reach in closed))

    def _far(self, ask: _WalkQuery, first: int, last: int, *, often: bool) -> tuple[Ints, Ints] | None:
        """Look for a walk from gate to gate; where what is closed makes one dearer than it was, anew."""
        leaving, arriving = self.graph.of_tile(ask.tile(first)), self._to_gates(ask, last)
        changed: dict[tuple[int, int], int] = {}
        for attempt in range(_TRIES):
            onward = self.graph.onward(first, leaving, arriving, changed)
            # From others the way leads to one of these.
            exits = leaving[(onward.cost[leaving] >= 0) & ~np.isin(onward.then[leaving], leaving)]
            begun = None
            if attempt == 0 and not often:
                window = ask.window(ask.square(first))
                begun = window.walk_out(first, self.graph.cells[exits], onward.cost[exits])
                gate = -1 if begun is None else int(np.searchsorted(self.graph.cells, begun[0][-1]))
            else:
                # Where the first is not the cheapest others often aren't: what all of them cost is found once, as it
                # is for a cell where many walks begin.
                gate = self._cheapest_exit(ask, first, exits, onward.cost[exits])
            if gate < 0:
                return None
            walk = self._from_gate(ask, onward.gates(gate), last, changed)
            if walk is not None:
                begun = begun or self._leg(ask, first, int(self.graph.cells[gate]))
                assert begun is not None
                # Of a walk that begins at a gate nothing is left here.
                (cells, costs), (more, dearer) = begun, walk
                return np.concatenate([cells, more[1:]]), np.concatenate([costs, dearer[1:] + costs[-1]])
        return None

    def _cheapest_exit(self, ask: _WalkQuery, first: int, exits: Ints, onward: Ints) -> int:
        """Return the gate by which it is cheapest to leave the tile of a cell; -1 if there is none."""
        gates, known = self._to_gates(ask, first)
        costs = known[np.searchsorted(gates, exits)]
        costs = np.where(costs < 0, _FAR, costs + onward)
        return int(exits[costs.argmin()]) if len(costs) and costs.min() < _FAR else -1

    def _from_gate(
        self, ask: _WalkQuery, gates: list[int], last: int, changed: dict[tuple[int, int], int]
    ) -> tuple[Ints, Ints] | None:
        """Return the walk over gates to a cell; None, and `changed`, where a part of it costs more than was thought."""
        cells = [*self.graph.cells[gates].tolist(), last]
        parts, costs, so_far = [np.array(cells[:1])], [np.array([0])], 0
        for k, (a, b) in enumerate(pairwise(cells)):
            between = gates[k : k + 2]
            told = self.graph.cost(*between) if len(between) == 2 else -1
            if ask.tile(a) != ask.tile(b):
                so_far += told
                parts.append(np.array([b]))
                costs.append(np.array([so_far]))
                continue
            found = self._leg(ask, a, b)
            if told >= 0 and (found is None or found[1][-1] > told):
                cost = -1 if found is None else int(found[1][-1])
                changed[between[0], between[1]] = changed[between[1], between[0]] = cost
                return None
            assert found is not None, "only gates that the goal was reached from lead to it"
            parts.append(found[0][1:])
            costs.append(found[1][1:] + so_far)
            so_far += int(found[1][-1])
        return np.concatenate(parts).astype(np.int64), np.concatenate(costs)

    def _to_gates(self, ask: _WalkQuery, cell: int) -> tuple[Ints, Ints]:
        """Return the gates of the tile that a cell lies in, and what walks from the cell to them cost."""
        gates, usual = self.graph.of_tile(ask.tile(cell)), ask.is_usual(cell)
        known = self._ends.get((ask.room, cell)) if usual else None
        if known is None:
            known = ask.window(ask.square(cell)).costs(cell, self.graph.cells[gates])
            if usual:
                self._ends.keep((ask.room, cell), known)
        return gates, known

    def _leg(self, ask: _WalkQuery, a: int, b: int) -> tuple[Ints, Ints] | None:
        """Return the walk from a cell to another of its tile, one of them a gate, and keep it for others."""
        if not ask.is_usual(a):
            return ask.window(ask.square(a)).walk(a, b)
        kept = None if ask.room else self.graph.walk(a, b)
        if kept is not None:
            self._open({ask.tile(a)})
            cells, costs = cells_along(self._cost, a, *kept)
            if not len(cells) or cells[-1] != b:
                raise SchemaError(f"{STEPS}: the walk from cell {a} to {b} is damaged; build the city anew")
            return cells, costs
        known = self._legs.get((ask.room, a, b))
        if known is None:
            found = ask.window(ask.square(a)).walk(a, b)
            known = _NO_WALK if found is None else (found[0].astype(np.int32), found[1].astype(np.int32))
            self._legs.keep((ask.room, a, b), known)
        return (known[0].astype(np.int64), known[1].astype(np.int64)) if len(known[0]) else None

    def distance_field(self, goal: ArrayLike, *, blocked: NDArray[np.bool_] | None = None) -> NDArray[np.float32]:
        """Cost of the walk to `goal` from every cell within some hundred metres of it; infinite beyond."""
        n = self.walkable.n
        field = np.full((n, n), np.inf, np.float32)
        first = self._nearest_cell(np.asarray(goal, np.float64)[:2], self._free, SNAP)
        if first >= 0:
            row, column = divmod(first, n)
            part = tuple(slice(max(0, k - _NEAR), min(n, k + _NEAR + 1)) for k in (row, column))
            with self._lock:
                ask = self._ask(blocked, 0.0, ())
                cells = (np.arange(n)[part[0], None] * n + np.arange(n)[None, part[1]]).ravel()
                costs = ask.window((part[0], part[1])).costs(first, cells)
            metre = self.walkable.cell / (100 * STRAIGHT)
            field[part] = np.where(costs < 0, np.inf, costs * metre).reshape(field[part].shape)
        return field


def _tiles_in(part: tuple[slice, slice], side: int) -> set[tuple[int, int]]:
    """Return the rows and columns of the tiles that have cells in a part of the map."""
    rows, columns = (range(k.start // side, (k.stop - 1) // side + 1) for k in part)
    return set(product(rows, columns))


class _WalkQuery:
    """One search for a walk: what may be walked on, window by window.

    Attributes
    ----------
    room
        What is needed beside one, metres.
    """

    def __init__(
        self,
        cost: NDArray[Any],
        clearance: NDArray[np.float32],
        blocked: NDArray[np.bool_] | None,
        room: float,
        side: int,
        closed: set[tuple[int, int]],
        scratch: Scratch,
        opened: Callable[[set[tuple[int, int]]], None],
    ) -> None:
        self._cost, self._clearance, self._blocked, self.room, self._side = cost, clearance, blocked, room, side
        self._scratch, self._opened = scratch, opened
        # Whether what is found in a tile is found again: nothing is closed there.
        self._usual = dict.fromkeys(closed, False)
        self._windows: dict[tuple[int, int, int, int], WindowSearch] = {}

    def tile(self, cell: int) -> tuple[int, int]:
        """Return the row and column of the tile that a cell lies in."""
        row, column = divmod(cell, self._cost.shape[1])
        return row // self._side, column // self._side

    def is_usual(self, cell: int) -> bool:
        """Return whether all may be walked on in the tile of a cell that has the room."""
        tile = self.tile(cell)
        if tile not in self._usual:
            self._usual[tile] = self._blocked is None or not self._blocked[self.square(cell)].any()
        return self._usual[tile]

    def square(self, cell: int) -> tuple[slice, slice]:
        """Return the rows and columns of the tile that a cell lies in."""
        row, column = (k * self._side for k in self.tile(cell))
        return slice(row, row + self._side), slice(column, column + self._side)

    def costs(self, part: tuple[slice, slice]) -> NDArray[np.int32]:
        """Return the costs of the cells of a part of the map for this walk; 0 where it may not lead."""
        cost = np.ascontiguousarray(self._cost[part], np.int32)
        if self._blocked is not None:
            cost = np.where(self._blocked[part], np.int32(0), cost)
        if self.room:
            cost = np.where(self._clearance[part] < self.room, np.int32(0), cost)
        return cost

    def window(self, part: tuple[slice, slice]) -> WindowSearch:
        """Return what searches a part of the map."""
        rows, columns = part
        key = rows.start, rows.stop, columns.start, columns.stop
        if key not in self._windows:
            self._opened(_tiles_in(part, self._side))
            self._windows[key] = WindowSearch(
                self.costs(part), rows.start, columns.start, self._cost.shape[1], self._scratch
            )
        return self._windows[key]


_NEAR_METRES = 400  # cells of a metre; walks between ends so near are looked for at once
_AROUND_METRES = 150  # cells of a metre around both ends in which they are looked for
_OFF = 3  # cells of a metre that gates lie off at most
_LENGTH_ENDS = 32_768  # ends that are remembered with their walks to the gates around them, some 600 bytes each
_LENGTH_TILES = 24  # tiles whose cells are remembered


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
        self._ends: LruCache[int, tuple[Ints, ReachedCells]] = LruCache(_LENGTH_ENDS)
        self._windows: LruCache[tuple[int, int], WindowSearch] = LruCache(_LENGTH_TILES)

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
        return max(abs(row - other_row), abs(column - other_column)) <= _NEAR_METRES

    def _near(self, first: int, last: int) -> Walk | None:
        ends = zip(divmod(first, self._n), divmod(last, self._n), strict=True)
        rows, columns = (slice(max(0, min(k) - _AROUND_METRES), max(k) + _AROUND_METRES + 1) for k in ends)
        window = WindowSearch(np.ascontiguousarray(self._cost[rows, columns]), rows.start, columns.start, self._n)
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

    def _to_gates(self, cell: int) -> tuple[Ints, ReachedCells]:
        """Return the gates of the tile that a cell lies in, and the walks there, at what they cost on finer cells."""
        known = self._ends.get(cell)
        if known is None:
            row, column = (k // self._side for k in divmod(cell, self._n))
            numbers, cells = self._gates((row, column))
            square = tuple(slice(k * self._side, (k + 1) * self._side) for k in (row, column))
            window = self._windows.get((row, column))
            if window is None:
                cost = np.ascontiguousarray(self._cost[square])
                window = WindowSearch(cost, square[0].start, square[1].start, self._n)
                self._windows.keep((row, column), window)
            reached = window.reach(cell, cells, np.ascontiguousarray(self._room[square]), self._cell)
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
