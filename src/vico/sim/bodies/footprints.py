"""Exact distances between the footprints of bodies (oriented rectangles, discs and stadiums), and who is near.

A footprint is all that is within a rounding of its core. The core is a rectangle, with sides that may be 0: a point
makes a disc, a line a stadium. So two footprints are as far apart as their cores, less their roundings; a negative
distance is how deep they are in each other.

A grid over the ground finds the neighbours of a point for all that ask, instead of looking at all pairs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled
from vico.sim.bodies.arrays import Bodies

#: Spaces that are no rooms: the street, and buses, whose riders take no room.
OUTDOORS, IN_BUS = -1, -2
#: A body for kernels: centre, heading cosine and sine, half sides and rounding of its footprint, radius of the circle
#: around that, extent in height (metres), velocity (m/s), its entity, the space it is in (only those of one space can
#: touch: a room, `OUTDOORS`, `IN_BUS`), and its index among those given.
BODY = np.dtype(
    [
        ("x", np.float64),
        ("y", np.float64),
        ("cos", np.float64),
        ("sin", np.float64),
        ("half_length", np.float64),
        ("half_width", np.float64),
        ("rounding", np.float64),
        ("radius", np.float64),
        ("bottom", np.float64),
        ("top", np.float64),
        ("vx", np.float64),
        ("vy", np.float64),
        ("entity", np.int64),
        ("space", np.int64),
        ("index", np.int64),
    ],
    align=True,
)


class Rectangle(NamedTuple):
    """An oriented rectangle: centre, cosine and sine of its heading, half its sides; metres."""

    x: float
    y: float
    cos: float
    sin: float
    half_length: float
    half_width: float


def records_of(bodies: Bodies, space: NDArray[Any] | int = OUTDOORS) -> NDArray[np.void]:
    """Return bodies as kernels take them, dtype `BODY`; extents in ENU metres, `space` one for all or one each."""
    found = np.empty(len(bodies), BODY)
    found["entity"], found["space"] = bodies.entity, space
    # One layout for all: another one would have to be compiled.
    half = _plain(bodies.half_length), _plain(bodies.half_width)
    extent = _plain(bodies.bottom), _plain(bodies.top)
    columns = (bodies.position, bodies.yaw, bodies.rounding, bodies.velocity)
    position, yaw, rounding, velocity = (_plain(column) for column in columns)
    _fill(found, position, yaw, half, rounding, extent, velocity)
    return found


def concatenate_records(parts: Sequence[NDArray[np.void]]) -> NDArray[np.void]:
    """Return bodies one after the other, dtype `BODY`: NumPy's own way takes ten times as long for records."""
    found, at = np.empty(sum(map(len, parts)), BODY), 0
    for part in parts:
        found[at : at + len(part)] = part
        at += len(part)
    return found


def _plain(column: NDArray[Any]) -> NDArray[np.float64]:
    return np.ascontiguousarray(column, np.float64)


@compiled
def _fill(found, position, yaw, half, rounding, extent, velocity):
    # Compiled, for it is quicker, and NumPy's own cosine differs between processors in its last digit.
    for k in range(len(found)):
        one = found[k]
        one.index = k
        one.x, one.y = position[k, 0], position[k, 1]
        one.cos, one.sin = math.cos(yaw[k]), math.sin(yaw[k])
        one.half_length, one.half_width = half[0][k], half[1][k]
        one.rounding = rounding[k]
        u, v = one.half_length - one.rounding, one.half_width - one.rounding
        one.radius = math.sqrt(u * u + v * v) + one.rounding
        one.bottom, one.top = extent[0][k], extent[1][k]
        one.vx, one.vy = velocity[k, 0], velocity[k, 1]


@compiled
def core_of(body):
    """Return the core of a body's footprint."""
    r = body.rounding
    return Rectangle(body.x, body.y, body.cos, body.sin, body.half_length - r, body.half_width - r)


@compiled
def point_gap(px, py, r):
    """Return the signed distance from a point to a rectangle, metres; negative inside."""
    dx, dy = px - r.x, py - r.y
    u = abs(dx * r.cos + dy * r.sin) - r.half_length
    v = abs(-dx * r.sin + dy * r.cos) - r.half_width
    if u > 0.0 and v > 0.0:
        return math.sqrt(u * u + v * v)
    return max(u, v)


@compiled
def separation(a, b):
    """Return the widest gap between two rectangles along any of their sides (separating axis theorem), metres.

    Negative where they overlap: then it is how deep they do. Otherwise they are at least so far apart.
    """
    dx, dy = b.x - a.x, b.y - a.y
    cos = abs(a.cos * b.cos + a.sin * b.sin)
    sin = abs(a.cos * b.sin - a.sin * b.cos)
    along_a = abs(dx * a.cos + dy * a.sin) - (a.half_length + b.half_length * cos + b.half_width * sin)
    across_a = abs(-dx * a.sin + dy * a.cos) - (a.half_width + b.half_length * sin + b.half_width * cos)
    along_b = abs(dx * b.cos + dy * b.sin) - (b.half_length + a.half_length * cos + a.half_width * sin)
    across_b = abs(-dx * b.sin + dy * b.cos) - (b.half_width + a.half_length * sin + a.half_width * cos)
    return max(max(along_a, across_a), max(along_b, across_b))


