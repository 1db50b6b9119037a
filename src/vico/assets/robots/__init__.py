"""Robots: what physics, control and drawing need to know of each."""

from vico.assets.robots.catalogue import robot_model, robot_names, robot_packages
from vico.assets.robots.model import BUMP, BUMPER, FOOT_CONTACT, TOUCH, PolicyNetwork, RobotModel

__all__ = [
    "BUMP",
    "BUMPER",
    "FOOT_CONTACT",
    "TOUCH",
    "PolicyNetwork",
    "RobotModel",
    "robot_model",
    "robot_names",
    "robot_packages",
]
