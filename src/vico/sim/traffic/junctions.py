"""Junctions and track crossings: who may enter, who has been let in, and who has waited longest.

A vehicle asks for every junction up to the next place where it can stand clear of them, all or none, and enters only
with room to leave again. A junction has one occupant at a time, or those whose lanes through it are not in each
other's way, and those who follow each other on one lane and find room for all of them beyond it. A long vehicle has
it to itself even then: its rear leaves its lane in bends. The rule is a switch of the run (`JunctionRule`).

Where tracks of trams cross lanes, vehicles let trams go first and do not stand. A vehicle that has been let into a
junction also drives out of it over the tracks beyond; trams wait for it.
"""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple

import numpy as np

from vico.io.compiled import compiled, inlined
from vico.sim.traffic.car_following import bodies_around, touched_at
from vico.sim.traffic.path import point_on_path
from vico.sim.traffic.pedestrian_routes import yields_to_pedestrians
from vico.sim.traffic.route import NEVER, STANDING_ROOM, clear_of_tracks, is_lane_of_stop
from vico.sim.traffic.state import DRIVING, HELD_JUNCTIONS, NONE, PRESENT, PREVIOUS_LANES, SEVERAL

#: What stands against entering a junction: nothing, one who cannot leave it before, others.
FREE, LETS_OUT, TAKEN = range(3)

_LONG = 6.0  # m from which on a vehicle needs a junction to itself
_LONG_COUNTS = 4.0  # times as much does its wait count where others share: an empty junction is rare
_LET_OUT_AFTER = 2.0  # s that a vehicle has stood in a junction before the one in its way is let in
_QUEUE_LEAD, _QUEUE_LEAST = 5.0, 10.0  # s that somebody has to have waited longer, and at all, to go first


@compiled
def holds(vehicle, junction):
    """Return whether a vehicle has been let into a junction cluster and has not left it."""
    found = False
    for h in range(HELD_JUNCTIONS):
        found = found or vehicle.held_junctions[h] == junction
    return found


@compiled
def holds_junction(vehicle):
    """Return whether a vehicle holds any junction."""
    found = False
    for h in range(HELD_JUNCTIONS):
        found = found or vehicle.held_junctions[h] >= 0
    return found


@compiled
def _cannot_leave_before(other, vehicle):
    """Return whether vehicle `other` cannot leave its junction before this one, in its way, has gone."""
    return other.blocker == vehicle.index and other.stopped_time > _LET_OUT_AFTER


@compiled
def _keeps_somebody_inside(fleet, vehicle, junction):
    """Return whether somebody cannot leave a junction before this vehicle, in its way, has gone."""
    found = False
    for other in fleet:
        found = found or (_cannot_leave_before(other, vehicle) and holds(other, junction))
    return found


@compiled
def is_overtaken(longest_wait, wait):
    """Return whether it is the turn of another vehicle, that has waited so long, s."""
    return longest_wait > max(wait + _QUEUE_LEAD, _QUEUE_LEAST)


@compiled
def counted_wait(junctions, vehicle):
    """Return how long a vehicle has waited for a junction, as it counts in queues, s."""
    is_patient = junctions.claims.any_shared and vehicle.length > _LONG
    return vehicle.junction_wait * (_LONG_COUNTS if is_patient else 1.0)


@compiled
def _is_taken(net, junctions, vehicle, lane):
    """Return whether others in the shared junction that a lane is in are in a vehicle's way there."""
    junction, me, claims = net.lanes[lane].junction, vehicle.index, junctions.claims
    holder, alone = junctions.holder[junction], claims.alone[junction]
    if alone != NONE and alone != me:
        return True
    if vehicle.length > _LONG and holder != NONE and holder != me:
        return True
    for c in range(net.conflict_first[lane], net.conflict_first[lane + 1]):
        by = claims.taken_by[net.conflict[c]]
        # Whoever is on the same lane is followed.
        if by != NONE and by != me and net.conflict[c] != lane:
            return True
    return False


