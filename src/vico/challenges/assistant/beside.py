"""Whether another thing finds room on a surface where things of the task lie already: a chair holds one toolbox.

A thing that is laid down where another one lies comes to lie beside it, on the same surface (see
`vico.sim.loop.scenario.Scenario.add_object`); where there is no such spot the task could not be played.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.exact import apply_matrix, dot
from vico.world.model import Container

# As the simulation looks for a spot beside: in rings, in so many directions, so far, metres.
_RING, _DIRECTIONS, _WITHIN = 0.1, 16, 2.0
# Surfaces of one height, and how deep things may be in each other, metres.
_SAME_HEIGHT, _TOLERANCE = 0.02, 1e-3


class Lying(NamedTuple):
    """A thing in a room.

    Attributes
    ----------
    spot
        The middle of its underside, ENU metres.
    size
        Extents of its box, metres.
    yaw
        Counter-clockwise from east, radians.
    """

    spot: tuple[float, float, float]
    size: tuple[float, float, float]
    yaw: float


def spot_beside(thing: Lying, others: Sequence[Lying], surfaces: Sequence[Container]) -> Lying | None:
    """Return a thing where it would come to lie: where it is, or beside others on the same surface.

    Parameters
    ----------
    others
        What lies in the room already.
    surfaces
        Of the room.

    Returns
    -------
    Lying or None
        None if there is no such spot. On floors there always is one: `thing` is returned as it is.
    """
    if not any(_overlap(thing, other) for other in others):
        return thing
    x, y, z = thing.spot
    if any(one.kind == "floor" and abs(one.centre[2] - z) <= _SAME_HEIGHT for one in surfaces):
        return thing
    for ring in range(1, int(_WITHIN / _RING) + 1):
        for k in range(_DIRECTIONS):
            angle = 2 * math.pi * k / _DIRECTIONS
            spot = (x + _RING * ring * math.cos(angle), y + _RING * ring * math.sin(angle), z)
            moved = thing._replace(spot=spot)
            if _height_at(spot, surfaces, z) and not any(_overlap(moved, other) for other in others):
                return moved
    return None


def _height_at(spot: Sequence[float], surfaces: Sequence[Container], z: float) -> bool:
    """Return whether the highest surface at a point is at a height."""
    heights = [one.centre[2] for one in surfaces if _is_on(spot, one)]
    return bool(heights) and abs(max(heights) - z) <= _SAME_HEIGHT


def _is_on(spot: Sequence[float], surface: Container) -> bool:
    dx, dy = spot[0] - surface.centre[0], spot[1] - surface.centre[1]
    c, s = math.cos(surface.yaw), math.sin(surface.yaw)
    return abs(c * dx + s * dy) <= surface.size[0] / 2 and abs(c * dy - s * dx) <= surface.size[1] / 2


def _overlap(one: Lying, other: Lying) -> bool:
    """Return whether two boxes are in each other: no axis of theirs keeps them apart."""
    if one.spot[2] >= other.spot[2] + other.size[2] or other.spot[2] >= one.spot[2] + one.size[2]:
        return False
    mine, theirs = _corners(one), _corners(other)
    for yaw in (one.yaw, one.yaw + math.pi / 2, other.yaw, other.yaw + math.pi / 2):
        axis = np.array([math.cos(yaw), math.sin(yaw)])
        a, b = dot(mine, axis), dot(theirs, axis)
        if min(a.max(), b.max()) - max(a.min(), b.min()) < _TOLERANCE:
            return False
    return True


def _corners(thing: Lying) -> NDArray[np.float64]:
    half = np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]]) * (thing.size[0] / 2, thing.size[1] / 2)
    c, s = math.cos(thing.yaw), math.sin(thing.yaw)
    return apply_matrix(half, np.array([[c, -s], [s, c]])) + thing.spot[:2]
