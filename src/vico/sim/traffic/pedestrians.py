"""Motion of pedestrians: on sidewalks, round each other, over crossings when those are clear.

Each follows a point that runs a little ahead of it along its walkway, on the right-hand side. Of a few headings around
that point it takes the one that leads furthest, and makes no step that would touch another body.

A pedestrian who walks alone stops before a shop window or at a bus stop it passes; two who walk together stop to talk.
At a bus stop one waits until the bus is there, or gives up. A pedestrian who stands leaves the walkway, and comes back.
"""

from __future__ import annotations

import numpy as np

from vico.io.compiled import compiled, inlined
from vico.rules import STAIRS_SPEED
from vico.seeds import rng
from vico.sim.bodies.footprints import search
from vico.sim.traffic.pedestrian_routes import (
    PEDESTRIAN_RADIUS,
    FollowPoint,
    advance_follow_point,
    follow_point,
    goes_wrong_way,
    keep_up,
    leave_crossing,
    note_distance,
    turn_round,
    wait_for_companions,
)
from vico.sim.traffic.shapes import Shapes, disc_touches, distance_to, is_disc, share_level
from vico.sim.traffic.state import CROWD, GAIT_TIME, LED, NONE, STOP, TALK, Records, WalkwayNetwork, next_random

#: Share of those who pass a free spot that take it, and how long they stand, s; by kind of spot.
_CHANCE = np.array([0.0, 0.1, 0.2, 0.25])
_SHORTEST = np.array([0.0, 10.0, 40.0, 420.0])
_LONGEST = np.array([0.0, 45.0, 180.0, 900.0])
#: Share of the spots at stops where somebody waits at the start, and of the pedestrians that do at the most.
_WAITING_AT_START, _MOST_AT_START = 0.5, 0.08
_ROOM = 0.3  # m: a body's radius and a little air
_STANDING_TURN_RATE = 2.5  # rad/s
_MAKES_WAY = 3.0  # s that somebody goes on standing at most whom a vehicle waits for to go
_TOGETHER = 2.0  # m within which two stop together


@compiled
def _is_free(paths, pedestrians, k, shapes, i, first):
    """Return whether nobody stands at spot k or is on the way there, but pedestrian i."""
    for other in range(len(pedestrians)):
        if pedestrians[other].spot == k:
            return False
    spot = paths.spots[k]
    for j in range(len(shapes.x)):
        if j != first + i and abs(shapes.x[j] - spot.x) < 8.0 and disc_touches(spot.x, spot.y, _ROOM, shapes, j):
            return False
    return True


@compiled
def _take_spot(paths, walker, k, seconds):
    """Have somebody go to spot k, to stand there."""
    spot = paths.spots[k]
    walker.spot, walker.stand_kind, walker.stand_time = k, spot.kind, seconds
    walker.stand_xy[0], walker.stand_xy[1], walker.stand_yaw = spot.x, spot.y, spot.yaw


@compiled
def stop_at_spot(paths, pedestrians, i, shapes, first, offset):
    """Have pedestrian i stop at one of the spots it has come past since its walkway's metre `offset`."""
    walker = pedestrians[i]
    way = walker.walkway
    if walker.leader != NONE or walker.goal != NONE or walker.leaving_crossing != NONE or paths.walkways[way].shut:
        return
    low, high = min(offset, walker.offset), max(offset, walker.offset)
    for k in range(paths.spot_first[way], paths.spot_first[way + 1]):
        kind = paths.spots[k].kind
        passes = low < paths.spots[k].offset <= high and walker.group_size == (2 if kind == TALK else 1)
        # Whether it stops is a matter of chance.
        if not passes or next_random(walker) >= _CHANCE[kind] or not _is_free(paths, pedestrians, k, shapes, i, first):
            continue
        seconds = _SHORTEST[kind] + next_random(walker) * (_LONGEST[kind] - _SHORTEST[kind])
        if kind == TALK:
            other = pedestrians[i + 1]
            together = other.walkway == way and walker.apart < _TOGETHER and other.leaving_crossing == NONE
            partner = paths.spots[k].partner
            if not together or not _is_free(paths, pedestrians, partner, shapes, i + 1, first):
                continue
            _take_spot(paths, other, partner, seconds)
        _take_spot(paths, walker, k, seconds)
        return


