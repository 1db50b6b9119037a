"""Path planning of robots in rooms and in the air.

In rooms: where a robot fits, paths round furniture, and which door is next. In the air: what stands how high in a
world, and paths over it or round it. Paths outdoors on the ground are in `vico.sim.robots.trips`.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import dijkstra

from vico.assets.robots import RobotModel
from vico.geometry import distance, distances
from vico.io.compiled import compiled
from vico.sim.bodies.arrays import FIXTURE, Bodies
from vico.sim.bodies.rooms import Indoor
from vico.world.model import Entrance, Room
from vico.world.routing import Router
from vico.world.walkable import BLOCKED, CROSSING, ROADWAY, SIDEWALK, WalkableMap
from vico.world.world import World

Array = NDArray[np.float64]

#: Outdoors, where the number of a room is asked for.
OUTDOORS = -1
#: Metres between two points that ways are made of.
_ROOM_CELL = 0.15
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
_FURNITURE_GAP = 0.03
_NOBODY = np.zeros((0, 3))


def turning_radius(model: RobotModel) -> float:
    """Return how much room a robot needs around its middle to turn anywhere, metres."""
    square = abs(model.half_length - model.half_width) < 0.01
    return _FURNITURE_GAP + (model.half_width + 0.05 if square else math.hypot(model.half_length, model.half_width))


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
        return self._straighten(points, room, radius, closed)

    def spot(self, room: int, near: Array, radius: float, closed: Array, within: float) -> Array | None:
        """Return the nearest point to a point where a robot has room, clear of discs, shape ``(2,)``; None for none."""
        grid = self._grid(room, radius)
        k = _nearest(grid.points, _outside(grid.points, closed), near)
        if k < 0 or math.dist(grid.points[k], np.asarray(near)[:2]) > within:
            return None
        return np.array(grid.points[k])

    def _straighten(self, points: Array, room: int, radius: float, closed: Array) -> Array:
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
        u = np.arange(-a + radius, a - radius + 1e-9, _ROOM_CELL)
        v = np.arange(-b + radius, b - radius + 1e-9, _ROOM_CELL)
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
            lengths.append(np.full(int(both.sum()), _ROOM_CELL * math.hypot(dx, dy)))
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
        yaw, half_length, half_width, height = (column.copy() for column in table[:, 3:].T)
        return Bodies(
            np.arange(-1, -n - 1, -1).astype(np.int32),
            np.full(n, FIXTURE, np.int8),
            table[:, :3].copy(),
            yaw,
            half_length,
            half_width,
            height,
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


_CELL = 0.5
# Rows of cells whose ground is looked up at once.
_ROWS = 256
OVER = 3.0  # m kept above what is flown over
BESIDE = 2.0  # m kept beside what is flown past
HOVER = 0.8  # m between a robot that hovers and anything else
#: Highest above ground: where most countries end the air that anybody may fly in.
CEILING = 120.0
# Metres by which a spot to land on may be uneven, and within which it has to be even: wind moves who comes down, into a
# wall or off an edge.
_UNEVEN, _SPOT = 0.25, 1.0
# Metres from roadways and crossings at which who rests is in nobody's way.
_KERBSIDE = 1.0
# Metres above where it begins that things may be which do not keep it from going straight up, and above ground.
_OVERHEAD, _LOW = 0.3, 1.0
# Where it goes first then.
_LEAD = 1.5  # m above ground
_ALONG = 0.3  # m beside its way there that have to be free
_MOST_SPOTS = 400  # of the nearest places are looked at
# Cells of the map on which ways round things are found, in cells of this one.
_COARSE = 4
# Speeds by which ways are compared, m/s: sideways, up and down.
_SPEEDS = (6.0, 3.0, 1.5)


@compiled
def _raise_triangles(tops, half, corners):
    """Raise all cells that triangles may cover to their heights there."""
    n = len(tops)
    for t in range(len(corners)):
        c = corners[t]
        low_x, high_x = min(c[0, 0], c[1, 0], c[2, 0]), max(c[0, 0], c[1, 0], c[2, 0])
        low_y, high_y = min(c[0, 1], c[1, 1], c[2, 1]), max(c[0, 1], c[1, 1], c[2, 1])
        low_z, high_z = min(c[0, 2], c[1, 2], c[2, 2]), max(c[0, 2], c[1, 2], c[2, 2])
        ux, uy, uz = c[1, 0] - c[0, 0], c[1, 1] - c[0, 1], c[1, 2] - c[0, 2]
        vx, vy, vz = c[2, 0] - c[0, 0], c[2, 1] - c[0, 1], c[2, 2] - c[0, 2]
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        for row in range(max(int((low_y + half) / _CELL), 0), min(int((high_y + half) / _CELL), n - 1) + 1):
            y = (row + 0.5) * _CELL - half
            for column in range(max(int((low_x + half) / _CELL), 0), min(int((high_x + half) / _CELL), n - 1) + 1):
                x = (column + 0.5) * _CELL - half
                # Outside of an edge by more than half a cell's diagonal.
                outside = False
                for k in range(3):
                    a, b = c[k], c[(k + 1) % 3]
                    ex, ey = b[0] - a[0], b[1] - a[1]
                    size = math.hypot(ex, ey)
                    side = (ex * (y - a[1]) - ey * (x - a[0])) * (1.0 if nz >= 0.0 else -1.0)
                    outside = outside or (size > 1e-9 and side < -0.71 * _CELL * size)
                if outside:
                    continue
                z = high_z
                if abs(nz) > 1e-3 * (abs(nx) + abs(ny) + abs(nz)):
                    slope = (abs(nx) + abs(ny)) / abs(nz)
                    z = c[0, 2] - (nx * (x - c[0, 0]) + ny * (y - c[0, 1])) / nz + 0.5 * _CELL * slope
                    z = min(max(z, low_z), high_z)
                tops[row, column] = max(tops[row, column], z)


def _corners(world: World, layers: tuple[str, ...]) -> Iterator[Array]:
    """Yield the corners of the triangles of each surface of some layers, shape ``(k, 3, 3)``."""
    for layer in layers:
        for surface in world.surfaces(layer):
            if len(surface.triangles):
                yield surface.positions[surface.triangles].astype(np.float64)


class Airspace:
    """Heights of everything that stands in a world, and ways over it or round it.

    Parameters
    ----------
    world
        Where.

    Attributes
    ----------
    tops
        How high anything reaches in each cell of half a metre, ENU metres, float64, shape ``(n, n)``, row = y.
    solid
        The same of ground and collision bodies alone.
    """

    def __init__(self, world: World) -> None:
        self.half, self.ground, self._walkable = float(world.half), world.height, world.walkable
        self._floor = self._heights()
        self.solid = self._floor.copy()
        for part in world.parts():
            for corners in _corners(part, ("collision",)):
                _raise_triangles(self.solid, self.half, corners)
        self.tops = self.solid.copy()
        for part in world.parts():
            self._raise(part)
        self._highest = float(self.tops.max())

    def _raise(self, world: World) -> None:
        """Raise the tops of cells to what is seen in a world, or in a part of it."""
        for corners in _corners(world, ("buildings", "roofs")):
            _raise_triangles(self.tops, self.half, corners)
        objects = world.objects.where(world.objects.outdoors)
        for x, y, z, a, b in zip(
            objects.x.tolist(),
            objects.y.tolist(),
            (objects.z + objects.size_z).tolist(),
            (objects.size_x / 2).tolist(),
            (objects.size_y / 2).tolist(),
            strict=True,
        ):
            part = self._window(x, y, math.hypot(a, b) if abs(a - b) > 0.05 * a else a)
            self.tops[part] = np.maximum(self.tops[part], z)

    # Heights.

    def _heights(self) -> Array:
        """Return the height of the ground at the middle of each cell; of a city some rows at once."""
        n = round(2 * self.half / _CELL)
        axis, found = (np.arange(n) + 0.5) * _CELL - self.half, np.empty((n, n))
        for rows in range(0, n, _ROWS):
            x, y = np.meshgrid(axis, axis[rows : rows + _ROWS])
            found[rows : rows + _ROWS] = self.ground(np.stack([x, y], axis=-1))
        return found

    def _window(self, x: float, y: float, reach: float) -> tuple[slice, slice]:
        low = np.floor((np.array([y, x]) - reach + self.half) / _CELL).astype(int)
        high = np.floor((np.array([y, x]) + reach + self.half) / _CELL).astype(int) + 1
        rows, columns = np.clip(np.stack([low, high], axis=1), 0, len(self.tops)).tolist()
        return slice(*rows), slice(*columns)

    def inside(self, xy: ArrayLike) -> bool:
        """Return whether a point lies in the world, with room to fly."""
        return bool(np.all(np.abs(np.asarray(xy, np.float64)[:2]) < self.half - BESIDE))

    def top(self, xy: ArrayLike, reach: float = HOVER) -> float:
        """How high anything reaches within so many metres of a point, ENU metres."""
        x, y = (float(v) for v in np.asarray(xy, np.float64)[:2])
        around = self.tops[self._window(x, y, reach)]
        return float(around.max()) if around.size else self._highest

    def highest(self, start: ArrayLike, end: ArrayLike, beside: float = BESIDE) -> float:
        """How high anything reaches along a straight line and so far beside it, ENU metres."""
        a, b = np.asarray(start, np.float64)[:2], np.asarray(end, np.float64)[:2]
        away = distance(b, a)
        shares = np.linspace(0.0, 1.0, max(2, math.ceil(away / max(beside, _CELL)) + 1))
        return max(self.top(a + share * (b - a), 1.2 * beside) for share in shares.tolist())

    def is_clear(self, start: Array, end: Array) -> bool:
        """Return whether a straight line keeps clear of everything, above and beside it."""
        away = float(np.linalg.norm(end - start))
        shares = np.linspace(0.0, 1.0, max(2, math.ceil(away / 1.0) + 1))
        points = start + shares[:, None] * (end - start)
        return all(self.top(point, BESIDE) + OVER / 2 <= point[2] for point in points)

    @cached_property
    def flat(self) -> NDArray[np.bool_]:
        """Where one can land: it is even, and what is seen there is solid; shape ``(n, n)``."""
        reach, n = round(_SPOT / _CELL), len(self.tops)
        flat = np.empty(self.tops.shape, np.bool_)
        for first in range(0, n, _ROWS):
            rows = slice(first, min(first + _ROWS, n))
            around = self.tops[max(first - reach, 0) : rows.stop + reach]
            size, before = 2 * reach + 1, min(first, reach)
            rough = ndimage.maximum_filter(around, size) - ndimage.minimum_filter(around, size)
            uneven = rough[before : before + rows.stop - first] >= _UNEVEN
            flat[rows] = ~uneven & (np.abs(self.tops[rows] - self.solid[rows]) < 0.05)
        margin = math.ceil(BESIDE / _CELL)
        flat[:margin] = flat[-margin:] = flat[:, :margin] = flat[:, -margin:] = False
        return flat

    def is_flat(self, xy: ArrayLike) -> bool:
        """Return whether one can land at a point."""
        if not self.inside(xy):
            return False
        column, row = np.floor((np.asarray(xy, np.float64)[:2] + self.half) / _CELL).astype(int)
        return bool(self.flat[row, column])

    @cached_property
    def off_streets(self) -> NDArray[np.bool_]:
        """Where one can land and stay in nobody's way: not on roadways and crossings; shape ``(n, n)``."""
        axis = (np.arange(len(self.flat)) + 0.5) * _CELL - self.half
        cells = self._walkable.cell_of(np.stack([axis, axis], axis=1))
        street = np.isin(self._walkable.cls, (ROADWAY, CROSSING))[np.ix_(cells[:, 1], cells[:, 0])]
        return self.flat & ~ndimage.binary_dilation(street, iterations=math.ceil(_KERBSIDE / _CELL))

    def flat_near(self, xy: ArrayLike) -> Array | None:
        """Return the nearest spot to land on, ENU metres, shape ``(2,)``; None if there is none in the world.

        Where vehicles drive and people cross only if there is no other near.
        """
        point, everywhere = np.asarray(xy, np.float64)[:2], 2.0 * self.half
        for cells, reach in ((self.off_streets, 30.0), (self.flat, 30.0), (self.off_streets, everywhere)):
            spots = self._spots(cells, point, reach)
            if len(spots):
                return np.asarray(spots[0])
        return None

    def level_ground_near(self, xy: ArrayLike, reach: float) -> Array:
        """Return spots of even ground off streets, under the open sky, the nearest first, ENU metres, ``(n, 2)``."""
        inner = self.half - BESIDE
        point = np.clip(np.asarray(xy, np.float64)[:2], -inner, inner)
        return self._spots(self.off_streets & (self.tops - self._floor < 0.1), point, reach)

    def _spots(self, cells: NDArray[np.bool_], point: Array, reach: float) -> Array:
        """Return middles of cells within reach of a point, the nearest first, shape ``(n, 2)``."""
        rows, columns = self._window(float(point[0]), float(point[1]), reach)
        found = np.argwhere(cells[rows, columns])
        spots = (found[:, ::-1] + [columns.start, rows.start] + 0.5) * _CELL - self.half
        away = distances(spots, point)
        order = np.argsort(away, kind="stable")
        found_spots: Array = spots[order[away[order] <= reach]]
        return found_spots

    # Ways.

    def refusal(self, target: Array) -> str:
        """Why nobody can fly to a point; "" if one can."""
        if not self.inside(target):
            return "that is outside of the world, or at its very edge"
        top, ceiling = self.top(target), float(self.ground(target)) + CEILING
        if target[2] < top + HOVER:
            return f"{target[2]:.1f} m is in or less than {HOVER:g} m above what is there, which reaches {top:.1f} m"
        if target[2] > ceiling:
            return f"{target[2]:.1f} m is higher than {CEILING:g} m above the ground there"
        return ""

    def route(self, start: Array, target: Array) -> Array:
        """Return the faster of the ways over what stands between two points and round it.

        Returns
        -------
        ndarray
            Corners, from the first one that is not `start` to `target`, ENU metres, shape ``(k, 3)``.
        """
        if self.is_clear(start, target):
            return target[None].copy()
        lead = self._out_from_under(start)
        begin = lead[-1] if len(lead) else start
        over = self._over(begin, target)
        around = self._around(begin, target)
        ways = [way for way in (over, around) if way is not None]
        best = min(ways, key=lambda way: _duration(np.vstack([begin, way])))
        return np.vstack([lead, best])

    def _out_from_under(self, start: Array) -> Array:
        """Return where to go first when something is overhead, or a wall beside it: a place near open to the sky."""
        rows, columns = self._window(float(start[0]), float(start[1]), 20.0)
        floor, tops = self._floor[rows, columns], self.tops[rows, columns]
        for beside in (BESIDE, _CELL):
            if self.top(start, beside) <= start[2] + _OVERHEAD:
                return np.zeros((0, 3))
            around = ndimage.maximum_filter(tops, 2 * round(beside / _CELL) + 1)
            found = np.argwhere(around <= np.maximum(floor + _LOW, start[2] + _OVERHEAD))
            spots = (found[:, ::-1] + [columns.start, rows.start] + 0.5) * _CELL - self.half
            order = np.argsort(distances(spots, start[:2]), kind="stable")
            for spot in spots[order[:_MOST_SPOTS]]:
                height = max(start[2], float(self.ground(spot)) + _LEAD)
                if self.highest(start, spot, _ALONG) <= height - _OVERHEAD:
                    return np.array([[*spot, height]])
        return np.zeros((0, 3))

    def _over(self, start: Array, target: Array) -> Array:
        height = max(self.highest(start, target) + OVER, start[2], target[2])
        return np.array([[*start[:2], height], [*target[:2], height], target])

    def _around(self, start: Array, target: Array) -> Array | None:
        height = max(start[2], target[2], self.top(start) + OVER, self.top(target) + OVER)
        n = len(self.tops) // _COARSE * _COARSE
        coarse = self.tops[:n, :n].reshape(n // _COARSE, _COARSE, n // _COARSE, _COARSE).max(axis=(1, 3))
        free = ndimage.maximum_filter(coarse, 3) + OVER / 2 <= height
        kinds = np.where(free, SIDEWALK, BLOCKED).astype(np.uint8)
        cell = _CELL * _COARSE
        grid = WalkableMap(kinds, n * _CELL / 2, cell)
        shift = n * _CELL / 2 - self.half  # of a side that is no multiple of a coarse cell
        path = Router(grid).path(start[:2] - shift, target[:2] - shift)
        if path is None:
            return None
        path = path + shift
        if distance(path[-1], target[:2]) > 2 * cell:
            return None
        middle = np.column_stack([path, np.full(len(path), height)])
        return np.vstack([[*start[:2], height], middle, [*target[:2], height], target])


def _duration(way: Array) -> float:
    """Seconds that a way takes."""
    steps = np.diff(way, axis=0)
    level = np.hypot(steps[:, 0], steps[:, 1]) / _SPEEDS[0]
    rise = np.where(steps[:, 2] > 0.0, steps[:, 2] / _SPEEDS[1], -steps[:, 2] / _SPEEDS[2])
    return float(np.maximum(level, rise).sum())
