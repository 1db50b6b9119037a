"""Place: put down a box that is held.

Task: bring the box in the jaw to the goal, put it down there and let go.

Randomizations: the box as of Reach, held from above with its narrower sides between the pads, 0.12 to 0.2 m above the
ground or a table; the goal is 0.2 m or more beside, on the same ground or table.

Success: the box is within 0.1 m of the goal, stands, moves by less than 0.05 m/s and 0.5 rad/s, and neither pad
presses on it.
"""

from __future__ import annotations

import numpy as np

from vico.challenges.learning.manipulation.draws import Episode, goal_beside, held_box
from vico.challenges.learning.manipulation.options import ManipulationOptions
from vico.challenges.learning.manipulation.readings import Bools, Readings
from vico.challenges.learning.manipulation.rewards import NEAR, carrying, is_placed, releasing
from vico.challenges.learning.manipulation.scene import Array
from vico.challenges.learning.manipulation.tasks import ManipulationTask


def begin(chance: np.random.Generator, options: ManipulationOptions) -> Episode:
    """Draw a held box and a goal beside it."""
    return goal_beside(chance, held_box(chance, options))


def evaluate(r: Readings) -> dict[str, Bools]:
    """Say what of the rule holds."""
    return {"at_goal": r.goal_distance < NEAR, "released": ~r.touching, "success": is_placed(r)}


def staged(r: Readings) -> Array:
    """Return the staged reward: what is put down counts as carried there."""
    placed, release = is_placed(r), releasing(r)
    carried = np.where(release > 0.0, 1.0, carrying(r))
    return np.asarray(np.where(placed, 1.0, 0.6 * carried + 0.25 * release))


PLACE = ManipulationTask("place", begin, evaluate, staged, ("object", "goal", "grasp", "place"))
