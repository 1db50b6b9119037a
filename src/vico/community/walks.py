"""Walks between points of a world, measured once and kept for as long as the world is in use."""

from __future__ import annotations

from collections import Counter
from weakref import WeakKeyDictionary

from vico.world.model import Point2
from vico.world.walk_lengths import Walk
from vico.world.world import World

# A point that so many walks began or ended at is worth learning about; so many points are.
_OFTEN, _MOST_LEARNED = 12, 64


class Walks:
    """Walks by their ends, there as back.

    Parameters
    ----------
    world
        Where. Its router is locked while a walk is looked for; nothing here may be shared between threads.
    """

    def __init__(self, world: World) -> None:
        self._lengths = world.walk_lengths()
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
            self._found[ends] = self._lengths.between(*ends)
        return self._found[ends]

    def _learn(self, end: Point2) -> None:
        self._asked[end] += 1
        if self._asked[end] == _OFTEN and self._learned < _MOST_LEARNED:
            self._learned += 1
            self._lengths.learn(end)


# The world holds no walks, so that it can be dropped; they go with it.
_WALKS: WeakKeyDictionary[World, Walks] = WeakKeyDictionary()
