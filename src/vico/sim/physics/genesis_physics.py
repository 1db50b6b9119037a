"""Genesis behind the protocols: a scene that makes engines and batches."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import RobotModel
from vico.sim.physics.genesis_batch import GenesisBatch
from vico.sim.physics.genesis_engine import GenesisEngine
from vico.sim.physics.genesis_scene import BuiltScene
from vico.sim.physics.records import Capacity, StaticChunks, StaticScene


class GenesisScene(BuiltScene):
    """See `vico.sim.physics.engine.PhysicsScene`; it has all of a city."""

    name = "genesis"

    def __init__(self, static: StaticScene | StaticChunks, models: tuple[RobotModel, ...], capacity: Capacity) -> None:
        super().__init__(static if isinstance(static, StaticScene) else static.whole(), models, capacity)

    def engine(self, places: NDArray[np.float64]) -> GenesisEngine:
        """Return a new state with robots standing at `places`."""
        return GenesisEngine(self, places)

    def batch(self, copies: int, places: NDArray[np.float64], *, threads: int = 0) -> GenesisBatch:
        """Return many copies of a new state, which take turns on one thread."""
        return GenesisBatch(self, copies, places, threads=threads)
