"""Colours of many pixels at a time: texture, sun, sky light and haze; rooms behind windows that none is built for.

`vico.render.shading.shade` lays pixels into a queue, one field behind the other; here a full queue is worked off in
short loops over all of its places, which the compiler turns into vector code. Only loads from tables, which it can't,
are loops of their own. Everything is single precision: colours need no more. The ray through a window pane goes on into
a box (interior mapping).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.render.arrays import (
    AROUND,
    BLUE,
    COLUMNS,
    GREEN,
    I0,
    I1,
    I2,
    I3,
    LAMPS,
    LEVEL,
    LIT,
    MIDDLE,
    NX,
    NY,
    NZ,
    PAIR,
    PIXEL,
    QUEUE,
    RED,
    ROWS,
    SEEN,
    SHINE,
    SKY,
    START,
    SU,
    SUN,
    SV,
    T0,
    T1,
    T2,
    T3,
    WINDOW,
    A,
    B,
    F,
    G,
    U,
    V,
    X,
    Y,
    Z,
)
from vico.render.compiled import inlined, kernel
from vico.render.lighting import TONE_RANGE, TONE_STEPS
from vico.render.records import BAYS, WINDOW_GROUND, WINDOW_SHIFT, WINDOW_STOREYS
from vico.render.shadows.casters import CABIN_BLUE, CABIN_GREEN, CABIN_LAMP, CABIN_TILT
from vico.render.shadows.moving import CABINS, NO_SHADOWS

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


class PixelQueue(NamedTuple):
    """Fields of pixels that wait for their colour, one behind the other.

    Attributes
    ----------
    real, whole
        float32 and uint32, shape ``(fields * STRIDE,)``.
    glass
        As in `Buffers`.
    """

    real: NDArray[np.float32]
    whole: NDArray[np.uint32]
    glass: NDArray[np.uint8]


class MovingShadows(NamedTuple):
    """What things that move leave of the light of each pixel; see `cast_moving`.

    Attributes
    ----------
    sun, contact
        0..1, float32, shape ``(h * w,)``.
    inside
        1 in vehicles with windows, float32, shape ``(h * w,)``.
    found
        What `cast_moving` returned: with NO_SHADOWS the arrays hold nothing, with SHADOWS `inside` does not.
    """

    sun: NDArray[np.float32]
    contact: NDArray[np.float32]
    inside: NDArray[np.float32]
    found: int


_EIGHT, _TWO_CHANNELS = np.uint32(8), np.uint32(0xFF00FF)
# sRGB to linear light as a polynomial of the byte / 255: off by less than 0.003.
_P1, _P2, _P3 = np.float32(0.012522878), np.float32(0.682171111), np.float32(0.305306011)


@kernel
def look_up(texels: Any, real: Any, whole: Any, along: Any) -> None:
    """Look texels up, bilinear and repeating: red and blue (16 bits up), green and alpha (16 bits up), times 256.

    Four weights that add up to 256 multiply two channels at once.
    """
    for i in range(QUEUE):
        x, y = real[U + i] + along * real[SU + i], real[V + i] + along * real[SV + i]
        floor_x, floor_y = np.floor(x), np.floor(y)
        real[F + i], real[G + i] = x - floor_x, y - floor_y
        whole[I0 + i], whole[I1 + i] = np.int32(floor_x), np.int32(floor_y)
    # Every sum is cut to 32 bits at once: else the compiler calculates with 64, in twice as many steps.
    for i in range(QUEUE):
        last_column, last_row = np.uint32(whole[COLUMNS + i] - _UNIT), np.uint32(whole[ROWS + i] - _UNIT)
        left = np.uint32(whole[I0 + i] & last_column)
        right = np.uint32(np.uint32(whole[I0 + i] + _UNIT) & last_column)
        row, next_row = whole[I1 + i] & last_row, np.uint32(whole[I1 + i] + _UNIT) & last_row
        upper = np.uint32(whole[START + i] + np.uint32(row * whole[COLUMNS + i]))
        lower = np.uint32(whole[START + i] + np.uint32(next_row * whole[COLUMNS + i]))
        whole[I0 + i], whole[I1 + i] = np.uint32(upper + left), np.uint32(upper + right)
        whole[I2 + i], whole[I3 + i] = np.uint32(lower + left), np.uint32(lower + right)
    for i in range(QUEUE):
        whole[T0 + i] = texels[whole[I0 + i]]
        whole[T1 + i] = texels[whole[I1 + i]]
        whole[T2 + i] = texels[whole[I2 + i]]
        whole[T3 + i] = texels[whole[I3 + i]]
    for i in range(QUEUE):
        f, g = np.int32(real[F + i] * np.float32(256.0)), np.int32(real[G + i] * np.float32(256.0))
        wd = np.int32(np.int32(f * g) >> np.int32(8))
        wb, wc = np.int32(f - wd), np.int32(g - wd)
        wa = np.int32(np.int32(np.int32(256) - f) - wc)
        a, b, c, d = whole[T0 + i], whole[T1 + i], whole[T2 + i], whole[T3 + i]
        whole[PAIR + i] = _weighted_texels(a, b, c, d, np.uint32(wa), np.uint32(wb), np.uint32(wc), np.uint32(wd))
        a, b, c, d = a >> _EIGHT, b >> _EIGHT, c >> _EIGHT, d >> _EIGHT
        whole[MIDDLE + i] = _weighted_texels(a, b, c, d, np.uint32(wa), np.uint32(wb), np.uint32(wc), np.uint32(wd))


@inlined
def _weighted_texels(a: Any, b: Any, c: Any, d: Any, wa: Any, wb: Any, wc: Any, wd: Any) -> Any:
    """Return the weighed sum of two channels of four texels."""
    first = np.uint32(np.uint32(np.uint32(a & _TWO_CHANNELS) * wa) + np.uint32(np.uint32(b & _TWO_CHANNELS) * wb))
    second = np.uint32(np.uint32(np.uint32(c & _TWO_CHANNELS) * wc) + np.uint32(np.uint32(d & _TWO_CHANNELS) * wd))
    return np.uint32(first + second)


@kernel
def sample_albedo(texels: Any, real: Any, whole: Any, taps: int) -> None:
    """Multiply the colours of all places by their textures: the mean of `taps` samples along each one's step.

    A texture's alpha says how much of a place's own light is on.
    """
    if taps == 0:
        return
    share = np.float32(1.0 / taps)
    factor = np.float32(1.0 / (256.0 * 255.0)) * share
    for i in range(QUEUE):
        real[A + i], real[B + i], real[LEVEL + i], real[LIT + i] = _ZERO, _ZERO, _ZERO, _ZERO
    for tap in range(taps):
        look_up(texels, real, whole, (np.float32(tap) + _HALF) * share - _HALF)
        for i in range(QUEUE):
            pair, middle = whole[PAIR + i], whole[MIDDLE + i]
            real[A + i] += np.float32(np.int32(pair & 0xFFFF))
            real[B + i] += np.float32(np.int32(middle & 0xFFFF))
            real[LIT + i] += np.float32(np.int32(middle >> 16))
            real[LEVEL + i] += np.float32(np.int32(pair >> 16))
    for i in range(QUEUE):
        r, g, b = real[A + i] * factor, real[B + i] * factor, real[LEVEL + i] * factor
        real[RED + i] *= r * (_P1 + r * (_P2 + r * _P3))
        real[GREEN + i] *= g * (_P1 + g * (_P2 + g * _P3))
        real[BLUE + i] *= b * (_P1 + b * (_P2 + b * _P3))
        lit = real[LIT + i] * factor
        real[LIT + i] = lit
        real[SHINE + i] *= lit


@kernel
def sun_visibility(light: Any, shadow: Any, real: Any, whole: Any) -> None:
    """Leave in `real[F:]` how much of the sun every place gets: its slope, and shadows.

    Static shadows are four comparisons around a position of the shadow map, blended.
    """
    if face_sun(light, real) <= _ZERO:
        return
    _project_on_shadow_map(shadow.matrix, np.int32(shadow.closeness.shape[0]), real, whole)
    size = shadow.closeness.shape[0]
    flat = shadow.closeness.reshape(-1)
    for i in range(QUEUE):
        at = whole[I0 + i]
        below = at + np.uint32(size)
        whole[T0 + i], whole[T1 + i] = flat[at], flat[at + np.uint32(1)]
        whole[T2 + i], whole[T3 + i] = flat[below], flat[below + np.uint32(1)]
    for i in range(QUEUE):
        a, b, level = real[A + i], real[B + i], real[LEVEL + i]
        t0, t1 = np.float32(np.int32(whole[T0 + i])), np.float32(np.int32(whole[T1 + i]))
        t2, t3 = np.float32(np.int32(whole[T2 + i])), np.float32(np.int32(whole[T3 + i]))
        low = (_ONE - a if t0 <= level else _ZERO) + (a if t1 <= level else _ZERO)
        high = (_ONE - a if t2 <= level else _ZERO) + (a if t3 <= level else _ZERO)
        real[F + i] *= (low + b * (high - low)) * real[SUN + i]


@kernel
def soft_sun_visibility(light: Any, shadow: Any, real: Any, whole: Any) -> None:
    """Do what `sun_visibility` does, with rims blurred over `light.shadow_softness` texels."""
    if face_sun(light, real) <= _ZERO:
        return
    size = np.int32(shadow.closeness.shape[0])
    flat = shadow.closeness.reshape(-1)
    r = light.shadow_softness
    for i in range(QUEUE):
        real[G + i] = _ZERO
    for tap in range(_SOFT_TAPS):
        du, dv = r * _SOFT_U[tap], r * _SOFT_V[tap]
        _project_aside(shadow.matrix, size, du, dv, real, whole)
        for i in range(QUEUE):
            at = whole[I0 + i]
            below = at + np.uint32(size)
            whole[T0 + i], whole[T1 + i] = flat[at], flat[at + np.uint32(1)]
            whole[T2 + i], whole[T3 + i] = flat[below], flat[below + np.uint32(1)]
        for i in range(QUEUE):
            a, b, level = real[A + i], real[B + i], real[LEVEL + i]
            t0, t1 = np.float32(np.int32(whole[T0 + i])), np.float32(np.int32(whole[T1 + i]))
            t2, t3 = np.float32(np.int32(whole[T2 + i])), np.float32(np.int32(whole[T3 + i]))
            low = (_ONE - a if t0 <= level else _ZERO) + (a if t1 <= level else _ZERO)
            high = (_ONE - a if t2 <= level else _ZERO) + (a if t3 <= level else _ZERO)
            real[G + i] += low + b * (high - low)
    for i in range(QUEUE):
        real[F + i] *= np.float32(1.0 / _SOFT_TAPS) * real[G + i] * real[SUN + i]


# Where a soft shadow is looked up around a point, in its radius.
_SOFT_TAPS = 4
_SOFT_U = (np.float32(0.8), np.float32(-0.35), np.float32(-0.8), np.float32(0.35))
_SOFT_V = (np.float32(0.35), np.float32(0.8), np.float32(-0.35), np.float32(-0.8))


@kernel
def mirror_surroundings(light: Any, camera: Any, real: Any, whole: Any) -> None:
    """Let glass mirror the sky, or the walls across the street: change rows of the tone table in `whole`.

    Glass is what may shine by night, and stands upright.
    """
    vx, vy, vz = np.float32(camera.x), np.float32(camera.y), np.float32(camera.z)
    full = _ONE / max(light.lamp_exposure, _TINY)
    haze_red, haze_green, haze_blue = light.haze_red, light.haze_green, light.haze_blue
    zenith_red, zenith_green = light.ambient_red + light.tilt_red, light.ambient_green + light.tilt_green
    zenith_blue = light.ambient_blue + light.tilt_blue
    wall = np.float32(0.42)
    wall_red, wall_green, wall_blue = wall * light.ambient_red, wall * light.ambient_green, wall * light.ambient_blue
    for i in range(QUEUE):
        gx, gy, gz = real[X + i] - vx, real[Y + i] - vy, real[Z + i] - vz
        length = max(np.sqrt(gx * gx + gy * gy + gz * gz), _TINY)
        nx, ny, nz = real[NX + i], real[NY + i], real[NZ + i]
        facing = min(max(-(gx * nx + gy * ny + gz * nz) / length, _ZERO), _ONE)
        grazing = _ONE - facing
        fresnel = np.float32(0.10) + np.float32(0.9) * grazing * grazing * grazing * grazing * grazing
        upright = min(max(_ONE - np.float32(3.0) * abs(nz), _ZERO), _ONE)
        share = light.glass * min(real[SHINE + i] * full, _ONE) * upright * fresnel
        up = gz / length + np.float32(2.0) * facing * nz
        sky = min(max((up - np.float32(0.10)) * np.float32(3.0), _ZERO), _ONE)
        high = min(max(np.float32(1.3) * up, _ZERO), _ONE)
        red = wall_red + sky * (haze_red + high * (zenith_red - haze_red) - wall_red)
        green = wall_green + sky * (haze_green + high * (zenith_green - haze_green) - wall_green)
        blue = wall_blue + sky * (haze_blue + high * (zenith_blue - haze_blue) - wall_blue)
        a, b, c = (
            np.float32(np.int32(whole[I0 + i])),
            np.float32(np.int32(whole[I1 + i])),
            np.float32(np.int32(whole[I2 + i])),
        )
        whole[I0 + i] = np.int32(min(max(_ZERO, a + share * (red * _TONE_SCALE - a)), _TONE_LAST))
        whole[I1 + i] = np.int32(min(max(_ZERO, b + share * (green * _TONE_SCALE - b)), _TONE_LAST))
        whole[I2 + i] = np.int32(min(max(_ZERO, c + share * (blue * _TONE_SCALE - c)), _TONE_LAST))


@inlined
def face_sun(light: Any, real: Any) -> Any:
    """Leave in `real[F:]` the cosine of the sun's slope on every place, 0 where it is behind; return the largest."""
    sun_x, sun_y, sun_z = light.sun_x, light.sun_y, light.sun_z
    most = _ZERO
    for i in range(QUEUE):
        facing = max(real[NX + i] * sun_x + real[NY + i] * sun_y + real[NZ + i] * sun_z, _ZERO)
        real[F + i] = facing
        most = max(most, facing)
    return most


