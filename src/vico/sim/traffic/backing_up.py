"""Who backs up: a vehicle that keeps another one from leaving a junction, or stands head to head with it."""

from __future__ import annotations

import numpy as np

from vico.io.compiled import compiled

_BACK_UP_AFTER = 3.0  # s that both have stood
_ALIKE = 0.85  # cosine of the angle between two headings that count as the same
_QUEUE = 6  # vehicles behind one another that make room


@compiled
def _keep_each_other(vehicle, other):  # type: ignore[no-untyped-def]
    """Return whether both, one behind the other, have stood for a while, and not at a stop."""
    return not other.at_stop and vehicle.stopped_time >= _BACK_UP_AFTER and other.stopped_time >= _BACK_UP_AFTER


@compiled
def _gives_way_head_on(net, vehicle, other):  # type: ignore[no-untyped-def]
    """Return whether `other`, of two in each other's way, backs up.

    The one outside the junction does; a car rather than a bus; the higher number.
    """
    inside, other_inside = net.lanes[vehicle.lane].junction >= 0, net.lanes[other.lane].junction >= 0
    is_shorter = other.length < vehicle.length
    is_later = other.length == vehicle.length and other.index > vehicle.index
    return (inside and not other_inside) or (inside == other_inside and (is_shorter or is_later))


@compiled
def vehicles_backing_up(net, fleet, shapes):  # type: ignore[no-untyped-def]
    """Return for each vehicle whether it backs up in this step, bool, shape ``(vehicles,)``."""
    backs_up = np.zeros(len(fleet), np.bool_)
    for v in range(len(fleet)):
        vehicle, b = fleet[v], fleet[v].blocker
        if not 0 <= b < len(fleet) or not _keep_each_other(vehicle, fleet[b]):
            continue
        if fleet[b].blocker == v:
            backs_up[b] = _gives_way_head_on(net, vehicle, fleet[b])
        elif np.cos(shapes.yaw[v] - shapes.yaw[b]) < _ALIKE and net.lanes[vehicle.lane].junction >= 0:
            backs_up[b] = True
    # Who stands close behind one that backs up backs up, too.
    for _ in range(_QUEUE):
        for v in range(len(fleet)):
            b = fleet[v].blocker
            if 0 <= b < len(fleet) and backs_up[b] and fleet[v].route < 0 and fleet[v].stopped_time > 0.0:
                backs_up[v] = backs_up[v] or np.cos(shapes.yaw[v] - shapes.yaw[b]) > _ALIKE
    return backs_up
