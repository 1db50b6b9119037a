"""Lane changes, gap acceptance, and vehicles that let others in.

Cars leave a queue for a lane with fewer vehicles, and overtake cyclists and deliveries. Buses follow their route to
the lane beside: they wait for room in time, and vehicles behind them let them in.
"""

from __future__ import annotations

import numpy as np

from vico.io.compiled import compiled, inlined
from vico.sim.traffic.car_following import ANY_BODY, TOUCH, touched_at
from vico.sim.traffic.parking import is_behind_delivery
from vico.sim.traffic.path import (
    LANE_CHANGE,
    PATH_POINT,
    STRAIGHT,
    changing_lane,
    end_of_lane_change,
    lane_polyline,
    line_points,
    point_on_path,
    project_on_polyline,
)
from vico.sim.traffic.route import NEVER, advance_on_route, route_lane
from vico.sim.traffic.state import APPROACHING, DRIVING, DRIVING_OUT, LEAVING, NONE, PRESENT, STANDING

_GAP_BEHIND_BUS = 4.0  # m behind a bus that are left for it
_SET_BACK = 5.0  # m before a lane's end at which vehicles stay out of the way of who does not get past there ...
_KEPT_OUT = 10.0  # ... and has waited for so long, s
_CLOSER = 1.5  # m nearer to a bus than that, a vehicle still stays behind it
_DELIVERY_SWING_OUT, _WAITS_TO_LEAVE = 12.0, 20.0  # m behind a delivery from where one changes lanes; s
_LEAST_ROOM = 1.0  # m before a lane's end
# m that a vehicle's rear is past the beginning of a lane before it changes, and more where the other begins later.
_ON_IT, _WELL_ON_IT = 3.0, 6.0


@compiled
def route_lane_beside(net, vehicle):
    """Return the neighbour lane on which a bus's route goes on, -1 where it goes straight on; buses only."""
    beside = route_lane(net, vehicle, 1)
    lane = net.lanes[vehicle.lane]
    return beside if beside == lane.left or beside == lane.right else -1


@compiled
def room_to_change(net, vehicle):
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
    return max(min(room, net.lanes[vehicle.lane].length - earliest_lane_change(vehicle) - _WELL_ON_IT), _LEAST_ROOM)


@compiled
def earliest_lane_change(vehicle):
    """Return the metres along its lane from which a vehicle may change to another: all of it is on the lane by then."""
    first = vehicle.length + _ON_IT
    if vehicle.lateral_offset != 0.0:
        first = max(first, vehicle.offset + end_of_lane_change(vehicle) - vehicle.lane_change_distance)
    return first


@compiled
def _behind_place(net, vehicle):
    """Return where others stop behind a car that backs into a place, has waited long to leave one, or delivers, m."""
    place = net.places[vehicle.place]
    if place.lot != NONE:
        waits = vehicle.stopping == DRIVING_OUT and vehicle.stay_left < -_WAITS_TO_LEAVE
        return place.out_offset - _GAP_BEHIND_BUS if waits else NEVER
    if place.delivery:
        return vehicle.stop_offset - vehicle.length - _DELIVERY_SWING_OUT
    is_let_out = vehicle.stopping == LEAVING and vehicle.stay_left < -_WAITS_TO_LEAVE
    if is_let_out or (place.reverse and vehicle.stopping < STANDING):
        return place.middle - vehicle.length / 2 - _GAP_BEHIND_BUS
    return NEVER


@compiled
def places_to_let_in(net, fleet, shapes):
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
        beside = route_lane_beside(net, vehicle)
        if beside < 0 or is_stop_ahead:
            continue
        v, lane = vehicle.index, net.lanes[beside]
        x, y = shapes.x[v], shapes.y[v]
        middle, _ = project_on_polyline(net.points, net.along, lane.first_point, lane.end_point, x, y)
        places[beside] = min(places[beside], middle - vehicle.length / 2 - _GAP_BEHIND_BUS)
    return places


@compiled
def distance_to_let_in(vehicle, places):
    """Return the metres to where a vehicle stops to let a bus in on its lane; `NEVER` if it need not or cannot.

    Who has a junction ahead drives on: it would keep the bus and others from it.
    """
    if vehicle.stopping != DRIVING:
        return NEVER
    distance = places[vehicle.lane] - vehicle.offset
    is_too_late = distance + _CLOSER < vehicle.speed * vehicle.speed / (2 * vehicle.braking)
    return NEVER if is_too_late or vehicle.granted_count > 0 else max(distance, 0.0)


