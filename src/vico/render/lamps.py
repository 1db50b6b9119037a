"""Light of lamps, shop fronts and headlights on what is around them.

A grid over the world names the lamps that light each cell. Headlights are cones of light before vehicles, of which a
picture shows the nearest few. On the pixels of a block, each of the few lamps that reach it is worked out for all of
them at once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.vehicle_parts import SHINING
from vico.render.arrays import LAMPS, NX, NY, NZ, RUN, X, Y, Z
from vico.render.compiled import inlined, kernel
from vico.render.lighting import Lighting
from vico.render.records import LAMP, LAMP_IN_CELL
from vico.world.mesh import Surface

#: Vehicles whose headlights light a picture, at most.
MOST_BEAMS = 6
#: How far light reaches, metres.
BEAM_REACH = 24.0
#: From this exposure of lamps on headlights are seen on what is around: by day glass shines a little, to be told.
LIT_FROM = 0.02
# Light is thrown whole up to 21 degrees from straight ahead, and nothing from 40 on.
_SPREAD, _SHARE = 6.0, -4.6
_POWER, _SIZE = 26.0, 9.0
# What is nearer than this to the middle of a cone has it in its picture, metres; the middle is so far ahead.
_FARTHEST, _MIDDLE = 75.0, 9.0
# Headlights are white, unlike rear lights, and no higher than this above ground, unlike lamps in buses, metres.
_WHITE, _HIGH = 200, 1.4


class Beams(NamedTuple):
    """Headlights of models.

    Attributes
    ----------
    row
        Of each prototype in `lamps`, -1: none; int32, shape ``(p,)``.
    lamps
        `LAMP` in the models' frames: the middle between a vehicle's headlights stands for both.
    """

    row: NDArray[np.int32]
    lamps: NDArray[np.void]

    def place(self, prototype: NDArray[np.int32], rows: NDArray[np.float32]) -> NDArray[np.void]:
        """Return the headlights of placed models; `rows` are of their transforms, shape ``(n, 3, 4)``."""
        known = self.row[prototype]
        shining = np.flatnonzero(known >= 0)
        found = self.lamps[known[shining]]
        matrix = rows[shining]
        local = np.stack([found[name] for name in "xyz"], axis=1)
        place = np.einsum("nij,nj->ni", matrix[:, :, :3], local) + matrix[:, :, 3]
        found["x"], found["y"], found["z"] = place.T
        found["axis_x"], found["axis_y"], found["axis_z"] = matrix[:, :, 0].T
        return found


def beams_of(models: Mapping[str, Sequence[Surface]]) -> Beams:
    """Return the headlights of models."""
    row = np.full(len(models), -1, np.int32)
    found: list[tuple[float, ...]] = []
    for k, surfaces in enumerate(models.values()):
        place = _headlight(surfaces)
        if place is not None:
            row[k] = len(found)
            found.append((*place, 1.0, 0.0, 0.0, _SPREAD, _SHARE, _POWER, _SIZE, 1.0 / BEAM_REACH**2, 0))
    return Beams(row, np.array(found, LAMP) if found else np.zeros(0, LAMP))


def _headlight(surfaces: Sequence[Surface]) -> tuple[float, float, float] | None:
    """Return the middle between a model's headlights, a hand's breadth before them."""
    for surface in surfaces:
        if surface.material.name != SHINING.name:
            continue
        points = surface.positions[(surface.colour.min(axis=1) >= _WHITE) & (surface.positions[:, 2] < _HIGH)]
        if len(points):
            front = points[points[:, 0] > points[:, 0].max() - 0.3]
            return float(front[:, 0].max()) + 0.1, float(front[:, 1].mean()), float(front[:, 2].mean())
    return None


@kernel
def nearest_beams(beams: Any, camera: Any, lamp_exposure: Any, chosen: Any) -> int:
    """Write the rows of the headlights that light a camera's picture most into `chosen`; return how many."""
    count, far = 0, np.empty(len(chosen))
    if camera.indoors or lamp_exposure < LIT_FROM:
        return 0
    for k in range(len(beams)):
        beam = beams[k]
        dx = beam.x + _MIDDLE * beam.axis_x - camera.x
        dy = beam.y + _MIDDLE * beam.axis_y - camera.y
        dz = beam.z - camera.z
        ahead = dx * camera.forward_x + dy * camera.forward_y + dz * camera.forward_z
        away = np.sqrt(dx * dx + dy * dy + dz * dz)
        if away > _FARTHEST or ahead < -_MIDDLE - 4.0:
            continue
        if count < len(chosen):
            at = count
            count += 1
        elif far[count - 1] > away:
            at = count - 1
        else:
            continue
        while at > 0 and far[at - 1] > away:
            far[at], chosen[at] = far[at - 1], chosen[at - 1]
            at -= 1
        far[at], chosen[at] = away, k
    return count


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


class TopHeights(NamedTuple):
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


