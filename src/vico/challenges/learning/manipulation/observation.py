"""What a learner is told, as one array of numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.challenges.learning.manipulation.draws import OPENING, ready_angles
from vico.challenges.learning.manipulation.readings import PRESSING, Readings

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
    "jaw": 3,
    "fingers": 3,
    "pressing": 2,
}
#: Numbers are cut off here.
BOUND = 10.0


# What the numbers of an entry are about, and how far they differ from that.
_USUAL: dict[str, tuple[object, object]] = {
    "joint_rates": (0.0, [0.6] * 7 + [0.1]),
    "robot": ([0.0, 0.0, 0.1], 0.1),
    "object": ([0.6, 0.0, 0.1], [0.1, 0.15, 0.25]),
    "hand_to_object": (0.0, 0.2),
    "object_to_goal": (0.0, 0.2),
    "hand_to_goal": (0.0, 0.25),
    "half_sides": (0.075, 0.03),
    "jaw": ([0.0, 0.0, 0.03], [0.7, 0.7, 0.05]),
    "fingers": (0.0, 0.7),
    "pressing": (0.5, 0.5),
}


def usual(observation: str) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return by what a network's inputs are shifted and divided, float32, shape ``(size,)`` each.

    Fixed numbers: with running means a policy changes while nothing is learnt, which an adaptive learning rate takes
    for learning too fast.
    """
    sizes = FULL if observation == "full" else PAPER
    known = {**_USUAL, "joints": ([*ready_angles(), OPENING], [0.7] * 7 + [0.05])}
    both = [
        [np.broadcast_to(np.asarray(known[name][k], np.float32), size) for name, size in sizes.items()] for k in (0, 1)
    ]
    return np.concatenate(both[0]), np.concatenate(both[1])


def size_of(observation: str) -> int:
    """Return how many numbers an observation has."""
    return sum((FULL if observation == "full" else PAPER).values())


def observe(readings: Readings, observation: str) -> NDArray[np.float32]:
    """Return the observation of each copy, float32, shape ``(n, size)``.

    ``robot`` is the base's position where it stood at first. ``object`` is seen from the base. ``half_sides`` are half
    the box's level sides, the one across the jaw first, and half its height. ``jaw`` is sine and cosine of four times
    the angle between the way the jaw opens and the box (a box is the same after a quarter turn), and what the jaw is
    wider than the box on each side. ``fingers`` is the way they point, ``pressing`` whether each pad presses on the
    box, which is what the robot's contacts tell.
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
        turn = 4.0 * r.jaw_turn
        parts += [
            r.level_half,
            np.column_stack([np.sin(turn), np.cos(turn), r.gap]),
            seen(r.hand_rotation[:, :, 2]),
            (r.pressure > PRESSING).astype(np.float64),
        ]
    return np.clip(np.concatenate(parts, axis=1), -BOUND, BOUND).astype(np.float32)
