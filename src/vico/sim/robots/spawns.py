"""Where robots start that nobody gave a place."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError
from vico.seeds import rng
from vico.world.world import World

# Metres of free ground around each, and between two.
_ROOM, _APART = 1.0, 3.0


def spawns(world: World, count: int, seed: int) -> NDArray[np.float64]:
    """Return reachable places apart from each other: x, y, yaw, shape ``(count, 3)``.

    Raises
    ------
    InputError
        If there is no room for so many.
    """
    found: list[NDArray[np.float64]] = []
    for i in range(count):
        stream = rng(seed, "robot spawn", i)
        for _ in range(200):
            xy = world.walkable.random_point(stream, clearance=_ROOM)
            if all(np.linalg.norm(xy - other[:2]) >= _APART for other in found):
                break
        else:
            raise InputError(f"robots: no room for {count} robots {_APART} m apart; take fewer")
        found.append(np.array([*xy, stream.uniform(-np.pi, np.pi)]))
    return np.array(found).reshape(-1, 3)
