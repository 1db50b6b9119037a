"""Motion of vehicles, one step of all of them; the rules are in the modules named after them.

The leader is whatever body a vehicle's own swept outline meets first: vehicles, pedestrians, avatars and robots alike.
No move is made that would touch another body, so vehicles never overlap whatever the model says.
"""

from __future__ import annotations

import numpy as np

from vico.io.compiled import compiled, inlined
from vico.sim.bodies.footprints import Rectangle, search
from vico.sim.traffic.car_following import (
    CLOSING_UP,
    NEARBY_BODY,
    TOUCH,
    Surroundings,
    VehicleView,
    braking_distance,
    clip_leader_before_stop,
    find_leader,
    idm_acceleration,
    leader_speed,
    look_ahead,
    nearby_bodies,
    next_speed,
    touched_at,
    touches,
)
from vico.sim.traffic.jams import leaves_room_for, vehicles_backing_up
from vico.sim.traffic.junctions import (
    BEYOND_TRACKS,
    asks_with_track,
    distance_to_track,
    holds_junction,
    is_hesitating,
    next_junction_request,
    note_claims,
    release_all_junctions,
    release_junctions,
    request_junctions,
    track_ahead,
)
from vico.sim.traffic.lane_change import choose_lane, distance_to_let_in, places_to_let_in, room_to_change
from vico.sim.traffic.lights import shown_lights
from vico.sim.traffic.parking import (
    choose_place,
    come_to_place,
    distance_to_place,
    speed_into_place,
    stay_at_place,
    stay_in_car_park,
)
from vico.sim.traffic.path import (
    PATH_POINT,
    PATH_POINTS,
    changing_lane,
    footprint,
    lane_polyline,
    line_points,
    move_vehicle,
    path_polyline,
    vehicle_outline,
)
from vico.sim.traffic.route import (
    NEVER,
    advance_lane,
    can_step_back,
    is_lane_of_stop,
    plan_lanes,
    step_back_lane,
)
from vico.sim.traffic.signals import is_stopped_by_signal, loses_its_green
from vico.sim.traffic.state import APPROACHING, AWAY, DRIVING, NONE, PRESENT, next_random

STANDING = 0.1  # slower is standing, m/s ...
_STARTED = 0.95  # ... where a vehicle gains so much in a step: slower than this share of what it can gain

_REVERSE = 0.6  # m/s
_BLOCKER_GAP = 3.0  # m within which a leader is what a standing vehicle stands before
_CREEP = 1.0  # a vehicle that is refused a junction waits for it below this speed, m/s
_OTHER_WAY_AFTER = 15.0  # s of waiting for a junction after which a car looks for another way, every 50 steps
_KEEPS_OUT_FOR = 60.0  # s of waiting for which others stay back on the lane whose vehicles are in its way
_BEFORE_JUNCTION = 1.0  # m before a lane's end at which a bus taken out of a jam goes on
_COMING_BACK = 8.0  # m before and behind a bus that are free where it comes back
_BEFORE_LANE_END = 1.0  # m kept before a path's end
_BEYOND_JUNCTION = 60.0  # m seen beyond a junction that is asked for


