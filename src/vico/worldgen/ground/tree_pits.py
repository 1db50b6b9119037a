"""Pits that trees on paved ground stand in: bare earth within a frame of stone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon

from vico.geo import overlay
from vico.worldgen.ground.markings import Quads

_PAVED = ("sidewalk", "pedestrian", "yard", "parking")
_FRAME, _EARTH = 1.7, 1.4  # metres, outer sides
_WHOLE = 0.98  # share of a pit's frame on paving
_STONE_COLOUR, _EARTH_COLOUR = (150, 147, 141), (86, 72, 56)


def tree_pits(trees: NDArray[np.float64], pieces: Mapping[str, Sequence[Polygon]], bearing: float) -> list[Quads]:
    """Lay out pits around the trees that stand on paving.

    Parameters
    ----------
    trees
        Their places, metres, shape ``(n, 2)``.
    pieces
        `ground_partition` of the map: a pit lies on paving as a whole, or there is none.
    bearing
        Direction of the paving, radians from east.
    """
    paved = [shape for name, shapes in pieces.items() if name.partition(":")[0] in _PAVED for shape in shapes]
    if not len(trees) or not paved:
        return []
    c, s = np.cos(bearing), np.sin(bearing)
    square = np.array([(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)]) @ np.array([[c, s], [-s, c]])
    frames = trees[:, None, :] + square * _FRAME
    squares = shapely.polygons(frames)
    covered = np.zeros(len(trees))
    for own, under in shapely.STRtree(paved).query(squares, predicate="intersects").T.tolist():
        covered[own] += overlay.common_area(squares[own], paved[under])
    kept = np.flatnonzero(covered > _WHOLE * _FRAME**2)
    if not len(kept):
        return []
    earth = trees[kept][:, None, :] + square * _EARTH
    return [
        Quads(frames[kept], _STONE_COLOUR, low=False, rank=0),
        Quads(earth, _EARTH_COLOUR, low=False, rank=1),
    ]
