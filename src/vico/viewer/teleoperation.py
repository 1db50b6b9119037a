"""How robots are steered by hand: wheels and legs, a drone, and an arm whose hand is led by inverse kinematics."""

from __future__ import annotations

from vico.agents.human import Steering, drive, fly
from vico.assets.robots import MobileManipulator, robot_model


def steering_of(name: str) -> Steering:
    """Return what keys and sticks mean to a robot of a model."""
    model = robot_model(name)
    if isinstance(model.controller, MobileManipulator):
        from vico.viewer.hand_led import HandLed

        return HandLed(model)
    return fly if len(model.action_spaces["velocity"]) == 4 else drive