@compiled
def _is_others_turn(net, junctions, vehicle, lane):
    """Return whether others, whom a vehicle would be in the way of on a lane in a junction, have waited longer."""
    wait = counted_wait(junctions, vehicle)
    if is_overtaken(junctions.longest_wait[net.lanes[lane].junction], wait):
        return True
    for c in range(net.conflict_first[lane], net.conflict_first[lane + 1]):
        if is_overtaken(junctions.claims.longest_lane_wait[net.conflict[c]], wait):
            return True
    return False


@compiled
def entry_conflict(net, fleet, junctions, vehicle, lane):
    """Return what stands against a vehicle's entering a lane in a junction: `FREE`, `LETS_OUT` or `TAKEN`."""
    junction = net.lanes[lane].junction
    if not junctions.claims.exclusive[junction]:
        inside = holds(vehicle, junction)
        if not inside and _keeps_somebody_inside(fleet, vehicle, junction):
            return LETS_OUT
        if _is_taken(net, junctions, vehicle, lane):
            return TAKEN
        return TAKEN if not inside and _is_others_turn(net, junctions, vehicle, lane) else FREE
    holder = junctions.holder[junction]
    if holder >= 0 and holder != vehicle.index:
        return LETS_OUT if _cannot_leave_before(fleet[holder], vehicle) else TAKEN
    is_queued = holder < 0 and is_overtaken(junctions.longest_wait[junction], counted_wait(junctions, vehicle))
    return TAKEN if is_queued else FREE


@compiled
def _shared_holder(holder, vehicle):
    """Return who has what `holder` has when a vehicle has it, too."""
    return vehicle.index if holder == NONE or holder == vehicle.index else SEVERAL


@compiled
def _note_taken(net, junctions, vehicle):
    """Note on which lanes a vehicle in a junction is, from its rear on, or has been let over."""
    claims, is_inside = junctions.claims, False
    for h in range(HELD_JUNCTIONS):
        junction = vehicle.held_junctions[h]
        if junction >= 0:
            is_inside = True
            if vehicle.length > _LONG:
                claims.alone[junction] = vehicle.index
    if not is_inside:
        return
    taken = claims.taken_by
    for k in range(-1, vehicle.granted_count):
        lane = vehicle.lane if k < 0 else vehicle.planned_lanes[k]
        taken[lane] = _shared_holder(taken[lane], vehicle)
        claims.to_come[lane] += vehicle.length + STANDING_ROOM
    rear = vehicle.offset - vehicle.length - 0.5
    k = 0
    while rear < 0.0 and k < PREVIOUS_LANES and vehicle.previous_lanes[k] != NONE:
        lane = vehicle.previous_lanes[k]
        taken[lane] = _shared_holder(taken[lane], vehicle)
        rear += net.lanes[lane].length
        k += 1


@compiled
def take_junctions(net, junctions, vehicle, first, last):
    """Let a vehicle into the junctions of its planned lanes from `first` to before `last`; False if it holds too many.

    Whoever holds a junction that had another occupant before is its occupant now.
    """
    for k in range(first, last):
        junction = net.lanes[vehicle.planned_lanes[k]].junction
        if junction < 0:
            continue
        is_mine = junctions.holder[junction] == vehicle.index
        if not (is_mine if junctions.claims.exclusive[junction] else holds(vehicle, junction)):
            slot = NONE
            for h in range(HELD_JUNCTIONS):
                if vehicle.held_junctions[h] < 0:
                    slot = h
                    break
            if slot < 0:
                return False
            vehicle.held_junctions[slot] = junction
            junctions.holder[junction] = vehicle.index
    vehicle.granted_count = last
    if junctions.claims.any_shared:
        _note_taken(net, junctions, vehicle)
    return True


@compiled
def _is_inside(net, vehicle, junction):
    """Return whether a vehicle's body is in a junction or may still drive into it."""
    inside = net.lanes[vehicle.lane].junction == junction
    for k in range(vehicle.granted_count):
        inside = inside or net.lanes[vehicle.planned_lanes[k]].junction == junction
    rear = vehicle.offset - vehicle.length - 0.5
    k = 0
    while rear < 0.0 and k < PREVIOUS_LANES and vehicle.previous_lanes[k] != NONE:
        lane = vehicle.previous_lanes[k]
        inside = inside or net.lanes[lane].junction == junction
        rear += net.lanes[lane].length
        k += 1
    return inside


