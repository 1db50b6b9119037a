"""Triangles into pixels: the innermost loops; and openings cut into walls where doors are not closed.

A picture's buffer holds one unsigned 64-bit key a pixel: the bits of 1/depth (positive floats sort like integers) above
the number of the triangle, so that "nearer wins" is a plain maximum which the compiler turns into vector code, and ties
are settled by number whatever the order of drawing. Of a wall, and of the leaf painted on it, what lies within an
opening is taken away.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from vico.render.compiled import inlined, kernel

_NUMBER_BITS = np.uint64(32)
_NUMBER_MASK = np.uint64(0xFFFFFFFF)
_RUN = 8
_OPAQUE = np.uint32(0x80000000)
# An index, masked so that the compiler knows it is not negative: else it allows for indices from the end.
# Masked so, an index is not negative for all the compiler knows.
_INDEX, _LONG_INDEX = 0x7FFFFFFF, 0x7FFFFFFFFFFF


class PictureSize(NamedTuple):
    """Pixels of a picture."""

    width: int
    height: int


class ScreenPoint(NamedTuple):
    """A corner on the picture: pixels from its upper left, and 1 / depth."""

    x: float
    y: float
    inverse_depth: float


class ScreenTriangle(NamedTuple):
    """Three corners on the picture."""

    a: ScreenPoint
    b: ScreenPoint
    c: ScreenPoint


class CornerUv(NamedTuple):
    """Texture coordinates of a triangle's corners, 1 = one repeat."""

    u0: float
    v0: float
    u1: float
    v1: float
    u2: float
    v2: float


class _Edges(NamedTuple):
    """A triangle's corners from top to bottom, and the slopes (columns a row) of the edges between them."""

    xa: float
    ya: float
    xb: float
    yb: float
    long: float
    upper: float
    lower: float


@inlined
def inverse_depth(key: Any) -> Any:
    """Return 1 / metres of a pixel's key, float32."""
    return np.uint32(key >> _NUMBER_BITS).view(np.float32)


@inlined
def triangle_number(key: Any) -> Any:
    """Return the number of the triangle that a pixel shows, 0: none."""
    return np.uint32(key & _NUMBER_MASK)


@inlined
def twice_area(t: Any) -> float:
    """Return twice the signed area of a triangle on the picture, pixels; below 0 where its front is seen."""
    return (t.b.x - t.a.x) * (t.c.y - t.a.y) - (t.c.x - t.a.x) * (t.b.y - t.a.y)


@inlined
def _edges(t: Any) -> Any:
    xa, ya, xb, yb, xc, yc = t.a.x, t.a.y, t.b.x, t.b.y, t.c.x, t.c.y
    if yb < ya:
        xa, ya, xb, yb = xb, yb, xa, ya
    if yc < ya:
        xa, ya, xc, yc = xc, yc, xa, ya
    if yc < yb:
        xb, yb, xc, yc = xc, yc, xb, yb
    long = (xc - xa) / (yc - ya)
    upper = (xb - xa) / (yb - ya) if yb > ya else 0.0
    lower = (xc - xb) / (yc - yb) if yc > yb else 0.0
    return _Edges(xa, ya, xb, yb, long, upper, lower)


@inlined
def _columns_of_row(edges: Any, y: float, left: float, right: float) -> Any:
    """Return the first and the end column whose centres lie in a triangle at height `y`."""
    p = edges.xa + (y - edges.ya) * edges.long
    q = edges.xa + (y - edges.ya) * edges.upper if y < edges.yb else edges.xb + (y - edges.yb) * edges.lower
    first = int(np.ceil(max(min(p, q) - 0.5, left)))
    last = int(np.ceil(min(max(p, q) - 0.5, right)))
    return first, last


