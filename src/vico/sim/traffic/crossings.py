"""Crossings between vehicles and pedestrians: who goes first."""

from __future__ import annotations

import numpy as np

from vico.io.compiled import compiled
from vico.sim.traffic.records import APPROACHING, NONE, PRESENT, PREVIOUS_LANES

_CAR_PATIENCE = 10.0  # s that cars let pedestrians go first at a crossing
_CALLED_AFTER = 4.0  # s that a pedestrian has waited before cars let it go first
_BUSY_WHILE = 5.0  # s that a vehicle which stands before its junction still counts on crossings


@compiled
def yields_to_pedestrians(net, junctions, vehicle, lane):  # type: ignore[no-untyped-def]
    """Return whether pedestrians on a crossing of `lane` go first; they are told how long the vehicle has waited."""
    yields = False
    for o in range(net.lanes[lane].first_crossing, net.lanes[lane].end_crossing):
        crossing = net.crossings[o]
        called = junctions.walker_wait[crossing] > _CALLED_AFTER and vehicle.junction_wait < _CAR_PATIENCE
        if junctions.walkers_on[crossing] > 0 or called:
            yields = True
            if vehicle.junction_wait > junctions.vehicle_wait[crossing]:
                junctions.vehicle_wait[crossing] = vehicle.junction_wait
    return yields


@compiled
def _mark_crossings(net, junctions, lane, rear):  # type: ignore[no-untyped-def]
    """Mark the crossings of a lane that a vehicle with its rear at `rear` metres along it has not passed."""
    for o in range(net.lanes[lane].first_crossing, net.lanes[lane].end_crossing):
        if rear < net.crossings_cleared[o]:
            junctions.crossing_busy[net.crossings[o]] = True


@compiled
def mark_busy_crossings(net, fleet, junctions):  # type: ignore[no-untyped-def]
    """Mark the crossings that a vehicle is on or has been let over.

    One that stands before its junction does not count; one that stands in it does, so that it gets out of it.
    """
    junctions.crossing_busy[:] = False
    for vehicle in fleet:
        if vehicle.presence != PRESENT or (vehicle.stopping > APPROACHING and vehicle.way_offset >= 0.0):
            continue
        rear = vehicle.offset - vehicle.length
        _mark_crossings(net, junctions, vehicle.lane, rear)
        k = 0
        while rear < 0.0 and k < PREVIOUS_LANES and vehicle.previous_lanes[k] != NONE:
            lane = vehicle.previous_lanes[k]
            rear += net.lanes[lane].length
            _mark_crossings(net, junctions, lane, rear)
            k += 1
        if vehicle.stopped_time > _BUSY_WHILE and net.lanes[vehicle.lane].junction < 0:
            continue
        for k in range(vehicle.granted_count):
            _mark_crossings(net, junctions, vehicle.planned_lanes[k], -np.inf)
