"""Cars that park at the kerb and in car parks, and vans that make deliveries.

A car that chooses a place slows down with its indicator on, drives or backs into it, stands there, and leaves when
no vehicle comes. Vans stand at the edge of their lane with both indicators on; vehicles behind them change lanes.

In car parks cars follow a way of their own off the lanes, one moving car in a car park at a time. A car backs out of
its place into the aisle, drives to where the way comes to the street or its sidewalk, and goes on when nobody comes.
"""

from __future__ import annotations

import numpy as np

from vico.io.compiled import compiled, inlined
from vico.sim.bodies.footprints import search
from vico.sim.traffic.car_following import (
    TOUCH,
    VehicleView,
    bodies_around,
    clip_leader_before_stop,
    find_leader,
    idm_acceleration,
    leader_speed,
    look_ahead,
    nearby_bodies,
    next_speed,
    touched_at,
)
from vico.sim.traffic.lights import BRAKE, LEFT, RIGHT
from vico.sim.traffic.path import footprint, move_vehicle, path_polyline, point_on_path, vehicle_outline
from vico.sim.traffic.route import NEVER
from vico.sim.traffic.state import (
    APPROACHING,
    BACKING_IN,
    BACKING_OUT,
    DRIVING,
    DRIVING_IN,
    DRIVING_OUT,
    LEAVING,
    NONE,
    PRESENT,
    STANDING,
    next_random,
)

#: m of lane that belong to a way into a car park, before that leaves it.
WAY_LEAD = 8.0
#: s that cars stand where they park.
PARKING_TIME = (120.0, 600.0)
_PARKING_SHARE, _DELIVERY_SHARE = 0.25, 0.25  # of the cars (vans) that come onto a street with places
_DELIVERY = (60.0, 180.0)  # s that vans stand
_MANOEUVRE, _REVERSE = 3.0, 1.2  # m/s into a place, and backwards
_LATE = 1.5  # m/s^2: a place for which one had to brake harder is too near
_GIVES_UP_AFTER = 12.0  # s of standing after which one drives on that has not got to its place
_HOLDS_UP, _HELD_UP_WITHIN = 40.0, 60.0  # s that somebody stands behind a delivery, and m, after which it is over
_SIGNALS_FROM, _SIGNALS_FOR = 35.0, 2.0  # m before a place, s before one leaves it
_REAR_VIEW = 45.0  # m behind it that a car looks before it leaves a place
_REAR_GAP = 4.0  # m that who comes from behind has to be away ...
_REAR_TIME = 3.5  # ... and s
_PERSON_GAP, _VEHICLE_GAP = 0.3, 0.1  # m kept sideways
_SWING_OUT = 10.5  # m behind a delivery that a car needs to change lanes
_SEES_DELIVERY = 60.0  # m behind a delivery from which on it does
_PATIENT = 3.0  # s after a lane change in which it makes no other one
_APART = 20.0  # m between places that are taken at a time: nobody is in the way of who leaves the one behind
_STANDS = 0.1  # m/s
_TOO_FAR = 0.8  # m beyond the beginning of a way, at which the front axle has passed it
_SIDE = 1.0  # m: places nearer to the lane's middle are in the lane


@compiled
def _front_in_place(net, vehicle):
    return net.places[vehicle.place].middle + vehicle.length / 2


@compiled
def is_car_park_busy(net, fleet, vehicle, lot, k=NONE):
    """Return whether another car is on its way in a car park, into it or out of it; or has place k.

    Nor does one come in (k given) while one waits to get out.
    """
    for other in fleet:
        if other.index == vehicle.index or other.place == NONE or net.places[other.place].lot != lot:
            continue
        waits = other.stopping == LEAVING and k == NONE
        if other.place == k or (other.stopping != STANDING and not waits):
            return True
    return False


@compiled
def _is_free(net, fleet, vehicle, k):
    """Return whether nobody has place k or one near it, its street has no delivery, and nobody is close behind."""
    place = net.places[k]
    if place.lot != NONE:
        return not is_car_park_busy(net, fleet, vehicle, place.lot, k)
    edge = net.lanes[place.lane].edge
    for other in fleet:
        if other.index == vehicle.index or (other.place != NONE and net.places[other.place].lot != NONE):
            continue
        if other.place != NONE and net.lanes[other.lane].edge == edge:
            is_near = other.lane == place.lane and abs(net.places[other.place].middle - place.middle) < _APART
            if is_near or place.delivery or net.places[other.place].delivery:
                return False
        is_behind = other.lane == vehicle.previous_lanes[0] or (
            other.lane == vehicle.lane and other.offset < vehicle.offset
        )
        if is_behind and other.stopping == DRIVING and (place.reverse or place.delivery):
            return False
    return True


