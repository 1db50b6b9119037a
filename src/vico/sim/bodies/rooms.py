"""Rooms as arrays: walls, furniture, doors, surfaces to put things on, and where in a room there is space.

The doors between rooms are kept as numbers: a city has half a million of them, and few are ever looked at.
`DoorLeaves` is the state of the doors of houses: those that are not closed, and how far each is open.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from vico.geometry import distances
from vico.io.compiled import compiled
from vico.io.memory import LruCache
from vico.sim.bodies.collisions import box_gap, gap_to, room_gap
from vico.sim.bodies.state_arrays import RADIUS
from vico.world.city_world import numbers_of
from vico.world.model import FLIGHT_STEPS, LANDING, Entrance, Place, Point3, Room
from vico.world.objects import Objects

# Rooms whose doors are kept as they were made.
_KEPT = 8192
_NONE = (np.nan, np.nan, np.nan)


@dataclass(frozen=True)
class Door:
    """A way out of a room: to the room with index `to`, or outdoors where `to` is -1.

    `inside` is the free spot of this room where people stand who come in by it; None in worlds that don't say.
    """

    to: int
    position: Point3
    inside: Point3 | None = None


class RoomDoors(Sequence[Sequence[Door]]):
    """The doors of each room.

    Parameters
    ----------
    rows
        Room, the room it leads to (-1: outdoors), position, spot inside (NaN: none): float64, shape ``(k, 8)``, in the
        order in which rooms list them.
    rooms
        How many there are.
    """

    def __init__(self, rows: NDArray[np.float64], rooms: int) -> None:
        order = np.argsort(rows[:, 0], kind="stable")
        self._to = rows[order, 1].astype(np.int32)
        self._spots = np.ascontiguousarray(rows[order, 2:])
        self._start = np.searchsorted(rows[order, 0], np.arange(rooms + 1))
        self._kept: LruCache[int, list[Door]] = LruCache(_KEPT)

    def __len__(self) -> int:
        return len(self._start) - 1

    @overload
    def __getitem__(self, room: int) -> list[Door]: ...

    @overload
    def __getitem__(self, room: slice) -> list[list[Door]]: ...

    def __getitem__(self, room: int | slice) -> list[Door] | list[list[Door]]:
        if isinstance(room, slice):
            return [self[k] for k in range(*room.indices(len(self)))]
        number = range(len(self))[int(room)]
        doors = self._kept.get(number)
        if doors is None:
            part = slice(*self._start[number : number + 2].tolist())
            both = zip(self._to[part].tolist(), self._spots[part].tolist(), strict=True)
            doors = [Door(to, (x, y, z), None if u != u else (u, v, w)) for to, (x, y, z, u, v, w) in both]
            self._kept.keep(number, doors)
        return doors


class DoorsListed:
    """Collects the ways out of rooms, which are told one by one.

    Where a room lists none, a place's first room leads outdoors by its own door, and a further room's door leads to
    those it links.

    Parameters
    ----------
    index
        Number of each room by its id.
    """

    def __init__(self, index: Mapping[str, int]) -> None:
        self._index = index
        self._rows = array("d")
        self._others: dict[int, Room] = {}

    def tell(self, number: int, room: Room) -> None:
        """Note a room's doors."""
        if not room.doors:
            self._others[number] = room
        for way in room.doors:
            to = self._index.get(way.to, -2) if way.to else -1
            if to >= -1:
                self._rows.extend((number, to, *way.position, *(way.inside or _NONE)))

    def doors(self, rooms: Sequence[Room], places: Iterable[Place]) -> RoomDoors:
        """Return the doors of all rooms."""
        rows = np.frombuffer(self._rows, np.float64).reshape(-1, 8) if self._rows else np.zeros((0, 8))
        if self._others:
            rows = np.concatenate([rows, self._doors_between(rooms, places)])
        return RoomDoors(rows, len(rooms))

    def _doors_between(self, rooms: Sequence[Room], places: Iterable[Place]) -> NDArray[np.float64]:
        """Return the doors of the rooms that list none."""
        found: dict[int, dict[int, Point3]] = {k: {} for k in self._others}
        rank = {}
        for place in places:
            for k, name in enumerate(place.rooms):
                rank[name] = k
                if k == 0 and self._index.get(name) in self._others:
                    found[self._index[name]][-1] = rooms[self._index[name]].door
        for i, room in self._others.items():
            for name in room.links:
                j = self._index.get(name)
                if j is None or j in found[i]:
                    continue
                # The doorway between two rooms is the door of the one further in.
                inner = i if rank.get(room.id, 0) > rank.get(name, 0) else j
                found[i][j] = rooms[inner].door
                if j in self._others:
                    found[j].setdefault(i, rooms[inner].door)
        rows = [(i, to, *position, *_NONE) for i, ways in found.items() for to, position in ways.items()]
        return np.array(rows, np.float64).reshape(-1, 8)