@compiled
def release_junctions(net, junctions, vehicle):
    """Give back the junctions that the vehicle's body has left and that are not granted ahead."""
    for h in range(HELD_JUNCTIONS):
        junction = vehicle.held_junctions[h]
        if junction < 0:
            continue
        if not _is_inside(net, vehicle, junction):
            vehicle.held_junctions[h] = NONE
            if junctions.holder[junction] == vehicle.index:
                junctions.holder[junction] = NONE
        elif junctions.holder[junction] < 0:
            junctions.holder[junction] = vehicle.index  # the one that was let go first has gone


@compiled
def release_all_junctions(junctions, vehicle):
    """Give back every junction a vehicle holds."""
    for h in range(HELD_JUNCTIONS):
        if vehicle.held_junctions[h] >= 0:
            if junctions.holder[vehicle.held_junctions[h]] == vehicle.index:
                junctions.holder[vehicle.held_junctions[h]] = NONE
            vehicle.held_junctions[h] = NONE
    vehicle.granted_count = 0


@compiled
def note_claims(net, fleet, junctions):
    """Note who is where in shared junctions, and how long the first in each queue has waited.

    There are queues for junctions, for lanes through shared ones, and for room on the lanes beyond.
    """
    claims = junctions.claims
    junctions.longest_wait[:] = 0.0
    junctions.longest_exit_wait[:] = 0.0
    if claims.any_shared:
        claims.alone[:] = NONE
        claims.taken_by[:] = NONE
        claims.longest_lane_wait[:] = 0.0
        claims.to_come[:] = 0.0
    for vehicle in fleet:
        if claims.any_shared:
            _note_taken(net, junctions, vehicle)
        queued_exit, queued, wait = vehicle.queued_exit, vehicle.queued_junction, counted_wait(junctions, vehicle)
        if queued_exit >= 0:
            junctions.longest_exit_wait[queued_exit] = max(junctions.longest_exit_wait[queued_exit], wait)
        if queued < 0:
            continue
        if claims.exclusive[queued] or vehicle.length > _LONG:
            junctions.longest_wait[queued] = max(junctions.longest_wait[queued], wait)
            continue
        for k in range(vehicle.granted_count, vehicle.planned_count):
            lane = vehicle.planned_lanes[k]
            if net.lanes[lane].junction == queued:
                claims.longest_lane_wait[lane] = max(claims.longest_lane_wait[lane], wait)


_BEFORE = 0.6  # m kept before tracks where a vehicle waits
_ON_TRACK = 0.3  # m before tracks from which on a vehicle is taken to be on them
#: Metres kept behind tracks.
BEYOND_TRACKS = 1.0
_CREEPS = 1.0  # m/s: who is slower may come to stand
#: Metres beyond its sight that a vehicle looks for room behind tracks, beside its own length.
FARTHER = 15.0


class TrackAhead(NamedTuple):
    """The first place ahead on a vehicle's street where tracks cross it.

    Attributes
    ----------
    distance
        Metres from the vehicle's front to where it waits before it; `NEVER` for no such place.
    beyond
        Metres to where its front is when it stands clear of the tracks behind them.
    junction
        Metres to the first junction that it has not been let into; `NEVER` for none in sight.
    called
        Whether a tram comes.
    """

    distance: float
    beyond: float
    junction: float
    called: bool


@compiled
def track_ahead(net, vehicle, look):
    """Return the first tracks ahead of a vehicle, within `look` metres, that it is not on and may have to wait for."""
    found = TrackAhead(NEVER, NEVER, NEVER, False)
    if len(net.tracks) == 0 or vehicle.stopping != DRIVING or holds_junction(vehicle):
        return found
    ahead, distance, beyond, called = -vehicle.offset, NEVER, NEVER, False
    for k in range(-1, vehicle.planned_count):
        lane = net.lanes[vehicle.lane if k < 0 else vehicle.planned_lanes[k]]
        if lane.junction >= 0 and k >= vehicle.granted_count:
            return TrackAhead(distance, beyond, ahead, called)
        for c in range(lane.first_track, lane.end_track):
            to_track = ahead + net.tracks[c].start - _BEFORE
            if distance >= NEVER and _ON_TRACK - _BEFORE < to_track < look:
                distance = max(to_track, 0.0)
                beyond = ahead + net.tracks[c].end + vehicle.length + BEYOND_TRACKS
                called = net.tracks[c].called
        ahead += lane.length
        if ahead > look and ahead > beyond + FARTHER:
            break
    return TrackAhead(distance, beyond, NEVER, called)