@compiled
def _place_to_stop_at(net, fleet, vehicle):
    """Return the place beside its lane where a car that has just come onto it is going to stop, `NONE` for none."""
    lane = net.lanes[vehicle.lane]
    count = lane.end_place - lane.first_place
    is_busy = (
        vehicle.route >= 0
        or vehicle.is_bicycle
        or vehicle.goal != NONE
        or vehicle.lateral_offset != 0.0
        or vehicle.granted_count > 0
    )
    if count == 0 or is_busy or lane.shut:
        return NONE
    share = _DELIVERY_SHARE if vehicle.delivers else _PARKING_SHARE
    draw = next_random(vehicle)
    if draw >= share:
        return NONE
    first = min(int(draw / share * count), count - 1)
    least = vehicle.offset + vehicle.speed * vehicle.speed / (2 * _LATE) + 4.0
    for i in range(count):
        k = lane.first_place + (first + i) % count
        place = net.places[k]
        fits = place.delivery == vehicle.delivers and vehicle.length <= place.longest
        ahead = place.middle - vehicle.length - (0.0 if place.reverse else place.taper)
        if fits and ahead > least and _is_free(net, fleet, vehicle, k):
            return k
    return NONE


@inlined
def choose_place(net, fleet, vehicle):
    """Have a car that has just come onto a lane stop at a place beside it, or not."""
    k = _place_to_stop_at(net, fleet, vehicle)
    if k == NONE:
        return
    place = net.places[k]
    vehicle.place, vehicle.stopping = k, APPROACHING
    vehicle.stop_offset = _front_in_place(net, vehicle)
    if place.lot != NONE:
        vehicle.stop_offset, vehicle.way_offset = place.middle, 0.0
    elif place.reverse:
        vehicle.stop_offset += place.taper + vehicle.wheelbase
    else:
        # It leaves the lane where its rear axle ends up.
        vehicle.lateral_offset, vehicle.lane_change_length = place.side, -place.taper
        rear = vehicle.stop_offset - vehicle.overhang - vehicle.wheelbase
        vehicle.lane_change_distance = vehicle.offset - rear


@compiled
def _drive_on(vehicle):
    vehicle.stopping, vehicle.place, vehicle.at_stop = DRIVING, NONE, False
    vehicle.time_since_lane_change, vehicle.way_offset = 0.0, -1.0


@compiled
def distance_to_place(vehicle):
    """Return the metres to where a car that comes to a place stops, `NEVER` for others: into car parks one turns."""
    stops = vehicle.stopping == APPROACHING and vehicle.way_offset < 0.0
    return max(vehicle.stop_offset - vehicle.offset, 0.0) if stops else NEVER


@compiled
def speed_into_place(vehicle, wanted):
    """Return the desired speed of a car that comes to a place it drives into, m/s: slow where it leaves its lane."""
    if vehicle.stopping != APPROACHING or (vehicle.lane_change_length >= 0.0 and vehicle.way_offset < 0.0):
        return wanted
    begin = vehicle.stop_offset
    if vehicle.way_offset < 0.0:
        begin += vehicle.lane_change_length - vehicle.wheelbase
    before = max(begin - vehicle.offset, 0.0)
    return min(wanted, np.sqrt(_MANOEUVRE * _MANOEUVRE + 2 * _LATE * before))


@compiled
def _turn_into_car_park(vehicle, beyond):
    """Leave the lane, `beyond` metres after the way into a car park does; drive on if that is too far, or not yet."""
    if beyond < 0.0 or beyond > _TOO_FAR:
        _drive_on(vehicle)
        return
    vehicle.stopping, vehicle.way_offset = DRIVING_IN, WAY_LEAD + beyond
    vehicle.planned_count = vehicle.granted_count = 0
    vehicle.blocker = vehicle.gives_way_to = NONE
    vehicle.queued_junction = vehicle.queued_exit = vehicle.kept_out_from = NONE
    vehicle.junction_wait = 0.0


