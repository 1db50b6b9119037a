"""A* over a grid of integer costs, pulling its ways straight, and the nearest free cell: compiled loops."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled
from vico.world.walkable import BODY

STRAIGHT, DIAGONAL = 10, 14  # 10 : 14 for 1 : sqrt 2; a cost unit is a thousandth of a cell on sidewalk
# Circular buckets, a power of 2; more than the largest change of f along an edge (14 * 500 + 14 * 100).
RING = 32768
_IN_RING = RING - 1

# Learned cost of cells to which there is no way: no sum of costs makes it that of another cell.
NEVER = -(1 << 30)

_NEVER_SO_FAR = np.int64(1) << 60

# Directions 0 to 3 lead east, west, north and south, 4 to 7 diagonally.
_FIRST_DIAGONAL = 4


# What a search knows of a cell; all in one place, for it is read together.
CELL = np.dtype(
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
Costs = tuple[NDArray[Any], NDArray[np.int32], int]


class SearchMemory(NamedTuple):
    """Working memory of a search.

    Attributes
    ----------
    cells
        Records of `CELL`, shape ``(cells,)``.
    head
        First cell in the list of each bucket, -1 for none, int32, shape ``(RING,)``.
    """

    cells: NDArray[np.void]
    head: NDArray[np.int32]


class Goals(NamedTuple):
    """Cells where a search may end; without any it goes everywhere.

    Attributes
    ----------
    cells
        Numbers of cells, rising, int64, shape ``(n,)``.
    columns, rows
        Of the cells, int64, shape ``(n,)``.
    onward
        What is still to be paid from each, int64, shape ``(n,)``.
    """

    cells: NDArray[np.int64]
    columns: NDArray[np.int64]
    rows: NDArray[np.int64]
    onward: NDArray[np.int64]


def goals_at(cells: NDArray[np.int64], onward: NDArray[np.int64], width: int) -> Goals:
    """Return cells of a grid as goals."""
    return Goals(cells, cells % width, cells // width, onward)


def goal_at(cell: int, width: int) -> Goals:
    """Return one cell of a grid as the goal."""
    return goals_at(np.array([cell], np.int64), np.zeros(1, np.int64), width)


EVERYWHERE = goals_at(np.zeros(0, np.int64), np.zeros(0, np.int64), 1)


@compiled(inline="always")
def _unlink(cell, key, work):
    n, p = cell.after, cell.before
    if p >= 0:
        work.cells[p].after = n
    else:
        work.head[key] = n
    if n >= 0:
        work.cells[n].before = p


@compiled(inline="always")
def _link(node, cell, key, work):
    first = work.head[key]
    cell.after, cell.before = first, -1
    if first >= 0:
        work.cells[first].before = node
    work.head[key] = node


@compiled(inline="always")
def _step(direction):
    """Return the step in x and y to the neighbour in a direction."""
    if direction >= _FIRST_DIAGONAL:
        return 1 if direction % 2 == 0 else -1, 1 if direction < 6 else -1
    if direction < 2:
        return 1 - 2 * direction, 0
    return 0, 5 - 2 * direction


@compiled(inline="always")
def _may_step(cost, width, height, cell, direction):
    """Return whether a step ends on an open cell, and cuts no corner if it is diagonal."""
    step_x, step_y = _step(direction)
    nx, ny = cell % width + step_x, cell // width + step_y
    if nx < 0 or ny < 0 or nx >= width or ny >= height or cost[ny * width + nx] == 0:
        return False
    return direction < _FIRST_DIAGONAL or (cost[cell + step_x] != 0 and cost[cell + step_y * width] != 0)


@compiled(inline="always")
def _least_cost(node, x, y, aim):
    """Return a cost that no walk to the goals is below, what A* goes by; 0 without a goal.

    The larger of two: the walk to one of them if all were sidewalk without walls, and what is to be paid from there;
    and, by the triangle inequality, what the two cells' costs from a landmark differ by. `aim` are the goals, the costs
    from landmarks, and the goal's among them.
    """
    goals, landmarks, from_goal = aim
    if len(goals.cells) == 0:
        return np.int64(0)
    least = _NEVER_SO_FAR
    for k in range(len(goals.cells)):
        dx, dy = abs(x - goals.columns[k]), abs(y - goals.rows[k])
        walk = 100 * (STRAIGHT * max(dx, dy) + (DIAGONAL - STRAIGHT) * min(dx, dy))
        least = min(least, walk + goals.onward[k])
    for k in range(landmarks.shape[1]):
        least = max(least, abs(landmarks[node, k] - from_goal[k]))
    return least


@compiled(inline="always")
def _left_from(node, goals):
    """Return what is left to go from a cell if it is a goal, else -1."""
    low, high = 0, len(goals.cells)
    while low < high:
        middle = (low + high) // 2
        if goals.cells[middle] < node:
            low = middle + 1
        else:
            high = middle
    return goals.onward[low] if low < len(goals.cells) and goals.cells[low] == node else np.int64(-1)


@compiled(inline="always")
def _step_cost(flat, node, other, direction):
    """Return the cost of a step between neighbours."""
    length = STRAIGHT if direction < _FIRST_DIAGONAL else DIAGONAL
    return length * (np.int64(flat[node]) + np.int64(flat[other])) // 2


@compiled(inline="always")
def _open_sides(flat, node, x, y, width, height):
    """Return whether the cells east, west, north and south of a cell are open."""
    return (
        x < width - 1 and flat[node + 1] != 0,
        x > 0 and flat[node - 1] != 0,
        y < height - 1 and flat[node + width] != 0,
        y > 0 and flat[node - width] != 0,
    )


@compiled
def _relax(other, x, y, length, here, flat, work, aim):
    """Reach a cell from a neighbour, if that is cheaper; return 1 if it was not seen before, else 0."""
    so_far, cost, generation = here
    near = work.cells[other]
    if near.stamp == generation + 1:
        return 0
    value = so_far + length * (cost + np.int64(flat[other])) // 2
    new = near.stamp != generation
    if new:
        near.stamp = generation
        near.rest = _least_cost(other, x, y, aim)
    elif value >= near.g:
        return 0
    else:
        _unlink(near, (near.g + near.rest) & _IN_RING, work)
    near.g = value
    _link(other, near, (value + near.rest) & _IN_RING, work)
    return 1 if new else 0


@compiled
def search(cost, work, start, goals, generation, landmarks):
    """Run A* from `start` with circular buckets; return the goal that the cheapest walk leads to, -1 if there is none.

    Without goals it is Dijkstra's search of all cells. Landmarks are for searches with one goal.

    All cells of all cheapest walks are made final, not those of the first one found alone: so `backtrack` chooses
    among them the same way whatever the landmarks. The stamp of a cell becomes `generation` where it was seen,
    `generation` + 1 where its cost is final.
    """
    cells, head = work.cells, work.head
    height, width = cost.shape
    flat = cost.ravel()
    aim = goals, landmarks, landmarks[goals.cells[0] if len(goals.cells) else 0].copy()
    head[:] = -1
    first = cells[start]
    first.g, first.stamp = 0, generation
    first.rest = _least_cost(start, start % width, start // width, aim)
    level = np.int64(first.rest)
    _link(start, first, level & _IN_RING, work)
    left, met, goal_cost = 1, np.int64(-1), np.int64(0)
    while left > 0:
        while head[level & _IN_RING] < 0:
            level += 1
        if met >= 0 and level > goal_cost:
            return met
        node = np.int64(head[level & _IN_RING])
        cell = cells[node]
        _unlink(cell, level & _IN_RING, work)
        left -= 1
        cell.stamp = generation + 1
        onward = _left_from(node, goals)
        if onward >= 0 and (met < 0 or cell.g + onward < goal_cost):
            met, goal_cost = node, cell.g + onward
        y = node // width
        x = node - y * width
        east, west, north, south = _open_sides(flat, node, x, y, width, height)
        here = cell.g, np.int64(flat[node]), generation
        if east:
            left += _relax(node + 1, x + 1, y, STRAIGHT, here, flat, work, aim)
            if north and flat[node + width + 1] != 0:
                left += _relax(node + width + 1, x + 1, y + 1, DIAGONAL, here, flat, work, aim)
            if south and flat[node - width + 1] != 0:
                left += _relax(node - width + 1, x + 1, y - 1, DIAGONAL, here, flat, work, aim)
        if west:
            left += _relax(node - 1, x - 1, y, STRAIGHT, here, flat, work, aim)
            if north and flat[node + width - 1] != 0:
                left += _relax(node + width - 1, x - 1, y + 1, DIAGONAL, here, flat, work, aim)
            if south and flat[node - width - 1] != 0:
                left += _relax(node - width - 1, x - 1, y - 1, DIAGONAL, here, flat, work, aim)
        if north:
            left += _relax(node + width, x, y + 1, STRAIGHT, here, flat, work, aim)
        if south:
            left += _relax(node - width, x, y - 1, STRAIGHT, here, flat, work, aim)
    return met


@compiled
def _entry_direction(flat, costs, node, width, height, last):
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
def backtrack(cost, costs, start, goal):
    """Return the cells of a cheapest walk from `start` to `goal`, the one with the fewest turns near its end.

    `costs` are those from the start: the costs, stamps, and the stamp of cells whose cost is final.
    """
    height, width = cost.shape
    flat = cost.ravel()
    cells = [goal]
    node, direction = goal, -1
    while node != start:
        direction = _entry_direction(flat, costs, node, width, height, direction)
        step_x, step_y = _step(direction)
        node -= step_y * width + step_x
        cells.append(node)
    return np.array(cells[::-1], np.int64)


@compiled
def steps_of(cells, width):
    """Return the directions of the steps from each of a walk's cells to the next, uint8."""
    steps = np.empty(len(cells) - 1, np.uint8)
    for k in range(len(steps)):
        aside, up = cells[k + 1] % width - cells[k] % width, cells[k + 1] // width - cells[k] // width
        if aside == 0 or up == 0:
            steps[k] = (1 - aside) // 2 if up == 0 else (5 - up) // 2
        else:
            steps[k] = 4 + (1 - aside) // 2 + (1 - up)
    return steps


