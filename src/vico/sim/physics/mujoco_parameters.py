"""What of MuJoCo's model differs from engine to engine: gains of servos, sizes and masses of pooled bodies."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import SchemaError
from vico.sim.physics.mujoco_model import OBJECT_BITS, OBJECT_HALF, OBJECT_MASS
from vico.sim.physics.mujoco_scene import CompiledScene, SharedModel
from vico.sim.physics.object_parts import PartRows, box_parts
from vico.sim.physics.records import PARTS

# Groups of shapes that are in use, which rays meet, and of those that are not.
_SHOWN, _UNUSED = 0, 5


class Parameters:
    """An engine's own numbers of the shared model.

    Attributes
    ----------
    stiffness, damping
        Of the servos that follow angles, Nm/rad and Nms/rad, shape ``(servos,)``.
    mover_half
        Half extents of people and vehicles, metres, shape ``(movers, 3)``.
    object_parts
        Of each object, as in `PartRows`, shape ``(objects, parts, 10)``.
    object_mass, object_inertia
        Kilograms, shape ``(objects,)``, and moments about their axes, kg m2, shape ``(objects, 3)``.
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
        shapes = [(servos,), (servos,), (movers, 3), (objects, len(PARTS), 10), (objects,), (objects, 3), (1,)]
        ends = np.cumsum([int(np.prod(shape)) for shape in shapes])
        # One array, so that two engines' numbers are compared at once.
        self.numbers = np.zeros(int(ends[-1]))
        parts = [part.reshape(shape) for part, shape in zip(np.split(self.numbers, ends[:-1]), shapes, strict=True)]
        self.stiffness, self.damping, self.mover_half, self.object_parts = parts[:4]
        self.object_mass, self.object_inertia, self.grip = parts[4:]
        self.stiffness[:], self.damping[:] = scene.stiffness, scene.damping
        self.mover_half[:], self.grip[:] = 0.25, 1.0
        cube = box_parts(np.full(3, OBJECT_HALF))
        self.object_parts[:], self.object_mass[:] = cube.rows, OBJECT_MASS
        self.object_inertia[:] = cube.inertia(OBJECT_MASS)
        self.token = object()

    def changed(self) -> None:
        """Note that some of the numbers were written."""
        self.token = object()

    def set_object(self, slot: int, parts: PartRows, mass: float) -> None:
        """Say what an object is made of, and weighs, kilograms."""
        self.object_parts[slot], self.object_mass[slot] = parts.rows, mass
        self.object_inertia[slot] = parts.inertia(mass)
        self.changed()

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
        half = self.mover_half
        model.geom_size[s.mover_geom] = size
        model.geom_rbound[s.mover_geom] = np.sqrt((half * half).sum(axis=1))
        model.geom_aabb[s.mover_geom, 3:] = half
        model.bvh_aabb[model.body_bvhadr[s.mover_body], 3:] = half
        if s.slots:
            self._write_parts(model)
            self._write_masses(model)

    def _write_parts(self, model: Any) -> None:
        s, parts = self._scene, PartRows(self.object_parts)
        geoms, used = s.object_geoms, parts.used
        model.geom_size[geoms], model.geom_rbound[geoms] = parts.sizes, parts.radii
        model.geom_aabb[geoms, 3:] = parts.half
        model.geom_pos[geoms], model.geom_quat[geoms] = parts.position, parts.quaternion
        model.geom_contype[geoms] = np.where(used, OBJECT_BITS[0], 0)
        model.geom_conaffinity[geoms] = np.where(used, OBJECT_BITS[1], 0)
        model.geom_group[geoms] = np.where(used, _SHOWN, _UNUSED)
        # All boxes of a body's tree hold all of its parts: there are too few of those to tell them apart sooner.
        middle, reach = parts.bounds()
        nodes = s.object_nodes
        model.bvh_aabb[nodes, :3], model.bvh_aabb[nodes, 3:] = middle[:, None], reach[:, None]

    def _write_masses(self, model: Any) -> None:
        bodies, mass, inertia = self._scene.object_body, self.object_mass, self.object_inertia
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
