"""Where a thing is put down at its destination: places to come to about its middle, and the spot ahead."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vico.agents.robot.body import Stance

Array = NDArray[np.float64]

#: Places round a middle that are tried one after the other.
PLACES = 6
#: Things are put down within so much of the middle of the destination, metres.
WITHIN = 2.2
# So far ahead things are put down, and come to from about the middle, metres.
_AHEAD, _ABOUT = 0.75, 1.6


def goal_about(centre: Sequence[float], number: int) -> Array:
    """Return the middle of a destination, or the place of a number about it, ENU metres, shape ``(2,)``."""
    middle = np.array(centre[:2], np.float64)
    turn = 2.0 * math.pi * number / PLACES
    return np.asarray(middle + (number > 0) * _ABOUT * np.array([math.cos(turn), math.sin(turn)]))


def spot_ahead(centre: Sequence[float], here: Stance, *, stand: float, tries: int) -> Array:
    """Return where to put a thing down: ahead, and near the middle of the destination, ENU metres, shape ``(3,)``.

    Parameters
    ----------
    stand
        Height of the base's frame above the ground, metres.
    tries
        How often it was tried: each time it is another spot.
    """
    middle = np.array(centre[:2])
    towards = middle - here.position[:2]
    away = float(np.hypot(*towards))
    ahead = towards / away if away > 0.3 else here.rotation[:2, 0]
    c, s = math.cos(0.6 * tries), math.sin(0.6 * tries)
    ahead = np.array([c * ahead[0] - s * ahead[1], s * ahead[0] + c * ahead[1]])
    reach = min(max(away - WITHIN, _AHEAD), max(away, _AHEAD))
    spot = here.position[:2] + ahead * reach
    return np.array([*spot, here.position[2] - stand])
