"""Which lamps light a place: a grid over the world whose cells name theirs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.render.lighting import Lighting
from vico.render.records import LAMP, LAMP_IN_CELL

#: Side of a cell, metres.
CELL = 2.0
# Lamps that one cell names at most: the brightest.
_MOST = 8
# What stands nearer than this to a place, or to a lamp, hides neither from the other, metres: walls are lit that stand
# in a cell's middle, and a lamp's own post darkens nothing.
_NEAR_PLACE, _NEAR_LAMP = 2.5, 1.5
# Light is looked up so high above ground, metres; of what rises to a lamp, the lamp's own ground is taken.
_HEIGHT = 0.5
_STEPS = 10


class LampGrid(NamedTuple):
    """Lamps that stay where they are.

    Attributes
    ----------
    lamps
        `LAMP`.
    power
        Of each lamp as it shines now, 0: it is out; float32.
    start
        First row of `named` of each cell, row by row from the south-west, and the end, int32.
    named
        `LAMP_IN_CELL`.
    x, y
        South-west corner, metres.
    columns, rows
        Cells; none where nothing shines.
    """

    lamps: NDArray[np.void]
    power: NDArray[np.float32]
    start: NDArray[np.int32]
    named: NDArray[np.void]
    x: float
    y: float
    columns: int
    rows: int


#: Where no lamp shines.
NO_LAMPS = LampGrid(
    np.zeros(1, LAMP), np.zeros(1, np.float32), np.zeros(1, np.int32), np.zeros(1, LAMP_IN_CELL), 0.0, 0.0, 0, 0
)


class Tops(NamedTuple):
    """Heights of the upper sides of what is built.

    Attributes
    ----------
    height
        Metres, float32, shape ``(n, n)``; rows go north.
    x, y
        South-west corner, metres.
    texels_per_metre
        Along both axes.
    """

    height: NDArray[np.float32]
    x: float
    y: float
    texels_per_metre: float

    def at(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float32]:
        """Return the heights at some points, metres."""
        last = len(self.height) - 1
        column = np.clip((x - self.x) * self.texels_per_metre, 0, last).astype(np.int64)
        row = np.clip((y - self.y) * self.texels_per_metre, 0, last).astype(np.int64)
        return self.height[row, column]


def lamp_grid(lamps: NDArray[np.void], tops: Tops) -> LampGrid:
    """Return a grid that holds all that lamps light; buildings keep light from what is behind them."""
    if not len(lamps):
        return NO_LAMPS
    reach = 1.0 / np.sqrt(lamps["inverse_reach"].astype(np.float64))
    x0, y0 = (float(np.floor((lamps[n] - reach).min() / CELL) * CELL) for n in ("x", "y"))
    columns, rows = (int(np.ceil(((lamps[n] + reach).max() - o) / CELL)) for n, o in (("x", x0), ("y", y0)))
    found = [_cells_of(lamps[k], float(reach[k]), tops, (x0, y0)) for k in range(len(lamps))]
    cell = np.concatenate([row * columns + column for column, row, _, _ in found])
    named = np.zeros(len(cell), LAMP_IN_CELL)
    named["lamp"] = np.repeat(np.arange(len(lamps)), [len(column) for column, _, _, _ in found])
    corners = np.concatenate([corner for _, _, corner, _ in found])
    named["low"], named["high"] = corners[:, :2], corners[:, 2:]
    brightness = np.concatenate([bright for _, _, _, bright in found])
    order = np.lexsort((-brightness, cell))
    cell, named = cell[order], named[order]
    first = np.searchsorted(cell, cell)
    kept = np.arange(len(cell)) - first < _MOST
    cell, named = cell[kept], named[kept]
    start = np.searchsorted(cell, np.arange(columns * rows + 1)).astype(np.int32)
    return LampGrid(lamps, lamps["power"].copy(), start, named, x0, y0, columns, rows)


def shining(grid: LampGrid, light: Lighting, windows: NDArray[np.void]) -> LampGrid:
    """Return the lamps as they shine in a light; `windows` are `SceneArrays.windows`."""
    lamps, (x, y, radius) = grid.lamps, light.unlit
    share = np.ones(len(lamps), np.float32)
    if len(windows):
        building = np.ascontiguousarray(windows["building"])
        row = np.minimum(np.searchsorted(building, lamps["entity"]), len(building) - 1)
        share = np.where(building[row] == lamps["entity"], windows["shares"][row, 1], share)
    if radius > 0.0:
        share[(lamps["x"] - x) ** 2 + (lamps["y"] - y) ** 2 <= radius**2] = 0.0
    power = lamps["power"] * share * (light.lamps * light.exposure)
    return grid._replace(power=power.astype(np.float32))


def _cells_of(lamp: Any, reach: float, tops: Tops, corner: tuple[float, float]) -> tuple[NDArray[Any], ...]:
    """Return columns and rows of the cells that a lamp reaches, what of it comes to their corners, and how bright."""
    i0, j0 = (int((float(lamp[n]) - reach - o) // CELL) for n, o in zip(("x", "y"), corner, strict=True))
    side = int(2 * reach / CELL) + 2
    x = corner[0] + CELL * np.arange(i0, i0 + side + 1)
    y = corner[1] + CELL * np.arange(j0, j0 + side + 1)
    # A front shines outwards and not far: what stands there is lit itself.
    is_front = int(lamp["entity"]) > 0
    comes = np.ones((side + 1, side + 1)) if is_front else _unhidden(lamp, np.meshgrid(x, y), tops)
    corners = np.stack([comes[:-1, :-1], comes[:-1, 1:], comes[1:, :-1], comes[1:, 1:]], axis=-1)
    mx, my = np.meshgrid(x[:-1] + CELL / 2, y[:-1] + CELL / 2)
    squared = (mx - lamp["x"]) ** 2 + (my - lamp["y"]) ** 2
    lit = (np.sqrt(squared) < reach + 0.75 * CELL) & (corners.max(axis=-1) > 0)
    ahead = (mx - lamp["x"]) * lamp["axis_x"] + (my - lamp["y"]) * lamp["axis_y"]
    lit &= (ahead > -CELL) | (not is_front)
    bright = lamp["power"] / (squared + lamp["size"] + 4.0) * np.maximum(1 - squared / reach**2, 0.01)
    j, i = np.nonzero(lit)
    return i + i0, j + j0, corners[j, i].astype(np.float32), bright[j, i]


def _unhidden(lamp: Any, points: Sequence[NDArray[np.float64]], tops: Tops) -> NDArray[np.float64]:
    """Return whether a lamp is seen from points of the ground, 0 or 1."""
    lx, ly, lz = (float(lamp[name]) for name in "xyz")
    x, y = points
    ground, foot = tops.at(x, y), float(tops.at(np.array(lx), np.array(ly)))
    foot = foot if foot < lz - 1.0 else lz - 3.0
    z = np.where(ground < lz - 1.0, ground, foot) + _HEIGHT
    dx, dy, dz = lx - x, ly - y, lz - z
    way = np.maximum(np.hypot(dx, dy), 1e-6)
    seen = np.ones(x.shape, bool)
    for step in range(_STEPS):
        at = _NEAR_PLACE + (step + 0.5) / _STEPS * (way - _NEAR_PLACE - _NEAR_LAMP)
        share = at / way
        between = (at > _NEAR_PLACE) & (at < way - _NEAR_LAMP)
        seen &= ~between | (tops.at(x + share * dx, y + share * dy) < z + share * dz)
    return seen.astype(np.float64)
