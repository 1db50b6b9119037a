"""Lengths of walks, outdoors and indoors.

Thousands of walks outdoors are measured when people are given homes, work and days: `CoarseWalkLengths` does so on
cells of a metre. `IndoorWays` measures ways from the street through corridors, over stairs and in lifts to the rooms
of a place.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple, Protocol

import numpy as np

from vico.rules import STAIRS_SPEED, WALK_SPEED
from vico.world.model import LANDING, LIFT, Doorway, Point2, Point3, Room
from vico.world.routing import Router


class Walk(NamedTuple):
    """Measures of a walk.

    Attributes
    ----------
    metres
        Its length; infinite if there is no way.
    corners
        Between its ends.
    """

    metres: float
    corners: int


class WalkLengths(Protocol):
    """Measures walks."""

    def between(self, start: Point2, goal: Point2) -> Walk:
        """Return the walk between two points, ENU metres."""

    def learn(self, point: Point2) -> None:
        """Learn what makes walks that begin or end at a point quick to measure, if there is such."""


class CoarseWalkLengths:
    """Measures walks on cells of a metre: a quarter of the cost, most within 2 % of the walk.

    Where such cells leave no way through, the walk is found on the world's own.

    Parameters
    ----------
    router
        Of the world.
    """

    def __init__(self, router: Router) -> None:
        self._measure, self._exact = Router(router.walkable.coarser()), router

    def between(self, start: Point2, goal: Point2) -> Walk:
        """Return the walk between two points, ENU metres."""
        walk = walk_of(self._measure, start, goal)
        return walk_of(self._exact, start, goal) if math.isinf(walk.metres) else walk

    def learn(self, point: Point2) -> None:
        """Learn the costs between a point and everywhere; 4 bytes a cell are kept."""
        self._measure.learn_costs(point)


def walk_of(router: Router, start: Point2, goal: Point2) -> Walk:
    """Return what the walk measures that a router finds."""
    route = router.path(start, goal)
    if route is None:
        return Walk(math.inf, 0)
    return Walk(float(np.linalg.norm(np.diff(route, axis=0), axis=1).sum()), max(0, len(route) - 2))


#: Seconds that going through a door takes: an agent acts once a second.
DOOR = 1.0
#: Seconds for which a lift's doors close before a ride and open after it.
LIFT_DOORS = 4.0
#: Speed of a lift, m/s: two seconds for a floor of 3.2 m.
LIFT_SPEED = 1.6


def lift_seconds(up: float) -> float:
    """Return how long a ride in a lift takes by metres up or down, seconds."""
    return round(LIFT_DOORS + abs(up) / LIFT_SPEED, 1)


class IndoorWays:
    """Lengths of the ways from the street to the rooms behind a door.

    Parameters
    ----------
    rooms
        Of a world, by their ids; those of a place are joined by their doors.
    """

    def __init__(self, rooms: Mapping[str, Room]) -> None:
        self._rooms = rooms
        self._from_street: dict[str, dict[str, float]] = {}

    def from_street(self, first: str) -> dict[str, float]:
        """Return the seconds from before the door to a spot a step inside each room that can be reached, on foot.

        Parameters
        ----------
        first
            Id of the room behind the door to the street.
        """
        if first not in self._from_street:
            self._from_street[first] = self._search(first)
        return self._from_street[first]

    def seconds(self, rooms: Iterable[str]) -> float:
        """Return the seconds from the street to the farthest room of a place, by its rooms' ids, entrance room first.

        0 for a place in the open.
        """
        ids = list(rooms)
        if not ids or ids[0] not in self._rooms:
            return 0.0
        found = self.from_street(ids[0])
        return max(found.get(room, 0.0) for room in ids)

    def _search(self, first: str) -> dict[str, float]:
        best: dict[str, float] = {}
        start = self._rooms[first]
        way_in = next((door.inside for door in self._doors(start) if not door.to), start.inside)
        queue: list[tuple[float, str, Point3]] = [(DOOR, first, way_in)]
        seen: set[tuple[str, Point3]] = set()
        while queue:
            at, name, here = heapq.heappop(queue)
            if (name, here) in seen:
                continue
            seen.add((name, here))
            best.setdefault(name, at)
            room = self._rooms[name]
            for door in self._doors(room):
                if door.to in self._rooms:
                    passage = DOOR
                    if room.kind == self._rooms[door.to].kind == LIFT:
                        passage = lift_seconds(self._rooms[door.to].centre[2] - room.centre[2])
                    speed = STAIRS_SPEED if room.rise else WALK_SPEED
                    after = at + walk_within(room, here, door.inside) / speed + passage
                    heapq.heappush(queue, (round(after, 3), door.to, self._arrival(door.to, name)))
        return best

    def _arrival(self, room: str, origin: str) -> Point3:
        record = self._rooms[room]
        return next((door.inside for door in self._doors(record) if door.to == origin), record.inside)

    def _doors(self, room: Room) -> list[Doorway]:
        """Return a room's ways out; where it lists none, its own door leads to the street or a room it links."""
        if room.doors:
            return room.doors
        return [Doorway(to=link, position=self._rooms[link].door, inside=room.inside) for link in room.links]


def walk_within(room: Room, start: Point3, goal: Point3) -> float:
    """Return the metres between two points of a room; on stairs around the wall between the flights."""
    if not room.rise:
        return math.dist(start[:2], goal[:2])
    c, s = math.cos(room.yaw), math.sin(room.yaw)
    (along, across), (along_goal, across_goal) = (
        (c * (x - room.centre[0]) + s * (y - room.centre[1]), c * (y - room.centre[1]) - s * (x - room.centre[0]))
        for x, y, _ in (start, goal)
    )
    if (across < 0) == (across_goal < 0):
        return math.dist(start[:2], goal[:2])
    # The flights meet at the landing halfway up, at the far end along own x.
    turn = room.size[0] / 2 - LANDING / 2
    up = math.hypot(turn - along, across)
    return up + math.hypot(turn - along_goal, across_goal)
