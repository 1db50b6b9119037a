"""Pedestrians who go to an event, stand or stroll there, or march, and go on their way when it is over."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.geometry import distance
from vico.sim.environment.event_sites import Gathering
from vico.sim.traffic.drawing import TrafficView
from vico.sim.traffic.placement import guided_walks
from vico.sim.traffic.state import CROWD, NONE, WINDOW
from vico.world.walkways import SIDEWALK

_MOST = 0.4  # share of all pedestrians that go to one event
_COMES_FROM = 350.0  # m from where they come at the most
_ARRIVED = 6.0  # m from where they leave the sidewalk
_PLACARDS = 3  # of so many who march one has a placard
_RAISED_FROM, _RAISING = 18.0, 4.0  # m from where a march is joined at which they go up, and in which
_STROLL = (20, 61)  # s before a stall


class Gatherings:
    """Leads pedestrians to the events that go on; what it knows of them is in their records.

    Parameters
    ----------
    traffic
        Whose pedestrians they are.

    Attributes
    ----------
    now
        The gatherings that go on.
    """

    def __init__(self, traffic: TrafficView) -> None:
        self._traffic, self._walkers = traffic, traffic.pedestrian_state
        self.now: Sequence[Gathering] = ()
        self._plain = traffic.paths
        self._shut: NDArray[np.bool_] | None = None

    def follow(self, gatherings: Sequence[Gathering]) -> None:
        """Take notice of which there are; the same again cost nothing."""
        traffic, walkers, plain = self._traffic, self._walkers, self._plain
        if gatherings is self.now and self._shut is traffic.shut_walkways:
            return
        self.now, self._shut = gatherings, traffic.shut_walkways
        own = guided_walks(traffic.walks, plain, [one.walkway for one in gatherings], shut=self._shut)
        traffic.paths = plain._replace(
            goal_walkway=np.concatenate([plain.goal_walkway, own.goal_walkway]),
            goal_away=np.concatenate([plain.goal_away, own.goal_away]),
        )
        numbers = [one.id for one in gatherings]
        for i in np.flatnonzero(walkers.event > 0).tolist():
            if walkers.event[i] not in numbers:
                self._release(i)
            elif walkers.goal[i] != NONE:
                self._send(i, numbers.index(int(walkers.event[i])))

    def advance(self, second: float) -> None:
        """Lead everybody on; once a second.

        Parameters
        ----------
        second
            Since midnight of the first day.
        """
        walkers = self._walkers
        for k, one in enumerate(self.now):
            wanted = min(one.count, int(_MOST * len(walkers)))
            members = np.flatnonzero(walkers.event == one.id)
            # A march sets out onto the street when the cars have left it.
            waits = one.manner == "march" and self._traffic.is_shut_street_taken()
            if len(members) < wanted:
                self._call(one, k, wanted - len(members))
            for i in members.tolist():
                if walkers.stand_kind[i] == CROWD:
                    self._place(i, one, second)
                elif walkers.goal[i] == NONE and not waits:
                    self._come(i, one, k)

    def placards(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how far each of those who march has a placard up: one of three, from a little before they join in.

        Parameters
        ----------
        position
            Of pedestrians, and of others after them who hold none, metres, shape ``(n, 2)`` or ``(n, 3)``.

        Returns
        -------
        ndarray
            0..1, shape ``(n,)``.
        """
        up, walkers = np.zeros(len(position)), self._walkers
        for one in self.now:
            members = (
                np.flatnonzero((walkers.event == one.id) & (walkers.aboard == NONE)) if one.manner == "march" else ()
            )
            for i in members:
                if i % _PLACARDS == 0:
                    away = distance(position[i, :2], one.entry)
                    joined = walkers.stand_kind[i] == CROWD
                    up[i] = 1.0 if joined else min(max((_RAISED_FROM - away) / _RAISING, 0.0), 1.0)
        return up

    def _call(self, one: Gathering, k: int, count: int) -> None:
        """Have the nearest of those who walk alone come to an event."""
        walkers, traffic = self._walkers, self._traffic
        x, y = (getattr(traffic.shapes, axis)[traffic.vehicles :] for axis in ("x", "y"))
        away = np.hypot(x - one.entry[0], y - one.entry[1])
        free = (walkers.event == 0) & (walkers.goal == NONE) & (walkers.aboard == NONE) & (walkers.group_size == 1)
        free &= np.isin(walkers.stand_kind, (0, WINDOW)) & (away < _COMES_FROM)
        # From wherever there is a way.
        there = traffic.paths.goal_away[len(self._plain.goal_walkway) + k]
        free &= np.isfinite(there[traffic.walks.ends[walkers.walkway]]).all(axis=1)
        found = np.flatnonzero(free)
        for i in found[np.argsort(away[found], kind="stable")][:count].tolist():
            walkers.event[i], walkers.stand_kind[i], walkers.spot[i] = one.id, 0, NONE
            if walkers.walkway[i] != one.walkway:
                self._send(i, k)

    def _send(self, i: int, k: int) -> None:
        """Have somebody walk to the sidewalk of a gathering."""
        goal = len(self._plain.goal_walkway) + k
        self._walkers.goal[i], self._walkers.goal_end[i] = goal, goal + 1

    def _come(self, i: int, one: Gathering, k: int) -> None:
        """Have somebody who walks on the gathering's sidewalk leave it where the others do."""
        walkers, b = self._walkers, self._traffic.vehicles + i
        if walkers.walkway[i] != one.walkway:
            self._send(i, k)
            return
        shapes = self._traffic.shapes
        if np.hypot(shapes.x[b] - one.entry[0], shapes.y[b] - one.entry[1]) > _ARRIVED:
            walkers.direction[i] = 1 if one.offset > walkers.offset[i] else -1
            return
        taken = self._places_taken(one.id)
        free = next((n for n in range(one.count) if n not in taken), None)
        if free is not None and walkers.leaving_crossing[i] == NONE:
            walkers.stand_kind[i], walkers.place[i], walkers.offset[i] = CROWD, free, one.offset
            walkers.stand_time[i] = _STROLL[0]

    def _places_taken(self, number: int) -> set[int]:
        walkers = self._walkers
        return set(walkers.place[(walkers.event == number) & (walkers.stand_kind == CROWD)].tolist())

    def _place(self, i: int, one: Gathering, second: float) -> None:
        """Have somebody stand where they are to be now."""
        walkers = self._walkers
        if one.manner == "stroll":
            walkers.stand_time[i] -= 1.0
            if walkers.stand_time[i] <= 0.0:
                self._stroll_on(i, one)
        x, y, yaw = one.place(int(walkers.place[i]), second).tolist()
        walkers.stand_xy[i], walkers.stand_yaw[i] = (x, y), yaw

    def _stroll_on(self, i: int, one: Gathering) -> None:
        """Have somebody look at another stall."""
        walkers = self._walkers
        mixed = int(walkers.random[i] >> np.uint64(17)) + 31 * int(walkers.place[i])
        walkers.stand_time[i] = _STROLL[0] + mixed % (_STROLL[1] - _STROLL[0])
        taken = self._places_taken(one.id)
        free = [n for n in range(len(one.places)) if n not in taken]
        if free:
            walkers.place[i] = free[mixed % len(free)]

    def _release(self, i: int) -> None:
        """Have somebody walk on along the nearest sidewalk."""
        walkers, traffic = self._walkers, self._traffic
        walkers.event[i], walkers.goal[i], walkers.place[i] = 0, NONE, 0
        if walkers.stand_kind[i] != CROWD:
            return
        walkers.stand_kind[i] = 0
        walkers.stuck_time[i] = walkers.jammed_time[i] = 0.0
        b = traffic.vehicles + i
        point = shapely.Point(traffic.shapes.x[b], traffic.shapes.y[b])
        ways, lines = self._sidewalks()
        best = int(np.argmin(shapely.distance(lines, point)))
        walkers.walkway[i] = ways[best]
        walkers.offset[i] = float(shapely.line_locate_point(lines[best], point))

    def _sidewalks(self) -> tuple[NDArray[np.int64], list[shapely.LineString]]:
        walks = self._traffic.walks
        ways = np.flatnonzero(walks.kind == SIDEWALK)
        return ways, [shapely.LineString(walks.line(int(way))) for way in ways]
