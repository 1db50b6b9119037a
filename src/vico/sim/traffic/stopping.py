"""Cars that stop beside the road: at free parking spots along the kerb, and vans that make deliveries.

Who chooses a place slows down with its indicator on, drives or backs into it, stands there, and leaves when nobody
comes. Vans stand at the edge of their lane with both indicators on; who comes behind changes lanes.
"""

from __future__ import annotations

import numpy as np

from vico.io.compiled import compiled, inlined
from vico.sim.neighbours import search
from vico.sim.traffic.leader import TOUCH, VehicleView, bodies_around, nearby_bodies, touched_at
from vico.sim.traffic.lights import LEFT, RIGHT
from vico.sim.traffic.moving import move_vehicle
from vico.sim.traffic.path import path_polyline, vehicle_outline
from vico.sim.traffic.random_stream import next_random
from vico.sim.traffic.records import APPROACHING, BACKING_IN, DRIVING, DRIVING_IN, LEAVING, NONE, STANDING
from vico.sim.traffic.route import NEVER

#: m of lane that belong to a way into a car park, before that leaves it.
WAY_LEAD = 8.0
#: s that cars stand where they park.
STAY = (120.0, 600.0)
_PARKING_SHARE, _DELIVERY_SHARE = 0.25, 0.25  # of the cars (vans) that come onto a street with places
_DELIVERY = (60.0, 180.0)  # s that vans stand
_MANOEUVRE, _REVERSE = 3.0, 1.2  # m/s into a place, and backwards
_LATE = 1.5  # m/s^2: a place for which one had to brake harder is too near
_GIVES_UP_AFTER = 12.0  # s of standing after which one drives on that has not got to its place
_HOLDS_UP, _HELD_UP_WITHIN = 40.0, 60.0  # s that somebody stands behind a delivery, and m, after which it is over
_SIGNALS_FROM, _SIGNALS_FOR = 35.0, 2.0  # m before a place, s before one leaves it
_REAR_VIEW, _REAR_GAP, _REAR_TIME = 45.0, 4.0, 3.5  # m and s that who comes from behind has to be away
_PERSON_GAP, _VEHICLE_GAP = 0.3, 0.1  # m kept sideways
_SWING_OUT, _SEES_DELIVERY, _PATIENT = 10.5, 60.0, 3.0  # m behind a delivery, and s after a lane change
_APART = 20.0  # m between places that are taken at a time: nobody is in the way of who leaves the one behind
_STANDS = 0.1  # m/s
_TOO_FAR = 0.8  # m beyond the beginning of a way, at which the front axle has passed it
_SIDE = 1.0  # m: places nearer to the lane's middle are in the lane


@compiled
def _front_in_place(net, vehicle):  # type: ignore[no-untyped-def]
    return net.places[vehicle.place].middle + vehicle.length / 2


@compiled
def is_car_park_busy(net, fleet, vehicle, lot, k=NONE):  # type: ignore[no-untyped-def]
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
def _is_free(net, fleet, vehicle, k):  # type: ignore[no-untyped-def]
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
def _place_to_stop_at(net, fleet, vehicle):  # type: ignore[no-untyped-def]
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
def choose_place(net, fleet, vehicle):  # type: ignore[no-untyped-def]
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
def _drive_on(vehicle):  # type: ignore[no-untyped-def]
    vehicle.stopping, vehicle.place, vehicle.at_stop = DRIVING, NONE, False
    vehicle.time_since_lane_change, vehicle.way_offset = 0.0, -1.0


@compiled
def distance_to_place(vehicle):  # type: ignore[no-untyped-def]
    """Return the metres to where a car that comes to a place stops, `NEVER` for others: into car parks one turns."""
    stops = vehicle.stopping == APPROACHING and vehicle.way_offset < 0.0
    return max(vehicle.stop_offset - vehicle.offset, 0.0) if stops else NEVER


@compiled
def speed_into_place(vehicle, wanted):  # type: ignore[no-untyped-def]
    """Return the desired speed of a car that comes to a place it drives into, m/s: slow where it leaves its lane."""
    if vehicle.stopping != APPROACHING or (vehicle.lane_change_length >= 0.0 and vehicle.way_offset < 0.0):
        return wanted
    begin = vehicle.stop_offset
    if vehicle.way_offset < 0.0:
        begin += vehicle.lane_change_length - vehicle.wheelbase
    before = max(begin - vehicle.offset, 0.0)
    return min(wanted, np.sqrt(_MANOEUVRE * _MANOEUVRE + 2 * _LATE * before))


