"""Robots: what physics, control and drawing need to know of each."""

from vico.assets.robots.catalogue import register_robot, robot_model, robot_names, robot_packages
from vico.assets.robots.model import (
    BUMP,
    BUMPER,
    FOOT_CONTACT,
    LIMB,
    TICK,
    TOUCH,
    ActionSpace,
    ControllerSettings,
    DeckModel,
    FourLegs,
    NoController,
    PolicyNetwork,
    RobotModel,
    Sensors,
    SkidSteering,
    velocity_space,
)

__all__ = [
    "BUMP",
    "BUMPER",
    "FOOT_CONTACT",
    "LIMB",
    "TICK",
    "TOUCH",
    "ActionSpace",
    "ControllerSettings",
    "DeckModel",
    "FourLegs",
    "NoController",
    "PolicyNetwork",
    "RobotModel",
    "Sensors",
    "SkidSteering",
    "register_robot",
    "robot_model",
    "robot_names",
    "robot_packages",
    "velocity_space",
]