@inlined
def _project_on_shadow_map(frame: Any, size: Any, real: Any, whole: Any) -> None:
    """Leave every place's texel in `whole[I0:]`, its share of the next ones and its closeness to the sun in `real`."""
    _project_aside(frame, size, _ZERO, _ZERO, real, whole)


@inlined
def _project_aside(frame: Any, size: Any, du: Any, dv: Any, real: Any, whole: Any) -> None:
    """Do the same `du`, `dv` texels aside."""
    f00, f01, f02, f03 = frame[0, 0], frame[0, 1], frame[0, 2], frame[0, 3] - _HALF + du
    f10, f11, f12, f13 = frame[1, 0], frame[1, 1], frame[1, 2], frame[1, 3] - _HALF + dv
    f20, f21, f22, f23 = frame[2, 0], frame[2, 1], frame[2, 2], frame[2, 3]
    rim = np.float32(size - 1)
    # A little off the surface, or it would shade itself.
    off = np.float32(0.2)
    for i in range(QUEUE):
        px, py, pz = (
            real[X + i] + off * real[NX + i],
            real[Y + i] + off * real[NY + i],
            real[Z + i] + off * real[NZ + i],
        )
        u = f00 * px + f01 * py + f02 * pz + f03
        v = f10 * px + f11 * py + f12 * pz + f13
        level = f20 * px + f21 * py + f22 * pz + f23
        ok = (u >= _ZERO) & (v >= _ZERO) & (u < rim) & (v < rim) & (real[F + i] > _ZERO)
        u, v = u if ok else _ZERO, v if ok else _ZERO
        floor_u, floor_v = np.floor(u), np.floor(v)
        real[A + i], real[B + i] = u - floor_u, v - floor_v
        real[LEVEL + i] = level if ok else np.float32(1e9)
        whole[I0 + i] = np.int32(floor_v) * size + np.int32(floor_u)


