"""How fast a vehicle drives: the Intelligent Driver Model behind its leader.

Treiber, Hennecke, Helbing: Congested traffic states in empirical observations and microscopic simulations (2000).
"""

from __future__ import annotations

import numpy as np

from vico.io.compiled import compiled
from vico.sim.traffic.leader import NO_GAP
from vico.sim.traffic.path import footprint
from vico.sim.traffic.records import NONE
from vico.sim.traffic.route import NEVER

COMFORTABLE_BRAKING = 2.0  # m/s^2 on dry ground; what vehicles do now is `vehicle.braking`
TIME_GAP = 1.2  # s on dry ground; now: `vehicle.time_gap`
CLOSING_UP = 1.2  # m nearer to its leader than usual stands who would else stand in a junction

_JAM_GAP = 1.8  # m kept behind a leader that stands
_LEAST_GAP = 0.3  # no step leaves less to the leader, m
_BEYOND_STOP = 3.0  # m beyond the place where a vehicle stops, others do not count
_LEAST_SPEED = 0.02  # slower is standing, m/s


@compiled
def look_ahead(vehicle):  # type: ignore[no-untyped-def]
    """Return how far ahead a vehicle minds what is there: braking distance, time gap and a little more, metres."""
    return vehicle.speed * vehicle.speed / (2 * vehicle.braking) + vehicle.speed * vehicle.time_gap + 8.0


@compiled
def braking_distance(vehicle):  # type: ignore[no-untyped-def]
    """Return the metres a vehicle needs to stop comfortably, and a little more."""
    return vehicle.speed * vehicle.speed / (2 * vehicle.braking) + 8.0


@compiled
def leader_speed(shapes, leader, view, front):  # type: ignore[no-untyped-def]
    """Return how fast the leader moves along the path where the vehicle would meet it, m/s; at least 0."""
    if leader < 0:
        return 0.0
    _, _, c, s = footprint(view.path, view.outline, front)
    return max(shapes.vx[leader] * c + shapes.vy[leader] * s, 0.0)


@compiled
def idm_acceleration(vehicle, desired, gap, leading):  # type: ignore[no-untyped-def]
    """Return the Intelligent Driver Model's acceleration, m/s^2.

    Parameters
    ----------
    desired
        The speed the vehicle would like, m/s.
    gap, leading
        Metres to the leader (`NO_GAP` for none) and its speed, m/s.
    """
    speed, greatest = vehicle.speed, vehicle.acceleration
    rate = greatest * (1.0 - (speed / max(desired, 0.1)) ** 4)
    if gap < NO_GAP:
        wish = speed * vehicle.time_gap + speed * (speed - leading) / (2 * np.sqrt(greatest * vehicle.braking))
        rate -= greatest * ((_JAM_GAP + max(wish, 0.0)) / max(gap, 0.05)) ** 2
    return rate


@compiled
def next_speed(vehicle, rate, limit, gap, stop, dt):  # type: ignore[no-untyped-def]
    """Return the speed after `dt` seconds: the model's, within the limit, short of the leader and of the stop.

    The last two hold even where no tyre brakes so hard: vehicles never touch.
    """
    speed, hardest = vehicle.speed, vehicle.hard_braking
    new = max(speed + max(rate, -hardest) * dt, 0.0)
    if new > limit:
        new = max(limit, speed - hardest * dt)
    if gap < NO_GAP:
        new = min(new, max(gap - _LEAST_GAP, 0.0) / dt)
    if stop < NEVER:
        new = min(new, stop / dt)
    return new if new >= _LEAST_SPEED else 0.0


@compiled
def mind_only_before(stop, gap, leader):  # type: ignore[no-untyped-def]
    """Return gap and leader; none if it is well beyond where the vehicle stops anyway."""
    if gap > stop + _BEYOND_STOP:
        return NO_GAP, NONE
    return gap, leader
