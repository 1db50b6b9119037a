"""Vehicles that can be looked into: the sun comes in by their windows, and their lamps light what is in them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.assets.vehicle_parts import Cabin
from vico.render.arrays import PAD, STRIDE
from vico.render.compiled import inlined
from vico.render.records import CABIN, CABIN_STEPS

#: Vehicles whose inside is seen are lit this far away, metres: lit ones are seen from afar by night.
CABIN_REACH = 200.0
#: Share of the sky's light that is left under a vehicle's roof.
UNDER_ROOF = np.float32(0.8)
#: Light of a cabin's lamps on what stands upright in it, what is added for each unit of a normal's z, and the colour.
CABIN_LAMP, CABIN_TILT = np.float32(0.42), np.float32(0.16)
CABIN_GREEN, CABIN_BLUE = np.float32(0.94), np.float32(0.82)
# Width of the rims of light on floor and seats, metres.
_PENUMBRA = 0.04
_ZERO, _HALF, _ONE, _TINY = (np.float32(value) for value in (0.0, 0.5, 1.0, 1e-9))
_STEPS, _LAST = np.float32(CABIN_STEPS - 1), CABIN_STEPS - 2
# Scratch memory of a block (see `vico.render.shadows.moving`): where a pixel is in the vehicle, what is left of the
# sun; then whether it is inside, the sun that comes in, whether by a side, and where along it.
_UNIT_A, _UNIT_B, _UNIT_C, LEFT, INSIDE = (k * STRIDE for k in (3, 4, 5, 6, 7))
_SUNLIT, _ALONG = 8 * STRIDE, 9 * STRIDE


def cabin_records(
    names: Sequence[str], cabins: Mapping[str, Cabin], low: NDArray[np.float32], high: NDArray[np.float32]
) -> tuple[NDArray[np.int32], NDArray[np.void]]:
    """Return which prototype has which cabin, as `Prototypes` has them.

    Parameters
    ----------
    names, low, high
        Of all prototypes, and their bounds, metres, shape ``(p, 3)``.
    cabins
        By the names of those that have one.
    """
    known = [name for name in names if name in cabins]
    rows, records = np.full(len(names), -1, np.int32), np.zeros(max(len(known), 1), CABIN)
    for row, name in enumerate(known):
        k = names.index(name)
        rows[k] = row
        middle, half = (low[k] + high[k]) / 2.0, np.maximum(high[k] - low[k], 1e-6) / 2.0
        _fill(records[row], cabins[name], middle.astype(np.float64), half.astype(np.float64))
    return rows, records


def _fill(record: Any, cabin: Cabin, middle: NDArray[np.float64], half: NDArray[np.float64]) -> None:
    """Write a cabin in the frame in which its vehicle's bounding box has corners at +-1."""
    record["low"] = (np.array(cabin.low) - middle) / half
    record["high"] = (np.array(cabin.high) - middle) / half
    for name in ("windows", "front", "rear"):
        record[name] = (np.array(getattr(cabin, name)) - middle[2]) / half[2]
    record["end_half"] = cabin.end_half / half[1]
    record["sharp"] = half / _PENUMBRA
    x = middle[0] + half[0] * np.linspace(-1.0, 1.0, CABIN_STEPS)
    for side, panes in enumerate((cabin.right, cabin.left)):
        for start, end in panes:
            within = np.minimum(x - start, end - x) / _PENUMBRA + 0.5
            record["open"][side] = np.maximum(record["open"][side], np.clip(within, 0.0, 1.0))


@inlined
def sun_in_cabin(cabin: Any, sun: Any, real: Any) -> None:
    """Lay whether a block's pixels are in a cabin, and for those what windows let in of the sun."""
    low, high, sharp, windows = cabin.low, cabin.high, cabin.sharp, cabin.windows
    low_a, low_b, low_c = low[0], low[1], low[2]
    high_a, high_b, high_c = high[0], high[1], high[2]
    sun_a, sun_b, sun_c = np.float32(sun[0]), np.float32(sun[1]), np.float32(sun[2])
    to_a, to_b, to_c = _inverse(sun_a), _inverse(sun_b), _inverse(sun_c)
    end_a, end_b, end_c = (
        high_a if to_a > _ZERO else low_a,
        high_b if to_b > _ZERO else low_b,
        high_c if to_c > _ZERO else low_c,
    )
    ends = cabin.front if to_a > _ZERO else cabin.rear
    sill, head, end_sill, end_head, end_half = windows[0], windows[1], ends[0], ends[1], cabin.end_half
    sharp_b, sharp_c = sharp[1], sharp[2]
    side = cabin.open[1 if to_b > _ZERO else 0]
    for i in range(PAD):
        a, b, c = real[_UNIT_A + i], real[_UNIT_B + i], real[_UNIT_C + i]
        inside = (a > low_a) & (a < high_a) & (b > low_b) & (b < high_b) & (c > low_c) & (c < high_c)
        real[INSIDE + i] = _ONE if inside else _ZERO
        # How far it is to each of the walls that the sun may come through.
        way_a, way_b, way_c = (end_a - a) * to_a, (end_b - b) * to_b, (end_c - c) * to_c
        way = min(way_a, way_b, way_c)
        hit_a, hit_b, hit_c = a + way * sun_a, b + way * sun_b, c + way * sun_c
        by_side = (way_b <= way_a) & (way_b <= way_c)
        by_end = (way_a < way_b) & (way_a <= way_c)
        pane = _within((hit_c - sill) * sharp_c) * _within((head - hit_c) * sharp_c)
        end = _within((hit_c - end_sill) * sharp_c) * _within((end_head - hit_c) * sharp_c)
        end *= _within((end_half - abs(hit_b)) * sharp_b)
        real[_SUNLIT + i] = end if by_end else (pane if by_side else _ZERO)
        along = min(max((hit_a + _ONE) * _HALF, _ZERO), _ONE) * _STEPS
        real[_ALONG + i] = along if by_side & inside else -_ONE
    for i in range(PAD):
        along = real[_ALONG + i]
        if along >= _ZERO:
            k = min(int(along), _LAST)
            real[_SUNLIT + i] *= side[k] + (along - np.float32(k)) * (side[k + 1] - side[k])
    for i in range(PAD):
        real[LEFT + i] = real[_SUNLIT + i] if real[INSIDE + i] > _ZERO else real[LEFT + i]


@inlined
def _inverse(way: Any) -> Any:
    return _ONE / (way if abs(way) > _TINY else _TINY)


@inlined
def _within(depth: Any) -> Any:
    """Return how far a point is within a rim, in penumbras: 0 well without, 1 well within."""
    return min(max(depth + _HALF, _ZERO), _ONE)