#: Metres between the middles of two who stand beside each other: a little more than touching, so that nobody starts in
#: a contact.
BESIDE = 2 * RADIUS + 0.05
#: Lists of free spots that are remembered, one a room and door.
_SPOTS_KEPT = 4096
_WAY_CELL = 0.1  # metres between the points by which ways in a room are found
# Where one wants to stand may be as narrow as can be; other spots of a room have so much more room, metres.
_NARROWER = 0.02
# Points at which a line beside a bed is looked at for furniture.
_SAMPLES = 16
_LEVEL = 0.5  # metres a door may lie above or below who goes through it
# Kinds of rooms in whose seats nobody sits down who finds another one: they would be in the way.
_PASSAGES = frozenset({"hall", "corridor"})


@dataclass(frozen=True)
class Indoor:
    """All rooms of a world, in the world's order.

    Attributes
    ----------
    boxes
        ``x, y, yaw, half length, half width`` of each floor, float64, shape ``(r, 5)``.
    floor
        Heights of the floors, metres, shape ``(r,)``.
    furniture, furniture_start
        Solid things as ``x, y, yaw, half length, half width``, shape ``(f, 5)``; those of room ``i`` are the rows
        ``furniture_start[i]`` up to ``furniture_start[i + 1]``.
    doors
        Ways out of each room.
    place
        Index of the place each room belongs to, -1 if it is not a place of this world.
    treads
        Depth of the treads of each room's stairs, metres, 0 where it has none; and last 0 for those who are in none,
        shape ``(r + 1,)``.
    climbs, is_passage
        Whether each room's floor climbs, and whether people only pass through it, bool, shape ``(r,)``.
    """

    rooms: Sequence[Room]
    index: Mapping[str, int]
    boxes: NDArray[np.float64]
    floor: NDArray[np.float64]
    furniture: NDArray[np.float64]
    furniture_start: NDArray[np.int64]
    doors: Sequence[Sequence[Door]]
    place: NDArray[np.int32]
    treads: NDArray[np.float64]
    climbs: NDArray[np.bool_]
    is_passage: NDArray[np.bool_]

    @classmethod
    def from_world(cls, rooms: Sequence[Room], places: Sequence[Place], objects: Objects) -> Indoor:
        """Pack the rooms, each of which is looked at once, and the solid objects that stand in them."""
        index = numbers_of(rooms)
        place_number = {place.id: i for i, place in enumerate(places)}
        boxes, floor, treads = np.zeros((len(rooms), 5)), np.zeros(len(rooms)), np.zeros(len(rooms) + 1)
        climbs, is_passage = (np.zeros(len(rooms), np.bool_) for _ in range(2))
        place, doors = np.full(len(rooms), -1, np.int32), DoorsListed(index)
        for i, room in enumerate(rooms):
            boxes[i] = *room.centre[:2], room.yaw, room.size[0] / 2, room.size[1] / 2
            floor[i], place[i] = room.centre[2], place_number.get(room.place, -1)
            climbs[i], is_passage[i] = bool(room.rise), room.kind in _PASSAGES
            treads[i] = (room.size[0] - 2 * LANDING) / FLIGHT_STEPS if room.rise else 0.0
            doors.tell(i, room)
        furniture, start = _furniture(objects, index, len(rooms))
        ways = doors.doors(rooms, places)
        return cls(rooms, index, boxes, floor, furniture, start, ways, place, treads, climbs, is_passage)

    def floor_at(self, room: int, xy: ArrayLike) -> float:
        """Height of a room's floor at a point, metres: on stairs it depends on where one stands."""
        if room not in self.stairs:
            return float(self.floor[room])
        x, y = np.asarray(xy, np.float64)[:2]
        return self.rooms[room].floor_at(float(x), float(y))

    def floors_at(self, rooms: NDArray[np.int32], xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Heights of the floors under several people, metres, shape ``(n,)``."""
        heights: NDArray[np.float64] = self.floor[rooms]
        for k in np.flatnonzero(self.climbs[rooms]):
            heights[k] = self.floor_at(int(rooms[k]), xy[k])
        return heights

    def treads_under(self, rooms: NDArray[np.int32]) -> NDArray[np.float64]:
        """Depth of the treads of the stairs that several people are on, metres, shape ``(n,)``; 0 elsewhere."""
        return self.treads[rooms]

    @cached_property
    def stairs(self) -> frozenset[int]:
        """Rooms whose floor climbs."""
        return frozenset(np.flatnonzero(self.climbs).tolist())

    def arrival(self, room: int, origin: int) -> NDArray[np.float64]:
        """Where people stand who come into a room from another one (-1: from outdoors), ENU metres."""
        record = self.rooms[room]
        door = next((d for d in self.doors[room] if d.to == origin), None)
        return np.asarray(record.inside if door is None or door.inside is None else door.inside, np.float64)

    def gap(self, room: int, xy: NDArray[np.float64] | tuple[float, float]) -> float:
        """Free room around a point of a room, metres: to the nearest wall or piece of furniture; negative in one."""
        return float(self.gaps(room, np.array([[float(xy[0]), float(xy[1])]]))[0])

    def gaps(self, room: int, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Free room around points of a room, ENU metres, shape ``(k, 2)``: as `gap` has it, shape ``(k,)``."""
        furniture = self.furniture[self.furniture_start[room] : self.furniture_start[room + 1]]
        found: NDArray[np.float64] = _free_room(np.ascontiguousarray(points), self.boxes[room], furniture)
        return found

    def are_connected(self, room: int, spots: ArrayLike, *, within: float) -> bool:
        """Return whether a person can walk between some spots of a room, shape ``(k, >= 2)``.

        Only ways are looked for that leave the square around the spots by no more than `within` metres.
        """
        goals = np.asarray(spots, np.float64)[:, :2]
        x, y = (
            np.arange(low - within, high + within + _WAY_CELL, _WAY_CELL)
            for low, high in zip(goals.min(axis=0), goals.max(axis=0), strict=True)
        )
        points = np.stack(np.meshgrid(x, y), axis=-1)
        free = (self.gaps(room, points.reshape(-1, 2)) > RADIUS).reshape(points.shape[:2])
        part = ndimage.label(free, np.ones((3, 3)))[0][free]
        away = np.hypot(*(goals[:, None] - points[free]).transpose(2, 0, 1))
        return away.shape[1] > 0 and len(set(part[away.argmin(axis=1)].tolist())) == 1

    def walked_from_doors(self, room: int, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which points of a room, shape ``(k, >= 2)``, one can walk to from a door of it, shape ``(k,)``."""
        x, y, yaw, half_length, half_width = self.boxes[room]
        c, s = np.cos(yaw), np.sin(yaw)
        dx, dy = points[:, 0] - x, points[:, 1] - y
        cells = np.column_stack([c * dx + s * dy + half_length, c * dy - s * dx + half_width]) / _WAY_CELL
        area = self._areas.get(room)
        if area is None:
            area = self._areas[room] = self._area_of_doors(room)
        u, v = np.clip(np.rint(cells).astype(np.int64), 0, np.array(area.shape) - 1).T
        return area[u, v]

    @cached_property
    def _areas(self) -> dict[int, NDArray[np.bool_]]:
        """Of the rooms that were asked for: `_area_of_doors`."""
        return {}

    def _area_of_doors(self, room: int) -> NDArray[np.bool_]:
        """Return the cells of a room's floor, along its length and width, that are by where one walks from a door."""
        x, y, yaw, half_length, half_width = self.boxes[room]
        u = np.arange(0.0, 2 * half_length + _WAY_CELL, _WAY_CELL) - half_length
        v = np.arange(0.0, 2 * half_width + _WAY_CELL, _WAY_CELL) - half_width
        c, s = np.cos(yaw), np.sin(yaw)
        points = np.stack([x + c * u[:, None] - s * v, y + s * u[:, None] + c * v], axis=-1)
        free = (self.gaps(room, points.reshape(-1, 2)) > RADIUS + _NARROWER).reshape(len(u), len(v))
        parts = ndimage.label(free)[0]
        inside = [door.inside or self.rooms[room].inside for door in self.doors[room]] or [self.rooms[room].inside]
        doors = np.array(inside)[:, None, None, :2]
        nearest = np.where(free, np.hypot(*np.moveaxis(points - doors, -1, 0)), np.inf).reshape(len(inside), -1)
        homes = np.unique(parts.reshape(-1)[nearest.argmin(axis=1)])
        # A spot beside a wall lies between cells: the one nearest to it may be a little too near to the wall.
        return ndimage.binary_dilation(np.isin(parts, homes[homes > 0]), np.ones((3, 3)))

    def free_spot(
        self,
        room: int,
        near: ArrayLike,
        taken: NDArray[np.float64],
        *,
        from_door: bool = False,
        beside: NDArray[np.float64] | None = None,
        apart: float = BESIDE,
    ) -> NDArray[np.float64] | None:
        """Spot of a room nearest to `near` where someone can stand; None if the room is full.

        Parameters
        ----------
        taken
            Where others stand in that room, shape ``(k, >= 2)``.
        from_door
            Only spots that one can walk to from a door.
        beside
            A point of furniture, shape ``(2,)``: only spots with no other furniture between them and it.
        apart
            So far from others, metres, middle to middle, if there is such a spot; else as near as without touching.

        Returns
        -------
        ndarray or None
            On the floor, ENU metres, shape ``(3,)``.
        """
        point = np.asarray(near, np.float64).reshape(-1)[:2]
        is_open = not len(taken) and beside is None and room not in self.stairs
        is_free = is_open and self.gap(room, point) + _NARROWER >= RADIUS + 0.02
        if is_free and (not from_door or bool(self.walked_from_doors(room, point[None])[0])):
            return np.array([*point, self.floor[room]])
        spots = self._spots(room, point)
        if from_door and len(spots):
            spots = spots[self.walked_from_doors(room, spots)]
        if beside is not None and len(spots):
            spots = spots[self._nothing_between(room, spots, beside)]
        if not len(taken) or not len(spots):
            return spots[0].copy() if len(spots) else None
        away = np.hypot(*(spots[:, None, :2] - taken[None, :, :2]).transpose(2, 0, 1)).min(axis=1)
        for least in (apart, BESIDE):
            free = np.flatnonzero(away >= least)
            if len(free):
                return spots[free[0]].copy()
        return None

    def _nothing_between(self, room: int, spots: NDArray[np.float64], point: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return from which spots no furniture is in the way to a point, but what is at that point; shape ``(k,)``."""
        furniture = self.furniture[self.furniture_start[room] : self.furniture_start[room + 1]]
        here = np.array([gap_to(point[0], point[1], row) for row in furniture])
        lines = spots[:, None, :2] + np.linspace(0.0, 1.0, _SAMPLES)[:, None] * (point - spots[:, None, :2])
        gaps = _free_room(lines.reshape(-1, 2), self.boxes[room], furniture[here > 0.0])
        return np.asarray((gaps.reshape(-1, _SAMPLES) > 0.0).all(axis=1))

    def _spots(self, room: int, near: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where someone can stand in an empty room, ENU metres, shape ``(k, 3)``, the nearest to a point first."""
        key = (room, float(near[0]), float(near[1]))
        if key not in self._known_spots:
            if len(self._known_spots) >= _SPOTS_KEPT:
                self._known_spots.clear()
            self._known_spots[key] = self._find_spots(room, near)
        return self._known_spots[key]

    @cached_property
    def _known_spots(self) -> dict[tuple[int, float, float], NDArray[np.float64]]:
        """People come in by doors: the same few points are asked for again and again."""
        return {}

    def _find_spots(self, room: int, near: NDArray[np.float64]) -> NDArray[np.float64]:
        x, y, yaw, half_length, half_width = self.boxes[room]
        u = np.arange(-half_length + RADIUS + 0.02, half_length - RADIUS, 0.2)
        v = np.arange(-half_width + RADIUS + 0.02, half_width - RADIUS, 0.2)
        grid = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
        c, s = np.cos(yaw), np.sin(yaw)
        spots = np.column_stack([x + c * grid[:, 0] - s * grid[:, 1], y + s * grid[:, 0] + c * grid[:, 1]])
        spots = np.vstack([near[None], spots])
        gap = self.gaps(room, spots)
        gap[0] += _NARROWER
        spots = spots[gap >= RADIUS + 0.02]
        spots = spots[np.argsort(distances(spots, near), kind="stable")]
        if room not in self.stairs:
            return np.column_stack([spots, np.full(len(spots), self.floor[room])])
        # On stairs the other flight may be near, and yet a floor away.
        level = np.array([self.floor_at(room, spot) for spot in spots]).reshape(-1)
        return np.column_stack([spots, level])[np.abs(level - self.floor_at(room, near)) <= 0.6]

    def holds(self, room: int, point: Sequence[float]) -> bool:
        """Whether a point lies in the room's box."""
        box = self.boxes[room]
        z = float(point[2]) - self.floor_at(room, point[:2])
        height = self.rooms[room].size[2]
        return float(room_gap(float(point[0]), float(point[1]), box)) >= 0.0 and -0.1 <= z <= height

    def support(self, room: int, xy: Sequence[float]) -> float:
        """Height of what a thing put down at a point of a room comes to lie on: the highest surface there."""
        return float(self.resting_point(room, xy, 0.0)[2])

    def resting_point(self, room: int, xy: Sequence[float], radius: float) -> NDArray[np.float64]:
        """Where a thing comes to rest that is put down at a point of a room, ENU metres, shape ``(3,)``.

        On the highest surface there, drawn in from its edges by `radius`, so that it hangs over none; in the middle of
        a surface that is smaller.
        """
        spot = np.array([float(xy[0]), float(xy[1]), self.floor_at(room, xy)])
        for container in self.rooms[room].containers:
            x, y, z = container.centre
            inside = box_gap(
                float(xy[0]), float(xy[1]), x, y, container.yaw, container.size[0] / 2, container.size[1] / 2
            )
            if inside <= 0.0 and z > spot[2]:
                c, s = math.cos(container.yaw), math.sin(container.yaw)
                dx, dy = float(xy[0]) - x, float(xy[1]) - y
                u, v = (
                    min(max(way, radius - half), half - radius) if radius < half else 0.0
                    for way, half in zip((c * dx + s * dy, c * dy - s * dx), np.array(container.size) / 2, strict=True)
                )
                spot = np.array([x + c * u - s * v, y + s * u + c * v, z])
        return spot


@compiled
def _free_room(points, box, furniture):
    """Distance from points of a room to the nearest wall or piece of furniture, metres; negative in one."""
    out = np.empty(len(points))
    for k in range(len(points)):
        x, y = points[k, 0], points[k, 1]
        gap = room_gap(x, y, box)
        for f in range(len(furniture)):
            gap = min(gap, gap_to(x, y, furniture[f]))
        out[k] = gap
    return out


def _furniture(objects: Objects, index: Mapping[str, int], rooms: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the outlines of the solid things in rooms, room by room, and where those of each room begin."""
    inside = np.flatnonzero(np.asarray(objects.solid, bool) & (objects.room != ""))
    room = np.array([index.get(name, -1) for name in objects.room[inside].tolist()], np.int64)
    inside, room = inside[room >= 0], room[room >= 0]
    order = np.argsort(room, kind="stable")
    inside = inside[order]
    columns = objects.x, objects.y, objects.yaw, objects.size_x / 2, objects.size_y / 2
    rows = np.column_stack([column[inside] for column in columns]).astype(np.float64)
    return rows, np.searchsorted(room[order], np.arange(rooms + 1)).astype(np.int64)


def entrance_of(place: Place, entrances: dict[str, Entrance]) -> Entrance | None:
    """Return the door people use for a place; None for open places."""
    return entrances.get(place.entrance) if place.entrance else None


def near_door(position: NDArray[Any], door: Door, reach: float) -> bool:
    """Whether someone stands within `reach` metres of a door, measured on the floor, and on the door's level."""
    return bool(doors_near(position, (door,), reach))


def doors_near(position: NDArray[Any], doors: Sequence[Door], reach: float) -> list[Door]:
    """Return the doors that someone stands within `reach` metres of, measured on the floor, and on the doors' level."""
    x, y, z = position.tolist()
    return [
        door
        for door in doors
        if abs(z - door.position[2]) <= _LEVEL and math.hypot(x - door.position[0], y - door.position[1]) <= reach
    ]


#: Seconds that a door takes to open or to close.
SWING = 0.6


class DoorLeaves:
    """The doors of a world that are not closed; all the others are.

    Attributes
    ----------
    entrance
        Row of each in ``world.entrances``, ascending, int32, shape ``(n,)``.
    share
        How far it is open, 0..1, float64, shape ``(n,)``.
    held
        Seconds for which it is still held open, float64, shape ``(n,)``; then it closes.
    """

    def __init__(self) -> None:
        self.entrance = np.zeros(0, np.int32)
        self.share = np.zeros(0)
        self.held = np.zeros(0)

    def __len__(self) -> int:
        return len(self.entrance)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Every array by name."""
        return {"entrance": self.entrance, "share": self.share, "held": self.held}

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held."""
        self.entrance, self.share, self.held = (np.array(arrays[name]) for name in ("entrance", "share", "held"))

    def hold(self, entrance: int, seconds: float) -> None:
        """Have a door open, or stay open, for some seconds."""
        k = int(np.searchsorted(self.entrance, entrance))
        if k == len(self) or self.entrance[k] != entrance:
            self.entrance = np.insert(self.entrance, k, entrance).astype(np.int32)
            self.share, self.held = np.insert(self.share, k, 0.0), np.insert(self.held, k, 0.0)
        self.held[k] = max(float(self.held[k]), seconds)

    def share_of(self, entrance: int) -> float:
        """Return how far a door is open, 0..1."""
        k = int(np.searchsorted(self.entrance, entrance))
        return float(self.share[k]) if k < len(self) and self.entrance[k] == entrance else 0.0

    def advance(self, dt: float) -> None:
        """Open and close doors for `dt` seconds."""
        if not len(self):
            return
        way = np.where(self.held > 1e-6, dt, -dt) / SWING
        self.share = np.clip(self.share + way, 0.0, 1.0)
        self.held = np.maximum(self.held - dt, 0.0)
        there = (self.share > 1e-6) | (self.held > 1e-6)
        if not there.all():
            self.entrance, self.share, self.held = self.entrance[there], self.share[there], self.held[there]
