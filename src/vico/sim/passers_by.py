"""People nobody plays, and assistants without a community: how they look, and how pedestrians move."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.assets.people import PASSERS_BY, Appearance, passer_by
from vico.seeds import rng
from vico.sim.animation import clip_index, stride_length


def looks_of_strangers(seed: int, count: int) -> list[Appearance]:
    """Return how the people of a run look who have no looks of their own: its assistants first, then its pedestrians.

    Which of the shared looks come, and in which order, is the run's; no two are alike before all have come.
    """
    order = rng(seed, "looks").permutation(PASSERS_BY)
    return [passer_by(int(order[k % PASSERS_BY])) for k in range(count)]


def manner_of_pedestrian(pedestrian: int) -> str:
    """Return the name of the random stream that decides how a pedestrian carries itself."""
    return f"pedestrian_{pedestrian}"


def pedestrian_motion(
    speed: NDArray[np.float64], walked: NDArray[np.float64], height: NDArray[np.float64], second: float
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return motion and place in its cycle of each pedestrian: they walk, or stand and breathe.

    Parameters
    ----------
    speed, walked
        Metres a second, and metres walked so far, shape ``(n,)``.
    height
        Stature, metres, shape ``(n,)``.
    second
        Seconds since midnight of the first day.
    """
    moving = speed > 0.05
    clip = np.where(moving, clip_index("walk"), clip_index("idle"))
    stride = np.where(moving, stride_length(clip, speed, height), 2.0)
    # People at rest breathe by the clock, each at their own time.
    at_rest = second * 0.5 + np.arange(len(speed)) * 0.37
    return clip, np.where(moving, walked / stride, at_rest) % 1.0