@kernel
def light_outdoors(light: Any, camera: Any, real: Any, whole: Any) -> None:
    """Light places by sun, sky and haze: leave rows of the tone table in `whole`."""
    vx, vy, vz = np.float32(camera.x), np.float32(camera.y), np.float32(camera.z)
    sun_x, sun_y, sun_z = light.sun_x, light.sun_y, light.sun_z
    sun_red, sun_green, sun_blue = light.sun_red, light.sun_green, light.sun_blue
    ambient_red, ambient_green, ambient_blue = light.ambient_red, light.ambient_green, light.ambient_blue
    tilt_red, tilt_green, tilt_blue = light.tilt_red, light.tilt_green, light.tilt_blue
    haze_red, haze_green, haze_blue = light.haze_red, light.haze_green, light.haze_blue
    haze_per_metre, side_x, side_y = light.haze_per_metre, light.side_x, light.side_y
    green_shine, blue_shine = np.float32(0.86), np.float32(0.62)
    for i in range(QUEUE):
        gx, gy, gz = real[X + i] - vx, real[Y + i] - vy, real[Z + i] - vz
        length = np.sqrt(gx * gx + gy * gy + gz * gz)
        haze = length * haze_per_metre
        clear = _ONE / (_ONE + haze * (_ONE + haze * (_HALF + haze * np.float32(0.1666))))
        haze = _ONE - clear
        toward = max((gx * sun_x + gy * sun_y + gz * sun_z) / max(length, _TINY), _ZERO)
        glow = np.float32(0.10) * toward * toward * toward
        nz, share = real[NZ + i], real[SKY + i] * real[AROUND + i]
        side = real[NX + i] * side_x + real[NY + i] * side_y
        facing, shine = real[F + i], real[SHINE + i] + real[LAMPS + i] * real[AROUND + i]
        red = real[RED + i] * (facing * sun_red + (ambient_red + nz * tilt_red + side) * share + shine)
        green = real[GREEN + i] * (
            facing * sun_green + (ambient_green + nz * tilt_green + side) * share + shine * green_shine
        )
        blue = real[BLUE + i] * (
            facing * sun_blue + (ambient_blue + nz * tilt_blue + side) * share + shine * blue_shine
        )
        # Zero comes first below: compared so, what is no number (a wall seen edge-on) turns into 0, a valid row.
        red = (haze * (haze_red + glow * sun_red) + clear * red) * _TONE_SCALE
        green = (haze * (haze_green + glow * sun_green) + clear * green) * _TONE_SCALE
        blue = (haze * (haze_blue + glow * sun_blue) + clear * blue) * _TONE_SCALE
        whole[I0 + i] = np.int32(min(max(_ZERO, red), _TONE_LAST))
        whole[I1 + i] = np.int32(min(max(_ZERO, green), _TONE_LAST))
        whole[I2 + i] = np.int32(min(max(_ZERO, blue), _TONE_LAST))


