"""Walking routes on the walkable map: A* with integer costs, then pulled straight."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from threading import Lock
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.io.compiled import compiled
from vico.world.walkable import BODY, CROSSING, OPEN, ROADWAY, SIDEWALK, WalkableMap

#: How much longer a metre on each surface counts than on a sidewalk, in hundredths.
WEIGHTS = {SIDEWALK: 100, CROSSING: 110, OPEN: 120, ROADWAY: 400}

# Walls are given a berth where there is room: cells closer than this cost a quarter more.
_BERTH = 0.6
_SNAP = 6.0  # metres a start or goal may lie off what can be walked on
_STRAIGHT, _DIAGONAL = 10, 14  # 10 : 14 for 1 : sqrt 2; a cost unit is a thousandth of a cell on sidewalk
# Circular buckets, a power of 2; more than the largest change of f along an edge (14 * 500 + 14 * 100).
_RING = 32768
_IN_RING = _RING - 1

# Costs from landmarks are worth their making (a search of the whole map each) to who searches this often.
_LANDMARKS = 6
_WORTH_LANDMARKS = 40

# Learned cost of cells to which there is no way: no sum of costs makes it that of another cell.
_NEVER = -(1 << 30)

# Directions 0 to 3 lead east, west, north and south, 4 to 7 diagonally.
_FIRST_DIAGONAL = 4


# What a search knows of a cell; all in one place, for it is read together.
_CELL = np.dtype(
    [
        ("g", np.int64),  # least cost from the start found so far; valid where `stamp` is of this search
        ("rest", np.int32),  # least cost that may be left to the goal (the heuristic); valid as `g` is
        ("stamp", np.int32),  # in which search it was last seen (an even number), plus 1 where `g` is final
        ("after", np.int32),  # neighbours in the list of its bucket, -1 for none
        ("before", np.int32),
    ],
    align=True,
)


# Costs by cell, stamps by cell, and the stamp of the cells whose cost is final.
_Costs = tuple[NDArray[Any], NDArray[np.int32], int]


class _Work(NamedTuple):
    """Working memory of a search.

    Attributes
    ----------
    cells
        Records of `_CELL`, shape ``(cells,)``.
    head
        First cell in the list of each bucket, -1 for none, int32, shape ``(_RING,)``.
    """

    cells: NDArray[np.void]
    head: NDArray[np.int32]


@compiled(inline="always")
def _unlink(cell, key, work):  # type: ignore[no-untyped-def]
    n, p = cell.after, cell.before
    if p >= 0:
        work.cells[p].after = n
    else:
        work.head[key] = n
    if n >= 0:
        work.cells[n].before = p


@compiled(inline="always")
def _link(node, cell, key, work):  # type: ignore[no-untyped-def]
    first = work.head[key]
    cell.after, cell.before = first, -1
    if first >= 0:
        work.cells[first].before = node
    work.head[key] = node


@compiled(inline="always")
def _step(direction):  # type: ignore[no-untyped-def]
    """Return the step in x and y to the neighbour in a direction."""
    if direction >= _FIRST_DIAGONAL:
        return 1 if direction % 2 == 0 else -1, 1 if direction < 6 else -1
    if direction < 2:
        return 1 - 2 * direction, 0
    return 0, 5 - 2 * direction


@compiled(inline="always")
def _may_step(cost, width, height, cell, direction):  # type: ignore[no-untyped-def]
    """Return whether a step ends on an open cell, and cuts no corner if it is diagonal."""
    step_x, step_y = _step(direction)
    nx, ny = cell % width + step_x, cell // width + step_y
    if nx < 0 or ny < 0 or nx >= width or ny >= height or cost[ny * width + nx] == 0:
        return False
    return direction < _FIRST_DIAGONAL or (cost[cell + step_x] != 0 and cost[cell + step_y * width] != 0)


@compiled(inline="always")
def _least_cost(node, goal, width, landmarks, from_goal):  # type: ignore[no-untyped-def]
    """Return a cost that no walk between two cells is below, what A* goes by; 0 without a goal.

    The larger of two: the walk if all were sidewalk without walls; and, by the triangle inequality, what the two cells'
    costs from a landmark differ by (`from_goal` are the goal's).
    """
    if goal < 0:
        return 0
    dx, dy = abs(node % width - goal % width), abs(node // width - goal // width)
    least = 100 * (_STRAIGHT * max(dx, dy) + (_DIAGONAL - _STRAIGHT) * min(dx, dy))
    for k in range(landmarks.shape[1]):
        least = max(least, abs(landmarks[node, k] - from_goal[k]))
    return least


@compiled(inline="always")
def _step_cost(flat, node, other, direction):  # type: ignore[no-untyped-def]
    """Return the cost of a step between neighbours."""
    length = _STRAIGHT if direction < _FIRST_DIAGONAL else _DIAGONAL
    return length * (np.int64(flat[node]) + np.int64(flat[other])) // 2


@compiled(inline="always")
def _open_sides(flat, node, width, height):  # type: ignore[no-untyped-def]
    """Return whether the cells east, west, north and south of a cell are open."""
    y = node // width
    x = node - y * width
    return (
        x < width - 1 and flat[node + 1] != 0,
        x > 0 and flat[node - 1] != 0,
        y < height - 1 and flat[node + width] != 0,
        y > 0 and flat[node - width] != 0,
    )


@compiled
def _search(cost, work, start, goal, generation, landmarks):  # type: ignore[no-untyped-def]
    """Run A* from `start`, or Dijkstra where `goal` is -1, with circular buckets; return whether the goal was met.

    All cells of all cheapest walks are made final, not those of the first one found alone: so `_backtrack` chooses
    among them the same way whatever the landmarks. The stamp of a cell becomes `generation` where it was seen,
    `generation` + 1 where its cost is final.
    """
    cells, head = work.cells, work.head
    height, width = cost.shape
    flat = cost.ravel()
    from_goal = landmarks[max(goal, 0)].copy()
    head[:] = -1
    first = cells[start]
    first.g, first.stamp = 0, generation
    first.rest = _least_cost(start, goal, width, landmarks, from_goal)
    level = np.int64(first.rest)
    _link(start, first, level & _IN_RING, work)
    left, met, goal_cost = 1, False, np.int64(0)
    while left > 0:
        while head[level & _IN_RING] < 0:
            level += 1
        if met and level > goal_cost:
            return True
        node = np.int64(head[level & _IN_RING])
        cell = cells[node]
        _unlink(cell, level & _IN_RING, work)
        left -= 1
        cell.stamp = generation + 1
        if node == goal:
            met, goal_cost = True, cell.g
        east, west, north, south = _open_sides(flat, node, width, height)
        for direction in range(8):
            step_x, step_y = _step(direction)
            if not (
                (step_x == 0 or (east if step_x > 0 else west)) and (step_y == 0 or (north if step_y > 0 else south))
            ):
                continue
            other = node + step_y * width + step_x
            if flat[other] == 0:
                continue
            near = cells[other]
            if near.stamp == generation + 1:
                continue
            value = cell.g + _step_cost(flat, node, other, direction)
            if near.stamp == generation:
                if value >= near.g:
                    continue
                _unlink(near, (near.g + near.rest) & _IN_RING, work)
            else:
                near.stamp = generation
                near.rest = _least_cost(other, goal, width, landmarks, from_goal)
                left += 1
            near.g = value
            _link(other, near, (value + near.rest) & _IN_RING, work)
    return met


@compiled
def _entered(flat, costs, node, width, height, last):  # type: ignore[no-untyped-def]
    """Return the direction in which a cheapest walk enters a cell: straight on if it can, else the first that does."""
    g, stamp, final = costs
    for k in range(-1, 8):
        direction = last if k < 0 else k
        if direction < 0:
            continue
        step_x, step_y = _step(direction)
        x, y = node % width - step_x, node // width - step_y
        if x < 0 or y < 0 or x >= width or y >= height:
            continue
        source = y * width + x
        if stamp[source] != final or not _may_step(flat, width, height, source, direction):
            continue
        if g[source] + _step_cost(flat, source, node, direction) == g[node]:
            return direction
    return -1


@compiled
def _backtrack(cost, costs, start, goal):  # type: ignore[no-untyped-def]
    """Return the cells of a cheapest walk from `start` to `goal`, the one with the fewest turns near its end.

    `costs` are those from the start: the costs, stamps, and the stamp of cells whose cost is final.
    """
    height, width = cost.shape
    flat = cost.ravel()
    cells = [goal]
    node, direction = goal, -1
    while node != start:
        direction = _entered(flat, costs, node, width, height, direction)
        step_x, step_y = _step(direction)
        node -= step_y * width + step_x
        cells.append(node)
    return np.array(cells[::-1], np.int64)


@compiled
def _straight_cost(cost, clearance, blocked, checks, x0, y0, x1, y1):  # type: ignore[no-untyped-def]
    """Cost of a straight walk between points in cell units, or -1 where there is no room for it."""
    n = cost.shape[0]
    length = math.hypot(x1 - x0, y1 - y0)
    steps = max(1, math.ceil(length / 0.4))
    total = 0.0
    for k in range(steps + 1):
        t = k / steps
        x, y = x0 + (x1 - x0) * t, y0 + (y1 - y0) * t
        i, j = min(n - 1, max(0, int(x))), min(n - 1, max(0, int(y)))
        if cost[j, i] == 0 or (checks and blocked[j, i]):
            return -1.0
        u, v = min(n - 1.0, max(0.0, x - 0.5)), min(n - 1.0, max(0.0, y - 0.5))
        a, b = min(n - 2, int(u)), min(n - 2, int(v))
        fu, fv = u - a, v - b
        room = (clearance[b, a] * (1 - fu) + clearance[b, a + 1] * fu) * (1 - fv) + (
            clearance[b + 1, a] * (1 - fu) + clearance[b + 1, a + 1] * fu
        ) * fv
        if room < BODY - 0.02:
            return -1.0
        if checks:
            for dj in range(2):
                for di in range(2):
                    if blocked[b + dj, a + di]:
                        return -1.0
        total += cost[j, i] * (0.5 if k in (0, steps) else 1.0)
    return total / steps * length * _STRAIGHT


@compiled
def _pull(cost, clearance, blocked, checks, points, g):  # type: ignore[no-untyped-def]
    """Return the points to keep (indices): straight walks that cost no more than the grid's path between their ends."""
    count = len(points)
    keep = np.empty(count, np.int64)
    keep[0] = 0
    kept = 1
    anchor = 0
    while anchor < count - 1:
        good = anchor + 1
        reach = 2
        # Galloping, then halving: the farthest point found that a straight walk serves as well.
        while anchor + reach < count:
            j = anchor + reach
            c = _straight_cost(
                cost, clearance, blocked, checks, points[anchor, 0], points[anchor, 1], points[j, 0], points[j, 1]
            )
            if c < 0 or c > (g[j] - g[anchor]) * 1.012 + 20:
                break
            good = j
            reach *= 2
        low, high = good, min(count - 1, anchor + reach)
        while high - low > 0:
            j = (low + high + 1) // 2
            c = _straight_cost(
                cost, clearance, blocked, checks, points[anchor, 0], points[anchor, 1], points[j, 0], points[j, 1]
            )
            if c < 0 or c > (g[j] - g[anchor]) * 1.012 + 20:
                high = j - 1
            else:
                low = j
        good = max(good, low)
        keep[kept] = good
        kept += 1
        anchor = good
    return keep[:kept]


@compiled
def _nearest(free, x, y, reach):  # type: ignore[no-untyped-def]
    """Flat index of the free cell whose centre is nearest to (x, y) in cell units, or -1 within `reach` rings."""
    n = free.shape[0]
    ci, cj = min(n - 1, max(0, int(x))), min(n - 1, max(0, int(y)))
    best, index = 1e18, -1
    for r in range(reach + 1):
        if index >= 0 and (r - 1.0) * (r - 1.0) > best:
            break
        for j in range(max(0, cj - r), min(n - 1, cj + r) + 1):
            step = 1 if j in (cj - r, cj + r) else max(1, 2 * r)
            for i in range(ci - r, ci + r + 1, step):
                if 0 <= i < n and free[j, i]:
                    d = (i + 0.5 - x) ** 2 + (j + 0.5 - y) ** 2
                    if d < best:
                        best, index = d, j * n + i
    return index


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
        table = np.zeros(5, np.int32)
        for surface, weight in WEIGHTS.items():
            table[surface] = weight
        cost = table[walkable.cls]
        self._clearance = np.ascontiguousarray(walkable.clearance)
        cost[self._clearance < _BERTH] = cost[self._clearance < _BERTH] * 5 // 4
        cost[~walkable.connected] = 0
        self._cost = np.ascontiguousarray(cost, np.int32)
        self._free = self._cost > 0
        cells = cost.size
        self._work = _Work(np.zeros(cells, _CELL), np.empty(_RING, np.int32))
        self._generation = 0
        self._searches = 0
        self._landmarks = np.zeros((cells, 0), np.int32)
        self._learned: dict[int, NDArray[np.int32]] = {}
        self._lock = Lock()
        self._nothing = np.zeros((0, 0), np.bool_)
        self._shut = np.zeros(cost.shape, np.bool_)

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
            cell = self._nearest_cell(np.asarray(point, np.float64)[:2], self._free, _SNAP)
            if cell >= 0 and cell not in self._learned:
                self._run(self._cost, cell, -1, self._landmarks)
                self._learned[cell] = np.where(self._is_final, self._work.cells["g"], _NEVER).astype(np.int32)

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
    ) -> NDArray[np.float64] | None:
        """Find a walk that prefers sidewalks and crossings and keeps 0.3 m from walls.

        Parameters
        ----------
        start, goal
            ENU metres. A point that can't be walked on is led to the nearest one that can, up to 6 m off.
        blocked
            Cells that are closed besides, bool, shape ``(n, n)``.
        closed
            Squares that are closed besides, as x, y and half their side, metres: quicker than `blocked` where they are
            few and small.

        Returns
        -------
        ndarray or None
            Corner points from start to goal, shape ``(k, 2)``, ``k >= 1``; None if there is no way.
        """
        a, b = np.asarray(start, np.float64)[:2], np.asarray(goal, np.float64)[:2]
        with self._lock:
            self._count_search()
            with self._closed(closed):
                if blocked is None:
                    return self._path(a, b, self._cost, self._shut if closed else None)
                shut = blocked | self._shut
                return self._path(a, b, np.where(shut, np.int32(0), self._cost), shut)

    def _path(
        self, a: NDArray[np.float64], b: NDArray[np.float64], cost: NDArray[np.int32], shut: NDArray[np.bool_] | None
    ) -> NDArray[np.float64] | None:
        """Find a walk where `cost` is above 0; `shut` are the cells in which it is 0 for this walk only."""
        free = self._free if cost is self._cost else cost > 0
        first, last = self._nearest_cell(a, free, _SNAP), self._nearest_cell(b, free, _SNAP)
        costs = None if first < 0 or last < 0 else self._costs_from(first, last, cost, closing=shut is not None)
        if costs is None:
            return None
        cells = _backtrack(cost, costs, first, last)
        g = costs[0][cells].astype(np.int64)
        n = self.walkable.n
        points = np.column_stack([cells % n, cells // n]) + 0.5
        checks = shut is not None
        kept = _pull(self._cost, self._clearance, self._nothing if shut is None else shut, checks, points, g)
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

    def _costs_from(self, first: int, last: int, cost: NDArray[np.int32], *, closing: bool) -> _Costs | None:
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
    def _closed(self, squares: Sequence[tuple[float, float, float]]) -> Iterator[None]:
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
        first = self._nearest_cell(np.asarray(goal, np.float64)[:2], free, _SNAP)
        shape = self._cost.shape
        if first < 0:
            return np.full(shape, np.inf, np.float32)
        metre = self.walkable.cell / (100 * _STRAIGHT)
        with self._lock:
            self._run(cost, first, -1, self._landmarks)
            return np.where(self._is_final, self._work.cells["g"] * metre, np.inf).astype(np.float32).reshape(shape)

    def _run(self, cost: NDArray[np.int32], first: int, last: int, landmarks: NDArray[np.int32]) -> bool:
        self._generation += 2
        return bool(_search(cost, self._work, first, last, self._generation, landmarks))

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
        index = int(_nearest(free, (x + half) / cell, (y + half) / cell, int(within / cell)))
        if index < 0:
            return -1
        away = math.hypot((index % n + 0.5) * cell - half - x, (index // n + 0.5) * cell - half - y)
        return index if away <= within else -1
