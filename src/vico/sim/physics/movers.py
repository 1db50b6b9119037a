"""People and vehicles as kinematic bodies: which are near robots, and where they are at every frame.

The simulation moves everybody else in sub-steps of 0.1 s. Physics sees them move smoothly, from where they were to
where they will be at the end of the sub-step, never jump: what is pushed is pushed, not thrown.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import SchemaError
from vico.io.compiled import compiled
from vico.sim.bodies import OBJECT, Bodies
from vico.sim.physics.records import Capacity

#: Bodies within this distance of a robot can be met, metres.
NEAR = 10.0
#: Kinematic bodies are this much larger than what they stand for: soft contact never lets the real ones overlap.
SKIN = 0.03
#: Further than this from where its velocity says that it comes from, metres, a body has jumped (or been moved).
_JUMP = 0.5
X, Y, Z, YAW = range(4)
_FIELDS = ("entity", "start", "end", "half", "time", "left_out")


@compiled
def _gaps(position, half_length, half_width, centres):  # type: ignore[no-untyped-def]
    """Distance of every body's outline (at least) from the nearest of `centres`, metres."""
    out = np.empty(len(position))
    for k in range(len(position)):
        least = np.inf
        for c in range(len(centres)):
            least = min(least, math.hypot(position[k, 0] - centres[c, 0], position[k, 1] - centres[c, 1]))
        out[k] = least - max(half_length[k], half_width[k])
    return out


@compiled
def moved_poses(start, end, time):  # type: ignore[no-untyped-def]
    """Return middle and yaw of everybody on the way, the shorter way round; arguments as in `KinematicBodies`."""
    share = 1.0 if time[1] <= 0.0 else min(1.0, time[0] / time[1])
    out = np.empty(start.shape)
    for k in range(len(start)):
        for i in range(YAW):
            out[k, i] = start[k, i] + (end[k, i] - start[k, i]) * share
        turn = (end[k, YAW] - start[k, YAW] + math.pi) % (2 * math.pi) - math.pi
        out[k, YAW] = start[k, YAW] + turn * share
    return out


class KinematicBodies:
    """A fixed number of slots: people on foot first, then everything else that is driven or ridden.

    Attributes
    ----------
    entity
        Who is in each slot, 0 for nobody, int32, shape ``(n,)``.
    start, end
        Middle and yaw at the beginning and at the end of the motion, float64, shape ``(n, 4)``.
    half
        Half extents, metres, shape ``(n, 3)``; people are as long as wide.
    time
        Seconds of the motion that have passed, and all of them, shape ``(2,)``.
    left_out
        How many near bodies found no slot, shape ``(1,)``.
    """

    def __init__(self, capacity: Capacity) -> None:
        n = capacity.people + capacity.vehicles
        self.people = capacity.people
        self.entity = np.zeros(n, np.int32)
        self.start, self.end = np.zeros((n, 4)), np.zeros((n, 4))
        self.half = np.full((n, 3), 0.25)
        self.time = np.zeros(2)
        self.left_out = np.zeros(1, np.int64)

    def set(self, bodies: Bodies, dt: float, centres: NDArray[np.float64]) -> None:
        """Take those near `centres` (robots, shape ``(r, 2)``): they arrive `dt` seconds from now."""
        before, poses = self.entity.copy(), self.poses()
        self.entity[:] = 0
        self.time[:] = 0.0, dt
        self.left_out[0] = 0
        if not len(bodies) or not len(centres):
            return
        gap = _gaps(bodies.position, bodies.half_length, bodies.half_width, centres)
        near = (gap < NEAR) & (bodies.kind != OBJECT)
        if not near.any():
            return
        on_foot = bodies.rounding == bodies.half_length
        for first, count, chosen in (
            (0, self.people, on_foot),
            (self.people, len(self.entity) - self.people, ~on_foot),
        ):
            rows = np.flatnonzero(chosen & near)
            rows = rows[np.lexsort((bodies.entity[rows], gap[rows]))]
            self.left_out[0] += max(len(rows) - count, 0)
            # In the order of their numbers, so that who comes and goes far away changes nothing.
            rows = rows[:count][np.argsort(bodies.entity[rows[:count]], kind="stable")]
            self._fill(slice(first, first + len(rows)), bodies, rows, dt)
        slot_of = {int(entity): k for k, entity in enumerate(before) if entity}
        for k in np.flatnonzero(self.entity):
            was = slot_of.get(int(self.entity[k]))
            away = np.inf if was is None else float(np.linalg.norm(self.start[k, :3] - poses[was, :3]))
            if was is not None and away <= _JUMP + 0.5 * float(np.linalg.norm(self.end[k, :3] - self.start[k, :3])):
                self.start[k] = poses[was]

    def _fill(self, slots: slice, bodies: Bodies, rows: NDArray[Any], dt: float) -> None:
        self.entity[slots] = bodies.entity[rows]
        self.half[slots, 0] = bodies.half_length[rows] + SKIN
        self.half[slots, 1] = bodies.half_width[rows] + SKIN
        self.half[slots, 2] = bodies.height[rows] / 2
        self.end[slots, :3] = bodies.position[rows]
        self.end[slots, Z] += bodies.height[rows] / 2
        self.end[slots, YAW] = bodies.yaw[rows]
        self.start[slots] = self.end[slots]
        self.start[slots, :2] -= bodies.velocity[rows] * dt

    @property
    def moving(self) -> bool:
        """Whether anybody is on the way."""
        return bool(self.time[0] < self.time[1] - 1e-9 and self.entity.any())

    def advance(self, dt: float) -> None:
        """Let time pass."""
        self.time[0] += dt

    def poses(self) -> NDArray[np.float64]:
        """Middle and yaw of everybody now, shape ``(n, 4)``."""
        found: NDArray[np.float64] = moved_poses(self.start, self.end, self.time)
        return found

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Everything that decides where they will be."""
        return {f"movers_{name}": getattr(self, name).copy() for name in _FIELDS}

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held."""
        for name in _FIELDS:
            saved, mine = arrays[f"movers_{name}"], getattr(self, name)
            if saved.shape != mine.shape:
                raise SchemaError("physics: the saved state has room for other numbers of people and vehicles")
            mine[...] = saved