@compiled
def cells_along(cost, start, steps, backwards):
    """Return the cells of a walk, int64, and what it costs up to each; none where it leaves what may be walked on.

    Parameters
    ----------
    cost
        Of the grid's cells.
    start
        The cell that it begins in; where `backwards` that in which the walk of these steps ends.
    steps
        Of `steps_of`.
    """
    height, width = cost.shape
    cells, costs = np.empty(len(steps) + 1, np.int64), np.zeros(len(steps) + 1, np.int64)
    cells[0] = start
    x, y = start % width, start // width
    here = np.int64(cost[y, x])
    for k in range(len(steps)):
        direction = np.int64(steps[len(steps) - 1 - k if backwards else k])
        step_x, step_y = _step(direction)
        if backwards:
            step_x, step_y = -step_x, -step_y
        x, y = x + step_x, y + step_y
        if x < 0 or y < 0 or x >= width or y >= height or cost[y, x] == 0:
            return cells[:0], costs[:0]
        there = np.int64(cost[y, x])
        length = STRAIGHT if direction < _FIRST_DIAGONAL else DIAGONAL
        costs[k + 1] = costs[k] + length * (here + there) // 2
        cells[k + 1] = y * width + x
        here = there
    return cells, costs


@compiled
def _straight_cost(cost, clearance, blocked, checks, x0, y0, x1, y1):
    """Cost of a straight walk between points in cell units, or -1 where there is no room for it."""
    height, width = cost.shape
    length = math.hypot(x1 - x0, y1 - y0)
    steps = max(1, math.ceil(length / 0.4))
    total = 0.0
    for k in range(steps + 1):
        t = k / steps
        x, y = x0 + (x1 - x0) * t, y0 + (y1 - y0) * t
        i, j = min(width - 1, max(0, int(x))), min(height - 1, max(0, int(y)))
        if cost[j, i] == 0 or (checks and blocked[j, i]):
            return -1.0
        u, v = min(width - 1.0, max(0.0, x - 0.5)), min(height - 1.0, max(0.0, y - 0.5))
        a, b = min(width - 2, int(u)), min(height - 2, int(v))
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
    return total / steps * length * STRAIGHT


@compiled
def string_pull(cost, clearance, blocked, checks, points, g):
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
def nearest_free(free, x, y, reach):
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
