"""Cars that park in car parks: along a way of their own off the lanes, one moving car in a car park at a time.

Who comes to a place in a car park leaves its lane there and follows the way into it; it backs out of it into the aisle,
drives to where the way comes to the street or its sidewalk, and goes on when nobody comes.
"""

from __future__ import annotations

import numpy as np

from vico.io.compiled import compiled
from vico.sim.neighbours import search
from vico.sim.traffic.car_following import (
    idm_acceleration,
    leader_speed,
    look_ahead,
    mind_only_before,
    next_speed,
)
from vico.sim.traffic.leader import TOUCH, VehicleView, find_leader, nearby_bodies, touched_at
from vico.sim.traffic.lights import BRAKE, LEFT, RIGHT
from vico.sim.traffic.path import footprint, point_on_path, vehicle_outline
from vico.sim.traffic.records import BACKING_OUT, DRIVING, DRIVING_IN, DRIVING_OUT, LEAVING, NONE, PRESENT, STANDING
from vico.sim.traffic.route import NEVER
from vico.sim.traffic.stopping import STAY, is_car_park_busy, stand

_SPEED, _REVERSE = 2.8, 1.2  # m/s, and backwards
_LOOKS_BACK = 2.0  # s with the lamps on before one backs out
_REAR_AXLE = 0.3  # m along the way out at which the rear axle stands that has been backed out
_REACHED = 0.03  # m
_SETS_OUT, _REAR_GAP, _TIME = 3.0, 4.0, 1.5  # m before the street at which one looks; m and s beyond the time it takes
_PERSON_GAP, _BESIDE, _WALKS, _BEFORE = 0.3, 0.6, 0.3, 1.5  # m, m, m/s and m: people on their way across
_LOOKS_FOR, _PATIENCE = 9, 8.0  # m ahead, and s of standing after which only who is in the way counts
_NEAR_STREET, _LONGEST = 15.0, 60.0  # m of a way from its lane; s that standing farther in counts, at most


@compiled
def _view(vehicle, path, scratch, beyond):  # type: ignore[no-untyped-def]
    v, shapes = vehicle.index, beyond.shapes
    reach = look_ahead(vehicle) + vehicle.length + 6.0
    near = search(beyond.grid, shapes.x[v], shapes.y[v], reach, beyond.candidates)
    nearby = nearby_bodies(shapes, v, shapes.x[v], shapes.y[v], reach, near, scratch)
    return VehicleView(path, vehicle_outline(vehicle), nearby, beyond)


@compiled
def _distance_to_people(vehicle, view, begin, way):  # type: ignore[no-untyped-def]
    """Return the metres from `begin` along a way (-1: back along it) to where somebody walks across; else `NEVER`."""
    if vehicle.stopped_time > _PATIENCE:
        return NEVER
    shapes = view.beyond.shapes
    for ahead in range(_LOOKS_FOR):
        x, y, _, _ = point_on_path(view.path, begin + way * ahead)
        for one in view.nearby:
            vx, vy = shapes.vx[one.body], shapes.vy[one.body]
            if one.rounding == 0.0 or vx * vx + vy * vy < _WALKS * _WALKS:
                continue
            close = view.outline.half_width + one.rounding + _BESIDE
            for k in range(1, 6):
                dx, dy = one.x + vx * 0.5 * k - x, one.y + vy * 0.5 * k - y
                if dx * dx + dy * dy < close * close:
                    return max(ahead - _BEFORE, 0.0)
    return NEVER


@compiled
def _put(vehicle, shapes, view, move, dt):  # type: ignore[no-untyped-def]
    """Move a car along its way, metres, and put its body there."""
    v = vehicle.index
    x, y, c, s = footprint(view.path, view.outline, vehicle.way_offset + move)
    shapes.vx[v], shapes.vy[v] = (x - shapes.x[v]) / dt, (y - shapes.y[v]) / dt
    shapes.x[v], shapes.y[v], shapes.yaw[v] = x, y, np.arctan2(s, c)
    vehicle.way_offset += move


