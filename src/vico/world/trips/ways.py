"""Ways on the ground between the ends of rides: bounds at first, found when it matters, then kept."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.rules import BIKE_SPEED
from vico.world.model import Point2
from vico.world.routing import Router

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


def find_way(router: Router, start: Point2, goal: Point2, blocked: NDArray[np.bool_] | None = None) -> Way:
    """Return the way between two points; `NO_WAY` if there is none."""
    path = router.path(start, goal, blocked=blocked)
    if path is None:
        return NO_WAY
    return Way(path, round(float(np.hypot(*np.diff(path, axis=0).T).sum()), 3))


class From(NamedTuple):
    """Ways from one point to each.

    Attributes
    ----------
    metres, walk, ride
        Metres, seconds on foot and by bicycle, float64; lower bounds until a way is known.
    """

    metres: NDArray[np.float64]
    walk: NDArray[np.float64]
    ride: NDArray[np.float64]


class Ways:
    """Ways between numbered points.

    Parameters
    ----------
    router
        Finds them.
    points
        ENU metres; the last one is the goal.
    names
        A name for each point under which its ways are kept for later; None for points nobody will come back to.
    kept
        Ways by the name of where they begin, then where they end, shared between searches.
    walk_speed
        Metres a second on foot.
    blocked
        Cells that are closed, as for `Router.path`; ways around them are not kept.

    Attributes
    ----------
    bee_line
        Metres that a way from each point to the goal has at least.
    """

    def __init__(
        self,
        router: Router,
        points: Sequence[Point2],
        names: Sequence[str | None],
        kept: dict[str, dict[str, Way]],
        *,
        walk_speed: float,
        blocked: NDArray[np.bool_] | None = None,
    ) -> None:
        self.points = list(points)
        self.walk_speed = walk_speed
        self._router, self._names, self._kept, self._blocked = router, list(names), kept, blocked
        self._xy = np.array(self.points, np.float64).reshape(-1, 2)
        sure = router.walkable.is_connected(self._xy) if blocked is None else np.zeros(len(self._xy), bool)
        self._off = np.where(sure, 0.0, _SNAP)
        self._to_goal = self._bounds(len(self.points) - 1)
        self.bee_line: list[float] = self._to_goal.tolist()
        self._number = {name: k for k, name in enumerate(self._names) if name is not None}
        self._from: dict[int, From] = {}
        self._found: dict[tuple[int, int], Way] = {}

    def leaving(self, a: int) -> From:
        """Return the ways from a point, made when they are first asked for: there are many points in a large city."""
        if a not in self._from:
            metres = self._bounds(a)
            self._from[a] = From(metres, metres / self.walk_speed, metres / BIKE_SPEED)
            name = self._names[a]
            if self._blocked is None and name is not None:
                # A copy: another thread may find a way meanwhile.
                for other, way in self._kept.get(name, {}).copy().items():
                    b = self._number.get(other)
                    if b is not None:
                        self._note(a, b, way)
        return self._from[a]

    def reached(
        self, a: int, points: NDArray[np.int64], seconds: float, top_speed: float, *, by_bicycle: bool = False
    ) -> list[int]:
        """Return to which of some points one may go and still be at the goal in a time, at a speed from there on.

        No point is missing for want of a known way; a hundredth of a second is left for rounding.
        """
        row = self.leaving(a)
        there = (row.ride if by_bicycle else row.walk)[points] + self._to_goal[points] / top_speed
        found: list[int] = points[there <= seconds + 0.01].tolist()
        return found

    def _bounds(self, a: int) -> NDArray[np.float64]:
        """Return metres that ways between a point and each have at least."""
        away = np.hypot(*(self._xy - self._xy[a]).T)
        # A little below, so that rounding makes no bound too high.
        return np.maximum(away - self._off - self._off[a] - 0.02, 0.0)

    def known(self, a: int, b: int) -> bool:
        """Whether the way is known, and not a bound."""
        self.leaving(a)
        return (a, b) in self._found

    def way(self, a: int, b: int) -> Way:
        """Return the way from one point to another, finding it if need be."""
        if (a, b) not in self._found:
            way = find_way(self._router, self.points[a], self.points[b], self._blocked)
            first, second = self._names[a], self._names[b]
            if self._blocked is None and first is not None and second is not None:
                way = self._kept.setdefault(first, {}).setdefault(second, way)
            self._note(a, b, way)
        return self._found[a, b]

    def _note(self, a: int, b: int, way: Way) -> None:
        self._found[a, b] = way
        row = self.leaving(a)
        row.metres[b] = way.metres
        row.walk[b] = way.seconds(self.walk_speed)
        row.ride[b] = way.seconds(BIKE_SPEED)
