"""Rooms behind the glass of shop fronts: drawn from where the eye would be if the room stood behind the pane.

The room's own geometry is what is seen, with all that is in it. A picture of it is taken by a camera that looks
straight into the room and has the pane as its near plane, so that the pane's points are places in the picture, in
proportion.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.render.compiled import inlined, kernel
from vico.render.scene import Scene
from vico.render.uniforms import Record, set_room
from vico.render.visibility.fill import inverse_depth, triangle_number

# No more rooms than this are shown in one picture, none farther away, nor from nearer to the wall, metres.
_MOST, _FARTHEST, _NEAREST = 3, 38.0, 0.25
# The pane lies no farther than this off the wall, metres.
_OFF_WALL = 0.12
# Least height of a room, pixels of a picture of 256, and the least share of a picture that shows a room.
_LEAST_PIXELS, _LEAST_SHARE = 10.0, 0.0015
# Pixels of a room's picture beside those in which it is seen.
_FINER = 1.4
# Light indoors beside that on the street by day.
_DAY, _SLACK = 0.62, 0.03


class SeenGlass(NamedTuple):
    """The part of a front that a picture shows: along it and up, metres; least depth before the camera, and pixels."""

    left: float
    right: float
    low: float
    high: float
    depth: float
    pixels: int


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
    for front in _near_fronts(scene.fronts, camera):
        area = _area(front, camera)
        if area is None:
            continue
        seen = SeenGlass(*_look_for_glass(front, camera, keys, glass, area))
        if seen.pixels < _LEAST_SHARE * len(keys) or seen.right <= seen.left or seen.high <= seen.low:
            continue
        inside = _camera_into(scene, front, camera, seen)
        picture = draw(inside)
        metre = float(inside["focal"]) / -_place(front, camera)[1]
        _lay(front, camera, (keys, glass), area, picture, (seen.left, seen.high, metre), bright, rgb)


def _near_fronts(fronts: NDArray[np.void], camera: Record) -> NDArray[np.void]:
    """Return the nearest fronts whose outside is seen, at most `_MOST`."""
    dx, dy = camera["x"] - fronts["x"], camera["y"] - fronts["y"]
    before = -(dx * fronts["inward_x"] + dy * fronts["inward_y"])
    away = np.hypot(dx, dy)
    ahead = -(dx * camera["forward_x"] + dy * camera["forward_y"])
    reach = np.maximum(np.abs(fronts["left"]), np.abs(fronts["right"]))
    chosen = np.flatnonzero((before > _NEAREST) & (away < _FARTHEST) & (ahead > -reach))
    return fronts[chosen[np.argsort(away[chosen], kind="stable")][:_MOST]]


def _place(front: Record, camera: Record) -> tuple[float, float, float]:
    """Return where the eye is in a front's frame: right, inwards, up."""
    dx, dy = float(camera["x"] - front["x"]), float(camera["y"] - front["y"])
    ix, iy = float(front["inward_x"]), float(front["inward_y"])
    return dx * iy - dy * ix, dx * ix + dy * iy, float(camera["z"] - front["z"])


def _area(front: Record, camera: Record) -> tuple[int, int, int, int] | None:
    """Return first and end row and column of the pixels that may show a front; None for none."""
    ix, iy = float(front["inward_x"]), float(front["inward_y"])
    along = np.array([front["left"], front["right"]])
    points = np.array([(s, b, z) for s in along for b in (-_OFF_WALL, _OFF_WALL) for z in (0.0, front["height"])])
    world = np.column_stack(
        [
            front["x"] + points[:, 0] * iy + points[:, 1] * ix - camera["x"],
            front["y"] - points[:, 0] * ix + points[:, 1] * iy - camera["y"],
            front["z"] + points[:, 2] - camera["z"],
        ]
    )
    axes = np.array([[camera[f"{name}_{axis}"] for axis in "xyz"] for name in ("right", "down", "forward")])
    x, y, depth = axes @ world.T
    width, height = int(camera["width"]), int(camera["height"])
    if depth.max() <= camera["near"]:
        return None
    if depth.min() <= camera["near"]:
        return 0, height, 0, width
    column, row = camera["centre_x"] + camera["focal"] * x / depth, camera["centre_y"] + camera["focal"] * y / depth
    if row.max() - row.min() < _LEAST_PIXELS * height / 256.0:
        return None
    area = (
        max(int(row.min()), 0),
        min(int(row.max()) + 1, height),
        max(int(column.min()), 0),
        min(int(column.max()) + 1, width),
    )
    return area if area[0] < area[1] and area[2] < area[3] else None


