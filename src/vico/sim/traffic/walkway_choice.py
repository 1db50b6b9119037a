"""Which walkway a pedestrian takes next, whether it may go onto a crossing, and the point ahead that it follows."""

from __future__ import annotations

import numpy as np

from vico.io.compiled import compiled
from vico.sim.traffic.companions import (
    waits_for_companions,
    walkway_to_leader,
)
from vico.sim.traffic.follow_point import follow_point
from vico.sim.traffic.leaving import project_on_walkway
from vico.sim.traffic.random_stream import next_random
from vico.sim.traffic.records import AMBER, NONE
from vico.world.walkways import CORNER as _CORNER_KIND
from vico.world.walkways import CROSSING as _CROSSING_KIND

_LEAD, _LEAD_WHEN_HINDERED = 0.7, 2.0  # how far ahead the point runs, m: past a vehicle that stands on it
_HINDERED_AFTER = 3.0  # who has got nowhere for so long looks that far ahead, s
_CARS_FIRST_AFTER, _CARS_FIRST_UNTIL = 10.0, 12.0  # s waited by a car that goes first then, and by the pedestrian
_LEFT_BEHIND = 15.0  # s after which a companion whose leader has crossed crosses, too
_GIVE_UP_CROSSING = 20.0, 10.0  # s waited for a crossing before turning round, and more by `lateral_share`
_CORNER, _CROSSING = int(_CORNER_KIND), int(_CROSSING_KIND)


@compiled
def turn_round(paths, walker, x, y):  # type: ignore[no-untyped-def]
    """Go the other way from here on: the followed point comes back to where the walker is, or it would lead on."""
    walker.direction = -walker.direction
    walker.offset, _ = project_on_walkway(paths, walker.walkway, x, y)
    walker.crossing_wait = walker.stuck_time = 0.0


@compiled
def _is_crossing_at(paths, node):  # type: ignore[no-untyped-def]
    """Return whether a crossing begins at a meeting point."""
    for m in range(paths.meeting_first[node], paths.meeting_first[node + 1]):
        if paths.walkways[paths.meeting[m]].kind == _CROSSING:
            return True
    return False


@compiled
def _choice_weight(paths, here, option, node):  # type: ignore[no-untyped-def]
    """Return how likely a walkway is taken at a meeting point: crossings less often, 0 for never."""
    is_corner = paths.walkways[option].kind == _CORNER
    if option == here or paths.walkways[option].shut or (is_corner and paths.walkways[here].kind == _CORNER):
        return 0.0
    far = paths.walkways[option].start + paths.walkways[option].end - node
    return 0.5 if is_corner and _is_crossing_at(paths, far) else 1.0


@compiled
def _walkway_to_goal(paths, walker, node):  # type: ignore[no-untyped-def]
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
def choose_next_walkway(paths, walker, node):  # type: ignore[no-untyped-def]
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
def must_wait_at_crossing(walker, junctions, crossing, is_asked):  # type: ignore[no-untyped-def]
    """Return whether a pedestrian lets vehicles go first: those on the crossing, and one that has waited long.

    Nobody waits for the vehicle that stands waiting for them: who is asked to go goes. Who has been left behind by
    others goes after a while: vehicles let pass who is on a crossing.
    """
    if walker.leader != NONE and walker.crossing_wait > _LEFT_BEHIND:
        return False
    cars_first = junctions.vehicle_wait[crossing] > _CARS_FIRST_AFTER and walker.crossing_wait < _CARS_FIRST_UNTIL
    return (junctions.crossing_busy[crossing] or cars_first) and not is_asked


@compiled
def _enter_walkway(paths, walker, junctions, following, node):  # type: ignore[no-untyped-def]
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
def _may_go_onto(paths, walker, junctions, is_asked, following, dt):  # type: ignore[no-untyped-def]
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
def _gives_up_crossing(walker):  # type: ignore[no-untyped-def]
    """Return whether a walker has waited so long for a crossing that it turns round; who is led does not."""
    longest, spread = _GIVE_UP_CROSSING
    return walker.leader == NONE and walker.crossing_wait > longest + spread * walker.lateral_share


@compiled
def advance_follow_point(paths, walker, leader, junctions, is_asked, x, y, dt):  # type: ignore[no-untyped-def]
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
            if _gives_up_crossing(walker):
                turn_round(paths, walker, x, y)
            return True
        _enter_walkway(paths, walker, junctions, following, node)
    return False
