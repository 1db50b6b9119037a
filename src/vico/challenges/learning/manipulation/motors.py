"""What actions do to the targets of an arm's motors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vico.assets.robots import MobileManipulator
from vico.challenges.learning.manipulation.options import ManipulationOptions
from vico.challenges.learning.manipulation.scene import Array

#: Of an action: the arm's joints and the jaw.
ACTIONS = 8
# Targets run ahead of joints by no more, rad, and fingers past what they press on, metres: 150 Nm and 60 N.
_AHEAD, _PAST = 0.1, 0.03


class Motors(NamedTuple):
    """Bounds of joints and jaw, and what an action of 1 moves them by, rad and metres, shape ``(8,)`` each."""

    low: Array
    high: Array
    step: Array

    def moved(self, targets: Array, joints: Array, actions: Array) -> Array:
        """Return targets moved by actions, within bounds and not far ahead of the joints; shape ``(n, 8)`` each."""
        wanted = targets + np.clip(actions, -1.0, 1.0) * self.step
        ahead = np.append(np.full(7, _AHEAD), _PAST)
        return np.clip(np.clip(wanted, joints - ahead, joints + ahead), self.low, self.high)


def motors_of(arm: MobileManipulator, options: ManipulationOptions) -> Motors:
    """Return those of an arm."""
    step = np.append(np.full(7, options.joint_step), options.finger_step)
    return Motors(np.append(arm.low, 0.0), np.append(arm.high, arm.opening), step)
