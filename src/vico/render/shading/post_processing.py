"""Post-processing of a finished picture: darker corners, smoother edges, and the weather.

Weather adds what wet ground mirrors, and drops and flakes that fall before the picture. Wet ground mirrors what the
picture itself shows: the ray off it is followed up its column until something stands in its way, which is exact for a
camera that is not tilted sideways. What the picture does not show cannot be mirrored.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.render.compiled import inlined, kernel
from vico.render.lighting import TONE_RANGE, TONE_STEPS
from vico.render.uniforms import Light
from vico.render.visibility.rasteriser import inverse_depth, triangle_number

# Ambient occlusion looks this far around a point, metres, at no more pixels than that.
_REACH, _MOST_PIXELS = 0.55, 28.0
_OFF = 0.30  # what is farther off a surface than this takes no light from it, metres
_LOOKS = 3
_LEAST_PIXELS = np.float32(1.7)  # what is farther away is left alone
_STRENGTH, _BIAS = 1.25, 0.12
# Sharper steps of brightness than this (of 255, and of the brighter one) are smoothed.
_STEP, _SHARE = 8.0, 0.09
# Neighbours begin to look in other directions.
_TURNS = np.array([(math.cos(k), math.sin(k)) for k in np.arange(16) * (math.pi / 8) * 5], np.float32)
_NUMBER = np.uint64(0xFFFFFFFF)
_INDEX = 0x7FFFFFFF  # masked so, an index is not negative for all the compiler knows


def occlude(camera: Any, keys: NDArray[np.uint64], rgb: NDArray[np.uint8]) -> None:
    """Darken what lies in corners and beneath things, by what the picture shows around each point.

    Parameters
    ----------
    camera
        Its `CAMERA_UNIFORMS`.
    keys
        Of the picture's pixels, as the visibility pass left them.
    rgb
        sRGB, uint8, shape ``(h, w, 3)``; changed.
    """
    rows, columns = (int(camera["height"]) + 1) // 2, (int(camera["width"]) + 1) // 2
    near, far = np.zeros((rows, columns), np.float32), np.zeros((rows, columns), np.float32)
    open_, blurred = np.ones((rows, columns), np.float32), np.ones((rows, columns), np.float32)
    _half_size(camera, keys, near)
    _look_around(camera, near, _TURNS, open_)
    _blur(near, open_, far, blurred)
    _darken(camera, keys, near, blurred, rgb)


@kernel
def _half_size(camera: Any, keys: Any, near: Any) -> None:
    """Write the inverse depth of every second pixel, 0 where nothing is seen."""
    width = camera.width
    for row in range(near.shape[0]):
        for column in range(near.shape[1]):
            key = keys[2 * row * width + 2 * column]
            near[row, column] = inverse_depth(key) if triangle_number(key) != 0 else np.float32(0.0)


@kernel
def _look_around(camera: Any, near: Any, turns: Any, out: Any) -> None:
    """Write how much of its surroundings is open above each point, 0..1."""
    rows, columns = near.shape
    flat = near.reshape(-1)
    focal = np.float32(camera.focal * 0.5)
    cx, cy = np.float32(camera.centre_x * 0.5 - 0.25), np.float32(camera.centre_y * 0.5 - 0.25)
    widest = max(np.float32(_MOST_PIXELS), np.float32(0.05) * focal)
    one, zero, reach = np.float32(1.0), np.float32(0.0), np.float32(_REACH)
    for row in range(1, rows - 1):
        for column in range(1, columns - 1):
            w = near[row, column]
            if w == zero:
                continue
            z = one / w
            radius = min(reach * focal * w, widest)
            if radius < _LEAST_PIXELS:
                continue
            x, y = (np.float32(column) - cx) / focal * z, (np.float32(row) - cy) / focal * z
            # The plane that the pixel shows: of the two neighbours on each axis, the one that is on it.
            left, right, up, down = (
                near[row, column - 1],
                near[row, column + 1],
                near[row - 1, column],
                near[row + 1, column],
            )
            sx = right - w if abs(right - w) < abs(w - left) else w - left
            sy = down - w if abs(down - w) < abs(w - up) else w - up
            # Inverse depth is a linear function of the picture; its steps are the plane's normal.
            nx, ny = sx * focal, sy * focal
            nz = w - sx * (np.float32(column) - cx) - sy * (np.float32(row) - cy)
            scale = -one / max(np.sqrt(nx * nx + ny * ny + nz * nz), np.float32(1e-9))
            nx, ny, nz = nx * scale, ny * scale, nz * scale
            turn = turns[(row & 3) * 4 + (column & 3)]
            hidden = zero
            for k in range(_LOOKS):
                length = radius * (np.float32(k) + np.float32(0.7)) / np.float32(_LOOKS)
                # A golden angle from look to look.
                a = turn[0] * _COS[k] - turn[1] * _SIN[k]
                b = turn[1] * _COS[k] + turn[0] * _SIN[k]
                i, j = (
                    int(np.float32(column) + a * length + np.float32(0.5)),
                    int(np.float32(row) + b * length + np.float32(0.5)),
                )
                if i < 0 or j < 0 or i >= columns or j >= rows:
                    continue
                v = flat[(j * columns + i) & _INDEX]
                if v == zero:
                    continue
                d = one / v
                dx, dy, dz = (np.float32(i) - cx) / focal * d - x, (np.float32(j) - cy) / focal * d - y, d - z
                squared = dx * dx + dy * dy + dz * dz
                height = nx * dx + ny * dy + nz * dz
                above = height / np.sqrt(squared + np.float32(1e-6))
                # What stands off in the air, like a head before a wall, lets light in behind it.
                off = height * height * np.float32(1.0 / _OFF**2)
                fade = max(one - off - squared / (np.float32(2.0) * reach * reach), zero)
                hidden += max(above - np.float32(_BIAS), zero) * fade
            out[row, column] = max(one - np.float32(_STRENGTH / _LOOKS) * hidden, np.float32(0.35))


_COS = tuple(np.float32(math.cos(2.39996 * k)) for k in range(_LOOKS))
_SIN = tuple(np.float32(math.sin(2.39996 * k)) for k in range(_LOOKS))


@kernel
def _blur(near: Any, values: Any, scratch: Any, out: Any) -> None:
    """Write the mean over 4 x 4 pixels of about the same depth: the pattern in which neighbours look around.

    One neighbour of a whole row after the other, so that the compiler makes vector code of it.
    """
    rows, columns = near.shape
    total, weight = np.empty(columns, np.float32), np.empty(columns, np.float32)
    for row in range(rows):
        total[:] = weight[:] = np.float32(0.0)
        for step in range(-1, 3):
            first, end = max(-step, 0), columns - max(step, 0)
            _add_alike(
                near[row, first:end],
                near[row, first + step : end + step],
                values[row, first + step : end + step],
                total[first:end],
                weight[first:end],
            )
        scratch[row] = total / weight
    for row in range(rows):
        total[:] = weight[:] = np.float32(0.0)
        for other in range(max(row - 1, 0), min(row + 3, rows)):
            _add_alike(near[row], near[other], scratch[other], total, weight)
        out[row] = total / weight


@inlined
def _add_alike(near: Any, other: Any, values: Any, total: Any, weight: Any) -> None:
    """Add neighbours' values to sums, as far as they are as near."""
    for i in range(len(near)):
        w = near[i]
        same = np.float32(1.0) if abs(other[i] - w) < np.float32(0.06) * w else np.float32(0.001)
        total[i] += same * values[i]
        weight[i] += same