@compiled
def asks_with_track(track, braking):
    """Return from how many metres before a junction a vehicle asks for it, its braking distance without tracks.

    Where there is no room between tracks and the junction behind them it takes both at once.
    """
    takes_both = track.distance < braking and track.junction < track.beyond
    return max(braking, track.junction + 0.1) if takes_both else braking


@compiled
def distance_to_track(track, vehicle, stop_distance, gap, leading):
    """Return the metres to where a vehicle stops before tracks; `NEVER` where it may drive on over them.

    Parameters
    ----------
    stop_distance
        Metres to a stop of its own, `NEVER` for none: it may be on tracks.
    gap, leading
        Metres to its leader, and how fast that is, m/s.
    """
    if track.distance >= NEVER or vehicle.granted_count > 0:
        return NEVER
    is_full = track.junction < track.beyond or (leading < _CREEPS and gap < track.beyond)
    return track.distance if track.called or (is_full and stop_distance >= NEVER) else NEVER


@compiled
def crosses_called_track(net, vehicle, first, last, end, s, start):
    """Return whether a tram comes where a vehicle would drive, on its planned lanes from `first` to before `end`.

    Parameters
    ----------
    last
        Number of planned lanes up to the last of the junctions.
    s, start
        s of its path where the lane `first` begins, and where the vehicle could stand behind the junctions.
    """
    for k in range(first, end):
        lane = net.lanes[vehicle.planned_lanes[k]]
        for c in range(lane.first_track, lane.end_track):
            if net.tracks[c].called and (k < last or s + net.tracks[c].start < start):
                return True
        s += lane.length
    return False


@compiled
def _note_behind(net, vehicle, taken):
    """Note the tracks that a vehicle's body is on behind the lane that its front is on."""
    rear, k = vehicle.offset - vehicle.length, 0
    while rear < 0.0 and k < PREVIOUS_LANES and vehicle.previous_lanes[k] != NONE:
        lane = net.lanes[vehicle.previous_lanes[k]]
        rear += lane.length
        for c in range(lane.first_track, lane.end_track):
            taken[c] = taken[c] or rear < net.tracks[c].end + _ON_TRACK
        k += 1


@compiled
def _note_ahead(net, vehicle, taken):
    """Note the tracks that a vehicle is on with its front, has been let over, or cannot stop before."""
    reach, room = vehicle.speed * vehicle.speed / (2 * vehicle.braking), vehicle.length + STANDING_ROOM
    ahead, holds, rear = -vehicle.offset, holds_junction(vehicle), vehicle.offset - vehicle.length
    for k in range(-1, vehicle.planned_count):
        lane, is_granted = net.lanes[vehicle.lane if k < 0 else vehicle.planned_lanes[k]], k < vehicle.granted_count
        if k >= 0 and not is_granted and (lane.junction >= 0 or ahead > max(reach, room)):
            break
        for c in range(lane.first_track, lane.end_track):
            start, end = net.tracks[c].start, net.tracks[c].end
            # Who is in a junction, or has been let in, stands beyond the tracks after it if there is no room before.
            drives_out = holds and (lane.junction >= 0 or is_granted or start < room)
            is_there = drives_out or ahead + start - _ON_TRACK < reach
            taken[c] = taken[c] or (is_there and (k >= 0 or rear < end + _ON_TRACK))
        ahead += lane.length


@compiled
def crossed_tracks(net, fleet):
    """Return where vehicles are on tracks or will not stop before them, bool, shape ``(track crossings,)``."""
    taken = np.zeros(len(net.tracks), np.bool_)
    for vehicle in fleet:
        if vehicle.presence == PRESENT:
            _note_ahead(net, vehicle, taken)
            _note_behind(net, vehicle, taken)
    return taken


