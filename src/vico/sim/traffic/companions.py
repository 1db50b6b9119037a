"""Pedestrians who walk together: one of each group decides the way, its companions keep beside or behind it.

Companions follow each other in the order of pedestrians: after the one that leads come the others of its group.
"""

from __future__ import annotations

import numpy as np

from vico.io.compiled import compiled
from vico.seeds import rng
from vico.sim.traffic.records import NONE, Records
from vico.sim.traffic.shapes import is_disc
from vico.world.walkways import CROSSING as _CROSSING_KIND

_GROUPS, _OF_THREE = 0.182, 0.25  # share of groups among those who walk alone and groups; of threes among groups
_PACES, _SHARES = (1.0, 1.3), (0.6, 0.95)  # m/s that groups prefer; how far right who leads walks, as `lateral_share`
_BESIDE, _BEHIND = 0.7, 0.8  # m between two who walk side by side, or one behind the other
_LEFT_OF_MIDDLE = 0.3  # companions walk side by side no farther left than this share of the room there
_ROOM_CHANGE = 0.6  # m/s to the side, from beside to behind and back
_COMES_WITHIN, _COMES_BESIDE = 3.2, 1.1  # m ahead and to the side where somebody who comes is let pass
_LET_PASS = 2.0  # s that companions stay one behind the other for them
_FOLLOWS_AT, _FOLLOWS_WITHIN, _FOLLOWS_BESIDE = 0.75, 1.3, 0.5  # m to one of the group ahead, kept and looked for
_CATCH_UP, _FASTEST = 0.8, 1.4  # share of one's pace for each metre one is behind, and the most
_TOGETHER, _PARTED = 2.0, 3.0  # m: who leads slows down from the first on and stands from the second on
_PARTED_LONG = 120.0  # s after which it goes on
_CROSSING = int(_CROSSING_KIND)


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
def _hops_to(paths, node, goal):  # type: ignore[no-untyped-def]
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
def _away(paths, walkway, node, x, y):  # type: ignore[no-untyped-def]
    """Return how far the end of a walkway at a meeting point is from (x, y), metres."""
    p = paths.first[walkway] if paths.walkways[walkway].start == node else paths.first[walkway + 1] - 1
    return np.sqrt((paths.points[p, 0] - x) ** 2 + (paths.points[p, 1] - y) ** 2)


@compiled
def walkway_to_leader(paths, walker, leader, node):  # type: ignore[no-untyped-def]
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
def goes_wrong_way(paths, walker, leader):  # type: ignore[no-untyped-def]
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
def _somebody_comes(shapes, b, near, group, hx, hy):  # type: ignore[no-untyped-def]
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
def keep_up(walker, leader, shapes, bodies, near, heading, half, dt):  # type: ignore[no-untyped-def]
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
def _share_behind(walker, shapes, b, first, heading):  # type: ignore[no-untyped-def]
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
def wait_for_companions(paths, walker, dt):  # type: ignore[no-untyped-def]
    """Return the share of its pace at which who leads a group goes on: off crossings it waits for those behind."""
    walker.parted_time = walker.parted_time + dt if walker.apart > _TOGETHER else 0.0
    is_on_crossing = paths.walkways[walker.walkway].kind == _CROSSING or walker.leaving_crossing != NONE
    if is_on_crossing or walker.parted_time > _PARTED_LONG:
        return 1.0
    return min(max((_PARTED - walker.apart) / (_PARTED - _TOGETHER), 0.0), 1.0)


@compiled
def waits_for_companions(walker):  # type: ignore[no-untyped-def]
    """Return whether who leads a group waits before a crossing until all are there."""
    return walker.leader == NONE and walker.apart > _TOGETHER and walker.parted_time < _PARTED_LONG


@compiled
def _is_ahead(walker, other):  # type: ignore[no-untyped-def]
    """Return whether `other` is farther along the walkway on which a pedestrian walks the same way."""
    goes_along = other.walkway == walker.walkway and other.direction == walker.direction
    return goes_along and (other.offset - walker.offset) * walker.direction > 0.0


@compiled
def note_distance(pedestrians, i, shapes, first):  # type: ignore[no-untyped-def]
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
