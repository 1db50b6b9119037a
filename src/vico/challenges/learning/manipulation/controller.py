"""A trained policy on a robot elsewhere, in a city's simulation: from what the robot knows to targets of its motors."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.assets.robots import MobileManipulator, robot_model
from vico.challenges.learning.manipulation.draws import hand_of_robot
from vico.challenges.learning.manipulation.motors import motors_of
from vico.challenges.learning.manipulation.observation import observe
from vico.challenges.learning.manipulation.options import ManipulationOptions
from vico.challenges.learning.manipulation.readings import PRESSING, Readings, hand_poses
from vico.challenges.learning.manipulation.scene import Array


class ArmMoment(NamedTuple):
    """What is known of an arm and its box. Vectors are in the frame of the robot's base, metres.

    Attributes
    ----------
    joints, joint_rates
        Of the arm and both fingers, rad and metres (a second), shape ``(9,)``.
    box, box_rotation
        Its middle, shape ``(3,)``, and its axes in columns, shape ``(3, 3)``.
    half
        Half its sides, shape ``(3,)``.
    goal
        Where its middle is to be, shape ``(3,)``.
    pressing
        Whether each finger touches it, shape ``(2,)``.
    """

    joints: Array
    joint_rates: Array
    box: Array
    box_rotation: Array
    half: Array
    goal: Array
    pressing: NDArray[np.bool_]


class ArmController:
    """Asks a policy 20 times a second, and keeps the targets that its increments add up to.

    The base is told to the policy as standing where it is.

    Parameters
    ----------
    policy
        From observations, shape ``(1, size)``, to actions, shape ``(1, 8)``: `ArrayPolicy.act`, `DecomposedPolicy.act`.
    options
        That it was trained with.
    """

    def __init__(self, policy: Callable[[NDArray[np.float32]], NDArray[Any]], options: ManipulationOptions) -> None:
        arm = robot_model("manipulator").controller
        assert isinstance(arm, MobileManipulator)
        self._policy, self._options = policy, options
        self._motors, self._hand = motors_of(arm, options), hand_of_robot()
        self._targets: Array | None = None

    def reset(self, targets: Array | None = None) -> None:
        """Begin anew from what the motors are told now, shape ``(9,)``; None: from where the joints are."""
        self._targets = None if targets is None else np.append(targets[:7], targets[7:9].mean())[None]

    def targets(self, moment: ArmMoment) -> Array:
        """Return the next targets of the arm's joints and both fingers, rad and metres, shape ``(9,)``."""
        joints = np.append(moment.joints[:7], moment.joints[7:9].mean())[None]
        before = joints if self._targets is None else self._targets
        action = np.asarray(self._policy(self.observation(moment)), np.float64)
        self._targets = self._motors.moved(before, joints, action)
        return np.append(self._targets[0], self._targets[0, 7])

    def observation(self, moment: ArmMoment) -> NDArray[np.float32]:
        """Return what the policy is told, shape ``(1, size)``."""
        up = np.array([0.0, 0.0, self._hand.stand])
        hand = np.empty((1, 3, 4))
        hand_poses(self._hand.chain, np.ascontiguousarray(moment.joints[None, :7]), hand)
        jaw, jaw_rate = moment.joints[7:9].mean(), moment.joint_rates[7:9].mean()
        box = (moment.box + up)[None]
        readings = Readings(
            joints=np.append(moment.joints[:7], jaw)[None],
            joint_rates=np.append(moment.joint_rates[:7], jaw_rate)[None],
            base=up[None],
            base_rotation=np.eye(3)[None],
            hand=hand[:, :, 3] + up,
            hand_rotation=hand[:, :, :3],
            thing=box,
            thing_rotation=moment.box_rotation[None],
            thing_speed=np.zeros((1, 2)),
            pressure=np.where(moment.pressing, 2.0 * PRESSING, 0.0)[None],
            targets=np.zeros((1, 8)),
            half=moment.half[None],
            surface=np.zeros(1),
            start=box,
            goal=(moment.goal + up)[None],
            at_goal=np.zeros(1, np.int64),
            was_lifted=np.zeros(1, bool),
        )
        return observe(readings, self._options.observation)
