"""Surfaces above and below the ground that people and vehicles use: decks of bridges over streets, tunnels.

The ground has one height at a point. Where a bridge passes over a street, or a tunnel under a hill, there is a second
surface, and a body is on whichever is nearest to it in height: so it stays on the one it came by. Where a tunnel begins
the ground is cut open down to its floor.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled

HEADROOM = 2.0
"""Metres between the ground and a deck above it, or the floor of a cut below it, where that is all there is: nobody can
be under such a deck, or above such a floor."""

_ENDS = 0.5  # metres that a deck goes on beyond its ends, so that no gap is left in bends and at joints
_CELL = 16.0  # metres; of the grid by which pieces are found
_SLACK = 1e-3  # metres by which the box around a piece of a strip is larger than that, for rounding

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Decks:
    """Strips with heights of their own.

    Attributes
    ----------
    first, points
        Strip ``i``'s middle is ``points[first[i]:first[i + 1]]``, ENU metres, float64, shape ``(p, 3)``.
    half_width
        From the middle to the edge, metres, shape ``(n,)``.
    pavement, rise
        How far from the middle the raised pavements begin, and how high they lie above the middle, metres, shape
        ``(n,)``.
    """

    first: NDArray[np.int64]
    points: Floats
    half_width: Floats
    pavement: Floats
    rise: Floats

    def __len__(self) -> int:
        return len(self.half_width)

    @classmethod
    def of(cls, strips: Sequence[tuple[Floats, float, float, float]]) -> Decks:
        """Make them of strips: points ``(k, 3)``, half the width, where pavements begin, and how high they lie."""
        first = np.zeros(len(strips) + 1, np.int64)
        first[1:] = np.cumsum([len(points) for points, *_ in strips])
        sizes = np.array([rest for _, *rest in strips], np.float64).reshape(-1, 3)
        points = np.concatenate([np.zeros((0, 3)), *(np.asarray(points, np.float64) for points, *_ in strips)])
        return cls(first, points, *(np.ascontiguousarray(column) for column in sizes.T))

    @classmethod
    def joined(cls, parts: Sequence[Decks]) -> Decks:
        """Return all strips of several lots, in order."""
        starts = np.cumsum([0, *(len(part.points) for part in parts)])
        first = [part.first[:-1] + start for part, start in zip(parts, starts, strict=False)]
        sizes = (np.concatenate([getattr(part, name) for part in parts]) for name in ("half_width", "pavement", "rise"))
        points = np.concatenate([part.points for part in parts])
        return cls(np.concatenate([*first, starts[-1:]]).astype(np.int64), points, *sizes)

    def moved(self, east: float, north: float) -> Decks:
        """Return them moved by some metres."""
        return replace(self, points=self.points + np.array([east, north, 0.0]))

    @cached_property
    def box(self) -> Floats:
        """West, south, east and north of all strips, metres."""
        reach = float(self.half_width.max(initial=0.0)) + _ENDS
        return np.concatenate([self.points[:, :2].min(axis=0) - reach, self.points[:, :2].max(axis=0) + reach])

    def heights(self, points: Floats, ground: Floats) -> None:
        """Replace heights of the ground (`ground`, metres) by those of the surfaces nearest to points, ``(n, 3)``."""
        _nearest_surface(self._strips, np.ascontiguousarray(points, np.float64), ground)

    @cached_property
    def _strips(self) -> tuple[NDArray[Any], ...]:
        """The strips as the kernel takes them: with the box around all of them, and the pieces that reach each cell."""
        strip = np.repeat(np.arange(len(self)), np.diff(self.first) - 1)
        piece = np.delete(np.arange(len(self.points)), self.first[1:] - 1)
        start, end = self.points[piece, :2], self.points[piece + 1, :2]
        reach = (self.half_width[strip] + _ENDS + _SLACK)[:, None]
        boxes = np.column_stack([np.minimum(start, end) - reach, np.maximum(start, end) + reach])
        first, pieces = _by_cell(self.box, boxes)
        return self.points, self.half_width, self.pavement, self.rise, self.box, strip, piece, boxes, first, pieces

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return them as named arrays, for a file."""
        return {f"deck_{name}": getattr(self, name) for name in self.__dataclass_fields__}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Decks | None:
        """Return the decks of `arrays`, None if there are none; ValueError or KeyError where they make none."""
        if "deck_first" not in arrays:
            return None
        first = np.ascontiguousarray(arrays["deck_first"], np.int64)
        points, *sizes = (
            np.ascontiguousarray(arrays[f"deck_{name}"], np.float64) for name in tuple(cls.__dataclass_fields__)[1:]
        )
        counts = np.diff(first)
        if points.ndim != 2 or points.shape[1] != 3 or first[0] != 0 or first[-1] != len(points) or (counts < 2).any():
            raise ValueError(f"decks of {len(points)} points, shape {points.shape}, cut at {first.tolist()}")
        if any(size.shape != counts.shape for size in sizes):
            raise ValueError(f"decks: {len(counts)} strips with sizes of shapes {[size.shape for size in sizes]}")
        return cls(first, points, *sizes)


