"""Robots of a kind that each follow a way of their own: saved and restored as arrays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import RobotModel


@dataclass
class OnTheirWays:
    """The robots of a kind, what changes of them, and the way that each follows.

    Attributes
    ----------
    model
        Their model.
    robots
        Their indices, int64, shape ``(k,)``.
    arrays
        What changes: a data class of arrays, row = robot of the kind.
    ways
        Points that each goes through, float64, shape ``(m, width)`` each.
    width
        Numbers a point has.
    """

    width: ClassVar[int]

    model: RobotModel
    robots: NDArray[np.int64]
    arrays: Any = field(init=False)
    ways: list[NDArray[np.float64]] = field(init=False)

    def row(self, robot: int) -> int:
        """Row of a robot in the arrays."""
        return int(np.flatnonzero(self.robots == robot)[0])

    def saved(self) -> dict[str, NDArray[Any]]:
        """Every number that decides the future, copied."""
        found = {name: value.copy() for name, value in vars(self.arrays).items()}
        return found | {
            "way_ends": np.cumsum([len(way) for way in self.ways], dtype=np.int64),
            "ways": np.concatenate([self.no_way(), *self.ways]),
        }

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `saved` returned."""
        for name, value in vars(self.arrays).items():
            value[...] = arrays[name]
        starts = np.concatenate([[0], arrays["way_ends"]]).astype(int)
        self.ways = [arrays["ways"][starts[k] : starts[k + 1]].copy() for k in range(len(self.ways))]

    def no_way(self) -> NDArray[np.float64]:
        """Return a way without points."""
        return np.zeros((0, self.width))
