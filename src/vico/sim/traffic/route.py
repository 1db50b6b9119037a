"""Routes of vehicles: cars choose at every junction, buses follow their route."""

from __future__ import annotations

from vico.io.compiled import compiled, inlined
from vico.sim.traffic.state import (
    HELD_JUNCTIONS,
    LEAVING,
    NONE,
    PLANNED_LANES,
    PRESENT,
    PREVIOUS_LANES,
    STANDING,
    next_random,
)

NEVER = 1e9  # distance to a stop that there is not, m
STANDING_ROOM = 1.5  # room kept behind a vehicle that has left a junction, m
# Costs of lanes, in vehicles on a street.
_DEAD_END = 4.0
_JUNCTION_AGAIN = 2.0
_BEEN_THERE = 50.0
_TURN_BACK = 1e6
_SHUT = 1e8  # only where there is no other way, turning back among them
_LESS_PICKY = 5.0  # s of waiting that count like a vehicle on a street


@compiled
def count_per_street(net, fleet, street_load):
    """Count the vehicles on each street (one direction) into `street_load`."""
    street_load[:] = 0
    for vehicle in fleet:
        street_load[net.lanes[vehicle.lane].edge] += vehicle.presence == PRESENT


@compiled
def _street_reached_by(net, lane):
    """Return the street lane that a lane through junctions leads to."""
    street = lane
    for _ in range(6):
        onward = net.lanes[street].first_next
        if net.lanes[street].inside < 0 or onward == net.lanes[street].end_next:
            break
        street = net.next[onward]
    return street


@compiled
def _lane_cost(net, vehicle, option, street, street_load):
    """Return what speaks against taking lane `option` to `street`: vehicles there, and ways that lead nowhere new."""
    # The longer it has waited to go its way, the less it minds where another one leads.
    cost = street_load[net.lanes[street].edge] + next_random(vehicle) * (1.0 + vehicle.junction_wait / _LESS_PICKY)
    # A dead end: a street that only leads back.
    onward = net.lanes[street].first_next
    if net.lanes[street].end_next == onward + 1 and net.lanes[net.next[onward]].u_turn:
        cost += _DEAD_END  # only when everywhere else is busy
    # Out of a junction, not round and round in it, and not back to where the car waits.
    if net.lanes[street].junction >= 0:
        cost += _JUNCTION_AGAIN
    if net.lanes[street].edge == net.lanes[vehicle.lane].edge:
        cost += _BEEN_THERE
    for p in range(vehicle.planned_count):
        if vehicle.planned_lanes[p] == option:
            cost += _BEEN_THERE
    if net.lanes[option].u_turn:
        cost += _TURN_BACK
    if net.lanes[option].shut or net.lanes[street].shut:
        cost += _SHUT
    return cost


@compiled
def _goal_after(net, vehicle):
    """Return the goal that a car drives to after its planned lanes, `NONE` for none."""
    goal = vehicle.goal
    if goal == NONE:
        return NONE
    for k in range(-1, vehicle.planned_count):
        lane = vehicle.lane if k < 0 else vehicle.planned_lanes[k]
        while goal < vehicle.goal_end and net.goal_edge[goal] == net.lanes[lane].edge:
            goal += 1
    return goal if goal < vehicle.goal_end else NONE


@compiled
def choose_next_lane(net, vehicle, lane, street_load):
    """Return the lane a car takes after `lane`: towards the street with fewer vehicles; `NONE` at the map's end."""
    best, best_cost = NONE, 1e18
    if net.lanes[lane].leaves:
        return NONE
    goal = _goal_after(net, vehicle)
    if goal != NONE and net.goal_next[goal, lane] != NONE:
        return net.goal_next[goal, lane]
    for k in range(net.lanes[lane].first_next, net.lanes[lane].end_next):
        option = net.next[k]
        if net.lanes[option].closed:
            continue
        street = _street_reached_by(net, option)
        if net.lanes[street].closed:
            continue
        cost = _lane_cost(net, vehicle, option, street, street_load)
        if cost < best_cost:
            best, best_cost = option, cost
    return best


@compiled
def route_lane(net, vehicle, further):
    """Return the lane of a bus's route that comes `further` lanes after its own."""
    route = vehicle.route
    size = net.route_first[route + 1] - net.route_first[route]
    return net.route[net.route_first[route] + (vehicle.route_index + further) % size]


@compiled
def is_lane_of_stop(net, vehicle, further):
    """Return whether it is a bus whose next stop is on the lane that comes `further` lanes after its own."""
    route = vehicle.route
    if route < 0:
        return False
    size = net.route_first[route + 1] - net.route_first[route]
    return (vehicle.route_index + further) % size == vehicle.stop_route_index


@compiled
def clear_of_tracks(net, lane, clear, room):
    """Return from which metre of a street lane on a vehicle can stand that needs so much room and has `clear` before.

    It is 0 where no tracks are in the way.
    """
    begin = 0.0
    for c in range(net.lanes[lane].first_track, net.lanes[lane].end_track):
        before = net.tracks[c].start - begin + (clear if begin == 0.0 else 0.0)
        if before < room:
            begin = net.tracks[c].end
    return begin


@compiled
def _clear_with(net, lane, clear, room):
    """Return the metres without a junction or tracks at the end of a path that a planned lane makes longer."""
    if net.lanes[lane].junction >= 0:
        return 0.0
    begin = clear_of_tracks(net, lane, clear, room)
    return net.lanes[lane].length - begin + (clear if begin == 0.0 else 0.0)


