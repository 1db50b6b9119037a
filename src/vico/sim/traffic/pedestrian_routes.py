"""Routes of pedestrians: the next walkway, the point they follow, right of way at crossings, walking groups.

At a crossing either vehicles or pedestrians go first (`yields_to_pedestrians`, `must_wait_at_crossing`). Vehicles wait
for a pedestrian until it is off the crossing that it walked over.

One pedestrian of each group decides the way; its companions keep beside or behind it. Companions follow each other in
the order of pedestrians: after the one that leads come the others of its group.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vico.io.compiled import compiled
from vico.seeds import rng
from vico.sim.traffic.path import project_on_polyline
from vico.sim.traffic.shapes import is_disc
from vico.sim.traffic.state import AMBER, APPROACHING, NONE, PRESENT, PREVIOUS_LANES, Records, next_random
from vico.world.lanes import lane_pose
from vico.world.walkways import CORNER as _CORNER_KIND
from vico.world.walkways import CROSSING as _CROSSING_KIND

_CAR_PATIENCE = 10.0  # s that cars let pedestrians go first at a crossing
_CALLED_AFTER = 4.0  # s that a pedestrian has waited before cars let it go first
_BUSY_WHILE = 5.0  # s that a vehicle which stands before its junction still counts on crossings


@compiled
def yields_to_pedestrians(net, junctions, vehicle, lane):
    """Return whether pedestrians on a crossing of `lane` go first; they are told how long the vehicle has waited."""
    yields = False
    for o in range(net.lanes[lane].first_crossing, net.lanes[lane].end_crossing):
        crossing = net.crossings[o]
        called = junctions.walker_wait[crossing] > _CALLED_AFTER and vehicle.junction_wait < _CAR_PATIENCE
        if junctions.walkers_on[crossing] > 0 or called:
            yields = True
            if vehicle.junction_wait > junctions.vehicle_wait[crossing]:
                junctions.vehicle_wait[crossing] = vehicle.junction_wait
    return yields


@compiled
def _mark_crossings(net, junctions, lane, rear):
    """Mark the crossings of a lane that a vehicle with its rear at `rear` metres along it has not passed."""
    for o in range(net.lanes[lane].first_crossing, net.lanes[lane].end_crossing):
        if rear < net.crossings_cleared[o]:
            junctions.crossing_busy[net.crossings[o]] = True


@compiled
def mark_busy_crossings(net, fleet, junctions):
    """Mark the crossings that a vehicle is on or has been let over.

    One that stands before its junction does not count; one that stands in it does, so that it gets out of it.
    """
    junctions.crossing_busy[:] = False
    for vehicle in fleet:
        if vehicle.presence != PRESENT or (vehicle.stopping > APPROACHING and vehicle.way_offset >= 0.0):
            continue
        rear = vehicle.offset - vehicle.length
        _mark_crossings(net, junctions, vehicle.lane, rear)
        k = 0
        while rear < 0.0 and k < PREVIOUS_LANES and vehicle.previous_lanes[k] != NONE:
            lane = vehicle.previous_lanes[k]
            rear += net.lanes[lane].length
            _mark_crossings(net, junctions, lane, rear)
            k += 1
        if vehicle.stopped_time > _BUSY_WHILE and net.lanes[vehicle.lane].junction < 0:
            continue
        for k in range(vehicle.granted_count):
            _mark_crossings(net, junctions, vehicle.planned_lanes[k], -np.inf)


class FollowPoint(NamedTuple):
    """The point a pedestrian follows, that beside it on the walkway's centre line, and the unit vector to the left.

    `room` is how far to the left and to the right of the centre line it may be there, and may be to get past somebody.
    """

    x: float
    y: float
    centre_x: float
    centre_y: float
    left_x: float
    left_y: float
    room: tuple[float, float, float, float]


@compiled
def room_at(paths, walkway, offset):
    """Return how far to each side of a walkway a walker may be so many metres along it: a row of `room`."""
    a, b = paths.first[walkway], paths.first[walkway + 1] - 1
    while b - a > 1:
        middle = (a + b) // 2
        if paths.along[middle] <= offset:
            a = middle
        else:
            b = middle
    return paths.room[a, 0], paths.room[a, 1], paths.room[a, 2], paths.room[a, 3]


@compiled
def follow_point(paths, walker):
    """Return the point a pedestrian follows."""
    walkway = walker.walkway
    offset = min(max(walker.offset, 0.0), paths.walkways[walkway].length)
    x, y, yaw = lane_pose(paths.first, paths.points, paths.along, walkway, offset)
    nx, ny = -np.sin(yaw), np.cos(yaw)
    room = room_at(paths, walkway, offset)
    left, right = room[0], room[1]
    aside = (left - right) / 2 - walker.direction * walker.lateral_share * (left + right) / 2
    return FollowPoint(x + nx * aside, y + ny * aside, x, y, nx, ny, room)


#: Of a pedestrian's body, m.
PEDESTRIAN_RADIUS = 0.25
_OFF_CROSSING = 1.3  # m walked after which the body is off the crossing
_AT_END = 0.3  # m from the end of a crossing from which on one stands at the kerb


@compiled
def project_on_walkway(paths, walkway, x, y):
    """Return the metres along a walkway of its point nearest to (x, y), and how far left of it that is."""
    begin, end = paths.first[walkway], paths.first[walkway + 1]
    return project_on_polyline(paths.points, paths.along, begin, end, x, y)


@compiled
def _is_off_crossing(paths, crossing, x, y):
    """Return whether (x, y) is at an end of a crossing, or beside it."""
    along, aside = project_on_walkway(paths, crossing, x, y)
    way = paths.walkways[crossing]
    is_at_end = min(along, way.length - along) < _AT_END
    room = room_at(paths, crossing, along)
    return is_at_end or not -room[3] - PEDESTRIAN_RADIUS < aside < room[2] + PEDESTRIAN_RADIUS


@compiled
def _metres_beyond(paths, end, before, x, y):
    """Return how far (x, y) is beyond the line's point number `end`, as seen from the one `before`."""
    dx, dy = paths.points[end, 0] - paths.points[before, 0], paths.points[end, 1] - paths.points[before, 1]
    along = (x - paths.points[end, 0]) * dx + (y - paths.points[end, 1]) * dy
    return along / np.sqrt(dx * dx + dy * dy)


