"""From where to look about in a room, so that nobody behind a shelf is overlooked."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

Point = tuple[float, float]

# Spots are so far apart, and none is wanted nearer than this to where one has looked from, metres.
_SPACING, _APART = 6.0, 2.5


def lookouts(room: NDArray[np.float64], here: Point) -> list[Point]:
    """Return the spots of a room that are worth going to after one has looked about `here`, ENU metres, nearest first.

    Parameters
    ----------
    room
        Its floor as `vico.sim.perception.InView.room` has it, shape ``(5,)``; an endless one has no spots.
    """
    x, y, yaw, half_length, half_width = room.tolist()
    if not (math.isfinite(half_length) and math.isfinite(half_width)):
        return []
    cos, sin = math.cos(yaw), math.sin(yaw)
    spots = [
        (x + cos * a - sin * b, y + sin * a + cos * b) for a in _middles(half_length) for b in _middles(half_width)
    ]
    return left_over(spots, here)


def left_over(spots: Iterable[Point], here: Point) -> list[Point]:
    """Return those spots that one has not looked from yet, now that one has `here`, nearest first."""
    return sorted((spot for spot in spots if math.dist(spot, here) > _APART), key=lambda spot: math.dist(spot, here))


def _middles(half: float) -> list[float]:
    """Return the middles of the parts that a length, twice `half`, is cut into."""
    parts = max(1, round(2.0 * half / _SPACING))
    return [half * ((2 * k + 1) / parts - 1.0) for k in range(parts)]
