"""Rooms behind the glass of shop fronts: drawn from where the eye would be if the room stood behind the pane.

The room's own geometry is what is seen, with all that is in it. A picture of it is taken by a camera that looks
straight into the room and has the pane as its near plane, so that the pane's points are places in the picture, in
proportion.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.render.compiled import inlined, kernel
from vico.render.records import CAMERA_UNIFORMS
from vico.render.scene import Scene
from vico.render.uniforms import Record, set_room
from vico.render.visibility.rasteriser import box_in_picture, inverse_depth, triangle_number

_MOST = 3  # rooms that one picture shows
_FARTHEST = 38.0  # of these, metres
_NEAREST = 0.25  # to the wall, metres: from nearer none is shown
# The pane lies no farther than this off the wall, metres.
_OFF_WALL = 0.12
_LEAST_PIXELS = 10.0  # height of a room, pixels of a picture of 256
# The least part of a picture that shows a room.
_LEAST_SHARE = 0.0015
_LEAST_SEEN = 300  # pixels: it can be told from a painted one
# Pixels of a room's picture beside those in which it is seen.
_FINER = 1.0
# Light indoors beside that on the street by day.
_DAY, _SLACK = 0.62, 0.03
_INDEX = 0x7FFFFFFF  # masked so, an index is not negative for all the compiler knows
# A room that is shown: its front; the pixels that may show it; what of the front shows glass, along it and up, metres,
# at what depth at least, and how many pixels of it; pixels a metre of its picture.
_SHOWN = np.dtype(
    [
        *((name, np.int64) for name in ("front", "first_row", "end_row", "first_column", "end_column", "pixels")),
        *((name, np.float64) for name in ("left", "right", "low", "high", "depth", "metre")),
    ],
    align=True,
)


Draw = Callable[[Record], NDArray[np.uint8]]
"""Takes the picture of a room with a camera; uint8, shape ``(h, w, 3)``."""


def show_rooms(
    scene: Scene,
    camera: Record,
    light: Any,
    keys: NDArray[np.uint64],
    glass: NDArray[np.uint8],
    draw: Draw,
    rgb: NDArray[np.uint8],
) -> None:
    """Show the rooms behind the fronts in a picture.

    Parameters
    ----------
    camera, light
        What the picture was taken with: `CAMERA_UNIFORMS` and `LIGHT_UNIFORMS`.
    keys, glass
        As in `Buffers`: the depths, and how much of what is behind is seen through each pixel.
    draw
        Takes the pictures of the rooms.
    rgb
        sRGB, uint8, shape ``(h, w, 3)``; changed.
    """
    if camera["indoors"] or not len(scene.fronts):
        return
    bright = _DAY + (1.0 - _DAY) * min(float(light["lamp_exposure"]) / 1.6, 1.0)
    inside, found = np.zeros(_MOST, CAMERA_UNIFORMS), np.zeros(_MOST, _SHOWN)
    inside[:] = camera
    count = _find_rooms(scene.fronts, camera, keys, glass, inside, found)
    for k in range(count):
        front = scene.fronts[found["front"][k]]
        set_room(inside[k], scene.rooms[int(front["room"])])
        _lay(front, camera, (keys, glass), found[k], draw(inside[k]), bright, rgb)


@kernel
def _find_rooms(fronts: Any, camera: Any, keys: Any, glass: Any, inside: Any, found: Any) -> int:
    """Write which rooms are seen and the cameras that look into them; return how many there are."""
    nearest = np.full(_MOST, -1, np.int64)
    for k in range(len(fronts)):
        _keep_nearest(fronts, k, camera, nearest)
    count = 0
    for place in range(_MOST):
        number = nearest[place]
        if number < 0:
            break
        front, shown = fronts[number], found[count]
        shown.front = number
        if _set_area(front, camera, shown) and _look_for_glass(front, camera, keys, glass, shown):
            _look_into(front, camera, inside[count], shown)
            count += 1
    return count


@inlined
def _keep_nearest(fronts: Any, k: int, camera: Any, nearest: Any) -> None:
    """Put a front whose outside is seen among the nearest ones, in order."""
    away = _distance(fronts[k], camera)
    if away < 0.0:
        return
    for place in range(_MOST):
        other = nearest[place]
        if other < 0 or away < _distance(fronts[other], camera):
            for later in range(_MOST - 1, place, -1):
                nearest[later] = nearest[later - 1]
            nearest[place] = k
            return


@inlined
def _distance(front: Any, camera: Any) -> float:
    """Return how far away a front is, metres; -1 if it can't be seen from outside or is too far away."""
    dx, dy = camera.x - front.x, camera.y - front.y
    away = np.sqrt(dx * dx + dy * dy)
    before = -(dx * front.inward_x + dy * front.inward_y)
    ahead = -(dx * camera.forward_x + dy * camera.forward_y)
    seen = before > _NEAREST and away < _FARTHEST and ahead > -max(abs(front.left), abs(front.right))
    return away if seen else -1.0