@compiled
def _is_past_end(paths, crossing, x, y):
    """Return whether who is at (x, y) is beyond an end of a crossing, clear of it."""
    first, last = paths.first[crossing], paths.first[crossing + 1] - 1
    return (
        max(_metres_beyond(paths, first, first + 1, x, y), _metres_beyond(paths, last, last - 1, x, y))
        > PEDESTRIAN_RADIUS
    )


@compiled
def leave_crossing(paths, walker, junctions, x, y):
    """Note who is off the crossing it was on: the metres alone do not tell, as one may walk to and fro there.

    Nor is who stands beyond its end on it: vehicles would wait for a companion who waits there for them.
    """
    left = walker.leaving_crossing
    if left < 0:
        return
    has_walked = walker.distance_walked - walker.leaving_since > _OFF_CROSSING
    if (has_walked or _is_past_end(paths, left, x, y)) and _is_off_crossing(paths, left, x, y):
        junctions.walkers_on[left] -= 1
        walker.leaving_crossing = NONE


_GROUPS, _OF_THREE = 0.182, 0.25  # share of groups among those who walk alone and groups; of threes among groups
_PACES, _SHARES = (1.0, 1.3), (0.6, 0.95)  # m/s that groups prefer; how far right who leads walks, as `lateral_share`
_BESIDE, _BEHIND = 0.7, 0.8  # m between two who walk side by side, or one behind the other
_LEFT_OF_MIDDLE = 0.3  # companions walk side by side no farther left than this share of the room there
_ROOM_CHANGE = 0.6  # m/s to the side, from beside to behind and back
_COMES_WITHIN, _COMES_BESIDE = 3.2, 1.1  # m ahead and to the side where somebody who comes is let pass
_LET_PASS = 2.0  # s that companions stay one behind the other for them
_FOLLOWS_AT = 0.75  # m kept to one of the group ahead
_FOLLOWS_WITHIN = 1.3  # m ahead that one is looked for ...
_FOLLOWS_BESIDE = 0.5  # ... and m to the side
_CATCH_UP, _FASTEST = 0.8, 1.4  # share of one's pace for each metre one is behind, and the most
_TOGETHER, _PARTED = 2.0, 3.0  # m: who leads slows down from the first on and stands from the second on
_PARTED_LONG = 120.0  # s after which it goes on


