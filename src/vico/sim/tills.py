"""Tills of shops and cafés, and the lines of people before them: who is served next, and where each one stands."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from vico.geometry import distances
from vico.sim.indoor import Indoor
from vico.sim.state import RADIUS, ArrayState
from vico.world.model import Category, Place
from vico.world.objects import Objects

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
            if self._indoor.joined(self.room, np.array([spot, self.spots[0]]), within=_AROUND):
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
