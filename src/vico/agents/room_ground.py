"""Where there is room between people, walls and furniture: the floor around a walker in cells of 5 cm."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from vico.agents.perception import cells_to
from vico.io.compiled import compiled

Point = tuple[float, float]

_CELL, _CELLS = 0.05, 121  # of the square around the walker: metres, and how many along a side
_BODY = 0.25  # metres from a walker's middle to its side
#: Metres that ways keep from walls and furniture, and from the middles of others; on a straight step a little less will
#: do: cells are rounded.
_FROM_SOLIDS, _FROM_OTHERS = _BODY + 0.01, 2 * _BODY + 0.015
_STEP_FROM_SOLIDS, _STEP_FROM_OTHERS = _BODY + 0.001, 2 * _BODY + 0.004
# To one side of somebody the ground counts as closed: so far, and so wide to both sides of that line, metres.
_WING, _HALF_WING = 3.0, 0.3
# Who steps aside looks so far for a spot, metres; lets pass who gets so far behind where it stood, within so much.
_ASIDE, _BEHIND, _ABOUT = 2.8, 0.9, 0.5
_TRIED, _EVERY = 100, 7  # spots, of the cells by how near they are
_LONGEST = 1.0  # metres a step
# Who keeps to the right steps so far aside, metres, where there is room: the first of these that there is room for.
_TO_THE_RIGHT = tuple(k / 100 for k in range(30, 5, -1))


class RoomGround:
    """The floor of a room around somebody who walks there.

    Parameters
    ----------
    here
        Where the walker stands, ENU metres.
    room, furniture
        As ``info["in_view"]`` has them: ``x, y, yaw, half length, half width``, shapes ``(5,)`` and ``(k, 5)``.
    others
        Where other people stand, ENU metres.
    """

    def __init__(
        self, here: Point, room: NDArray[np.float64], furniture: NDArray[np.float64], others: Sequence[Point]
    ) -> None:
        self._here, self._others = here, list(others)
        self._room, self._furniture = np.asarray(room, np.float64), np.asarray(furniture, np.float64).reshape(-1, 5)
        # The walker stands in the middle of a cell.
        self._corner = np.array(here) - _CELLS * _CELL / 2
        self._free = _gaps(self._corner, _CELLS, self._room, self._furniture) >= _FROM_SOLIDS
        axis = (np.arange(_CELLS) + 0.5) * _CELL
        self._x, self._y = np.meshgrid(self._corner[0] + axis, self._corner[1] + axis)

    def way(self, goal: Point, *, near: float, closed: NDArray[np.bool_] | None = None) -> NDArray[np.float64]:
        """Return the points of a way past the others to within `near` metres of a goal, shape ``(k, 2)``; or none.

        Parameters
        ----------
        closed
            Cells that it does not lead over, of `beside`.
        """
        blocked = ~self._free
        for other in self._others:
            blocked |= self._away_from(other) < self._kept_from(other)
        if closed is not None:
            blocked |= closed
        middle = _CELLS // 2
        blocked[middle, middle] = False
        aim = (np.array(goal) - self._corner) / _CELL
        return self._corner + (cells_to(blocked, (middle, middle), aim, near / _CELL) + 0.5) * _CELL

    def beside(self, other: Point, side: float) -> NDArray[np.bool_]:
        """Return the cells to the left (1) or the right (-1) of somebody, as seen from the walker."""
        dx, dy = other[0] - self._here[0], other[1] - self._here[1]
        far = max(math.hypot(dx, dy), 1e-9)
        along = ((self._x - other[0]) * dx + (self._y - other[1]) * dy) / far
        left = ((self._y - other[1]) * dx - (self._x - other[0]) * dy) / far * side
        return np.asarray((np.abs(along) < _HALF_WING) & (left > 0.0) & (left < _WING))

    def first_step(self, way: NDArray[np.float64]) -> Point:
        """Return the last point of a way, within a step, that is reached straight on."""
        found = way[0]
        for point in way[1:]:
            if math.dist(point, self._here) > _LONGEST:
                break
            if self._is_straight(point):
                found = point
        return float(found[0]), float(found[1])

    def spot_to_the_right(self, other: Point) -> Point | None:
        """Return where one stands who makes room for somebody ahead on one's left; None without room to the right."""
        dx, dy = other[0] - self._here[0], other[1] - self._here[1]
        far = max(math.hypot(dx, dy), 1e-9)
        for step in _TO_THE_RIGHT:
            spot = self._here[0] + step * dy / far, self._here[1] - step * dx / far
            if self._is_straight(np.array(spot)):
                return spot
        return None

    def _is_straight(self, point: NDArray[np.float64]) -> bool:
        """Whether one can walk straight to a point."""
        people = np.array([(*other, self._kept_from(other, _STEP_FROM_OTHERS)) for other in self._others])
        here = np.array(self._here)
        return bool(_is_free_line(here, point, self._room, self._furniture, people.reshape(-1, 3)))

    def spot_aside(self, other: Point) -> Point | None:
        """Return the nearest spot where one lets somebody pass who stands before one; None if there is none near."""
        dx, dy = self._here[0] - other[0], self._here[1] - other[1]
        far = max(math.hypot(dx, dy), 1e-9)
        away = self._metres_to_free_cells()
        beyond = self._here[0] + _BEHIND * dx / far, self._here[1] + _BEHIND * dy / far
        # To the right sooner than to the left, where both are as near.
        right = ((self._x - self._here[0]) * -dy + (self._y - self._here[1]) * dx) / far
        cost = away + np.where(right > 0.0, 0.0, 0.15)
        cost[away > _ASIDE] = np.inf
        start = self._cell_of(other)
        about = self._away_from(beyond) <= _ABOUT
        order = np.argsort(cost, axis=None, kind="stable")[: _EVERY * _TRIED : _EVERY]
        for k in order.tolist():
            j, i = divmod(k, _CELLS)
            if not math.isfinite(cost[j, i]):
                return None
            spot = float(self._x[j, i]), float(self._y[j, i])
            left_over = self._free & (self._away_from(spot) >= _FROM_OTHERS)
            left_over[start] = True
            part = ndimage.label(left_over)[0]
            if (part[about] == part[start]).any():
                return spot
        return None

    def spot_off(self, point: Point, *, away: float) -> Point | None:
        """Return the nearest spot at least so many metres from a point; None if there is none near."""
        metres = self._metres_to_free_cells()
        metres[(self._away_from(point) < away) | (metres > _ASIDE)] = np.inf
        j, i = divmod(int(metres.argmin()), _CELLS)
        return (float(self._x[j, i]), float(self._y[j, i])) if math.isfinite(metres[j, i]) else None

    def _metres_to_free_cells(self) -> NDArray[np.float64]:
        """Return how far the cells are that the walker can get to past the others, metres; infinite for the rest."""
        mine = self._free.copy()
        for other in self._others:
            mine &= self._away_from(other) >= self._kept_from(other)
        middle = _CELLS // 2
        mine[middle, middle] = True
        parts = ndimage.label(mine)[0]
        return np.where(parts == parts[middle, middle], self._away_from(self._here), np.inf)

    def _away_from(self, point: Point) -> NDArray[np.float64]:
        return np.asarray(np.hypot(self._x - point[0], self._y - point[1]))

    def _kept_from(self, other: Point, usual: float = _FROM_OTHERS) -> float:
        """Return how far one keeps from somebody, metres: who touches others need not step back first."""
        return min(usual, math.dist(other, self._here) - 1e-6)

    def _cell_of(self, point: Point) -> tuple[int, int]:
        i, j = ((np.array(point) - self._corner) / _CELL).astype(np.int64).clip(0, _CELLS - 1).tolist()
        return j, i


