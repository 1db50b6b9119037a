"""How far it is to what stands in the way, along rays over the public map."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled
from vico.world.walkable import WalkableMap

#: Rays around an agent, the first one ahead, counter-clockwise; how far they reach, metres.
RAYS, FAR = 16, 20.0
_LEAST_STEP = 0.25


def free_ways(walkable: WalkableMap, x: float, y: float, heading: float) -> NDArray[np.float64]:
    """Return how far it is to what stands in the way along each ray, metres, up to `FAR`, shape ``(RAYS,)``.

    Parameters
    ----------
    x, y
        ENU metres.
    heading
        Radians.
    """
    out = np.empty(RAYS)
    _march(walkable.clearance, float(walkable.half), float(walkable.cell), (x, y, heading), out)
    return out


@compiled
def _march(clearance, half, cell, stance, out):  # type: ignore[no-untyped-def]
    x, y, heading = stance
    n = clearance.shape[0]
    for k in range(len(out)):
        angle = heading + 2.0 * math.pi * k / len(out)
        east, north, away = math.cos(angle), math.sin(angle), 0.0
        while away < FAR:
            ix = math.floor((x + away * east + half) / cell)
            iy = math.floor((y + away * north + half) / cell)
            room = clearance[iy, ix] if 0 <= ix < n and 0 <= iy < n else 0.0
            if room <= 0.0:
                break
            # Clearance is that of the cell's centre: half a cell less is free at every point of it.
            away += max(_LEAST_STEP, room - cell)
        out[k] = min(away, FAR)