@compiled
def advance_vehicles(net, fleet, junctions, shapes, grid, street_load, dt):
    """Advance all vehicles by `dt` seconds, one after the other, each seeing where the ones before it went.

    Parameters
    ----------
    net, fleet, junctions, shapes
        See `vico.sim.traffic.state`; vehicle v is body v of `shapes`.
    grid
        Of the bodies, where they were at the start of the step.
    street_load
        Vehicles on each street, shape ``(streets,)``.
    """
    note_claims(net, fleet, junctions)
    backs_up = vehicles_backing_up(net, fleet, shapes, dt)
    places = places_to_let_in(net, fleet, shapes)
    buffers = np.empty(len(shapes.x), NEARBY_BODY), np.empty(len(shapes.x), NEARBY_BODY)
    beyond = Surroundings(shapes, grid, np.empty(len(shapes.x), np.int64), np.empty(len(shapes.x), NEARBY_BODY))
    path_buffer = np.empty(PATH_POINTS, PATH_POINT)
    for v in range(len(fleet)):
        vehicle = fleet[v]
        if vehicle.presence != PRESENT:
            continue
        if vehicle.stopping > APPROACHING:
            if net.places[vehicle.place].lot != NONE:
                stay_in_car_park(net, fleet, vehicle, buffers, beyond, dt)
            else:
                stay_at_place(net, fleet, vehicle, (path_buffer, buffers[0]), beyond, dt)
            continue
        lane, speed, is_bus = vehicle.lane, vehicle.speed, vehicle.route >= 0
        look = look_ahead(vehicle)
        path_ends = plan_lanes(net, vehicle, street_load, look + vehicle.length + 12.0)
        track = track_ahead(net, vehicle, look)
        if track.distance < NEVER:
            look = max(look, track.beyond + BEYOND_TRACKS)  # is there room behind the tracks?
        if is_hesitating(net, vehicle) or loses_its_green(net, vehicle):
            vehicle.granted_count = 0
            release_junctions(net, junctions, vehicle)

        stop_distance, let_in_distance = distance_to_stop(vehicle), distance_to_let_in(vehicle, places)
        asks_from = asks_with_track(track, braking_distance(vehicle))
        request = next_junction_request(net, vehicle, stop_distance, asks_from, path_ends)
        view = _look_around(net, vehicle, look, request, (path_buffer, buffers[0]), beyond)
        gap, leader = find_leader(view, vehicle.offset, look, buffers[1])
        # Who is behind another vehicle does not ask: it would hold the junction that the other one needs.
        is_behind = (0 <= leader < len(fleet) and gap < request.distance) or let_in_distance < request.distance
        # Nor does who makes room for another one: it stands, and who holds a junction does not back up.
        waits_for_tram = track.called and track.distance < request.distance
        is_behind = is_behind or vehicle.gives_way_to != NONE or waits_for_tram
        vehicle.queued_junction = vehicle.queued_exit = NONE
        if not _keeps_others_out(vehicle, junctions):
            vehicle.kept_out_from = NONE
        at_signal = request.planned_index >= 0 and is_stopped_by_signal(net, vehicle, request.planned_index)
        is_refused = (
            request.planned_index >= 0
            and not is_behind
            and not at_signal
            and not request_junctions(net, fleet, junctions, vehicle, request, view)
        )
        # At red it keeps what it has waited: its green was too short for it, and it would else begin anew with each. So
        # does who makes room for another one.
        keeps_wait = is_refused or at_signal or vehicle.gives_way_to != NONE
        if vehicle.speed >= _CREEP or not keeps_wait:
            vehicle.junction_wait = 0.0
        elif is_refused:
            vehicle.junction_wait += dt

        # The speed that it drives at on an empty lane.
        wanted = min(net.lanes[vehicle.lane].speed * vehicle.speed_factor, vehicle.target_speed)
        wanted = speed_into_place(vehicle, wanted)
        stop, limit = stop_and_speed_limit(net, vehicle, look, stop_distance, let_in_distance, wanted)
        gap, leader = clip_leader_before_stop(stop, gap, leader)
        leading = leader_speed(shapes, leader, view, vehicle.offset + gap)
        to_track = distance_to_track(track, vehicle, stop_distance, gap, leading)
        stop, limit = min(stop, to_track), min(limit, np.sqrt(2 * vehicle.braking * to_track))
        # Who is still in a junction closes up, so that it gets out of it.
        behind = gap + CLOSING_UP if holds_junction(vehicle) else gap
        rate = idm_acceleration(vehicle, wanted, behind, leading)
        move = next_speed(vehicle, rate, limit, gap, stop, dt) * dt
        if backs_up[v] or vehicle.gives_way_to != NONE or leaves_room_for(fleet, v, gap, leader):
            move = 0.0  # it would be in the way again
        move, gap, leader = _move_without_contact(net, vehicle, view, move, gap, leader)
        vehicle.speed = move / dt
        if backs_up[v] and move == 0.0:
            move = _move_back(net, vehicle, view, dt)
        if move != 0.0:
            move_vehicle(vehicle, shapes, view, move, dt)
            advance_lane(net, vehicle)
            if vehicle.offset < 0.0:
                step_back_lane(net, vehicle)
        else:
            shapes.vx[v] = shapes.vy[v] = 0.0

        # On snow and ice one that has just set off is so slow that it would be taken for one that does not get going.
        is_standing = vehicle.speed < min(STANDING, _STARTED * vehicle.acceleration * dt)
        vehicle.blocker = leader if gap < _BLOCKER_GAP and is_standing else NONE
        release_junctions(net, junctions, vehicle)
        vehicle.lights = shown_lights(net, vehicle, speed, dt)
        vehicle.time_since_lane_change += dt
        vehicle.stopped_time = vehicle.stopped_time + dt if is_standing else 0.0
        come_to_place(net, vehicle)
        if is_bus:
            vehicle.at_stop = vehicle.at_stop or (stop_distance < 0.5 and is_standing)
            if vehicle.at_stop:
                vehicle.stopped_time = 0.0
        elif is_refused and _gives_up_waiting(vehicle, dt):
            vehicle.planned_count = vehicle.granted_count

        # Only on the lane the path was laid for: who has just reached another one can change a step later.
        if vehicle.lane != lane:
            choose_place(net, fleet, vehicle)
            continue
        choose_lane(net, fleet, vehicle, view, stop_distance, (leader, gap, leading, wanted))


