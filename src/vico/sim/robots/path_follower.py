"""Taking one robot along its way: whom to wait for, when to go round, when to give up."""

from __future__ import annotations

import math
from dataclasses import replace
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import RobotModel
from vico.sim.physics.records import Base
from vico.sim.robots.navigation import (
    GAP,
    STILL,
    braking,
    free_ahead,
    path_length,
    progress,
    room_to_turn,
    towards,
)

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


def _discs(one: np.void, room: float) -> list[tuple[float, float, float]]:
    pose = float(one["x"]), float(one["y"]), float(one["yaw"])
    return footprint_discs(pose, float(one["half_length"]), float(one["half_width"]), room)


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
        wanted = towards(m, (x, y, base.yaw), self.path, self.along, free, braking(slope))
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

    def closed(self, base: Base, others: NDArray[np.void]) -> NDArray[np.float64]:
        """Discs (x, y, radius) a detour keeps out of: those who stand still near, and what is right ahead."""
        still = np.flatnonzero(_stand_still(others))
        discs = [disc for one in others[still] for disc in _discs(one, self._model.half_width + 0.35)]
        ahead = base.position[:2] + base.rotation[:2, 0] * (self._model.half_length + GAP)
        if not len(still):
            discs.append((float(ahead[0]), float(ahead[1]), 0.5))
        return np.array(discs).reshape(-1, 3)

    def detoured(self, path: NDArray[np.float64] | None) -> None:
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
