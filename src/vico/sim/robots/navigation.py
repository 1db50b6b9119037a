"""Driving and walking along a way, and stopping for whoever is in it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vico.assets.robots import RobotModel

Array = NDArray[Any]
#: Metres a robot leaves to whoever is ahead, and to the side.
GAP, SIDE_GAP = 0.6, 0.15
#: Metres a second squared it brakes with; metres it looks ahead at most; seconds others' motion is foreseen.
BRAKE, SIGHT, FORESIGHT = 0.8, 5.0, 3.0
#: Seconds the rest of a robot takes to follow its nose.
FOLLOW = 1.5


@njit(cache=True)
def progress(path, start, x, y):  # type: ignore[no-untyped-def]
    """Metres along `path` of the point nearest to x, y, not before `start` and at most 3 m after it."""
    best, best_gap, at = start, 1e18, 0.0
    for k in range(len(path) - 1):
        ax, ay = path[k, 0], path[k, 1]
        dx, dy = path[k + 1, 0] - ax, path[k + 1, 1] - ay
        length = math.sqrt(dx * dx + dy * dy)
        if length > 1e-9 and at + length >= start and at <= start + 3.0:
            t = min(1.0, max(0.0, ((x - ax) * dx + (y - ay) * dy) / (length * length)))
            t = min(1.0, max(t, (start - at) / length))
            s = at + t * length
            if s <= start + 3.0:
                ex, ey = x - ax - t * dx, y - ay - t * dy
                gap = ex * ex + ey * ey
                if gap < best_gap - 1e-12:
                    best, best_gap = s, gap
        at += length
    return best


@njit(cache=True)
def point_at(path, s):  # type: ignore[no-untyped-def]
    """Point `s` metres along a path (its end beyond that)."""
    at = 0.0
    for k in range(len(path) - 1):
        dx, dy = path[k + 1, 0] - path[k, 0], path[k + 1, 1] - path[k, 1]
        length = math.sqrt(dx * dx + dy * dy)
        if length > 1e-9 and s <= at + length:
            t = (s - at) / length
            return path[k, 0] + t * dx, path[k, 1] + t * dy
        at += length
    return path[-1, 0], path[-1, 1]


@njit(cache=True)
def path_length(path):  # type: ignore[no-untyped-def]
    """Metres from the first to the last point."""
    total = 0.0
    for k in range(len(path) - 1):
        total += math.hypot(path[k + 1, 0] - path[k, 0], path[k + 1, 1] - path[k, 1])
    return total


@njit(cache=True)
def _gap(x, y, bx, by, yaw, a, b, disc):  # type: ignore[no-untyped-def]
    """Distance from a point to a body: disc, or oriented rectangle; negative inside."""
    if disc:
        return math.hypot(x - bx, y - by) - b
    c, s = math.cos(yaw), math.sin(yaw)
    u = abs(c * (x - bx) + s * (y - by)) - a
    v = abs(-s * (x - bx) + c * (y - by)) - b
    if u > 0.0 and v > 0.0:
        return math.hypot(u, v)
    return max(u, v)


@njit(cache=True)
def free_ahead(x, y, yaw, speed, half_length, half_width, path, along, position, turn, half_l, half_w, velocity, disc):  # type: ignore[no-untyped-def]
    """Metres the nose can go along the way before it comes too near anybody, and who that is (-1: nobody).

    The robot is followed along its path at `speed`, everybody else along a straight line at their velocity for
    `FORESIGHT` seconds. Without a path (its length is 0) it is taken to go straight on.
    """
    total = path_length(path) if len(path) > 1 else 0.0
    reach = half_width + SIDE_GAP
    nose = half_length - half_width
    pace = max(speed, 0.3)
    s = 0.0
    while s <= SIGHT:
        t = min(s / pace, FORESIGHT)
        if total > 0.0 and s > 0.0:
            cx, cy = point_at(path, along + s + nose)
        else:
            cx, cy = x + (nose + s) * math.cos(yaw), y + (nose + s) * math.sin(yaw)
        for k in range(len(position)):
            gap = 1e9
            # The place has to be free from now until the rest of the robot has followed.
            for wait in range(int((t + FOLLOW) / 0.5) + 1):
                later = 0.5 * wait
                ox, oy = position[k, 0] + velocity[k, 0] * later, position[k, 1] + velocity[k, 1] * later
                gap = min(gap, _gap(cx, cy, ox, oy, turn[k], half_l[k], half_w[k], disc[k]))
            if gap < reach:
                # Whoever is abreast or behind already is nobody to stop for.
                front = (position[k, 0] - x) * math.cos(yaw) + (position[k, 1] - y) * math.sin(yaw)
                if s > 0.0 or front > half_length * 0.5:
                    return s, k
        s += 0.1
    return SIGHT, -1


@njit(cache=True)
def room_to_turn(x, y, radius, position, turn, half_l, half_w, disc):  # type: ignore[no-untyped-def]
    """True if nobody stands within `radius` of x, y."""
    for k in range(len(position)):
        if _gap(x, y, position[k, 0], position[k, 1], turn[k], half_l[k], half_w[k], disc[k]) < radius:
            return False
    return True


def towards(model: RobotModel, x: float, y: float, yaw: float, path: Array, along: float, free: float) -> Array:
    """Velocity (vx, vy, wz) that follows `path`, `along` metres of which are done, with `free` metres ahead.

    The robot steers for a point some way ahead on the path, turns on the spot if that lies far aside, and brakes so
    that it could stop `GAP` short of whoever is ahead, and at the end.
    """
    left = path_length(path) - along
    ahead = min(0.7 if model.legged else 0.9, max(left, 0.05))
    gx, gy = point_at(path, along + ahead)
    error = (math.atan2(gy - y, gx - x) - yaw + math.pi) % (2 * math.pi) - math.pi
    turn = min(model.turn, max(-model.turn, 1.8 * error))
    if abs(error) > 0.8:
        return np.array([0.0, 0.0, turn])
    speed = model.speed * max(0.3, math.cos(error) ** 2)
    speed = min(speed, math.sqrt(2 * BRAKE * max(left, 0.02)))
    speed = min(speed, math.sqrt(2 * BRAKE * max(free - GAP, 0.0)))
    if speed < 0.05:
        return np.zeros(3)
    return np.array([speed, 0.0, turn])