@compiled
def note_standing(paths, pedestrians, walker, is_there, is_asked, dt):
    """Count the time somebody stands; who has stood long enough walks on, or can't get there, or may not be there.

    So does, before long, who is asked to go: a bus that leaves its stop swings out over the kerb.
    """
    if walker.stand_kind >= LED:
        return
    walker.stand_time -= dt
    if is_asked:
        walker.stand_time = min(walker.stand_time, _MAKES_WAY)
    deserted = walker.stand_kind == TALK and walker.leader != NONE and pedestrians[walker.leader].stand_kind != TALK
    is_over = walker.stand_time <= 0.0 or paths.walkways[walker.walkway].shut
    if is_over or deserted or (not is_there and walker.jammed_time > 6.0):
        walker.spot, walker.stand_kind, walker.stand_time = NONE, 0, 0.0
        walker.jammed_time = walker.stuck_time = 0.0


@compiled
def _turn_towards(shapes, b, yaw, rate, dt):
    """Turn body b towards a heading, by `rate` rad/s at most; return by how much its own differed, rad."""
    turn = (yaw - shapes.yaw[b] + np.pi) % (2 * np.pi) - np.pi
    shapes.yaw[b] += min(max(turn, -rate * dt), rate * dt)
    return turn


def stand_at_start(paths: WalkwayNetwork, walkers: Records, shapes: Shapes, first: int, seed: int) -> None:
    """Have some of those who walk alone wait at bus stops when a run begins; their bodies begin at `first`."""
    random = rng(seed, "traffic", "standing")
    alone = np.flatnonzero((walkers["group_size"] == 1) & (walkers["goal"] == NONE))
    spots = np.flatnonzero(paths.spots["kind"] == STOP)
    spots = spots[random.random(len(spots)) < _WAITING_AT_START]
    count = min(len(spots), int(_MOST_AT_START * len(walkers)), len(alone))
    chosen = random.permutation(spots)[:count]
    for i, k in zip(random.permutation(alone)[:count].tolist(), chosen.tolist(), strict=True):
        spot, walker, b = paths.spots[k], walkers[i], first + i
        x, y = float(spot["x"]), float(spot["y"])
        if any(disc_touches(x, y, _ROOM, shapes, j) for j in range(len(shapes.x)) if j != b):
            continue
        shapes.x[b], shapes.y[b], shapes.yaw[b] = x, y, spot["yaw"]
        walker["walkway"], walker["offset"] = spot["walkway"], spot["offset"]
        walker["spot"], walker["stand_kind"], walker["stand_time"] = (
            k,
            STOP,
            random.uniform(_SHORTEST[STOP], _LONGEST[STOP]),
        )
        walker["stand_xy"], walker["stand_yaw"], walker["progress_xy"] = (x, y), spot["yaw"], (x, y)


