"""Ways on the ground between the ends of rides: bounds at first, found when it matters, then kept."""

from __future__ import annotations

import math
from collections.abc import Sequence
from threading import Lock
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.rules import BIKE_SPEED
from vico.world.model import Point2
from vico.world.routing import Router
from vico.world.trips.labels import Ground, bee_lines

#: Seconds that a corner costs: an agent that turns does not go on in the same second.
TURN = 1.0
# Metres that a way may be shorter than the bee line at an end from which the nearest walkable point is taken.
_SNAP = 6.0


class Way(NamedTuple):
    """A way on the ground.

    Attributes
    ----------
    path
        Corner points, shape ``(k, 2)``.
    metres
        Its length; infinite if there is no way.
    """

    path: NDArray[np.float64]
    metres: float

    def seconds(self, speed: float) -> float:
        """How long it takes at a speed, m/s, with a moment at every corner, in hundredths of a second."""
        return round(self.metres / speed + TURN * max(0, len(self.path) - 2), 2)


NO_WAY = Way(np.zeros((0, 2)), math.inf)


def find_way(
    router: Router, start: Point2, goal: Point2, blocked: NDArray[np.bool_] | None = None, *, often: bool = False
) -> Way:
    """Return the way between two points; `NO_WAY` if there is none. Parameters are those of `Router.path`."""
    path = router.path(start, goal, blocked=blocked, often=often)
    if path is None:
        return NO_WAY
    return Way(path, round(float(np.hypot(*np.diff(path, axis=0).T).sum()), 3))


class KnownWays:
    """The ways between the stops and stations of a place that were found so far; threads may share it.

    Parameters
    ----------
    names
        Of the stops and stations.
    walk_speed
        Metres a second on foot.

    Attributes
    ----------
    number
        Of each name, in their order.
    """

    def __init__(self, names: Sequence[str], walk_speed: float) -> None:
        self.number = {name: k for k, name in enumerate(names)}
        self.walk_speed = walk_speed
        self._ways: dict[tuple[int, int], Way] = {}
        self._row = np.full(len(names), -1, np.int64)
        self._known = np.full((1, len(names), 3), np.nan)
        self._lock = Lock()

    def get(self, a: int, b: int) -> Way | None:
        """Return the way from one to another, by number; None if it is not known."""
        return self._ways.get((a, b))

    def keep(self, a: int, b: int, way: Way) -> Way:
        """Keep a way from one to another, and return it; or the one that is known already."""
        with self._lock:
            if (a, b) not in self._ways:
                row = self._row[a]
                if row < 0:
                    row = self._row.max() + 1
                    if row == len(self._known):
                        self._known = np.concatenate([self._known, np.full_like(self._known, np.nan)])
                    self._row[a] = row
                self._known[row, b] = measures(way, self.walk_speed)
                self._ways[a, b] = way
            return self._ways[a, b]

    def arrays(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return the row of each of the known ways from there, -1 without any, and the measures by row and number."""
        with self._lock:
            return self._row, self._known


def measures(way: Way, walk_speed: float) -> tuple[float, float, float]:
    """Return a way's metres, and its seconds on foot and by bicycle."""
    return way.metres, way.seconds(walk_speed), way.seconds(BIKE_SPEED)


class Ways:
    """Ways between numbered points.

    Parameters
    ----------
    router
        Finds them.
    points
        ENU metres: of stops and stations, then of the start and the goal.
    place
        Numbers of the stops and stations among the known ways, int64.
    known
        Ways that are known; those found are kept there.
    blocked
        Cells that are closed, as for `Router.path`.
    """

    def __init__(
        self,
        router: Router,
        points: Sequence[Point2],
        place: NDArray[np.int64],
        known: KnownWays,
        *,
        blocked: NDArray[np.bool_] | None = None,
    ) -> None:
        self.points = list(points)
        self.walk_speed = known.walk_speed
        self._router, self._place, self._known, self._blocked = router, place, known, blocked
        xy = np.array(self.points, np.float64).reshape(-1, 2)
        sure = router.walkable.is_connected(xy) if blocked is None else np.zeros(len(xy), bool)
        off = np.where(sure, 0.0, _SNAP)
        self._own: dict[tuple[int, int], Way] = {}
        of_start, of_goal = np.full((2, len(xy), 3), np.nan)
        self._ground = Ground(xy, off, place, *known.arrays(), of_start, of_goal, bee_lines(xy, off, len(xy) - 1))

    @property
    def ground(self) -> Ground:
        """What is known of them now."""
        row, known = self._known.arrays()
        return self._ground._replace(row=row, known=known)

    def known(self, a: int, b: int) -> bool:
        """Whether the way is known, and not a bound."""
        return self._get(a, b) is not None

    def way(self, a: int, b: int) -> Way:
        """Return the way from one point to another, finding it if need be."""
        if (way := self._get(a, b)) is not None:
            return way
        start, goal = len(self.points) - 2, len(self.points) - 1
        between = a < start and b < start
        way = find_way(self._router, self.points[a], self.points[b], self._blocked, often=between)
        if between:
            return self._known.keep(int(self._place[a]), int(self._place[b]), way)
        self._own[a, b] = way
        if a == start:
            self._ground.of_start[b] = measures(way, self.walk_speed)
        if b == goal:
            self._ground.of_goal[a] = measures(way, self.walk_speed)
        return way

    def _get(self, a: int, b: int) -> Way | None:
        if max(a, b) < len(self.points) - 2:
            return self._known.get(int(self._place[a]), int(self._place[b]))
        return self._own.get((a, b))