_REAR_GAP, _FRONT_GAP = 7.0, 8.0  # m that have to be free on the other lane behind the front's place and ahead of it
_LET_IN_GAP, _CUT_IN_GAP = 2.0, 3.0  # m behind a bus that is let in, and ahead of it
_VEHICLE_GAP, _PERSON_GAP = 0.1, 0.3  # m kept sideways on the other lane
_SWING_OUT, _PLACES = 6.0, 5  # m that a car has to have free to swing out, and places where that is looked at
_LANE_POINTS = 64
_QUEUE_GAP, _QUEUE_SPEED = 15.0, 0.5  # m, share of the desired speed: nearer and slower leaders are a queue
_CYCLIST_GAP, _CYCLIST_SPEED = 25.0, 0.9  # the same of cyclists who are overtaken
_BEHIND_HEADWAY, _BESIDE = 2.0, 2.0  # s until who comes up on the other lane is there; m from its middle
_LEAST_TIME = 6.0  # s between two lane changes of a car
_LEAST_LANE = 18.0  # m of lane that have to be left for a car to change


@compiled
def wants_lane_change(net, vehicle, gap, leading, wanted):
    """Return whether a car is in a queue, has not changed lanes lately, and has the room to do it.

    Parameters
    ----------
    gap, leading
        Metres to the vehicle ahead and its speed, m/s.
    wanted
        Speed the car would like to drive at, m/s.
    """
    is_queued = gap < _QUEUE_GAP and leading < _QUEUE_SPEED * wanted
    left = net.lanes[vehicle.lane].length - vehicle.offset
    return is_queued and vehicle.time_since_lane_change > _LEAST_TIME and left > _LEAST_LANE


@compiled
def _vehicles_on(net, fleet, lane):
    count = 0
    for vehicle in fleet:
        is_parked = vehicle.stopping > APPROACHING and not net.places[vehicle.place].delivery
        count += vehicle.lane == lane and vehicle.presence == PRESENT and not is_parked
    return count


@compiled
def _is_open(net, lane):
    return lane >= 0 and not net.lanes[lane].closed and not net.lanes[lane].shut


@compiled
def wants_to_overtake_cyclist(net, vehicle, view, ahead, wanted):
    """Return whether the one ahead rides a bicycle, resident or not, too slowly for a car that has not changed lately.

    Parameters
    ----------
    ahead
        The leader, metres to it, and its speed, m/s.
    wanted
        Speed the car would like to drive at, m/s.
    """
    leader, gap, leading = ahead
    shapes = view.beyond.shapes
    # Who is round but no disc.
    rides = shapes.rounding[leader] > 0.0 and shapes.half_length[leader] > shapes.rounding[leader]
    is_held_up = rides and gap < _CYCLIST_GAP and leading < _CYCLIST_SPEED * wanted
    left = net.lanes[vehicle.lane].length - vehicle.offset
    return is_held_up and vehicle.time_since_lane_change > _LEAST_TIME and left > _LEAST_LANE


@inlined
def choose_lane(net, fleet, vehicle, view, stop_distance, ahead):
    """Change lanes as the route does, past a delivery, to the kerb, past a cyclist, or out of a queue.

    Parameters
    ----------
    stop_distance
        Metres to its stop, `NEVER` for none.
    ahead
        Its leader, the gap to it (metres) and its speed; the speed the vehicle would like (m/s).
    """
    leader, gap, leading, wanted = ahead
    lane = vehicle.lane
    left, right = net.lanes[lane].left, net.lanes[lane].right
    if vehicle.route >= 0:
        # Not before its stop, where its route goes on in the lane beside after that: it would drive past it.
        if not vehicle.at_stop and vehicle.planned_count == 0 and stop_distance >= NEVER:
            beside = route_lane_beside(net, vehicle)
            if beside >= 0 and change_lane(net, vehicle, beside, view):
                advance_on_route(net, vehicle)
    elif is_behind_delivery(net, fleet, vehicle):
        for beside in (left, right):
            if _is_open(net, beside) and change_lane(net, vehicle, beside, view):
                break
    elif vehicle.is_bicycle:
        if _is_open(net, right) and vehicle.time_since_lane_change > _LEAST_TIME:
            change_lane(net, vehicle, right, view)
    elif leader >= 0 and wants_to_overtake_cyclist(net, vehicle, view, (leader, gap, leading), wanted):
        if _is_open(net, left):
            change_lane(net, vehicle, left, view)
    elif 0 <= leader < len(fleet) and wants_lane_change(net, vehicle, gap, leading, wanted):
        here = _vehicles_on(net, fleet, lane)
        for beside in (left, right):
            is_emptier = _is_open(net, beside) and _vehicles_on(net, fleet, beside) < here
            if is_emptier and change_lane(net, vehicle, beside, view):
                break


