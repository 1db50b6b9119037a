"""Junctions: one vehicle at a time has a junction to itself, and gets it only with room to leave it again.

A vehicle asks for every junction up to the next place where it can stand clear of them, all or none.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vico.io.compiled import compiled
from vico.sim.traffic.leader import bodies_around, touched_at
from vico.sim.traffic.path import point_on_path
from vico.sim.traffic.route import NEVER, STANDING_ROOM, is_lane_of_stop
from vico.sim.traffic.state import HELD_JUNCTIONS, NONE, PREVIOUS_LANES

_LET_OUT_AFTER = 2.0  # s that a vehicle has stood in a junction before the one in its way is let in
_CAR_PATIENCE = 10.0  # s that cars let pedestrians go first at a crossing
_CALLED_AFTER = 4.0  # s that a pedestrian has waited before cars let it go first
_QUEUE_LEAD, _QUEUE_LEAST = 5.0, 10.0  # s that somebody has to have waited longer, and at all, to go first
_HESITATION = 3.0  # s that a vehicle let in may stand before the junction goes back
_BUSY_WHILE = 5.0  # s that a vehicle which stands before its junction still counts on crossings
_GAP = 0.05  # m kept from others where a vehicle will stand
_AROUND = 5.0  # more than a vehicle's corners leave its path, and another's its half length, m


class JunctionRequest(NamedTuple):
    """The first junction ahead that a vehicle has to ask for.

    Attributes
    ----------
    planned_index
        Its position in the planned lanes; `NONE` where there is nothing to ask for.
    distance
        Metres from the vehicle's front to it.
    path_ends
        Whether the planned path ends for good.
    """

    planned_index: int
    distance: float
    path_ends: bool


class JunctionExit(NamedTuple):
    """Where a vehicle would stand after the junctions it asks for.

    Attributes
    ----------
    last
        Number of planned lanes up to the last of the junctions.
    end
        Number of planned lanes looked at.
    clear
        Metres of path without a junction after the last one.
    start, far
        s of the path where they begin (-1 for never) and end.
    """

    last: int
    end: int
    clear: float
    start: float
    far: float


@compiled
def next_junction_request(net, vehicle, stop_distance, braking_distance, path_ends):  # type: ignore[no-untyped-def]
    """Return the first junction within the braking distance, and before its stop, that a vehicle was not let into."""
    index = NONE
    distance = net.lanes[vehicle.lane].length - vehicle.offset
    for k in range(vehicle.planned_count):
        if distance > braking_distance or stop_distance < NEVER:
            break
        if net.lanes[vehicle.planned_lanes[k]].junction >= 0 and k >= vehicle.granted_count:
            index = k
            break
        if is_lane_of_stop(net, vehicle, k + 1):
            break
        distance += net.lanes[vehicle.planned_lanes[k]].length
    return JunctionRequest(index, distance, path_ends)


@compiled
def _find_exit(net, vehicle, request):  # type: ignore[no-untyped-def]
    """Return where a vehicle can stand clear of junctions after those it asks for."""
    s = vehicle.offset + request.distance
    clear = 0.0
    start = -1.0
    last = k = request.planned_index
    while k < vehicle.planned_count:
        lane = vehicle.planned_lanes[k]
        if net.lanes[lane].junction >= 0:
            clear = 0.0
            start = -1.0
            last = k + 1
        else:
            if start < 0.0:
                start = s
            clear += net.lanes[lane].length
        s += net.lanes[lane].length
        k += 1
        if clear >= vehicle.length + STANDING_ROOM:
            break
    return JunctionExit(last, k, clear, start, s)


@compiled
def _has_to_be_let_out(holder, vehicle):  # type: ignore[no-untyped-def]
    """Return whether vehicle `holder` cannot leave its junction before this one, in its way, has gone."""
    return holder.blocker == vehicle.index and holder.stopped_time > _LET_OUT_AFTER


@compiled
def _is_overtaken(longest_wait, vehicle):  # type: ignore[no-untyped-def]
    """Return whether it is the turn of another vehicle, that has waited so long."""
    return longest_wait > max(vehicle.junction_wait + _QUEUE_LEAD, _QUEUE_LEAST)


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
def _exit_is_long_enough(vehicle, request, leave):  # type: ignore[no-untyped-def]
    """Return whether a vehicle fits behind the junctions; where a car leaves the map it need not."""
    leaves_map = request.path_ends and leave.end == vehicle.planned_count and vehicle.route < 0
    return leave.clear >= vehicle.length + STANDING_ROOM or leaves_map


@compiled
def _exit_is_free(vehicle, leave, view, vehicles):  # type: ignore[no-untyped-def]
    """Return whether no vehicle is where this one would stand: whoever stands there may stay."""
    if leave.start < 0.0:
        return True
    room = min(vehicle.length + STANDING_ROOM, max(leave.clear, 0.0))
    x, y, _, _ = point_on_path(view.path, leave.start + (room - vehicle.length) / 2)
    nearby = bodies_around(vehicle.index, x, y, (room + vehicle.length) / 2 + _AROUND, view.beyond)
    for i in range(1, 6):
        there = leave.start + room * i / 5
        if touched_at(view.path, view.outline, there, nearby, _GAP, _GAP, vehicles) >= 0:
            return False
    return True


@compiled
def _way_is_free(vehicle, leave, view, vehicles):  # type: ignore[no-untyped-def]
    """Return whether no vehicle is on the whole way through the junctions."""
    there = vehicle.offset + 0.5
    x, y, _, _ = point_on_path(view.path, there)
    nearby = bodies_around(vehicle.index, x, y, leave.far - there + vehicle.length + _AROUND, view.beyond)
    while there < leave.far:
        if touched_at(view.path, view.outline, there, nearby, _GAP, _GAP, vehicles) >= 0:
            return False
        there += 1.0
    return True


@compiled
def may_enter_junction(net, fleet, junctions, vehicle, request, leave, view):  # type: ignore[no-untyped-def]
    """Return whether a vehicle may enter the junctions from the requested one up to its exit.

    Nobody else may have them or have waited longer for them, pedestrians go first, and the exit must have room. One
    that it keeps from leaving a junction itself does not count, if the whole way is free to get out of its way.
    """
    lets_out = False
    yields = False
    for k in range(request.planned_index, leave.last):
        lane = vehicle.planned_lanes[k]
        junction = net.lanes[lane].junction
        if junction < 0:
            continue
        holder = junctions.holder[junction]
        taken = holder >= 0 and holder != vehicle.index
        if taken and _has_to_be_let_out(fleet[holder], vehicle):
            lets_out = True
        elif taken or (holder < 0 and _is_overtaken(junctions.longest_wait[junction], vehicle)):
            vehicle.queued_junction = junction
            return False
        if yields_to_pedestrians(net, junctions, vehicle, lane):
            yields = True
    if yields or not _exit_is_long_enough(vehicle, request, leave):
        return False
    # Shorter vehicles, and those with a shorter way, would else take whatever room there is for ever.
    lane = vehicle.planned_lanes[leave.last] if leave.start >= 0.0 else NONE
    if lane >= 0 and _is_overtaken(junctions.longest_exit_wait[lane], vehicle):
        return False
    if not _exit_is_free(vehicle, leave, view, len(fleet)):
        vehicle.queued_exit = lane
        return False
    return not lets_out or _way_is_free(vehicle, leave, view, len(fleet))


@compiled
def _take_junctions(net, junctions, vehicle, request, leave):  # type: ignore[no-untyped-def]
    """Give a vehicle the junctions it asked for; return False if it holds too many already."""
    for k in range(request.planned_index, leave.last):
        junction = net.lanes[vehicle.planned_lanes[k]].junction
        if junction >= 0 and junctions.holder[junction] != vehicle.index:
            slot = NONE
            for h in range(HELD_JUNCTIONS):
                if vehicle.held_junctions[h] < 0:
                    slot = h
                    break
            if slot < 0:
                return False
            vehicle.held_junctions[slot] = junction
            junctions.holder[junction] = vehicle.index
    vehicle.granted_count = leave.last
    return True


@compiled
def request_junctions(net, fleet, junctions, vehicle, request, view):  # type: ignore[no-untyped-def]
    """Ask for the junctions ahead; return whether the vehicle has them now."""
    leave = _find_exit(net, vehicle, request)
    if not may_enter_junction(net, fleet, junctions, vehicle, request, leave, view):
        return False
    return _take_junctions(net, junctions, vehicle, request, leave)


@compiled
def hesitates(net, vehicle):  # type: ignore[no-untyped-def]
    """Return whether a vehicle was let into a junction but has not got going: then it is in everybody's way."""
    return vehicle.granted_count > 0 and vehicle.stopped_time > _HESITATION and net.lanes[vehicle.lane].junction < 0


