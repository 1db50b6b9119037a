"""Teleoperation of robots: wheels and legs, a drone, and an arm whose hand is led by inverse kinematics.

Keys move the hand of an arm on wheels; inverse kinematics finds the joints.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.agents.base import Action, Observation
from vico.agents.human import PERIOD, HeldInput, Steering, drive, fly
from vico.assets.robots import MobileManipulator, RobotModel, robot_model
from vico.kinematics.arm import Chain, hand_pose, solve
from vico.sim.robots.manipulator import FINGER_SPEED, JOINT_SPEED


def steering_of(name: str) -> Steering:
    """Return what keys and sticks mean to a robot of a model."""
    model = robot_model(name)
    if isinstance(model.controller, MobileManipulator):
        return HandTeleoperation(model)
    return fly if len(model.action_spaces["velocity"]) == 4 else drive


Array = NDArray[np.float64]

#: How fast the hand is led, m/s and rad/s, and how fast the base drives and turns.
HAND_SPEED, HAND_TURN = 0.25, 0.8
BASE_SPEED, BASE_TURN = 0.5, 0.8

# The hand is led no farther than this from where the arm has come to, metres: it stops at the edge of its reach.
_AHEAD = 0.08
_STEPS = 20
# What is left of a pose that cannot be reached, metres and radians summed.
_REACHED = 0.03


class HandTeleoperation:
    """Steers a mobile manipulator by its ``joints`` space; keeps where the hand is to be between calls.

    Parameters
    ----------
    model
        Of the robot.
    """

    def __init__(self, model: RobotModel) -> None:
        controller = model.controller
        assert isinstance(controller, MobileManipulator)
        self._chain = Chain(controller.places, controller.axes, controller.low, controller.high, controller.grip)
        self._opening = float(controller.opening)
        self._goal: Array | None = None
        self._angles = np.zeros(len(controller.low))
        self._fingers = 0.0

    def __call__(self, held: HeldInput, observation: Observation) -> Action:
        """Return targets of the joints and speeds of the base."""
        measured = np.asarray(observation["sensors"]["joint_position"], np.float64)
        n = len(self._angles)
        if self._goal is None:
            self._angles, self._goal = measured[:n].copy(), self.pose_of(measured[:n])
            self._fingers = float(measured[n])
        self._lead(held, measured[:n])
        grip = ("grip_open" in held.keys) - ("grip_close" in held.keys)
        self._fingers = float(np.clip(self._fingers + grip * FINGER_SPEED * PERIOD, 0.0, self._opening))
        ahead = BASE_SPEED * held.axis("y", "forward", "back")
        turn = BASE_TURN * (held.axis("turn", "turn_left", "turn_right") or -held.axis("x", "right", "left"))
        vector = [*self._angles.tolist(), self._fingers, self._fingers, ahead, turn]
        return {"type": "control", "space": "joints", "vector": vector}

    def pose_of(self, angles: Array) -> Array:
        """Return the hand's rotation (columns 0-2) and place (column 3) in the base's frame, shape ``(3, 4)``."""
        n, pose = len(angles), np.empty((3, 4))
        hand_pose(self._chain, angles, np.empty((n, 3)), np.empty((n, 3)), pose)
        return pose

    def _lead(self, held: HeldInput, measured: Array) -> None:
        """Move the goal by what is held down, and the joints towards it; a goal out of reach is given up."""
        assert self._goal is not None
        step = HAND_SPEED * PERIOD
        shift = step * np.array([held.axis("hand_x"), held.axis("hand_y"), held.axis("hand_z", "up", "down")])
        tilt = HAND_TURN * PERIOD * held.axis("hand_pitch")
        if not shift.any() and not tilt:
            return
        goal = self._goal.copy()
        goal[:, 3] += shift
        here = self.pose_of(measured)[:, 3]
        away = float(np.linalg.norm(goal[:, 3] - here))
        if away > _AHEAD:
            goal[:, 3] = here + (goal[:, 3] - here) * (_AHEAD / away)
        c, s = np.cos(tilt), np.sin(tilt)
        goal[:, :3] = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]) @ goal[:, :3]
        angles = self._angles.copy()
        if solve(self._chain, angles, goal, _STEPS) > _REACHED:
            return
        most = JOINT_SPEED * PERIOD
        self._angles += np.clip(angles - self._angles, -most, most)
        # Where the joints lag behind, the goal waits for them.
        self._goal = goal if np.abs(angles - self._angles).max() < 1e-9 else self.pose_of(self._angles)