def _camera_into(scene: Scene, front: Record, camera: Record, seen: SeenGlass) -> Record:
    """Return the camera that looks into the room by the part of its front that is seen."""
    a, b, z = _place(front, camera)
    ix, iy = float(front["room_inward_x"]), float(front["room_inward_y"])
    inside = camera.copy()
    inside["x"] = front["room_x"] + a * iy + b * ix
    inside["y"] = front["room_y"] - a * ix + b * iy
    inside["z"] = front["room_z"] + z
    for name, axis in (("right", (iy, -ix, 0.0)), ("down", (0.0, 0.0, -1.0)), ("forward", (ix, iy, 0.0))):
        for part, value in zip("xyz", axis, strict=True):
            inside[f"{name}_{part}"] = value
    wide, high = seen.right - seen.left, seen.high - seen.low
    wanted = math.sqrt(_FINER * seen.pixels / (wide * high))
    most = 2.0 * max(int(camera["width"]), int(camera["height"])) / max(wide, high)
    metre = min(float(camera["focal"]) / max(seen.depth, 0.1), wanted, most)
    inside["width"], inside["height"] = int(np.ceil(wide * metre)) + 1, int(np.ceil(high * metre)) + 1
    inside["focal"] = -b * metre
    inside["centre_x"], inside["centre_y"] = (a - seen.left) * metre, (seen.high - z) * metre
    inside["near"], inside["far"] = -b + _SLACK, -b + float(front["depth"]) + 1.0
    set_room(inside, scene.rooms[int(front["room"])])
    return inside


@inlined
def _step(front: Any, camera: Any, column: int, row: int, depth: Any) -> Any:
    """Return a pixel's place in a front's frame: right, inwards, up, metres."""
    u = (column + 0.5 - camera.centre_x) / camera.focal
    v = (row + 0.5 - camera.centre_y) / camera.focal
    dx = camera.x - front.x + depth * (camera.forward_x + u * camera.right_x + v * camera.down_x)
    dy = camera.y - front.y + depth * (camera.forward_y + u * camera.right_y + v * camera.down_y)
    dz = camera.z - front.z + depth * (camera.forward_z + u * camera.right_z + v * camera.down_z)
    return dx * front.inward_y - dy * front.inward_x, dx * front.inward_x + dy * front.inward_y, dz


@inlined
def _is_pane(front: Any, a: float, b: float, z: float) -> bool:
    return abs(b) < _OFF_WALL and front.left < a < front.right and -0.5 < z < front.height + 0.5


@kernel
def _look_for_glass(front: Any, camera: Any, keys: Any, glass: Any, area: Any) -> Any:
    """Return the part of a front that is seen through glass: the fields of `SeenGlass`."""
    left, right, low, high, least, count = 1e30, -1e30, 1e30, -1e30, 1e30, 0
    for row in range(area[0], area[1]):
        for column in range(area[2], area[3]):
            pixel = row * camera.width + column
            if glass[pixel] == 0 or triangle_number(keys[pixel]) == 0:
                continue
            depth = 1.0 / float(inverse_depth(keys[pixel]))
            a, b, z = _step(front, camera, column, row, depth)
            if _is_pane(front, a, b, z):
                a = min(max(a, -front.half_width), front.half_width)
                left, right, low, high = min(left, a), max(right, a), min(low, z), max(high, z)
                least = min(least, depth)
                count += 1
    return left, right, max(low, 0.0), min(high, front.height), least, count


@kernel
def _lay(front: Any, camera: Any, pixels: Any, area: Any, picture: Any, frame: Any, bright: float, rgb: Any) -> None:
    """Lay a room's picture behind the panes: `pixels` are keys and glass, `frame` left, upper end, pixels a metre."""
    keys, glass = pixels
    left, high, metre = frame
    rows, columns = picture.shape[0], picture.shape[1]
    for row in range(area[0], area[1]):
        for column in range(area[2], area[3]):
            pixel = row * camera.width + column
            if glass[pixel] == 0 or triangle_number(keys[pixel]) == 0:
                continue
            a, b, z = _step(front, camera, column, row, 1.0 / float(inverse_depth(keys[pixel])))
            if not _is_pane(front, a, b, z):
                continue
            x = min(max((a - left) * metre - 0.5, 0.0), columns - 1.001)
            y = min(max((high - z) * metre - 0.5, 0.0), rows - 1.001)
            i, j = int(x), int(y)
            s, t = x - i, y - j
            i1, j1 = min(i + 1, columns - 1), min(j + 1, rows - 1)
            share = float(glass[pixel]) / 255.0
            for channel in range(3):
                upper = (1.0 - s) * picture[j, i, channel] + s * picture[j, i1, channel]
                lower = (1.0 - s) * picture[j1, i, channel] + s * picture[j1, i1, channel]
                behind = bright * ((1.0 - t) * upper + t * lower)
                here = float(rgb[row, column, channel])
                rgb[row, column, channel] = np.uint8(here + share * (behind - here) + 0.5)
