"""Pick and place: take a box and put it down elsewhere.

Task: grasp the box, lift it, bring it to the goal, put it down there and let go.

Randomizations: as of Reach; the goal is 0.2 m or more beside, on the same ground or table.

Success: as of Place, and the jaw has lifted the box on the way: pushing it there does not count.
"""

from __future__ import annotations

import numpy as np

from vico.challenges.learning.manipulation.draws import Episode, goal_beside, standing_box
from vico.challenges.learning.manipulation.lift import staged as lift_staged
from vico.challenges.learning.manipulation.options import ManipulationOptions
from vico.challenges.learning.manipulation.place import staged as place_staged
from vico.challenges.learning.manipulation.readings import Bools, Readings
from vico.challenges.learning.manipulation.rewards import NEAR, is_placed
from vico.challenges.learning.manipulation.scene import Array
from vico.challenges.learning.manipulation.tasks import ManipulationTask


def begin(chance: np.random.Generator, options: ManipulationOptions) -> Episode:
    """Draw a standing box and a goal beside it."""
    return goal_beside(chance, standing_box(chance, options))


def evaluate(r: Readings) -> dict[str, Bools]:
    """Say what of the rule holds."""
    found = {"gripped": r.gripped, "was_lifted": r.was_lifted, "at_goal": r.goal_distance < NEAR}
    return {**found, "released": ~r.touching, "success": is_placed(r) & r.was_lifted}


def staged(r: Readings) -> Array:
    """Return the staged reward: lifting, and carrying once the box has been lifted."""
    held_or_there = r.gripped | (r.goal_distance < NEAR)
    later = r.was_lifted & held_or_there
    return np.asarray(np.where(later, 0.4 + 0.6 * place_staged(r), 0.4 * lift_staged(r)))


PICK_PLACE = ManipulationTask("pick_place", begin, evaluate, staged, ("object", "goal", "grasp", "place"))
