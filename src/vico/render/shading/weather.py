"""What weather adds to a finished picture: what wet ground mirrors, and drops and flakes that fall before it.

Wet ground mirrors what the picture itself shows: the ray off it is followed up its column until something stands in its
way, which is exact for a camera that is not tilted sideways. What the picture does not show cannot be mirrored.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.render.compiled import inlined, kernel
from vico.render.lighting import TONE_RANGE, TONE_STEPS
from vico.render.shading.light import Light
from vico.render.visibility.fill import inverse_depth, triangle_number

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
