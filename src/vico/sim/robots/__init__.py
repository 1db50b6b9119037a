"""Robots: physics bodies with controllers that drive, walk, follow ways and stop for people."""

from vico.sim.robots.path_follower import RobotStatus
from vico.sim.robots.population import Mode, RobotEvent, RobotPopulation

__all__ = ["Mode", "RobotEvent", "RobotPopulation", "RobotStatus"]
