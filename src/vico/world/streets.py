"""Streets by name, and which one a point lies in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.world.model import Point2
from vico.world.street_model import Roads


@dataclass(frozen=True)
class PublicStreet:
    """A piece of a street that has a name.

    Attributes
    ----------
    line
        Centre line, ENU metres.
    width
        Of its carriageway, metres.
    """

    name: str
    line: list[Point2]
    width: float


def named_streets(roads: Roads) -> list[PublicStreet]:
    """Return the streets of a road database that have names and are open."""
    return [PublicStreet(r.name, r.line, r.width) for r in roads.roads if r.name and not r.closed and len(r.line) > 1]


class StreetIndex:
    """Streets as arrays of stretches between two points.

    Parameters
    ----------
    streets
        By their pieces.
    """

    def __init__(self, streets: Sequence[PublicStreet]) -> None:
        lines = [np.asarray(street.line, np.float64) for street in streets]
        self.names = sorted({street.name for street in streets})
        number = {name: k for k, name in enumerate(self.names)}
        pairs = [np.concatenate([line[:-1], line[1:]], axis=1) for line in lines]
        self._ends = np.concatenate([np.zeros((0, 4)), *pairs])
        self._half = np.repeat([street.width / 2 for street in streets], [len(one) for one in pairs])
        self._number = np.repeat(
            np.array([number[street.name] for street in streets], np.int64), [len(one) for one in pairs]
        )

    def streets_at(self, points: ArrayLike, *, beside: float = 8.0) -> list[str]:
        """Return the street that each point lies in: the nearest, up to `beside` metres from its carriageway; "" else.

        Parameters
        ----------
        points
            ENU metres, shape ``(n, 2)``.
        """
        found = np.asarray(points, np.float64).reshape(-1, 2)
        if not len(self._ends) or not len(found):
            return [""] * len(found)
        away = self._distances(found) - self._half
        nearest = away.argmin(axis=1)
        near = away[np.arange(len(found)), nearest] <= beside
        return [
            self.names[self._number[k]] if ok else "" for k, ok in zip(nearest.tolist(), near.tolist(), strict=True)
        ]

    def _distances(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distance of each point to each stretch, metres, shape ``(points, stretches)``."""
        start, along = self._ends[:, :2], self._ends[:, 2:] - self._ends[:, :2]
        to = points[:, None] - start
        share = np.clip((to * along).sum(axis=2) / np.maximum((along**2).sum(axis=1), 1e-12), 0.0, 1.0)
        return np.linalg.norm(to - share[..., None] * along, axis=2)


__all__ = ["PublicStreet", "StreetIndex", "named_streets"]
