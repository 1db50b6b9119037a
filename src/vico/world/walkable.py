"""Walkable map: a grid of surface classes over the square world.

The grid is a configuration space for a standing person: a cell is free only if a disc of `BODY` metres around its
centre touches nothing solid, so a person may stand at the centre of any free cell.
"""

from __future__ import annotations

import io
import math
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from vico.errors import InputError, MissingFileError, SchemaError
from vico.io.arrays import read_npz
from vico.io.compiled import compiled
from vico.io.files import write_bytes

BLOCKED, OPEN, SIDEWALK, CROSSING, ROADWAY = range(5)
CLASS_NAMES = ("blocked", "open", "sidewalk", "crossing", "roadway")

#: Free room around the centre of every free cell, metres: a person's radius (0.25) and a little.
BODY = 0.3


@dataclass(frozen=True)
class WalkableMap:
    """Surface classes on a square grid.

    Attributes
    ----------
    cls
        `BLOCKED`, `OPEN`, `SIDEWALK`, `CROSSING` or `ROADWAY`, uint8, shape ``(n, n)``, indexed ``[iy, ix]``;
        cell ``[0, 0]`` has its corner at the south-west corner of the world.
    half
        Half the side of the square, metres.
    cell
        Side of a cell, metres.
    """

    cls: NDArray[np.uint8]
    half: float
    cell: float = 0.5

    @property
    def n(self) -> int:
        """Cells along a side."""
        return int(self.cls.shape[0])

    def cell_of(self, xy: ArrayLike) -> NDArray[np.int64]:
        """Column and row ``(ix, iy)`` of the cells that hold points; points outside give the nearest border cell."""
        points = np.asarray(xy, np.float64)[..., :2]
        index = np.floor((points + self.half) / self.cell).astype(np.int64)
        return np.clip(index, 0, self.n - 1)

    def centre_of(self, cells: ArrayLike) -> NDArray[np.float64]:
        """Centres of cells given as ``(ix, iy)``, ENU metres."""
        return (np.asarray(cells, np.float64) + 0.5) * self.cell - self.half

    def inside(self, xy: ArrayLike) -> NDArray[np.bool_]:
        """Which points lie in the square."""
        points = np.asarray(xy, np.float64)
        return np.asarray(np.all(np.abs(points[..., :2]) < self.half, axis=-1))

    def class_at(self, xy: ArrayLike) -> NDArray[np.uint8]:
        """Class under points, shape ``(...)``; outside the square everything is blocked."""
        cells = self.cell_of(xy)
        return np.where(self.inside(xy), self.cls[cells[..., 1], cells[..., 0]], BLOCKED).astype(np.uint8)

    def cells_within(self, circles: Sequence[tuple[float, float, float]]) -> NDArray[np.bool_]:
        """Return the cells whose centres lie in one of some circles (x, y, radius, ENU metres), shape ``(n, n)``."""
        axis = self.centre_of(np.arange(self.n))
        found = np.zeros((self.n, self.n), bool)
        for x, y, radius in circles:
            found |= (axis[None, :] - x) ** 2 + (axis[:, None] - y) ** 2 <= radius * radius
        return found

    def is_connected(self, xy: ArrayLike) -> NDArray[np.bool_]:
        """Which points lie in cells that can be reached on foot from the edge of the map."""
        cells = self.cell_of(xy)
        return np.asarray(self.inside(xy) & self.connected[cells[..., 1], cells[..., 0]])

    @cached_property
    def clearance(self) -> NDArray[np.float32]:
        """Metres from cell centres to the nearest solid thing, at least; float32, shape ``(n, n)``; 0 where blocked."""
        free = self.cls != BLOCKED
        if free.all():
            return np.full(self.cls.shape, 2 * self.half, np.float32)
        far = ndimage.distance_transform_edt(free, sampling=self.cell)
        # Something solid comes within BODY of a blocked cell's centre, and no nearer than BODY to a free one's.
        return np.where(free, np.maximum(far - BODY, BODY), 0.0).astype(np.float32)

    def clearance_at(self, xy: ArrayLike) -> NDArray[np.float64]:
        """Clearance at points, bilinear between cell centres, metres, shape ``(...)``."""
        points = np.asarray(xy, np.float64)
        u = np.clip((points[..., 0] + self.half) / self.cell - 0.5, 0.0, self.n - 1.0)
        v = np.clip((points[..., 1] + self.half) / self.cell - 0.5, 0.0, self.n - 1.0)
        i = np.minimum(u.astype(np.int64), self.n - 2)
        j = np.minimum(v.astype(np.int64), self.n - 2)
        fu, fv = u - i, v - j
        c = self.clearance
        south = c[j, i] * (1 - fu) + c[j, i + 1] * fu
        north = c[j + 1, i] * (1 - fu) + c[j + 1, i + 1] * fu
        return np.asarray(south * (1 - fv) + north * fv, np.float64)

    def class_of(self, x: float, y: float) -> int:
        """Class under one point; `class_at` in plain numbers, which is quicker for who asks for few."""
        if not (abs(x) < self.half and abs(y) < self.half):
            return BLOCKED
        last = self.n - 1
        return int(self.cls[min(int((y + self.half) / self.cell), last), min(int((x + self.half) / self.cell), last)])

    def clearance_of(self, x: float, y: float) -> float:
        """Clearance at one point, metres; `clearance_at` in plain numbers."""
        last = self.n - 1.0
        u = min(max((x + self.half) / self.cell - 0.5, 0.0), last)
        v = min(max((y + self.half) / self.cell - 0.5, 0.0), last)
        i, j = min(int(u), self.n - 2), min(int(v), self.n - 2)
        fu, fv = u - i, v - j
        (a, b), (c, d) = self.clearance[j : j + 2, i : i + 2].tolist()
        south, north = a * (1 - fu) + b * fu, c * (1 - fu) + d * fu
        return float(south * (1 - fv) + north * fv)

    @cached_property
    def connected(self) -> NDArray[np.bool_]:
        """Cells that can be reached on foot from the map's edge, roads crossed; bool, shape ``(n, n)``.

        Where walls divide the edge it is the largest of the regions that touch it: any two points of it have a way.
        """
        # Four neighbours: a step between diagonal cells needs both cells beside it free.
        labels, count = ndimage.label(self.cls != BLOCKED)
        if count == 0:
            return np.zeros(self.cls.shape, bool)
        sizes = np.bincount(labels.ravel(), minlength=count + 1)
        edge = np.unique(np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]]))
        edge = edge[edge > 0]
        if not len(edge):
            return np.zeros(self.cls.shape, bool)
        return np.asarray(labels == edge[int(np.argmax(sizes[edge]))])

    def coarser(self) -> WalkableMap:
        """Return the map on cells twice as wide, for measuring many walks: a cell is free if all four within it are.

        Ways less than two metres wide may be missing. The map itself if its number of cells is odd.
        """
        if self.n % 2:
            return self
        four = self.cls.reshape(self.n // 2, 2, self.n // 2, 2)
        free = (four != BLOCKED).all(axis=(1, 3))
        cls = np.full(free.shape, ROADWAY, np.uint8)
        for surface in (OPEN, CROSSING, SIDEWALK):
            cls[(four == surface).any(axis=(1, 3))] = surface
        return WalkableMap(np.where(free, cls, np.uint8(BLOCKED)), self.half, 2 * self.cell)

    def _free_cells(self, classes: tuple[int, ...], clearance: float) -> NDArray[np.int64]:
        """Numbers of the reachable cells of some classes with so much room, row by row."""
        known = self._known_cells.get((classes, clearance))
        if known is None:
            mask = self.connected & np.isin(self.cls, classes)
            if clearance > BODY:
                mask &= self.clearance >= clearance
            known = self._known_cells[classes, clearance] = np.flatnonzero(mask)
        return known

    @cached_property
    def _known_cells(self) -> dict[tuple[tuple[int, ...], float], NDArray[np.int64]]:
        return {}

    def random_point(
        self,
        rng: np.random.Generator,
        *,
        classes: tuple[int, ...] = (OPEN, SIDEWALK),
        near: ArrayLike | None = None,
        radius: float | None = None,
        clearance: float = BODY,
    ) -> NDArray[np.float64]:
        """Return a random reachable point, ENU metres, shape ``(2,)``.

        Parameters
        ----------
        rng
            Decides which.
        classes
            Surfaces to choose from.
        near, radius
            Only within `radius` metres of the point `near`.
        clearance
            Metres of free room it needs.

        Raises
        ------
        InputError
            If there is no such point.
        """
        if near is None or radius is None:
            cells = self._free_cells(classes, max(clearance, BODY))
        else:
            cells = self._free_cells_near(classes, clearance, np.asarray(near, np.float64)[:2], radius)
        if not len(cells):
            names = ", ".join(CLASS_NAMES[c] for c in classes)
            place = "" if near is None else f" within {radius} m of {np.asarray(near)[:2].tolist()}"
            raise InputError(f"walkable map: no reachable {names} cell{place}; widen the search")
        chosen = int(cells[rng.integers(len(cells))])
        return self.centre_of([chosen % self.n, chosen // self.n])

    def _free_cells_near(
        self, classes: tuple[int, ...], clearance: float, point: NDArray[np.float64], radius: float
    ) -> NDArray[np.int64]:
        """Numbers of those free cells whose centres lie within `radius` metres of a point, row by row."""
        x, y = (float(value) for value in point)
        rows, columns = self._cells_within(y, radius), self._cells_within(x, radius)
        mask = self.connected[rows, columns] & np.isin(self.cls[rows, columns], classes)
        if clearance > BODY:
            mask &= self.clearance[rows, columns] >= clearance
        axis = self.centre_of(np.arange(self.n))
        mask &= (axis[None, columns] - x) ** 2 + (axis[rows, None] - y) ** 2 <= radius * radius
        iy, ix = np.nonzero(mask)
        return np.asarray((iy + rows.start) * self.n + ix + columns.start, np.int64)

    def _cells_within(self, middle: float, radius: float) -> slice:
        """Return the columns (or rows) whose centres may lie within `radius` metres of a coordinate."""
        first = math.floor((middle - radius + self.half) / self.cell)
        end = math.ceil((middle + radius + self.half) / self.cell) + 1
        return slice(min(max(first, 0), self.n), min(max(end, 0), self.n))


def write_walkable(path: Path, walkable: WalkableMap) -> None:
    """Write the map as ``.npz``, whole or not at all."""
    sink = io.BytesIO()
    np.savez_compressed(sink, cls=walkable.cls, half=np.float64(walkable.half), cell=np.float64(walkable.cell))
    write_bytes(path, sink.getvalue())


def read_walkable(path: Path) -> WalkableMap:
    """Read what `write_walkable` wrote.

    Raises
    ------
    MissingFileError, SchemaError
        If the file is not there, or damaged.
    """
    try:
        data = read_npz(path.read_bytes(), ("cls", "half", "cell"))
        return WalkableMap(data["cls"].astype(np.uint8), float(data["half"]), float(data["cell"]))
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such file; build the world anew") from None
    except (ValueError, KeyError, OSError, EOFError, zipfile.BadZipFile) as error:
        raise SchemaError(f"{path}: not a readable walkable map ({error}); build the world anew") from None


@compiled
def fill_polygon(grid, xs, ys, starts, half, cell, value):
    """Set the cells whose centres lie in a polygon: rings end to end in xs, ys (metres), even-odd rule."""
    n = grid.shape[0]
    low, high = ys.min(), ys.max()
    j0 = max(0, int(np.ceil((low + half) / cell - 0.5)))
    j1 = min(n - 1, int(np.floor((high + half) / cell - 0.5)))
    cuts = np.empty(len(xs), np.float64)
    for j in range(j0, j1 + 1):
        y = (j + 0.5) * cell - half
        count = 0
        for r in range(len(starts) - 1):
            a, b = starts[r], starts[r + 1]
            for k in range(a, b):
                m = k + 1 if k + 1 < b else a
                y0, y1 = ys[k], ys[m]
                if (y0 <= y) != (y1 <= y):
                    cuts[count] = xs[k] + (y - y0) * (xs[m] - xs[k]) / (y1 - y0)
                    count += 1
        row = np.sort(cuts[:count])
        for k in range(0, count - 1, 2):
            i0 = max(0, int(np.ceil((row[k] + half) / cell - 0.5)))
            i1 = min(n - 1, int(np.floor((row[k + 1] + half) / cell - 0.5)))
            for i in range(i0, i1 + 1):
                grid[j, i] = value


@compiled
def stroke(grid, start, end, radius, half, cell, value):
    """Set the cells whose centres lie within `radius` of a segment; `start`, `end`: metres, shape ``(k, 2)``."""
    n = grid.shape[0]
    for k in range(len(start)):
        x0, y0, x1, y1 = start[k, 0], start[k, 1], end[k, 0], end[k, 1]
        i0 = max(0, int(np.ceil((min(x0, x1) - radius + half) / cell - 0.5)))
        i1 = min(n - 1, int(np.floor((max(x0, x1) + radius + half) / cell - 0.5)))
        j0 = max(0, int(np.ceil((min(y0, y1) - radius + half) / cell - 0.5)))
        j1 = min(n - 1, int(np.floor((max(y0, y1) + radius + half) / cell - 0.5)))
        dx, dy = x1 - x0, y1 - y0
        square = dx * dx + dy * dy
        for j in range(j0, j1 + 1):
            y = (j + 0.5) * cell - half
            for i in range(i0, i1 + 1):
                x = (i + 0.5) * cell - half
                t = 0.0
                if square > 0.0:
                    t = min(1.0, max(0.0, ((x - x0) * dx + (y - y0) * dy) / square))
                ex, ey = x - x0 - t * dx, y - y0 - t * dy
                if ex * ex + ey * ey < radius * radius:
                    grid[j, i] = value
