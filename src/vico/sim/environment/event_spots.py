"""Where things stand at an event: a barrier before each lane that is closed, stalls over a square, a stage."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vico.sim.environment.event_sites import EventSites
from vico.sim.environment.occurrence import Occurrence
from vico.world.walkable import CROSSING, ROADWAY

# A barrier stands so far within its lane, metres, or in its middle if that is nearer.
_INTO_LANE = 4.0
#: What stands across closed lanes.
BARRIER = "road_barrier"
# Stalls stand so far apart, with so much free ground around the middle of each, and of a stage, metres.
_APART, _STALL_ROOM, _STAGE_ROOM = 5.0, 2.2, 5.0
# Directions in which it is asked what is there.
_AROUND = np.array([(np.cos(a), np.sin(a)) for a in np.arange(12) * np.pi / 6])
# Cars that have run into each other: metres between their middles, and radians that the one behind is askew.
_CAR_APART, _ASKEW = 5.6, 0.2


class Spot(NamedTuple):
    """Where a thing stands: its model, ENU metres, radians."""

    model: str
    x: float
    y: float
    yaw: float


def spots_of(one: Occurrence, sites: EventSites) -> list[Spot]:
    """Return where an event's things stand, always in the same order."""
    if not one.kind.lanes:
        return _over_ground(one, sites)
    models = list(one.kind.things)
    if models == [BARRIER]:
        return _before_lanes(BARRIER, one, sites)
    return _on_a_lane(models, one, sites)


def _over_ground(one: Occurrence, sites: EventSites) -> list[Spot]:
    """Return spots on a grid round the middle, the nearest first, as many as there is open ground for."""
    models = [model for model, count in one.kind.things.items() for _ in range(count)]
    reach = one.kind.radius if one.event.region is None else one.event.region[2]
    # One thing alone may stand anywhere: lamps and trees leave few places with so much room.
    apart = _APART if len(models) > 1 else _APART / 4
    steps = np.arange(-np.floor(reach / apart), np.floor(reach / apart) + 1) * apart
    grid = np.array([(x, y) for x in steps for y in steps if x * x + y * y <= reach * reach]).reshape(-1, 2)
    grid = grid[np.lexsort((grid[:, 1], grid[:, 0], np.round(np.hypot(*grid.T), 3)))]
    points = grid + one.middle[:2]
    room = _STAGE_ROOM if len(models) == 1 else _STALL_ROOM
    walkable = sites.world.walkable
    free = walkable.is_connected(points) & (walkable.clearance_at(points) >= room)
    # Not even their edges stand in a street.
    around = points[:, None] + np.concatenate([np.zeros((1, 2)), room / 2 * _AROUND, room * _AROUND])
    free &= ~np.isin(walkable.class_at(around), (ROADWAY, CROSSING)).any(axis=1)
    chosen = points[free][: len(models)]
    return [Spot(model, float(x), float(y), 0.0) for model, (x, y) in zip(models, chosen, strict=False)]


def _on_a_lane(models: list[str], one: Occurrence, sites: EventSites) -> list[Spot]:
    """Return spots one behind the other in the middle of the longest closed lane that no bus takes, askew."""
    lanes, closed = sites.world.lanes, sites.lanes_of(one.event)
    usable = [k for k in np.flatnonzero(closed).tolist() if k not in _lanes_of_buses(sites)]
    if not usable or not models:
        return []
    lane = max(usable, key=lambda k: (float(lanes.length[k]), -k))
    found = []
    for k, model in enumerate(models):
        x, y, yaw = lanes.at(lane, max(float(lanes.length[lane]) / 2 - _CAR_APART * k, 0.0)).tolist()
        found.append(Spot(model, x, y, yaw + _ASKEW * k))
    return found


def _lanes_of_buses(sites: EventSites) -> set[int]:
    index = sites.world.lanes.index
    return {index[lane] for line in sites.world.transit.lines for lane in line.lanes if lane in index}


def _before_lanes(model: str, one: Occurrence, sites: EventSites) -> list[Spot]:
    """Return a spot across each closed lane where cars could drive in; buses' lanes stay free."""
    lanes, closed = sites.world.lanes, sites.lanes_of(one.event)
    buses = _lanes_of_buses(sites)
    found = []
    for lane in np.flatnonzero(closed).tolist():
        through = [k for k in lanes.preceding(lane).tolist() if lanes.inside[k] < 0 and closed[k]]
        if lane not in buses and not through:
            x, y, yaw = lanes.at(lane, min(_INTO_LANE, float(lanes.length[lane]) / 2)).tolist()
            found.append(Spot(model, x, y, yaw))
    return found
