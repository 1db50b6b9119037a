"""What traffic kernels read and write: the network, the vehicles and pedestrians, who is in which junction.

Rows are those of `records`. Positions are local ENU metres, headings radians counter-clockwise from east. "Distance
along a lane" runs from the lane's start in metres; a vehicle is where its front is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.seeds import rng
from vico.sim.traffic.records import GAIT_TIME, NONE, PEDESTRIAN_RECORD, TOP_SPEED, VEHICLE, Floats, Ints, Records


class LaneNetwork(NamedTuple):
    """The lanes vehicles drive, in the order of `LaneGraph`, and the routes of the buses.

    Only the lanes' speeds, `shut` and `light` change, in the copy that each `Traffic` has: they follow weather, events
    and the time.

    Attributes
    ----------
    lanes
        Dtype `LANE`.
    points, along
        Points of the lanes' centre lines, metres, shape ``(p, 2)``, and their distances along their lanes.
    kerb_points
        The same points where cyclists ride, shape ``(p, 2)``: towards the kerb.
    next
        Lanes that follow another one, lane by lane.
    conflict_first, conflict
        Lanes of the same junction cluster that cross, join or come too near lane ``i``, itself among them:
        ``conflict[conflict_first[i]:conflict_first[i + 1]]``; none for lanes between junctions, nor where every
        junction has one occupant.
    crossings, crossings_cleared
        Crossings that lanes run over (indices of walkways), lane by lane, and the distance along the lane at which a
        vehicle's rear has passed each, metres.
    route_first, route
        Lanes of bus route ``r``, a closed round: ``route[route_first[r]:route_first[r + 1]]``.
    goal_edge, goal_next
        Street of each goal of cars whose route is given, and the lane that leads to it from each lane, `NONE` for none,
        int32, shapes ``(goals,)`` and ``(goals, lanes)``.
    places
        Places where cars stop, lane by lane, dtype `STOPPING_PLACE`.
    way_points
        Points of the ways in car parks, dtype `PATH_POINT`.
    tracks
        Where tracks of trams cross lanes, lane by lane, dtype `TRACK_CROSSING`; `called` is part of the trams' state.
    """

    lanes: Records
    points: Floats
    along: Floats
    kerb_points: Floats
    next: Ints
    conflict_first: Ints
    conflict: Ints
    crossings: Ints
    crossings_cleared: Floats
    route_first: Ints
    route: Ints
    goal_edge: Ints
    goal_next: Ints
    places: Records
    way_points: Records
    tracks: Records


class WalkwayNetwork(NamedTuple):
    """Where pedestrians walk, in the order of `Walkways`.

    `shut` and `light` change, in the copy that each `Traffic` has.

    Attributes
    ----------
    walkways
        Dtype `WALKWAY`.
    first, points, along
        Walkway ``i``'s centre line is ``points[first[i]:first[i + 1]]``, metres; `along` the distances along it.
    room
        How far a walker's centre may be to the left and to the right of the centre line, and the same for who has to
        get past somebody, from each point to the next, metres, shape ``(points, 4)``.
    meeting_first, meeting
        Walkways at meeting point ``k``: ``meeting[meeting_first[k]:meeting_first[k + 1]]``.
    goal_walkway, goal_away
        Walkway of each goal of pedestrians whose route is given, int32, shape ``(goals,)``, and how far it is from each
        meeting point, metres, shape ``(goals, meeting points)``.
    spots, spot_first
        Where people stand beside walkway ``i``: ``spots[spot_first[i]:spot_first[i + 1]]``, dtype `SPOT`.
    """

    walkways: Records
    first: Ints
    points: Floats
    along: Floats
    room: Floats
    meeting_first: Ints
    meeting: Ints
    goal_walkway: Ints
    goal_away: Floats
    spots: Records
    spot_first: Ints


class Claims(NamedTuple):
    """Who has a right to what in junctions that several vehicles may be in: worked out anew in each step.

    Attributes
    ----------
    exclusive
        Junction clusters that have one occupant at a time, bool, shape ``(clusters,)``.
    any_shared
        Whether there are others.
    alone
        Vehicle that has a cluster to itself, being long; `NONE` for none, int32, shape ``(clusters,)``.
    taken_by
        Vehicle that has been let into a junction over the lane, `NONE` for nobody, `SEVERAL` for more than one, int32,
        shape ``(lanes,)``.
    to_come
        Metres that those need to stand on who have been let in over the lane and are not beyond it, shape ``(lanes,)``.
    longest_lane_wait
        Longest that a vehicle in the queue for a shared cluster has waited that wants to take the lane, seconds, shape
        ``(lanes,)``.
    """

    exclusive: NDArray[np.bool_]
    any_shared: bool
    alone: Ints
    taken_by: Ints
    to_come: Floats
    longest_lane_wait: Floats


class JunctionState(NamedTuple):
    """Who is in each junction cluster, and who wants over each crossing.

    Attributes
    ----------
    holder
        Vehicle that has the junction cluster to itself, `NONE` for nobody, int32, shape ``(clusters,)``; one of them
        where several may be in it.
    walkers_on
        Pedestrians on each crossing or just off it, int32, shape ``(walkways,)`` as everything about crossings.
    walker_wait
        Longest that a pedestrian has waited for it so far, seconds.
    vehicle_wait
        Longest that a vehicle which lets pedestrians go first has waited, seconds.
    longest_wait
        Longest that a vehicle in the queue for the cluster has waited, seconds, shape ``(clusters,)``; where several
        may be in it, one that wants it to itself.
    crossing_busy
        Whether a vehicle is on the crossing or has been let over it.
    longest_exit_wait
        Longest that a vehicle has waited for room to stand on the lane, having left a junction, seconds, shape
        ``(lanes,)``.
    claims
        Not part of the state.
    """

    holder: Ints
    walkers_on: Ints
    walker_wait: Floats
    vehicle_wait: Floats
    longest_wait: Floats
    crossing_busy: NDArray[np.bool_]
    longest_exit_wait: Floats
    claims: Claims

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Return the arrays of the state by name, not copied."""
        return {name: array for name, array in self._asdict().items() if name != "claims"}


