"""Driving and walking along a way, and stopping for whoever is in it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import RobotModel
from vico.io.compiled import compiled
from vico.sim.bodies import IS_ROUND, OBJECT, Bodies
from vico.sim.footprints import Rectangle, point_gap

Array = NDArray[Any]

#: Somebody near a robot: pose, half sides of its footprint's core, velocity (ENU), rounding; metres, m/s.
NEIGHBOUR = np.dtype(
    [
        ("x", np.float64),
        ("y", np.float64),
        ("yaw", np.float64),
        ("half_length", np.float64),
        ("half_width", np.float64),
        ("vx", np.float64),
        ("vy", np.float64),
        ("rounding", np.float64),
    ],
    align=True,
)
#: Metres a robot leaves to whoever is ahead, and to the side.
GAP, SIDE_GAP = 0.6, 0.15
#: Metres above and below a robot that count as its height: the ground under two bodies differs.
_HEIGHT_GAP = 0.5
#: Metres a second squared it brakes with; metres it looks ahead at most; seconds others' motion is foreseen.
BRAKE, SIGHT, FORESIGHT = 0.8, 5.0, 3.0
#: What a slope takes from that, m/s2 for each metre down in a metre ahead, and the least that is left: legs, and heavy
#: bases on small wheels, stop so late.
_PULL, _LEAST_BRAKE = 3.0, 0.3
#: Metres by which who goes away from somebody is farther from them, for each metre.
_LEAVES = 0.4
#: Metres a second below which somebody stands still.
STILL = 0.15
# Metres a second below which a robot does not go on.
_SLOWEST = 0.05
#: Seconds the rest of a robot takes to follow its nose.
FOLLOW = 1.5


@compiled
def _neighbours(found, count, parts, own, reach):  # type: ignore[no-untyped-def]
    """Write those near a body into `found`, after the first `count`, and return how many there are then.

    Parameters
    ----------
    parts
        Entity, kind, position, yaw, half length, half width, height and velocity of bodies.
    own
        Of the body itself: entity, x, y, bottom, top, cosine and sine of its heading, half its length and width. What
        lies on it, with its middle within its outline, is not near but part of it.
    """
    entity, kind, position, yaw, half_length, half_width, height, velocity = parts
    for k in range(len(entity)):
        x, y, z = position[k]
        if math.hypot(x - own[1], y - own[2]) - half_length[k] >= reach or entity[k] == own[0]:
            continue
        if z >= own[4] + _HEIGHT_GAP or z + height[k] <= own[3] - _HEIGHT_GAP:
            continue
        if kind[k] == OBJECT and z > own[3]:
            ahead, aside = own[5] * (x - own[1]) + own[6] * (y - own[2]), own[5] * (y - own[2]) - own[6] * (x - own[1])
            if abs(ahead) < own[7] and abs(aside) < own[8]:
                continue
        one = found[count]
        one.x, one.y, one.yaw, one.vx, one.vy = x, y, yaw[k], velocity[k, 0], velocity[k, 1]
        one.rounding = half_width[k] if IS_ROUND[kind[k]] else 0.0
        one.half_length, one.half_width = half_length[k] - one.rounding, half_width[k] - one.rounding
        count += 1
    return count


class NearbyBodies:
    """Everybody outdoors in one sub-step, to be asked who is near a robot.

    Parameters
    ----------
    others, robots
        All bodies outdoors but the robots', and the robots'.
    """

    def __init__(self, others: Bodies, robots: Bodies) -> None:
        self._others, self._robots = others, robots

    @property
    def bodies(self) -> Bodies:
        """All of them."""
        return Bodies.joined([self._others, self._robots])

    def near(self, robot: int, reach: float) -> NDArray[np.void]:
        """Return who is within `reach` metres of a robot, and as high or low, dtype `NEIGHBOUR`."""
        mine = self._robots
        x, y, bottom = mine.position[robot].tolist()
        yaw, top = float(mine.yaw[robot]), bottom + float(mine.height[robot])
        outline = float(mine.half_length[robot]), float(mine.half_width[robot])
        own = (int(mine.entity[robot]), x, y, bottom, top, math.cos(yaw), math.sin(yaw), *outline)
        found = np.empty(len(self._others) + len(mine), NEIGHBOUR)
        count = 0
        for b in (self._others, mine):
            parts = (b.entity, b.kind, b.position, b.yaw, b.half_length, b.half_width, b.height, b.velocity)
            count = _neighbours(found, count, parts, own, reach)
        return found[:count]


@compiled
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


@compiled
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


@compiled
def path_length(path):  # type: ignore[no-untyped-def]
    """Metres from the first to the last point."""
    total = 0.0
    for k in range(len(path) - 1):
        total += math.hypot(path[k + 1, 0] - path[k, 0], path[k + 1, 1] - path[k, 1])
    return total


@compiled
def _gap(x, y, ox, oy, other):  # type: ignore[no-untyped-def]
    """Return the distance from a point to a neighbour that is at (ox, oy); negative inside a rectangle."""
    core = Rectangle(ox, oy, math.cos(other.yaw), math.sin(other.yaw), other.half_length, other.half_width)
    return point_gap(x, y, core) - other.rounding


@compiled
def _least_gap(x, y, other, seconds):  # type: ignore[no-untyped-def]
    """Return how near a neighbour that goes straight on comes to a point within some seconds, metres."""
    gap = 1e9
    for wait in range(int(seconds / 0.5) + 1):
        later = 0.5 * wait
        gap = min(gap, _gap(x, y, other.x + other.vx * later, other.y + other.vy * later, other))
    return gap


@compiled
def free_ahead(x, y, yaw, speed, outline, path, along, others):  # type: ignore[no-untyped-def]
    """Return the metres the nose can go along the way before it comes too near anybody, and who that is (-1: nobody).

    The robot is followed along its path at `speed`, everybody else along a straight line at their velocity for
    `FORESIGHT` seconds. Without a path (its length is 0) it is taken to go straight on.

    Parameters
    ----------
    outline
        Half the robot's length and half its width, metres.
    others
        Who is near, dtype `NEIGHBOUR`.
    """
    half_length, half_width = outline
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
        for k in range(len(others)):
            # The place has to be free from now until the rest of the robot has followed.
            gap = _least_gap(cx, cy, others[k], t + FOLLOW)
            if gap < reach:
                now = _gap(x + nose * math.cos(yaw), y + nose * math.sin(yaw), others[k].x, others[k].y, others[k])
                if s > 0.0 and gap > now + _LEAVES * s:
                    continue  # who is too near already may go away from the other
                # Whoever is abreast or behind already is nobody to stop for.
                front = (others[k].x - x) * math.cos(yaw) + (others[k].y - y) * math.sin(yaw)
                if s > 0.0 or front > half_length * 0.5:
                    return s, k
        s += 0.1
    return SIGHT, -1


@compiled
def room_to_turn(x, y, radius, others):  # type: ignore[no-untyped-def]
    """Return whether nobody stands within `radius` of x, y."""
    is_free = True
    for other in others:
        is_free = is_free and _gap(x, y, other.x, other.y, other) >= radius
    return is_free


def braking(slope: float) -> float:
    """Return how hard a robot brakes where the ground falls by so much for each metre ahead, m/s2."""
    return max(BRAKE - _PULL * max(slope, 0.0), _LEAST_BRAKE)


def speed_to_stop(free: float, brake: float) -> float:
    """Return the fastest that a robot may go to stop `GAP` short of who is `free` metres ahead, m/s; 0: it has to wait.

    `brake` is how hard it brakes, m/s2.
    """
    speed = math.sqrt(2.0 * brake * max(free - GAP, 0.0))
    return speed if speed >= _SLOWEST else 0.0


def towards(
    model: RobotModel, pose: tuple[float, float, float], path: Array, along: float, free: float, brake: float
) -> Array:
    """Velocity (vx, vy, wz) that follows `path`, `along` metres of which are done, with `free` metres ahead.

    `pose` is x, y, yaw, and `brake` how hard it brakes, m/s2.

    The robot steers for a point some way ahead on the path, turns on the spot if that lies far aside, and brakes so
    that it could stop `GAP` short of whoever is ahead, and at the end.
    """
    x, y, yaw = pose
    left = path_length(path) - along
    assert model.velocity_limit is not None
    fastest, _, turning = model.velocity_limit.tolist()
    ahead = min(model.lookahead, max(left, 0.05))
    gx, gy = point_at(path, along + ahead)
    error = (math.atan2(gy - y, gx - x) - yaw + math.pi) % (2 * math.pi) - math.pi
    turn = min(turning, max(-turning, 1.8 * error))
    if abs(error) > 0.8:
        return np.array([0.0, 0.0, turn])
    speed = fastest * max(0.3, math.cos(error) ** 2)
    speed = min(speed, math.sqrt(2.0 * brake * max(left, 0.02)), speed_to_stop(free, brake))
    if speed < _SLOWEST:
        return np.zeros(3)
    return np.array([speed, 0.0, turn])
