"""Lift: take hold of a box and hold it up.

Task: grasp the box and lift it.

Randomizations: as of Reach; the goal is 0.15 to 0.25 m above where the box stands.

Success: both pads press on the box, its underside is 0.1 m or more above what it stood on, and it moves by less than
0.1 m/s.
"""

from __future__ import annotations

import numpy as np

from vico.challenges.learning.manipulation.draws import Episode, goal_above, standing_box
from vico.challenges.learning.manipulation.options import ManipulationOptions
from vico.challenges.learning.manipulation.readings import Bools, Readings
from vico.challenges.learning.manipulation.rewards import LIFTED, approach, closing, lifting
from vico.challenges.learning.manipulation.scene import Array
from vico.challenges.learning.manipulation.tasks import ManipulationTask

_SLOW = 0.1


def begin(chance: np.random.Generator, options: ManipulationOptions) -> Episode:
    """Draw a standing box and a goal above it."""
    return goal_above(chance, standing_box(chance, options))


def evaluate(r: Readings) -> dict[str, Bools]:
    """Say what of the rule holds."""
    lifted, slow = r.clearance >= LIFTED, r.thing_speed[:, 0] < _SLOW
    return {"gripped": r.gripped, "lifted": lifted, "still": slow, "success": r.gripped & lifted & slow}


def staged(r: Readings) -> Array:
    """Return the staged reward: once the box is gripped, all of the approach counts as done."""
    before = np.where(r.gripped, 1.0, approach(r))
    grip = np.where(r.gripped, 1.0, closing(r))
    return np.asarray(0.25 * before + 0.25 * grip + 0.5 * lifting(r))


LIFT = ManipulationTask("lift", begin, evaluate, staged, ("object", "goal", "grasp", "place"))