def lamp_grid(lamps: NDArray[np.void], tops: TopHeights) -> LampGrid:
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


def shining_lamps(grid: LampGrid, light: Lighting, windows: NDArray[np.void]) -> LampGrid:
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


def _cells_of(lamp: Any, reach: float, tops: TopHeights, corner: tuple[float, float]) -> tuple[NDArray[Any], ...]:
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


def _unhidden(lamp: Any, points: Sequence[NDArray[np.float64]], tops: TopHeights) -> NDArray[np.float64]:
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


#: Light that still comes to what looks so far away from a lamp, as a cosine: lamps are no points.
AROUND_CORNER = np.float32(0.2)
#: Where lamps that reach a point are looked up, metres before its surface.
BEFORE = np.float32(1.0)
_ZERO, _ONE, _TINY = np.float32(0.0), np.float32(1.0), np.float32(1e-4)
_PER_METRE = 1.0 / CELL

# Blocks are up to some metres wide.
_REACH = (BEAM_REACH + 4.0) ** 2


class _Comes(NamedTuple):
    """What comes of a lamp's light to the corners of a cell."""

    low: tuple[Any, Any]
    high: tuple[Any, Any]


# Nothing hides headlights.
_OPEN = _Comes((_ONE, _ONE), (_ONE, _ONE))


class ShownBeams(NamedTuple):
    """Headlights of a picture: the first `number` of `chosen` are rows of `lamps`."""

    lamps: Any
    chosen: Any
    number: int
    exposure: Any


@inlined
def shown_beams(beams: Any, camera: Any, exposure: Any) -> Any:
    """Return the headlights that light a camera's picture; `exposure` is that of lamps."""
    chosen = np.zeros(MOST_BEAMS, np.int64)
    return ShownBeams(beams, chosen, nearest_beams(beams, camera, exposure, chosen), exposure)


@inlined
def queue_lamplight(real: Any, at: int, grid: Any, beams: Any, x: float, y: float) -> None:
    """Lay the light of lamps on a block of pixels into the queue; `x`, `y` is a point before its middle."""
    if grid.rows == 0 and beams.number == 0:
        return
    for i in range(RUN):
        real[LAMPS + at + i] = _ZERO
    for k in range(beams.number):
        beam = beams.lamps[beams.chosen[k]]
        if (x - beam.x) ** 2 + (y - beam.y) ** 2 < _REACH:
            _add_lamp(real, at, beam, beam.power * beams.exposure, _OPEN, _ZERO, _ZERO)
    u, v = (x - grid.x) * _PER_METRE, (y - grid.y) * _PER_METRE
    if not (u >= 0.0 and v >= 0.0 and u < grid.columns and v < grid.rows):
        return
    column, row = np.uint32(u), np.uint32(v)
    west, south = np.float32(grid.x + column * CELL), np.float32(grid.y + row * CELL)
    lamps, power, start, named = grid.lamps, grid.power, grid.start, grid.named
    cell = np.int64(row) * grid.columns + column
    for k in range(start[cell], start[cell + 1]):
        one = named[k]
        bright = power[one.lamp]
        if bright > _ZERO:
            _add_lamp(real, at, lamps[one.lamp], bright, one, west, south)


@inlined
def _add_lamp(real: Any, at: int, lamp: Any, bright: Any, one: Any, west: Any, south: Any) -> None:
    lx, ly, lz = lamp.x, lamp.y, lamp.z
    ax, ay, az, spread, share = lamp.axis_x, lamp.axis_y, lamp.axis_z, lamp.spread, lamp.share
    size, inverse_reach, per_metre = lamp.size, lamp.inverse_reach, np.float32(_PER_METRE)
    c00, c10, c01, c11 = one.low[0], one.low[1], one.high[0], one.high[1]
    for i in range(RUN):
        px, py, pz = real[X + at + i], real[Y + at + i], real[Z + at + i]
        nx, ny, nz = real[NX + at + i], real[NY + at + i], real[NZ + at + i]
        dx, dy, dz = lx - px, ly - py, lz - pz
        squared = dx * dx + dy * dy + dz * dz + _TINY
        inverse = _ONE / np.sqrt(squared)
        facing = max((dx * nx + dy * ny + dz * nz) * inverse + AROUND_CORNER, _ZERO)
        thrown = min(max(share - spread * (dx * ax + dy * ay + dz * az) * inverse, _ZERO), _ONE)
        left = max(_ONE - squared * inverse_reach, _ZERO)
        s = min(max((px + BEFORE * nx - west) * per_metre, _ZERO), _ONE)
        t = min(max((py + BEFORE * ny - south) * per_metre, _ZERO), _ONE)
        low, high = c00 + s * (c10 - c00), c01 + s * (c11 - c01)
        comes = low + t * (high - low)
        real[LAMPS + at + i] += bright * facing * thrown * left * left * comes / (squared + size)