@compiled
def holds_junction(vehicle):  # type: ignore[no-untyped-def]
    """Return whether a vehicle holds any junction."""
    holds = False
    for h in range(HELD_JUNCTIONS):
        holds = holds or vehicle.held_junctions[h] >= 0
    return holds


@compiled
def _is_inside(net, vehicle, junction):  # type: ignore[no-untyped-def]
    """Return whether a vehicle's body is in a junction or may still drive into it."""
    inside = net.lanes[vehicle.lane].junction == junction
    for k in range(vehicle.granted_count):
        inside = inside or net.lanes[vehicle.planned_lanes[k]].junction == junction
    rear = vehicle.offset - vehicle.length - 0.5
    k = 0
    while rear < 0.0 and k < PREVIOUS_LANES and vehicle.previous_lanes[k] != NONE:
        lane = vehicle.previous_lanes[k]
        inside = inside or net.lanes[lane].junction == junction
        rear += net.lanes[lane].length
        k += 1
    return inside


@compiled
def release_junctions(net, junctions, vehicle):  # type: ignore[no-untyped-def]
    """Give back the junctions that the vehicle's body has left and that are not granted ahead."""
    for h in range(HELD_JUNCTIONS):
        junction = vehicle.held_junctions[h]
        if junction < 0:
            continue
        if not _is_inside(net, vehicle, junction):
            vehicle.held_junctions[h] = NONE
            if junctions.holder[junction] == vehicle.index:
                junctions.holder[junction] = NONE
        elif junctions.holder[junction] < 0:
            junctions.holder[junction] = vehicle.index  # the one that was let go first has gone


@compiled
def release_all_junctions(junctions, vehicle):  # type: ignore[no-untyped-def]
    """Give back every junction a vehicle holds."""
    for h in range(HELD_JUNCTIONS):
        if vehicle.held_junctions[h] >= 0:
            if junctions.holder[vehicle.held_junctions[h]] == vehicle.index:
                junctions.holder[vehicle.held_junctions[h]] = NONE
            vehicle.held_junctions[h] = NONE
    vehicle.granted_count = 0


@compiled
def note_longest_waits(fleet, junctions):  # type: ignore[no-untyped-def]
    """Note how long the first in each junction's queue has waited, and the first that lacks room on each lane."""
    junctions.longest_wait[:] = 0.0
    junctions.longest_exit_wait[:] = 0.0
    for vehicle in fleet:
        lane, queued = vehicle.queued_exit, vehicle.queued_junction
        if lane >= 0:
            junctions.longest_exit_wait[lane] = max(junctions.longest_exit_wait[lane], vehicle.junction_wait)
        if queued >= 0:
            junctions.longest_wait[queued] = max(junctions.longest_wait[queued], vehicle.junction_wait)


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
