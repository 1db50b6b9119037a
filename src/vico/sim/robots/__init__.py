"""Robots: physics bodies with controllers that drive, walk, follow ways and stop for people."""

from vico.assets.robots import ActionSpace
from vico.sim.robots.hardware import Reading
from vico.sim.robots.path_following import RobotStatus
from vico.sim.robots.population import RobotPopulation
from vico.sim.robots.scene import RobotScene
from vico.sim.robots.state import RobotEvent, RobotMode

__all__ = ["ActionSpace", "Reading", "RobotEvent", "RobotMode", "RobotPopulation", "RobotScene", "RobotStatus"]
