"""How vehicles drive: lane following (IDM), junction tokens, lane changes, bus stops; kernels over arrays.

Car following is the Intelligent Driver Model (Treiber, Hennecke, Helbing 2000), the leader being whatever body the
vehicle's own swept rectangle meets first: vehicles, walkers, avatars and robots alike. No move is made that would
touch another body, so vehicles never overlap whatever the model says.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from vico.sim.traffic_shapes import next_random
from vico.sim.traffic_ways import (
    TOUCH,
    TRAIL,
    blocked,
    first_ahead,
    follow,
    footprint,
    gather_near,
    lay_way,
    project,
    set_frame,
    touches,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]

PLAN, HELD = 48, 6
TOP_SPEED = 13.9  # m/s, whatever the street allows
_BRAKE = 2.0  # comfortable deceleration, m/s^2
_HARD_BRAKE = 8.0
_HEADWAY = 1.2  # s
_JAM_GAP = 1.8  # m
_STAND_AIR = 1.5  # room kept behind a vehicle that has left a junction, m
_BACK_UP, _REVERSE = 3.0, 0.6  # s stood before a vehicle backs up for another, and how fast, m/s
_YIELD = 2.0  # s that a vehicle has stood in a junction before the one in its way is let in
_PATIENCE = 10.0  # s that cars let walkers go first at a crossing, and walkers cars


class Net(NamedTuple):
    """The lanes, as `LaneGraph` has them, those closed to cars, and the crossings each lane runs over."""

    first: Ints
    points: Floats
    along: Floats
    length: Floats
    speed: Floats
    zone: Ints
    inside: Ints
    edge: Ints
    closed: NDArray[np.bool_]
    left: Ints
    right: Ints
    next_first: Ints
    next: Ints
    over_first: Ints
    over: Ints
    over_until: Floats
    u_turn: NDArray[np.bool_]
    leaves: NDArray[np.bool_]
    route_first: Ints
    route: Ints


class Makes(NamedTuple):
    """What does not change about each vehicle."""

    length: Floats
    half_width: Floats
    overhang: Floats
    wheelbase: Floats
    acceleration: Floats
    haste: Floats
    line: Ints


class Fleet(NamedTuple):
    """What changes about each vehicle; `offset` is where its front is on its lane."""

    lane: Ints
    offset: Floats
    speed: Floats
    trail: Ints
    plan: Ints
    planned: Ints
    granted: Ints
    held: Ints
    shift: Floats
    changed: Floats
    blocker: Ints
    pace: Floats
    still: Floats
    waited: Floats
    queue: Ints
    rested: Floats
    place: Ints
    goal: Ints
    goal_offset: Floats
    arrived: NDArray[np.bool_]
    rounds: Ints
    rescued: Ints
    random: NDArray[np.uint64]


class Gates(NamedTuple):
    """Who is in each junction cluster, and who wants over each crossing."""

    holder: Ints
    walkers_on: Ints
    walker_wait: Floats
    vehicle_wait: Floats
    longest: Floats
    busy: NDArray[np.bool_]


@njit(cache=True)
def _choose(net, fleet, v, lane, crowd):  # type: ignore[no-untyped-def]
    """The next lane for a car: towards the street with fewer vehicles; -1 at the end of the map."""
    best, best_score = -1, 1e18
    if net.leaves[lane]:
        return -1
    for k in range(net.next_first[lane], net.next_first[lane + 1]):
        option = net.next[k]
        if net.closed[option]:
            continue
        street = option
        for _ in range(6):
            if net.inside[street] < 0 or net.next_first[street] == net.next_first[street + 1]:
                break
            street = net.next[net.next_first[street]]
        if net.closed[street]:
            continue
        score = crowd[net.edge[street]] + next_random(fleet.random, v)
        onward = net.next_first[street]
        if net.next_first[street + 1] == onward + 1 and net.u_turn[net.next[onward]]:
            score += 4.0  # a dead end: only when everywhere else is busy
        # Out of a junction, not round and round in it, and not back to where the car waits.
        if net.zone[street] >= 0:
            score += 2.0
        if net.edge[street] == net.edge[fleet.lane[v]]:
            score += 50.0
        for p in range(fleet.planned[v]):
            if fleet.plan[v, p] == option:
                score += 50.0
        if net.u_turn[option]:
            score += 1e6
        if score < best_score:
            best, best_score = option, score
    return best


@njit(cache=True)
def _extend_plan(net, makes, fleet, v, crowd, reach):  # type: ignore[no-untyped-def]
    """Plan lanes until the way ahead is `reach` metres long and ends where v can stand clear of junctions.

    True if the way ends there for good: at the map's edge, or where a route goes on in the next lane.
    """
    lane = fleet.lane[v] if fleet.planned[v] == 0 else fleet.plan[v, fleet.planned[v] - 1]
    ahead = net.length[fleet.lane[v]] - fleet.offset[v]
    clear = 1e9
    for k in range(fleet.planned[v]):
        ahead += net.length[fleet.plan[v, k]]
        clear = 0.0 if net.zone[fleet.plan[v, k]] >= 0 else clear + net.length[fleet.plan[v, k]]
    line = makes.line[v]
    while fleet.planned[v] < PLAN and (ahead < reach or clear < makes.length[v] + _STAND_AIR):
        if line >= 0:
            size = net.route_first[line + 1] - net.route_first[line]
            place = (fleet.place[v] + fleet.planned[v] + 1) % size
            following = net.route[net.route_first[line] + place]
            if following == net.left[lane] or following == net.right[lane]:
                return True
        else:
            following = _choose(net, fleet, v, lane, crowd)
            if following < 0:
                return True
        fleet.plan[v, fleet.planned[v]] = following
        fleet.planned[v] += 1
        ahead += net.length[following]
        clear = 0.0 if net.zone[following] >= 0 else clear + net.length[following]
        lane = following
    return False


@njit(cache=True)
def _ask(net, makes, fleet, gates, v, k0, way, count, frame, table, n, vehicles, start, ends):  # type: ignore[no-untyped-def]
    """Try to get every junction from plan[k0] on up to where v can stand clear; `start` = metres from v's lane's
    start to that of plan[k0]. True if granted. Notes who is waited for at crossings.
    """
    x = start
    k = k0
    clear = 0.0
    need = makes.length[v] + _STAND_AIR
    stand = -1.0  # where the stretch to stand on starts
    last = k0
    guest = -1
    for_walkers = False
    while k < fleet.planned[v]:
        lane = fleet.plan[v, k]
        if net.zone[lane] >= 0:
            holder = gates.holder[net.zone[lane]]
            turn = max(fleet.waited[v] + 5.0, 10.0)
            if holder >= 0 and holder != v and fleet.blocker[holder] == v and fleet.still[holder] > _YIELD:
                guest = holder  # it cannot leave the junction before v is out of its way: v goes first
            elif (holder >= 0 and holder != v) or gates.longest[net.zone[lane]] > turn:
                fleet.queue[v] = net.zone[lane]
                return False
            clear = 0.0
            stand = -1.0
            last = k + 1
            for o in range(net.over_first[lane], net.over_first[lane + 1]):
                crossing = net.over[o]
                called = gates.walker_wait[crossing] > 4.0 and fleet.waited[v] < _PATIENCE
                if gates.walkers_on[crossing] > 0 or called:
                    for_walkers = True
                    if fleet.waited[v] > gates.vehicle_wait[crossing]:
                        gates.vehicle_wait[crossing] = fleet.waited[v]
        else:
            if stand < 0.0:
                stand = x
            clear += net.length[lane]
        x += net.length[lane]
        k += 1
        if clear >= need:
            break
    if for_walkers:
        return False
    if clear < need and not (ends and k == fleet.planned[v] and makes.line[v] < 0):
        return False
    if stand >= 0.0:
        # The exit must have room now: whoever stands there may stay.
        room = min(need, max(clear, 0.0))
        for i in range(1, 6):
            there = stand + room * i / 5
            if blocked(way, count, frame, there, table, n, 0.05, 0.05, vehicles) >= 0:
                return False
    if guest >= 0:
        # Nobody may be in the way of a guest, or neither would get out.
        there = fleet.offset[v] + 0.5
        while there < x:
            if blocked(way, count, frame, there, table, n, 0.05, 0.05, vehicles) >= 0:
                return False
            there += 1.0
    for k in range(k0, last):
        zone = net.zone[fleet.plan[v, k]]
        if zone >= 0 and gates.holder[zone] != v:
            slot = -1
            for h in range(HELD):
                if fleet.held[v, h] < 0:
                    slot = h
                    break
            if slot < 0:
                return False
            fleet.held[v, slot] = zone
            gates.holder[zone] = v
    fleet.granted[v] = last
    return True


@njit(cache=True)
def _release(net, makes, fleet, gates, v):  # type: ignore[no-untyped-def]
    """Give back the junctions that v's body has left and that are not granted ahead."""
    for h in range(HELD):
        zone = fleet.held[v, h]
        if zone < 0:
            continue
        inside = net.zone[fleet.lane[v]] == zone
        for k in range(fleet.granted[v]):
            inside = inside or net.zone[fleet.plan[v, k]] == zone
        rear = fleet.offset[v] - makes.length[v] - 0.5
        k = 0
        while rear < 0.0 and k < TRAIL and fleet.trail[v, k] >= 0:
            lane = fleet.trail[v, k]
            inside = inside or net.zone[lane] == zone
            rear += net.length[lane]
            k += 1
        if not inside:
            fleet.held[v, h] = -1
            if gates.holder[zone] == v:
                gates.holder[zone] = -1
        elif gates.holder[zone] < 0:
            gates.holder[zone] = v  # the guest that was let go first has gone


