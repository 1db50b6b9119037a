"""Physics of robots: one small protocol, and MuJoCo behind it."""

from vico.sim.physics.engine import PhysicsEngine, StaticScene
from vico.sim.physics.mujoco_engine import MujocoEngine

__all__ = ["MujocoEngine", "PhysicsEngine", "StaticScene"]