@compiled
def _corner_gap(a, b):
    """Return the distance from the nearest corner of rectangle `a` to rectangle `b`."""
    best = 1e18
    for i in (-1.0, 1.0):
        for j in (-1.0, 1.0):
            u, v = i * a.half_length, j * a.half_width
            best = min(best, point_gap(a.x + u * a.cos - v * a.sin, a.y + u * a.sin + v * a.cos, b))
    return best


@compiled
def rectangle_gap(a, b):
    """Return the signed distance between two rectangles, metres: negative is how deep they overlap."""
    if a.half_length == 0.0 and a.half_width == 0.0:
        return point_gap(a.x, a.y, b)
    if b.half_length == 0.0 and b.half_width == 0.0:
        return point_gap(b.x, b.y, a)
    apart = separation(a, b)
    if apart <= 0.0:
        return apart
    # Rectangles that are apart are nearest to each other at a corner of one of them.
    return min(_corner_gap(a, b), _corner_gap(b, a))


@compiled
def body_gap(a, b):
    """Return the signed distance between the footprints of two bodies, dtype `BODY`, metres."""
    return rectangle_gap(core_of(a), core_of(b)) - a.rounding - b.rounding


@compiled
def gaps(core, bodies):
    """Return the distance from a core to the footprint of each body, dtype `BODY`, metres; shape ``(n,)``."""
    found = np.empty(len(bodies))
    for k in range(len(bodies)):
        found[k] = rectangle_gap(core, core_of(bodies[k])) - bodies[k].rounding
    return found


@compiled
def can_touch(a, b):
    """Return whether two bodies, dtype `BODY`, can touch: in one space, not in a bus, and on one level."""
    return a.space == b.space and a.space != IN_BUS and a.bottom < b.top and b.bottom < a.top


Array = NDArray[Any]


class NeighbourGrid(NamedTuple):
    """Points hashed by the square cell they lie in; made anew when they have moved farther than `spread` allows.

    Attributes
    ----------
    cell
        Side of a cell, metres.
    spread
        How much farther than its reach a search looks, metres: what bodies stick out of their cells, and what they
        move while the grid is used.
    column, row
        Cell of each point, int64, shape ``(n,)``.
    start, order
        Points of bucket ``b`` of the hash: ``order[start[b]:start[b + 1]]``.
    """

    cell: float
    spread: float
    column: Array
    row: Array
    start: Array
    order: Array


@compiled
def _bucket(column, row, buckets):
    # The primes of Teschner et al.: Optimized spatial hashing for collision detection of deformable objects (2003).
    return ((column * 73856093) ^ (row * 19349663)) & (buckets - 1)


@compiled
def neighbour_grid(x, y, cell, spread):
    """Return a grid of the points x, y, shape ``(n,)`` each; `cell` and `spread` as in `NeighbourGrid`."""
    n = len(x)
    buckets = 64
    while buckets < 2 * n:
        buckets *= 2
    column, row = np.empty(n, np.int64), np.empty(n, np.int64)
    start = np.zeros(buckets + 1, np.int64)
    for k in range(n):
        column[k], row[k] = math.floor(x[k] / cell), math.floor(y[k] / cell)
        start[_bucket(column[k], row[k], buckets) + 1] += 1
    for b in range(buckets):
        start[b + 1] += start[b]
    order = np.empty(n, np.int64)
    filled = start[:-1].copy()
    for k in range(n):
        b = _bucket(column[k], row[k], buckets)
        order[filled[b]] = k
        filled[b] += 1
    return NeighbourGrid(cell, spread, column, row, start, order)


@compiled
def search(grid, x, y, reach, buffer):
    """Write the points that may be within `reach` metres of (x, y) into `buffer`, in ascending order.

    Returns
    -------
    ndarray
        The part of `buffer` (int64, as long as there are points) that is used: all points in the cells that the
        square of side ``2 * (reach + spread)`` touches.
    """
    far = reach + grid.spread
    first, last = math.floor((x - far) / grid.cell), math.floor((x + far) / grid.cell)
    low, high = math.floor((y - far) / grid.cell), math.floor((y + far) / grid.cell)
    n, buckets = 0, len(grid.start) - 1
    for row in range(low, high + 1):
        for column in range(first, last + 1):
            b = _bucket(column, row, buckets)
            for at in range(grid.start[b], grid.start[b + 1]):
                k = grid.order[at]
                if grid.column[k] == column and grid.row[k] == row:
                    # What is done with neighbours may depend on their order, and must not depend on the hash. They
                    # are few, and those of a cell come in order: sorted at once.
                    at_place = n
                    while at_place > 0 and buffer[at_place - 1] > k:
                        buffer[at_place] = buffer[at_place - 1]
                        at_place -= 1
                    buffer[at_place] = k
                    n += 1
    return buffer[:n]
