"""What is painted where people cross carriageways, as flat quads."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vico.geometry import distance
from vico.worldgen.facts.streets import Crossing
from vico.worldgen.ground.strokes import ribbon

_STRIPE, _STRIPE_PERIOD = 0.5, 1.0  # of a zebra, metres along the walk
# Rows of marks at both sides: metres from one to the next, along the walk and across it.
_ROWS = {
    "dashes": (1.0, 0.5, 0.4),
    "dots": (0.6, 0.25, 0.4),
    "broken_lines": (0.7, 0.5, 0.12),
    "studs": (0.45, 0.1, 0.1),
}


def _zebra(start: tuple[float, float], end: tuple[float, float], width: float) -> list[NDArray[np.float64]]:
    """Bars along the traffic, side by side along the walk, as many as fit with half a gap at either kerb."""
    a, b = np.array(start), np.array(end)
    length = distance(b, a)
    count = int((length - 0.2) / _STRIPE_PERIOD)
    if count < 2:
        return []
    along = (b - a) / length
    across = np.array([-along[1], along[0]]) * (width - 0.4) / 2
    first = (length - (count - 1) * _STRIPE_PERIOD - _STRIPE) / 2
    quads = []
    for k in range(count):
        near = a + along * (first + k * _STRIPE_PERIOD)
        far = near + along * _STRIPE
        quads.append(np.array([near - across, far - across, far + across, near + across]))
    return quads


def crossing_paint(crossing: Crossing) -> list[NDArray[np.float64]]:
    """Paint a crossing by its kind."""
    bars = _zebra(crossing.start, crossing.end, crossing.width)
    if crossing.marking == "zebra" or not bars:
        return bars
    a, b = np.array(crossing.start), np.array(crossing.end)
    along = (b - a) / np.hypot(*(b - a))
    across = np.array([-along[1], along[0]]) * (crossing.width / 2 - 0.2)
    line = np.array([a + 0.3 * along, b - 0.3 * along])
    sides = [line + across, line - across]
    if crossing.marking in ("lines", "ladder"):
        lines = [quad for side in sides for quad in ribbon(side, 0.0, 0.25)]
        return lines + bars if crossing.marking == "ladder" else lines
    step, size, wide = _ROWS[crossing.marking]
    length = distance(line[1], line[0])
    return [
        quad
        for side in sides
        for place in np.arange(0.1, length - size, step)
        for quad in ribbon(np.array([side[0] + along * place, side[0] + along * (place + size)]), 0.0, wide)
    ]
