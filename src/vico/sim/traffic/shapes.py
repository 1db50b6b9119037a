"""Exact tests between upright bodies on the ground: oriented rectangles and discs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled

Floats = NDArray[np.float64]


class Shapes(NamedTuple):
    """Every body that counts in a step: vehicles, then pedestrians, then the others, arrays of shape ``(n,)``.

    Attributes
    ----------
    x, y
        Centre, ENU metres.
    yaw
        Heading, radians counter-clockwise from east.
    half_length, half_width
        Of the oriented rectangle, metres; the radius of a disc.
    disc
        Which bodies are discs.
    vx, vy
        Velocity, ENU, m/s.
    """

    x: Floats
    y: Floats
    yaw: Floats
    half_length: Floats
    half_width: Floats
    disc: NDArray[np.bool_]
    vx: Floats
    vy: Floats


class Rectangle(NamedTuple):
    """An oriented rectangle: centre, cosine and sine of its heading, half its sides; metres."""

    x: float
    y: float
    cos: float
    sin: float
    half_length: float
    half_width: float


@compiled
def point_to_rectangle(px, py, r):  # type: ignore[no-untyped-def]
    """Return the distance from a point to a rectangle, metres; 0 inside."""
    dx, dy = px - r.x, py - r.y
    u = abs(dx * r.cos + dy * r.sin) - r.half_length
    v = abs(-dx * r.sin + dy * r.cos) - r.half_width
    u = max(u, 0.0)
    v = max(v, 0.0)
    return np.sqrt(u * u + v * v)


@compiled
def rectangles_overlap(a, b):  # type: ignore[no-untyped-def]
    """Return whether two rectangles overlap (separating axis theorem)."""
    dx, dy = b.x - a.x, b.y - a.y
    cos = abs(a.cos * b.cos + a.sin * b.sin)
    sin = abs(a.cos * b.sin - a.sin * b.cos)
    if abs(dx * a.cos + dy * a.sin) > a.half_length + b.half_length * cos + b.half_width * sin:
        return False
    if abs(-dx * a.sin + dy * a.cos) > a.half_width + b.half_length * sin + b.half_width * cos:
        return False
    if abs(dx * b.cos + dy * b.sin) > b.half_length + a.half_length * cos + a.half_width * sin:
        return False
    return abs(-dx * b.sin + dy * b.cos) <= b.half_width + a.half_length * sin + a.half_width * cos


@compiled
def rectangle_of(shapes, j):  # type: ignore[no-untyped-def]
    """Return body j's rectangle."""
    return Rectangle(
        shapes.x[j], shapes.y[j], np.cos(shapes.yaw[j]), np.sin(shapes.yaw[j]),
        shapes.half_length[j], shapes.half_width[j],
    )  # fmt: skip


@compiled
def rectangle_touches(rectangle, shapes, j):  # type: ignore[no-untyped-def]
    """Return whether a rectangle touches body j."""
    if shapes.disc[j]:
        return point_to_rectangle(shapes.x[j], shapes.y[j], rectangle) <= shapes.half_length[j]
    return rectangles_overlap(rectangle, rectangle_of(shapes, j))


@compiled
def disc_touches(x, y, radius, shapes, j):  # type: ignore[no-untyped-def]
    """Return whether a disc touches body j."""
    if shapes.disc[j]:
        reach = radius + shapes.half_length[j]
        dx, dy = x - shapes.x[j], y - shapes.y[j]
        return dx * dx + dy * dy <= reach * reach
    return point_to_rectangle(x, y, rectangle_of(shapes, j)) <= radius


@compiled
def count_overlaps(shapes, margin):  # type: ignore[no-untyped-def]
    """Return the number of pairs of bodies that touch or come nearer than `margin` metres."""
    n = len(shapes.x)
    found = 0
    for i in range(n):
        reach_i = np.hypot(shapes.half_length[i], shapes.half_width[i])
        x, y, half_length, half_width = shapes.x[i], shapes.y[i], shapes.half_length[i], shapes.half_width[i]
        grown = Rectangle(x, y, np.cos(shapes.yaw[i]), np.sin(shapes.yaw[i]), half_length + margin, half_width + margin)
        for j in range(i + 1, n):
            reach = reach_i + np.hypot(shapes.half_length[j], shapes.half_width[j]) + margin
            dx, dy = shapes.x[j] - x, shapes.y[j] - y
            if dx * dx + dy * dy > reach * reach:
                continue
            if shapes.disc[i]:
                found += disc_touches(x, y, half_length + margin, shapes, j)
            else:
                found += rectangle_touches(grown, shapes, j)
    return found