@kernel
def _darken(camera: Any, keys: Any, near: Any, open_: Any, rgb: Any) -> None:
    """Multiply the colours of 2 x 2 pixels by what their half-size pixel says, or one beside it that is as near."""
    width, rows, columns = camera.width, near.shape[0], near.shape[1]
    flat = rgb.reshape(-1)
    for j in range(rows):
        for i in range(columns):
            share = open_[j, i]
            right, below = min(i + 1, columns - 1), min(j + 1, rows - 1)
            if min(min(share, open_[j, right]), min(open_[below, i], open_[below, right])) > np.float32(0.985):
                continue
            for row in range(2 * j, min(2 * j + 2, camera.height)):
                for column in range(2 * i, min(2 * i + 2, width)):
                    at = row * width + column
                    if triangle_number(keys[at]) == 0:
                        continue
                    w = inverse_depth(keys[at])
                    y, x = (below if row & 1 else j), (right if column & 1 else i)
                    here = share
                    if abs(near[y, x] - w) < np.float32(0.06) * w:
                        here = open_[y, x]
                        if abs(near[j, i] - w) < np.float32(0.06) * w:
                            here = np.float32(0.5) * (here + share)
                    for channel in range(3):
                        flat[3 * at + channel] = np.uint8(np.float32(flat[3 * at + channel]) * here)


