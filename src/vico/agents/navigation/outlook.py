"""Looking ahead on a way outdoors: which cells of the public map are taken by what the map does not have."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.navigation.voxel_kernels import SIDE, VOXEL
from vico.agents.navigation.voxels import VoxelMap
from vico.agents.state import AgentState
from vico.world.walkable import WalkableMap

Point = tuple[float, float]

#: How far ahead on its way one looks for what stands, and for what moves, metres: that may have gone on until then.
STANDING_AHEAD, MOVING_AHEAD = 6.0, 1.8
#: On one way so often at most: where there is no end of it, one walks on and sees what stops one.
MOST_TIMES = 6
# Metres between the points of a way that are looked at; those within so many of oneself are not.
_SPACING, _OWN = 0.2, 0.3
# Cells are closed up to so many metres around what is in the way.
_AROUND = 2.5
# What was gone round is not gone round again within so many metres of it.
_SAME = 1.0
_NEAR = 1  # the count of `Voxels.counts` that a person cannot stand with


class Outlook:
    """Tells which cells of the public map to keep out of, where something that was seen is on one's way.

    A cell is taken if its centre has less than a person's room to two voxels of a column, as cells are blocked in the
    map itself.

    Parameters
    ----------
    walkable
        The public map's.
    """

    def __init__(self, walkable: WalkableMap) -> None:
        self._walkable = walkable
        self._last: Point | None = None
        self._times = 0

    def set_out(self) -> None:
        """Begin a new way."""
        self._last, self._times = None, 0

    def in_the_way(
        self, voxels: VoxelMap, position: Point, corners: Sequence[Point]
    ) -> list[tuple[float, float, float]]:
        """Return the cells to close, as x, y and half a side, metres; none where the way is free.

        Parameters
        ----------
        voxels
            What was seen outdoors.
        position, corners
            Where one stands, and the way ahead, ENU metres.
        """
        line = _sampled(position, corners)
        if not len(line) or self._times >= MOST_TIMES:
            return []
        i, j = (np.floor(line / VOXEL).astype(np.int64) % SIDE).T
        (taken,) = np.nonzero(voxels.voxels.counts[j, i, _NEAR])
        for k in taken.tolist():
            spot = (float(line[k, 0]), float(line[k, 1]))
            if self._last is not None and math.dist(spot, self._last) < _SAME:
                return []
            if math.dist(spot, position) <= MOVING_AHEAD or not _moves(voxels, int(i[k]), int(j[k])):
                self._last = spot
                self._times += 1
                return self._cells_around(voxels, spot)
        if not len(taken):
            self._last = None
        return []

    def _cells_around(self, voxels: VoxelMap, spot: Point) -> list[tuple[float, float, float]]:
        cell = self._walkable.cell
        reach = int(_AROUND / cell)
        column, row = self._walkable.cell_of(spot).tolist()
        axis = np.arange(-reach, reach + 1)
        x, y = np.meshgrid(column + axis, row + axis)
        centres = self._walkable.centre_of(np.column_stack([x.ravel(), y.ravel()]))
        i, j = (np.floor(centres / VOXEL).astype(np.int64) % SIDE).T
        return [(x, y, 0.0) for x, y in centres[voxels.voxels.counts[j, i, _NEAR] > 0].tolist()]

    def state(self) -> AgentState:
        """Return what was gone round last, and how often something was."""
        return {"last": None if self._last is None else list(self._last), "times": self._times}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on as `state` returned it."""
        last, self._times = state["last"], int(state["times"])
        self._last = None if last is None else (float(last[0]), float(last[1]))


def _sampled(position: Point, corners: Sequence[Point]) -> NDArray[np.float64]:
    """Return points along a way, nearest first, shape ``(k, 2)``."""
    found, here, gone = [], position, 0.0
    for corner in corners:
        length = math.dist(here, corner)
        at = np.arange(max(_OWN - gone, 0.0), min(length, STANDING_AHEAD - gone), _SPACING)
        share = (at / max(length, 1e-9))[:, None]
        found.append(np.array(here) * (1.0 - share) + np.array(corner) * share)
        gone, here = gone + length, corner
        if gone >= STANDING_AHEAD:
            break
    return np.concatenate(found) if found else np.zeros((0, 2))


def _moves(voxels: VoxelMap, i: int, j: int) -> bool:
    """Tell whether what is near a column moves, or is only known from a stumble."""
    axis = np.arange(-3, 4)
    return bool(voxels.voxels.until[np.ix_((j + axis) % SIDE, (i + axis) % SIDE)].any())
