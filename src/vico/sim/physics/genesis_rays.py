"""What lies below a point: asked of MuJoCo, of the same scene with everybody where Genesis has them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.sim.physics.genesis_objects import ObjectSlots
from vico.sim.physics.genesis_scene import BuiltScene
from vico.sim.physics.movers import KinematicBodies
from vico.sim.physics.mujoco_engine import MujocoEngine
from vico.sim.physics.mujoco_scene import CompiledScene
from vico.sim.physics.records import ObjectMotion, RigidObject


class RayTwin:
    """The same scene compiled by MuJoCo, which is never stepped: Genesis casts rays with sensors that are built in.

    Parameters
    ----------
    scene
        In Genesis; the twin is compiled when it is first asked, and shared.
    """

    def __init__(self, scene: BuiltScene) -> None:
        if scene.twin is None:
            scene.twin = CompiledScene(scene.static, scene.models, scene.capacity)
        self._scene = scene
        self._engine = MujocoEngine(scene.twin, np.zeros((len(scene.models), 3)))

    def mirror(
        self, positions: NDArray[np.float64], movers: KinematicBodies, objects: ObjectMotion, slots: ObjectSlots
    ) -> None:
        """Put everybody where Genesis has them."""
        engine, mine = self._engine, self._scene
        for slot, there in enumerate(objects.present.tolist()):
            if there:
                pose = objects.position[slot], objects.quaternion[slot]
                engine.place_object(slot, RigidObject(slots.size[slot], float(slots.mass[slot]), *pose))
            else:
                engine.remove_object(slot)
        engine.follow_movers(movers)
        qpos, _ = engine.coordinates
        for theirs, index in zip(engine.compiled.robots, mine.robots, strict=True):
            qpos[theirs.root : theirs.root + 7] = positions[index.root : index.root + 7]
            qpos[theirs.angle] = positions[index.angle]

    def clearance_below(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `PhysicsEngine.clearance_below`."""
        return self._engine.clearance_below(points)