_SIGHT = 2.2  # how far ahead others are avoided, m
_TOUCH, _LEAST_GAP = 0.03, 0.005  # no step leaves less, m; the second towards whom one walks away from
_ASKED_AFTER = 1.5  # a vehicle that has stood so long before somebody is waiting for them to go, s
_JAMMED_AFTER = 6.0  # who has got nowhere for so long squeezes past, s
_GAP, _GAP_WHEN_JAMMED = 0.1, 0.04  # kept from others, m
#: Headings tried, relative to that of the point; the first so many unless nothing has helped for a while.
_ANGLES = np.array([0.0, -0.35, 0.35, -0.7, 0.7, -1.1, 1.1, -1.6, 1.6, -2.3, 2.3, 3.1])
_FORWARD = 9
_LET_GO_AFTER = 5.0  # s after which companions of who gets nowhere go their own ways: they may be in the way
_MAKES_ROOM_AFTER = 10.0  # s after which who is led goes its own way, away from a vehicle that it is in the way of
_TURN_RATE = 4.0  # rad/s
_KEEPS_ON = 0.3  # how much the heading counts that one has already, as metres free: ways round somebody are kept to
_TURNS_FIRST = (
    0.5,
    1.5,
)  # rad from where one looks to where one goes: slower from the first on, on the spot from the second
_LEAST_STEP, _FIRST_STEP = 0.004, 0.04  # m
_ACCELERATION = 4.0  # m/s2 with which one sets out
_SETS_OUT = 0.2  # m that have to be free for who stands to set out
_STRIDE_AHEAD = 0.4  # m ahead where a heading is tested against the walkway's sides
_PROGRESS = 1.0  # who is farther from where it was has got on, m
_STUCK_AFTER, _STUCK_SPREAD = 3.5, 3.0  # s without progress before turning round, and how much that varies
_WAITS_BELOW = 0.3  # who walks at less than this share of its pace waits for somebody
_SLOWS_WITHIN = 1.2  # m from its place
_STANDS_WITHIN = 0.2  # m from where it is to stand


@inlined
def _nearby(shapes, grid, b, buffer):
    """Return the indices of the bodies that body b, a walker, may meet."""
    x, y = shapes.x[b], shapes.y[b]
    n = 0
    for j in search(grid, x, y, _SIGHT + 1.0, buffer):
        dx, dy = shapes.x[j] - x, shapes.y[j] - y
        r = _SIGHT + 1.0 + shapes.half_length[j] + shapes.half_width[j]
        if j != b and dx * dx + dy * dy < r * r and share_level(shapes, b, j):
            buffer[n] = j
            n += 1
    return buffer[:n]


@compiled
def _leads_off(x, y, c, s, shapes, j):
    """Return whether a first step along a heading comes no nearer to somebody than one may be, or away from them."""
    tx, ty = x + c * _FIRST_STEP, y + s * _FIRST_STEP
    if not disc_touches(tx, ty, PEDESTRIAN_RADIUS + _TOUCH, shapes, j):
        return True
    return distance_to(tx, ty, shapes, j) > distance_to(x, y, shapes, j)


@inlined
def _free_distance(x, y, c, s, shapes, near, gap):
    """Return the metres a walker can go along a heading before it touches somebody, at most `_SIGHT`."""
    free = _SIGHT
    for j in near:
        dx, dy = shapes.x[j] - x, shapes.y[j] - y
        if is_disc(shapes, j):
            reach = PEDESTRIAN_RADIUS + shapes.half_length[j] + gap
            ahead = dx * c + dy * s
            if ahead <= 0.0:
                continue
            aside2 = dx * dx + dy * dy - ahead * ahead
            if aside2 < reach * reach:
                free = min(free, max(ahead - np.sqrt(reach * reach - aside2), 0.0))
        else:
            # Beside somebody whom it all but touches a step nearer is refused, however free it is beyond.
            if not _leads_off(x, y, c, s, shapes, j):
                return 0.0
            d = 0.25
            while d < free:
                if disc_touches(x + c * d, y + s * d, PEDESTRIAN_RADIUS + gap, shapes, j):
                    free = min(free, d - 0.25)
                d += 0.25
    return free