@compiled
def _drive(vehicle, path, goal, scratch, beyond, dt):  # type: ignore[no-untyped-def]
    """Drive on along a way, to `goal` (metres along it) at most."""
    shapes, s, before = beyond.shapes, vehicle.way_offset, vehicle.speed
    view = _view(vehicle, path, scratch[0], beyond)
    gap, leader = find_leader(view, s, look_ahead(vehicle), scratch[1])
    stop = min(max(goal - s, 0.0), _distance_to_people(vehicle, view, s, 1.0))
    gap, leader = mind_only_before(stop, gap, leader)
    rate = idm_acceleration(vehicle, _SPEED, gap, leader_speed(shapes, leader, view, s + gap))
    limit = min(max(_SPEED, before - vehicle.braking * dt), np.sqrt(2 * vehicle.braking * stop))
    move = next_speed(vehicle, rate, limit, gap, stop, dt) * dt
    if move > 0.0 and touched_at(path, view.outline, s + move, view.nearby, TOUCH, TOUCH) >= 0:
        move = 0.0
    vehicle.speed = move / dt
    if move > 0.0:
        _put(vehicle, shapes, view, move, dt)
    if vehicle.speed == 0.0 or before - vehicle.speed > 0.6 * dt:
        vehicle.lights |= BRAKE


@compiled
def _back_out(vehicle, path, end, scratch, beyond, dt):  # type: ignore[no-untyped-def]
    """Back along a way until the front is so many metres along it; stand for who comes in the way."""
    shapes, s = beyond.shapes, vehicle.way_offset
    view = _view(vehicle, path, scratch[0], beyond)
    move = -min(_REVERSE * dt, s - end)
    is_blocked = _distance_to_people(vehicle, view, s - vehicle.length, -1.0) < 2.0
    for farther in (0.0, 1.0):
        at = max(s + move - farther, end)
        is_blocked = is_blocked or touched_at(path, view.outline, at, view.nearby, TOUCH, _PERSON_GAP) >= 0
    if is_blocked:
        vehicle.speed = 0.0
        return
    vehicle.speed = -move / dt
    _put(vehicle, shapes, view, move, dt)


@compiled
def _is_way_free(vehicle, path, first, last, scratch, beyond):  # type: ignore[no-untyped-def]
    """Return whether nobody stands where a car comes from `first` to `last` metres along a way."""
    view = _view(vehicle, path, scratch[0], beyond)
    for k in range(int((last - first) / 0.5) + 1):
        if touched_at(path, view.outline, first + 0.5 * k, view.nearby, 0.1, _PERSON_GAP) >= 0:
            return False
    return True


@compiled
def _nobody_comes(net, fleet, vehicle, place):  # type: ignore[no-untyped-def]
    """Return whether nobody on the lane it comes to would have to brake for a car that leaves a car park."""
    takes = (place.out_joint - vehicle.way_offset + vehicle.length) / _SPEED + _TIME
    for other in fleet:
        if other.presence != PRESENT or other.index == vehicle.index or other.stopping > STANDING:
            continue
        ahead, lane = place.out_offset - other.offset, other.lane
        k = 0
        while lane != place.out_lane and k < other.planned_count:
            ahead += net.lanes[lane].length
            lane = other.planned_lanes[k]
            k += 1
        is_on_way = lane == place.out_lane and ahead > -vehicle.length - other.length
        if is_on_way and ahead < _REAR_GAP - 0.5 + other.speed * takes:
            return False
    return True


