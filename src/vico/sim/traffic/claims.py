"""Who has been let into which junction, over which lanes, and who has waited longest for it.

A junction has one occupant at a time, or those whose lanes through it are not in each other's way, and those who follow
each other on one lane and find room for all of them beyond it. A long vehicle has
it to itself even then: its rear leaves its lane in bends.
"""

from __future__ import annotations

from vico.io.compiled import compiled
from vico.sim.traffic.records import HELD_JUNCTIONS, NONE, PREVIOUS_LANES, SEVERAL
from vico.sim.traffic.route import STANDING_ROOM

#: What stands against entering a junction: nothing, one who cannot leave it before, others.
FREE, LETS_OUT, TAKEN = 0, 1, 2

_LONG = 6.0  # m from which on a vehicle needs a junction to itself
_LONG_COUNTS = 4.0  # times as much does its wait count where others share: an empty junction is rare
_LET_OUT_AFTER = 2.0  # s that a vehicle has stood in a junction before the one in its way is let in
_QUEUE_LEAD, _QUEUE_LEAST = 5.0, 10.0  # s that somebody has to have waited longer, and at all, to go first


@compiled
def holds(vehicle, junction):  # type: ignore[no-untyped-def]
    """Return whether a vehicle has been let into a junction cluster and has not left it."""
    found = False
    for h in range(HELD_JUNCTIONS):
        found = found or vehicle.held_junctions[h] == junction
    return found


@compiled
def holds_junction(vehicle):  # type: ignore[no-untyped-def]
    """Return whether a vehicle holds any junction."""
    found = False
    for h in range(HELD_JUNCTIONS):
        found = found or vehicle.held_junctions[h] >= 0
    return found


@compiled
def _cannot_leave_before(other, vehicle):  # type: ignore[no-untyped-def]
    """Return whether vehicle `other` cannot leave its junction before this one, in its way, has gone."""
    return other.blocker == vehicle.index and other.stopped_time > _LET_OUT_AFTER


@compiled
def _keeps_somebody_inside(fleet, vehicle, junction):  # type: ignore[no-untyped-def]
    """Return whether somebody cannot leave a junction before this vehicle, in its way, has gone."""
    found = False
    for other in fleet:
        found = found or (_cannot_leave_before(other, vehicle) and holds(other, junction))
    return found


@compiled
def is_overtaken(longest_wait, wait):  # type: ignore[no-untyped-def]
    """Return whether it is the turn of another vehicle, that has waited so long, s."""
    return longest_wait > max(wait + _QUEUE_LEAD, _QUEUE_LEAST)


@compiled
def counted_wait(junctions, vehicle):  # type: ignore[no-untyped-def]
    """Return how long a vehicle has waited for a junction, as it counts in queues, s."""
    is_patient = junctions.claims.any_shared and vehicle.length > _LONG
    return vehicle.junction_wait * (_LONG_COUNTS if is_patient else 1.0)


@compiled
def _is_taken(net, junctions, vehicle, lane):  # type: ignore[no-untyped-def]
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
def _is_others_turn(net, junctions, vehicle, lane):  # type: ignore[no-untyped-def]
    """Return whether others, whom a vehicle would be in the way of on a lane in a junction, have waited longer."""
    wait = counted_wait(junctions, vehicle)
    if is_overtaken(junctions.longest_wait[net.lanes[lane].junction], wait):
        return True
    for c in range(net.conflict_first[lane], net.conflict_first[lane + 1]):
        if is_overtaken(junctions.claims.longest_lane_wait[net.conflict[c]], wait):
            return True
    return False


@compiled
def what_stands_against(net, fleet, junctions, vehicle, lane):  # type: ignore[no-untyped-def]
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
def _joined_by(holder, vehicle):  # type: ignore[no-untyped-def]
    """Return who has what `holder` has when a vehicle has it, too."""
    return vehicle.index if holder == NONE or holder == vehicle.index else SEVERAL


@compiled
def _note_taken(net, junctions, vehicle):  # type: ignore[no-untyped-def]
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
        taken[lane] = _joined_by(taken[lane], vehicle)
        claims.to_come[lane] += vehicle.length + STANDING_ROOM
    rear = vehicle.offset - vehicle.length - 0.5
    k = 0
    while rear < 0.0 and k < PREVIOUS_LANES and vehicle.previous_lanes[k] != NONE:
        lane = vehicle.previous_lanes[k]
        taken[lane] = _joined_by(taken[lane], vehicle)
        rear += net.lanes[lane].length
        k += 1


@compiled
def take_junctions(net, junctions, vehicle, first, last):  # type: ignore[no-untyped-def]
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
def _is_inside(net, vehicle, junction):  # type: ignore[no-untyped-def]
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
def release_junctions(net, junctions, vehicle):  # type: ignore[no-untyped-def]
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
def release_all_junctions(junctions, vehicle):  # type: ignore[no-untyped-def]
    """Give back every junction a vehicle holds."""
    for h in range(HELD_JUNCTIONS):
        if vehicle.held_junctions[h] >= 0:
            if junctions.holder[vehicle.held_junctions[h]] == vehicle.index:
                junctions.holder[vehicle.held_junctions[h]] = NONE
            vehicle.held_junctions[h] = NONE
    vehicle.granted_count = 0


@compiled
def _note_lane_waits(net, junctions, vehicle):  # type: ignore[no-untyped-def]
    """Note how long a vehicle has waited for the lanes that it wants to take through the junction it queues for."""
    wait, queued, waits = counted_wait(junctions, vehicle), vehicle.queued_junction, junctions.claims.longest_lane_wait
    for k in range(vehicle.granted_count, vehicle.planned_count):
        lane = vehicle.planned_lanes[k]
        if net.lanes[lane].junction == queued:
            waits[lane] = max(waits[lane], wait)


@compiled
def note_claims(net, fleet, junctions):  # type: ignore[no-untyped-def]
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
        lane, queued, wait = vehicle.queued_exit, vehicle.queued_junction, counted_wait(junctions, vehicle)
        if lane >= 0:
            junctions.longest_exit_wait[lane] = max(junctions.longest_exit_wait[lane], wait)
        if queued < 0:
            continue
        if claims.exclusive[queued] or vehicle.length > _LONG:
            junctions.longest_wait[queued] = max(junctions.longest_wait[queued], wait)
        else:
            _note_lane_waits(net, junctions, vehicle)