@compiled
def distance_to_stop(vehicle):
    """Return the metres to a bus's stop if that is on its lane, or to a car's place; `NEVER` otherwise."""
    is_here = vehicle.stop_route_index >= 0 and vehicle.route_index == vehicle.stop_route_index
    if vehicle.route >= 0 and is_here and vehicle.stop_offset > vehicle.offset - 1.0:
        return max(vehicle.stop_offset - vehicle.offset, 0.0)
    return distance_to_place(vehicle)


@inlined
def stop_and_speed_limit(net, vehicle, look, stop_distance, let_in_distance, wanted):
    """Return where a vehicle has to stop and how fast it may be now.

    It stops at its bus stop, before a junction it may not enter, where it lets a bus in, and at its path's end; it
    slows down in time for lower limits ahead.

    Parameters
    ----------
    look
        Metres ahead that count.
    stop_distance
        Metres to a bus stop on its own lane, `NEVER` for none.
    let_in_distance
        Metres to where it lets a bus in, `NEVER` for none.
    wanted
        Desired speed on its own lane, m/s.

    Returns
    -------
    tuple
        Metres to where it stops (`NEVER` for nowhere), and the most speed, m/s.
    """
    limit_now = wanted
    ahead = net.lanes[vehicle.lane].length - vehicle.offset
    stop = stop_distance
    is_bus = vehicle.route >= 0
    for k in range(vehicle.planned_count):
        if stop < NEVER or ahead > look:
            break
        lane = vehicle.planned_lanes[k]
        if net.lanes[lane].junction >= 0 and k >= vehicle.granted_count:
            stop = max(ahead - net.lanes[vehicle.lane if k == 0 else vehicle.planned_lanes[k - 1]].stop_line, 0.0)
            break
        limit = min(net.lanes[lane].speed * vehicle.speed_factor, vehicle.target_speed if is_bus else wanted)
        limit_now = min(limit_now, np.sqrt(limit * limit + 2 * vehicle.braking * max(ahead, 0.0)))
        if is_lane_of_stop(net, vehicle, k + 1):
            stop = ahead + vehicle.stop_offset
        ahead += net.lanes[lane].length
    if is_bus and stop >= NEVER:
        # The route goes on in the lane beside: wait for room to change.
        ahead -= room_to_change(net, vehicle) if vehicle.planned_count == 0 else _BEFORE_LANE_END
        if ahead < look:
            stop = max(ahead, 0.0)
    stop = min(stop, let_in_distance)
    if stop < NEVER:
        limit_now = min(limit_now, np.sqrt(2 * vehicle.braking * stop))
    return stop, limit_now


@compiled
def _keeps_others_out(vehicle, junctions):
    """Return whether those stay back, until a vehicle has gone, who would stand in its way at the end of their lane.

    Else whoever comes next would go before it again. Where junctions are shared they cannot wait for ever: on lanes of
    a few metres they keep those behind them inside junctions.
    """
    is_patient = not junctions.claims.any_shared or vehicle.junction_wait < _KEEPS_OUT_FOR
    return vehicle.junction_wait > 0.0 and is_patient


