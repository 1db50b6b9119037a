"""Gates between the tiles of a city, the walks between them, and the cheapest ways over them.

Where two tiles meet there are gates: the middle of each stretch of the border that can be walked over. Each tile knows
the walks between its own, cell by cell. `GateGraph` searches the gates of the whole city in compiled code: a large city
has thousands of them.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.errors import SchemaError
from vico.geometry import polyline_length
from vico.io.arrays import read_npz
from vico.io.compiled import compiled
from vico.world.grid_search import (
    CELL,
    DIAGONAL,
    EVERYWHERE,
    RING,
    STRAIGHT,
    Goals,
    SearchMemory,
    backtrack,
    goal_at,
    goals_at,
    search,
    steps_of,
    string_pull,
)
from vico.world.routing import WEIGHTS
from vico.world.walkable import ROADWAY

Ints = NDArray[np.int64]

# A gate for so many cells side by side.
_GATE = 64
_NOTHING = np.zeros((0, 0), np.bool_)
_NO_STEP = np.zeros(0, np.uint8)


@dataclass(frozen=True)
class Gates:
    """Gates of a city's tiles, and the walks between them.

    Attributes
    ----------
    cells
        The cell on one side of a border of each, number in the city's map, int64, shape ``(n,)``.
    start, end
        Between which gates walks lead, within a tile or over a border: cells, int64, shape ``(m,)``; each pair once.
    cost
        What they cost, int64, shape ``(m,)``.
    metres, corners
        How long they are, and how many corners they have between their ends, float64 and int64, shape ``(m,)``.
    count
        How many steps from cell to cell they have, int64, shape ``(m,)``.
    steps
        These steps, walk after walk, as `vico.world.grid_search.steps_of` writes them, uint8, shape
        ``(count.sum(),)``.
    """

    cells: Ints
    start: Ints
    end: Ints
    cost: Ints
    metres: NDArray[np.float64]
    corners: Ints
    count: Ints
    steps: NDArray[np.uint8]

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return them as named arrays, for a file; `steps`, which are many, are written apart."""
        return {name: getattr(self, name) for name in self._array_names()}

    @classmethod
    def _array_names(cls) -> list[str]:
        return [name for name in cls.__dataclass_fields__ if name != "steps"]

    @classmethod
    def joined(cls, parts: Sequence[Gates]) -> Gates:
        """Return the gates of several tiles as one table."""
        return cls(*(np.concatenate([getattr(one, name) for one in parts]) for name in cls.__dataclass_fields__))

    @classmethod
    def read(cls, path: Path, steps: NDArray[np.uint8]) -> Gates:
        """Read what was written of `arrays`, for these steps.

        Raises
        ------
        SchemaError
            If the file does not hold them, or the steps are those of other walks.
        """
        arrays = read_npz(path.read_bytes())
        missing = sorted(set(cls._array_names()) - set(arrays))
        if missing:
            raise SchemaError(f"{path}: has no {', '.join(missing)}; build the city anew")
        whole = {k: np.ascontiguousarray(arrays[k], np.int64) for k in cls._array_names() if k != "metres"}
        if steps.dtype != np.uint8 or steps.shape != (whole["count"].sum(),):
            raise SchemaError(f"{path}: the steps beside it are those of other walks; build the city anew")
        return cls(**whole, metres=np.ascontiguousarray(arrays["metres"], np.float64), steps=steps)


class ReachedCells(NamedTuple):
    """Walks from a cell to others, an entry each.

    Attributes
    ----------
    cost
        int64; -1 where there is none.
    metres, corners
        float64 and int64.
    steps
        From cell to cell, uint8 each; none where they were not asked for.
    """

    cost: Ints
    metres: NDArray[np.float64]
    corners: Ints
    steps: Sequence[NDArray[np.uint8]] = ()


class Scratch:
    """Working memory that searches use one after the other: to fetch it anew takes as long as a short one."""

    def __init__(self) -> None:
        self.memory = SearchMemory(np.zeros(0, CELL), np.empty(RING, np.int32))
        # Even; of the last search. It counts on when the memory grows, so that stamps of any search differ.
        self.generation = 0

    def begin(self, cells: int) -> None:
        """Begin a search of so many cells; what the last one found is lost."""
        if len(self.memory.cells) < cells:
            self.memory = SearchMemory(np.zeros(cells, CELL), self.memory.head)
        self.generation += 2


