"""Every body that counts in a step of traffic, as arrays, and exact tests between them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled
from vico.sim.footprints import Rectangle, point_gap, rectangle_gap, separation

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
        Half the footprint's extents, metres.
    rounding
        Radius of a footprint's round ends, metres; 0 for rectangles: see `vico.sim.bodies.Bodies`.
    bottom, top
        Extent in height above the ground beneath it, metres.
    vx, vy
        Velocity, ENU, m/s.
    """

    x: Floats
    y: Floats
    yaw: Floats
    half_length: Floats
    half_width: Floats
    rounding: Floats
    bottom: Floats
    top: Floats
    vx: Floats
    vy: Floats


@compiled
def core(shapes, j):  # type: ignore[no-untyped-def]
    """Return the core of body j's footprint."""
    r = shapes.rounding[j]
    return Rectangle(
        shapes.x[j], shapes.y[j], np.cos(shapes.yaw[j]), np.sin(shapes.yaw[j]),
        shapes.half_length[j] - r, shapes.half_width[j] - r,
    )  # fmt: skip


@compiled
def is_disc(shapes, j):  # type: ignore[no-untyped-def]
    """Return whether body j's footprint is a disc."""
    return shapes.half_length[j] == shapes.rounding[j] == shapes.half_width[j]


@compiled
def share_level(shapes, i, j):  # type: ignore[no-untyped-def]
    """Return whether the extents in height of bodies i and j overlap."""
    return shapes.bottom[i] < shapes.top[j] and shapes.bottom[j] < shapes.top[i]


@compiled
def within(a, b, reach):  # type: ignore[no-untyped-def]
    """Return whether two rectangles come as near to each other as `reach` metres."""
    apart = separation(a, b)
    return apart <= 0.0 or (apart <= reach and rectangle_gap(a, b) <= reach)


@compiled
def distance_to(x, y, shapes, j):  # type: ignore[no-untyped-def]
    """Return the metres from a point to the core of body j's footprint: to a disc's middle; negative inside."""
    if is_disc(shapes, j):
        dx, dy = x - shapes.x[j], y - shapes.y[j]
        return np.sqrt(dx * dx + dy * dy)
    return point_gap(x, y, core(shapes, j))


@compiled
def disc_touches(x, y, radius, shapes, j):  # type: ignore[no-untyped-def]
    """Return whether a disc touches body j."""
    reach = radius + shapes.rounding[j]
    if is_disc(shapes, j):
        dx, dy = x - shapes.x[j], y - shapes.y[j]
        return dx * dx + dy * dy <= reach * reach
    return point_gap(x, y, core(shapes, j)) <= reach