@inlined
def _look_around(net, vehicle, look, request, scratch, beyond):
    """Return what a vehicle sees: bodies near it, and its path, farther where it may have to see beyond a junction.

    Parameters
    ----------
    look
        Metres ahead that it minds.
    """
    path_buffer, body_buffer = scratch
    length = vehicle.length
    far, reach = look, look + length + 6.0
    if request.planned_index >= 0:
        # Who asks has to see the place beyond the junction where it will stand.
        far = net.lanes[vehicle.lane].length - vehicle.offset
        for k in range(vehicle.planned_count):
            far += net.lanes[vehicle.planned_lanes[k]].length
            is_street = net.lanes[vehicle.planned_lanes[k]].junction < 0
            if k > request.planned_index and is_street and far > look + _BEYOND_JUNCTION:
                break
        far = max(far, look)
    path = path_polyline(net, vehicle, length + 3.0, vehicle.offset + far + 4.0, path_buffer)
    v, shapes = vehicle.index, beyond.shapes
    near = search(beyond.grid, shapes.x[v], shapes.y[v], reach, beyond.candidates)
    nearby = nearby_bodies(shapes, v, shapes.x[v], shapes.y[v], reach, near, body_buffer)
    return VehicleView(path, vehicle_outline(vehicle), nearby, beyond)


@inlined
def _move_without_contact(net, vehicle, view, move, gap, leader):
    """Return the move, gap and leader; no move where it would touch a body or leave the planned path."""
    if vehicle.planned_count == 0:
        move = min(move, max(net.lanes[vehicle.lane].length - vehicle.offset, 0.0))
    if move > 0.0:
        hit = touched_at(view.path, view.outline, vehicle.offset + move, view.nearby, TOUCH, TOUCH)
        if hit >= 0:
            return 0.0, 0.0, view.nearby[hit].body
    return move, gap, leader


@compiled
def _move_back(net, vehicle, view, dt):
    """Return the move of a vehicle that backs up, metres; 0 where it would touch a body."""
    move = -_REVERSE * dt
    if (
        vehicle.stopping != DRIVING
        or vehicle.granted_count > 0
        or (vehicle.offset + move < 0.0 and not can_step_back(net, vehicle))
    ):
        return 0.0
    # Whoever backs up stands as near as may be to what it backs away from.
    is_blocked = touched_at(view.path, view.outline, vehicle.offset + move, view.nearby, TOUCH / 4, TOUCH / 4) >= 0
    return 0.0 if is_blocked else move


@compiled
def _gives_up_waiting(vehicle, dt):
    """Return whether a car looks for another way now: a full exit is no reason to wait for ever."""
    return vehicle.junction_wait > _OTHER_WAY_AFTER and int(vehicle.junction_wait / dt) % 50 == 0


@compiled
def place_vehicle(net, fleet, v, lane, offset, shapes, air):
    """Put vehicle v on a lane if no other body would be nearer than `air` metres; True if it now stands there."""
    vehicle = fleet[v]
    path = lane_polyline(net, line_points(net, vehicle), lane, np.empty(256, PATH_POINT))
    outline = changing_lane(vehicle_outline(vehicle), 0.0, 0.0)
    cx, cy, c, s = footprint(path, outline, offset)
    before = shapes.x[v], shapes.y[v]
    shapes.x[v], shapes.y[v] = cx, cy
    length = vehicle.length
    grown = Rectangle(cx, cy, c, s, length / 2 + air, vehicle.half_width + 0.3)
    everybody = np.arange(len(shapes.x))
    for one in nearby_bodies(shapes, v, cx, cy, length + air + 1.0, everybody, np.empty(len(shapes.x), NEARBY_BODY)):
        if touches(grown, one):
            shapes.x[v], shapes.y[v] = before
            return False
    vehicle.lane, vehicle.offset, vehicle.planned_count, vehicle.lateral_offset = lane, offset, 0, 0.0
    vehicle.stopping, vehicle.place, vehicle.way_offset = DRIVING, NONE, -1.0
    vehicle.gives_way_to = NONE
    vehicle.previous_lanes[:] = NONE
    vehicle.speed = vehicle.stopped_time = vehicle.junction_wait = 0.0
    vehicle.time_since_lane_change = vehicle.lane_change_distance = 0.0
    shapes.yaw[v] = np.arctan2(s, c)
    shapes.vx[v] = shapes.vy[v] = 0.0
    return True