@kernel
def light_room(camera: Any, real: Any, whole: Any) -> None:
    """Light places by a lamp under the ceiling's middle, corners dimmer: leave rows of the tone table in `whole`.

    What shines is a window: it shows the daylight, whatever the lamp does.
    """
    cx, cy, cz = np.float32(camera.room_x), np.float32(camera.room_y), np.float32(camera.room_z)
    length, width = np.float32(camera.room_half_length), np.float32(camera.room_half_width)
    height = np.float32(camera.room_height)
    c, s = np.float32(camera.room_cos), np.float32(camera.room_sin)
    lamp_height = np.float32(0.92) * height
    fall = np.float32(2.0) / (length * length + width * width + np.float32(6.0))
    all_lamp, all_around, window = camera.room_lamp, camera.room_around, camera.room_window
    # Lamps are warm.
    red, blue = _ONE + np.float32(0.04) * all_lamp, _ONE - np.float32(0.07) * all_lamp
    for i in range(QUEUE):
        px, py, pz = real[X + i] - cx, real[Y + i] - cy, real[Z + i] - cz
        nx, ny, nz = real[NX + i], real[NY + i], real[NZ + i]
        lz = lamp_height - pz
        squared = px * px + py * py + lz * lz
        facing = (lz * nz - px * nx - py * ny) / np.sqrt(squared + np.float32(1e-6))
        lamp = np.float32(0.62) * max(facing, _ZERO) / (_ONE + squared * fall)
        a, b = length - abs(px * c + py * s), width - abs(py * c - px * s)
        up = min(pz, height - pz)
        # Distance to the second nearest of floor, ceiling and walls: small in edges and corners.
        second = max(max(min(a, b), min(max(a, b), up)), _ZERO)
        corner = _ONE - np.float32(0.30) / (_ONE + second * second * np.float32(9.0))
        glass = min(real[SHINE + i], _ONE)
        around = all_around + glass * (window - all_around)
        lamp *= all_lamp + glass * (window - all_lamp)
        bright = ((np.float32(0.36) + np.float32(0.05) * nz + np.float32(0.03) * nx) * around + lamp) * corner
        bright *= (np.float32(0.4) + np.float32(0.6) * real[AROUND + i]) * _TONE_SCALE
        whole[I0 + i] = np.int32(min(max(_ZERO, real[RED + i] * bright * red), _TONE_LAST))
        whole[I1 + i] = np.int32(min(max(_ZERO, real[GREEN + i] * bright), _TONE_LAST))
        whole[I2 + i] = np.int32(min(max(_ZERO, real[BLUE + i] * bright * blue), _TONE_LAST))


