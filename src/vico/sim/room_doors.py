"""Ways out of rooms, kept as numbers: a city has half a million of them, and few are ever looked at."""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np
from numpy.typing import NDArray

from vico.io.recent import Recent
from vico.world.model import Place, Point3, Room

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
        self._kept: Recent[int, list[Door]] = Recent(_KEPT)

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
            rows = np.concatenate([rows, self._linked(rooms, places)])
        return RoomDoors(rows, len(rooms))

    def _linked(self, rooms: Sequence[Room], places: Iterable[Place]) -> NDArray[np.float64]:
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
