"""Seats, beds and tills: where people sit and lie, one person a place, and where they stand in line.

A seat has a spot before it where one stands who gets up. A till has a line of spots before it, and a spot behind it
for who serves; `Lines` is the state: who waits at which till, and who is served next.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.assets.models.model import Model, Seat
from vico.geometry import distances
from vico.rules import REACH
from vico.sim.bodies.rooms import Indoor
from vico.sim.bodies.state_arrays import RADIUS, ArrayState
from vico.world.heights import HeightField
from vico.world.model import Category, Place
from vico.world.objects import Objects

#: A seat that is further up or down than this is on another level, metres.
_LEVEL = 0.6
#: Who gets up stands so far before the hips, metres.
STEP_OFF = 0.55
#: A bed's edge may be this much nearer than the hips of whoever lies in it, metres.
_HALF_BED = 1.2
#: Who walks to where one stands before a seat stops so much short of it, metres.
_SHORT = 0.3
#: Outdoors, benches so near are found, metres.
_BENCH = 15.0
#: Rooms that are looked through for a seat, and seats of a room that are tried for a way to them.
_ROOMS, _TRIED = 24, 6


class Rest(NamedTuple):
    """A free seat or bed, or the way to one.

    Attributes
    ----------
    entity
        Of the seat.
    door
        Id of the next room on the way; empty where it is in this one.
    stand
        Where one stands before it, ENU metres; the door's position where it is in another room.
    """

    entity: int
    door: str
    stand: tuple[float, float, float]


class Rests(Mapping[str, "dict[str, Any] | None"]):
    """The nearest free seat (``sit``) and bed (``lie``), or None; looked for when somebody asks.

    Parameters
    ----------
    find
        Finds a seat (False) or a bed (True).
    """

    def __init__(self, find: Callable[[bool], Rest | None]) -> None:
        self._find = find
        self._found: dict[str, dict[str, Any] | None] = {}

    def __getitem__(self, name: str) -> dict[str, Any] | None:
        """Return a rest as plain data."""
        if name not in ("sit", "lie"):
            raise KeyError(name)
        if name not in self._found:
            rest = self._find(name == "lie")
            self._found[name] = None if rest is None else rest._asdict()
        return self._found[name]

    def __iter__(self) -> Iterator[str]:
        """Yield both names."""
        return iter(("sit", "lie"))

    def __len__(self) -> int:
        """Return 2."""
        return 2

    def __reduce__(self) -> tuple[type, tuple[Any, ...]]:
        """Be sent to another process as a dict of both: a way to find them cannot be sent."""
        return dict, (dict(self),)


@dataclass(frozen=True)
class Seats:
    """All places of a world where somebody can sit or lie, by room; outdoors (room -1) first.

    Attributes
    ----------
    entity
        The thing one sits on, int32, shape ``(m,)``: a sofa has several places.
    lies
        Whether one lies there, bool, shape ``(m,)``.
    position
        Where the hips are, on the seat, ENU metres, float64, shape ``(m, 3)``.
    floor
        Height of the floor or the ground there, metres, shape ``(m,)``.
    yaw
        Where one looks, radians counter-clockwise from east, shape ``(m,)``; who lies has the head the other way.
    room
        Index of the room, -1 outdoors, ascending, int32, shape ``(m,)``.
    """

    entity: NDArray[np.int32]
    lies: NDArray[np.bool_]
    position: NDArray[np.float64]
    floor: NDArray[np.float64]
    yaw: NDArray[np.float64]
    room: NDArray[np.int32]

    @classmethod
    def of(cls, objects: Objects, models: Mapping[str, Model], indoor: Indoor, ground: HeightField) -> Seats:
        """Find the seats among a world's things; those of models nobody knows are none."""
        # A city has millions of things: only those that may be seats are looked for.
        seats = {name: model.seat for name, model in models.items() if model.seat is not None}
        lots = [_places_of(objects, name, seats[name]) for name in np.unique(objects.prototype) if name in seats]
        rows = np.concatenate([np.zeros((0, 6)), *lots])
        # The number of a row's object: seats of one room stay in the objects' order.
        owner = rows[:, 0].astype(np.int64)
        room = np.array([indoor.index.get(str(name), -1) for name in objects.room[owner]], np.int32)
        order = np.lexsort((np.arange(len(rows)), owner, room))
        rows, owner, room = rows[order], owner[order], room[order]
        floor = np.zeros(len(rows))
        outdoors = room < 0
        floor[outdoors] = ground(rows[outdoors, 1:3]) if outdoors.any() else 0.0
        floor[~outdoors] = indoor.floors_at(room[~outdoors], rows[~outdoors, 1:3])
        return cls(
            np.asarray(objects.entity[owner], np.int32),
            rows[:, _LIES] > 0,
            np.ascontiguousarray(rows[:, 1:4]),
            floor,
            np.ascontiguousarray(rows[:, _YAW]),
            room,
        )

    def __len__(self) -> int:
        return len(self.entity)

    def in_room(self, room: int) -> slice:
        """Return which seats are in a room, or outdoors (-1)."""
        starts = self._starts
        if room + 2 >= len(starts):
            return slice(len(self), len(self))
        return slice(starts.item(room + 1), starts.item(room + 2))

    @cached_property
    def _starts(self) -> NDArray[np.int64]:
        """First seat outdoors, of room 0, and so on to one after the last room that has any."""
        rooms = np.arange(-1, int(self.room.max(initial=-1)) + 2, dtype=self.room.dtype)
        return np.searchsorted(self.room, rooms)

    @cached_property
    def _stands(self) -> tuple[NDArray[np.int8], NDArray[np.float64]]:
        """Of each seat whether it is known where one stands to take it: 0 not yet, 1 nowhere, 2 there; and the spot."""
        return np.zeros(len(self), np.int8), np.zeros((len(self), 3))

    def stand_before(self, seat: int, indoor: Indoor) -> tuple[float, float, float] | None:
        """Return where one stands, ENU metres, to take a seat of an empty room; None where it cannot be reached.

        Neither seats nor furniture move: it is found once a seat.
        """
        known, spots = self._stands
        if not known[seat]:
            room, stand = self.room.item(seat), self.spot_beside(seat, indoor, np.zeros((0, 3)))
            reached = (
                stand is not None
                and seat in self.near(stand, room, lies=self.lies.item(seat), reach=REACH - _SHORT)
                and bool(indoor.walked_from_doors(room, stand[None])[0])
            )
            if stand is not None and reached:
                spots[seat] = stand
            known[seat] = 2 if reached else 1
        return _triple(spots[seat].tolist()) if known[seat] == 2 else None

    def spot_beside(self, seat: int, indoor: Indoor, taken: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return where one stands who leaves a seat of a room, ENU metres, shape ``(3,)``; None if there is no room.

        A seat is left forwards, a bed on the side that has room; where a door can be walked to from there, if there is
        such a spot by a seat, and nowhere else by a bed.

        Parameters
        ----------
        taken
            Where others stand in that room, shape ``(k, >= 2)``.
        """
        room, hips = self.room.item(seat), self.position[seat, :2]
        before = self.before(seat)[:2]
        if not self.lies.item(seat):
            spot = indoor.free_spot(room, before, taken, from_door=True)
            if spot is not None and math.hypot(*(spot[:2] - hips)) <= self.farthest(seat):
                return spot
            return indoor.free_spot(room, before, taken)
        sides = (before, 2.0 * hips - before)
        spots = [indoor.free_spot(room, side, taken, from_door=True, beside=hips) for side in sides]
        free = [spot for spot in spots if spot is not None]
        return min(free, key=lambda spot: math.hypot(*(spot[:2] - hips)), default=None)

    def farthest(self, seat: int) -> float:
        """Return how far from the hips one may come to stand who leaves a seat or a bed, metres."""
        return REACH + (_HALF_BED if self.lies.item(seat) else STEP_OFF)

    def near(self, point: ArrayLike, room: int, *, lies: bool, reach: float = REACH) -> NDArray[np.int64]:
        """Return the seats, or the beds, of a room within reach of a point on its floor, the nearest first."""
        reach += _HALF_BED if lies else 0.0
        x, y, z = np.asarray(point, np.float64)
        here = self.in_room(room)
        dx, dy = self.position[here, 0] - x, self.position[here, 1] - y
        away = np.hypot(dx, dy)
        found = np.flatnonzero((away <= reach) & (self.lies[here] == lies) & (np.abs(self.floor[here] - z) <= _LEVEL))
        return here.start + found[np.argsort(away[found], kind="stable")]

    def before(self, seat: int) -> NDArray[np.float64]:
        """Return the point before a seat, or to the left of who lies there, where one would best stand, ENU metres."""
        x, y, _ = self.position[seat]
        yaw = self.yaw[seat] + (0.5 * math.pi if self.lies[seat] else 0.0)
        away = STEP_OFF + (0.3 if self.lies[seat] else 0.0)
        return np.array([x + away * math.cos(yaw), y + away * math.sin(yaw), self.floor[seat]])


# Columns of `_places_of`: radians, and whether one lies.
_YAW = 4
_LIES = 5


def _places_of(objects: Objects, name: str, seat: Seat) -> NDArray[np.float64]:
    """Return the places on all things of a model: object, x, y, z, yaw, whether one lies, float64, shape ``(k, 6)``."""
    which = np.flatnonzero(objects.prototype == name)
    parts = [np.zeros((0, 6))]
    c, s, scale = np.cos(objects.yaw[which]), np.sin(objects.yaw[which]), objects.scale[which]
    for u, v in seat.places:
        x = objects.x[which] + scale * (c * u - s * v)
        y = objects.y[which] + scale * (s * u + c * v)
        z = objects.z[which] + scale * seat.height
        lies = np.full(len(which), float(seat.lies))
        parts.append(np.column_stack([which, x, y, z, objects.yaw[which], lies]))
    return np.concatenate(parts)


def find_rest(
    seats: Seats,
    indoor: Indoor,
    here: tuple[ArrayLike, int],
    taken: NDArray[np.bool_],
    *,
    lies: bool,
    has_room: Callable[[int], bool],
) -> Rest | None:
    """Return the nearest free seat of one's room, else the way to the nearest room of the same place that has one.

    Seats in halls and corridors, where others want to pass, are taken where no room has any.

    Parameters
    ----------
    here
        Where one is, ENU metres, and in which room (-1 outdoors: only benches near by are found).
    taken
        Which seats are no longer free, shape ``(m,)``.
    has_room
        Whether others leave room to sit on a seat.
    """
    point, room = here
    if room < 0:
        near = [k for k in seats.near(point, -1, lies=lies, reach=_BENCH).tolist() if not taken[k]]
        seat = next((k for k in near if has_room(k)), None)
        return None if seat is None else Rest(int(seats.entity[seat]), "", _triple(seats.before(seat)))

    def wanted(here: slice) -> NDArray[np.bool_]:
        # Of one room at a time: a city has a hundred thousand seats.
        return (seats.lies[here] == lies) & ~taken[here]

    def in_rooms(here: slice) -> NDArray[np.bool_]:
        return wanted(here) & ~indoor.is_passage[seats.room[here]]

    found = _rest_in((point, room), in_rooms, seats, indoor, has_room)
    return _rest_in((point, room), wanted, seats, indoor, has_room) if found is None else found


def _rest_in(
    here: tuple[ArrayLike, int],
    wanted: Callable[[slice], NDArray[np.bool_]],
    seats: Seats,
    indoor: Indoor,
    has_room: Callable[[int], bool],
) -> Rest | None:
    """Return the same among the seats that are wanted; `wanted` says so of those from one number to another."""
    _, room = here
    found = _nearest_in(here, wanted, seats, indoor, has_room)
    if found is not None:
        seat, stand = found
        return Rest(int(seats.entity[seat]), "", stand)
    # The next rooms of the place, from the nearest on: each with the door of this room that leads towards it.
    first_door = {room: -1}
    queue = [room]
    for now in queue:
        for k, door in enumerate(indoor.doors[now]):
            if door.to < 0 or door.to in first_door or indoor.place[door.to] != indoor.place[room]:
                continue
            first_door[door.to] = k if now == room else first_door[now]
            queue.append(door.to)
            found = _nearest_in((door.position, door.to), wanted, seats, indoor, has_room)
            if found is not None:
                way = indoor.doors[room][first_door[door.to]]
                return Rest(int(seats.entity[found[0]]), indoor.rooms[way.to].id, way.position)
        if len(queue) > _ROOMS:
            return None
    return None


def _nearest_in(
    here: tuple[ArrayLike, int],
    wanted: Callable[[slice], NDArray[np.bool_]],
    seats: Seats,
    indoor: Indoor,
    has_room: Callable[[int], bool],
) -> tuple[int, tuple[float, float, float]] | None:
    """Return the wanted seat of a room nearest to a point that can be reached, and where one stands before it."""
    point, room = here
    inside = seats.in_room(room)
    free = wanted(inside).nonzero()[0]
    if not len(free):
        return None
    x, y = np.asarray(point, np.float64)[:2]
    places = seats.position[inside][free]
    order = np.argsort((places[:, 0] - x) ** 2 + (places[:, 1] - y) ** 2, kind="stable")
    for seat in (inside.start + free[order[:_TRIED]]).tolist():
        stand = seats.stand_before(seat, indoor)
        if stand is not None and has_room(seat):
            return seat, stand
    return None


def _triple(point: Sequence[float] | NDArray[np.float64]) -> tuple[float, float, float]:
    return float(point[0]), float(point[1]), float(point[2])


#: Seconds that serving somebody takes, and what they pay.
SERVICE, PRICE = 12.0, 5.0
#: People stand so far apart in a line, metres; who strays farther from their spot than `LOST` has left it.
SPACING, LOST = 0.75, 2.5
#: Who joins a line stands this near to its end, metres, and whoever is served this near to the till.
AT_SPOT = 0.8
_LONGEST = 6
_BEFORE = 0.45  # metres between a counter and whoever is served
_BEHIND = (0.45, 0.35, 0.6)  # metres between it and whoever serves, tried one after the other
_AIR = 0.03
_AROUND = 2.5  # metres around a counter within which a way behind it begins and ends
_DOORWAY = 0.8  # metres from a door, and from who comes in by it, that a line keeps clear
_KINDS = ("counter", "bar_counter", "pastry_case")
_TRADE = (Category.STORE, Category.FOOD)


@dataclass(frozen=True)
class Till:
    """A till.

    Attributes
    ----------
    room
        Where it is.
    spots
        Where people stand in line before it, whoever is served first, ENU metres, shape ``(k, 2)``.
    counter
        Middle of the counter, which way its front looks, and half its depth, metres and radians.
    """

    room: int
    spots: NDArray[np.float64]
    counter: tuple[float, float, float, float]
    _indoor: Indoor

    @cached_property
    def behind(self) -> tuple[float, float, float] | None:
        """Where whoever serves stands, ENU metres, and which way they look, radians; None where nobody can get."""
        x, y, yaw, depth = self.counter
        for away in _BEHIND:
            spot = x - (depth + away) * math.cos(yaw), y - (depth + away) * math.sin(yaw)
            if self._indoor.gap(self.room, spot) <= RADIUS + _AIR:
                continue
            if self._indoor.are_connected(self.room, np.array([spot, self.spots[0]]), within=_AROUND):
                return *spot, yaw
        return None


def tills_of(places: Sequence[Place], indoor: Indoor, objects: Objects) -> dict[int, Till]:
    """Find the till of each room of shops, cafés and restaurants that has one: the counter with the longest line."""
    trade = {k for k, place in enumerate(places) if place.category in _TRADE}
    found: dict[int, Till] = {}
    for k in np.flatnonzero(np.isin(objects.kind, _KINDS)).tolist():
        room = indoor.index.get(str(objects.room[k]), -1)
        if room < 0 or int(indoor.place[room]) not in trade:
            continue
        x, y, yaw, size = (float(values[k]) for values in (objects.x, objects.y, objects.yaw, objects.size_x))
        counter = x, y, yaw, size / 2
        spots = _line(room, counter, indoor)
        if len(spots) and (room not in found or len(spots) > len(found[room].spots)):
            found[room] = Till(room, spots, counter, indoor)
    return found


def _line(room: int, counter: tuple[float, float, float, float], indoor: Indoor) -> NDArray[np.float64]:
    """Return the longest straight line of spots that begins before a counter; empty if nobody can stand there."""
    x, y, yaw, depth = counter
    ahead = np.array([math.cos(yaw), math.sin(yaw)])
    first = np.array([x, y]) + (depth + _BEFORE) * ahead
    best = np.zeros((0, 2))
    doors = np.array([p[:2] for d in indoor.doors[room] for p in (d.position, d.inside or d.position)]).reshape(-1, 2)
    for turn in (0.0, math.pi / 2, -math.pi / 2):
        c, s = math.cos(yaw + turn), math.sin(yaw + turn)
        spots = []
        for k in range(_LONGEST):
            spot = first + k * SPACING * np.array([c, s])
            in_the_way = bool((distances(doors, spot) < _DOORWAY).any())
            if in_the_way or indoor.gap(room, (float(spot[0]), float(spot[1]))) < RADIUS + _AIR:
                break
            spots.append(spot)
        if len(spots) > len(best):
            best = np.array(spots)
    return best


@dataclass
class Lines(ArrayState):
    """Who stands in line.

    Attributes
    ----------
    room
        Room of the till that each person waits at, -1 for none, int32, shape ``(n,)``.
    number
        The order in which they joined, int64, shape ``(n,)``.
    left
        Seconds of service left, float64, shape ``(n,)``.
    served
        How often each person was served, int32, shape ``(n,)``.
    """

    room: NDArray[np.int32]
    number: NDArray[np.int64]
    left: NDArray[np.float64]
    served: NDArray[np.int32]

    @classmethod
    def of(cls, people: int) -> Self:
        """Return the lines of so many people, none of whom waits."""
        return cls(
            np.full(people, -1, np.int32), np.zeros(people, np.int64), np.zeros(people), np.zeros(people, np.int32)
        )

    def waiting(self, room: int) -> list[int]:
        """Return who stands in line at the till of a room, whoever is served next first."""
        here = np.flatnonzero(self.room == room)
        return [int(i) for i in here[np.argsort(self.number[here], kind="stable")]]

    def join(self, i: int, room: int) -> None:
        """Have a person stand at the end of a line."""
        self.room[i], self.number[i], self.left[i] = room, int(self.number.max(initial=0)) + 1, SERVICE

    def leave(self, i: int) -> None:
        """Have a person stand in line no longer."""
        self.room[i] = -1
