"""MuJoCo behind the protocols: a scene that makes engines and batches."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import RobotModel
from vico.sim.physics.mujoco_batch import MujocoBatch
from vico.sim.physics.mujoco_engine import MujocoEngine
from vico.sim.physics.mujoco_scene import ChunkedScenes, CompiledScene
from vico.sim.physics.records import Capacity, StaticChunks, StaticScene


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
