"""Where the robots of a task can go: asked as it is drawn, so that none is drawn that no robots can do."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import RobotModel
from vico.assets.robots.ground import narrow_ground
from vico.world.world import World

# The ground is looked at so far to either side of a point, metres.
_ASIDE = 0.5

Array = NDArray[np.float64]
Grid = NDArray[np.bool_]


@dataclass
class Ways:
    """Ways of robots on a world's ground."""

    world: World
    _narrow: dict[str, Grid] = field(default_factory=dict)

    def stands(self, model: RobotModel, at: Sequence[float] | Array) -> bool:
        """Return whether a robot can begin at a point, ENU metres."""
        walkable = self.world.walkable
        ix, iy = walkable.cell_of(np.asarray(at, np.float64)[:2])
        return bool(walkable.connected[iy, ix] and not self._kept_off(model)[iy, ix])

    def rise(self, at: Sequence[float] | Array) -> float:
        """Return how much the ground rises a metre at a point, ENU metres."""
        x, y = float(at[0]), float(at[1])
        east, west, north, south = self.world.height.smooth(
            [[x + _ASIDE, y], [x - _ASIDE, y], [x, y + _ASIDE], [x, y - _ASIDE]]
        ).tolist()
        return math.hypot(east - west, north - south) / (2.0 * _ASIDE)

    def lead(
        self, model: RobotModel, start: Sequence[float] | Array, points: Sequence[tuple[Array, float]], *, within: float
    ) -> bool:
        """Return whether a robot can go near each of some points.

        Parameters
        ----------
        start
            Where it begins, ENU metres.
        points
            ENU metres, and how near to each it has to come, metres.
        within
            Longest way from the start, in metres of pavement.
        """
        blocked = self._kept_off(model)
        way = self.world.router.distance_field(np.asarray(start, np.float64)[:2], blocked=blocked)
        return all(self._comes(way, point, near, within) for point, near in points)

    def _comes(self, way: NDArray[np.float32], point: Array, near: float, within: float) -> bool:
        walkable = self.world.walkable
        low, high = walkable.cell_of([point[:2] - near, point[:2] + near])
        i0, j0 = np.maximum(low, 0)
        i1, j1 = np.minimum(high, walkable.n - 1)
        yy, xx = np.mgrid[j0 : j1 + 1, i0 : i1 + 1]
        away = np.hypot(*(walkable.centre_of(np.stack([xx, yy], axis=-1)) - point[:2]).transpose(2, 0, 1))
        return bool((way[j0 : j1 + 1, i0 : i1 + 1][away <= near] <= within).any())

    def _kept_off(self, model: RobotModel) -> Grid:
        if model.name not in self._narrow:
            self._narrow[model.name] = narrow_ground(self.world, model)
        return self._narrow[model.name]