@njit(cache=True)
def release_all(fleet, gates, v):  # type: ignore[no-untyped-def]
    """Give back every junction v holds."""
    for h in range(HELD):
        if fleet.held[v, h] >= 0:
            if gates.holder[fleet.held[v, h]] == v:
                gates.holder[fleet.held[v, h]] = -1
            fleet.held[v, h] = -1
    fleet.granted[v] = 0


@njit(cache=True)
def mark_busy(net, makes, fleet, gates):  # type: ignore[no-untyped-def]
    """Mark the crossings that a vehicle is on or has been granted the way over.

    One that stands before its junction does not count; one that stands in it does, so that it gets out of it.
    """
    gates.busy[:] = False
    for v in range(len(fleet.lane)):
        lane = fleet.lane[v]
        rear = fleet.offset[v] - makes.length[v]
        for o in range(net.over_first[lane], net.over_first[lane + 1]):
            if rear < net.over_until[o]:
                gates.busy[net.over[o]] = True
        k = 0
        while rear < 0.0 and k < TRAIL and fleet.trail[v, k] >= 0:
            lane = fleet.trail[v, k]
            rear += net.length[lane]
            for o in range(net.over_first[lane], net.over_first[lane + 1]):
                if rear < net.over_until[o]:
                    gates.busy[net.over[o]] = True
            k += 1
        if fleet.still[v] > 5.0 and net.zone[fleet.lane[v]] < 0:
            continue
        for k in range(fleet.granted[v]):
            lane = fleet.plan[v, k]
            for o in range(net.over_first[lane], net.over_first[lane + 1]):
                gates.busy[net.over[o]] = True


