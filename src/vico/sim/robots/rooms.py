"""Rooms as robots find their way in them: where they fit, ways round furniture, and which door is next."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import dijkstra

from vico.assets.robots import RobotModel
from vico.sim.bodies import FIXTURE, Bodies
from vico.sim.indoor import Indoor
from vico.world.model import Entrance, Room
from vico.world.world import World

Array = NDArray[np.float64]

#: Outdoors, where the number of a room is asked for.
OUTDOORS = -1
#: Metres between two points that ways are made of.
_CELL = 0.15
#: Metres between points at which a straight way is looked at, and that it may come nearer to things than a cell does.
_LOOK, _NEARER = 0.08, 0.03
#: Grids that are remembered.
_KEPT = 128
#: Half the thickness of walls, metres, and height of their boxes.
_WALL, _WALL_HEIGHT = 0.1, 2.5
#: Metres that a robot may start off the places where it has room.
_OFF = 1.0
#: Width of doorways, metres, and what has to be left of it.
DOORWAY, _DOOR_GAP = 0.9, 0.05
#: Metres a robot leaves to walls and furniture.
_GAP = 0.03
_NOBODY = np.zeros((0, 3))


def turning_radius(model: RobotModel) -> float:
    """Return how much room a robot needs around its middle to turn anywhere, metres."""
    square = abs(model.half_length - model.half_width) < 0.01
    return _GAP + (model.half_width + 0.05 if square else math.hypot(model.half_length, model.half_width))


def fits_doors(model: RobotModel) -> bool:
    """Return whether a robot is narrow enough for doorways."""
    return 2.0 * (model.half_width + _DOOR_GAP) <= DOORWAY


@dataclass(frozen=True)
class _Grid:
    """Where a robot has room in a room: points (ENU metres, shape ``(k, 2)``), and steps from one to the next."""

    points: Array
    steps: csr_matrix


class RobotRooms:
    """All rooms of a world, for robots. Nothing in it changes.

    Parameters
    ----------
    world
        The world.
    indoor
        Its rooms as arrays.
    """

    def __init__(self, world: World, indoor: Indoor) -> None:
        self.world, self.indoor = world, indoor
        self._grids: dict[tuple[int, float], _Grid] = {}
        self._solids: dict[int, Bodies] = {}
        self._entrances = {entrance.id: entrance for entrance in world.entrances}
        #: Entrances by the number of the room behind them.
        self.entrances: dict[int, Entrance] = {}
        for place in world.places:
            if place.rooms and place.entrance and place.rooms[0] in indoor.index:
                self.entrances.setdefault(indoor.index[place.rooms[0]], self._entrances[place.entrance])

    def room(self, room: int) -> Room:
        """Return a room's record."""
        return self.indoor.rooms[room]

    def room_at(self, point: Array) -> int:
        """Return the room that a point lies in, ENU metres; `OUTDOORS` for none."""
        if not len(self.indoor.rooms) or point[2] >= float(self.world.height(point)) - 1.0:
            return OUTDOORS
        x, y, _, a, b = self.indoor.boxes.T
        near = np.flatnonzero(np.hypot(x - point[0], y - point[1]) <= np.hypot(a, b))
        return next((int(k) for k in near if self.indoor.holds(int(k), point.tolist())), OUTDOORS)

    # Doors.

    def next_room(self, room: int, goal: int) -> int | None:
        """Return the room to go to next on the way from a room (or outdoors) to another; None if there is no way.

        Stairs are no way for robots.
        """
        if goal == OUTDOORS:
            return self._next(room, lambda k: k in self.entrances and self._leads_out(k), OUTDOORS)
        if room == OUTDOORS:
            way = self._chain(goal, lambda k: k in self.entrances)
            return None if way is None else way[-1]
        return self._next(room, lambda k: k == goal, goal)

    def _leads_out(self, room: int) -> bool:
        return any(door.to == OUTDOORS for door in self.indoor.doors[room])

    def _next(self, room: int, is_goal: Callable[[int], bool], beyond: int) -> int | None:
        way = self._chain(room, is_goal)
        if way is None:
            return None
        return way[1] if len(way) > 1 else beyond

    def _chain(self, room: int, is_goal: Callable[[int], bool]) -> list[int] | None:
        """Return the fewest rooms from one to one that is wanted, both among them."""
        before = {room: room}
        queue = deque([room])
        while queue:
            here = queue.popleft()
            if is_goal(here):
                way = [here]
                while before[way[-1]] != way[-1]:
                    way.append(before[way[-1]])
                return way[::-1]
            for door in self.indoor.doors[here]:
                if door.to >= 0 and door.to not in before and not self.room(door.to).rise:
                    before[door.to] = here
                    queue.append(door.to)
        return None

    def door(self, room: int, to: int) -> Array:
        """Return where the door of a room to another one (or outdoors) is, ENU metres, shape ``(3,)``."""
        found = next((door.position for door in self.indoor.doors[room] if door.to == to), self.room(room).door)
        return np.asarray(found, np.float64)

    # Ways.

    def path(
        self, room: int, start: Array, goal: Array, radius: float, *, within: float, closed: Array = _NOBODY
    ) -> Array | None:
        """Return the way in a room to the nearest point to a goal where a robot has room.

        Parameters
        ----------
        start, goal
            ENU metres; x and y count.
        radius
            Room around its middle, metres.
        within
            How far off the goal the way may end, metres.
        closed
            Discs to keep out of: x, y, radius, shape ``(m, 3)``.

        Returns
        -------
        ndarray or None
            A polyline that begins at `start`, shape ``(k, 2)``, ``k >= 2``; None if there is none.
        """
        grid = self._grid(room, radius)
        free = _outside(grid.points, closed)
        begin, here = _nearest(grid.points, free, start), np.asarray(start, np.float64)[:2]
        if begin < 0 or math.dist(grid.points[begin], here) > _OFF:
            return None
        chosen = np.flatnonzero(free)
        steps = grid.steps if free.all() else grid.steps[chosen][:, chosen]
        first = int(np.searchsorted(chosen, begin))
        length, before = dijkstra(steps, indices=first, return_predecessors=True)
        reached = np.isfinite(length)
        away = np.hypot(*(grid.points[chosen] - np.asarray(goal)[:2]).T)
        away[~reached] = np.inf
        end = int(away.argmin())
        if away[end] > within:
            return None
        cells = [end]
        while cells[-1] != first:
            cells.append(int(before[cells[-1]]))
        points = np.vstack([here, grid.points[chosen[cells[::-1]]]])
        return self._straightened(points, room, radius, closed)

    def spot(self, room: int, near: Array, radius: float, closed: Array, within: float) -> Array | None:
        """Return the nearest point to a point where a robot has room, clear of discs, shape ``(2,)``; None for none."""
        grid = self._grid(room, radius)
        k = _nearest(grid.points, _outside(grid.points, closed), near)
        if k < 0 or math.dist(grid.points[k], np.asarray(near)[:2]) > within:
            return None
        return np.array(grid.points[k])

    def _straightened(self, points: Array, room: int, radius: float, closed: Array) -> Array:
        """Leave out points of a way between which one can go straight."""
        kept, at = [0], 0
        while at < len(points) - 1:
            to = len(points) - 1
            while to > at + 1 and not self._is_free(points[at], points[to], room, radius, closed):
                to = at + max(1, (to - at) // 2)
            kept.append(to)
            at = to
        return np.ascontiguousarray(points[kept])

    def _is_free(self, a: Array, b: Array, room: int, radius: float, closed: Array) -> bool:
        count = max(2, math.ceil(math.dist(a, b) / _LOOK) + 1)
        line = a + (b - a) * np.linspace(0.0, 1.0, count)[:, None]
        gaps = self.indoor.gaps(room, line)
        # Who starts nearer to something may leave it.
        return bool((gaps >= min(radius, gaps[0]) - _NEARER).all() and _outside(line[1:], closed).all())

    def _grid(self, room: int, radius: float) -> _Grid:
        key = room, radius
        if key not in self._grids:
            if len(self._grids) >= _KEPT:
                self._grids.clear()
            self._grids[key] = self._make_grid(room, radius)
        return self._grids[key]

    def _make_grid(self, room: int, radius: float) -> _Grid:
        x, y, yaw, a, b = self.indoor.boxes[room].tolist()
        u = np.arange(-a + radius, a - radius + 1e-9, _CELL)
        v = np.arange(-b + radius, b - radius + 1e-9, _CELL)
        uu, vv = np.meshgrid(u, v)
        c, s = math.cos(yaw), math.sin(yaw)
        points = np.column_stack([(x + c * uu - s * vv).ravel(), (y + s * uu + c * vv).ravel()])
        free = (self.indoor.gaps(room, points) >= radius - 1e-6).reshape(uu.shape)
        number = np.full(uu.shape, -1)
        number[free] = np.arange(int(free.sum()))
        rows, columns, lengths = [], [], []
        for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
            here = number[: len(v) - dy, max(0, -dx) : len(u) - max(0, dx)]
            there = number[dy:, max(0, dx) : len(u) - max(0, -dx)]
            both = (here >= 0) & (there >= 0)
            rows.append(here[both])
            columns.append(there[both])
            lengths.append(np.full(int(both.sum()), _CELL * math.hypot(dx, dy)))
        count = int(free.sum())
        parts = [np.concatenate(part) for part in (lengths, rows, columns)]
        steps = coo_matrix((parts[0], (parts[1], parts[2])), shape=(count, count))
        return _Grid(points[free.ravel()], csr_matrix(steps + steps.T))

    # What stands in rooms.

    def solids(self, room: int) -> Bodies:
        """Return walls and furniture of a room as bodies, with numbers below 0; not to be written to."""
        if room not in self._solids:
            self._solids[room] = self._solids_of(room)
        return self._solids[room]

    def _solids_of(self, room: int) -> Bodies:
        x, y, yaw, a, b = self.indoor.boxes[room].tolist()
        z = float(self.indoor.floor[room])
        c, s = math.cos(yaw), math.sin(yaw)
        rows = [
            [x + c * u - s * v, y + s * u + c * v, z, yaw, half_u, half_v, _WALL_HEIGHT]
            for u, v, half_u, half_v in (
                (a + _WALL, 0.0, _WALL, b + 2 * _WALL),
                (-a - _WALL, 0.0, _WALL, b + 2 * _WALL),
                (0.0, b + _WALL, a, _WALL),
                (0.0, -b - _WALL, a, _WALL),
            )
        ]
        o = self.world.objects
        chosen = np.flatnonzero((o.room == self.room(room).id) & np.asarray(o.solid, bool))
        columns = (o.x, o.y, o.z, o.yaw, o.size_x / 2, o.size_y / 2, o.size_z)
        things = np.column_stack([np.asarray(column[chosen], np.float64) for column in columns]).reshape(-1, 7)
        table = np.vstack([np.array(rows), things])
        n = len(table)
        return Bodies(
            np.arange(-1, -n - 1, -1).astype(np.int32),
            np.full(n, FIXTURE, np.int8),
            table[:, :3].copy(),
            table[:, 3].copy(),
            table[:, 4].copy(),
            table[:, 5].copy(),
            table[:, 6].copy(),
            np.zeros((n, 2)),
        )


def _outside(points: Array, discs: Array) -> NDArray[np.bool_]:
    """Return which points lie in none of some discs (x, y, radius)."""
    if not len(discs):
        return np.ones(len(points), np.bool_)
    away = np.hypot(points[:, :1] - discs[:, 0], points[:, 1:2] - discs[:, 1])
    return np.asarray((away >= discs[:, 2]).all(axis=1))


def _nearest(points: Array, free: NDArray[np.bool_], to: Array) -> int:
    """Return which free point is nearest to one; -1 for none."""
    if not free.any():
        return -1
    away = np.hypot(*(points - np.asarray(to, np.float64)[:2]).T)
    away[~free] = np.inf
    return int(away.argmin())
