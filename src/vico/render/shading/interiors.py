"""Rooms behind windows that none is built for: boxes that the ray through a pane goes on into."""

from __future__ import annotations

from typing import Any

import numpy as np

from vico.render.arrays import QUEUE
from vico.render.compiled import inlined, kernel
from vico.render.lighting import TONE_RANGE, TONE_STEPS
from vico.render.records import BAYS, WINDOW_GROUND, WINDOW_SHIFT, WINDOW_STOREYS
from vico.render.shading.fields import COLUMNS, I0, I1, I2, LIT, NX, NY, NZ, ROWS, SEEN, SHINE, WINDOW, U, V, X, Y, Z

_ZERO, _HALF, _ONE = np.float32(0.0), np.float32(0.5), np.float32(1.0)
_TINY, _UNIT = np.float32(1e-12), np.uint32(1)
_TONE_SCALE = np.float32((TONE_STEPS - 1) / TONE_RANGE)
_TONE_LAST = np.float32(TONE_STEPS - 1)
# A bay and a storey as rooms have them, metres; what is farther away shows no rooms, and begins to before.
_BAY, _STOREY, _FARTHEST, _FADE = np.float32(3.2), np.float32(2.9), np.float32(70.0), np.float32(1.0 / 25.0)
# Alpha of a texture from which on it is a pane, inverse.
_PANE = np.float32(50.0)
_BAYS = np.float32(BAYS)


@inlined
def _part_of(number: Any, low: Any) -> Any:
    """Return eight bits of a random number as a share, 0..1."""
    return np.float32(np.int32((number >> np.uint32(low)) & np.uint32(255))) * np.float32(1.0 / 255.0)


