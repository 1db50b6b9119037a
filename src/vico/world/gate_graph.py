"""The cheapest ways over the gates of a city, looked for in compiled code: a large city has thousands of gates."""

from __future__ import annotations

import heapq
from collections.abc import Mapping
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled
from vico.world.city_gates import Gates, Ints
from vico.world.grid_search import DIAGONAL, STRAIGHT

_FAR = np.int64(1) << 60


class Onward(NamedTuple):
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
    ) -> Onward:
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
        costs, then = _onward(graph, *arriving, leaving, start, self._width)
        return Onward(costs, then)


@compiled
def _least(cell, goal, width):  # type: ignore[no-untyped-def]
    """Return a cost that no walk between two cells is below."""
    dx, dy = abs(cell % width - goal % width), abs(cell // width - goal // width)
    return 100 * (STRAIGHT * max(dx, dy) + (DIAGONAL - STRAIGHT) * min(dx, dy))


@compiled
def _go_on(node, graph, known, queue, aim, width):  # type: ignore[no-untyped-def]
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
def _cheapest(graph, leave, leave_costs, arrive, arrive_costs, goal, width):  # type: ignore[no-untyped-def]
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
        _go_on(node, graph, (best, came, done), queue, goal, width)
    way = [np.int64(0)]
    way.pop()
    while last >= 0:
        way.append(np.int64(last))
        last = came[last]
    return np.array(way[::-1], np.int64)


@compiled
def _onward(graph, arrive, arrive_costs, leave, start, width):  # type: ignore[no-untyped-def]
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
        _go_on(node, graph, (best, then, done), queue, start, width)
    return np.where(done, best, -1), then