def smooth_edges(camera: Any, keys: NDArray[np.uint64], rgb: NDArray[np.uint8]) -> None:
    """Smooth the steps between one triangle and another along their edges; see `occlude`."""
    bright = np.empty(rgb.shape[:2], np.float32)
    _smooth(camera, keys, rgb.copy(), bright, rgb)


@kernel
def _smooth(camera: Any, keys: Any, source: Any, bright: Any, out: Any) -> None:
    width, height = camera.width, camera.height
    flat, flat_bright = source.reshape(-1), bright.reshape(-1)
    for i in range(len(flat_bright)):
        flat_bright[i] = np.float32(flat[3 * i + 1])  # green is most of what is bright
    is_edge = np.empty(width, np.bool_)
    for row in range(1, height - 1):
        # Slices, so that the compiler makes vector code of the comparisons.
        start = row * width
        here = keys[start : start + width]
        left, right = keys[start - 1 : start - 1 + width], keys[start + 1 : start + 1 + width]
        above, below = keys[start - width : start], keys[start + width : start + 2 * width]
        for i in range(width):
            key = here[i]
            other = (key ^ left[i]) | (key ^ right[i]) | (key ^ above[i]) | (key ^ below[i])
            is_edge[i] = (other & _NUMBER) != np.uint64(0)
        b0, b3, b4 = bright[row], bright[row - 1], bright[row + 1]
        b1, b2 = flat_bright[start - 1 : start - 1 + width], flat_bright[start + 1 : start + 1 + width]
        for i in range(width):
            b = b0[i]
            step = max(max(abs(b - b1[i]), abs(b - b2[i])), max(abs(b - b3[i]), abs(b - b4[i])))
            is_edge[i] &= step > np.float32(_STEP)
        for column in range(1, width - 1):
            if is_edge[column]:
                _smooth_pixel(source, bright, row, column, out)


@inlined
def _smooth_pixel(source: Any, bright: Any, row: int, column: int, out: Any) -> None:
    """Mix a pixel with those along the edge that it lies on (after FXAA, T. Lottes)."""
    nw, ne = bright[row - 1, column - 1], bright[row - 1, column + 1]
    sw, se = bright[row + 1, column - 1], bright[row + 1, column + 1]
    here = bright[row, column]
    low, high = min(here, min(min(nw, ne), min(sw, se))), max(here, max(max(nw, ne), max(sw, se)))
    if high - low < max(np.float32(_STEP), np.float32(_SHARE) * high):
        return
    dx, dy = (sw + se) - (nw + ne), (nw + sw) - (ne + se)
    least = min(abs(dx), abs(dy)) + max((nw + ne + sw + se) * np.float32(0.03), np.float32(2.0))
    dx = min(max(dx / least, -_FARTHEST), _FARTHEST)
    dy = min(max(dy / least, -_FARTHEST), _FARTHEST)
    y, x = np.float32(row), np.float32(column)
    a0, a1, a2 = _bilinear(source, y - dy * _SIXTH, x - dx * _SIXTH)
    b0, b1, b2 = _bilinear(source, y + dy * _SIXTH, x + dx * _SIXTH)
    c0, c1, c2 = _bilinear(source, y - dy * _HALF, x - dx * _HALF)
    d0, d1, d2 = _bilinear(source, y + dy * _HALF, x + dx * _HALF)
    r, g, b = _HALF * (a0 + b0), _HALF * (a1 + b1), _HALF * (a2 + b2)
    wide_r, wide_g = _HALF * (r + _HALF * (c0 + d0)), _HALF * (g + _HALF * (c1 + d1))
    wide_b = _HALF * (b + _HALF * (c2 + d2))
    # Where the far ends belong to something else, the near ones do.
    if low <= wide_g <= high:
        r, g, b = wide_r, wide_g, wide_b
    out[row, column, 0], out[row, column, 1] = np.uint8(r + _HALF), np.uint8(g + _HALF)
    out[row, column, 2] = np.uint8(b + _HALF)


_SIXTH, _HALF, _FARTHEST = np.float32(1.0 / 6.0), np.float32(0.5), np.float32(4.0)