@compiled
def come_to_place(net, vehicle):
    """Note that a car has come to its place, or does not get there."""
    if vehicle.stopping != APPROACHING:
        return
    place = net.places[vehicle.place]
    left = vehicle.stop_offset - vehicle.offset
    if left < _SIGNALS_FROM:
        vehicle.lights |= LEFT if place.side > 0.0 else RIGHT
    is_there = left < 0.5 and vehicle.speed < _STANDS
    if place.lot != NONE:
        if left <= 0.0 or vehicle.stopped_time > _GIVES_UP_AFTER:
            _turn_into_car_park(vehicle, -left)
    elif not is_there:
        in_lane = place.reverse or vehicle.offset < vehicle.stop_offset - vehicle.wheelbase - place.taper
        if in_lane and vehicle.stopped_time > _GIVES_UP_AFTER:
            vehicle.lateral_offset = 0.0
            _drive_on(vehicle)
    elif place.reverse:
        vehicle.stopping, vehicle.stay_left = BACKING_IN, _GIVES_UP_AFTER
        _prepare_to_leave(net, vehicle)
    else:
        stand_at_place(vehicle, _DELIVERY if place.delivery else PARKING_TIME)


@compiled
def _prepare_to_leave(net, vehicle):
    """Lay the way out of a place: who backs in follows it backwards."""
    place = net.places[vehicle.place]
    vehicle.lateral_offset, vehicle.lane_change_length = place.side, place.taper
    vehicle.lane_change_distance = vehicle.offset - _front_in_place(net, vehicle) + vehicle.overhang


@compiled
def stand_at_place(vehicle, stay):
    """Have a car stand where it parks, for a time between two, s."""
    vehicle.stopping, vehicle.at_stop = STANDING, True
    vehicle.stay_left = stay[0] + (stay[1] - stay[0]) * next_random(vehicle)
    vehicle.blocker = vehicle.gives_way_to = NONE
    vehicle.queued_junction = vehicle.queued_exit = vehicle.kept_out_from = NONE
    vehicle.junction_wait = vehicle.stopped_time = 0.0


@compiled
def _holds_up(fleet, vehicle):
    """Return whether somebody has stood behind a vehicle for too long."""
    for other in fleet:
        behind = vehicle.offset - other.offset
        if other.lane == vehicle.lane and 0.0 < behind < _HELD_UP_WITHIN and other.stopped_time > _HOLDS_UP:
            return True
    return False


@inlined
def is_behind_delivery(net, fleet, vehicle):
    """Return whether a car has room to swing out behind a van that makes a delivery ahead on its lane."""
    lane = net.lanes[vehicle.lane]
    if lane.first_place == lane.end_place or vehicle.stopping != DRIVING or vehicle.time_since_lane_change < _PATIENT:
        return False
    found = False
    for other in fleet:
        delivers = other.lane == vehicle.lane and other.place != NONE and net.places[other.place].delivery
        ahead = other.offset - other.length - vehicle.offset
        found = found or (delivers and _SWING_OUT < ahead < _SEES_DELIVERY)
    return found


@compiled
def _view_from_place(net, vehicle, reach, scratch, beyond):
    """Return what a vehicle beside the road sees within so many metres."""
    v, shapes, length = vehicle.index, beyond.shapes, vehicle.length
    path = path_polyline(net, vehicle, length + 3.0, vehicle.offset + reach, scratch[0])
    near = search(beyond.grid, shapes.x[v], shapes.y[v], reach + length, beyond.candidates)
    nearby = nearby_bodies(shapes, v, shapes.x[v], shapes.y[v], reach + length, near, scratch[1])
    return VehicleView(path, vehicle_outline(vehicle), nearby, beyond)


@compiled
def _no_vehicle_comes(vehicle, vehicles, beyond):
    """Return whether no vehicle comes from behind that would have to brake for one that leaves its place."""
    v, shapes = vehicle.index, beyond.shapes
    c, s = np.cos(shapes.yaw[v]), np.sin(shapes.yaw[v])
    for one in bodies_around(v, shapes.x[v], shapes.y[v], _REAR_VIEW, beyond):
        if one.body >= vehicles or one.cos * c + one.sin * s < 0.7:
            continue
        dx, dy = one.x - shapes.x[v], one.y - shapes.y[v]
        behind, beside = -(dx * c + dy * s), abs(dy * c - dx * s)
        speed = np.hypot(shapes.vx[one.body], shapes.vy[one.body])
        gap = behind - vehicle.length / 2 - one.half_length
        is_coming = behind > 0.0 and speed > 0.5 and beside < abs(vehicle.lateral_offset) + 2.0
        if is_coming and gap < _REAR_GAP + speed * _REAR_TIME:
            return False
    return True


