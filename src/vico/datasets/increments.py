"""Actions that are increments of joints, as policies of arms give them: what their vectors hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.challenges.pick_place.demonstrations import INCREMENTS
from vico.datasets.actions import ActionForm
from vico.errors import InputError

#: Stands where the forms of other actions name one of a robot's action spaces.
SPACE = "increments"


@dataclass(frozen=True)
class IncrementForm:
    """Vectors with an increment for each degree of freedom of a mobile manipulator.

    An increment goes from where a joint is, as the state of the same frame says, to where its servo is told to be;
    `vico.agents.robot.increments.control_of` makes an action of both.
    """

    robot: bool = True
    width: int = len(INCREMENTS)
    space: str = SPACE

    @property
    def names(self) -> tuple[str, ...]:
        """What each number of a vector is, rad and metres."""
        return INCREMENTS

    def decode(self, vector: Sequence[float] | NDArray[Any], pose: Sequence[float], text: str = "") -> dict[str, Any]:
        """Return the vector as a record; only with a state it is an action.

        Raises
        ------
        InputError
            If the vector has another length or holds what is not finite.
        """
        numbers = np.asarray(vector, np.float64)
        if numbers.shape != (self.width,) or not np.isfinite(numbers).all():
            raise InputError(f"action: a vector of shape {numbers.shape}; give {self.width} finite numbers")
        return {"type": SPACE, "vector": numbers.tolist()}


Form = ActionForm | IncrementForm


def form_of(*, robot: bool, width: int, space: str) -> Form:
    """Return how actions of a dataset are read, as its record says."""
    if space == SPACE:
        return IncrementForm(robot, width, space)
    return ActionForm(robot, width, space)
