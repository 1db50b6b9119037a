"""Heights of what feet and wheels stand on: the ground with its kerbs and quays, decks and tunnels, and stairs.

`HeightField` is the one look-up used by everybody. A step of the ground would be smeared over a whole cell by any field
of heights. So edges are kept as a field of signed distances beside the heights of their lower and their upper side, all
three smooth: a look-up finds the edge to a few centimetres though cells are half a metre wide.

`Decks` are surfaces above and below the ground. The ground has one height at a point. Where a bridge passes over a
street, or a tunnel under a hill, there is a second surface, and a body is on whichever is nearest to it in height: so
it stays on the one it came by. Where a tunnel begins the ground is cut open down to its floor.

`Stairs` are treads outdoors: what feet stand on, where the ground is a slope to everything else.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vico.io.compiled import compiled

HEADROOM = 2.0
"""Metres between the ground and a deck above it, or the floor of a cut below it, where that is all there is: nobody can
be under such a deck, or above such a floor."""

_ENDS = 0.5  # metres that a deck goes on beyond its ends, so that no gap is left in bends and at joints
_DECK_CELL = 16.0  # metres; of the grid by which pieces are found
_SLACK = 1e-3  # metres by which the box around a piece of a strip is larger than that, for rounding

Floats = NDArray[np.float64]


class _Strips(NamedTuple):
    """Decks as the kernel takes them.

    Attributes
    ----------
    points, half_width, pavement, rise
        As those of `Decks`.
    box
        West, south, east and north of all, metres.
    strip, start, boxes
        Of each piece between two points: its strip, its first point, and the box around it.
    first, pieces
        The pieces that reach cell ``i`` of the grid over `box` are ``pieces[first[i]:first[i + 1]]``.
    """

    points: Floats
    half_width: Floats
    pavement: Floats
    rise: Floats
    box: Floats
    strip: NDArray[np.int64]
    start: NDArray[np.int64]
    boxes: Floats
    first: NDArray[np.int64]
    pieces: NDArray[np.int64]


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
    def _strips(self) -> _Strips:
        strip = np.repeat(np.arange(len(self)), np.diff(self.first) - 1)
        piece = np.delete(np.arange(len(self.points)), self.first[1:] - 1)
        start, end = self.points[piece, :2], self.points[piece + 1, :2]
        reach = (self.half_width[strip] + _ENDS + _SLACK)[:, None]
        boxes = np.column_stack([np.minimum(start, end) - reach, np.maximum(start, end) + reach])
        first, pieces = _by_cell(self.box, boxes)
        sizes = self.half_width, self.pavement, self.rise
        return _Strips(self.points, *sizes, self.box, strip, piece, boxes, first, pieces)

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
    columns, rows = (max(int(np.ceil((box[k + 2] - box[k]) / _DECK_CELL)), 1) for k in (0, 1))
    low = np.clip(np.floor((boxes[:, :2] - box[:2]) / _DECK_CELL).astype(np.int64), 0, [columns - 1, rows - 1])
    high = np.clip(np.floor((boxes[:, 2:] - box[:2]) / _DECK_CELL).astype(np.int64), 0, [columns - 1, rows - 1])
    found: list[tuple[int, int]] = []
    for k, ((west, south), (east, north)) in enumerate(zip(low.tolist(), high.tolist(), strict=True)):
        found += [(row * columns + column, k) for row in range(south, north + 1) for column in range(west, east + 1)]
    table = np.array(sorted(found), np.int64).reshape(-1, 2)
    first = np.searchsorted(table[:, 0], np.arange(columns * rows + 1))
    return first.astype(np.int64), np.ascontiguousarray(table[:, 1])


@compiled
def _nearest_surface(strips, places, ground):
    """Replace `ground` by the height of the strip nearest to each place, where one is nearer."""
    points, box, boxes = strips.points, strips.box, strips.boxes
    columns = max(int(np.ceil((box[2] - box[0]) / _DECK_CELL)), 1)
    rows = (len(strips.first) - 1) // columns
    for k in range(len(places)):
        px, py, pz = places[k, 0], places[k, 1], places[k, 2]
        if px < box[0] or py < box[1] or px > box[2] or py > box[3]:
            continue
        best, low = ground[k], ground[k]
        found = abs(pz - best)
        row, column = min(int((py - box[1]) / _DECK_CELL), rows - 1), min(int((px - box[0]) / _DECK_CELL), columns - 1)
        cell = row * columns + column
        for p in strips.pieces[strips.first[cell] : strips.first[cell + 1]]:
            s, m = strips.strip[p], strips.start[p]
            if px < boxes[p, 0] or py < boxes[p, 1] or px > boxes[p, 2] or py > boxes[p, 3]:
                continue
            ax, ay = points[m, 0], points[m, 1]
            dx, dy = points[m + 1, 0] - ax, points[m + 1, 1] - ay
            length = np.sqrt(dx * dx + dy * dy)
            if length < 1e-6:
                continue
            along = ((px - ax) * dx + (py - ay) * dy) / length
            across = abs((px - ax) * dy - (py - ay) * dx) / length
            if across > strips.half_width[s] or along < -_ENDS or along > length + _ENDS:
                continue
            t = min(max(along / length, 0.0), 1.0)
            height = points[m, 2] + t * (points[m + 1, 2] - points[m, 2])
            if across > strips.pavement[s]:
                height += strips.rise[s]
            # Nobody is between the ground and a deck that lies low above it, nor above the floor of an open cut.
            away = 0.0 if 0.0 <= height - low < HEADROOM and pz < height else abs(pz - height)
            if 0.0 < low - height < HEADROOM and pz < low + HEADROOM:
                away = -1.0
            if away < found or (away == found and height > best):
                best, found = height, away
        ground[k] = best


DEEPEST = 0.6
"""Metres from riser to riser up to which one takes a tread a step."""

_TREAD_CELL = 1.0  # of the grid in which treads are looked up, metres
# Who is so far above or below the treads is on a deck over them, or under them, metres. Treads lie within half a step.
_REACH = 0.6


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
        found = self._tread_at(points)
        on = found >= 0
        ground[on] = self.level[found[on]]

    def going_at(self, points: Floats) -> Floats:
        """Return how deep the treads at points ``(n, 3)`` are, metres, shape ``(n,)``.

        0 off stairs, and where treads are so deep that one walks on them as on the ground.
        """
        found = self._tread_at(points)
        return np.where((found >= 0) & (self.going[found] < DEEPEST), self.going[found], 0.0)

    def _tread_at(self, points: Floats) -> NDArray[np.int64]:
        """Return the number of the tread at each point, -1 where there is none."""
        found = np.full(len(points), -1, np.int64)
        _find(self._grid, self.corners, self.level, np.ascontiguousarray(points, np.float64), found)
        return found

    @cached_property
    def _grid(self) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
        """South-west corner; where each cell's treads begin, shape ``(ny, nx + 1)``, in a list of their numbers."""
        low, high = self.corners.min(axis=1), self.corners.max(axis=1)
        corner = low.min(axis=0)
        first, last = (np.floor((side - corner) / _TREAD_CELL).astype(np.int64) for side in (low, high))
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
def _find(grid, corners, level, points, found):
    """Write the number of the tread that lies at each point nearest to it in height."""
    corner, start, numbers = grid
    ny, nx = start.shape[0], start.shape[1] - 1
    for k in range(len(points)):
        x, y, z = points[k, 0], points[k, 1], points[k, 2]
        u, v = (x - corner[0]) / _TREAD_CELL, (y - corner[1]) / _TREAD_CELL
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