@compiled
def _gap(x, y, room, furniture):  # type: ignore[no-untyped-def]
    """Distance from a point of a room to the nearest wall or piece of furniture, metres; negative in one."""
    c, s = math.cos(room[2]), math.sin(room[2])
    dx, dy = x - room[0], y - room[1]
    gap = min(room[3] - abs(c * dx + s * dy), room[4] - abs(c * dy - s * dx))
    for k in range(len(furniture)):
        box = furniture[k]
        c, s = math.cos(box[2]), math.sin(box[2])
        dx, dy = x - box[0], y - box[1]
        u, v = abs(c * dx + s * dy) - box[3], abs(c * dy - s * dx) - box[4]
        if u > 0.0 or v > 0.0:
            gap = min(gap, math.hypot(max(u, 0.0), max(v, 0.0)))
        else:
            gap = min(gap, max(u, v))
    return gap


@compiled
def _gaps(corner, n, room, furniture):  # type: ignore[no-untyped-def]
    """Return the gaps around the middles of ``n x n`` cells."""
    found = np.empty((n, n))
    for j in range(n):
        for i in range(n):
            found[j, i] = _gap(corner[0] + (i + 0.5) * _CELL, corner[1] + (j + 0.5) * _CELL, room, furniture)
    return found


@compiled
def _is_free_line(start, end, room, furniture, people):  # type: ignore[no-untyped-def]
    """Return whether one can walk straight; `people`: x, y, and how far one keeps from them, shape ``(k, 3)``."""
    length = math.hypot(end[0] - start[0], end[1] - start[1])
    wanted = min(_STEP_FROM_SOLIDS, _gap(start[0], start[1], room, furniture) - 1e-9)
    steps = max(1, math.ceil(length / 0.05))
    for k in range(1, steps + 1):
        x, y = start[0] + (end[0] - start[0]) * k / steps, start[1] + (end[1] - start[1]) * k / steps
        if _gap(x, y, room, furniture) < wanted:
            return False
        for m in range(len(people)):
            if math.hypot(x - people[m, 0], y - people[m, 1]) < people[m, 2]:
                return False
    return True


__all__ = ["RoomGround"]
