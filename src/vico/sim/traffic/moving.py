"""Puts a vehicle's body where it is on its path."""

from __future__ import annotations

import numpy as np

from vico.io.compiled import inlined
from vico.sim.traffic.path import end_of_lane_change, footprint
from vico.sim.traffic.records import BACKING_IN


@inlined
def move_vehicle(vehicle, shapes, view, move, dt):  # type: ignore[no-untyped-def]
    """Move a vehicle along its path, metres, in `dt` seconds, and put its body there."""
    x, y, c, s = footprint(view.path, view.outline, vehicle.offset + move)
    vehicle.offset += move
    if vehicle.lateral_offset != 0.0 and (move > 0.0 or vehicle.stopping == BACKING_IN):
        # The front's own metres: `outline` keeps what a point of the path had done when the change began.
        vehicle.lane_change_distance += move
    v = vehicle.index
    shapes.vx[v], shapes.vy[v] = (x - shapes.x[v]) / dt, (y - shapes.y[v]) / dt
    shapes.x[v], shapes.y[v], shapes.yaw[v] = x, y, np.arctan2(s, c)
    if vehicle.lane_change_length > 0.0 and vehicle.lane_change_distance > end_of_lane_change(vehicle):
        vehicle.lateral_offset = 0.0
