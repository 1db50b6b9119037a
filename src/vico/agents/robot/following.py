"""Bringing servos along a way, and spots beside others, as far from the base."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def go_along(way: Array, point: int, servos: Array, most: Array) -> int:
    """Bring servos on along a way, in place, as far as a period allows; return which of its points is next.

    Parameters
    ----------
    way
        Angles, shape ``(m, 7)``, of which those before `point` are behind.
    most
        That each may move, rad, shape ``(7,)``.
    """
    left = 1.0
    while left > 1e-9 and point < len(way):
        missing = way[point] - servos
        longest = float(np.max(np.abs(missing) / most))
        share = min(1.0, left / longest) if longest > 0.0 else 1.0
        servos += share * missing
        left -= longest * share
        if share < 1.0:
            break
        point += 1
    return point


def turned_aside(spot: Array, away: float) -> Array:
    """Return a spot at the same distance from the base's middle and at the same height, so many metres to the left."""
    radius = max(float(np.hypot(*spot[:2])), abs(away))
    turn = 2.0 * math.asin(away / (2.0 * radius))
    c, s = math.cos(turn), math.sin(turn)
    return np.array([c * spot[0] - s * spot[1], s * spot[0] + c * spot[1], spot[2]])