_HESITATION = 3.0  # s that a vehicle let in may stand before the junction goes back
_APART = 3.0  # m between places where it is looked whether somebody stands there
_GAP = 0.05  # m kept from others where a vehicle will stand
_AROUND = 5.0  # more than a vehicle's corners leave its path, and another's its half length, m


class JunctionRequest(NamedTuple):
    """The first junction ahead that a vehicle has to ask for.

    Attributes
    ----------
    planned_index
        Its position in the planned lanes; `NONE` where there is nothing to ask for.
    distance
        Metres from the vehicle's front to it.
    path_ends
        Whether the planned path ends for good.
    """

    planned_index: int
    distance: float
    path_ends: bool


class JunctionExit(NamedTuple):
    """Where a vehicle would stand after the junctions it asks for.

    Attributes
    ----------
    last
        Number of planned lanes up to the last of the junctions.
    to_come
        Metres beyond it that those need who are ahead on its last lane.
    end
        Number of planned lanes looked at.
    clear
        Metres of path without a junction after the last one.
    start, far
        s of the path where they begin (-1 for never) and end.
    """

    last: int
    to_come: float
    end: int
    clear: float
    start: float
    far: float


@inlined
def next_junction_request(net, vehicle, stop_distance, braking_distance, path_ends):
    """Return the first junction within the braking distance, and before its stop, that a vehicle was not let into."""
    index = NONE
    distance = net.lanes[vehicle.lane].length - vehicle.offset
    for k in range(vehicle.planned_count):
        if distance > braking_distance or stop_distance < NEVER:
            break
        if net.lanes[vehicle.planned_lanes[k]].junction >= 0 and k >= vehicle.granted_count:
            index = k
            break
        if is_lane_of_stop(net, vehicle, k + 1):
            break
        distance += net.lanes[vehicle.planned_lanes[k]].length
    return JunctionRequest(index, distance, path_ends)


@compiled
def _find_exit(net, junctions, vehicle, request):
    """Return where a vehicle can stand clear of junctions after those it asks for."""
    s = vehicle.offset + request.distance
    clear = 0.0
    start = -1.0
    last = k = request.planned_index
    while k < vehicle.planned_count:
        lane = vehicle.planned_lanes[k]
        if net.lanes[lane].junction >= 0:
            clear = 0.0
            start = -1.0
            last = k + 1
        else:
            begin = clear_of_tracks(net, lane, clear, vehicle.length + STANDING_ROOM)
            if begin > 0.0:
                clear = 0.0
                start = -1.0
            if start < 0.0:
                start = s + begin
            clear += net.lanes[lane].length - begin
        s += net.lanes[lane].length
        k += 1
        if clear >= vehicle.length + STANDING_ROOM:
            break
    to_come = 0.0
    lane = vehicle.planned_lanes[last - 1]
    if last > request.planned_index and not junctions.claims.exclusive[net.lanes[lane].junction]:
        to_come = junctions.claims.to_come[lane]
    return JunctionExit(last, to_come, k, clear, start, s)


@compiled
def _exit_is_long_enough(vehicle, request, leave):
    """Return whether a vehicle fits behind the junctions; where a car leaves the map it need not."""
    leaves_map = request.path_ends and leave.end == vehicle.planned_count and vehicle.route < 0
    return leave.clear >= leave.to_come + vehicle.length + STANDING_ROOM or leaves_map


@compiled
def _who_is_at_exit(vehicle, leave, view, vehicles):
    """Return the first vehicle that is where this one would stand, or `NONE`: whoever stands there may stay."""
    if leave.start < 0.0:
        return NONE
    room = min(leave.to_come + vehicle.length + STANDING_ROOM, max(leave.clear, 0.0))
    x, y, _, _ = point_on_path(view.path, leave.start + (room - vehicle.length) / 2)
    nearby = bodies_around(vehicle.index, x, y, (room + vehicle.length) / 2 + _AROUND, view.beyond)
    places = 5 + int(leave.to_come / _APART)
    for i in range(1, places + 1):
        there = leave.start + room * i / places
        hit = touched_at(view.path, view.outline, there, nearby, _GAP, _GAP, vehicles)
        if hit >= 0:
            return nearby[hit].body
    return NONE


