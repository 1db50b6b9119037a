"""Exact tests between upright bodies on the ground: oriented rectangles and discs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Shapes(NamedTuple):
    """Every body that counts in a step: vehicles, then walkers, then the others, arrays of shape ``(n,)``."""

    x: Floats
    y: Floats
    yaw: Floats
    half_length: Floats
    half_width: Floats
    disc: NDArray[np.bool_]
    vx: Floats
    vy: Floats


@njit(cache=True)
def disc_gap_to_box(px, py, x, y, c, s, half_length, half_width):  # type: ignore[no-untyped-def]
    """Distance from a point to a rectangle (heading cosine c, sine s); 0 inside."""
    dx, dy = px - x, py - y
    u = abs(dx * c + dy * s) - half_length
    v = abs(-dx * s + dy * c) - half_width
    u = max(u, 0.0)
    v = max(v, 0.0)
    return np.sqrt(u * u + v * v)


@njit(cache=True)
def boxes_overlap(ax, ay, ac, as_, al, aw, bx, by, bc, bs, bl, bw):  # type: ignore[no-untyped-def]
    """Whether two rectangles overlap (separating axis theorem)."""
    dx, dy = bx - ax, by - ay
    cos = abs(ac * bc + as_ * bs)
    sin = abs(ac * bs - as_ * bc)
    if abs(dx * ac + dy * as_) > al + bl * cos + bw * sin:
        return False
    if abs(-dx * as_ + dy * ac) > aw + bl * sin + bw * cos:
        return False
    if abs(dx * bc + dy * bs) > bl + al * cos + aw * sin:
        return False
    return abs(-dx * bs + dy * bc) <= bw + al * sin + aw * cos


@njit(cache=True)
def box_hits(x, y, c, s, half_length, half_width, shapes, j):  # type: ignore[no-untyped-def]
    """Whether a rectangle touches body j."""
    if shapes.disc[j]:
        gap = disc_gap_to_box(shapes.x[j], shapes.y[j], x, y, c, s, half_length, half_width)
        return gap <= shapes.half_length[j]
    return boxes_overlap(
        x, y, c, s, half_length, half_width,
        shapes.x[j], shapes.y[j], np.cos(shapes.yaw[j]), np.sin(shapes.yaw[j]),
        shapes.half_length[j], shapes.half_width[j],
    )  # fmt: skip


@njit(cache=True)
def disc_hits(x, y, radius, shapes, j):  # type: ignore[no-untyped-def]
    """Whether a disc touches body j."""
    if shapes.disc[j]:
        reach = radius + shapes.half_length[j]
        dx, dy = x - shapes.x[j], y - shapes.y[j]
        return dx * dx + dy * dy <= reach * reach
    gap = disc_gap_to_box(
        x, y, shapes.x[j], shapes.y[j], np.cos(shapes.yaw[j]), np.sin(shapes.yaw[j]),
        shapes.half_length[j], shapes.half_width[j],
    )  # fmt: skip
    return gap <= radius


@njit(cache=True)
def next_random(state, i):  # type: ignore[no-untyped-def]
    """A number in 0..1 from stream i (splitmix64: one word of state, so it is saved like any other array)."""
    state[i] += np.uint64(0x9E3779B97F4A7C15)
    z = state[i]
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return float(z >> np.uint64(11)) / 9007199254740992.0


@njit(cache=True)
def count_overlaps(shapes, margin):  # type: ignore[no-untyped-def]
    """Number of pairs of bodies that touch or come nearer than `margin`: what tests and the recorder ask for."""
    n = len(shapes.x)
    found = 0
    for i in range(n):
        reach_i = np.hypot(shapes.half_length[i], shapes.half_width[i])
        c, s = np.cos(shapes.yaw[i]), np.sin(shapes.yaw[i])
        for j in range(i + 1, n):
            reach = reach_i + np.hypot(shapes.half_length[j], shapes.half_width[j]) + margin
            dx, dy = shapes.x[j] - shapes.x[i], shapes.y[j] - shapes.y[i]
            if dx * dx + dy * dy > reach * reach:
                continue
            if shapes.disc[i]:
                found += disc_hits(shapes.x[i], shapes.y[i], shapes.half_length[i] + margin, shapes, j)
            else:
                found += box_hits(
                    shapes.x[i], shapes.y[i], c, s,
                    shapes.half_length[i] + margin, shapes.half_width[i] + margin, shapes, j,
                )  # fmt: skip
    return found
