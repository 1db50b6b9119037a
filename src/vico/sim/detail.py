"""Level of detail: who is so far from everybody who looks that a coarse body and roughly placed feet do.

Only pictures know of it, never the state: what happens does not depend on who looks.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

#: From so many people on there are coarse bodies: making and loading them costs more than they save for fewer.
CROWD = 40
# Who is less tall than this in every picture is far, pixels.
_TALL = 12.0


class Sights(NamedTuple):
    """From where, and how large, people are seen.

    Attributes
    ----------
    eyes
        ENU metres, float64, shape ``(k, 3)``.
    focal
        Focal lengths, pixels, float64, shape ``(k,)``.
    """

    eyes: NDArray[np.float64]
    focal: NDArray[np.float64]


def far_from_all(sights: Sights, position: NDArray[np.float64], height: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return who is small in all pictures, whichever way these look.

    Parameters
    ----------
    sights
        Of all viewers; without any, nobody is far.
    position
        Where people stand, ENU metres, shape ``(n, 3)``.
    height
        Their statures, metres, shape ``(n,)``.
    """
    if not len(sights.eyes):
        return np.zeros(len(position), np.bool_)
    away = np.hypot(*(sights.eyes[:, None, :2] - position[None, :, :2]).transpose(2, 0, 1))
    tallest = (sights.focal[:, None] / np.maximum(away, 0.1)).max(axis=0) * height
    return np.asarray(tallest < _TALL)
