"""Ways within a room whose walls and furniture are known: past people who stand there, and to where one is in no way.

A body's width is kept from everything, so that the way behind a counter is found where there is one, and none is
tried where nobody fits through.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.io.compiled import compiled

#: People who have a choice stand so far apart, metres, middle to middle: near enough to talk.
PERSONAL = 1.0
#: Nobody stays standing so near to a door, metres, nor where there is less room to walls and furniture than `PASSAGE`.
DOORWAY, PASSAGE = 1.0, 0.42
# What is asked of a spot to stand aside: room to walls and furniture, metres to doors and to others; where there are
# others and no such spot, less will do.
_ASIDE = ((PASSAGE, DOORWAY, PERSONAL), (0.27, 0.0, PERSONAL), (0.27, 0.0, 0.7))
# The same of a spot where others get past: with room for them beside one.
_LETS_PASS = ((0.8, 0.0, PERSONAL), (PASSAGE, 0.0, PERSONAL), (0.27, 0.0, PERSONAL), (0.27, 0.0, 0.7))
# Metres between the points of a grid. Half a person's width and a little; and what will do where that leaves no way.
_CELL, _WIDTHS = 0.1, (0.27, 0.252)
# Middle to middle, metres, that one passes people at. Who comes towards one is passed on the right: such people are
# taken to be so far to the left of where they are, metres, if they are no farther away than `_ONCOMING`.
_PASSES, _LEFT, _ONCOMING = 0.55, 0.15, 2.5
# Ways keep this far from walls and furniture where there is room, metres; a step nearer to them counts as so many.
_EASY, _NARROW_COSTS = 0.45, 2.0
_KEPT = 128  # rooms

Area = NDArray[np.float64]
_NOBODY: Area = np.zeros((0, 2))


class RoomWays:
    """A room's floor as a grid along its walls: how much room there is at each point.

    Parameters
    ----------
    room
        Floor as ``x, y, yaw, half length, half width``, ENU metres and radians, shape ``(5,)``.
    furniture
        What stands in it, in the same form, shape ``(k, 5)``.
    """

    def __init__(self, room: Area, furniture: Area) -> None:
        self._x, self._y, yaw, self._half_u, self._half_v = (float(value) for value in room)
        self._cos, self._sin = math.cos(yaw), math.sin(yaw)
        u = np.arange(-self._half_u, self._half_u + _CELL / 2, _CELL)
        v = np.arange(-self._half_v, self._half_v + _CELL / 2, _CELL)
        self._shape = len(v), len(u)
        across, along = np.meshgrid(u, v)
        self._points = np.stack(
            [
                self._x + self._cos * across - self._sin * along,
                self._y + self._sin * across + self._cos * along,
            ],
            axis=-1,
        )
        gap = np.minimum(self._half_u - np.abs(across), self._half_v - np.abs(along))
        for box in furniture:
            gap = np.minimum(gap, _gap_to(box, self._points))
        #: Metres to the nearest wall or piece of furniture, float32, shape ``(rows, columns)``; negative within one.
        self.room = gap.astype(np.float32)

    def gap(self, point: ArrayLike) -> float:
        """Return the room around a point, metres."""
        column, row = self._cell(np.asarray(point, np.float64))
        return float(self.room[row, column])

    def way(
        self, start: Area, goal: Area, *, near: float, people: Area = _NOBODY, bumps: Area = _NOBODY
    ) -> Area | None:
        """Return the points of a way to within `near` metres of a goal, shape ``(k, 2)``; None if there is none.

        Parameters
        ----------
        people
            Where others stand, who are passed, shape ``(m, 2)``.
        bumps
            Where something stands that is not known otherwise, shape ``(m, 2)``.
        """
        return self._search(start, self._away_from(goal) <= max(near, 0.75 * _CELL), people, bumps, goal, near)

    def aside(
        self, start: Area, *, people: Area, doors: Sequence[Sequence[float]] | None = None, within: float
    ) -> Area | None:
        """Return the points of the shortest way to where one stands in nobody's way; None if there is no such spot.

        It ends `PERSONAL` metres from others, or 0.7 m where there is no more room.

        Parameters
        ----------
        people
            Where others are, shape ``(m, 2)``.
        doors
            Where doors are, ENU metres, at which nobody stays; None for who only lets others pass.
        within
            How far off the spot may be, metres.
        """
        near = self._away_from(start) <= within
        for width, from_doors, from_people in _LETS_PASS if doors is None else _ASIDE:
            wanted = near & (self.room >= width)
            for x, y in people:
                wanted &= self._away_from((x, y)) >= from_people
            for door in doors or ():
                wanted &= self._away_from(door) >= from_doors
            way = self._search(start, wanted, people, _NOBODY, start, math.inf) if wanted.any() else None
            if way is not None or not len(people):
                return way
        return None

    def is_out_of_the_way(self, point: Area, doors: Sequence[Sequence[float]]) -> bool:
        """Return whether who stands at a point leaves others room to pass and to come in by the doors."""
        return self.gap(point) >= PASSAGE - _CELL and all(
            math.dist(point, door[:2]) >= DOORWAY - _CELL for door in doors
        )

    def is_clear(self, one: Area, other: Area, people: Area) -> bool:
        """Return whether one gets straight from one point to another, past people who stand there."""
        steps = max(2, math.ceil(math.dist(one, other) / (_CELL / 2)))
        line = one + np.linspace(0.0, 1.0, steps)[1:, None] * (other - one)
        least = min(_WIDTHS[0], self.gap(one))
        if any(self.gap(point) < least for point in line):
            return False
        return not len(people) or bool((_distances(line, people) >= _PASSES - 0.02).all())

    def _search(
        self, start: Area, wanted: NDArray[np.bool_], people: Area, bumps: Area, aim: Area, near: float
    ) -> Area | None:
        """Return the cheapest way from a point to one of those that are wanted."""
        gap = self.room
        for points, reach in ((people, _PASSES), (bumps, 0.3)):
            for x, y in points:
                gap = np.minimum(gap, (self._away_from((x, y)) - (reach - _WIDTHS[0])).astype(np.float32))
        column, row = self._cell(start)
        aim_column, aim_row = self._cell(aim)
        for width in _WIDTHS:
            found = _cheapest_way(
                gap, wanted, (row, column), (aim_row, aim_column), near / _CELL, (width, _EASY, _NARROW_COSTS)
            )
            if len(found):
                # The last cell stands for the first point: the way begins where one is.
                rows, columns = found[1:].T if len(found) > 1 else found.T
                return np.asarray(self._points[rows, columns])
        return None

    def _away_from(self, point: Sequence[float] | Area) -> Area:
        """Return how far all points of the grid are from a point, metres."""
        return np.asarray(np.hypot(self._points[..., 0] - point[0], self._points[..., 1] - point[1]))

    def _cell(self, point: Area) -> tuple[int, int]:
        """Return column and row of the point of the grid that is nearest to a point."""
        dx, dy = float(point[0]) - self._x, float(point[1]) - self._y
        u = self._cos * dx + self._sin * dy + self._half_u
        v = self._cos * dy - self._sin * dx + self._half_v
        rows, columns = self._shape
        return min(max(round(u / _CELL), 0), columns - 1), min(max(round(v / _CELL), 0), rows - 1)


def ways_in(room: Area, furniture: Area) -> RoomWays:
    """Return the ways of a room; those of the rooms asked for last are kept."""
    return _kept(np.ascontiguousarray(room).tobytes(), np.ascontiguousarray(furniture).tobytes())


@lru_cache(maxsize=_KEPT)
def _kept(room: bytes, furniture: bytes) -> RoomWays:
    return RoomWays(np.frombuffer(room), np.frombuffer(furniture).reshape(-1, 5))


def passed_on_the_right(people: Area, position: Area, yaw: float) -> Area:
    """Return where people are taken to be whom one goes around: those ahead a little to the left, shape ``(m, 2)``."""
    if not len(people):
        return people
    east, north = math.cos(yaw), math.sin(yaw)
    away = people - position
    oncoming = (away[:, 0] * east + away[:, 1] * north > 0.0) & (np.hypot(*away.T) <= _ONCOMING)
    return people + np.where(oncoming[:, None], _LEFT * np.array([-north, east]), 0.0)


def _gap_to(box: Area, points: Area) -> Area:
    """Return signed distances from points to an oriented rectangle, metres."""
    x, y, yaw, half_length, half_width = box
    c, s = math.cos(yaw), math.sin(yaw)
    dx, dy = points[..., 0] - x, points[..., 1] - y
    u, v = np.abs(c * dx + s * dy) - half_length, np.abs(c * dy - s * dx) - half_width
    outside = np.hypot(np.maximum(u, 0.0), np.maximum(v, 0.0))
    return np.asarray(outside + np.minimum(np.maximum(u, v), 0.0))


def _distances(points: Area, others: Area) -> Area:
    return np.asarray(np.hypot(*np.moveaxis(points[:, None] - others[None], -1, 0)))


@compiled
def _cheapest_way(gap, wanted, start, aim, near, costs):  # type: ignore[no-untyped-def]
    """Run A* on a grid to the first wanted cell; return rows and columns from the start on, none if there is no way.

    A cell with too little room may be left for one with more, so that whoever touches something gets away from it.
    """
    width, easy, dear = costs
    rows, columns = gap.shape
    cost = np.full((rows, columns), np.inf)
    parent = np.full((rows, columns), -1, np.int64)
    done = np.zeros((rows, columns), np.bool_)
    cost[start[0], start[1]] = 0.0
    queue = [(0.0, start[0], start[1])]
    while len(queue) > 0:
        _, y, x = heapq.heappop(queue)
        if done[y, x]:
            continue
        done[y, x] = True
        if wanted[y, x]:
            return _cells_to(parent, y, x)
        for dy in range(-1, 2):
            for dx in range(-1, 2):
                j, i = y + dy, x + dx
                if not (0 <= j < rows and 0 <= i < columns) or done[j, i]:
                    continue
                if gap[j, i] < width and gap[j, i] <= gap[y, x]:
                    continue
                # No corner is cut.
                if dx != 0 and dy != 0:
                    least = min(gap[y, i], gap[j, x])
                    if least < width and least <= gap[y, x]:
                        continue
                step = math.sqrt(dx * dx + dy * dy)
                new = cost[y, x] + step * (dear if gap[j, i] < easy else 1.0)
                if new < cost[j, i]:
                    cost[j, i] = new
                    parent[j, i] = y * columns + x
                    left = math.sqrt((j - aim[0]) ** 2 + (i - aim[1]) ** 2) - near
                    heapq.heappush(queue, (new + max(left, 0.0), j, i))
    return np.zeros((0, 2), np.int64)


@compiled
def _cells_to(parent, y, x):  # type: ignore[no-untyped-def]
    """Return the cells of the way that led to one, the start first."""
    columns = parent.shape[1]
    count, j, i = 1, y, x
    while parent[j, i] >= 0:
        before = parent[j, i]
        j, i = before // columns, before % columns
        count += 1
    cells = np.empty((count, 2), np.int64)
    j, i = y, x
    for k in range(count - 1, -1, -1):
        cells[k, 0], cells[k, 1] = j, i
        before = parent[j, i]
        j, i = before // columns, before % columns
    return cells
