"""Waters as bodies: a river, a lake or the sea is one, whatever bridges and streets part it on the map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon

from vico.io.compiled import compiled

_REACH = 30.0  # metres along which a surface follows its banks
_WIDER = 0.75  # of the distance to the nearest bank, where that is more
_SOFT = 0.7  # metres by which the banks near a point may differ and still count


@dataclass(frozen=True)
class WaterBody:
    """A body of open water and how high its surface lies.

    Attributes
    ----------
    outline
        Where it is, what only bridges hide among it, metres.
    shore, banks
        Points of its banks and their heights, metres, shapes ``(n, 2)`` and ``(n,)``; one point for a level surface.
    drop
        How far the surface lies below the lowest banks nearby, metres.
    """

    outline: Polygon
    shore: NDArray[np.float64]
    banks: NDArray[np.float64]
    drop: float

    def level(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Height of the surface at points, shape ``(n, 2)``, metres."""
        if len(self.shore) == 1:
            return np.full(len(xy), float(self.banks[0]) - self.drop)
        out = np.empty(len(xy))
        _soft_least(np.ascontiguousarray(xy, np.float64), self.shore, self.banks, out)
        return out - self.drop


@compiled
def _soft_least(xy, shore, banks, out):  # type: ignore[no-untyped-def]
    """About the lowest bank near each point, smooth from point to point.

    What counts as near ends: a river falls, and far down it every bank is lower. On wide water it reaches further.
    """
    away = np.empty(len(shore))
    for k in range(len(xy)):
        nearest = np.inf
        for i in range(len(shore)):
            away[i] = (xy[k, 0] - shore[i, 0]) ** 2 + (xy[k, 1] - shore[i, 1]) ** 2
            nearest = min(nearest, away[i])
        wide = 8.0 * max(_REACH**2, _WIDER**2 * nearest)
        lowest = np.inf
        for i in range(len(shore)):
            if away[i] - nearest < wide:
                lowest = min(lowest, banks[i])
        total, weight = 0.0, 0.0
        for i in range(len(shore)):
            share = 1.0 - (away[i] - nearest) / wide
            if share > 0.0:
                weight += share**4
                total += share**4 * np.exp(-(banks[i] - lowest) / _SOFT)
        out[k] = lowest - _SOFT * np.log(max(total / weight, 1e-300))
