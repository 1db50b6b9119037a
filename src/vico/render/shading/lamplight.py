"""Light of lamps on the pixels of a block: each of the few that reach it is worked out for all of them at once."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from vico.render.arrays import RUN
from vico.render.compiled import inlined
from vico.render.lamps.beams import BEAM_REACH, MOST_BEAMS, nearest_beams
from vico.render.lamps.grid import CELL
from vico.render.shading.fields import LAMPS, NX, NY, NZ, X, Y, Z

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
