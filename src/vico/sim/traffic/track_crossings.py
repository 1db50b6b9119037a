"""Where tracks of trams cross lanes: vehicles let trams go first there, and do not stand there.

Who has been let into a junction drives out of it, over the tracks beyond, too; trams wait for it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from vico.io.compiled import compiled
from vico.sim.traffic.claims import holds_junction
from vico.sim.traffic.records import DRIVING, NONE, PRESENT, PREVIOUS_LANES
from vico.sim.traffic.route import NEVER, STANDING_ROOM

_BEFORE = 0.6  # m kept before tracks where a vehicle waits
_ON_TRACK = 0.3  # m before tracks from which on a vehicle is taken to be on them
_BEYOND = 1.0  # m kept behind tracks
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
def track_ahead(net, vehicle, look):  # type: ignore[no-untyped-def]
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
                beyond = ahead + net.tracks[c].end + vehicle.length + _BEYOND
                called = net.tracks[c].called
        ahead += lane.length
        if ahead > look and ahead > beyond + FARTHER:
            break
    return TrackAhead(distance, beyond, NEVER, called)


@compiled
def look_over(track):  # type: ignore[no-untyped-def]
    """Return how far a vehicle looks to see whether there is room behind tracks, metres; 0 without any."""
    return track.beyond + _BEYOND if track.distance < NEVER else 0.0


@compiled
def waits_for_tram(track, distance):  # type: ignore[no-untyped-def]
    """Return whether a tram comes on tracks that lie before a place so many metres ahead."""
    return track.called and track.distance < distance


@compiled
def asks_with_track(track, braking):  # type: ignore[no-untyped-def]
    """Return from how many metres before a junction a vehicle asks for it, its braking distance without tracks.

    Where there is no room between tracks and the junction behind them it takes both at once.
    """
    takes_both = track.distance < braking and track.junction < track.beyond
    return max(braking, track.junction + 0.1) if takes_both else braking


@compiled
def distance_to_track(track, vehicle, stop_distance, gap, leading):  # type: ignore[no-untyped-def]
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
def crosses_called_track(net, vehicle, first, last, end, s, start):  # type: ignore[no-untyped-def]
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
def _note_behind(net, vehicle, taken):  # type: ignore[no-untyped-def]
    """Note the tracks that a vehicle's body is on behind the lane that its front is on."""
    rear, k = vehicle.offset - vehicle.length, 0
    while rear < 0.0 and k < PREVIOUS_LANES and vehicle.previous_lanes[k] != NONE:
        lane = net.lanes[vehicle.previous_lanes[k]]
        rear += lane.length
        for c in range(lane.first_track, lane.end_track):
            taken[c] = taken[c] or rear < net.tracks[c].end + _ON_TRACK
        k += 1


@compiled
def _note_ahead(net, vehicle, taken):  # type: ignore[no-untyped-def]
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
def crossed_tracks(net, fleet):  # type: ignore[no-untyped-def]
    """Return where vehicles are on tracks or will not stop before them, bool, shape ``(track crossings,)``."""
    taken = np.zeros(len(net.tracks), np.bool_)
    for vehicle in fleet:
        if vehicle.presence == PRESENT:
            _note_ahead(net, vehicle, taken)
            _note_behind(net, vehicle, taken)
    return taken