def choose_companions(walkers: Records, first: int, seed: int) -> None:
    """Have about a third of the pedestrians from `first` on walk in twos and threes."""
    random = rng(seed, "traffic", "companions")
    i = first
    while i < len(walkers):
        size = 1 if random.random() >= _GROUPS else 3 if random.random() < _OF_THREE else 2
        pace, share = random.uniform(*_PACES), random.uniform(*_SHARES)
        size = min(size, len(walkers) - i)
        if size > 1:
            group = walkers[i : i + size]
            group["group_size"], group["group_place"] = size, np.arange(size)
            group["leader"][1:] = i
            group["preferred_speed"], group["lateral_share"] = pace, share
        i += size


def leave_group(walkers: Records, i: int) -> None:
    """Have a pedestrian, and those of its group who come after it, walk alone."""
    leader, place = int(walkers["leader"][i]), int(walkers["group_place"][i])
    rest = walkers[i : leader + int(walkers["group_size"][i])]
    walkers["group_size"][leader:i] = place
    rest["leader"], rest["group_size"], rest["group_place"] = NONE, 1, 0


@compiled
def _hops_to(paths, node, goal):
    """Return how many walkways lie between a meeting point and a walkway: 0, 1, or 2 for more."""
    a, b = paths.walkways[goal].start, paths.walkways[goal].end
    if node in (a, b):
        return 0
    for k in range(paths.meeting_first[node], paths.meeting_first[node + 1]):
        way = paths.walkways[paths.meeting[k]]
        if not way.shut and way.start + way.end - node in (a, b):
            return 1
    return 2


@compiled
def _away(paths, walkway, node, x, y):
    """Return how far the end of a walkway at a meeting point is from (x, y), metres."""
    p = paths.first[walkway] if paths.walkways[walkway].start == node else paths.first[walkway + 1] - 1
    return np.sqrt((paths.points[p, 0] - x) ** 2 + (paths.points[p, 1] - y) ** 2)


@compiled
def walkway_to_leader(paths, walker, leader, node):
    """Return the walkway at a meeting point that leads to who leads the walker, `NONE` while that one has yet to come.

    Whose way is more than two walkways long goes as the crow flies.
    """
    if walker.walkway == leader.walkway:
        return NONE
    best, least = NONE, np.inf
    x, y = leader.progress_xy
    for k in range(paths.meeting_first[node], paths.meeting_first[node + 1]):
        option = paths.meeting[k]
        if option == leader.walkway:
            return option
        way = paths.walkways[option]
        if option == walker.walkway or way.shut:
            continue
        far = way.start + way.end - node
        hops = _hops_to(paths, far, leader.walkway)
        cost = hops * 1000.0 + (_away(paths, option, far, x, y) if hops == 2 else way.length)
        if cost < least:
            best, least = option, cost
    return best


@compiled
def goes_wrong_way(paths, walker, leader):
    """Return whether a companion goes away from who leads it, or against that one's direction on the same walkway."""
    if walker.walkway == leader.walkway:
        return walker.direction != leader.direction
    way = paths.walkways[walker.walkway]
    ahead, behind = (way.end, way.start) if walker.direction > 0 else (way.start, way.end)
    there, back = _hops_to(paths, ahead, leader.walkway), _hops_to(paths, behind, leader.walkway)
    if there == back == 2:
        x, y = leader.progress_xy
        return _away(paths, walker.walkway, behind, x, y) + 2.0 < _away(paths, walker.walkway, ahead, x, y)
    return back < there