@compiled
def _out_of_place(net, fleet, vehicle, place, scratch, beyond, dt):  # type: ignore[no-untyped-def]
    """Have a car whose time is over leave when nobody else moves in the car park."""
    vehicle.speed = vehicle.stopped_time = 0.0
    beyond.shapes.vx[vehicle.index] = beyond.shapes.vy[vehicle.index] = 0.0
    vehicle.lights = 0
    vehicle.stay_left -= dt
    if vehicle.stopping == STANDING:
        if vehicle.stay_left <= 0.0:
            vehicle.stopping, vehicle.stay_left = LEAVING, 0.0
        return
    if net.lanes[place.out_lane].shut or is_car_park_busy(net, fleet, vehicle, place.lot):
        vehicle.stay_left = 0.0
        return
    vehicle.lights = BRAKE
    path = net.way_points[place.first_back : place.end_back]
    rest, end = place.back_rest + vehicle.length / 2, _REAR_AXLE + vehicle.wheelbase + vehicle.overhang
    if vehicle.stay_left < -_LOOKS_BACK and _is_way_free(vehicle, path, end, rest, scratch, beyond):
        vehicle.stopping, vehicle.way_offset, vehicle.at_stop = BACKING_OUT, rest, False
        vehicle.lane, vehicle.offset = place.out_lane, place.out_offset
        vehicle.previous_lanes[:] = NONE


@compiled
def _drive_out(net, fleet, vehicle, place, scratch, beyond, dt):  # type: ignore[no-untyped-def]
    """Drive from the aisle to the street, and on it when nobody comes."""
    path = net.way_points[place.first_out : place.end_out]
    vehicle.lights = LEFT if place.out_side > 0.0 else RIGHT
    left = place.hold - vehicle.way_offset
    if vehicle.stay_left <= 0.0 and left < _SETS_OUT:
        vehicle.stay_left -= dt
        if _nobody_comes(net, fleet, vehicle, place):
            vehicle.stay_left = 1.0
    goal = NEVER if vehicle.stay_left > 0.0 else place.hold
    _drive(vehicle, path, goal, scratch, beyond, dt)
    if left < 0.5 and vehicle.stay_left <= 0.0:
        vehicle.stopped_time = 0.0  # it waits for a gap
    rear = vehicle.way_offset - vehicle.overhang - vehicle.wheelbase
    if rear >= place.out_joint:
        vehicle.offset = place.out_offset + vehicle.way_offset - place.out_joint
        vehicle.stopping, vehicle.place, vehicle.way_offset = DRIVING, NONE, -1.0
        vehicle.time_since_lane_change = 0.0


@compiled
def stay_in_car_park(net, fleet, vehicle, scratch, beyond, dt):  # type: ignore[no-untyped-def]
    """Advance a car on its way into a car park, that stands there, or is on its way out of it."""
    place = net.places[vehicle.place]
    if vehicle.stopping == STANDING or vehicle.stopping == LEAVING:
        _out_of_place(net, fleet, vehicle, place, scratch, beyond, dt)
        return
    beyond.shapes.vx[vehicle.index] = beyond.shapes.vy[vehicle.index] = 0.0
    is_in_street = False
    if vehicle.stopping == DRIVING_IN:
        is_in_street = vehicle.way_offset < _NEAR_STREET
        vehicle.lights = (LEFT if place.side > 0.0 else RIGHT) if is_in_street else 0
        rest = place.in_rest + vehicle.length / 2
        _drive(vehicle, net.way_points[place.first_in : place.end_in], rest, scratch, beyond, dt)
        if rest - vehicle.way_offset < _REACHED:
            stand(vehicle, STAY)
    elif vehicle.stopping == BACKING_OUT:
        vehicle.lights = 0
        end = _REAR_AXLE + vehicle.wheelbase + vehicle.overhang
        _back_out(vehicle, net.way_points[place.first_back : place.end_back], end, scratch, beyond, dt)
        if vehicle.way_offset - end < _REACHED:
            vehicle.stopping, vehicle.stay_left = DRIVING_OUT, 0.0
    else:
        is_in_street = vehicle.way_offset > place.hold + 1.0
        _drive_out(net, fleet, vehicle, place, scratch, beyond, dt)
    vehicle.stopped_time = vehicle.stopped_time + dt if vehicle.speed < 0.05 else 0.0
    if not is_in_street:
        vehicle.stopped_time = min(vehicle.stopped_time, _LONGEST)  # it is in nobody's way
