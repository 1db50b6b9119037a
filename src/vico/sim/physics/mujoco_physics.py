"""MuJoCo behind the protocols: a scene that makes engines, and batches of copies stepped on several threads."""

from __future__ import annotations

import copy as copying
import os
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import RobotModel
from vico.errors import InputError
from vico.sim.physics.mujoco_engine import MujocoEngine, take_warnings
from vico.sim.physics.mujoco_scene import ChunkedScenes, CompiledScene, SharedModel
from vico.sim.physics.records import COARSE, Capacity, StaticChunks, StaticScene


class MujocoBatch:
    """Copies of one scene; see `vico.sim.physics.engine.PhysicsBatch`.

    Each copy is an engine, so it computes what an engine computes. MuJoCo steps them outside Python's lock; every
    thread has a model of its own, so that copies may differ in gains, sizes and masses.

    Parameters
    ----------
    scene
        What is fixed.
    copies
        How many.
    places
        Where the robots of every copy stand at first: x, y, yaw, shape ``(n, 3)``.
    threads
        0: one a core.
    """

    def __init__(self, scene: CompiledScene, copies: int, places: NDArray[np.float64], *, threads: int = 0) -> None:
        if copies < 1 or threads < 0:
            raise InputError(f"physics: a batch needs 1 or more copies and 0 or more threads, not {copies}, {threads}")
        self.compiled = scene
        self.engines = [MujocoEngine(scene, places) for _ in range(copies)]
        count = min(threads or os.cpu_count() or 1, copies)
        # The last thread is the caller's.
        self._models: list[dict[CompiledScene, SharedModel]] = [{} for _ in range(count)]
        self._pool = ThreadPoolExecutor(count - 1) if count > 1 else None

    def __len__(self) -> int:
        return len(self.engines)

    def restore(self, copies: NDArray[np.int64], arrays: Mapping[str, NDArray[Any]]) -> None:
        """Put some copies into a saved state."""
        for k in np.asarray(copies, np.int64):
            self.engines[k].restore(arrays)

    def arrays(self, copy: int) -> dict[str, NDArray[Any]]:
        """State of one copy."""
        return self.engines[copy].arrays()

    def command(self, robot: int, targets: NDArray[np.float64]) -> None:
        """Set what the servos of a robot follow in each copy, shape ``(copies, motors)``."""
        for engine, values in zip(self.engines, targets, strict=True):
            engine.command(robot, values)

    def bases(self, robot: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Poses and motions of a robot's base, shapes ``(copies, 7)`` and ``(copies, 6)``."""
        index = self.compiled.robots[robot]
        return self._gather(slice(index.root, index.root + 7), slice(index.root_speed, index.root_speed + 6))

    def joints(self, robot: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Positions and speeds of the joints, shape ``(copies, joints)`` each."""
        index = self.compiled.robots[robot]
        return self._gather(index.angle, index.rate)

    def objects(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Poses and motions of the objects, shapes ``(copies, slots, 7)`` and ``(copies, slots, 6)``."""
        found = [engine.objects() for engine in self.engines]
        poses = [np.concatenate([one.position, one.quaternion], axis=1) for one in found]
        motions = [np.concatenate([one.velocity, one.angular_velocity_body], axis=1) for one in found]
        return np.stack(poses), np.stack(motions)

    def _gather(self, pose: Any, motion: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        states = [engine.coordinates for engine in self.engines]
        return np.stack([q[pose] for q, _ in states]), np.stack([v[motion] for _, v in states])

    def step(self, frames: int = 1, *, frame: float = COARSE) -> None:
        """Move all copies on by some frames."""
        take_warnings()  # what was said of other models' steps says nothing of these
        for engine in self.engines:
            engine.stay_in_scene()
        used = {engine.compiled.bare for engine in self.engines}
        self._models = [{scene: one for scene, one in own.items() if scene.bare in used} for own in self._models]
        parts = [self.engines[k :: len(self._models)] for k in range(len(self._models))]

        def run(models: dict[CompiledScene, SharedModel], engines: list[MujocoEngine]) -> None:
            for engine in engines:
                scene = engine.compiled
                if scene not in models:
                    own = models is self._models[-1]
                    models[scene] = scene.shared if own else SharedModel(copying.copy(scene.model))
                engine.step_in(models[scene], frames, frame)

        others = (
            [self._pool.submit(run, *pair) for pair in zip(self._models[:-1], parts[:-1], strict=True)]
            if self._pool
            else []
        )
        run(self._models[-1], parts[-1])
        for other in others:
            other.result()
        for engine in self.engines:
            engine.judge()


class MujocoScene(CompiledScene):
    """See `vico.sim.physics.engine.PhysicsScene`; of a city in chunks it is the scene without any of them."""

    name = "mujoco"

    def __init__(self, static: StaticScene | StaticChunks, models: tuple[RobotModel, ...], capacity: Capacity) -> None:
        if isinstance(static, StaticScene):
            super().__init__(static, models, capacity)
        else:
            super().__init__(static.scene(()), models, capacity)
            self.chunked = ChunkedScenes(static, models, capacity)

    def engine(self, places: NDArray[np.float64]) -> MujocoEngine:
        """Return a new state with robots standing at `places`."""
        return MujocoEngine(self, places)

    def batch(self, copies: int, places: NDArray[np.float64], *, threads: int = 0) -> MujocoBatch:
        """Return many copies of a new state."""
        return MujocoBatch(self, copies, places, threads=threads)
