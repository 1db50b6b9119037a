"""Walks between points of a world, measured once and kept for as long as the world is in use."""

from __future__ import annotations

import math
from collections import Counter
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from vico.world.model import Point2
from vico.world.routing import Router
from vico.world.world import World

# A point that so many walks began or ended at is worth learning the costs to; so many points are, 4 bytes a cell each.
_OFTEN, _MOST_LEARNED = 12, 64


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


class Walks:
    """Walks by their ends, there as back.

    Thousands are measured, on cells of a metre: a quarter of the cost, most within 2 % of the walk. Where such cells
    leave no way through, the walk is found on the world's own.

    Parameters
    ----------
    world
        Where. Its router is locked while a walk is looked for; nothing here may be shared between threads.
    """

    def __init__(self, world: World) -> None:
        self._measure = Router(world.walkable.coarser())
        self._exact = world.router
        self._found: dict[tuple[Point2, Point2], Walk] = {}
        self._asked: Counter[Point2] = Counter()
        self._learned = 0

    @classmethod
    def of(cls, world: World) -> Walks:
        """Return the walks of a world: those of its author, its validator and all others are the same."""
        if world not in _WALKS:
            _WALKS[world] = cls(world)
        return _WALKS[world]

    def between(self, a: Point2, b: Point2) -> Walk:
        """Return the walk between two points, ENU metres."""
        ends = (a, b) if a <= b else (b, a)
        if ends not in self._found:
            for end in ends:
                self._learn(end)
            walk = _measured(self._measure, *ends)
            self._found[ends] = _measured(self._exact, *ends) if math.isinf(walk.metres) else walk
        return self._found[ends]

    def _learn(self, end: Point2) -> None:
        self._asked[end] += 1
        if self._asked[end] == _OFTEN and self._learned < _MOST_LEARNED:
            self._learned += 1
            self._measure.learn_costs(end)


def _measured(router: Router, start: Point2, goal: Point2) -> Walk:
    route = router.path(start, goal)
    if route is None:
        return Walk(math.inf, 0)
    return Walk(float(np.linalg.norm(np.diff(route, axis=0), axis=1).sum()), max(0, len(route) - 2))


# The world holds no walks, so that it can be dropped; they go with it.
_WALKS: WeakKeyDictionary[World, Walks] = WeakKeyDictionary()
