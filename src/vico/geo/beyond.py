"""Ground where no elevation file reaches: flat, and without a step where the files end."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vico.geo.frame import LocalFrame
from vico.geo.raster_cuts import RasterCut

_CELL = 8.0  # metres between points
_FADE = 120.0  # metres over which the height at a file's edge gives way to the flat


def flat_beyond(
    points: NDArray[np.float64], cuts: Sequence[RasterCut], frame: LocalFrame, reach: float
) -> tuple[NDArray[np.float64], float]:
    """Return points where no file reaches, and the height they flatten out to.

    Parameters
    ----------
    points
        Heights where files do reach, ENU metres, shape ``(n, 3)``.
    cuts
        What the files cover.
    frame, reach
        Centre and half side of the square to fill, metres.

    Returns
    -------
    tuple
        Points, shape ``(m, 3)``, and metres above sea level: the median height along the edge of the files.
    """
    side = np.arange(-reach + _CELL / 2, reach, _CELL)
    grid = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    bare = np.ones(len(grid), bool)
    for cut in cuts:
        bare &= ~cut.holds(frame, grid)
    grid = grid[bare]
    if not len(grid):
        return np.zeros((0, 3)), float(np.median(points[:, 2]))
    distance, nearest = cKDTree(points[:, :2]).query(grid)
    edge = points[nearest, 2]
    level = float(np.median(edge))
    away = np.clip(distance / _FADE, 0.0, 1.0)
    fade = away * away * (3.0 - 2.0 * away)
    return np.column_stack([grid, edge + (level - edge) * fade]), level