@inlined
def plan_lanes(net, vehicle, street_load, reach):
    """Plan lanes until the path is `reach` metres long and ends where it can stand clear of junctions and tracks.

    Returns
    -------
    bool
        Whether the path ends there for good: at the map's edge, or where a route goes on in the lane beside.
    """
    count = vehicle.planned_count
    lane = vehicle.lane if count == 0 else vehicle.planned_lanes[count - 1]
    ahead = net.lanes[vehicle.lane].length - vehicle.offset
    clear, room = 1e9, vehicle.length + STANDING_ROOM
    for k in range(count):
        planned = vehicle.planned_lanes[k]
        ahead += net.lanes[planned].length
        clear = _clear_with(net, planned, clear, room)
    while vehicle.planned_count < PLANNED_LANES and (ahead < reach or clear < room):
        if vehicle.route >= 0:
            following = route_lane(net, vehicle, vehicle.planned_count + 1)
            if following == net.lanes[lane].left or following == net.lanes[lane].right:
                return True
        else:
            following = choose_next_lane(net, vehicle, lane, street_load)
            if following < 0:
                return True
        vehicle.planned_lanes[vehicle.planned_count] = following
        vehicle.planned_count += 1
        ahead += net.lanes[following].length
        clear = _clear_with(net, following, clear, room)
        lane = following
    return False


@compiled
def advance_lane(net, vehicle):
    """Step on to the planned lanes that a vehicle's front has reached."""
    while vehicle.offset > net.lanes[vehicle.lane].length and vehicle.planned_count > 0:
        vehicle.offset -= net.lanes[vehicle.lane].length
        while vehicle.goal != NONE and net.goal_edge[vehicle.goal] == net.lanes[vehicle.lane].edge:
            vehicle.goal = vehicle.goal + 1 if vehicle.goal + 1 < vehicle.goal_end else NONE
        for k in range(PREVIOUS_LANES - 1, 0, -1):
            vehicle.previous_lanes[k] = vehicle.previous_lanes[k - 1]
        vehicle.previous_lanes[0] = vehicle.lane
        vehicle.lane = vehicle.planned_lanes[0]
        for k in range(vehicle.planned_count - 1):
            vehicle.planned_lanes[k] = vehicle.planned_lanes[k + 1]
        vehicle.planned_count -= 1
        vehicle.granted_count = max(vehicle.granted_count - 1, 0)
        advance_on_route(net, vehicle)


@compiled
def can_step_back(net, vehicle):
    """Return whether a vehicle that backs up may do so onto the lane it came from: a car, and not into a junction.

    A junction that it holds it may back into.
    """
    before = vehicle.previous_lanes[0]
    if before == NONE or vehicle.route >= 0 or vehicle.planned_count == PLANNED_LANES or vehicle.lateral_offset != 0.0:
        return False
    junction = net.lanes[before].junction
    holds = junction < 0
    for h in range(HELD_JUNCTIONS):
        holds = holds or vehicle.held_junctions[h] == junction
    return holds


@compiled
def step_back_lane(net, vehicle):
    """Step back to the lane before, onto which a vehicle has backed up."""
    for k in range(vehicle.planned_count, 0, -1):
        vehicle.planned_lanes[k] = vehicle.planned_lanes[k - 1]
    vehicle.planned_lanes[0] = vehicle.lane
    vehicle.planned_count += 1
    vehicle.lane = vehicle.previous_lanes[0]
    vehicle.offset += net.lanes[vehicle.lane].length
    for k in range(PREVIOUS_LANES - 1):
        vehicle.previous_lanes[k] = vehicle.previous_lanes[k + 1]
    vehicle.previous_lanes[PREVIOUS_LANES - 1] = NONE


@compiled
def advance_on_route(net, vehicle):
    """Note that a bus is on the next lane of its route; cars have none."""
    route = vehicle.route
    if route >= 0:
        vehicle.route_index = (vehicle.route_index + 1) % (net.route_first[route + 1] - net.route_first[route])


@compiled
def drop_shut_plans(net, fleet):
    """Have cars plan anew that meant to drive on lanes that are shut now, unless they were let in already."""
    for vehicle in fleet:
        if vehicle.route >= 0:
            continue
        for k in range(vehicle.granted_count, vehicle.planned_count):
            if net.lanes[vehicle.planned_lanes[k]].shut:
                vehicle.planned_count = vehicle.granted_count
                break


@compiled
def is_taken(net, fleet, lanes):
    """Return whether a car is on one of some lanes (a mask), may still be with its rear, or will drive there."""
    for vehicle in fleet:
        is_in_car_park = vehicle.way_offset > 0.0 and (vehicle.stopping == STANDING or vehicle.stopping == LEAVING)
        if vehicle.route >= 0 or is_in_car_park:
            continue
        if lanes[vehicle.lane]:
            return True
        behind = vehicle.length - vehicle.offset
        for k in range(PREVIOUS_LANES):
            before = vehicle.previous_lanes[k]
            if behind <= 0.0 or before == NONE:
                break
            if lanes[before]:
                return True
            behind -= net.lanes[before].length
        for k in range(vehicle.planned_count):
            if lanes[vehicle.planned_lanes[k]]:
                return True
    return False


@compiled
def widen_shut(net, shut):
    """Shut, besides, the lanes from which every way leads onto shut ones; `shut` is a mask, and is changed.

    A car that drove in there would have to go through.
    """
    changed = True
    while changed:
        changed = False
        for lane in range(len(shut)):
            if shut[lane] or net.lanes[lane].leaves:
                continue
            ways = open_ways = 0
            for k in range(net.lanes[lane].first_next, net.lanes[lane].end_next):
                option = net.next[k]
                street = _street_reached_by(net, option)
                if net.lanes[option].closed or net.lanes[street].closed:
                    continue
                ways += 1
                open_ways += not (shut[option] or shut[street])
            if ways > 0 and open_ways == 0:
                shut[lane] = changed = True
