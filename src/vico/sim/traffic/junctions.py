"""Junctions: who may enter one, and then only with room to leave it again.

A vehicle asks for every junction up to the next place where it can stand clear of them, all or none.
"""

from __future__ import annotations

from typing import NamedTuple

from vico.io.compiled import compiled, inlined
from vico.sim.traffic.claims import LETS_OUT, TAKEN, counted_wait, is_overtaken, take_junctions, what_stands_against
from vico.sim.traffic.crossings import yields_to_pedestrians
from vico.sim.traffic.leader import bodies_around, touched_at
from vico.sim.traffic.path import point_on_path
from vico.sim.traffic.records import NONE
from vico.sim.traffic.route import NEVER, STANDING_ROOM, clear_of_tracks, is_lane_of_stop
from vico.sim.traffic.track_crossings import crosses_called_track

_HESITATION = 3.0  # s that a vehicle let in may stand before the junction goes back
_APART = 3.0  # m between places where it is looked whether somebody stands there
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
    to_come
        Metres beyond it that those need who are ahead on its last lane.
    end
        Number of planned lanes looked at.
    clear
        Metres of path without a junction after the last one.
    start, far
        s of the path where they begin (-1 for never) and end.
    """

    last: int
    to_come: float
    end: int
    clear: float
    start: float
    far: float


@inlined
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
def _find_exit(net, junctions, vehicle, request):  # type: ignore[no-untyped-def]
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
            begin = clear_of_tracks(net, lane, clear, vehicle.length + STANDING_ROOM)
            if begin > 0.0:
                clear = 0.0
                start = -1.0
            if start < 0.0:
                start = s + begin
            clear += net.lanes[lane].length - begin
        s += net.lanes[lane].length
        k += 1
        if clear >= vehicle.length + STANDING_ROOM:
            break
    to_come = 0.0
    lane = vehicle.planned_lanes[last - 1]
    if last > request.planned_index and not junctions.claims.exclusive[net.lanes[lane].junction]:
        to_come = junctions.claims.to_come[lane]
    return JunctionExit(last, to_come, k, clear, start, s)


@compiled
def _exit_is_long_enough(vehicle, request, leave):  # type: ignore[no-untyped-def]
    """Return whether a vehicle fits behind the junctions; where a car leaves the map it need not."""
    leaves_map = request.path_ends and leave.end == vehicle.planned_count and vehicle.route < 0
    return leave.clear >= leave.to_come + vehicle.length + STANDING_ROOM or leaves_map


@compiled
def _who_is_at_exit(vehicle, leave, view, vehicles):  # type: ignore[no-untyped-def]
    """Return the first vehicle that is where this one would stand, or `NONE`: whoever stands there may stay."""
    if leave.start < 0.0:
        return NONE
    room = min(leave.to_come + vehicle.length + STANDING_ROOM, max(leave.clear, 0.0))
    x, y, _, _ = point_on_path(view.path, leave.start + (room - vehicle.length) / 2)
    nearby = bodies_around(vehicle.index, x, y, (room + vehicle.length) / 2 + _AROUND, view.beyond)
    places = 5 + int(leave.to_come / _APART)
    for i in range(1, places + 1):
        there = leave.start + room * i / places
        hit = touched_at(view.path, view.outline, there, nearby, _GAP, _GAP, vehicles)
        if hit >= 0:
            return nearby[hit].body
    return NONE


@compiled
def _waits_outside(net, vehicle):  # type: ignore[no-untyped-def]
    """Return whether a vehicle waits for a junction before it: for ever, if who has waited longer cannot pass it."""
    return vehicle.junction_wait > 0.0 and vehicle.granted_count == 0 and net.lanes[vehicle.lane].junction < 0


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
        against = what_stands_against(net, fleet, junctions, vehicle, lane)
        if against == TAKEN:
            vehicle.queued_junction = junction
            return False
        lets_out = lets_out or against == LETS_OUT
        if yields_to_pedestrians(net, junctions, vehicle, lane):
            yields = True
    if yields or not _exit_is_long_enough(vehicle, request, leave):
        return False
    s = vehicle.offset + request.distance
    if crosses_called_track(net, vehicle, request.planned_index, leave.last, leave.end, s, leave.start):
        return False
    # Shorter vehicles, and those with a shorter way, would else take whatever room there is for ever.
    lane = vehicle.planned_lanes[leave.last] if leave.start >= 0.0 else NONE
    if lane >= 0 and is_overtaken(junctions.longest_exit_wait[lane], counted_wait(junctions, vehicle)):
        return False
    other = _who_is_at_exit(vehicle, leave, view, len(fleet))
    if 0 <= other < len(fleet) and _waits_outside(net, fleet[other]):
        vehicle.kept_out_from = fleet[other].lane  # that one goes first, and who comes behind it stays back
        return False
    if other >= 0:
        vehicle.queued_exit = lane
        return False
    return not lets_out or _way_is_free(vehicle, leave, view, len(fleet))


@inlined
def request_junctions(net, fleet, junctions, vehicle, request, view):  # type: ignore[no-untyped-def]
    """Ask for the junctions ahead; return whether the vehicle has them now."""
    leave = _find_exit(net, junctions, vehicle, request)
    if not may_enter_junction(net, fleet, junctions, vehicle, request, leave, view):
        return False
    return take_junctions(net, junctions, vehicle, request.planned_index, leave.last)


@compiled
def hesitates(net, vehicle):  # type: ignore[no-untyped-def]
    """Return whether a vehicle was let into a junction but has not got going: then it is in everybody's way."""
    return vehicle.granted_count > 0 and vehicle.stopped_time > _HESITATION and net.lanes[vehicle.lane].junction < 0
