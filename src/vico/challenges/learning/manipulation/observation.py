"""What a learner is told, as one array of numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.challenges.learning.manipulation.readings import Readings

#: Entries and how many numbers each has. Positions and vectors are along the axes of the robot's base, metres.
PAPER = {
    "joints": 8,
    "joint_rates": 8,
    "robot": 3,
    "object": 3,
    "hand_to_object": 3,
    "object_to_goal": 3,
    "hand_to_goal": 3,
}
FULL = {
    **PAPER,
    "half_sides": 3,
    "jaw_in_object": 3,
    "fingers": 3,
    "pressure": 2,
}
#: Numbers are cut off here.
BOUND = 10.0
_NEWTONS = 100.0


def size_of(observation: str) -> int:
    """Return how many numbers an observation has."""
    return sum((FULL if observation == "full" else PAPER).values())


def observe(readings: Readings, observation: str) -> NDArray[np.float32]:
    """Return the observation of each copy, float32, shape ``(n, size)``.

    ``robot`` is the base's position where it stood at first. ``object`` is seen from the base. ``jaw_in_object`` is
    the way the jaw opens along the box's own axes, ``fingers`` the way they point, ``pressure`` the force of each pad
    in units of 100 N.
    """
    r = readings

    def seen(vector: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.einsum("nij,ni->nj", r.base_rotation, vector)

    parts = [
        r.joints,
        r.joint_rates,
        r.base,
        seen(r.thing - r.base),
        seen(r.thing - r.hand),
        seen(r.goal - r.thing),
        seen(r.goal - r.hand),
    ]
    if observation == "full":
        parts += [r.half, r.jaw_in_thing, seen(r.hand_rotation[:, :, 2]), r.pressure / _NEWTONS]
    return np.clip(np.concatenate(parts, axis=1), -BOUND, BOUND).astype(np.float32)