@inlined
def best_heading(x, y, point, shapes, near, is_jammed, facing):
    """Return the heading (rad) that leads furthest towards the followed point, and the metres free along it.

    Of headings that are about as good it is the one nearest to where the walker looks (`facing`, rad): who goes round
    somebody keeps to one side. Headings that lead off the walkway count only on the way back onto it; who is jammed may
    step off the kerb.
    """
    gap = _GAP_WHEN_JAMMED if is_jammed else _GAP
    straight = np.arctan2(point.y - y, point.x - x)
    aside = (x - point.centre_x) * point.left_x + (y - point.centre_y) * point.left_y
    left = point.room[2] if is_jammed else point.room[0]
    right = point.room[3] if is_jammed else point.room[1]
    best, best_score, best_free = 0.0, -np.inf, 0.0
    ease = 1.2 if is_jammed else 0.35
    for k in range(len(_ANGLES) if is_jammed else _FORWARD):
        angle = straight + _ANGLES[k]
        habit = _KEEPS_ON * np.cos(angle - facing) - 0.01 * k
        if _SIGHT * (ease + np.cos(_ANGLES[k])) + habit <= best_score:
            continue  # not even if all of it were free
        c, s = np.cos(angle), np.sin(angle)
        there = aside + _STRIDE_AHEAD * (c * point.left_x + s * point.left_y)
        most = left if there > 0.0 else right
        if k > 0 and abs(there) > most + 0.1 and abs(there) >= abs(aside):
            continue
        free = _free_distance(x, y, c, s, shapes, near, gap)
        score = free * (ease + np.cos(_ANGLES[k])) + habit
        if score > best_score:
            best, best_score, best_free = angle, score, free
    return best, best_free


@compiled
def may_step_to(tx, ty, x, y, shapes, near):
    """Return whether a walker at (x, y) may stand at (tx, ty); who is too near already may go away from the other."""
    for j in near:
        if disc_touches(tx, ty, PEDESTRIAN_RADIUS + _TOUCH, shapes, j):
            is_leaving = distance_to(tx, ty, shapes, j) > distance_to(x, y, shapes, j)
            if not is_leaving or disc_touches(tx, ty, PEDESTRIAN_RADIUS + _LEAST_GAP, shapes, j):
                return False
    return True


@inlined
def _walk(walker, point, shapes, b, near, is_waiting, time):
    """Take a pedestrian, body b, a step towards a point; return the metres walked.

    `time` is the share of its pace at which it walks, and the seconds that pass. Who goes another way than it looks
    turns first: feet would slide.
    """
    pace, dt = time
    x, y = shapes.x[b], shapes.y[b]
    dx, dy = point.x - x, point.y - y
    away = np.sqrt(dx * dx + dy * dy)
    if (is_waiting and away < 0.2) or away <= 1e-6:
        return 0.0
    is_jammed = walker.jammed_time > _JAMMED_AFTER
    heading, free = best_heading(x, y, point, shapes, near, is_jammed, shapes.yaw[b])
    if walker.gait_time < 0.0 and free < _SETS_OUT and not is_jammed:
        return 0.0
    speed = min(walker.preferred_speed * pace * min(1.0, free / 0.6), walker.speed + _ACCELERATION * dt)
    if speed * dt <= _LEAST_STEP:
        return 0.0
    turn = _turn_towards(shapes, b, heading, _TURN_RATE, dt)
    slow, still = _TURNS_FIRST
    speed *= min(max((still - abs(turn)) / (still - slow), 0.0), 1.0)
    step = min(speed * dt, away if is_waiting else speed * dt)
    tx, ty = x + np.cos(heading) * step, y + np.sin(heading) * step
    if step <= _LEAST_STEP or not may_step_to(tx, ty, x, y, shapes, near):
        return 0.0
    shapes.x[b], shapes.y[b] = tx, ty
    shapes.vx[b], shapes.vy[b] = (tx - x) / dt, (ty - y) / dt
    return step


@compiled
def _note_progress(paths, walker, x, y, is_waiting, dt):
    """Turn round who gets nowhere, on the spot or to and fro."""
    ex, ey = x - walker.progress_xy[0], y - walker.progress_xy[1]
    if is_waiting or ex * ex + ey * ey > _PROGRESS:
        walker.progress_xy[0], walker.progress_xy[1] = x, y
        walker.stuck_time = walker.jammed_time = 0.0
        return
    walker.stuck_time += dt
    walker.jammed_time += dt
    over = walker.stuck_time - _STUCK_AFTER
    if walker.leader == NONE and walker.stuck_time > _STUCK_AFTER and over > _STUCK_SPREAD * next_random(walker):
        turn_round(paths, walker, x, y)