@compiled
def _somebody_comes(shapes, b, near, group, hx, hy):
    """Return whether somebody who is not of the group (bodies from `group[0]` to before `group[1]`) is in the way."""
    for j in near:
        if group[0] <= j < group[1] or not is_disc(shapes, j):
            continue
        dx, dy = shapes.x[j] - shapes.x[b], shapes.y[j] - shapes.y[b]
        ahead, aside = dx * hx + dy * hy, dy * hx - dx * hy
        stands = shapes.vx[j] * hx + shapes.vy[j] * hy < 0.3
        if stands and 0.0 < ahead < _COMES_WITHIN and abs(aside) < _COMES_BESIDE:
            return True
    return False


@compiled
def keep_up(walker, leader, shapes, bodies, near, heading, half, dt):
    """Have a companion walk beside who leads it, or behind; return the share of its pace at which it stays with it.

    Parameters
    ----------
    bodies
        Of the walker, and of who leads it.
    heading
        Unit vector along the walkway, the way they go.
    half
        Half the room there is across the walkway, metres.
    """
    b, first = bodies
    hx, hy = heading
    if _somebody_comes(shapes, b, near, (first, first + walker.group_size), hx, hy):
        walker.in_file = _LET_PASS
    walker.in_file = max(walker.in_file - dt, 0.0)
    beside = leader.lateral_share - walker.group_place * _BESIDE / half
    is_beside = walker.in_file == 0.0 and beside >= -_LEFT_OF_MIDDLE
    change = (beside if is_beside else leader.lateral_share) - walker.lateral_share
    most = _ROOM_CHANGE * dt / half
    walker.lateral_share = min(max(walker.lateral_share + min(max(change, -most), most), -1.0), 1.0)
    lag = 0.0 if is_beside else _BEHIND * walker.group_place
    dx, dy = shapes.x[first] - shapes.x[b], shapes.y[first] - shapes.y[b]
    if walker.walkway == leader.walkway:
        behind = dx * hx + dy * hy
        if walker.apart > _TOGETHER:
            # Round a corner who leads may be ahead on the way and yet not the way one looks.
            behind = max(behind, (leader.offset - walker.offset) * walker.direction)
        behind -= lag
    else:
        behind = walker.apart - max(lag, _BESIDE)
    share = leader.speed / walker.preferred_speed + _CATCH_UP * behind
    return min(max(min(share, _share_behind(walker, shapes, b, first, heading)), 0.0), _FASTEST)


@compiled
def _share_behind(walker, shapes, b, first, heading):
    """Return the share of its pace at which a companion comes no nearer to one of its group who walks before it.

    Whatever their order: nobody pushes past the others.
    """
    hx, hy = heading
    share = _FASTEST
    for j in range(first, first + walker.group_size):
        dx, dy = shapes.x[j] - shapes.x[b], shapes.y[j] - shapes.y[b]
        ahead, aside = dx * hx + dy * hy, abs(dy * hx - dx * hy)
        if j != b and 0.0 < ahead < _FOLLOWS_WITHIN and aside < _FOLLOWS_BESIDE:
            along = shapes.vx[j] * hx + shapes.vy[j] * hy
            share = min(share, along / walker.preferred_speed + _CATCH_UP * (ahead - _FOLLOWS_AT))
    return share


@compiled
def wait_for_companions(paths, walker, dt):
    """Return the share of its pace at which who leads a group goes on: off crossings it waits for those behind."""
    walker.parted_time = walker.parted_time + dt if walker.apart > _TOGETHER else 0.0
    is_on_crossing = paths.walkways[walker.walkway].kind == _CROSSING or walker.leaving_crossing != NONE
    if is_on_crossing or walker.parted_time > _PARTED_LONG:
        return 1.0
    return min(max((_PARTED - walker.apart) / (_PARTED - _TOGETHER), 0.0), 1.0)


@compiled
def waits_for_companions(walker):
    """Return whether who leads a group waits before a crossing until all are there."""
    return walker.leader == NONE and walker.apart > _TOGETHER and walker.parted_time < _PARTED_LONG


@compiled
def _is_ahead(walker, other):
    """Return whether `other` is farther along the walkway on which a pedestrian walks the same way."""
    goes_along = other.walkway == walker.walkway and other.direction == walker.direction
    return goes_along and (other.offset - walker.offset) * walker.direction > 0.0


