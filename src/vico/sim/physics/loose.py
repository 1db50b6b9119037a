"""Movable things that physics moves: those near robots, and those in the air.

A thing outdoors that nobody carries enters physics when a robot comes near it, or when it was let go where nothing
holds it up. It leaves when it has come to rest and no robot is near; between the two its pose is what physics says.
The rest of the world's things cost nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.assets.models.solids import movable_mass, movable_solids
from vico.errors import SchemaError
from vico.quaternions import matrix_of
from vico.sim.physics.engine import PhysicsEngine
from vico.sim.physics.records import RigidObject, RigidPart
from vico.sim.state import MovableObjects

#: Things enter physics within the first distance of a robot's base, and leave beyond the second, metres.
ENTER, LEAVE = 2.5, 3.5
#: What is higher than this above what is below it falls; what reaches deeper into ground or kerb is lifted out of it
#: when it enters, but not by more than the second: then it lies in something that physics takes for solid, metres.
_IN_THE_AIR, _TOO_DEEP = 0.03, 0.15
#: Kilograms a cubic metre of a thing's box, and bounds of its mass, kg, where no entry says what it weighs.
_DENSITY, _LIGHTEST, _HEAVIEST = 150.0, 0.05, 60.0
# Where it is asked what lies below a thing: its middle and near its corners, shares of its half extents.
_PROBES = np.array([[0.0, 0.0], [0.9, 0.9], [0.9, -0.9], [-0.9, 0.9], [-0.9, -0.9]])


def mass_of(size: NDArray[np.float64]) -> float:
    """Kilograms of a thing of some extents, metres, shape ``(3,)``."""
    return float(np.clip(_DENSITY * np.prod(size), _LIGHTEST, _HEAVIEST))


def _parts(prototype: str, height: float) -> tuple[RigidPart, ...]:
    """Return a thing's convex parts about the middle of its box."""
    lift = np.array([0.0, 0.0, height / 2])
    return tuple(
        RigidPart(solid.shape, solid.half, solid.middle - lift, solid.quaternion) for solid in movable_solids(prototype)
    )