@inlined
def _set_area(front: Any, camera: Any, shown: Any) -> bool:
    """Write first and end row and column of the pixels that may show a front; return whether there are any."""
    across, inward = (front.left, front.right), (-_OFF_WALL, _OFF_WALL)
    left, right, top, bottom, nearest, farthest = box_in_picture(front, across, inward, camera)
    if farthest <= camera.near:
        return False
    if nearest <= camera.near:
        shown.first_row, shown.end_row, shown.first_column, shown.end_column = 0, camera.height, 0, camera.width
        return True
    if bottom - top < _LEAST_PIXELS * camera.height / 256.0:
        return False
    shown.first_row, shown.end_row = int(max(top, 0.0)), int(min(bottom + 1.0, float(camera.height)))
    shown.first_column, shown.end_column = int(max(left, 0.0)), int(min(right + 1.0, float(camera.width)))
    return shown.first_row < shown.end_row and shown.first_column < shown.end_column


@inlined
def _look_into(front: Any, camera: Any, inside: Any, shown: Any) -> None:
    """Write the camera that looks into the room by the part of its front that is seen."""
    ix, iy = front.room_inward_x, front.room_inward_y
    dx, dy, z = camera.x - front.x, camera.y - front.y, camera.z - front.z
    a, b = dx * front.inward_y - dy * front.inward_x, dx * front.inward_x + dy * front.inward_y
    inside.x, inside.y, inside.z = front.room_x + a * iy + b * ix, front.room_y - a * ix + b * iy, front.room_z + z
    inside.right_x, inside.right_y, inside.right_z = iy, -ix, 0.0
    inside.down_x, inside.down_y, inside.down_z = 0.0, 0.0, -1.0
    inside.forward_x, inside.forward_y, inside.forward_z = ix, iy, 0.0
    wide, high = shown.right - shown.left, shown.high - shown.low
    wanted = np.sqrt(_FINER * shown.pixels / (wide * high))
    most = 2.0 * max(camera.width, camera.height) / max(wide, high)
    metre = min(camera.focal / max(shown.depth, 0.1), wanted, most)
    inside.width, inside.height = int(np.ceil(wide * metre)) + 1, int(np.ceil(high * metre)) + 1
    inside.focal = -b * metre
    inside.centre_x, inside.centre_y = (a - shown.left) * metre, (shown.high - z) * metre
    inside.near, inside.far = -b + _SLACK, -b + front.depth + 1.0
    shown.metre = metre


@inlined
def _coordinate(front: Any, camera: Any, axis: int) -> Any:
    """Return a coordinate in a front's frame (right, inwards, up): where the eye is, and what each metre of depth adds.

    That is a number at the picture's corner, and its steps from row to row and from column to column.
    """
    x = front.inward_y if axis == 0 else (front.inward_x if axis == 1 else 0.0)
    y = -front.inward_x if axis == 0 else (front.inward_y if axis == 1 else 0.0)
    z = 1.0 if axis == 2 else 0.0
    eye = (camera.x - front.x) * x + (camera.y - front.y) * y + (camera.z - front.z) * z
    across = (camera.right_x * x + camera.right_y * y + camera.right_z * z) / camera.focal
    down = (camera.down_x * x + camera.down_y * y + camera.down_z * z) / camera.focal
    start = camera.forward_x * x + camera.forward_y * y + camera.forward_z * z
    start += (0.5 - camera.centre_x) * across + (0.5 - camera.centre_y) * down
    return eye, start, down, across


