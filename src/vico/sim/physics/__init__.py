"""Physics of robots: one small protocol, and MuJoCo behind it."""

from vico.sim.physics.engine import PhysicsEngine, Scenery
from vico.sim.physics.mujoco_engine import MujocoEngine

__all__ = ["MujocoEngine", "PhysicsEngine", "Scenery"]