@kernel
def cover_ground(light: Any, real: Any) -> None:
    """Darken wet ground, and whiten by snow what looks up; below 0, `SKY` says of a place that nothing lies on it."""
    wet, snow = np.float32(0.45) * light.wet, light.snow_cover
    white, blue_white = np.float32(0.86), np.float32(0.90)
    for i in range(QUEUE):
        nz, sky = real[NZ + i], real[SKY + i]
        lies = _ONE if sky > _ZERO else _ZERO
        real[SKY + i] = abs(sky)
        ground = min(max(nz * np.float32(8.0) - np.float32(6.6), _ZERO), _ONE)
        dark = _ONE - lies * wet * (np.float32(0.3) + np.float32(0.7) * ground)
        share = min(max((nz - np.float32(0.25)) * np.float32(2.2), _ZERO), _ONE)
        share = lies * snow * share * share * (np.float32(3.0) - np.float32(2.0) * share)
        bare = (_ONE - share) * dark
        real[RED + i] = real[RED + i] * bare + white * share
        real[GREEN + i] = real[GREEN + i] * bare + white * share
        real[BLUE + i] = real[BLUE + i] * bare + blue_white * share
        real[SHINE + i] *= _ONE - share


@kernel
def _take_under_roof(inside: Any, real: Any, whole: Any) -> None:
    """Leave word in `SKY` that neither rain nor snow falls into vehicles."""
    for i in range(QUEUE):
        if inside[whole[PIXEL + i]] > _ZERO:
            real[SKY + i] = -abs(real[SKY + i])