@compiled
def _somebody_comes_up(vehicle, lateral_offset, view):
    """Return whether somebody on the other lane would have to brake for a vehicle that changes onto it.

    That lane is `lateral_offset` metres to the right.
    """
    shapes, v = view.beyond.shapes, vehicle.index
    c, s = np.cos(shapes.yaw[v]), np.sin(shapes.yaw[v])
    for one in view.nearby:
        dx, dy = one.x - shapes.x[v], one.y - shapes.y[v]
        ahead, aside = dx * c + dy * s, dy * c - dx * s
        closing = shapes.vx[one.body] * c + shapes.vy[one.body] * s - vehicle.speed
        gap = -ahead - vehicle.length / 2 - one.half_length
        if ahead < 0.0 and abs(aside + lateral_offset) < _BESIDE and gap < closing * _BEHIND_HEADWAY:
            return True
    return False


@compiled
def _can_swing_out(path, swerving, offset, places, view):
    """Return whether a vehicle touches nobody at the first so many places of its lane change."""
    for i in range(places):
        there = offset + _SWING_OUT * i / _PLACES
        if touched_at(path, swerving, there, view.nearby, TOUCH, TOUCH, ANY_BODY) >= 0:
            return False
    return True


@compiled
def is_gap_accepted(net, vehicle, target, offset, lateral_offset, view):
    """Return whether nobody is in the way on lane `target`, from a gap behind to the end of the lane change.

    Parameters
    ----------
    offset, lateral_offset
        Where the vehicle is now, seen from that lane: metres along it and to the left of it.
    """
    is_let_in = vehicle.route >= 0
    path = lane_polyline(net, line_points(net, vehicle), target, np.empty(_LANE_POINTS, PATH_POINT))
    straight = changing_lane(view.outline, 0.0, 0.0)
    # A bus is let in: who is behind it waits for it, and it may wait for who is ahead of it.
    behind, ahead = (_REAR_GAP, _FRONT_GAP + view.outline.length) if not is_let_in else (_LET_IN_GAP, _CUT_IN_GAP)
    for i in range(9):
        there = offset - behind + (behind + ahead) * i / 8
        if there > net.lanes[target].length:
            continue
        if touched_at(path, straight, there, view.nearby, _VEHICLE_GAP, _PERSON_GAP) >= 0:
            return False
    swerving = changing_lane(view.outline, lateral_offset, -offset)
    # A car swings out only if it gets across now: halfway, behind who stands there, it would be in the way of both.
    return _can_swing_out(path, swerving, offset, 1 if is_let_in else _PLACES, view)


@compiled
def change_lane(net, vehicle, target, view):
    """Put a vehicle on a neighbour lane if there is a gap; True if it is there now.

    Its place on the ground changes gradually.
    """
    length = vehicle.length
    is_changing = vehicle.lateral_offset != 0.0 or vehicle.stopping != DRIVING
    if vehicle.granted_count > 0 or is_changing or vehicle.offset < earliest_lane_change(vehicle):
        return False
    lane = net.lanes[target]
    x, y, _, _ = point_on_path(view.path, vehicle.offset)
    points = line_points(net, vehicle)
    offset, lateral_offset = project_on_polyline(points, net.along, lane.first_point, lane.end_point, x, y)
    if offset < length + 2.0 or offset > lane.length - 1.0:
        return False
    if not is_gap_accepted(net, vehicle, target, offset, lateral_offset, view):
        return False
    if vehicle.route < 0 and _somebody_comes_up(vehicle, lateral_offset, view):
        return False
    vehicle.lane, vehicle.offset, vehicle.planned_count = target, offset, 0
    vehicle.lateral_offset, vehicle.lane_change_distance = lateral_offset, 0.0
    vehicle.lane_change_length = LANE_CHANGE + length
    vehicle.time_since_lane_change = 0.0
    vehicle.previous_lanes[:] = NONE
    return True
