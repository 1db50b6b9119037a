"""What of MuJoCo's model differs from engine to engine: gains of servos, sizes and masses of pooled bodies."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import SchemaError
from vico.sim.physics.mujoco_model import OBJECT_HALF, OBJECT_MASS
from vico.sim.physics.mujoco_scene import CompiledScene, SharedModel


class Parameters:
    """An engine's own numbers of the shared model.

    Attributes
    ----------
    stiffness, damping
        Of the servos that follow angles, Nm/rad and Nms/rad, shape ``(servos,)``.
    mover_half
        Half extents of people and vehicles, metres, shape ``(movers, 3)``.
    object_half, object_mass
        Half extents, metres, shape ``(objects, 3)``, and kilograms, shape ``(objects,)``.
    grip
        Share of their dry friction that ground, tyres and feet have, shape ``(1,)``.
    numbers
        All of these in one array, of which they are views; whoever writes to any of them says so by `changed`.
    token
        Stands for what the numbers are now.
    """

    def __init__(self, scene: CompiledScene) -> None:
        self._scene = scene
        servos, movers, objects = len(scene.servos), len(scene.mover_body), len(scene.object_body)
        shapes = [(servos,), (servos,), (movers, 3), (objects, 3), (objects,), (1,)]
        ends = np.cumsum([int(np.prod(shape)) for shape in shapes])
        # One array, so that two engines' numbers are compared at once.
        self.numbers = np.zeros(int(ends[-1]))
        parts = [part.reshape(shape) for part, shape in zip(np.split(self.numbers, ends[:-1]), shapes, strict=True)]
        self.stiffness, self.damping, self.mover_half, self.object_half, self.object_mass, self.grip = parts
        self.stiffness[:], self.damping[:] = scene.stiffness, scene.damping
        self.mover_half[:], self.object_half[:], self.object_mass[:] = 0.25, OBJECT_HALF, OBJECT_MASS
        self.grip[:] = 1.0
        self.token = object()

    def changed(self) -> None:
        """Note that some of the numbers were written."""
        self.token = object()

    def hold(self, model: SharedModel) -> None:
        """Have a model say what these say."""
        if model.holder is self.token:
            return
        if model.written is None or not np.array_equal(model.written, self.numbers):
            self.write(model.model)
            model.written = self.numbers.copy()
        model.holder = self.token

    def write(self, model: Any) -> None:
        """Write them, and what the broad phase and the solver derive from them, into a model of the scene."""
        s = self._scene
        model.actuator_gainprm[s.servos, 0] = self.stiffness
        model.actuator_biasprm[s.servos, 1] = -self.stiffness
        model.actuator_biasprm[s.servos, 2] = -self.damping
        model.geom_friction[s.gripping, 0] = s.dry_friction * self.grip
        people = s.capacity.people
        size = self.mover_half.copy()
        size[:people, 1], size[:people, 2] = self.mover_half[:people, 2], 0.0  # cylinders: radius, half height
        for geoms, bodies, half, sizes in (
            (s.mover_geom, s.mover_body, self.mover_half, size),
            (s.object_geom, s.object_body, self.object_half, self.object_half),
        ):
            model.geom_size[geoms] = sizes
            model.geom_rbound[geoms] = np.sqrt((half * half).sum(axis=1))
            model.geom_aabb[geoms, 3:] = half
            model.bvh_aabb[model.body_bvhadr[bodies], 3:] = half
        self._write_masses(model)

    def _write_masses(self, model: Any) -> None:
        bodies, half, mass = self._scene.object_body, self.object_half, self.object_mass
        squares = half * half
        inertia = mass[:, None] / 3.0 * (squares.sum(axis=1)[:, None] - squares)
        model.body_mass[bodies] = mass
        model.body_subtreemass[bodies] = mass
        model.body_inertia[bodies] = inertia
        # What the solver scales contacts by: mean inverse inertia of a free body, in translation and in rotation.
        slow = np.stack([1.0 / mass, (1.0 / inertia).mean(axis=1)], axis=1)
        model.body_invweight0[bodies] = slow
        first = model.body_dofadr[bodies]
        dofs = np.add.outer(first, np.arange(6))
        model.dof_M0[dofs] = np.concatenate([np.repeat(mass[:, None], 3, axis=1), inertia], axis=1)
        model.dof_invweight0[dofs] = np.repeat(slow, 3, axis=1)

    def copy_from(self, other: Parameters) -> None:
        """Take over what another engine of the same scene, with objects or without, says of all but objects."""
        self.stiffness[:], self.damping[:] = other.stiffness, other.damping
        self.mover_half[:], self.grip[:] = other.mover_half, other.grip
        self.changed()

    def restore(self, numbers: NDArray[np.float64]) -> None:
        """Go back to what `numbers` was."""
        if numbers.shape != self.numbers.shape:
            raise SchemaError("physics: the saved state belongs to other robots or surroundings")
        self.numbers[:] = numbers
        self.changed()
