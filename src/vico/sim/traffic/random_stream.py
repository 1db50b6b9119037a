"""Random numbers inside kernels, one stream a vehicle or pedestrian."""

from __future__ import annotations

import numpy as np

from vico.io.compiled import compiled


@compiled
def next_random(owner):  # type: ignore[no-untyped-def]
    """Return a number in 0..1 from the stream of a vehicle or pedestrian (splitmix64: one word of state, `random`)."""
    z = owner.random + np.uint64(0x9E3779B97F4A7C15)
    owner.random = z
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return float(z >> np.uint64(11)) / 9007199254740992.0