@compiled
def _turn_into_car_park(vehicle, beyond):  # type: ignore[no-untyped-def]
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
def come_to_place(net, vehicle):  # type: ignore[no-untyped-def]
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
        stand(vehicle, _DELIVERY if place.delivery else STAY)


@compiled
def _prepare_to_leave(net, vehicle):  # type: ignore[no-untyped-def]
    """Lay the way out of a place: who backs in follows it backwards."""
    place = net.places[vehicle.place]
    vehicle.lateral_offset, vehicle.lane_change_length = place.side, place.taper
    vehicle.lane_change_distance = vehicle.offset - _front_in_place(net, vehicle) + vehicle.overhang


@compiled
def stand(vehicle, stay):  # type: ignore[no-untyped-def]
    """Have a car stand where it parks, for a time between two, s."""
    vehicle.stopping, vehicle.at_stop = STANDING, True
    vehicle.stay_left = stay[0] + (stay[1] - stay[0]) * next_random(vehicle)
    vehicle.blocker = vehicle.gives_way_to = NONE
    vehicle.queued_junction = vehicle.queued_exit = vehicle.kept_out_from = NONE
    vehicle.junction_wait = vehicle.stopped_time = 0.0


@compiled
def _holds_up(fleet, vehicle):  # type: ignore[no-untyped-def]
    """Return whether somebody has stood behind a vehicle for too long."""
    for other in fleet:
        behind = vehicle.offset - other.offset
        if other.lane == vehicle.lane and 0.0 < behind < _HELD_UP_WITHIN and other.stopped_time > _HOLDS_UP:
            return True
    return False


@inlined
def is_behind_delivery(net, fleet, vehicle):  # type: ignore[no-untyped-def]
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
def _look(net, vehicle, reach, scratch, beyond):  # type: ignore[no-untyped-def]
    """Return what a vehicle beside the road sees within so many metres."""
    v, shapes, length = vehicle.index, beyond.shapes, vehicle.length
    path = path_polyline(net, vehicle, length + 3.0, vehicle.offset + reach, scratch[0])
    near = search(beyond.grid, shapes.x[v], shapes.y[v], reach + length, beyond.candidates)
    nearby = nearby_bodies(shapes, v, shapes.x[v], shapes.y[v], reach + length, near, scratch[1])
    return VehicleView(path, vehicle_outline(vehicle), nearby, beyond)


@compiled
def _nobody_comes(vehicle, vehicles, beyond):  # type: ignore[no-untyped-def]
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
def _can_leave(net, vehicle, vehicles, scratch, beyond):  # type: ignore[no-untyped-def]
    """Return whether nobody is or comes in the way of a car that leaves its place."""
    if abs(vehicle.lateral_offset) < _SIDE:
        return True  # it is in its lane: it drives on behind who is before it
    if not _nobody_comes(vehicle, vehicles, beyond):
        return False
    reach = net.places[vehicle.place].taper + vehicle.wheelbase
    view = _look(net, vehicle, reach + 6.0, scratch, beyond)
    for i in range(int(reach) + 1):
        if touched_at(view.path, view.outline, vehicle.offset + i, view.nearby, _VEHICLE_GAP, _PERSON_GAP) >= 0:
            return False
    return True


@compiled
def _back_in(net, vehicle, scratch, beyond, dt):  # type: ignore[no-untyped-def]
    """Move a car backwards into its place; it drives on if it does not get there."""
    shapes, v = beyond.shapes, vehicle.index
    left = vehicle.offset - _front_in_place(net, vehicle)
    move = -min(_REVERSE * dt, left)
    view = _look(net, vehicle, vehicle.length + 4.0, scratch, beyond)
    shapes.vx[v] = shapes.vy[v] = 0.0
    if touched_at(view.path, view.outline, vehicle.offset + move, view.nearby, TOUCH, _PERSON_GAP) < 0:
        move_vehicle(vehicle, shapes, view, move, dt)
        if left <= _REVERSE * dt:
            stand(vehicle, STAY)
        return
    vehicle.stay_left -= dt
    if vehicle.stay_left <= 0.0:
        _drive_on(vehicle)


@compiled
def stay_at_place(net, fleet, vehicle, scratch, beyond, dt):  # type: ignore[no-untyped-def]
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
