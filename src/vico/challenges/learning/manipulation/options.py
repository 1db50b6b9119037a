"""What of a manipulation environment can be chosen."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from vico.errors import InputError

#: Control steps a second, and seconds of a step of physics.
RATE, PHYSICS_STEP = 20, 0.01
#: Steps of physics in one of control.
SUBSTEPS = 5

_CHOICES = {
    "reward": ("staged", "paper"),
    "observation": ("full", "paper"),
    "surface": ("any", "ground", "table"),
    "base": ("fixed", "wheels"),
    "start": ("ready", "folded"),
}


@dataclass(frozen=True, kw_only=True)
class ManipulationOptions:
    """Options of a manipulation environment.

    Attributes
    ----------
    reward
        ``"staged"``: parts that follow each other (align, down, close, lift, hold, place). ``"paper"``: the four terms
        of the paper.
    observation
        ``"paper"``: 31 numbers as the paper lists them. ``"full"``: these, and size and turn of the box to the hand
        and which fingers press on it, 42 numbers.
    surface
        What boxes stand on: ``"ground"``, ``"table"``, or ``"any"``, each every second time.
    base
        ``"fixed"``: with its brakes on, which steps twice as fast. ``"wheels"``: it stands on its wheels, as in a
        simulation of a city, and may roll.
    start
        ``"ready"``: the hand points down in front of the base. ``"folded"``: the arm is folded as on a drive.
    oracle_grasp
        Whether a box is fastened to the hand once both pads press on it while the jaw is being closed, and let go of
        when it is opened. Nothing else is given. Without it friction alone holds a box.
    max_steps
        Of an episode.
    terminate_on_success
        Whether an episode ends with success. If not, what has been achieved has to be kept until the end.
    joint_step, finger_step
        What an action of 1 moves a target by, rad and metres.

    Raises
    ------
    InputError
        If a value is not one of these.
    """

    reward: str = "staged"
    observation: str = "full"
    surface: str = "any"
    base: str = "fixed"
    start: str = "ready"
    oracle_grasp: bool = False
    max_steps: int = 250
    terminate_on_success: bool = False
    joint_step: float = 0.06
    finger_step: float = 0.01

    def __post_init__(self) -> None:
        for name, choices in _CHOICES.items():
            value: Any = getattr(self, name)
            if value not in choices:
                raise InputError(f"env: {name} is {value!r}; use {' or '.join(map(repr, choices))}")
        if self.max_steps < 1:
            raise InputError(f"env: max_steps is {self.max_steps}; it has to be 1 or more")
        for name, most in (("joint_step", 0.2), ("finger_step", 0.05)):
            value = getattr(self, name)
            if not (math.isfinite(value) and 0.0 < value <= most):
                raise InputError(f"env: {name} is {value}; it has to be above 0 and at most {most}")
