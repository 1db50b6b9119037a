"""Triangles into pixels: the innermost loops.

A picture's buffer holds one unsigned 64-bit key a pixel: the bits of 1/depth (positive floats sort like integers) above
the number of the triangle, so that "nearer wins" is a plain maximum which the compiler turns into vector code, and ties
are settled by number whatever the order of drawing.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

# Spare keys behind a picture's last pixel: `fill` works in blocks.
PAD = 8


@njit(cache=True, nogil=True, error_model="numpy")
def fill(
    keys: Any,
    width: int,
    height: int,
    x0: float,
    y0: float,
    w0: float,
    x1: float,
    y1: float,
    w1: float,
    x2: float,
    y2: float,
    w2: float,
    number: int,
) -> None:
    """Draw a triangle of screen points with inverse depths `w`.

    A pixel belongs to the triangle whose spans hold its centre. Each edge is walked from its upper end by the same
    arithmetic in both triangles that share it, so neighbours neither overlap nor leave gaps.
    """
    left = max(np.ceil(min(x0, x1, x2) - 0.5), 0.0)
    right = min(np.ceil(max(x0, x1, x2) - 0.5), float(width))
    if left >= right:
        return
    top = max(np.ceil(min(y0, y1, y2) - 0.5), 0.0)
    bottom = min(np.ceil(max(y0, y1, y2) - 0.5), float(height))
    if top >= bottom:
        return
    area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
    if area == 0.0:
        return
    scale = 1.0 / area
    across = ((w1 - w0) * (y2 - y0) - (w2 - w0) * (y1 - y0)) * scale
    down = ((w2 - w0) * (x1 - x0) - (w1 - w0) * (x2 - x0)) * scale
    low = np.float32(min(w0, w1, w2))
    high = np.float32(max(w0, w1, w2))
    xa, ya, xb, yb, xc, yc = x0, y0, x1, y1, x2, y2
    if yb < ya:
        xa, ya, xb, yb = xb, yb, xa, ya
    if yc < ya:
        xa, ya, xc, yc = xc, yc, xa, ya
    if yc < yb:
        xb, yb, xc, yc = xc, yc, xb, yb
    long = (xc - xa) / (yc - ya)
    upper = (xb - xa) / (yb - ya) if yb > ya else 0.0
    lower = (xc - xb) / (yc - yb) if yc > yb else 0.0
    step = np.float32(across)
    mark = np.uint64(number)
    for row in range(int(top), int(bottom)):
        y = row + 0.5
        p = xa + (y - ya) * long
        q = xa + (y - ya) * upper if y < yb else xb + (y - yb) * lower
        first = int(np.ceil(max(min(p, q) - 0.5, left)))
        last = int(np.ceil(min(max(p, q) - 0.5, right)))
        start = np.float32(w0 + across * (first + 0.5 - x0) + down * (y - y0))
        offset = row * width + first
        # Blocks of a fixed length become straight vector code; past the span's end a key of 0 changes nothing.
        for block in range(0, last - first, 8):
            for i in range(8):
                w = min(max(start + step * np.float32(block + i), low), high)
                key = (np.uint64(np.float32(w).view(np.uint32)) << np.uint64(32)) | mark
                key = key if block + i < last - first else np.uint64(0)
                keys[offset + block + i] = max(keys[offset + block + i], key)


@njit(cache=True, nogil=True, error_model="numpy")
def fill_cutout(
    keys: Any,
    width: int,
    height: int,
    x0: float,
    y0: float,
    w0: float,
    x1: float,
    y1: float,
    w1: float,
    x2: float,
    y2: float,
    w2: float,
    number: int,
    textures: Any,
    material: int,
    u0: float,
    v0: float,
    u1: float,
    v1: float,
    u2: float,
    v2: float,
) -> None:
    """Draw a triangle whose texture has holes; see `fill`."""
    left = max(np.ceil(min(x0, x1, x2) - 0.5), 0.0)
    right = min(np.ceil(max(x0, x1, x2) - 0.5), float(width))
    top = max(np.ceil(min(y0, y1, y2) - 0.5), 0.0)
    bottom = min(np.ceil(max(y0, y1, y2) - 0.5), float(height))
    area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
    if left >= right or top >= bottom or area == 0.0 or textures.size[material, 2] == 0:
        return
    scale = 1.0 / area
    log_width, log_height = textures.size[material, 0], textures.size[material, 1]
    area_in_texels = abs((u1 - u0) * (v2 - v0) - (u2 - u0) * (v1 - v0)) * (1 << log_width) * (1 << log_height)
    level = 0
    while level < textures.size[material, 2] - 1 and area_in_texels * abs(scale) > 2.0:
        area_in_texels *= 0.25
        level += 1
    columns, rows = 1 << max(log_width - level, 0), 1 << max(log_height - level, 0)
    start = textures.start[material, level]
    texels = textures.texels
    # 1/depth, u/depth and v/depth are linear on the screen.
    ex, ey, gx, gy = (x1 - x0) * scale, (y1 - y0) * scale, (x2 - x0) * scale, (y2 - y0) * scale
    p0, q0 = u0 * w0 * columns, v0 * w0 * rows
    dw1, dp1, dq1 = w1 - w0, u1 * w1 * columns - p0, v1 * w1 * rows - q0
    dw2, dp2, dq2 = w2 - w0, u2 * w2 * columns - p0, v2 * w2 * rows - q0
    w_across, w_down = dw1 * gy - dw2 * ey, dw2 * ex - dw1 * gx
    p_across, p_down = dp1 * gy - dp2 * ey, dp2 * ex - dp1 * gx
    q_across, q_down = dq1 * gy - dq2 * ey, dq2 * ex - dq1 * gx
    low, high = min(w0, w1, w2), max(w0, w1, w2)
    xa, ya, xb, yb, xc, yc = x0, y0, x1, y1, x2, y2
    if yb < ya:
        xa, ya, xb, yb = xb, yb, xa, ya
    if yc < ya:
        xa, ya, xc, yc = xc, yc, xa, ya
    if yc < yb:
        xb, yb, xc, yc = xc, yc, xb, yb
    long = (xc - xa) / (yc - ya)
    upper = (xb - xa) / (yb - ya) if yb > ya else 0.0
    lower = (xc - xb) / (yc - yb) if yc > yb else 0.0
    for row in range(int(top), int(bottom)):
        y = row + 0.5
        p = xa + (y - ya) * long
        q = xa + (y - ya) * upper if y < yb else xb + (y - yb) * lower
        first = int(np.ceil(max(min(p, q) - 0.5, left)))
        last = int(np.ceil(min(max(p, q) - 0.5, right)))
        for column in range(first, last):
            x = column + 0.5 - x0
            w = min(max(w0 + w_across * x + w_down * (y - y0), low), high)
            key = (np.uint64(np.float32(w).view(np.uint32)) << np.uint64(32)) | np.uint64(number)
            if key <= keys[row * width + column]:
                continue
            depth = 1.0 / w
            i = int(np.floor((p0 + p_across * x + p_down * (y - y0)) * depth)) & (columns - 1)
            j = int(np.floor((q0 + q_across * x + q_down * (y - y0)) * depth)) & (rows - 1)
            if texels[start + j * columns + i] >= np.uint32(0x80000000):
                keys[row * width + column] = key
