"""Path following on wheels and legs: stopping for others, going round them, backing off, and giving up.

Kernels measure progress along a path and free room ahead. A `PathFollower` takes one robot along its path.
`WaypointFollowers` are robots of a kind that each follow waypoints of their own, saved and restored as arrays.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import RobotModel
from vico.io.compiled import compiled
from vico.sim.bodies.arrays import IS_ROUND, OBJECT, Bodies
from vico.sim.bodies.footprints import Rectangle, point_gap
from vico.sim.physics.records import Base

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
BRAKE = 0.8  # m/s^2 it brakes with
SIGHT = 5.0  # m it looks ahead at most
FORESIGHT = 3.0  # s others' motion is foreseen
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


class _BodyArrays(NamedTuple):
    """`Bodies` as compiled code takes them; row = body."""

    entity: Array
    kind: Array
    position: Array
    yaw: Array
    half_length: Array
    half_width: Array
    height: Array
    velocity: Array


class _OwnOutline(NamedTuple):
    """A robot among bodies: an upright box; ENU metres, cosine and sine of its heading."""

    entity: int
    x: float
    y: float
    bottom: float
    top: float
    cos: float
    sin: float
    half_length: float
    half_width: float


@compiled
def _write_neighbours(found, count, bodies, own, reach):
    """Write those near a robot into `found`, after the first `count`, and return how many there are then.

    What lies on it, with its middle within its outline, is not near but part of it.
    """
    for k in range(len(bodies.entity)):
        x, y, z = bodies.position[k]
        east, north = x - own.x, y - own.y
        if math.hypot(east, north) - bodies.half_length[k] >= reach or bodies.entity[k] == own.entity:
            continue
        if z >= own.top + _HEIGHT_GAP or z + bodies.height[k] <= own.bottom - _HEIGHT_GAP:
            continue
        if bodies.kind[k] == OBJECT and z > own.bottom:
            ahead, aside = own.cos * east + own.sin * north, own.cos * north - own.sin * east
            if abs(ahead) < own.half_length and abs(aside) < own.half_width:
                continue
        one = found[count]
        one.x, one.y, one.yaw, one.vx, one.vy = x, y, bodies.yaw[k], bodies.velocity[k, 0], bodies.velocity[k, 1]
        one.rounding = bodies.half_width[k] if IS_ROUND[bodies.kind[k]] else 0.0
        one.half_length = bodies.half_length[k] - one.rounding
        one.half_width = bodies.half_width[k] - one.rounding
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
        own = _OwnOutline(int(mine.entity[robot]), x, y, bottom, top, math.cos(yaw), math.sin(yaw), *outline)
        found = np.empty(len(self._others) + len(mine), NEIGHBOUR)
        count = 0
        for b in (self._others, mine):
            bodies = _BodyArrays(b.entity, b.kind, b.position, b.yaw, b.half_length, b.half_width, b.height, b.velocity)
            count = _write_neighbours(found, count, bodies, own, reach)
        return found[:count]


@compiled
def progress(path, start, x, y):
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
def point_at(path, s):
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
def path_length(path):
    """Metres from the first to the last point."""
    total = 0.0
    for k in range(len(path) - 1):
        total += math.hypot(path[k + 1, 0] - path[k, 0], path[k + 1, 1] - path[k, 1])
    return total


@compiled
def _gap(x, y, ox, oy, other):
    """Return the distance from a point to a neighbour that is at (ox, oy); negative inside a rectangle."""
    core = Rectangle(ox, oy, math.cos(other.yaw), math.sin(other.yaw), other.half_length, other.half_width)
    return point_gap(x, y, core) - other.rounding


@compiled
def _least_gap(x, y, other, seconds):
    """Return how near a neighbour that goes straight on comes to a point within some seconds, metres."""
    gap = 1e9
    for wait in range(int(seconds / 0.5) + 1):
        later = 0.5 * wait
        gap = min(gap, _gap(x, y, other.x + other.vx * later, other.y + other.vy * later, other))
    return gap


@compiled
def free_ahead(x, y, yaw, speed, outline, path, along, others):
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
def room_to_turn(x, y, radius, others):
    """Return whether nobody stands within `radius` of x, y."""
    is_free = True
    for other in others:
        is_free = is_free and _gap(x, y, other.x, other.y, other) >= radius
    return is_free


def braking_on_slope(slope: float) -> float:
    """Return how hard a robot brakes where the ground falls by so much for each metre ahead, m/s2."""
    return max(BRAKE - _PULL * max(slope, 0.0), _LEAST_BRAKE)


def speed_to_stop(free: float, brake: float) -> float:
    """Return the fastest that a robot may go to stop `GAP` short of who is `free` metres ahead, m/s; 0: it has to wait.

    `brake` is how hard it brakes, m/s2.
    """
    speed = math.sqrt(2.0 * brake * max(free - GAP, 0.0))
    return speed if speed >= _SLOWEST else 0.0


def velocity_along_path(
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


#: Seconds a robot waits for somebody who stands still before it goes round, and tries to move before it backs off.
_PATIENCE, _STUCK = 4.0, 2.5
_BACK_TIME, _BACK_SPEED = 1.5, 0.25
# Who tries to move and gets less far in that time, metres, or turns less beyond where it has been turned to there,
# radians, is stuck: at a kerb wheels slip and the base rocks, or turns to and fro, so that its speed of a moment says
# nothing.
_FURTHER, _TURNED = 0.1, 0.075
#: Metres free ahead of who waits below which it makes room for who stands there.
_CLOSE = 0.25
#: Detours without getting 5 m further after which it gives up.
_DETOURS = 6
_NO_PATH = np.zeros((0, 2))


class RobotStatus(IntEnum):
    """How a robot fares."""

    IDLE, MOVING, WAITING, ARRIVED, BLOCKED, FALLEN = range(6)


def footprint_discs(
    pose: tuple[float, float, float], half_length: float, half_width: float, room: float
) -> list[tuple[float, float, float]]:
    """Discs (x, y, radius) that cover a footprint at x, y, yaw with some room around it: several along a vehicle."""
    (x, y, yaw), width = pose, max(half_width, 0.1)
    count = max(1, math.ceil(half_length / width))
    c, s = math.cos(yaw), math.sin(yaw)
    shifts = [(2 * k + 1 - count) / count * half_length for k in range(count)]
    return [(x + c * shift, y + s * shift, width + room) for shift in shifts]


def _stand_still(others: NDArray[np.void]) -> NDArray[np.bool_]:
    still: NDArray[np.bool_] = np.hypot(others["vx"], others["vy"]) < STILL
    return still


class PathFollower:
    """Follows a path. All that changes is in `path` and in the numbers of `numbers`."""

    def __init__(self, model: RobotModel) -> None:
        self._model = model
        self.path = _NO_PATH
        self.status = RobotStatus.IDLE
        self.wants_detour = False
        self.begin(_NO_PATH)
        self.status = RobotStatus.IDLE

    def begin(self, path: NDArray[np.float64]) -> None:
        """Start on a path."""
        self.path = np.ascontiguousarray(path)
        self.along = self.waiting = self.stuck = self.backing = self.marked = 0.0
        # Where it was when `stuck` began to count, and how far it has been turned there: to the right, to the left.
        self._from = 0.0, 0.0, 0.0, 0.0
        self.detours = 0
        self.status = RobotStatus.MOVING
        self.wants_detour = False

    def end(self) -> None:
        """Forget the path."""
        self.begin(_NO_PATH)
        self.status = RobotStatus.IDLE

    def ahead(self) -> NDArray[np.float64]:
        """Points every half metre or so of what is left of the path, shape ``(k, 2)``."""
        lengths = np.hypot(*np.diff(self.path, axis=0).T)
        at = np.concatenate([[0.0], np.cumsum(lengths)])
        steps = np.linspace(self.along, at[-1], max(2, int((at[-1] - self.along) / 0.5) + 2))
        return np.column_stack([np.interp(steps, at, self.path[:, axis]) for axis in (0, 1)])

    def free(self, base: Base, others: NDArray[np.void], speed: float) -> tuple[float, int]:
        """Metres free ahead, and who is there."""
        m = self._model
        x, y = base.position[:2]
        outline = (m.half_length, m.half_width)
        return free_ahead(x, y, base.yaw, speed, outline, self.path, self.along, others)

    def steer(self, base: Base, others: NDArray[np.void], dt: float, slope: float = 0.0) -> NDArray[np.float64]:
        """Velocity to follow for the next `dt` seconds; sets `status` and `wants_detour`.

        `slope` is by how much the ground falls for each metre ahead.
        """
        m, (x, y) = self._model, (float(v) for v in base.position[:2])
        self.wants_detour = False
        self.along = progress(self.path, self.along, x, y)
        end = self.path[-1]
        if path_length(self.path) - self.along < 0.5 and np.hypot(end[0] - x, end[1] - y) < m.arrival:
            self.status = RobotStatus.ARRIVED
            return np.zeros(3)
        if self.along > self.marked + 5.0:
            self.marked, self.detours = self.along, 0
        if self.backing > 0.0:
            return self._back_off(base, others, dt)
        speed = float(np.hypot(*base.velocity[:2]))
        free, who = self.free(base, others, max(speed, 0.3))
        wanted = velocity_along_path(m, (x, y, base.yaw), self.path, self.along, free, braking_on_slope(slope))
        if wanted[0] == 0.0 and wanted[2] != 0.0 and not self._can_turn(x, y, others):
            wanted = np.zeros(3)
        if not wanted.any():
            self._wait(who, others, dt)
            return self._make_room(base, others)
        self.status, self.waiting = RobotStatus.MOVING, 0.0
        self._try((x, y, base.yaw), dt if wanted[0] > 0.15 or wanted[0] == 0.0 else 0.0)
        return wanted

    def _try(self, pose: tuple[float, float, float], dt: float) -> None:
        """Count for how long it has tried to move and got nowhere; back off after a while. 0: it hardly tries."""
        x, y, right, left = self._from
        if self.stuck == 0.0 or math.hypot(pose[0] - x, pose[1] - y) > _FURTHER:
            self._from, self.stuck = (pose[0], pose[1], pose[2], pose[2]), dt
            return
        middle = 0.5 * (right + left)
        yaw = middle + math.remainder(pose[2] - middle, math.tau)
        if yaw < right - _TURNED or yaw > left + _TURNED:
            self._from, self.stuck = (x, y, min(right, yaw), max(left, yaw)), dt
            return
        self.stuck += dt
        if self.stuck > _STUCK:
            self.stuck, self.backing = 0.0, _BACK_TIME

    def _can_turn(self, x: float, y: float, others: NDArray[np.void]) -> bool:
        radius = float(np.hypot(self._model.half_length, self._model.half_width)) + 0.08
        return bool(room_to_turn(x, y, radius, others))

    def _wait(self, who: int, others: NDArray[np.void], dt: float) -> None:
        self.status = RobotStatus.WAITING
        still = who < 0 or bool(_stand_still(others)[who])
        self.waiting = self.waiting + dt if still else 0.0
        if self.waiting > _PATIENCE:
            self.waiting = 0.0
            self.backing = _BACK_TIME

    def _back_off(self, base: Base, others: NDArray[np.void], dt: float) -> NDArray[np.float64]:
        self.status = RobotStatus.MOVING
        self.backing -= dt
        if self.backing <= 0.0:
            self.wants_detour = True
        return self._backwards(base, others)

    def _make_room(self, base: Base, others: NDArray[np.void]) -> NDArray[np.float64]:
        """Velocity of who waits: back, slowly, from somebody who stands right ahead."""
        free, _ = self._straight(base, others[_stand_still(others)])
        return self._backwards(base, others) if free < _CLOSE else np.zeros(3)

    def _backwards(self, base: Base, others: NDArray[np.void]) -> NDArray[np.float64]:
        """Velocity back, if there is room."""
        free, _ = self._straight(replace(base, rotation=-base.rotation), others)
        return np.array([-_BACK_SPEED, 0.0, 0.0]) if free > 0.5 else np.zeros(3)

    def _straight(self, base: Base, others: NDArray[np.void]) -> tuple[float, int]:
        """Metres free straight ahead of a base, whatever the path, and who is there."""
        m = self._model
        x, y = base.position[:2]
        return free_ahead(x, y, base.yaw, _BACK_SPEED, (m.half_length, m.half_width), _NO_PATH, 0.0, others)

    def standing_discs(self, base: Base, others: NDArray[np.void]) -> NDArray[np.float64]:
        """Discs (x, y, radius) a detour keeps out of: those who stand still near, and what is right ahead."""
        still = np.flatnonzero(_stand_still(others))
        discs: list[tuple[float, float, float]] = []
        for one in others[still]:
            pose = float(one["x"]), float(one["y"]), float(one["yaw"])
            half_length, half_width = float(one["half_length"]), float(one["half_width"])
            discs += footprint_discs(pose, half_length, half_width, self._model.half_width + 0.35)
        ahead = base.position[:2] + base.rotation[:2, 0] * (self._model.half_length + GAP)
        if not len(still):
            discs.append((float(ahead[0]), float(ahead[1]), 0.5))
        return np.array(discs).reshape(-1, 3)

    def take_detour(self, path: NDArray[np.float64] | None) -> None:
        """Take a new way; without one, or after too many, give up or keep waiting."""
        self.wants_detour = False
        self.detours += 1
        if self.detours > _DETOURS:
            self.status = RobotStatus.BLOCKED
        elif path is not None:
            detours = self.detours
            self.begin(path)
            self.detours = detours

    def numbers(self) -> list[float]:
        """Everything it remembers beside its path."""
        return [
            self.along,
            self.waiting,
            self.stuck,
            self.backing,
            self.marked,
            float(self.detours),
            float(self.status),
            *self._from,
        ]

    def restore(self, path: NDArray[np.float64], numbers: NDArray[np.float64]) -> None:
        """Go back to what `path` and `numbers` held."""
        self.path = np.ascontiguousarray(path, np.float64)
        self.along, self.waiting, self.stuck, self.backing, self.marked, detours, status, *place = numbers.tolist()
        x, y, right, left = place
        self._from = x, y, right, left
        self.detours, self.status = int(detours), RobotStatus(int(status))
        self.wants_detour = False


@dataclass
class WaypointFollowers:
    """The robots of a kind, what changes of them, and the way that each follows.

    Attributes
    ----------
    model
        Their model.
    robots
        Their indices, int64, shape ``(k,)``.
    arrays
        What changes: a data class of arrays, row = robot of the kind.
    ways
        Points that each goes through, float64, shape ``(m, width)`` each.
    width
        Numbers a point has.
    """

    width: ClassVar[int]

    model: RobotModel
    robots: NDArray[np.int64]
    arrays: Any = field(init=False)
    ways: list[NDArray[np.float64]] = field(init=False)

    def row(self, robot: int) -> int:
        """Row of a robot in the arrays."""
        return int(np.flatnonzero(self.robots == robot)[0])

    def state_arrays(self) -> dict[str, NDArray[Any]]:
        """Every number that decides the future, copied."""
        found = {name: value.copy() for name, value in vars(self.arrays).items()}
        return found | {
            "way_ends": np.cumsum([len(way) for way in self.ways], dtype=np.int64),
            "ways": np.concatenate([self.no_way(), *self.ways]),
        }

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `state_arrays` returned."""
        for name, value in vars(self.arrays).items():
            value[...] = arrays[name]
        starts = np.concatenate([[0], arrays["way_ends"]]).astype(int)
        self.ways = [arrays["ways"][starts[k] : starts[k + 1]].copy() for k in range(len(self.ways))]

    def no_way(self) -> NDArray[np.float64]:
        """Return a way without points."""
        return np.zeros((0, self.width))
