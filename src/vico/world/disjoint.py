"""Disjoint sets of numbers."""

from __future__ import annotations


class DisjointSets:
    """Numbers in sets that can be joined; the least number stands for its set."""

    def __init__(self, count: int) -> None:
        self._parent = list(range(count))

    def root(self, j: int) -> int:
        """Return the number that stands for the set of `j`."""
        parent = self._parent
        while parent[j] != j:
            parent[j] = parent[parent[j]]
            j = parent[j]
        return j

    def join(self, a: int, b: int) -> None:
        """Make the sets of two numbers one."""
        a, b = self.root(a), self.root(b)
        self._parent[max(a, b)] = min(a, b)