class WindowSearch:
    """Searches the cells of a rectangle of a map.

    Parameters
    ----------
    cost
        Of its cells, int32, contiguous.
    row, column
        Of its south-western cell in the map.
    width
        Of the map, cells.
    scratch
        Shared with other windows, used by one of them at a time.
    """

    def __init__(
        self, cost: NDArray[np.int32], row: int, column: int, width: int, scratch: Scratch | None = None
    ) -> None:
        self._cost, self._row, self._column, self._width = cost, row, column, width
        self._scratch = scratch or Scratch()
        self._landmarks = np.zeros((cost.size, 0), np.int32)

    def own(self, cells: Ints) -> Ints:
        """Return the numbers in the window of cells of the map."""
        rows, columns = cells // self._width - self._row, cells % self._width - self._column
        return np.asarray(rows * self._cost.shape[1] + columns, np.int64)

    def costs(self, start: int, goals: Ints) -> Ints:
        """Return what walks from a cell of the map to others cost; -1 where there is none."""
        self._search(start, EVERYWHERE)
        own = self.own(goals)
        final = self._scratch.memory.cells["stamp"][own] == self._scratch.generation + 1
        return np.where(final, self._scratch.memory.cells["g"][own], -1).astype(np.int64)

    def reach(
        self, start: int, goals: Ints, clearance: NDArray[np.float32], cell: float, *, steps: bool = False
    ) -> ReachedCells:
        """Return what walks from a cell of the map to others cost, and how long they are, pulled straight.

        Parameters
        ----------
        start, goals
            Numbers of cells in the map.
        clearance
            Room to walls of the window's cells, metres.
        cell
            Side of a cell, metres.
        steps
            Whether to tell their steps, too.
        """
        cost = self.costs(start, goals)
        metres, corners = np.zeros(len(goals)), np.zeros(len(goals), np.int64)
        told = [_NO_STEP] * len(goals) if steps else []
        first = int(self.own(np.array([start]))[0])
        for k, last in enumerate(self.own(goals).tolist()):
            if cost[k] > 0:
                cells, costs = self._walk_between(first, last)
                metres[k], corners[k] = self._length(cells, costs, clearance, cell)
                if steps:
                    told[k] = steps_of(cells, self._cost.shape[1])
        return ReachedCells(cost, metres, corners, told)

    def length(self, start: int, goal: int, clearance: NDArray[np.float32], cell: float) -> tuple[float, int] | None:
        """Return how long the cheapest walk between two cells of the map is, and its corners; None if there is none."""
        if start == goal:
            return 0.0, 0
        first, last = self.own(np.array([start, goal])).tolist()
        if self._search(start, goal_at(last, self._cost.shape[1])) < 0:
            return None
        return self._length(*self._walk_between(first, last), clearance, cell)

    def walk(self, start: int, goal: int) -> tuple[Ints, Ints] | None:
        """Return the cells of the cheapest walk between two cells of the map, and its cost up to each."""
        last = int(self.own(np.array([goal]))[0])
        return self._walk_to(start, goal_at(last, self._cost.shape[1]))

    def walk_out(self, start: int, exits: Ints, onward: Ints) -> tuple[Ints, Ints] | None:
        """Return the walk from a cell of the map to that of several others by which it is cheapest to go on.

        Parameters
        ----------
        start, exits
            Numbers of cells in the map; exits rising.
        onward
            What it costs to go on from each exit, shape ``(len(exits),)``.
        """
        return self._walk_to(start, goals_at(self.own(exits), onward, self._cost.shape[1]))

    def _walk_to(self, start: int, goals: Goals) -> tuple[Ints, Ints] | None:
        last = self._search(start, goals)
        if last < 0:
            return None
        cells, costs = self._walk_between(int(self.own(np.array([start]))[0]), last)
        side = self._cost.shape[1]
        return (cells // side + self._row) * self._width + cells % side + self._column, costs

    def _search(self, start: int, goals: Goals) -> int:
        self._scratch.begin(self._cost.size)
        first = int(self.own(np.array([start]))[0])
        return int(search(self._cost, self._scratch.memory, first, goals, self._scratch.generation, self._landmarks))

    def _walk_between(self, first: int, last: int) -> tuple[Ints, Ints]:
        known = self._scratch.memory.cells["g"], self._scratch.memory.cells["stamp"], self._scratch.generation + 1
        cells = backtrack(self._cost, known, first, last)
        return cells, self._scratch.memory.cells["g"][cells].astype(np.int64)

    def _length(self, cells: Ints, costs: Ints, clearance: NDArray[np.float32], cell: float) -> tuple[float, int]:
        side = self._cost.shape[1]
        points = np.column_stack([cells % side, cells // side]) + 0.5
        kept = points[string_pull(self._cost, clearance, _NOTHING, False, points, costs)]
        return polyline_length(kept) * cell, max(0, len(kept) - 2)


def border_gates(mine: NDArray[Any], theirs: NDArray[Any]) -> list[int]:
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


class _GateWalk(NamedTuple):
    """A walk from a gate to another: their cells, what it costs, metres, and corners between its ends."""

    start: int
    end: int
    cost: int
    metres: float
    corners: int


def tile_gates(
    cost: NDArray[Any], clearance: NDArray[np.float32], square: tuple[slice, slice], *, cell: float
) -> Gates:
    """Find a tile's gates, the walks between them, and the steps over its eastern and northern border.

    Parameters
    ----------
    cost, clearance
        Of all cells of the city.
    square
        Rows and columns of the tile.
    cell
        Side of a cell, metres.
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
    walks: list[_GateWalk] = []
    steps: list[NDArray[np.uint8]] = []
    for (rows, columns), (up, aside) in sides:
        there = tuple(
            slice(part.start + by, part.stop + by) if isinstance(part, slice) else part + by
            for part, by in ((rows, up), (columns, aside))
        )
        if not all(
            part.start >= 0 and part.stop <= size if isinstance(part, slice) else 0 <= part < size
            for part, size in zip(there, (height, width), strict=True)
        ):
            continue
        mine, theirs = cost[rows, columns], cost[there]
        for k in border_gates(mine, theirs):
            row = rows.start + k if isinstance(rows, slice) else rows
            column = columns.start + k if isinstance(columns, slice) else columns
            own.append(row * width + column)
            if up + aside > 0:
                other = (row + up) * width + column + aside
                walks.append(_GateWalk(own[-1], other, STRAIGHT * (int(mine[k]) + int(theirs[k])) // 2, cell, 0))
                steps.append(steps_of(np.array([own[-1], other], np.int64), width))
    cells = np.unique(np.array(own, np.int64))
    window = WindowSearch(np.ascontiguousarray(cost[square], np.int32), bottom, left, width)
    room = np.ascontiguousarray(clearance[square], np.float32)
    for k, first in enumerate(cells.tolist()):
        rest = cells[k + 1 :]
        found = window.reach(first, rest, room, cell, steps=True)
        for j in np.flatnonzero(found.cost >= 0).tolist():
            metres = round(float(found.metres[j]), 2)
            walks.append(_GateWalk(first, int(rest[j]), int(found.cost[j]), metres, int(found.corners[j])))
            steps.append(found.steps[j])
    return Gates(
        cells,
        np.array([walk.start for walk in walks], np.int64),
        np.array([walk.end for walk in walks], np.int64),
        np.array([walk.cost for walk in walks], np.int64),
        np.array([walk.metres for walk in walks], np.float64),
        np.array([walk.corners for walk in walks], np.int64),
        np.array([len(one) for one in steps], np.int64),
        np.concatenate([_NO_STEP, *steps]),
    )


_FAR = np.int64(1) << 60


class WaysToGoal(NamedTuple):
    """The cheapest ways from gates to a goal.

    Attributes
    ----------
    cost
        Of that from each gate by number, int64; -1 where none was found.
    then
        The next gate on it, int64; -1 where it leads to the goal itself.
    """

    cost: Ints
    then: Ints

    def gates(self, first: int) -> list[int]:
        """Return the gates of the way that begins in one."""
        way = [first]
        while self.then[way[-1]] >= 0:
            way.append(int(self.then[way[-1]]))
        return way


class GateGraph:
    """Which gates lead to which, and at what cost.

    Parameters
    ----------
    gates
        Of a city.
    width
        Of its map, cells.
    side
        Cells along a tile's side.

    Attributes
    ----------
    cells
        The gates, number of the cell of each, rising.
    steps
        Of all walks, as in `Gates`.
    """

    def __init__(self, gates: Gates, width: int, side: int) -> None:
        self.cells = np.unique(np.concatenate([gates.cells, gates.start, gates.end]))
        self._width, self._side = width, side
        first, last = (np.searchsorted(self.cells, part) for part in (gates.start, gates.end))
        starts, ends = np.concatenate([first, last]), np.concatenate([last, first])
        order = np.lexsort((ends, starts))
        self._ends = ends[order]
        self._costs = np.tile(gates.cost, 2)[order]
        self._metres = np.tile(gates.metres, 2)[order]
        self._corners = np.tile(gates.corners, 2)[order]
        self._first = np.searchsorted(starts[order], np.arange(len(self.cells) + 1))
        # Of an edge: the walk as it is kept, and where the steps of each begin; walks are kept in one direction.
        self._walk = order.astype(np.int32)
        self._begin = np.concatenate([[0], np.cumsum(gates.count)])
        self.steps = gates.steps

    @cached_property
    def _by_tile(self) -> dict[tuple[int, int], Ints]:
        tiles = np.column_stack([self.cells // self._width, self.cells % self._width]) // self._side
        found: dict[tuple[int, int], list[int]] = {}
        for number, (row, column) in enumerate(tiles.tolist()):
            found.setdefault((row, column), []).append(number)
        return {tile: np.array(numbers, np.int64) for tile, numbers in found.items()}

    def of_tile(self, tile: tuple[int, int]) -> Ints:
        """Return the numbers of the gates of a tile, given by its row and column."""
        return self._by_tile.get(tile, np.zeros(0, np.int64))

    def edge(self, a: int, b: int) -> int:
        """Return the number of the walk from gate to gate; -1 if there is none."""
        begin, end = self._first[a : a + 2].tolist()
        k = begin + int(np.searchsorted(self._ends[begin:end], b))
        return k if k < end and self._ends[k] == b else -1

    def cost(self, a: int, b: int) -> int:
        """Return what the walk from gate to gate costs; -1 if there is none."""
        k = self.edge(a, b)
        return -1 if k < 0 else int(self._costs[k])

    def walk(self, a: int, b: int) -> tuple[NDArray[np.uint8], bool] | None:
        """Return the steps of the walk from the cell of a gate to that of another; None if none is kept.

        Returns
        -------
        steps
            As in `Gates`.
        backwards
            Whether they lead from the second to the first.
        """
        gates = np.searchsorted(self.cells, (a, b)).tolist()
        if max(gates) >= len(self.cells) or self.cells[gates].tolist() != [a, b]:
            return None
        k = self.edge(*gates)
        if k < 0:
            return None
        backwards, number = divmod(int(self._walk[k]), len(self._begin) - 1)
        return self.steps[self._begin[number] : self._begin[number + 1]], bool(backwards)

    def length(self, a: int, b: int) -> tuple[float, int]:
        """Return how long the walk from gate to gate is, metres, and its corners."""
        k = self.edge(a, b)
        return float(self._metres[k]), int(self._corners[k])

    def _costs_with(self, changed: Mapping[tuple[int, int], int]) -> Ints:
        costs = self._costs.copy() if changed else self._costs
        for (a, b), cost in changed.items():
            k = self.edge(a, b)
            if k >= 0:
                costs[k] = cost
        return costs

    def cheapest(
        self,
        leaving: tuple[Ints, Ints],
        arriving: tuple[Ints, Ints],
        goal: int,
        changed: Mapping[tuple[int, int], int] | None = None,
    ) -> list[int]:
        """Return the gates of the cheapest way.

        Parameters
        ----------
        leaving, arriving
            Gates by number that lie in the tile of the start and of the goal, and the costs from the one and to the
            other; below 0 where there is no walk.
        goal
            Its cell.
        changed
            What walks from gate to gate cost instead; below 0 if there is none now.

        Returns
        -------
        list of int
            Empty if there is no way.
        """
        graph = self.cells, self._first, self._ends, self._costs_with(changed or {})
        found: NDArray[np.int64] = _cheapest(graph, *leaving, *arriving, goal, self._width)
        return found.tolist()

    def onward(
        self,
        start: int,
        leaving: Ints,
        arriving: tuple[Ints, Ints],
        changed: Mapping[tuple[int, int], int] | None = None,
    ) -> WaysToGoal:
        """Return what it costs from the gates of one tile to a goal.

        Parameters
        ----------
        start
            A cell among the gates `leaving`, by which the search is led.
        leaving
            Gates by number.
        arriving, changed
            As in `cheapest`.
        """
        graph = self.cells, self._first, self._ends, self._costs_with(changed or {})
        costs, then = _search_from_goal(graph, *arriving, leaving, start, self._width)
        return WaysToGoal(costs, then)


@compiled
def _least(cell, goal, width):
    """Return a cost that no walk between two cells is below."""
    dx, dy = abs(cell % width - goal % width), abs(cell // width - goal // width)
    return 100 * (STRAIGHT * max(dx, dy) + (DIAGONAL - STRAIGHT) * min(dx, dy))


@compiled
def _relax_neighbours(node, graph, known, queue, aim, width):
    """Reach the neighbours of a gate that is done; `known` are costs so far, by which gate, and what is done."""
    cells, first, ends, costs = graph
    best, by, done = known
    for k in range(first[node], first[node + 1]):
        other = ends[k]
        if costs[k] < 0 or done[other]:
            continue
        value = best[node] + costs[k]
        if value < best[other]:
            best[other], by[other] = value, node
            heapq.heappush(queue, (value + _least(cells[other], aim, width), other))


@compiled
def _cheapest(graph, leave, leave_costs, arrive, arrive_costs, goal, width):
    """Run A* over the gates; of ways that cost the same, the gates with the lower numbers are taken first."""
    cells = graph[0]
    count = len(cells)
    best, came = np.full(count, _FAR), np.full(count, -1)
    onward, done = np.full(count, -1), np.zeros(count, np.bool_)
    for k in range(len(arrive)):
        onward[arrive[k]] = arrive_costs[k]
    queue = [(np.int64(0), np.int64(-1))]
    queue.pop()
    for k in range(len(leave)):
        if 0 <= leave_costs[k] < best[leave[k]]:
            best[leave[k]] = leave_costs[k]
            heapq.heappush(queue, (leave_costs[k] + _least(cells[leave[k]], goal, width), leave[k]))
    total, last = _FAR, np.int64(-1)
    while len(queue) > 0:
        bound, node = heapq.heappop(queue)
        if bound >= total:
            break
        if done[node]:
            continue
        done[node] = True
        if onward[node] >= 0 and best[node] + onward[node] < total:
            total, last = best[node] + onward[node], node
        _relax_neighbours(node, graph, (best, came, done), queue, goal, width)
    way = [np.int64(0)]
    way.pop()
    while last >= 0:
        way.append(np.int64(last))
        last = came[last]
    return np.array(way[::-1], np.int64)


@compiled
def _search_from_goal(graph, arrive, arrive_costs, leave, start, width):
    """Run A* from the goal to all gates of a tile; of ways that cost the same, those over lower numbers are taken."""
    cells = graph[0]
    count = len(cells)
    best, then = np.full(count, _FAR), np.full(count, -1)
    done, wanted = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    wanted[leave] = True
    left = len(leave)
    queue = [(np.int64(0), np.int64(-1))]
    queue.pop()
    for k in range(len(arrive)):
        if 0 <= arrive_costs[k] < best[arrive[k]]:
            best[arrive[k]] = arrive_costs[k]
            heapq.heappush(queue, (arrive_costs[k] + _least(cells[arrive[k]], start, width), arrive[k]))
    while len(queue) > 0 and left > 0:
        _, node = heapq.heappop(queue)
        if done[node]:
            continue
        done[node] = True
        left -= wanted[node]
        _relax_neighbours(node, graph, (best, then, done), queue, start, width)
    return np.where(done, best, -1), then
