"""Many copies of a scene in Genesis, which take turns in it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError
from vico.sim.physics.frames import COARSE
from vico.sim.physics.genesis_engine import GenesisEngine
from vico.sim.physics.genesis_scene import BuiltScene


class GenesisBatch:
    """Copies of one scene; see `vico.sim.physics.engine.PhysicsBatch`.

    Each copy is an engine, so it computes what an engine computes, bit for bit. They are stepped one after the other:
    Genesis' own batches, on a GPU, compute with other bits than a scene alone.

    Parameters
    ----------
    scene
        What is fixed.
    copies
        How many.
    places
        Where the robots of every copy stand at first: x, y, yaw, shape ``(n, 3)``.
    threads
        Only one is used.
    """

    def __init__(self, scene: BuiltScene, copies: int, places: NDArray[np.float64], *, threads: int = 0) -> None:
        if copies < 1 or threads < 0:
            raise InputError(f"physics: a batch needs 1 or more copies and 0 or more threads, not {copies}, {threads}")
        self.engines = [GenesisEngine(scene, places) for _ in range(copies)]

    def __len__(self) -> int:
        return len(self.engines)

    def restore(self, copies: NDArray[np.int64], arrays: Mapping[str, NDArray[Any]]) -> None:
        """Put some copies into a saved state."""
        for k in np.asarray(copies, np.int64).tolist():
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
        found = [engine.base(robot) for engine in self.engines]
        poses = [np.concatenate([one.position, one.quaternion]) for one in found]
        motions = [np.concatenate([one.velocity, one.angular_velocity_body]) for one in found]
        return np.stack(poses), np.stack(motions)

    def joints(self, robot: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Positions and speeds of the joints, shape ``(copies, joints)`` each."""
        found = [engine.joints(robot) for engine in self.engines]
        return np.stack([one[0] for one in found]), np.stack([one[1] for one in found])

    def objects(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Poses and motions of the objects, shapes ``(copies, slots, 7)`` and ``(copies, slots, 6)``."""
        found = [engine.objects() for engine in self.engines]
        poses = [np.concatenate([one.position, one.quaternion], axis=1) for one in found]
        motions = [np.concatenate([one.velocity, one.angular_velocity_body], axis=1) for one in found]
        return np.stack(poses), np.stack(motions)

    def step(self, frames: int = 1, *, frame: float = COARSE) -> None:
        """Move all copies on by some frames."""
        for engine in self.engines:
            engine.step(frames, frame=frame)
