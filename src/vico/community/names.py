"""Names for people who don't exist: first and last names of a data file, put together so that none comes twice."""

from __future__ import annotations

import numpy as np

from vico.community.catalogue import names


class NameBook:
    """Gives names, none twice; first names repeat only when all have been given.

    Parameters
    ----------
    rng
        Decides the order.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        known = names()
        self._first = {
            "female": [known.female[k] for k in rng.permutation(len(known.female))],
            "male": [known.male[k] for k in rng.permutation(len(known.male))],
        }
        self._last = [known.last[k] for k in rng.permutation(len(known.last))]
        self._given = {"female": 0, "male": 0}
        self._families = 0
        self._used: set[str] = set()
        self._initials: dict[str, int] = {}

    def family(self) -> str:
        """Return a last name for a new family."""
        name = self._last[self._families % len(self._last)]
        self._families += 1
        return name

    def full(self, gender: str, last: str) -> str:
        """Return a full name nobody has yet, with one of the least used initials: people are easily told apart."""
        pool, given = self._first[gender], self._given[gender]
        start = given % len(pool)
        if start == 0:
            self._initials.clear()
        best = min(
            (k for k in range(start, len(pool)) if f"{pool[k]} {last}" not in self._used and pool[k][:2] != last[:2]),
            key=lambda k: (self._initials.get(pool[k][0], 0), k),
            default=None,
        )
        if best is None:
            self._given[gender] += len(pool) - start
            return self.full(gender, self.family())
        pool[start], pool[best] = pool[best], pool[start]
        self._given[gender] += 1
        first = pool[start]
        self._initials[first[0]] = self._initials.get(first[0], 0) + 1
        name = f"{first} {last}"
        self._used.add(name)
        return name