@dataclass(frozen=True)
class BusRoutes:
    """Where buses drive and start.

    Attributes
    ----------
    routes
        Closed sequences of lane numbers.
    buses
        Route of each bus.
    starts
        Each bus's position in its route and distance along that lane (metres) at the start.
    """

    routes: Sequence[Sequence[int]] = field(default_factory=list)
    buses: Sequence[int] = field(default_factory=list)
    starts: Sequence[tuple[int, float]] = field(default_factory=list)


def new_fleet(n: int, seed: int) -> Records:
    """Return `n` vehicles, dtype `VEHICLE`, that have no parameters and no place yet."""
    fleet = np.zeros(n, VEHICLE)
    fleet["index"] = np.arange(n)
    for name in (
        "previous_lanes",
        "planned_lanes",
        "held_junctions",
        "blocker",
        "gives_way_to",
        "queued_junction",
        "queued_exit",
        "kept_out_from",
        "stop_route_index",
        "goal",
        "place",
    ):
        fleet[name] = NONE
    fleet["target_speed"] = TOP_SPEED
    fleet["way_offset"] = -1.0
    fleet["random"] = _random_streams(seed, "turns", n)
    return fleet


def new_pedestrians(n: int, seed: int) -> Records:
    """Return `n` pedestrians, dtype `PEDESTRIAN_RECORD`, that have no place yet."""
    random = rng(seed, "traffic", "paces")
    walkers = np.zeros(n, PEDESTRIAN_RECORD)
    walkers["direction"] = 1
    walkers["lateral_share"] = random.uniform(0.1, 0.95, n)
    walkers["preferred_speed"] = random.uniform(1.0, 1.5, n)
    walkers["leaving_crossing"] = walkers["goal"] = walkers["leader"] = NONE
    walkers["spot"] = walkers["boards"] = walkers["aboard"] = NONE
    walkers["group_size"] = 1
    walkers["gait_time"] = -GAIT_TIME
    walkers["random"] = _random_streams(seed, "ways", n)
    return walkers


def new_junctions(clusters: int, walkways: int, lanes: int, *, shared: bool = False) -> JunctionState:
    """Return the state of junctions nobody is in and crossings nobody is on.

    Parameters
    ----------
    shared
        Whether several vehicles may be in a junction.
    """
    clusters = max(clusters, 1)
    claims = Claims(
        exclusive=np.full(clusters, not shared),
        any_shared=shared,
        alone=np.full(clusters, NONE, np.int32),
        taken_by=np.full(lanes, NONE, np.int32),
        to_come=np.zeros(lanes),
        longest_lane_wait=np.zeros(lanes),
    )
    return JunctionState(
        holder=np.full(clusters, NONE, np.int32),
        walkers_on=np.zeros(walkways, np.int32),
        walker_wait=np.zeros(walkways),
        vehicle_wait=np.zeros(walkways),
        longest_wait=np.zeros(clusters),
        crossing_busy=np.zeros(walkways, np.bool_),
        longest_exit_wait=np.zeros(lanes),
        claims=claims,
    )


def _random_streams(seed: int, name: str, n: int) -> NDArray[np.uint64]:
    return rng(seed, "traffic", name).integers(0, 2**63, n, dtype=np.uint64)