@compiled
def _note_gait(walker, is_walking, dt):
    """Count the time since somebody set out, upward, or stopped, downward."""
    if is_walking and walker.gait_time < 0.0:
        walker.gait_time, walker.set_out, walker.tread_cycles = 0.0, walker.distance_walked, 0.0
    elif not is_walking and walker.gait_time > 0.0:
        walker.gait_time = 0.0
    walker.gait_time = min(max(walker.gait_time + (dt if is_walking else -dt), -GAIT_TIME), GAIT_TIME)


@compiled
def _note_treads(walker, tread, dt):
    """Note that somebody comes to stairs, or from them, and how far in its gait it is."""
    walker.tread_time = min(walker.tread_time + dt, GAIT_TIME)
    if tread != walker.tread:
        walker.tread_before, walker.tread, walker.tread_time = walker.tread, tread, 0.0
        walker.change_walked = walker.distance_walked - walker.set_out
        walker.change_cycles = walker.tread_cycles


@compiled
def asked_to_go(fleet, first, pedestrians):
    """Return which walkers, bodies from `first` on, a vehicle or a tram stands before, waiting for them to go.

    Those who lead them are among them: companions go where they do.
    """
    asked = pedestrians["before_tram"].copy()
    for vehicle in fleet:
        if first <= vehicle.blocker < first + len(pedestrians) and vehicle.stopped_time > _ASKED_AFTER:
            asked[vehicle.blocker - first] = True
    for i in range(len(pedestrians)):
        if asked[i] and pedestrians[i].leader != NONE:
            asked[pedestrians[i].leader] = True
    return asked


@compiled
def _group_pace(paths, pedestrians, i, shapes, near, first, dt):
    """Have one of a group stay with the others; return the share of its pace at which it walks for that."""
    walker = pedestrians[i]
    note_distance(pedestrians, i, shapes, first)
    if walker.leader == NONE:
        return wait_for_companions(paths, walker, dt)
    leader, b = pedestrians[walker.leader], first + i
    if goes_wrong_way(paths, walker, leader):
        turn_round(paths, walker, shapes.x[b], shapes.y[b])
    point = follow_point(paths, walker)
    heading = point.left_y * walker.direction, -point.left_x * walker.direction
    half = max((point.room[0] + point.room[1]) / 2, 0.05)
    return keep_up(walker, leader, shapes, (b, first + walker.leader), near, heading, half, dt)


@inlined
def _go_to_spot(paths, pedestrians, i, shapes, b, near, is_asked, time):
    """Take who is to stand a step to where it stands, or turn it there; return the metres walked."""
    walker, dt = pedestrians[i], time[1]
    x, y = walker.stand_xy
    is_there = (x - shapes.x[b]) ** 2 + (y - shapes.y[b]) ** 2 < _STANDS_WITHIN**2
    if walker.group_size > 1:
        note_distance(pedestrians, i, shapes, b - i)
    step = 0.0
    if is_there:
        _turn_towards(shapes, b, walker.stand_yaw, _STANDING_TURN_RATE, dt)
    else:
        # Sides of walkways do not count. In a crowd one slows down towards one's place, or goes on with a march.
        if walker.stand_kind == CROWD:
            away = np.sqrt((x - shapes.x[b]) ** 2 + (y - shapes.y[b]) ** 2)
            time = (time[0] * min(1.0, away / _SLOWS_WITHIN), dt)
        step = _walk(walker, FollowPoint(x, y, x, y, 0.0, 0.0, (0.0, 0.0, 0.0, 0.0)), shapes, b, near, True, time)
    _note_progress(paths, walker, shapes.x[b], shapes.y[b], is_there, dt)
    note_standing(paths, pedestrians, walker, is_there, is_asked, dt)
    return step


