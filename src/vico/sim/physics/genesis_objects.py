"""Free boxes in Genesis: a fixed number of them, hung up without weight where nobody comes until they are needed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError, SchemaError
from vico.sim.physics.genesis_scene import BuiltScene
from vico.sim.physics.mujoco_model import parked_object
from vico.sim.physics.records import ObjectMotion, RigidObject

#: Slower than this, m/s and rad/s, for so many seconds an object rests.
_SLOW, _CALM_TIME = 0.03, 0.2


class ObjectSlots:
    """What is in which slot.

    Parameters
    ----------
    count
        How many slots there are.

    Attributes
    ----------
    present
        Which are taken, bool.
    size, mass
        Extents, metres, shape ``(n, 3)``, and kilograms.
    calm
        Seconds for which each has been slow.
    """

    def __init__(self, count: int) -> None:
        self.present, self.calm = np.zeros(count, np.bool_), np.zeros(count)
        self.size, self.mass = np.ones((count, 3)), np.ones(count)

    def check(self, slot: int) -> None:
        """Refuse a slot that is not there."""
        if not 0 <= slot < len(self.present):
            raise InputError(f"physics: there is no slot {slot} for objects; there are {len(self.present)}")

    def place(self, scene: BuiltScene, slot: int, thing: RigidObject) -> None:
        """Put an object into a slot."""
        self.check(slot)
        size = np.asarray(thing.size, np.float64)
        if size.shape != (3,) or not (np.isfinite(size).all() and size.min() > 0.0 and thing.mass > 0.0):
            raise InputError(
                f"physics: an object needs three positive extents and a mass, not {size.tolist()}, {thing.mass} kg"
            )
        self.size[slot], self.mass[slot], self.present[slot], self.calm[slot] = size, thing.mass, True, 0.0
        self._write(scene, slot)
        q, v = int(scene.object_q[slot]), int(scene.object_v[slot])
        scene.positions[q : q + 7] = np.concatenate([thing.position, thing.quaternion])
        scene.speeds[v : v + 6] = np.concatenate([thing.velocity, thing.angular_velocity_body])

    def remove(self, scene: BuiltScene, slot: int) -> None:
        """Take an object out of the scene."""
        self.check(slot)
        if not self.present[slot]:
            return
        self.present[slot], self.calm[slot] = False, 0.0
        scene.weightless[scene.object_entity[slot]] = 1.0
        q, v = int(scene.object_q[slot]), int(scene.object_v[slot])
        scene.positions[q : q + 7] = [*parked_object(slot), 1.0, 0.0, 0.0, 0.0]
        scene.speeds[v : v + 6] = 0.0

    def put(self, scene: BuiltScene) -> None:
        """Write extents and masses of all slots into a scene that another run had."""
        scene.weightless[scene.object_entity] = 1.0
        for slot in np.flatnonzero(self.present).tolist():
            self._write(scene, slot)

    def _write(self, scene: BuiltScene, slot: int) -> None:
        scene.weightless[scene.object_entity[slot]] = 0.0
        scene.built.shapes.resize(scene.object_geom[slot : slot + 1], self.size[slot : slot + 1])
        link, squares, mass = [int(scene.built.objects[slot])], self.size[slot] ** 2, float(self.mass[slot])
        inertia = np.diag(mass / 12.0 * (squares.sum() - squares))
        scene.solver.set_links_mass([mass], link)
        scene.solver.set_links_inertia(inertia[None], link)

    def watch(self, scene: BuiltScene, seconds: float) -> None:
        """Note who was slow in the last so many seconds."""
        if self.present.any():
            motion = scene.speeds[scene.object_v[:, None] + np.arange(6)]
            self.calm = np.where(np.abs(motion).max(axis=1) < _SLOW, self.calm + seconds, 0.0)

    def motion(self, scene: BuiltScene, qpos: NDArray[np.float64], qvel: NDArray[np.float64]) -> ObjectMotion:
        """Where all objects are."""
        pose = qpos[scene.object_q[:, None] + np.arange(7)].reshape(-1, 7)
        motion = qvel[scene.object_v[:, None] + np.arange(6)].reshape(-1, 6)
        resting = self.calm >= _CALM_TIME - 1e-9
        return ObjectMotion(self.present.copy(), pose[:, :3], pose[:, 3:], motion[:, :3], motion[:, 3:], resting)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return what is in the slots."""
        return {
            "present": self.present.copy(),
            "calm": self.calm.copy(),
            "object_size": self.size.copy(),
            "object_mass": self.mass.copy(),
        }

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held."""
        if arrays["present"].shape != self.present.shape:
            raise SchemaError("physics: the saved state has room for another number of objects")
        self.present[:], self.calm = arrays["present"], np.array(arrays["calm"])
        self.size[:], self.mass[:] = arrays["object_size"], arrays["object_mass"]