@kernel
def fill(keys: Any, size: Any, t: Any, number: int) -> None:
    """Draw a triangle.

    A pixel belongs to the triangle whose spans hold its centre. Each edge is walked from its upper end by the same
    arithmetic in both triangles that share it, so neighbours neither overlap nor leave gaps.
    """
    x0, y0, w0 = t.a
    x1, y1, w1 = t.b
    x2, y2, w2 = t.c
    left = max(np.ceil(min(x0, x1, x2) - 0.5), 0.0)
    right = min(np.ceil(max(x0, x1, x2) - 0.5), float(size.width))
    if left >= right:
        return
    top = max(np.ceil(min(y0, y1, y2) - 0.5), 0.0)
    bottom = min(np.ceil(max(y0, y1, y2) - 0.5), float(size.height))
    if top >= bottom:
        return
    area = twice_area(t)
    if area == 0.0:
        return
    scale = 1.0 / area
    across = ((w1 - w0) * (y2 - y0) - (w2 - w0) * (y1 - y0)) * scale
    down = ((w2 - w0) * (x1 - x0) - (w1 - w0) * (x2 - x0)) * scale
    low = np.float32(min(w0, w1, w2))
    high = np.float32(max(w0, w1, w2))
    edges = _edges(t)
    step = np.float32(across)
    mark = np.uint64(number)
    for row in range(int(top), int(bottom)):
        y = row + 0.5
        first, last = _columns_of_row(edges, y, left, right)
        start = np.float32(w0 + across * (first + 0.5 - x0) + down * (y - y0))
        offset = row * size.width + first
        # Blocks of a fixed length become straight vector code; past the span's end a key of 0 changes nothing.
        for block in range(0, last - first, _RUN):
            at, ahead, left_over = (offset + block) & _INDEX, np.float32(block), last - first - block
            for i in range(_RUN):
                w = min(max(start + step * (ahead + np.float32(i)), low), high)
                key = (np.uint64(np.float32(w).view(np.uint32)) << _NUMBER_BITS) | mark
                key = key if i < left_over else np.uint64(0)
                keys[at + i] = max(keys[at + i], key)


@inlined
def _cutout_level(material: Any, uv: Any, scale: float) -> int:
    """Return the level of a texture that has about one texel a pixel of a triangle."""
    area = abs((uv.u1 - uv.u0) * (uv.v2 - uv.v0) - (uv.u2 - uv.u0) * (uv.v1 - uv.v0))
    area_in_texels = area * (1 << material.log2_width) * (1 << material.log2_height)
    level = 0
    while level < material.levels - 1 and area_in_texels * abs(scale) > 2.0:
        area_in_texels *= 0.25
        level += 1
    return level


@kernel
def fill_cutout(keys: Any, size: Any, t: Any, number: int, textures: Any, index: int, uv: Any) -> None:
    """Draw a triangle whose texture (that of material `index`) has holes; see `fill`."""
    x0, y0, w0 = t.a
    x1, y1, w1 = t.b
    x2, y2, w2 = t.c
    left = max(np.ceil(min(x0, x1, x2) - 0.5), 0.0)
    right = min(np.ceil(max(x0, x1, x2) - 0.5), float(size.width))
    top = max(np.ceil(min(y0, y1, y2) - 0.5), 0.0)
    bottom = min(np.ceil(max(y0, y1, y2) - 0.5), float(size.height))
    area = twice_area(t)
    material = textures.materials[index]
    if left >= right or top >= bottom or area == 0.0 or material.levels == 0:
        return
    scale = 1.0 / area
    level = _cutout_level(material, uv, scale)
    columns, rows = 1 << max(material.log2_width - level, 0), 1 << max(material.log2_height - level, 0)
    start = textures.start[index, level]
    texels = textures.texels
    # 1/depth, u/depth and v/depth are linear on the screen.
    ex, ey, gx, gy = (x1 - x0) * scale, (y1 - y0) * scale, (x2 - x0) * scale, (y2 - y0) * scale
    p0, q0 = uv.u0 * w0 * columns, uv.v0 * w0 * rows
    dw1, dp1, dq1 = w1 - w0, uv.u1 * w1 * columns - p0, uv.v1 * w1 * rows - q0
    dw2, dp2, dq2 = w2 - w0, uv.u2 * w2 * columns - p0, uv.v2 * w2 * rows - q0
    w_across, w_down = dw1 * gy - dw2 * ey, dw2 * ex - dw1 * gx
    p_across, p_down = dp1 * gy - dp2 * ey, dp2 * ex - dp1 * gx
    q_across, q_down = dq1 * gy - dq2 * ey, dq2 * ex - dq1 * gx
    low, high = min(w0, w1, w2), max(w0, w1, w2)
    edges = _edges(t)
    for row in range(int(top), int(bottom)):
        y = row + 0.5
        first, last = _columns_of_row(edges, y, left, right)
        for column in range(first, last):
            x = column + 0.5 - x0
            w = min(max(w0 + w_across * x + w_down * (y - y0), low), high)
            key = (np.uint64(np.float32(w).view(np.uint32)) << _NUMBER_BITS) | np.uint64(number)
            at = (row * size.width + column) & _INDEX
            if key <= keys[at]:
                continue
            depth = 1.0 / w
            i = int(np.floor((p0 + p_across * x + p_down * (y - y0)) * depth)) & (columns - 1)
            j = int(np.floor((q0 + q_across * x + q_down * (y - y0)) * depth)) & (rows - 1)
            if texels[(start + j * columns + i) & _LONG_INDEX] >= _OPAQUE:
                keys[at] = key


