"""Physics of robots: two small protocols, and the engines behind them."""

from vico.sim.physics.engine import (
    DEFAULT_ENGINE,
    PhysicsBatch,
    PhysicsEngine,
    PhysicsScene,
    engine_names,
    make_engine,
    make_scene,
)
from vico.sim.physics.records import Capacity, StaticScene

__all__ = [
    "DEFAULT_ENGINE",
    "Capacity",
    "PhysicsBatch",
    "PhysicsEngine",
    "PhysicsScene",
    "StaticScene",
    "engine_names",
    "make_engine",
    "make_scene",
]