@njit(cache=True)
def _change_lane(net, makes, fleet, v, target, way, count, frame, table, n):  # type: ignore[no-untyped-def]
    """Move v over to a neighbour lane if there is room beside; its place on the ground changes gradually."""
    length = makes.length[v]
    if fleet.granted[v] > 0 or fleet.shift[v] != 0.0 or fleet.offset[v] < length + 3.0:
        return False
    x, y, _, _ = follow(way, count, fleet.offset[v])
    offset, side = project(net.first, net.points, net.along, target, x, y)
    if offset < length + 2.0 or offset > net.length[target] - 1.0:
        return False
    beside = np.empty((64, 3))
    nobody = np.empty(0, np.int32)
    m = lay_way(
        net.first, net.points, net.along, net.length, target, nobody, nobody, 0, 0.0, net.length[target], beside
    )
    frame[4] = 0.0
    # From a gap behind for whoever comes, to the end of the swerve.
    for i in range(9):
        there = offset - 7.0 + (15.0 + length) * i / 8
        if there <= net.length[target] and blocked(beside, m, frame, there, table, n, 0.1, 0.3, 1e9) >= 0:
            return False
    frame[4], frame[5] = side, -offset
    if blocked(beside, m, frame, offset, table, n, TOUCH, TOUCH, 1e9) >= 0:
        return False
    fleet.lane[v], fleet.offset[v], fleet.planned[v] = target, offset, 0
    fleet.shift[v], fleet.changed[v], fleet.rested[v] = side, 0.0, 0.0
    fleet.trail[v, :] = -1
    return True