class BoxInPicture(NamedTuple):
    """The rectangle around a box's corners, in pixels, and the least and the greatest depth of them, metres."""

    left: float
    right: float
    top: float
    bottom: float
    nearest: float
    farthest: float


@inlined
def box_in_picture(place: Any, across: Any, inward: Any, camera: Any) -> Any:
    """Return where a box comes to lie whose corners are so far from a place.

    Parameters
    ----------
    place
        What has `x`, `y`, `z`, `height`, and a unit vector `inward_x`, `inward_y`; ENU metres.
    across, inward
        First and last distance along the wall and into it, metres.
    """
    left, right, top, bottom, nearest, farthest = 1e30, -1e30, 1e30, -1e30, 1e30, -1e30
    for corner in range(8):
        a = across[1] if corner & 1 else across[0]
        b = inward[1] if corner & 2 else inward[0]
        dx = place.x + a * place.inward_y + b * place.inward_x - camera.x
        dy = place.y - a * place.inward_x + b * place.inward_y - camera.y
        dz = place.z + (place.height if corner & 4 else 0.0) - camera.z
        depth = dx * camera.forward_x + dy * camera.forward_y + dz * camera.forward_z
        nearest, farthest = min(nearest, depth), max(farthest, depth)
        scale = camera.focal / max(depth, float(camera.near))
        x = camera.centre_x + scale * (dx * camera.right_x + dy * camera.right_y + dz * camera.right_z)
        y = camera.centre_y + scale * (dx * camera.down_x + dy * camera.down_y + dz * camera.down_z)
        left, right, top, bottom = min(left, x), max(right, x), min(top, y), max(bottom, y)
    return BoxInPicture(left, right, top, bottom, nearest, farthest)


# Farther away than this a door looks closed, metres.
_FARTHEST_OPENING = 120.0


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
        first_row, end_row, first_column, end_column = _opening_bounds(openings[k], camera)
        if first_row < end_row and first_column < end_column:
            _cut_opening(openings[k], camera, (first_row, end_row, first_column, end_column), empty, keys)


@inlined
def _opening_bounds(opening: Any, camera: Any) -> Any:
    """Return first and end row and column of the pixels that may show what lies in an opening."""
    across, inward = (-opening.half_width, opening.half_width), (-opening.before, opening.behind)
    left, right, top, bottom, nearest, farthest = box_in_picture(opening, across, inward, camera)
    if farthest <= camera.near or nearest > _FARTHEST_OPENING:
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
def _cut_opening(opening: Any, camera: Any, part: Any, empty: Any, keys: Any) -> None:
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