@compiled
def note_distance(pedestrians, i, shapes, first):
    """Note how far a pedestrian is from who leads it, or from the farthest of those whom it leads.

    Who is ahead of who leads does not count: both would wait for the other one.
    """
    walker = pedestrians[i]
    leads = walker.leader == NONE
    begin, end = (i + 1, i + walker.group_size) if leads else (walker.leader, walker.leader + 1)
    walker.apart = 0.0
    for k in range(first + begin, first + end):
        if leads and _is_ahead(walker, pedestrians[k - first]):
            continue
        dx, dy = shapes.x[k] - shapes.x[first + i], shapes.y[k] - shapes.y[first + i]
        walker.apart = max(walker.apart, np.sqrt(dx * dx + dy * dy))


_LEAD, _LEAD_WHEN_HINDERED = 0.7, 2.0  # how far ahead the point runs, m: past a vehicle that stands on it
_HINDERED_AFTER = 3.0  # who has got nowhere for so long looks that far ahead, s
_CARS_FIRST_AFTER, _CARS_FIRST_UNTIL = 10.0, 12.0  # s waited by a car that goes first then, and by the pedestrian
_LEFT_BEHIND = 15.0  # s after which a companion whose leader has crossed crosses, too
_GIVE_UP_CROSSING = 20.0  # s waited for a crossing before turning round ...
_GIVE_UP_SPREAD = 10.0  # ... and s more by `lateral_share`
_CORNER, _CROSSING = int(_CORNER_KIND), int(_CROSSING_KIND)


@compiled
def turn_round(paths, walker, x, y):
    """Go the other way from here on: the followed point comes back to where the walker is, or it would lead on."""
    walker.direction = -walker.direction
    walker.offset, _ = project_on_walkway(paths, walker.walkway, x, y)
    walker.crossing_wait = walker.stuck_time = 0.0


@compiled
def _is_crossing_at(paths, node):
    """Return whether a crossing begins at a meeting point."""
    for m in range(paths.meeting_first[node], paths.meeting_first[node + 1]):
        if paths.walkways[paths.meeting[m]].kind == _CROSSING:
            return True
    return False


@compiled
def _choice_weight(paths, here, option, node):
    """Return how likely a walkway is taken at a meeting point: crossings less often, 0 for never."""
    is_corner = paths.walkways[option].kind == _CORNER
    if option == here or paths.walkways[option].shut or (is_corner and paths.walkways[here].kind == _CORNER):
        return 0.0
    far = paths.walkways[option].start + paths.walkways[option].end - node
    return 0.5 if is_corner and _is_crossing_at(paths, far) else 1.0


@compiled
def _walkway_to_goal(paths, walker, node):
    """Return the walkway at a meeting point that leads to a pedestrian's goal the shortest way, `NONE` for none."""
    best, least = NONE, np.inf
    for k in range(paths.meeting_first[node], paths.meeting_first[node + 1]):
        option = paths.meeting[k]
        if option == walker.walkway or paths.walkways[option].shut:
            continue
        far = paths.walkways[option].start + paths.walkways[option].end - node
        away = paths.walkways[option].length + paths.goal_away[walker.goal, far]
        if option == paths.goal_walkway[walker.goal]:
            away = 0.0
        if away < least:
            best, least = option, away
    return best


@compiled
def choose_next_walkway(paths, walker, node):
    """Return where a pedestrian goes on at a meeting point, `NONE` for nowhere."""
    if walker.goal != NONE:
        return _walkway_to_goal(paths, walker, node)
    here = walker.walkway
    total = 0.0
    for k in range(paths.meeting_first[node], paths.meeting_first[node + 1]):
        total += _choice_weight(paths, here, paths.meeting[k], node)
    if total == 0.0:
        return NONE
    pick = next_random(walker) * total
    for k in range(paths.meeting_first[node], paths.meeting_first[node + 1]):
        weight = _choice_weight(paths, here, paths.meeting[k], node)
        if weight > 0.0:
            pick -= weight
            if pick <= 0.0:
                return paths.meeting[k]
    return NONE


