"""Treads of stairs outdoors: what feet stand on, where the ground is a slope to everything else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled

DEEPEST = 0.6
"""Metres from riser to riser up to which one takes a tread a step."""

_CELL = 1.0  # of the grid in which treads are looked up, metres
# Who is so far above or below the treads is on a deck over them, or under them, metres. Treads lie within half a step.
_REACH = 0.6

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Stairs:
    """Level treads, each a convex quadrilateral.

    Attributes
    ----------
    corners
        ENU metres, counter-clockwise, float64, shape ``(n, 4, 2)``.
    level
        Height of each, metres, shape ``(n,)``.
    going
        How far it is from one riser to the next on its flight, on average, metres, shape ``(n,)``.
    """

    corners: Floats
    level: Floats
    going: Floats

    def __len__(self) -> int:
        return len(self.level)

    @classmethod
    def joined(cls, parts: Sequence[Stairs]) -> Stairs:
        """Return all treads of several lots, in order."""
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in cls.__dataclass_fields__))

    def moved(self, east: float, north: float) -> Stairs:
        """Return them moved by some metres."""
        return replace(self, corners=self.corners + np.array([east, north]))

    def stand_on(self, points: Floats, ground: Floats) -> None:
        """Replace heights of the ground (`ground`, metres) by those of the treads at points, ``(n, 3)``, if any."""
        found = self._found(points)
        on = found >= 0
        ground[on] = self.level[found[on]]

    def going_at(self, points: Floats) -> Floats:
        """How deep the treads at points ``(n, 3)`` are, metres, shape ``(n,)``.

        0 off stairs, and where treads are so deep that one walks on them as on the ground.
        """
        found = self._found(points)
        return np.where((found >= 0) & (self.going[found] < DEEPEST), self.going[found], 0.0)

    def _found(self, points: Floats) -> NDArray[np.int64]:
        """Return the number of the tread at each point, -1 where there is none."""
        found = np.full(len(points), -1, np.int64)
        _find(self._grid, self.corners, self.level, np.ascontiguousarray(points, np.float64), found)
        return found

    @cached_property
    def _grid(self) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
        """South-west corner; where each cell's treads begin, shape ``(ny, nx + 1)``, in a list of their numbers."""
        low, high = self.corners.min(axis=1), self.corners.max(axis=1)
        corner = low.min(axis=0)
        first, last = (np.floor((side - corner) / _CELL).astype(np.int64) for side in (low, high))
        nx, ny = last.max(axis=0) + 1
        cells: list[list[int]] = [[] for _ in range(int(nx * ny))]
        for number, ((i0, j0), (i1, j1)) in enumerate(zip(first.tolist(), last.tolist(), strict=True)):
            for j in range(j0, j1 + 1):
                for i in range(i0, i1 + 1):
                    cells[j * int(nx) + i].append(number)
        start = np.zeros(len(cells) + 1, np.int64)
        start[1:] = np.cumsum([len(cell) for cell in cells])
        rows = np.stack([start[j * nx : (j + 1) * nx + 1] for j in range(ny)])
        return corner, rows, np.array([number for cell in cells for number in cell], np.int64)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return them as named arrays, for a file."""
        return {f"stairs_{name}": getattr(self, name) for name in self.__dataclass_fields__}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Stairs | None:
        """Return the stairs of `arrays`, None if there are none; ValueError or KeyError where they make none."""
        if "stairs_corners" not in arrays:
            return None
        corners, level, going = (
            np.ascontiguousarray(arrays[f"stairs_{name}"], np.float64) for name in cls.__dataclass_fields__
        )
        n = len(corners)
        if not n or corners.shape != (n, 4, 2) or level.shape != (n,) or going.shape != (n,):
            raise ValueError(f"stairs of shapes {corners.shape}, {level.shape}, {going.shape}")
        if not (np.isfinite(corners).all() and np.isfinite(level).all() and (going > 0.0).all()):
            raise ValueError("stairs with treads that are nowhere, or that have no depth")
        return cls(corners, level, going)


@compiled
def _find(grid, corners, level, points, found):  # type: ignore[no-untyped-def]
    """Write the number of the tread that lies at each point nearest to it in height."""
    corner, start, numbers = grid
    ny, nx = start.shape[0], start.shape[1] - 1
    for k in range(len(points)):
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        u, v = (x - corner[0]) / _CELL, (y - corner[1]) / _CELL
        if not (0.0 <= u < nx and 0.0 <= v < ny):
            continue
        nearest = _REACH
        for m in range(start[int(v), int(u)], start[int(v), int(u) + 1]):
            t = numbers[m]
            if abs(z - level[t]) >= nearest:
                continue
            inside = True
            for c in range(4):
                ax, ay = corners[t, c, 0], corners[t, c, 1]
                bx, by = corners[t, (c + 1) % 4, 0], corners[t, (c + 1) % 4, 1]
                inside &= (bx - ax) * (y - ay) - (by - ay) * (x - ax) >= 0.0
            if inside:
                nearest, found[k] = abs(z - level[t]), t