@njit(cache=True)
def _advance_lane(net, makes, fleet, v):  # type: ignore[no-untyped-def]
    """Step on to the planned lanes that v's front has reached."""
    while fleet.offset[v] > net.length[fleet.lane[v]] and fleet.planned[v] > 0:
        fleet.offset[v] -= net.length[fleet.lane[v]]
        for k in range(TRAIL - 1, 0, -1):
            fleet.trail[v, k] = fleet.trail[v, k - 1]
        fleet.trail[v, 0] = fleet.lane[v]
        fleet.lane[v] = fleet.plan[v, 0]
        for k in range(fleet.planned[v] - 1):
            fleet.plan[v, k] = fleet.plan[v, k + 1]
        fleet.planned[v] -= 1
        fleet.granted[v] = max(fleet.granted[v] - 1, 0)
        line = makes.line[v]
        if line >= 0:
            fleet.place[v] = (fleet.place[v] + 1) % (net.route_first[line + 1] - net.route_first[line])


@njit(cache=True)
def advance_vehicles(net, makes, fleet, gates, shapes, crowd, dt):  # type: ignore[no-untyped-def]
    """Move every vehicle by one step, one after the other, each seeing where the ones before it went."""
    vehicles = len(fleet.lane)
    gates.longest[:] = 0.0
    for v in range(vehicles):
        if fleet.queue[v] >= 0:
            gates.longest[fleet.queue[v]] = max(gates.longest[fleet.queue[v]], fleet.waited[v])
    # A vehicle that keeps another one from leaving a junction, or stands head to head with it, backs up for it.
    backs = np.zeros(vehicles, np.bool_)
    for v in range(vehicles):
        b = fleet.blocker[v]
        if b < 0 or b >= vehicles or fleet.still[v] < _BACK_UP or fleet.still[b] < _BACK_UP or fleet.arrived[b]:
            continue
        across = np.cos(shapes.yaw[v] - shapes.yaw[b]) < 0.85
        # Of two in each other's way the one outside the junction moves; a car rather than a bus; the higher number.
        inside_v, inside_b = net.zone[fleet.lane[v]] >= 0, net.zone[fleet.lane[b]] >= 0
        if fleet.blocker[b] == v:
            backs[b] = (inside_v and not inside_b) or (
                inside_v == inside_b
                and (makes.length[b] < makes.length[v] or (makes.length[b] == makes.length[v] and b > v))
            )
        else:
            backs[b] = backs[b] or (across and inside_v)
    # Who stands close behind one that backs up backs up, too.
    for _ in range(6):
        for v in range(vehicles):
            b = fleet.blocker[v]
            if 0 <= b < vehicles and backs[b] and makes.line[v] < 0 and fleet.still[v] > 0.0:
                backs[v] = backs[v] or np.cos(shapes.yaw[v] - shapes.yaw[b]) > 0.85
    table = np.empty((len(shapes.x), 9))
    picked = np.empty((len(table), 9))
    way = np.empty((768, 3))
    frame = np.empty(7)
    for v in range(vehicles):
        lane, speed, line = fleet.lane[v], fleet.speed[v], makes.line[v]
        offset, length = fleet.offset[v], makes.length[v]
        look = speed * speed / (2 * _BRAKE) + speed * _HEADWAY + 8.0
        ends = _extend_plan(net, makes, fleet, v, crowd, look + length + 12.0)

        # Who was let in but has not got going is in everybody's way: the junction goes back.
        if fleet.granted[v] > 0 and fleet.still[v] > 3.0 and net.zone[lane] < 0:
            fleet.granted[v] = 0
            _release(net, makes, fleet, gates, v)

        # The first junction ahead that has to be asked for, and the bus stop ahead.
        ahead = net.length[lane] - offset
        braking = speed * speed / (2 * _BRAKE) + 8.0
        goal = 1e9
        size = net.route_first[line + 1] - net.route_first[line] if line >= 0 else 1
        if line >= 0 and fleet.goal[v] >= 0 and fleet.place[v] == fleet.goal[v] and fleet.goal_offset[v] > offset - 1.0:
            goal = max(fleet.goal_offset[v] - offset, 0.0)
        ask = -1
        for k in range(fleet.planned[v]):
            if ahead > braking or goal < 1e8:
                break
            if net.zone[fleet.plan[v, k]] >= 0 and k >= fleet.granted[v]:
                ask = k
                break
            if line >= 0 and (fleet.place[v] + k + 1) % size == fleet.goal[v]:
                break
            ahead += net.length[fleet.plan[v, k]]

        far, reach = look, look + length + 6.0
        if ask >= 0:
            # Who asks has to see the place beyond the junction where it will stand.
            far = net.length[lane] - offset
            for k in range(fleet.planned[v]):
                far += net.length[fleet.plan[v, k]]
                if k > ask and net.zone[fleet.plan[v, k]] < 0 and far > look + 60.0:
                    break
            far = max(far, look)
            reach = max(reach, min(far, look + length + 150.0))
        count = lay_way(
            net.first, net.points, net.along, net.length, lane, fleet.trail[v], fleet.plan[v], fleet.planned[v],
            length + 3.0, offset + far + 4.0, way,
        )  # fmt: skip
        set_frame(makes, fleet, v, frame)
        n = gather_near(shapes, v, reach, table)
        refused = False
        fleet.queue[v] = -1
        gap, leader = first_ahead(way, count, frame, offset, table, n, look, picked)
        # Who is behind another vehicle does not ask: it would hold the junction that the other one needs.
        if ask >= 0 and not (0 <= leader < vehicles and gap < ahead):
            refused = not _ask(
                net, makes, fleet, gates, v, ask, way, count, frame, table, n, vehicles, offset + ahead, ends
            )

        # What holds the vehicle back: the limit, bends ahead, its stop, a junction it may not enter, the plan's end.
        wanted = min(net.speed[lane] * makes.haste[v], fleet.pace[v])
        cap = wanted
        ahead = net.length[lane] - offset
        stop = goal
        for k in range(fleet.planned[v]):
            if stop < 1e8 or ahead > look:
                break
            following = fleet.plan[v, k]
            if net.zone[following] >= 0 and k >= fleet.granted[v]:
                stop = max(ahead - 0.6, 0.0)
                break
            limit = min(net.speed[following] * makes.haste[v], wanted if line < 0 else fleet.pace[v])
            cap = min(cap, np.sqrt(limit * limit + 2 * _BRAKE * max(ahead, 0.0)))
            if line >= 0 and (fleet.place[v] + k + 1) % size == fleet.goal[v]:
                stop = ahead + fleet.goal_offset[v]
            ahead += net.length[following]
        if line >= 0 and stop > 1e8 and ahead < look:
            stop = max(ahead - 1.0, 0.0)  # the route goes on in the lane beside: wait here for room to change
        fleet.waited[v] = fleet.waited[v] + dt if refused and speed < 1.0 else 0.0
        if stop < 1e8:
            cap = min(cap, np.sqrt(2 * _BRAKE * stop))

        if gap > stop + 3.0:
            gap, leader = 1e9, -1
        leading = 0.0
        rate = makes.acceleration[v] * (1.0 - (speed / max(wanted, 0.1)) ** 4)
        if leader >= 0:
            _, _, c, s = footprint(way, count, frame, offset + gap)
            leading = max(shapes.vx[leader] * c + shapes.vy[leader] * s, 0.0)
            wish = speed * _HEADWAY + speed * (speed - leading) / (2 * np.sqrt(makes.acceleration[v] * _BRAKE))
            rate -= makes.acceleration[v] * ((_JAM_GAP + max(wish, 0.0)) / max(gap, 0.05)) ** 2
        new = max(speed + max(rate, -_HARD_BRAKE) * dt, 0.0)
        if new > cap:
            new = max(cap, speed - _HARD_BRAKE * dt)
        if leader >= 0:
            new = min(new, max(gap - 0.3, 0.0) / dt)
        if stop < 1e8:
            new = min(new, stop / dt)
        move = new * dt if new >= 0.02 else 0.0
        if fleet.planned[v] == 0:
            move = min(move, max(net.length[lane] - offset, 0.0))
        hit = blocked(way, count, frame, offset + move, table, n, TOUCH, TOUCH, 1e9) if move > 0.0 else -1
        if hit >= 0:
            move, leader, gap = 0.0, int(table[hit, 7]), 0.0
        fleet.speed[v] = move / dt
        if backs[v] and move == 0.0 and fleet.granted[v] == 0 and offset > 0.5:
            move = -_REVERSE * dt
            if blocked(way, count, frame, offset + move, table, n, TOUCH, TOUCH, 1e9) >= 0:
                move = 0.0
        if move != 0.0:
            fleet.offset[v] += move
            if fleet.shift[v] != 0.0 and move > 0.0:
                # The front's own metres: `frame` keeps what a point of the way had done when the swerve began.
                fleet.changed[v] += move
            cx, cy, c, s = footprint(way, count, frame, offset + move)
            shapes.vx[v], shapes.vy[v] = (cx - shapes.x[v]) / dt, (cy - shapes.y[v]) / dt
            shapes.x[v], shapes.y[v], shapes.yaw[v] = cx, cy, np.arctan2(s, c)
            if fleet.changed[v] > 14.0 + 2 * length:
                fleet.shift[v] = 0.0
            _advance_lane(net, makes, fleet, v)
        else:
            shapes.vx[v] = shapes.vy[v] = 0.0
        fleet.blocker[v] = leader if gap < 3.0 and fleet.speed[v] < 0.1 else -1
        _release(net, makes, fleet, gates, v)
        fleet.rested[v] += dt
        fleet.still[v] = fleet.still[v] + dt if fleet.speed[v] < 0.1 else 0.0
        if line >= 0:
            if goal < 0.5 and fleet.speed[v] < 0.1:
                fleet.arrived[v] = True
            if fleet.arrived[v]:
                fleet.still[v] = 0.0

        # A full exit is no reason to wait for ever: look for another way.
        if line < 0 and refused and fleet.waited[v] > 15.0 and int(fleet.waited[v] / dt) % 50 == 0:
            fleet.planned[v] = fleet.granted[v]

        # Lane changes: a route that goes on beside, or a queue that the lane beside has not. Only on the lane the
        # way was laid for: a vehicle that has just reached another one can do it a step later.
        if fleet.lane[v] != lane:
            continue
        if line >= 0:
            if not fleet.arrived[v] and fleet.planned[v] == 0:
                beside = net.route[net.route_first[line] + (fleet.place[v] + 1) % size]
                side = beside == net.left[lane] or beside == net.right[lane]
                if side and _change_lane(net, makes, fleet, v, beside, way, count, frame, table, n):
                    fleet.place[v] = (fleet.place[v] + 1) % size
            continue
        queued = 0 <= leader < vehicles and gap < 15.0 and leading < 0.5 * wanted
        if queued and fleet.rested[v] > 6.0 and net.length[lane] - fleet.offset[v] > 18.0:
            mine = _count_on(fleet.lane, lane)
            for beside in (net.left[lane], net.right[lane]):
                open_ = beside >= 0 and not net.closed[beside] and _count_on(fleet.lane, beside) < mine
                if open_ and _change_lane(net, makes, fleet, v, beside, way, count, frame, table, n):
                    break