@compiled
def _can_leave(net, vehicle, vehicles, scratch, beyond):
    """Return whether nobody is or comes in the way of a car that leaves its place."""
    if abs(vehicle.lateral_offset) < _SIDE:
        return True  # it is in its lane: it drives on behind who is before it
    if not _no_vehicle_comes(vehicle, vehicles, beyond):
        return False
    reach = net.places[vehicle.place].taper + vehicle.wheelbase
    view = _view_from_place(net, vehicle, reach + 6.0, scratch, beyond)
    for i in range(int(reach) + 1):
        if touched_at(view.path, view.outline, vehicle.offset + i, view.nearby, _VEHICLE_GAP, _PERSON_GAP) >= 0:
            return False
    return True


@compiled
def _back_in(net, vehicle, scratch, beyond, dt):
    """Move a car backwards into its place; it drives on if it does not get there."""
    shapes, v = beyond.shapes, vehicle.index
    left = vehicle.offset - _front_in_place(net, vehicle)
    move = -min(_REVERSE * dt, left)
    view = _view_from_place(net, vehicle, vehicle.length + 4.0, scratch, beyond)
    shapes.vx[v] = shapes.vy[v] = 0.0
    if touched_at(view.path, view.outline, vehicle.offset + move, view.nearby, TOUCH, _PERSON_GAP) < 0:
        move_vehicle(vehicle, shapes, view, move, dt)
        if left <= _REVERSE * dt:
            stand_at_place(vehicle, PARKING_TIME)
        return
    vehicle.stay_left -= dt
    if vehicle.stay_left <= 0.0:
        _drive_on(vehicle)


@compiled
def stay_at_place(net, fleet, vehicle, scratch, beyond, dt):
    """Advance a car that backs into a place, stands there, or waits for a gap to leave it."""
    v, shapes, place = vehicle.index, beyond.shapes, net.places[vehicle.place]
    vehicle.speed = vehicle.stopped_time = 0.0
    inwards, outwards = (LEFT, RIGHT) if place.side > 0.0 else (RIGHT, LEFT)
    if vehicle.stopping == BACKING_IN:
        vehicle.lights = inwards
        _back_in(net, vehicle, scratch, beyond, dt)
        return
    shapes.vx[v] = shapes.vy[v] = 0.0
    vehicle.stay_left -= dt
    if vehicle.stopping == STANDING:
        vehicle.lights = LEFT | RIGHT if place.delivery else 0
        is_over = vehicle.stay_left <= 0.0 or net.lanes[vehicle.lane].shut
        if is_over or (place.delivery and _holds_up(fleet, vehicle)):
            vehicle.stopping, vehicle.stay_left = LEAVING, 0.0
            _prepare_to_leave(net, vehicle)
        return
    vehicle.lights = outwards
    if vehicle.stay_left < -_SIGNALS_FOR and _can_leave(net, vehicle, len(fleet), scratch, beyond):
        _drive_on(vehicle)


_CAR_PARK_SPEED, _CAR_PARK_REVERSE = 2.8, 1.2  # m/s, and backwards
_LOOKS_BACK = 2.0  # s with the lamps on before one backs out
_REAR_AXLE = 0.3  # m along the way out at which the rear axle stands that has been backed out
_REACHED = 0.03  # m
_SETS_OUT = 3.0  # m before the street at which one looks whether somebody comes
_STREET_REAR_GAP = 4.0  # m that who comes has to be away ...
_TIME = 1.5  # ... and s, beyond the time that it takes to drive out
_CAR_PARK_PERSON_GAP = 0.3  # m kept from people
_BESIDE = 0.6  # m beside it where people on their way across count
_WALKS = 0.3  # m/s from which on somebody walks
_BEFORE = 1.5  # m before where they cross at which a car waits
_LOOKS_FOR, _CAR_PARK_PATIENCE = 9, 8.0  # m ahead, and s of standing after which only who is in the way counts
_NEAR_STREET, _LONGEST = 15.0, 60.0  # m of a way from its lane; s that standing farther in counts, at most


@compiled
def _view(vehicle, path, scratch, beyond):
    v, shapes = vehicle.index, beyond.shapes
    reach = look_ahead(vehicle) + vehicle.length + 6.0
    near = search(beyond.grid, shapes.x[v], shapes.y[v], reach, beyond.candidates)
    nearby = nearby_bodies(shapes, v, shapes.x[v], shapes.y[v], reach, near, scratch)
    return VehicleView(path, vehicle_outline(vehicle), nearby, beyond)