@kernel
def look_into_windows(light: Any, camera: Any, textured: bool, real: Any, whole: Any) -> bool:
    """Show a room behind each bay of a facade: change rows of the tone table in `whole`.

    The ray goes on into a box with a floor, a ceiling, walls and a piece of furniture, all decided by the number of
    the building and of the bay (interior mapping, J. van Dongen 2008). Leaves in `real[SEEN:]` how much of what is
    behind is seen through panes of ground floors; returns whether anything is.
    """
    # Whole numbers: a greatest float of all would not become vector code.
    codes = np.uint32(0)
    for i in range(QUEUE):
        codes |= whole[WINDOW + i] if real[LIT + i] > _ZERO else np.uint32(0)
        real[SEEN + i] = _ZERO
    if codes == 0 or not textured:
        return False
    vx, vy, vz = np.float32(camera.x), np.float32(camera.y), np.float32(camera.z)
    dusk = min(light.lamp_exposure * np.float32(1.0 / 1.6), _ONE)
    day_red, day_green, day_blue = light.ambient_red, light.ambient_green, light.ambient_blue
    for i in range(QUEUE):
        code = whole[WINDOW + i]
        nx, ny = real[NX + i], real[NY + i]
        gx, gy, gz = real[X + i] - vx, real[Y + i] - vy, real[Z + i] - vz
        length = max(np.sqrt(gx * gx + gy * gy + gz * gz), _TINY)
        inverse = _ONE / length
        ahead = max(-(gx * nx + gy * ny) * inverse, np.float32(0.02))
        aside, up = (gy * nx - gx * ny) * inverse, gz * inverse
        grazing = _ONE - min(ahead, _ONE)
        clear = np.float32(0.90) * (_ONE - grazing * grazing * grazing * grazing * grazing)
        upright = min(max(_ONE - np.float32(3.0) * abs(real[NZ + i]), _ZERO), _ONE)
        pane = min(real[LIT + i] * _PANE, _ONE) * upright * clear
        pane *= min(max((_FARTHEST - length) * _FADE, _ZERO), _ONE)
        pane = pane if code != 0 else _ZERO
        real[SEEN + i] = pane if code & WINDOW_GROUND != 0 else _ZERO
        storeys = np.float32(np.int32(code & WINDOW_STOREYS))
        # Where in the bay, and which one.
        u = (real[U + i] + _HALF) / np.float32(np.int32(whole[COLUMNS + i])) * _BAYS
        v = (real[V + i] + _HALF) / np.float32(np.int32(whole[ROWS + i])) * storeys
        bay, storey = np.floor(u), np.floor(v)
        x, z = (u - bay) * _BAY, (v - storey) * _STOREY
        bay_number, storey_number = np.uint32(np.int32(bay) & 7), np.uint32(np.int32(storey) & 3)
        number = np.uint32(np.uint32(code >> WINDOW_SHIFT) * np.uint32(0x9E3779B1))
        number = np.uint32(
            number ^ np.uint32(np.uint32(bay_number * np.uint32(4) + storey_number + _UNIT) * np.uint32(0x85EBCA6B))
        )
        number = np.uint32(np.uint32(number ^ (number >> np.uint32(15))) * np.uint32(0x2C1B3C6D))
        number = np.uint32(number ^ (number >> np.uint32(13)))
        first, second, third = _part_of(number, 0), _part_of(number, 8), _part_of(number, 16)
        depth = np.float32(2.6) + np.float32(2.4) * first
        # How far the ray goes to each wall, and to where furniture stands.
        to_side = ((_BAY - x) if aside > _ZERO else x) / max(abs(aside), np.float32(1e-4))
        to_level = ((_STOREY - z) if up > _ZERO else z) / max(abs(up), np.float32(1e-4))
        to_back, to_thing = depth / ahead, np.float32(0.62) * depth / ahead
        way = min(to_side, min(to_level, to_back))
        is_level = (to_level <= to_side) & (to_level <= to_back)
        is_back = (to_back < to_side) & (to_back < to_level)
        tx, tz = x + aside * to_thing, z + up * to_thing
        left = np.float32(0.3) + np.float32(1.4) * second
        tall = np.float32(0.7) + np.float32(1.2) * third
        is_thing = (to_thing < way) & (tx > left) & (tx < left + np.float32(1.1)) & (tz < tall)
        way = to_thing if is_thing else way
        hx, hy, hz = x + aside * way, ahead * way, z + up * way
        # A picture on the wall at the back, a door beside it.
        is_frame = is_back & (abs(hx - np.float32(0.7) - np.float32(1.6) * third) < np.float32(0.36))
        is_frame &= abs(hz - np.float32(1.65)) < np.float32(0.28)
        warm = np.float32(0.50) + np.float32(0.34) * second
        red, green, blue = (
            warm,
            warm * (np.float32(0.90) + np.float32(0.08) * third),
            warm * (np.float32(0.70) + np.float32(0.25) * first),
        )
        ceiling = is_level & (up > _ZERO)
        floor = is_level & (up <= _ZERO)
        red = np.float32(0.82) if ceiling else (np.float32(0.30) if floor else red)
        green = np.float32(0.80) if ceiling else (np.float32(0.20) if floor else green)
        blue = np.float32(0.76) if ceiling else (np.float32(0.12) if floor else blue)
        dark = np.float32(0.12) + np.float32(0.22) * first
        red = dark if is_thing else (np.float32(0.22) if is_frame else red)
        green = dark * np.float32(0.8) if is_thing else (np.float32(0.26) if is_frame else green)
        blue = dark * np.float32(0.62) if is_thing else (np.float32(0.30) if is_frame else blue)
        # By day light comes in by the pane; at night there is a lamp in the middle, where one is on.
        lx, ly, lz = hx - _HALF * _BAY, hy - _HALF * depth, hz - np.float32(2.5)
        lamp = np.float32(1.7) / (_ONE + np.float32(1.6) * (lx * lx + ly * ly + lz * lz)) + np.float32(0.06)
        lamp += np.float32(2.2) if ceiling & (lx * lx + ly * ly < np.float32(0.05)) else _ZERO
        lamp *= real[SHINE + i] * np.float32(1.25) if real[LIT + i] > np.float32(0.1) else _ZERO
        daylight = np.float32(0.26) / (_ONE + np.float32(0.30) * hy) * (_ONE - np.float32(0.8) * dusk)
        red *= daylight * day_red + lamp
        green *= daylight * day_green + lamp * np.float32(0.84)
        blue *= daylight * day_blue + lamp * np.float32(0.58)
        share = np.float32(0.66) * pane if storeys > _ZERO else _ZERO
        a = np.float32(np.int32(whole[I0 + i]))
        b = np.float32(np.int32(whole[I1 + i]))
        c = np.float32(np.int32(whole[I2 + i]))
        whole[I0 + i] = np.int32(min(max(_ZERO, a + share * (red * _TONE_SCALE - a)), _TONE_LAST))
        whole[I1 + i] = np.int32(min(max(_ZERO, b + share * (green * _TONE_SCALE - b)), _TONE_LAST))
        whole[I2 + i] = np.int32(min(max(_ZERO, c + share * (blue * _TONE_SCALE - c)), _TONE_LAST))
    return codes & np.uint32(WINDOW_GROUND) != 0
