"""Spikes and slits of drawn outlines: what is thinner than a hand and no wall.

An outline that runs out to a point and back within a hair of the same line, or that is cut into so, has walls in one
plane with its own or its neighbour's, and no roof comes out over it as drawn.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.worldgen.facts.outlines.roof_shapes import rings_of

_THIN = 0.2  # metres: no wall is thinner
_TURN = np.radians(174.0)  # by which an outline turns round at the end of a spike or a slit
_STYLE = {"join_style": "mitre", "mitre_limit": 5.0}


def without_needles(polygon: Polygon) -> BaseGeometry:
    """Return an outline without spikes and slits, in one or several pieces; one that has none, or is one, as it is."""
    if not any(_turns_round(ring) for ring in rings_of(polygon)):
        return polygon
    half = 0.5 * _THIN
    filled = overlay.buffer(overlay.buffer(polygon, half, **_STYLE), -half, **_STYLE)
    opened = overlay.buffer(overlay.buffer(filled, -half, **_STYLE), half, **_STYLE)
    return polygon if opened.is_empty else overlay.simplify(overlay.on_grid(overlay.areas_of(opened)), 0.02)


def _turns_round(ring: NDArray[np.float64]) -> bool:
    """Whether a ring turns back at a corner, or at two that are as close as a needle is thin."""
    step = np.roll(ring, -1, axis=0) - ring
    length = np.hypot(*step.T)
    heading = np.arctan2(step[:, 1], step[:, 0])
    turn = (heading - np.roll(heading, 1) + np.pi) % (2 * np.pi) - np.pi
    both = turn + np.roll(turn, -1)
    return bool((np.abs(turn) > _TURN).any() or ((np.abs(both) > _TURN) & (length < _THIN)).any())
