"""Where things stand at an event: a barrier before each lane that is closed, stalls over a square, a stage."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vico.sim.environment.agenda import Occurrence
from vico.sim.environment.event_sites import EventSites

# A barrier stands so far within its lane, metres, or in its middle if that is nearer.
_INTO_LANE = 4.0


class Spot(NamedTuple):
    """Where a thing stands: its model, ENU metres, radians."""

    model: str
    x: float
    y: float
    yaw: float


def spots_of(one: Occurrence, sites: EventSites) -> list[Spot]:
    """Return where an event's things stand, always in the same order."""
    return [spot for model in one.kind.things if one.kind.lanes for spot in _before_lanes(model, one, sites)]


def _before_lanes(model: str, one: Occurrence, sites: EventSites) -> list[Spot]:
    """Return a spot across each closed lane where cars could drive in; buses' lanes stay free."""
    lanes, closed = sites.world.lanes, sites.lanes_of(one.event)
    buses = {lanes.index[lane] for line in sites.world.transit.lines for lane in line.lanes if lane in lanes.index}
    found = []
    for lane in np.flatnonzero(closed).tolist():
        through = [k for k in lanes.preceding(lane).tolist() if lanes.inside[k] < 0 and closed[k]]
        if lane not in buses and not through:
            x, y, yaw = lanes.at(lane, min(_INTO_LANE, float(lanes.length[lane]) / 2)).tolist()
            found.append(Spot(model, x, y, yaw))
    return found