@compiled
def must_wait_at_crossing(walker, junctions, crossing, is_asked):
    """Return whether a pedestrian lets vehicles go first: those on the crossing, and one that has waited long.

    Nobody waits for the vehicle that stands waiting for them: who is asked to go goes. Who has been left behind by
    others goes after a while: vehicles let pass who is on a crossing.
    """
    if walker.leader != NONE and walker.crossing_wait > _LEFT_BEHIND:
        return False
    cars_first = junctions.vehicle_wait[crossing] > _CARS_FIRST_AFTER and walker.crossing_wait < _CARS_FIRST_UNTIL
    return (junctions.crossing_busy[crossing] or cars_first) and not is_asked


@compiled
def _enter_walkway(paths, walker, junctions, following, node):
    """Put the followed point at the start of the next walkway, from meeting point `node`."""
    walkway = walker.walkway
    walker.crossing_wait = 0.0
    if paths.walkways[following].kind == _CROSSING:
        junctions.walkers_on[following] += 1
    if paths.walkways[walkway].kind == _CROSSING:
        if walker.leaving_crossing >= 0:
            junctions.walkers_on[walker.leaving_crossing] -= 1
        walker.leaving_crossing, walker.leaving_since = walkway, walker.distance_walked
    walker.walkway = following
    while walker.goal != NONE and paths.goal_walkway[walker.goal] == following:
        walker.goal = walker.goal + 1 if walker.goal + 1 < walker.goal_end else NONE
    if paths.walkways[following].start == node:
        walker.direction, walker.offset = 1, 0.0
    else:
        walker.direction, walker.offset = -1, paths.walkways[following].length


@compiled
def _may_go_onto(paths, walker, junctions, is_asked, following, dt):
    """Return whether a walker may go onto a walkway now; who may not counts the time, and gives up after a while."""
    if paths.walkways[following].kind != _CROSSING or following == walker.leaving_crossing:
        return True  # Who turns round before it is off a crossing goes back: vehicles wait for it as it is.
    if (paths.walkways[following].light >= AMBER or waits_for_companions(walker)) and not is_asked:
        return False
    if not must_wait_at_crossing(walker, junctions, following, is_asked):
        return True
    walker.crossing_wait = max(walker.crossing_wait, dt)
    junctions.walker_wait[following] = max(junctions.walker_wait[following], walker.crossing_wait)
    return False


@compiled
def advance_follow_point(paths, walker, leader, junctions, is_asked, x, y, dt):
    """Move the followed point on until it is far enough ahead; return whether there is something to wait for.

    That is a crossing, or where the way forks who leads the walker (`leader`; the walker itself where nobody does).
    """
    if walker.crossing_wait > 0.0:
        walker.crossing_wait += dt  # also while others push it to and fro before the crossing
    lead = _LEAD_WHEN_HINDERED if walker.jammed_time > _HINDERED_AFTER else _LEAD
    for _ in range(12):
        point = follow_point(paths, walker)
        if (point.x - x) ** 2 + (point.y - y) ** 2 >= lead * lead:
            return False
        walkway = walker.walkway
        offset = walker.offset + walker.direction * 0.12
        if 0.0 < offset < paths.walkways[walkway].length:
            walker.offset = offset
            continue
        node = paths.walkways[walkway].end if walker.direction > 0 else paths.walkways[walkway].start
        if walker.leader != NONE:
            following = walkway_to_leader(paths, walker, leader, node)
            if following < 0:
                return True
        else:
            following = choose_next_walkway(paths, walker, node)
        if following < 0:
            walker.direction = -walker.direction
            walker.offset = min(max(offset, 0.0), paths.walkways[walkway].length)
            continue
        if not _may_go_onto(paths, walker, junctions, is_asked, following, dt):
            longest = _GIVE_UP_CROSSING + _GIVE_UP_SPREAD * walker.lateral_share
            if walker.leader == NONE and walker.crossing_wait > longest:
                turn_round(paths, walker, x, y)
            return True
        _enter_walkway(paths, walker, junctions, following, node)
    return False