@kernel
def _light_cabins(lamps: Any, inside: Any, real: Any, whole: Any) -> None:
    """Add the light of lamps under their ceilings to what is seen in vehicles: change rows of the tone table."""
    for i in range(QUEUE):
        lamp = lamps * inside[whole[PIXEL + i]] * (CABIN_LAMP + CABIN_TILT * real[NZ + i]) * _TONE_SCALE
        a = np.float32(np.int32(whole[I0 + i])) + lamp * real[RED + i]
        b = np.float32(np.int32(whole[I1 + i])) + lamp * real[GREEN + i] * CABIN_GREEN
        c = np.float32(np.int32(whole[I2 + i])) + lamp * real[BLUE + i] * CABIN_BLUE
        whole[I0 + i], whole[I1 + i] = np.int32(min(a, _TONE_LAST)), np.int32(min(b, _TONE_LAST))
        whole[I2 + i] = np.int32(min(c, _TONE_LAST))


@kernel
def finish(light: Any, camera: Any, texels: Any, queue: Any, moving: Any, count: int, taps: int, out: Any) -> None:
    """Colour the first `count` places of the queue and write their pixels; `out` has one dimension."""
    real, whole, tone = queue.real, queue.whole, light.tone
    if moving.found != NO_SHADOWS:
        sun, contact = moving.sun, moving.contact
        for i in range(QUEUE):
            pixel = whole[PIXEL + i]
            real[SUN + i], real[AROUND + i] = sun[pixel], contact[pixel]
    sample_albedo(texels, real, whole, taps)
    if camera.indoors:
        light_room(camera, real, whole)
    else:
        if light.uniforms.snow_cover > _ZERO or light.uniforms.wet > _ZERO:
            if moving.found == CABINS:
                _take_under_roof(moving.inside, real, whole)
            cover_ground(light.uniforms, real)
        if light.uniforms.shadow_softness > _ZERO:
            soft_sun_visibility(light.uniforms, light.shadow, real, whole)
        else:
            sun_visibility(light.uniforms, light.shadow, real, whole)
        light_outdoors(light.uniforms, camera, real, whole)
        if moving.found == CABINS and light.uniforms.lamp_exposure > _ZERO:
            _light_cabins(light.uniforms.lamp_exposure, moving.inside, real, whole)
        if light.uniforms.interiors > _ZERO:
            glass = queue.glass
            if look_into_windows(light.uniforms, camera, taps > 0, real, whole):
                for i in range(count):
                    glass[whole[PIXEL + i]] = np.uint8(real[SEEN + i] * np.float32(255.0))
        if light.uniforms.glass > _ZERO:
            mirror_surroundings(light.uniforms, camera, real, whole)
    for i in range(count):
        pixel = whole[PIXEL + i] * np.uint32(3)
        out[pixel] = tone[whole[I0 + i]]
        out[pixel + np.uint32(1)] = tone[whole[I1 + i]]
        out[pixel + np.uint32(2)] = tone[whole[I2 + i]]


@kernel
def finish_sky(sky: Any, queue: Any, count: int, out: Any) -> None:
    """Write the first `count` places of the sky's queue."""
    real, whole = queue.real, queue.whole
    look_up(sky, real, whole, _ZERO)
    for i in range(count):
        pixel = whole[PIXEL + i] * np.uint32(3)
        pair = whole[PAIR + i]
        out[pixel] = np.uint8((pair >> 8) & 0xFF)
        out[pixel + np.uint32(1)] = np.uint8((whole[MIDDLE + i] >> 8) & 0xFF)
        out[pixel + np.uint32(2)] = np.uint8(pair >> 24)
