"""The point that a pedestrian follows along its walkway, and the room that there is beside it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vico.io.compiled import compiled
from vico.world.lanes import lane_pose


class FollowPoint(NamedTuple):
    """The point a pedestrian follows, that beside it on the walkway's centre line, and the unit vector to the left.

    `room` is how far to the left and to the right of the centre line it may be there, and may be to get past somebody.
    """

    x: float
    y: float
    centre_x: float
    centre_y: float
    left_x: float
    left_y: float
    room: tuple[float, float, float, float]


@compiled
def room_at(paths, walkway, offset):  # type: ignore[no-untyped-def]
    """Return how far to each side of a walkway a walker may be so many metres along it: a row of `room`."""
    a, b = paths.first[walkway], paths.first[walkway + 1] - 1
    while b - a > 1:
        middle = (a + b) // 2
        if paths.along[middle] <= offset:
            a = middle
        else:
            b = middle
    return paths.room[a, 0], paths.room[a, 1], paths.room[a, 2], paths.room[a, 3]


@compiled
def follow_point(paths, walker):  # type: ignore[no-untyped-def]
    """Return the point a pedestrian follows."""
    walkway = walker.walkway
    offset = min(max(walker.offset, 0.0), paths.walkways[walkway].length)
    x, y, yaw = lane_pose(paths.first, paths.points, paths.along, walkway, offset)
    nx, ny = -np.sin(yaw), np.cos(yaw)
    room = room_at(paths, walkway, offset)
    left, right = room[0], room[1]
    aside = (left - right) / 2 - walker.direction * walker.lateral_share * (left + right) / 2
    return FollowPoint(x + nx * aside, y + ny * aside, x, y, nx, ny, room)