class LooseObjects:
    """Which things are in physics, and where.

    Parameters
    ----------
    engine
        The robots' physics.
    objects
        All movable things of the run: read, and written where physics moves them.

    Attributes
    ----------
    entity
        Entity of the thing in each slot of the engine, 0 for none, int32, shape ``(slots,)``.
    left_out
        How many things should have entered and found no slot, when that was last decided.
    """

    def __init__(self, engine: PhysicsEngine, objects: MovableObjects) -> None:
        self._engine, self._objects = engine, objects
        self.entity = np.zeros(len(engine.objects().present), np.int32)
        self.left_out = 0
        # Poses as they were last seen or written, whether each was loose then, and whether it is still to fall.
        self._position = np.zeros((0, 3))
        self._orientation = np.zeros((0, 4))
        self._loose = np.zeros(0, np.bool_)
        self._falling = np.zeros(0, np.bool_)

    def __len__(self) -> int:
        return len(self._objects)

    def update(self, robots: NDArray[np.float64]) -> None:
        """Decide who enters and who leaves.

        Parameters
        ----------
        robots
            Where the robots are, shape ``(r, 2)``.
        """
        objects = self._objects
        if not len(objects):
            return
        self._know_all()
        loose = (objects.holder == 0) & (objects.room < 0)
        moved = np.any(objects.position != self._position, axis=1) | np.any(
            objects.orientation != self._orientation, axis=1
        )
        changed = loose & (moved | ~self._loose)
        away = np.full(len(objects), np.inf)
        for x, y in robots[:, :2]:
            away = np.minimum(away, np.hypot(objects.position[:, 0] - x, objects.position[:, 1] - y))
        self._keep_stacks(loose, away)
        self._falling &= loose
        self._leave(loose, changed, away)
        inside = np.isin(objects.entity, self.entity)
        for k in np.flatnonzero(changed & ~inside):
            # What lies on another thing is held up, which physics does not know as long as that one is not in it.
            held_up = objects.support_of(int(k)) >= 0
            self._falling[k] = not held_up and self._clearances(int(k))[0] > _IN_THE_AIR
        self._enter(np.flatnonzero(loose & ~inside & (self._falling | (away < ENTER))), away)
        self._remember(loose)

    def _keep_stacks(self, loose: NDArray[np.bool_], away: NDArray[np.float64]) -> None:
        """Count what holds a thing up as near to robots as that is: else the thing would fall into it."""
        for k in np.flatnonzero(loose & (away < LEAVE)).tolist():
            below = self._objects.support_of(k)
            while below >= 0 and away[below] > away[k]:
                away[below] = away[k]
                below = self._objects.support_of(below)

    def _know_all(self) -> None:
        """Make room for things that were added since."""
        missing = len(self._objects) - len(self._loose)
        if missing > 0:
            self._position = np.vstack([self._position, np.full((missing, 3), np.nan)])
            self._orientation = np.vstack([self._orientation, np.full((missing, 4), np.nan)])
            self._loose = np.append(self._loose, np.zeros(missing, np.bool_))
            self._falling = np.append(self._falling, np.zeros(missing, np.bool_))

    def _remember(self, loose: NDArray[np.bool_]) -> None:
        self._position[:], self._orientation[:] = self._objects.position, self._objects.orientation
        self._loose[:] = loose

    def _leave(self, loose: NDArray[np.bool_], changed: NDArray[np.bool_], away: NDArray[np.float64]) -> None:
        """Take out who was taken away, moved by somebody else, or rests far from robots."""
        taken = np.flatnonzero(self.entity)
        if not len(taken):
            return
        resting = self._engine.objects().resting
        for slot in taken:
            k = self._objects.index(int(self.entity[slot]))
            rests = resting[slot] and away[k] > LEAVE
            if not loose[k] or changed[k] or rests:
                self._engine.remove_object(int(slot))
                self.entity[slot] = 0
                self._falling[k] = False

    def _enter(self, rows: NDArray[np.int64], away: NDArray[np.float64]) -> None:
        """Put things into free slots, the nearest to a robot first."""
        free = np.flatnonzero(self.entity == 0).tolist()
        self.left_out = 0
        for k in rows[np.lexsort((self._objects.entity[rows], away[rows]))].tolist():
            lift = max(0.0, -float(self._clearances(k).min()))
            if lift > _TOO_DEEP:
                self._falling[k] = False
            elif free:
                self._place(free.pop(0), k, lift)
            else:
                self.left_out += 1

    def _place(self, slot: int, k: int, lift: float) -> None:
        objects = self._objects
        middle = objects.position[k] + matrix_of(objects.orientation[k])[:, 2] * objects.size[k, 2] / 2
        middle[2] += lift
        size, prototype = objects.size[k], objects.prototypes[k]
        thing = RigidObject(size, movable_mass(prototype) or mass_of(size), middle, objects.orientation[k].copy())
        self._engine.place_object(slot, replace(thing, parts=_parts(prototype, float(size[2]))))
        self.entity[slot] = objects.entity[k]
        self._falling[k] = False

    def _clearances(self, k: int) -> NDArray[np.float64]:
        """Metres between a thing's underside and what is below it, at its middle and near its corners, shape ``(5,)``.

        Negative where something reaches into the thing.
        """
        body = self._objects.bodies_of(np.array([k]))
        turn = float(body.yaw[0])
        u, v = (_PROBES * (float(body.half_length[0]), float(body.half_width[0]))).T
        c, s = np.cos(turn), np.sin(turn)
        x, y, z = body.position[0]
        # From a little above its top: two of one height in one place are seen to be that.
        height = float(body.height[0]) + 0.002
        points = np.column_stack([x + c * u - s * v, y + s * u + c * v, np.full(len(u), z + height)])
        return self._engine.clearance_below(points) - height

    def _moved(self, k: int) -> bool:
        """Return whether somebody else has written a thing's pose since it was last seen or written."""
        objects = self._objects
        stays = np.array_equal(objects.position[k], self._position[k])
        return not (stays and np.array_equal(objects.orientation[k], self._orientation[k]))

    @property
    def moving(self) -> bool:
        """Whether physics moves any of them."""
        if not self.entity.any():
            return False
        motion = self._engine.objects()
        return bool(np.any(motion.present & ~motion.resting))

    def write_back(self) -> None:
        """Write where physics has moved them into the state."""
        taken = np.flatnonzero(self.entity)
        if not len(taken):
            return
        motion, objects = self._engine.objects(), self._objects
        for slot in taken:
            k = objects.index(int(self.entity[slot]))
            if self._moved(k):
                continue  # by somebody else, within a sub-step: `update` takes it from there
            up = matrix_of(motion.quaternion[slot])[:, 2]
            objects.position[k] = motion.position[slot] - up * objects.size[k, 2] / 2
            objects.orientation[k] = motion.quaternion[slot]
            self._position[k], self._orientation[k] = objects.position[k], objects.orientation[k]

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Everything that decides who enters and leaves."""
        return {
            "loose_entity": self.entity.copy(),
            "loose_position": self._position.copy(),
            "loose_orientation": self._orientation.copy(),
            "loose_known": self._loose.copy(),
            "loose_falling": self._falling.copy(),
            "loose_left_out": np.array([self.left_out]),
        }

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held; the engine is restored by itself.

        Raises
        ------
        SchemaError
            If it belongs to an engine with room for another number of things.
        """
        if arrays["loose_entity"].shape != self.entity.shape:
            raise SchemaError("physics: the saved state has room for another number of loose things")
        self.entity[:] = arrays["loose_entity"]
        self._position, self._orientation = arrays["loose_position"].copy(), arrays["loose_orientation"].copy()
        self._loose, self._falling = arrays["loose_known"].copy(), arrays["loose_falling"].copy()
        self.left_out = int(arrays["loose_left_out"][0])
