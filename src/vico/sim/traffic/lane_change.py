"""Lane changes: cars leave a queue for a lane with fewer vehicles, buses follow their route to the lane beside."""

from __future__ import annotations

import numpy as np

from vico.io.compiled import compiled, inlined
from vico.sim.traffic.leader import ANY_BODY, TOUCH, touched_at
from vico.sim.traffic.letting_in import first_place_to_change, lane_to_change_to
from vico.sim.traffic.path import (
    LANE_CHANGE,
    PATH_POINT,
    changing_lane,
    lane_polyline,
    line_points,
    point_on_path,
    project_on_polyline,
)
from vico.sim.traffic.records import APPROACHING, DRIVING, NONE, PRESENT
from vico.sim.traffic.route import advance_on_route

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
def wants_lane_change(net, vehicle, gap, leading, wanted):  # type: ignore[no-untyped-def]
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
def _vehicles_on(net, fleet, lane):  # type: ignore[no-untyped-def]
    count = 0
    for vehicle in fleet:
        is_parked = vehicle.stopping > APPROACHING and not net.places[vehicle.place].delivery
        count += vehicle.lane == lane and vehicle.presence == PRESENT and not is_parked
    return count


@inlined
def change_to_emptier_lane(net, fleet, vehicle, view):  # type: ignore[no-untyped-def]
    """Move a car to a neighbour lane with fewer vehicles if there is a gap."""
    lane = vehicle.lane
    here = _vehicles_on(net, fleet, lane)
    for beside in (net.lanes[lane].left, net.lanes[lane].right):
        is_open = beside >= 0 and not net.lanes[beside].closed and not net.lanes[beside].shut
        is_better = is_open and _vehicles_on(net, fleet, beside) < here
        if is_better and change_lane(net, vehicle, beside, view):
            break


@compiled
def change_to_lane_beside(net, vehicle, view):  # type: ignore[no-untyped-def]
    """Move a car to a neighbour lane if there is a gap, however many drive there."""
    lane = vehicle.lane
    for beside in (net.lanes[lane].left, net.lanes[lane].right):
        is_open = beside >= 0 and not net.lanes[beside].closed and not net.lanes[beside].shut
        if is_open and change_lane(net, vehicle, beside, view):
            break


@compiled
def _is_open(net, lane):  # type: ignore[no-untyped-def]
    return lane >= 0 and not net.lanes[lane].closed and not net.lanes[lane].shut


@compiled
def keep_to_kerb(net, vehicle, view):  # type: ignore[no-untyped-def]
    """Move a cyclist to the neighbour lane towards the kerb if there is one and a gap."""
    beside = net.lanes[vehicle.lane].right
    if _is_open(net, beside) and vehicle.time_since_lane_change > _LEAST_TIME:
        change_lane(net, vehicle, beside, view)


@compiled
def wants_to_overtake_cyclist(net, vehicle, view, ahead, wanted):  # type: ignore[no-untyped-def]
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


@compiled
def overtake_cyclist(net, vehicle, view):  # type: ignore[no-untyped-def]
    """Move a car to the neighbour lane towards the middle of the street if there is one and a gap."""
    beside = net.lanes[vehicle.lane].left
    if _is_open(net, beside):
        change_lane(net, vehicle, beside, view)


@compiled
def change_as_route_does(net, vehicle, view):  # type: ignore[no-untyped-def]
    """Move a bus to the neighbour lane where its route goes on, if it does and there is a gap."""
    beside = lane_to_change_to(net, vehicle)
    if beside >= 0 and change_lane(net, vehicle, beside, view):
        advance_on_route(net, vehicle)


@compiled
def _somebody_comes_up(vehicle, lateral_offset, view):  # type: ignore[no-untyped-def]
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
def _can_swing_out(path, swerving, offset, places, view):  # type: ignore[no-untyped-def]
    """Return whether a vehicle touches nobody at the first so many places of its lane change."""
    for i in range(places):
        there = offset + _SWING_OUT * i / _PLACES
        if touched_at(path, swerving, there, view.nearby, TOUCH, TOUCH, ANY_BODY) >= 0:
            return False
    return True


@compiled
def is_gap_accepted(net, vehicle, target, offset, lateral_offset, view):  # type: ignore[no-untyped-def]
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
def change_lane(net, vehicle, target, view):  # type: ignore[no-untyped-def]
    """Put a vehicle on a neighbour lane if there is a gap; True if it is there now.

    Its place on the ground changes gradually.
    """
    length = vehicle.length
    is_changing = vehicle.lateral_offset != 0.0 or vehicle.stopping != DRIVING
    if vehicle.granted_count > 0 or is_changing or vehicle.offset < first_place_to_change(vehicle):
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
