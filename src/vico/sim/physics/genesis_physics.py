"""Genesis behind the protocols: a scene that makes engines and batches."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.sim.physics.genesis_batch import GenesisBatch
from vico.sim.physics.genesis_engine import GenesisEngine
from vico.sim.physics.genesis_scene import BuiltScene


class GenesisScene(BuiltScene):
    """See `vico.sim.physics.engine.PhysicsScene`."""

    name = "genesis"

    def engine(self, places: NDArray[np.float64]) -> GenesisEngine:
        """Return a new state with robots standing at `places`."""
        return GenesisEngine(self, places)

    def batch(self, copies: int, places: NDArray[np.float64], *, threads: int = 0) -> GenesisBatch:
        """Return many copies of a new state, which take turns on one thread."""
        return GenesisBatch(self, copies, places, threads=threads)