@compiled
def waits_outside(net, vehicle):
    """Return whether a vehicle waits for a junction before it: for ever, if who has waited longer cannot pass it."""
    return vehicle.junction_wait > 0.0 and vehicle.granted_count == 0 and net.lanes[vehicle.lane].junction < 0


@compiled
def _way_is_free(vehicle, leave, view, vehicles):
    """Return whether no vehicle is on the whole way through the junctions."""
    there = vehicle.offset + 0.5
    x, y, _, _ = point_on_path(view.path, there)
    nearby = bodies_around(vehicle.index, x, y, leave.far - there + vehicle.length + _AROUND, view.beyond)
    while there < leave.far:
        if touched_at(view.path, view.outline, there, nearby, _GAP, _GAP, vehicles) >= 0:
            return False
        there += 1.0
    return True


@compiled
def may_enter_junction(net, fleet, junctions, vehicle, request, leave, view):
    """Return whether a vehicle may enter the junctions from the requested one up to its exit.

    Nobody else may have them or have waited longer for them, pedestrians go first, and the exit must have room. One
    that it keeps from leaving a junction itself does not count, if the whole way is free to get out of its way.
    """
    lets_out = False
    yields = False
    for k in range(request.planned_index, leave.last):
        lane = vehicle.planned_lanes[k]
        junction = net.lanes[lane].junction
        if junction < 0:
            continue
        against = entry_conflict(net, fleet, junctions, vehicle, lane)
        if against == TAKEN:
            vehicle.queued_junction = junction
            return False
        lets_out = lets_out or against == LETS_OUT
        if yields_to_pedestrians(net, junctions, vehicle, lane):
            yields = True
    if yields or not _exit_is_long_enough(vehicle, request, leave):
        return False
    s = vehicle.offset + request.distance
    if crosses_called_track(net, vehicle, request.planned_index, leave.last, leave.end, s, leave.start):
        return False
    # Shorter vehicles, and those with a shorter way, would else take whatever room there is for ever.
    lane = vehicle.planned_lanes[leave.last] if leave.start >= 0.0 else NONE
    if lane >= 0 and is_overtaken(junctions.longest_exit_wait[lane], counted_wait(junctions, vehicle)):
        return False
    other = _who_is_at_exit(vehicle, leave, view, len(fleet))
    if 0 <= other < len(fleet) and waits_outside(net, fleet[other]):
        vehicle.kept_out_from = fleet[other].lane  # that one goes first, and who comes behind it stays back
        return False
    if other >= 0:
        vehicle.queued_exit = lane
        return False
    return not lets_out or _way_is_free(vehicle, leave, view, len(fleet))


@inlined
def request_junctions(net, fleet, junctions, vehicle, request, view):
    """Ask for the junctions ahead; return whether the vehicle has them now."""
    leave = _find_exit(net, junctions, vehicle, request)
    if not may_enter_junction(net, fleet, junctions, vehicle, request, leave, view):
        return False
    return take_junctions(net, junctions, vehicle, request.planned_index, leave.last)


@compiled
def is_hesitating(net, vehicle):
    """Return whether a vehicle was let into a junction but has not got going: then it is in everybody's way."""
    return vehicle.granted_count > 0 and vehicle.stopped_time > _HESITATION and net.lanes[vehicle.lane].junction < 0


class JunctionRule(StrEnum):
    """Who may be in a junction.

    Attributes
    ----------
    ONE
        One vehicle at a time; signals are not obeyed. The paper's rule.
    SHARED
        Those whose lanes through it do not cross, join, or come too near each other; buses alone; no signals.
    SIGNALS
        The same, and signals are obeyed where the map has them.
    BOTH
        One vehicle at a time, and signals are obeyed.
    """

    ONE = "one"
    SHARED = "shared"
    SIGNALS = "signals"
    BOTH = "both"

    @property
    def is_shared(self) -> bool:
        """Whether several vehicles may be in a junction."""
        return self in (JunctionRule.SHARED, JunctionRule.SIGNALS)

    @property
    def has_signals(self) -> bool:
        """Whether signals are obeyed."""
        return self in (JunctionRule.SIGNALS, JunctionRule.BOTH)