def _by_cell(box: Floats, boxes: Floats) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return where the boxes begin that reach each cell of a grid over a box, row by row, and these in their order."""
    columns, rows = (max(int(np.ceil((box[k + 2] - box[k]) / _CELL)), 1) for k in (0, 1))
    low = np.clip(np.floor((boxes[:, :2] - box[:2]) / _CELL).astype(np.int64), 0, [columns - 1, rows - 1])
    high = np.clip(np.floor((boxes[:, 2:] - box[:2]) / _CELL).astype(np.int64), 0, [columns - 1, rows - 1])
    found: list[tuple[int, int]] = []
    for k, ((west, south), (east, north)) in enumerate(zip(low.tolist(), high.tolist(), strict=True)):
        found += [(row * columns + column, k) for row in range(south, north + 1) for column in range(west, east + 1)]
    table = np.array(sorted(found), np.int64).reshape(-1, 2)
    first = np.searchsorted(table[:, 0], np.arange(columns * rows + 1))
    return first.astype(np.int64), np.ascontiguousarray(table[:, 1])


@compiled
def _nearest_surface(strips, places, ground):  # type: ignore[no-untyped-def]
    """Replace `ground` by the height of the strip nearest to each place, where one is nearer."""
    points, half_width, pavement, rise, box, strip, piece, boxes, first, pieces = strips
    columns = max(int(np.ceil((box[2] - box[0]) / _CELL)), 1)
    rows = (len(first) - 1) // columns
    for k in range(len(places)):
        px, py, pz = places[k, 0], places[k, 1], places[k, 2]
        if px < box[0] or py < box[1] or px > box[2] or py > box[3]:
            continue
        best, low = ground[k], ground[k]
        found = abs(pz - best)
        row, column = min(int((py - box[1]) / _CELL), rows - 1), min(int((px - box[0]) / _CELL), columns - 1)
        cell = row * columns + column
        for p in pieces[first[cell] : first[cell + 1]]:
            s, m = strip[p], piece[p]
            if px < boxes[p, 0] or py < boxes[p, 1] or px > boxes[p, 2] or py > boxes[p, 3]:
                continue
            ax, ay = points[m, 0], points[m, 1]
            dx, dy = points[m + 1, 0] - ax, points[m + 1, 1] - ay
            length = np.sqrt(dx * dx + dy * dy)
            if length < 1e-6:
                continue
            along = ((px - ax) * dx + (py - ay) * dy) / length
            across = abs((px - ax) * dy - (py - ay) * dx) / length
            if across > half_width[s] or along < -_ENDS or along > length + _ENDS:
                continue
            t = min(max(along / length, 0.0), 1.0)
            height = points[m, 2] + t * (points[m + 1, 2] - points[m, 2])
            if across > pavement[s]:
                height += rise[s]
            # Nobody is between the ground and a deck that lies low above it, nor above the floor of an open cut.
            away = 0.0 if 0.0 <= height - low < HEADROOM and pz < height else abs(pz - height)
            if 0.0 < low - height < HEADROOM and pz < low + HEADROOM:
                away = -1.0
            if away < found or (away == found and height > best):
                best, found = height, away
        ground[k] = best
