"""What many agents observe, as arrays: for who acts for all of them at once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Crowd:
    """What all agents observe, as arrays: row ``i`` is that of the agent whose `index` is ``i``.

    Attributes
    ----------
    index
        Row of each agent by name.
    time
        Seconds since midnight of the first day.
    pose
        As observations have it: x, y, z and the unit vector one looks along, float64, shape ``(n, 6)``.
    posture
        0 standing, 1 sitting, 2 lying, int8, shape ``(n,)``.
    place, room
        Place one is in, by its index in ``PublicMap.places``, and a number of the room; -1 where there is none, int32,
        shape ``(n,)``.
    heard, stopped
        Whether there are messages, and whether something stopped the last motion, bool, shape ``(n,)``.
    viewer, seen, distance
        Who has which other agent in view, by rows, int64, and how far away it is, metres; shape ``(pairs,)``. Only
        residents are told.
    """

    index: Mapping[str, int]
    time: float
    pose: NDArray[np.float64]
    posture: NDArray[np.int8]
    place: NDArray[np.int32]
    room: NDArray[np.int32]
    heard: NDArray[np.bool_]
    stopped: NDArray[np.bool_]
    viewer: NDArray[np.int64]
    seen: NDArray[np.int64]
    distance: NDArray[np.float64]