@compiled
def _distance_to_people(vehicle, view, begin, way):
    """Return the metres from `begin` along a way (-1: back along it) to where somebody walks across; else `NEVER`."""
    if vehicle.stopped_time > _CAR_PARK_PATIENCE:
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
def _put(vehicle, shapes, view, move, dt):
    """Move a car along its way, metres, and put its body there."""
    v = vehicle.index
    x, y, c, s = footprint(view.path, view.outline, vehicle.way_offset + move)
    shapes.vx[v], shapes.vy[v] = (x - shapes.x[v]) / dt, (y - shapes.y[v]) / dt
    shapes.x[v], shapes.y[v], shapes.yaw[v] = x, y, np.arctan2(s, c)
    vehicle.way_offset += move


@compiled
def _drive(vehicle, path, goal, scratch, beyond, dt):
    """Drive on along a way, to `goal` (metres along it) at most."""
    shapes, s, before = beyond.shapes, vehicle.way_offset, vehicle.speed
    view = _view(vehicle, path, scratch[0], beyond)
    gap, leader = find_leader(view, s, look_ahead(vehicle), scratch[1])
    stop = min(max(goal - s, 0.0), _distance_to_people(vehicle, view, s, 1.0))
    gap, leader = clip_leader_before_stop(stop, gap, leader)
    rate = idm_acceleration(vehicle, _CAR_PARK_SPEED, gap, leader_speed(shapes, leader, view, s + gap))
    limit = min(max(_CAR_PARK_SPEED, before - vehicle.braking * dt), np.sqrt(2 * vehicle.braking * stop))
    move = next_speed(vehicle, rate, limit, gap, stop, dt) * dt
    if move > 0.0 and touched_at(path, view.outline, s + move, view.nearby, TOUCH, TOUCH) >= 0:
        move = 0.0
    vehicle.speed = move / dt
    if move > 0.0:
        _put(vehicle, shapes, view, move, dt)
    if vehicle.speed == 0.0 or before - vehicle.speed > 0.6 * dt:
        vehicle.lights |= BRAKE


@compiled
def _back_out(vehicle, path, end, scratch, beyond, dt):
    """Back along a way until the front is so many metres along it; stand for who comes in the way."""
    shapes, s = beyond.shapes, vehicle.way_offset
    view = _view(vehicle, path, scratch[0], beyond)
    move = -min(_CAR_PARK_REVERSE * dt, s - end)
    is_blocked = _distance_to_people(vehicle, view, s - vehicle.length, -1.0) < 2.0
    for farther in (0.0, 1.0):
        at = max(s + move - farther, end)
        is_blocked = is_blocked or touched_at(path, view.outline, at, view.nearby, TOUCH, _CAR_PARK_PERSON_GAP) >= 0
    if is_blocked:
        vehicle.speed = 0.0
        return
    vehicle.speed = -move / dt
    _put(vehicle, shapes, view, move, dt)


@compiled
def _is_way_free(vehicle, path, first, last, scratch, beyond):
    """Return whether nobody stands where a car comes from `first` to `last` metres along a way."""
    view = _view(vehicle, path, scratch[0], beyond)
    for k in range(int((last - first) / 0.5) + 1):
        if touched_at(path, view.outline, first + 0.5 * k, view.nearby, 0.1, _CAR_PARK_PERSON_GAP) >= 0:
            return False
    return True


@compiled
def _street_is_clear(net, fleet, vehicle, place):
    """Return whether nobody on the lane it comes to would have to brake for a car that leaves a car park."""
    takes = (place.out_joint - vehicle.way_offset + vehicle.length) / _CAR_PARK_SPEED + _TIME
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
        if is_on_way and ahead < _STREET_REAR_GAP - 0.5 + other.speed * takes:
            return False
    return True


@compiled
def _out_of_place(net, fleet, vehicle, place, scratch, beyond, dt):
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
def _drive_out(net, fleet, vehicle, place, scratch, beyond, dt):
    """Drive from the aisle to the street, and on it when nobody comes."""
    path = net.way_points[place.first_out : place.end_out]
    vehicle.lights = LEFT if place.out_side > 0.0 else RIGHT
    left = place.hold - vehicle.way_offset
    if vehicle.stay_left <= 0.0 and left < _SETS_OUT:
        vehicle.stay_left -= dt
        if _street_is_clear(net, fleet, vehicle, place):
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
def stay_in_car_park(net, fleet, vehicle, scratch, beyond, dt):
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
            stand_at_place(vehicle, PARKING_TIME)
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
