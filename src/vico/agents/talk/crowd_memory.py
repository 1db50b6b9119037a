"""Whom many residents see, taken down in arrays, and told to their memories when these are wanted."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from vico.agents.talk.memory import RECOGNISED, ResidentMemory, tick_of
from vico.crowd import Crowd

_LYING = 2
# Memories are told at the latest after so many times of looking about.
_MOST_PENDING = 60


class CrowdMemory:
    """Looks about for members of a group; each remembers what it would by itself (`ResidentMemory.look`).

    Parameters
    ----------
    memories
        Of the members, by number; None for one that has none.
    """

    def __init__(self, memories: Sequence[ResidentMemory | None]) -> None:
        self._memories = memories
        self._tick = -1
        self._pending: list[tuple[float, NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]] = []
        self._agents: tuple[object, list[str]] = None, []
        for memory in memories:
            if memory is not None:
                memory.settle = self.settle

    def look(self, crowd: Crowd, asked: NDArray[np.int64], number: Callable[[], NDArray[np.int64]]) -> None:
        """Take down who is about, if it is time to.

        Parameters
        ----------
        asked
            Numbers of the members that are asked now, int64, shape ``(n,)``.
        number
            Returns the members' numbers by row of the crowd; -1 for others.
        """
        if (tick := tick_of(crowd.time)) == self._tick:
            return
        self._tick = tick
        if self._agents[0] is not crowd.index:
            self.settle()
            self._agents = crowd.index, sorted(crowd.index, key=lambda name: crowd.index[name])
        looks = np.zeros(len(self._memories) + 1, bool)  # the last one is for those who are no members
        for k in asked.tolist():
            memory = self._memories[k]
            if memory is not None and memory.tick != tick:
                memory.tick, looks[k] = tick, True
        me = number()[crowd.viewer]
        kept = looks[me] & (crowd.distance <= RECOGNISED) & (crowd.posture[crowd.viewer] != _LYING)
        if kept.any():
            viewer, seen = crowd.viewer[kept], crowd.seen[kept]
            where = np.column_stack([crowd.pose[seen, :2], crowd.place[viewer]])
            self._pending.append((float(crowd.time), me[kept], seen, where))
        if len(self._pending) >= _MOST_PENDING:
            self.settle()

    def settle(self) -> None:
        """Tell all memories what was taken down for them."""
        if not self._pending:
            return
        time = np.concatenate([np.full(len(me), when) for when, me, _, _ in self._pending])
        me, seen, where = (np.concatenate([one[k] for one in self._pending]) for k in (1, 2, 3))
        self._pending = []
        pair = me * (int(seen.max()) + 1) + seen
        # Only the last time counts; in order, so that the same ones are forgotten.
        _, last = np.unique(pair[::-1], return_index=True)
        kept = np.sort(len(pair) - 1 - last)
        agents = self._agents[1]
        rows = zip(me[kept].tolist(), seen[kept].tolist(), time[kept].tolist(), where[kept].tolist(), strict=True)
        for k, other, when, (x, y, place) in rows:
            memory = self._memories[k]
            assert memory is not None
            memory.see(agents[other], when, x, y, memory.places[int(place)] if place >= 0 else "")


__all__ = ["CrowdMemory"]