EDGE_RANGE = 1.0
"""Metres of distance to an edge that a `Steps` field can tell; int8 127 stands for it."""

EDGE_WIDTH = 0.1
"""Metres over which the ground goes from the lower to the upper side of an edge."""


@dataclass(frozen=True)
class Steps:
    """Edges where the ground steps down, over the same square as its height field.

    Attributes
    ----------
    edge
        Distance to the nearest edge, negative on the lower side, in units of ``EDGE_RANGE / 127``; int8, ``(m, m)``.
    low, high
        What to add to the smooth height on the lower and the upper side of the edges, millimetres, int16, ``(m, m)``.
    """

    edge: NDArray[np.int8]
    low: NDArray[np.int16]
    high: NDArray[np.int16]


@dataclass(frozen=True)
class HeightField:
    """Ground heights over the square world.

    Attributes
    ----------
    heights
        Smooth heights, metres, float32, shape ``(n, n)``, indexed ``[iy, ix]``; corner ``[0, 0]`` is the south-west
        one.
    half
        Half the side of the square covered, metres; the square is centred on the origin.
    steps
        Kerbs, quays and their like; None where there are none.
    decks
        Surfaces above and below the ground that people and vehicles use, too; None where there are none.
    stairs
        Treads that feet stand on, where the heights are a slope; None where there are none.
    """

    heights: NDArray[np.float32]
    half: float
    steps: Steps | None = None
    decks: Decks | None = None
    stairs: Stairs | None = None

    @property
    def cell(self) -> float:
        """Spacing of the smooth heights, metres."""
        return 2.0 * self.half / (self.heights.shape[0] - 1)

    @classmethod
    def flat(cls, half: float, height: float = 0.0) -> HeightField:
        """Return a level field."""
        return cls(np.full((2, 2), height, np.float32), half)

    def __call__(self, xy: ArrayLike) -> NDArray[np.float64]:
        """Heights at points; points outside take the nearest edge's height.

        Parameters
        ----------
        xy
            ENU metres, shape ``(..., 2)`` (further columns are ignored).

        Returns
        -------
        ndarray
            Metres, shape ``(...)``.
        """
        return self._look_up(xy, 0)

    def near(self, xyz: ArrayLike) -> NDArray[np.float64]:
        """Heights of the surfaces that bodies are on: of the ground, or of a deck or a tunnel that is nearer in height.

        Parameters
        ----------
        xyz
            ENU metres, shape ``(..., 3)``.

        Returns
        -------
        ndarray
            Metres, shape ``(...)``; those of the ground where there are no decks.
        """
        points = np.asarray(xyz, np.float64)
        found = self._look_up(points, 0)
        if self.decks is not None:
            self.decks.heights(points.reshape(-1, 3), found.reshape(-1))
        return found

    def footing(self, xyz: ArrayLike) -> NDArray[np.float64]:
        """Heights of what feet stand on: as `near`, and of treads on stairs; shaped as those of `near`."""
        found = self.near(xyz)
        if self.stairs is not None:
            flat = found.reshape(-1)
            self.stairs.stand_on(np.asarray(xyz, np.float64).reshape(-1, 3), flat)
        return found

    def going_at(self, xyz: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how deep the treads are that one climbs at points ``(n, 3)``, metres, shape ``(n,)``; 0 off stairs."""
        return np.zeros(len(xyz)) if self.stairs is None else self.stairs.going_at(xyz)

    def smooth(self, xy: ArrayLike) -> NDArray[np.float64]:
        """Heights without kerbs and their like, shaped as those of a call."""
        return self._look_up(xy, 1)

    def lower(self, xy: ArrayLike) -> NDArray[np.float64]:
        """Heights of the lower side near an edge, wherever the points lie: of the carriageway, of the water."""
        return self._look_up(xy, 2)

    def upper(self, xy: ArrayLike) -> NDArray[np.float64]:
        """Heights of the upper side near an edge, wherever the points lie: of the sidewalk, of the quay."""
        return self._look_up(xy, 3)

    def edge_distance(self, xy: ArrayLike) -> NDArray[np.float64]:
        """Metres to the nearest edge of a kerb, a quay or their like, negative below it; at most `EDGE_RANGE`.

        Parameters
        ----------
        xy
            ENU metres, shape ``(..., 2)`` (further columns are ignored).

        Returns
        -------
        ndarray
            Metres, shape ``(...)``; `EDGE_RANGE` where there are no edges.
        """
        points = np.asarray(xy, np.float64)
        if self.steps is None:
            return np.full(points.shape[:-1], EDGE_RANGE)
        edge, n = self.steps.edge, self.steps.edge.shape[0]
        u, v = (np.clip((points[..., k] + self.half) * (n - 1) / (2.0 * self.half), 0.0, n - 1.0) for k in (0, 1))
        i, j = np.minimum(u.astype(np.int64), n - 2), np.minimum(v.astype(np.int64), n - 2)
        fu, fv = u - i, v - j
        south = edge[j, i] * (1.0 - fu) + edge[j, i + 1] * fu
        north = edge[j + 1, i] * (1.0 - fu) + edge[j + 1, i + 1] * fu
        return np.asarray((south * (1.0 - fv) + north * fv) * (EDGE_RANGE / 127.0), np.float64)

    def _look_up(self, xy: ArrayLike, which: int) -> NDArray[np.float64]:
        points = np.ascontiguousarray(xy, np.float64)
        flat = points.reshape(-1, points.shape[-1])
        found = np.empty(len(flat))
        _smooth(self.heights, self.half, flat, found)
        if self.steps is not None and which != 1:
            _add_steps(self.steps.edge, self.steps.low, self.steps.high, self.half, flat, which, found)
        return found.reshape(points.shape[:-1])

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the field as named arrays, for a file."""
        found: dict[str, NDArray[Any]] = {"heights": self.heights, "half": np.array(self.half, np.float64)}
        if self.steps is not None:
            found |= {"edge": self.steps.edge, "low": self.steps.low, "high": self.steps.high}
        for more in (self.decks, self.stairs):
            found |= {} if more is None else more.arrays()
        return found

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> HeightField:
        """Return the field of `arrays`; ValueError or KeyError where they make none."""
        heights = np.ascontiguousarray(arrays["heights"], np.float32)
        if heights.ndim != 2 or heights.shape[0] != heights.shape[1] or heights.shape[0] < 2:
            raise ValueError(f"heights of shape {heights.shape}, not square")
        steps, half = cls._steps_from(arrays), float(arrays["half"])
        return cls(heights, half, steps, Decks.from_arrays(arrays), Stairs.from_arrays(arrays))

    @staticmethod
    def _steps_from(arrays: Mapping[str, NDArray[Any]]) -> Steps | None:
        if "edge" not in arrays:
            return None
        edge = np.ascontiguousarray(arrays["edge"], np.int8)
        low, high = (np.ascontiguousarray(arrays[name], np.int16) for name in ("low", "high"))
        if edge.ndim != 2 or edge.shape[0] != edge.shape[1] or not edge.shape == low.shape == high.shape:
            raise ValueError(f"steps of shapes {edge.shape}, {low.shape}, {high.shape}")
        return Steps(edge, low, high)


@compiled
def _smooth(heights, half, places, out):
    n = heights.shape[0]
    scale = (n - 1) / (2.0 * half)
    for k in range(len(places)):
        u = min(max((places[k, 0] + half) * scale, 0.0), n - 1.0)
        v = min(max((places[k, 1] + half) * scale, 0.0), n - 1.0)
        i, j = min(int(u), n - 2), min(int(v), n - 2)
        fu, fv = u - i, v - j
        south = np.float64(heights[j, i]) * (1.0 - fu) + np.float64(heights[j, i + 1]) * fu
        north = np.float64(heights[j + 1, i]) * (1.0 - fu) + np.float64(heights[j + 1, i + 1]) * fu
        out[k] = south * (1.0 - fv) + north * fv


@compiled
def _add_steps(edge, low, high, half, places, which, out):
    """Add the steps: at the point itself (0), or as if it lay on the lower (2) or upper (3) side."""
    n = edge.shape[0]
    scale = (n - 1) / (2.0 * half)
    for k in range(len(places)):
        u = min(max((places[k, 0] + half) * scale, 0.0), n - 1.0)
        v = min(max((places[k, 1] + half) * scale, 0.0), n - 1.0)
        i, j = min(int(u), n - 2), min(int(v), n - 2)
        fu, fv = u - i, v - j
        a, b, c, d = (1.0 - fu) * (1.0 - fv), fu * (1.0 - fv), (1.0 - fu) * fv, fu * fv
        share = 0.0
        if which == 3:
            share = 1.0
        elif which == 0:
            away = a * edge[j, i] + b * edge[j, i + 1] + c * edge[j + 1, i] + d * edge[j + 1, i + 1]
            share = min(max(0.5 + away * (EDGE_RANGE / 127.0 / EDGE_WIDTH), 0.0), 1.0)
        if share < 1.0:
            out[k] += (
                (1.0 - share) * 0.001 * (a * low[j, i] + b * low[j, i + 1] + c * low[j + 1, i] + d * low[j + 1, i + 1])
            )
        if share > 0.0:
            out[k] += (
                share * 0.001 * (a * high[j, i] + b * high[j, i + 1] + c * high[j + 1, i] + d * high[j + 1, i + 1])
            )