@inlined
def _weighted_sum(source: Any, j: int, i: int, channel: int, shares: Any) -> Any:
    upper = shares[0] * np.float32(source[j, i, channel]) + shares[1] * np.float32(source[j, i + 1, channel])
    lower = shares[2] * np.float32(source[j + 1, i, channel]) + shares[3] * np.float32(source[j + 1, i + 1, channel])
    return upper + lower


@inlined
def _bilinear(source: Any, y: Any, x: Any) -> Any:
    """Return the colour between pixels, mixed of four; beyond the rim, the rim's."""
    rows, columns = source.shape[0], source.shape[1]
    y = min(max(y, np.float32(0.0)), np.float32(rows) - np.float32(1.001))
    x = min(max(x, np.float32(0.0)), np.float32(columns) - np.float32(1.001))
    j, i = int(y), int(x)
    t, s = y - np.float32(j), x - np.float32(i)
    one = np.float32(1.0)
    shares = (one - s) * (one - t), s * (one - t), (one - s) * t, s * t
    return (
        _weighted_sum(source, j, i, 0, shares),
        _weighted_sum(source, j, i, 1, shares),
        _weighted_sum(source, j, i, 2, shares),
    )


#: Dryer ground than this mirrors nothing.
_LEAST_WET = 0.02
# Cameras that look down more steeply than this (cosine) see no mirror image worth its time.
_LEAST_LEVEL = 0.5
# Drops and flakes before a camera at a rain, or snowfall, of 1 mm/h.
_DROPS, _FLAKES = 140.0, 520.0
_DROP_SPEED, _FLAKE_SPEED = 6.5, 1.1  # m/s
_DROP_LENGTH, _FLAKE_SIZE = 0.17, 0.014  # m; a drop's in the time that a picture takes
_WHITE = 0.9
# Rays that go up for each metre of depth by more than this see no ground.
_HORIZON = -0.004
# Columns beside one another that mirror the same row.
_ALIKE = 4


class _Falling(NamedTuple):
    """What falls.

    Attributes
    ----------
    number
        How many of them.
    speed, size
        How fast, m/s, and how large, metres.
    moment
        Seconds.
    """

    number: int
    speed: float
    size: float
    moment: float


def draw_weather(camera: Any, light: Light, keys: NDArray[np.uint64], moment: float, rgb: NDArray[np.uint8]) -> None:
    """Draw over a finished picture what weather adds to it; nothing in a room, and in dry air over dry ground.

    Parameters
    ----------
    camera
        Its `CAMERA_UNIFORMS`.
    keys
        Of the picture's pixels, as the visibility pass left them.
    moment
        Seconds; where drops and flakes are depends on it alone.
    rgb
        sRGB, uint8, shape ``(h, w, 3)``; changed.
    """
    uniforms = light.uniforms
    if camera["indoors"]:
        return
    if uniforms["wet"] > _LEAST_WET and math.hypot(camera["forward_x"], camera["forward_y"]) > _LEAST_LEVEL:
        _mirror(camera, keys, float(uniforms["wet"]), _tone_of(light, "haze", 1.0), rgb)
    if uniforms["rain"] > 0.0:
        count = int(_DROPS * math.sqrt(uniforms["rain"]))
        drops = _Falling(count, _DROP_SPEED, _DROP_LENGTH, moment)
        _draw_drops(camera, keys, drops, _tone_of(light, "ambient", 1.0), rgb)
    if uniforms["snowfall"] > 0.0:
        count = int(_FLAKES * math.sqrt(uniforms["snowfall"]))
        white = _tone_of(light, "ambient", _WHITE)
        _draw_flakes(camera, keys, _Falling(count, _FLAKE_SPEED, _FLAKE_SIZE, moment), white, rgb)


def _tone_of(light: Light, name: str, share: float) -> NDArray[np.float32]:
    """Return a colour of the light as the picture shows it, sRGB, float32, shape ``(3,)``."""
    linear = [float(light.uniforms[f"{name}_{channel}"]) * share for channel in ("red", "green", "blue")]
    rows = np.clip(np.array(linear) * ((TONE_STEPS - 1) / TONE_RANGE), 0, TONE_STEPS - 1).astype(np.int64)
    return light.tone[rows].astype(np.float32)