@inlined
def _is_pane(front: Any, a: float, b: float, z: float) -> bool:
    return abs(b) < _OFF_WALL and front.left < a < front.right and -0.5 < z < front.height + 0.5


@inlined
def _look_for_glass(front: Any, camera: Any, keys: Any, glass: Any, shown: Any) -> bool:
    """Write the part of a front that is seen through glass; return whether it is worth showing.

    Every second pixel of every second row is looked at.
    """
    a0, a1, a2, a3 = _coordinate(front, camera, 0)
    b0, b1, b2, b3 = _coordinate(front, camera, 1)
    z0, z1, z2, z3 = _coordinate(front, camera, 2)
    left, right, low, high, least, count, width = 1e30, -1e30, 1e30, -1e30, 1e30, 0, camera.width
    for row in range(shown.first_row, shown.end_row, 2):
        a4, b4, z4 = a1 + row * a2, b1 + row * b2, z1 + row * z2
        for column in range(shown.first_column, shown.end_column, 2):
            pixel = (row * width + column) & _INDEX
            if glass[pixel] == 0 or triangle_number(keys[pixel]) == 0:
                continue
            depth = 1.0 / float(inverse_depth(keys[pixel]))
            a, b = a0 + depth * (a4 + column * a3), b0 + depth * (b4 + column * b3)
            z = z0 + depth * (z4 + column * z3)
            if _is_pane(front, a, b, z):
                a = min(max(a, -front.half_width), front.half_width)
                left, right, low, high = min(left, a), max(right, a), min(low, z), max(high, z)
                least = min(least, depth)
                count += 4
    shown.left, shown.right, shown.low, shown.high = left, right, max(low, 0.0), min(high, front.height)
    shown.depth, shown.pixels = least, count
    enough = count >= max(_LEAST_SHARE * camera.width * camera.height, _LEAST_SEEN)
    return enough and shown.right > shown.left and shown.high > shown.low


@kernel
def _lay(front: Any, camera: Any, pixels: Any, shown: Any, picture: Any, bright: float, rgb: Any) -> None:
    """Lay a room's picture behind the panes: `pixels` are keys and glass."""
    keys, glass = pixels
    left, high, metre, width = shown.left, shown.high, shown.metre, camera.width
    a0, a1, a2, a3 = _coordinate(front, camera, 0)
    b0, b1, b2, b3 = _coordinate(front, camera, 1)
    z0, z1, z2, z3 = _coordinate(front, camera, 2)
    last_x, last_y = picture.shape[1] - 1.001, picture.shape[0] - 1.001
    for row in range(shown.first_row, shown.end_row):
        a4, b4, z4 = a1 + row * a2, b1 + row * b2, z1 + row * z2
        for column in range(shown.first_column, shown.end_column):
            pixel = (row * width + column) & _INDEX
            if glass[pixel] == 0 or triangle_number(keys[pixel]) == 0:
                continue
            depth = 1.0 / float(inverse_depth(keys[pixel]))
            a, b = a0 + depth * (a4 + column * a3), b0 + depth * (b4 + column * b3)
            z = z0 + depth * (z4 + column * z3)
            if not _is_pane(front, a, b, z):
                continue
            x = min(max((a - left) * metre - 0.5, 0.0), last_x)
            y = min(max((high - z) * metre - 0.5, 0.0), last_y)
            i, j = int(x), int(y)
            s, t = np.float32(x - i), np.float32(y - j)
            share = np.float32(glass[pixel]) * np.float32(1.0 / 255.0)
            for channel in range(3):
                v0, v1 = np.float32(picture[j, i, channel]), np.float32(picture[j, i + 1, channel])
                v2, v3 = np.float32(picture[j + 1, i, channel]), np.float32(picture[j + 1, i + 1, channel])
                upper, lower = v0 + s * (v1 - v0), v2 + s * (v3 - v2)
                behind = np.float32(bright) * (upper + t * (lower - upper))
                here = np.float32(rgb[row, column, channel])
                rgb[row, column, channel] = np.uint8(here + share * (behind - here) + np.float32(0.5))