@inlined
def _go_along(paths, pedestrians, junctions, shapes, who, near, is_asked, time):
    """Take a pedestrian, by its row and its body in `who`, a step along its walkway; return the metres walked."""
    (i, b), (pace, dt) = who, time
    walker = pedestrians[i]
    x, y = shapes.x[b], shapes.y[b]
    led_by = walker.leader
    leader = pedestrians[i if led_by == NONE else led_by]
    # A vehicle may stand between it and who leads it, and wait for it to go: then it makes room for that one first.
    is_in_way = is_asked and walker.jammed_time > _MAKES_ROOM_AFTER
    is_let_go = leader.jammed_time > _LET_GO_AFTER or is_in_way
    if is_let_go:
        walker.leader = NONE  # in this step it goes its own way
    is_alone = walker.group_size == 1 or is_let_go
    share = 1.0 if is_alone else _group_pace(paths, pedestrians, i, shapes, near, b - i, dt)
    if is_asked:
        share = max(share, 1.0)
    walkway, offset = walker.walkway, walker.offset
    is_waiting = advance_follow_point(paths, walker, leader, junctions, is_asked, x, y, dt)
    leave_crossing(paths, walker, junctions, x, y)
    if is_asked and walker.stuck_time > 2.5:
        turn_round(paths, walker, x, y)  # it waits for us, and is in our way
    elif led_by == NONE and walker.walkway == walkway and walker.offset != offset:
        stop_at_spot(paths, pedestrians, i, shapes, b - i, offset)
    step = _walk(walker, follow_point(paths, walker), shapes, b, near, is_waiting, (pace * share, dt))
    _note_progress(paths, walker, shapes.x[b], shapes.y[b], is_waiting or share < _WAITS_BELOW, dt)
    walker.leader = led_by
    return step


@compiled
def advance_pedestrians(paths, pedestrians, junctions, fleet, shapes, grid, on, dt):
    """Advance all pedestrians by `dt` seconds; their bodies follow those of the vehicles in `shapes`, and in `grid`.

    They walk `on` what is below them: at so many times the speed each prefers, on treads so deep, metres, ``(n,)``.
    """
    pace, treads = on
    first = len(fleet)
    asked = asked_to_go(fleet, first, pedestrians)
    buffer = np.empty(len(shapes.x), np.int64)
    junctions.walker_wait[:] = 0.0
    for i in range(len(pedestrians)):
        walker = pedestrians[i]
        if walker.aboard != NONE:
            continue
        b = first + i
        near = _nearby(shapes, grid, b, buffer)
        _note_treads(walker, treads[i], dt)
        own_pace = pace if treads[i] == 0.0 else min(pace, STAIRS_SPEED / walker.preferred_speed)
        if walker.stand_kind != 0:
            step = _go_to_spot(paths, pedestrians, i, shapes, b, near, asked[i], (own_pace, dt))
        else:
            step = _go_along(paths, pedestrians, junctions, shapes, (i, b), near, asked[i], (own_pace, dt))
        if step == 0.0:
            shapes.vx[b] = shapes.vy[b] = 0.0
        walker.speed = step / dt
        _note_gait(walker, step > 0.0, dt)
        walker.distance_walked += step
        if walker.tread > 0.0:
            walker.set_out += step
            walker.tread_cycles += step / (2.0 * walker.tread)


@compiled
def place_pedestrian(paths, pedestrians, i, walkway, offset, direction, shapes, b):
    """Put pedestrian i, body b, on a walkway if nobody is within half a metre; True if it now stands there."""
    walker = pedestrians[i]
    walker.walkway, walker.offset, walker.direction = walkway, offset, direction
    point = follow_point(paths, walker)
    for j in range(len(shapes.x)):
        if j != b and share_level(shapes, b, j) and disc_touches(point.x, point.y, PEDESTRIAN_RADIUS + 0.5, shapes, j):
            return False
    shapes.x[b], shapes.y[b] = point.x, point.y
    along = np.arctan2(point.left_y, point.left_x)
    shapes.yaw[b] = along - np.pi / 2 if direction > 0 else along + np.pi / 2
    return True
