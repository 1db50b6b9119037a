"""Doors that are not closed: of the wall and the leaf painted on it, what lies within an opening is taken away."""

from __future__ import annotations

from typing import Any

import numpy as np

from vico.render.compiled import inlined, kernel
from vico.render.visibility.boxes import box_in_picture
from vico.render.visibility.fill import inverse_depth, triangle_number

# Farther away than this a door looks closed, metres.
_FARTHEST = 120.0
_INDEX = 0x7FFFFFFF  # masked so, an index is not negative for all the compiler knows


@kernel
def cut_openings(openings: Any, camera: Any, keys: Any) -> None:
    """Take what lies within openings out of a picture of what never moves.

    Parameters
    ----------
    openings
        `OPENING` records: doors outdoors.
    keys
        As in `Buffers`; changed.
    """
    empty = np.uint64(np.float32(1.0 / camera.far).view(np.uint32)) << np.uint64(32)
    for k in range(len(openings)):
        first_row, end_row, first_column, end_column = _bounds(openings[k], camera)
        if first_row < end_row and first_column < end_column:
            _cut(openings[k], camera, (first_row, end_row, first_column, end_column), empty, keys)


@inlined
def _bounds(opening: Any, camera: Any) -> Any:
    """Return first and end row and column of the pixels that may show what lies in an opening."""
    across, inward = (-opening.half_width, opening.half_width), (-opening.before, opening.behind)
    left, right, top, bottom, nearest, farthest = box_in_picture(opening, across, inward, camera)
    if farthest <= camera.near or nearest > _FARTHEST:
        return 0, 0, 0, 0
    if nearest <= camera.near:
        return 0, camera.height, 0, camera.width
    first_row, end_row = int(max(top, 0.0)), int(min(bottom + 1.0, float(camera.height)))
    return first_row, end_row, int(max(left, 0.0)), int(min(right + 1.0, float(camera.width)))


@inlined
def _coordinate(x: float, y: float, z: float, camera: Any) -> Any:
    """Return a coordinate along a direction: what each metre of depth adds at the picture's corner, by row, by column.

    It is counted from the eye.
    """
    across = (camera.right_x * x + camera.right_y * y + camera.right_z * z) / camera.focal
    down = (camera.down_x * x + camera.down_y * y + camera.down_z * z) / camera.focal
    start = camera.forward_x * x + camera.forward_y * y + camera.forward_z * z
    return start + (0.5 - camera.centre_x) * across + (0.5 - camera.centre_y) * down, down, across


@kernel
def _cut(opening: Any, camera: Any, part: Any, empty: Any, keys: Any) -> None:
    """Take what lies in an opening out of a part of the picture: first and end row, first and end column."""
    first_row, end_row, first_column, end_column = part
    ix, iy, width = opening.inward_x, opening.inward_y, camera.width
    a1, a2, a3 = _coordinate(iy, -ix, 0.0, camera)
    b1, b2, b3 = _coordinate(ix, iy, 0.0, camera)
    z1, z2, z3 = _coordinate(0.0, 0.0, 1.0, camera)
    dx, dy, z0 = camera.x - opening.x, camera.y - opening.y, camera.z - opening.z
    a0, b0 = dx * iy - dy * ix, dx * ix + dy * iy
    for row in range(first_row, end_row):
        for column in range(first_column, end_column):
            pixel = (row * width + column) & _INDEX
            if triangle_number(keys[pixel]) == 0:
                continue
            depth = 1.0 / float(inverse_depth(keys[pixel]))
            a, b = a0 + depth * (a1 + row * a2 + column * a3), b0 + depth * (b1 + row * b2 + column * b3)
            z = z0 + depth * (z1 + row * z2 + column * z3)
            if abs(a) < opening.half_width and -opening.before < b < opening.behind and 0.0 < z < opening.height:
                keys[pixel] = empty