@inlined
def _ray_along(camera: Any, level: float, row: int) -> Any:
    """Return how far a row's rays go ahead, over the ground, and up, for each metre of depth."""
    down = (row + 0.5 - camera.centre_y) / camera.focal
    tilt = (camera.down_x * camera.forward_x + camera.down_y * camera.forward_y) / level
    return level + down * tilt, camera.forward_z + down * camera.down_z


@inlined
def _is_level(keys: Any, at: int, other: int, ups: Any, pixel: float) -> bool:
    """Return whether what a pixel shows lies level, by the pixel `other` places on and the one beside it.

    `ups` are how far its ray and the other one's go up for each metre of depth; `pixel` is a pixel at one metre.
    """
    below, beside = keys[at + other], keys[at + 1]
    if triangle_number(below) == 0 or triangle_number(beside) == 0:
        return False
    here, there, next_ = inverse_depth(keys[at]), inverse_depth(below), inverse_depth(beside)
    # Heights differ by less than half of what they would on a wall.
    rise, aside = ups[0] * there - ups[1] * here, ups[0] * (next_ - here)
    return abs(rise) < 0.5 * pixel * there and abs(aside) < 0.5 * pixel * next_


@inlined
def _noise_at(i: int, j: int) -> float:
    """Return a number that looks random of two whole numbers, 0..1."""
    n = np.uint32(i) * np.uint32(374761393) + np.uint32(j) * np.uint32(668265263)
    n = (n ^ (n >> np.uint32(13))) * np.uint32(1274126177)
    return float((n ^ (n >> np.uint32(16))) & np.uint32(0xFFFF)) / 65535.0


@inlined
def _puddles(x: float, y: float) -> float:
    """Return how much water stands at a place of wet ground, 0..1."""
    u, v = x * 0.7, y * 0.7
    i, j = math.floor(u), math.floor(v)
    a, b = u - i, v - j
    a, b = a * a * (3.0 - 2.0 * a), b * b * (3.0 - 2.0 * b)
    i, j = int(i), int(j)
    low = _noise_at(i, j) * (1.0 - a) + _noise_at(i + 1, j) * a
    high = _noise_at(i, j + 1) * (1.0 - a) + _noise_at(i + 1, j + 1) * a
    deep = low * (1.0 - b) + high * b
    return min(max((deep - 0.45) * 4.0, 0.0), 1.0)


@inlined
def _mirrored_row(camera: Any, keys: Any, row: int, column: int, drop: float, ahead: float, level: float) -> int:
    """Return the row that a level place `ahead` metres before the eye and `drop` below it mirrors; below 0: the sky.

    Where something nearer hides what is mirrored, it is the last that is seen behind the place on the way up.
    """
    width, slope = camera.width, drop / ahead
    other, behind = row - 1, -1
    while other >= 0:
        along, up = _ray_along(camera, level, other)
        steepness = up / along
        key = keys[other * width + column]
        is_open = triangle_number(key) == 0
        if steepness >= slope - 1e-3:
            return -1 - other if is_open or behind < 0 else behind
        there = 0.0 if is_open else along / inverse_depth(key)
        if there > ahead * 1.02:
            if there <= 2.0 * drop / (slope - steepness):
                return other
            behind = other
        other -= 2 + (row - other) // 8
    return -1


@kernel
def _mirror(camera: Any, keys: Any, wet: float, sky: Any, out: Any) -> None:
    """Lay over wet ground what it mirrors, row by row from below, so that what is mirrored is still as it was."""
    height, width = camera.height, camera.width
    level = math.sqrt(camera.forward_x**2 + camera.forward_y**2)
    for row in range(height - 1, 1, -1):
        along, up = _ray_along(camera, level, row)
        if up >= _HORIZON:
            break
        down = (row + 0.5 - camera.centre_y) / camera.focal
        other = 1 if row + 1 < height else -1
        _, up_other = _ray_along(camera, level, row + other)
        mirrored, known, share = 0, -_ALIKE, 0.0
        for column in range(width - 1):
            at = row * width + column
            key = keys[at]
            if triangle_number(key) == 0 or not _is_level(keys, at, other * width, (up, up_other), 1.0 / camera.focal):
                continue
            if column - known >= _ALIKE:
                depth = 1.0 / inverse_depth(key)
                side = (column + 0.5 - camera.centre_x) / camera.focal
                x = camera.x + depth * (camera.forward_x + side * camera.right_x + down * camera.down_x)
                y = camera.y + depth * (camera.forward_y + side * camera.right_y + down * camera.down_y)
                glance = 1.0 + up / math.sqrt(1.0 + side * side + down * down)
                share = wet * (0.02 + 0.98 * glance * glance * glance * glance * glance)
                share *= 0.30 + 0.45 * _puddles(x, y)  # rough ground scatters the rest
                mirrored = _mirrored_row(camera, keys, row, column, -up * depth, along * depth, level)
                known = column
            _mix_in(camera, keys, mirrored, row, column, share, sky, out)