@compiled
def _bring_on(net, fleet, v, junctions, shapes):
    """Put a bus at the stop it drives to, else where its route is free nearest before it; its riders come along."""
    vehicle = fleet[v]
    if vehicle.stop_route_index < 0:
        return
    first = net.route_first[vehicle.route]
    size = net.route_first[vehicle.route + 1] - first
    for back in range(size):
        index = (vehicle.stop_route_index - back) % size
        if back > 0 and index == vehicle.route_index:
            return  # it would get nowhere
        lane = net.route[first + index]
        offset = vehicle.stop_offset if back == 0 else net.lanes[lane].length - _BEFORE_JUNCTION
        if (back == 0 or _can_stand_on(net, vehicle, lane, net.route[first + (index + 1) % size])) and place_vehicle(
            net, fleet, v, lane, offset, shapes, 1.0
        ):
            vehicle.route_index = index
            release_all_junctions(junctions, vehicle)
            vehicle.teleports += 1
            return


@compiled
def _can_stand_on(net, vehicle, lane, following):
    """Return whether a bus fits on a lane, between junctions, that its route leaves at its end."""
    street = net.lanes[lane]
    fits = street.inside < 0 and street.junction < 0 and street.length > vehicle.length + _BEFORE_JUNCTION + 1.0
    return fits and following != street.left and following != street.right


@compiled
def take_away(net, fleet, v, junctions):
    """Take a bus off the streets; it comes back at the stop that it drives to, or stands at."""
    vehicle = fleet[v]
    release_all_junctions(junctions, vehicle)
    vehicle.route_index, vehicle.offset = vehicle.stop_route_index, vehicle.stop_offset
    vehicle.lane = net.route[net.route_first[vehicle.route] + vehicle.route_index]
    vehicle.planned_count = 0
    vehicle.previous_lanes[:] = NONE
    vehicle.speed = vehicle.stopped_time = vehicle.junction_wait = vehicle.lateral_offset = 0.0
    vehicle.blocker = vehicle.gives_way_to = NONE
    vehicle.queued_junction = vehicle.queued_exit = vehicle.kept_out_from = NONE
    vehicle.at_stop, vehicle.lights, vehicle.presence = False, 0, AWAY


@compiled
def come_back(net, fleet, v, shapes):
    """Put a bus that was taken away at its stop, where nobody is so near that they would have to brake for it."""
    vehicle = fleet[v]
    if place_vehicle(net, fleet, v, vehicle.lane, vehicle.offset, shapes, _COMING_BACK):
        vehicle.at_stop, vehicle.presence = True, PRESENT


@compiled
def bring_back(net, fleet, junctions, shapes, entries, entry_speed, patience):
    """Bring cars that left the map, or stood still for longer than `patience`, back in where the map begins.

    Buses that stood still for so long, not at a stop, go on from the stop they drove to, or before it where it is free.

    Parameters
    ----------
    entries
        Lanes that begin at the map's edge.
    entry_speed
        Of those that left it, m/s.
    patience
        Seconds.
    """
    for v in range(len(fleet)):
        vehicle = fleet[v]
        if vehicle.route >= 0:
            if vehicle.stopped_time >= patience:
                _bring_on(net, fleet, v, junctions, shapes)
            continue
        if len(entries) == 0:
            continue
        # A car that stands at the end of a lane that leads nowhere has left the map.
        left = vehicle.planned_count == 0 and vehicle.offset >= net.lanes[vehicle.lane].length - 0.3
        if not left and vehicle.stopped_time < patience:
            continue
        for _ in range(3):
            entry = entries[min(int(next_random(vehicle) * len(entries)), len(entries) - 1)]
            start = vehicle.length + 0.2
            if net.lanes[entry].length > start + 1.0 and place_vehicle(net, fleet, v, entry, start, shapes, 4.0):
                release_all_junctions(junctions, vehicle)
                vehicle.speed = min(entry_speed, vehicle.target_speed) if left else 0.0
                if left:
                    vehicle.laps += 1
                else:
                    vehicle.teleports += 1
                break