@njit(cache=True)
def _count_on(lanes, lane):  # type: ignore[no-untyped-def]
    count = 0
    for v in range(len(lanes)):
        count += lanes[v] == lane
    return count


@njit(cache=True)
def streets_count(net, fleet, crowd):  # type: ignore[no-untyped-def]
    """Vehicles on each street (one direction)."""
    crowd[:] = 0
    for v in range(len(fleet.lane)):
        crowd[net.edge[fleet.lane[v]]] += 1


@njit(cache=True)
def place_vehicle(net, makes, fleet, v, lane, offset, shapes, air):  # type: ignore[no-untyped-def]
    """Put v on a lane if it would come nearer than `air` to no other body; True if it now stands there."""
    way = np.empty((256, 3))
    frame = np.empty(7)
    table = np.empty((len(shapes.x), 9))
    nobody = np.empty(0, np.int32)
    count = lay_way(net.first, net.points, net.along, net.length, lane, nobody, nobody, 0, 0.0, net.length[lane], way)
    set_frame(makes, fleet, v, frame)
    frame[4] = 0.0
    cx, cy, c, s = footprint(way, count, frame, offset)
    before = shapes.x[v], shapes.y[v]
    shapes.x[v], shapes.y[v] = cx, cy
    n = gather_near(shapes, v, makes.length[v] + air + 1.0, table)
    for k in range(n):
        if touches(table, k, cx, cy, c, s, makes.length[v] / 2 + air, makes.half_width[v] + 0.3):
            shapes.x[v], shapes.y[v] = before
            return False
    fleet.lane[v], fleet.offset[v], fleet.planned[v], fleet.shift[v] = lane, offset, 0, 0.0
    fleet.trail[v, :] = -1
    fleet.speed[v] = fleet.still[v] = fleet.waited[v] = fleet.rested[v] = fleet.changed[v] = 0.0
    shapes.yaw[v] = np.arctan2(s, c)
    shapes.vx[v] = shapes.vy[v] = 0.0
    return True


@njit(cache=True)
def relocate(net, makes, fleet, gates, shapes, entries, entry_speed, patience):  # type: ignore[no-untyped-def]
    """Bring cars that left the map, or stood still for longer than `patience`, back in where the map begins."""
    for v in range(len(fleet.lane)):
        if makes.line[v] >= 0 or len(entries) == 0:
            continue
        left = fleet.planned[v] == 0 and fleet.offset[v] >= net.length[fleet.lane[v]] - 0.3
        if not left and fleet.still[v] < patience:
            continue
        for _ in range(3):
            entry = entries[min(int(next_random(fleet.random, v) * len(entries)), len(entries) - 1)]
            start = makes.length[v] + 0.2
            if net.length[entry] > start + 1.0 and place_vehicle(net, makes, fleet, v, entry, start, shapes, 4.0):
                release_all(fleet, gates, v)
                fleet.speed[v] = entry_speed if left else 0.0
                if left:
                    fleet.rounds[v] += 1
                else:
                    fleet.rescued[v] += 1
                break
