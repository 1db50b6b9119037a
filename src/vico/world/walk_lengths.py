"""How long walks are: thousands are asked for when people are given homes, work and days."""

from __future__ import annotations

import math
from typing import NamedTuple, Protocol

import numpy as np

from vico.world.model import Point2
from vico.world.routing import Router


class Walk(NamedTuple):
    """What a walk measures.

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