@inlined
def _mix_in(camera: Any, keys: Any, mirrored: int, row: int, column: int, share: float, sky: Any, out: Any) -> None:
    """Lay what another row shows, or the sky, over a pixel of wet ground."""
    if out[row, column, 1] > 1.06 * max(out[row, column, 0], out[row, column, 2]):
        share *= 0.15  # grass is no mirror
    if mirrored < 0:
        shown = -1 - mirrored
        is_sky = triangle_number(keys[shown * camera.width + column]) == 0
        for channel in range(3):
            seen = float(out[shown, column, channel]) if is_sky else float(sky[channel])
            value = float(out[row, column, channel])
            out[row, column, channel] = np.uint8(value + (seen - value) * share)
        return
    # Ripples draw it out upwards and downwards, the more the farther it is from the place.
    ripple = 1 + (row - mirrored) // 16
    first, last = max(mirrored - ripple, 0), min(mirrored + ripple, row - 1)
    for channel in range(3):
        seen = 0.25 * (float(out[first, column, channel]) + float(out[last, column, channel]))
        seen += 0.5 * float(out[mirrored, column, channel])
        value = float(out[row, column, channel])
        out[row, column, channel] = np.uint8(value + (seen - value) * share)


@inlined
def _place(falling: Any, camera: Any, i: int, nearest: float, reach: float) -> Any:
    """Return the row and column of the picture at which one of what falls is, and its distance, metres."""
    near = _noise_at(i, 3)
    away = nearest + reach * near * near
    rows = falling.moment * falling.speed * camera.focal / away / camera.height + _noise_at(i, 2)
    return (rows - math.floor(rows)) * camera.height, _noise_at(i, 1) * camera.width, away


@inlined
def _lighten(out: Any, row: int, column: int, colour: Any, share: float) -> None:
    for channel in range(3):
        value = float(out[row, column, channel])
        out[row, column, channel] = np.uint8(value + max(float(colour[channel]) - value, 0.0) * share)


@kernel
def _draw_drops(camera: Any, keys: Any, falling: Any, colour: Any, out: Any) -> None:
    """Draw drops as streaks, nearer ones longer; what stands before a drop hides it."""
    height, width = camera.height, camera.width
    thick = max(height // 300, 1)
    for i in range(falling.number):
        top, left, away = _place(falling, camera, i, 1.5, 14.0)
        length = int(camera.focal * falling.size / away) + 1
        share = 0.14 + 0.30 / away
        for k in range(length):
            row = int(top) + k
            if row >= height:
                break
            for j in range(thick):
                column = int(left - 0.10 * k) + j
                if 0 <= column < width and inverse_depth(keys[row * width + column]) * away < 1.0:
                    _lighten(out, row, column, colour, share)


@kernel
def _draw_flakes(camera: Any, keys: Any, falling: Any, colour: Any, out: Any) -> None:
    """Draw flakes as soft discs, nearer ones larger; what stands before a flake hides it."""
    height, width = camera.height, camera.width
    for i in range(falling.number):
        y, x, away = _place(falling, camera, i, 1.2, 16.0)
        x += 0.3 * math.sin(falling.moment * 1.7 + i) * camera.focal / away * 0.3
        radius = 0.5 * camera.focal * falling.size / away
        share = min(radius * 1.4, 0.85)
        size = int(radius + 0.5)
        for row in range(int(y) - size, int(y) + size + 1):
            for column in range(int(x) - size, int(x) + size + 1):
                if not (0 <= row < height and 0 <= column < width):
                    continue
                off = math.sqrt((row - int(y)) ** 2 + (column - int(x)) ** 2)
                soft = min(max(radius + 0.7 - off, 0.0), 1.0) if size > 0 else 1.0
                if inverse_depth(keys[row * width + column]) * away < 1.0:
                    _lighten(out, row, column, colour, share * soft)
