"""Buses that have to change lanes where their route does wait for room in time, and are let in by who comes behind."""

from __future__ import annotations

import numpy as np

from vico.io.compiled import compiled
from vico.sim.traffic.path import LANE_CHANGE, STRAIGHT, end_of_lane_change, project_on_polyline
from vico.sim.traffic.records import DRIVING, DRIVING_OUT, LEAVING, NONE, STANDING
from vico.sim.traffic.route import NEVER, route_lane

_REAR_GAP = 4.0  # m behind a bus that are left for it
_SET_BACK = 5.0  # m before a lane's end at which vehicles stay out of the way of who does not get past there ...
_KEPT_OUT = 10.0  # ... and has waited for so long, s
_CLOSER = 1.5  # m nearer to a bus than that, a vehicle still stays behind it
_SWING_OUT, _WAITS_TO_LEAVE = 12.0, 20.0  # m behind a delivery from where one changes lanes; s
_LEAST_ROOM = 1.0  # m before a lane's end
# m that a vehicle's rear is past the beginning of a lane before it changes, and more where the other begins later.
_ON_IT, _WELL_ON_IT = 3.0, 6.0


@compiled
def lane_to_change_to(net, vehicle):  # type: ignore[no-untyped-def]
    """Return the neighbour lane on which a bus's route goes on, -1 where it goes straight on; buses only."""
    beside = route_lane(net, vehicle, 1)
    lane = net.lanes[vehicle.lane]
    return beside if beside == lane.left or beside == lane.right else -1


@compiled
def room_to_change(net, vehicle):  # type: ignore[no-untyped-def]
    """Return the metres before its lane's end at which a bus waits for room in the lane beside.

    So many that it ends this lane change, and those that follow it, before the junction; but not before it may change.
    """
    change = LANE_CHANGE + vehicle.length
    room, lane = change, route_lane(net, vehicle, 1)
    for k in range(2, 5):
        beside = route_lane(net, vehicle, k)
        if beside != net.lanes[lane].left and beside != net.lanes[lane].right:
            break
        room, lane = room + change + STRAIGHT + vehicle.length, beside
    return max(min(room, net.lanes[vehicle.lane].length - first_place_to_change(vehicle) - _WELL_ON_IT), _LEAST_ROOM)


@compiled
def first_place_to_change(vehicle):  # type: ignore[no-untyped-def]
    """Return the metres along its lane from which a vehicle may change to another: all of it is on the lane by then."""
    first = vehicle.length + _ON_IT
    if vehicle.lateral_offset != 0.0:
        first = max(first, vehicle.offset + end_of_lane_change(vehicle) - vehicle.lane_change_distance)
    return first


@compiled
def _behind_place(net, vehicle):  # type: ignore[no-untyped-def]
    """Return where others stop behind a car that backs into a place, has waited long to leave one, or delivers, m."""
    place = net.places[vehicle.place]
    if place.lot != NONE:
        waits = vehicle.stopping == DRIVING_OUT and vehicle.stay_left < -_WAITS_TO_LEAVE
        return place.out_offset - _REAR_GAP if waits else NEVER
    if place.delivery:
        return vehicle.stop_offset - vehicle.length - _SWING_OUT
    is_let_out = vehicle.stopping == LEAVING and vehicle.stay_left < -_WAITS_TO_LEAVE
    if is_let_out or (place.reverse and vehicle.stopping < STANDING):
        return place.middle - vehicle.length / 2 - _REAR_GAP
    return NEVER


@compiled
def places_to_let_in(net, fleet, shapes):  # type: ignore[no-untyped-def]
    """Return for each lane where vehicles stop to let others in: metres along it, else `NEVER`.

    That is a bus that waits beside it, or who does not get past those who wait at its end.
    """
    places = np.full(len(net.lanes), NEVER)
    for vehicle in fleet:
        kept, room = vehicle.kept_out_from, vehicle.length + _SET_BACK
        if kept != NONE and vehicle.junction_wait > _KEPT_OUT and net.lanes[kept].length > room:
            places[kept] = min(places[kept], net.lanes[kept].length - _SET_BACK)
        if vehicle.place != NONE:
            places[vehicle.lane] = min(places[vehicle.lane], _behind_place(net, vehicle))
        if vehicle.route < 0 or vehicle.at_stop or vehicle.planned_count > 0 or vehicle.lateral_offset != 0.0:
            continue
        is_stop_ahead = vehicle.stop_route_index == vehicle.route_index and vehicle.stop_offset > vehicle.offset - 1.0
        beside = lane_to_change_to(net, vehicle)
        if beside < 0 or is_stop_ahead:
            continue
        v, lane = vehicle.index, net.lanes[beside]
        x, y = shapes.x[v], shapes.y[v]
        middle, _ = project_on_polyline(net.points, net.along, lane.first_point, lane.end_point, x, y)
        places[beside] = min(places[beside], middle - vehicle.length / 2 - _REAR_GAP)
    return places


@compiled
def distance_to_let_in(vehicle, places):  # type: ignore[no-untyped-def]
    """Return the metres to where a vehicle stops to let a bus in on its lane; `NEVER` if it need not or cannot.

    Who has a junction ahead drives on: it would keep the bus and others from it.
    """
    if vehicle.stopping != DRIVING:
        return NEVER
    distance = places[vehicle.lane] - vehicle.offset
    is_too_late = distance + _CLOSER < vehicle.speed * vehicle.speed / (2 * vehicle.braking)
    return NEVER if is_too_late or vehicle.granted_count > 0 else max(distance, 0.0)
