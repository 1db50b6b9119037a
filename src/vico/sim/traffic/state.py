"""Arrays of traffic: rows of lanes, vehicles, walkways, pedestrians and stopping places, their codes, and the networks.

One row a lane, vehicle, junction, walkway or pedestrian, as records of NumPy structured arrays: a kernel's `vehicle`
is one row of the fleet, `vehicle.speed` its speed. Records cost a kernel nothing to pass on, unlike tuples of arrays.
Positions are local ENU metres, headings radians counter-clockwise from east. "Distance along a lane" runs from the
lane's start in metres; a vehicle is where its front is. Vehicles and pedestrians have a stream of random numbers each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.io.compiled import compiled
from vico.seeds import rng

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]
Records = NDArray[np.void]

PREVIOUS_LANES = 32  # lanes behind a vehicle that are remembered
PLANNED_LANES = 48  # lanes ahead that can be planned
HELD_JUNCTIONS = 6  # junctions a vehicle can hold at once
TOP_SPEED = 13.9  # m/s, whatever the street allows
NONE = -1  # no lane, junction, route, body: wherever an index may be missing
SEVERAL = -2  # more than one vehicle
#: Where a vehicle is: on the streets, out of the world, or out of it and to come back as soon as there is room.
PRESENT, AWAY, COMING = range(3)
#: Whether a car stops at a place beside the road: it drives, comes to the place, backs into it, stands there, or waits
#: for a gap to leave it. In car parks, besides: it is on the way in, backs into the aisle, or is on the way out.
DRIVING, APPROACHING, BACKING_IN, STANDING, LEAVING, DRIVING_IN, BACKING_OUT, DRIVING_OUT = range(8)
#: What a signal shows.
DARK, GREEN, AMBER, RED = range(4)

_F, _I, _B = np.float64, np.int32, np.bool_

#: A lane that vehicles drive.
LANE = np.dtype(
    [
        ("first_point", _I),  # its centre line: points from this one ...
        ("end_point", _I),  # ... to before this one
        ("length", _F),  # m
        ("speed", _F),  # speed limit, m/s
        ("junction", _I),  # junction cluster that a vehicle on it must hold alone, NONE between junctions
        ("inside", _I),  # junction it lies in, NONE for street lanes
        ("edge", _I),  # street (one direction) it belongs to
        ("closed", _B),  # whether cars keep off
        ("shut", _B),  # whether an event keeps cars off: they take it where there is no other way left
        ("left", _I),  # neighbour lanes in the same direction, NONE for none
        ("right", _I),
        ("first_next", _I),  # lanes that follow it: `next` from here ...
        ("end_next", _I),  # ... to before here
        ("first_crossing", _I),  # crossings it runs over: `crossings` from here ...
        ("end_crossing", _I),  # ... to before here
        ("u_turn", _B),  # whether it turns back
        ("turn", np.int8),  # in junctions: 1 where it turns left, -1 right, 0 straight on
        ("leaves", _B),  # whether it ends where the map cuts the street off
        ("light", np.uint8),  # what its signal shows who wants onto it: DARK, GREEN, AMBER or RED
        ("first_place", _I),  # places beside it where cars stop: `places` from here ...
        ("end_place", _I),  # ... to before here
        ("first_track", _I),  # places where tracks of trams cross it: `tracks` from here ...
        ("end_track", _I),  # ... to before here
        ("stop_line", _F),  # m before its end at which vehicles stop that may not enter the junction
    ],
    align=True,
)

#: Where tracks of trams cross a lane at an angle: metres along it, and whether a tram is there or comes.
TRACK_CROSSING = np.dtype([("lane", _I), ("start", _F), ("end", _F), ("called", _B)], align=True)

#: A place where cars stop: a parking spot at the kerb, or the edge of a lane for deliveries.
STOPPING_PLACE = np.dtype(
    [
        ("lane", _I),
        ("middle", _F),  # metres along the lane
        ("side", _F),  # metres to the left of the lane's middle
        ("longest", _F),  # vehicle that fits, m
        ("taper", _F),  # metres along the lane that it takes to get there, or away
        ("reverse", _B),  # whether one backs into it: who drives in forwards would touch what stands behind it
        ("delivery", _B),  # whether it is for deliveries
        ("lot", _I),  # car park it is in, NONE for none; the rest is of these alone
        ("first_in", _I),  # the way in: `way_points` from this one ...
        ("end_in", _I),  # ... to before this one
        ("first_back", _I),  # the way on which one backs out, in the direction one faces
        ("end_back", _I),
        ("first_out", _I),  # the way out, which begins as that one does
        ("end_out", _I),
        ("in_rest", _F),  # metres along the way in of the spot's middle
        ("back_rest", _F),  # the same along the way on which one backs out
        ("out_lane", _I),  # lane that the way out comes to
        ("out_offset", _F),  # metres along that lane where it does
        ("out_joint", _F),  # metres along the way out of the same point
        ("out_side", _F),  # 1 for a turn to the left there, -1 to the right
        ("hold", _F),  # metres along the way out of the front of a car that waits for a gap
    ],
    align=True,
)

#: What does not change about a vehicle, or follows from the weather.
VEHICLE_PARAMETERS: list[tuple[Any, ...]] = [
    ("index", _I),  # its row in the fleet, and its body in `Shapes`
    ("length", _F),  # of its outline, m
    ("half_width", _F),  # of its outline, m
    ("overhang", _F),  # from its front to the front axle, m
    ("wheelbase", _F),  # between its axles, m
    ("acceleration", _F),  # greatest, m/s^2; this and the next three follow the weather
    ("braking", _F),  # that its driver likes, m/s^2
    ("hard_braking", _F),  # the most its tyres can do, m/s^2
    ("time_gap", _F),  # that its driver keeps behind another vehicle, s
    ("speed_factor", _F),  # share of the speed limit it drives at
    ("route", _I),  # bus route it follows, NONE for cars
    ("delivers", _B),  # whether it is a van that makes deliveries
    ("is_bicycle", _B),  # whether it is a bicycle, that keeps to the kerb
]

#: What changes about a vehicle: its state, that is hashed and saved.
VEHICLE_STATE: list[tuple[Any, ...]] = [
    ("lane", _I),  # lane its front is on
    ("offset", _F),  # distance of its front along that lane, m
    ("speed", _F),  # along its path, m/s
    ("previous_lanes", _I, (PREVIOUS_LANES,)),  # lanes it came over, the last one first, NONE after them
    ("planned_lanes", _I, (PLANNED_LANES,)),  # lanes it will take, the next one first
    ("planned_count", _I),  # how many of them are set
    ("granted_count", _I),  # how many it may drive without asking: up to the last junction it was let into
    ("held_junctions", _I, (HELD_JUNCTIONS,)),  # junction clusters it holds, NONE in free slots
    ("lateral_offset", _F),  # where a lane change under way began, m to the left of the new lane; 0 without one
    ("lane_change_distance", _F),  # driven since that lane change began, m
    ("lane_change_length", _F),  # metres it takes; less than 0: the lane is left, and so many metres are left of it
    ("blocker", _I),  # body it stands behind, an index into the step's `Shapes`; NONE while it drives
    ("target_speed", _F),  # most it drives, m/s: what a bus's timetable asks for
    ("gives_way_to", _I),  # vehicle it backed up for and lets pass now, NONE for nobody
    ("gave_way_for", _F),  # how long it has let that one pass, s
    ("stopped_time", _F),  # how long it has stood, s; 0 at a bus stop
    ("junction_wait", _F),  # how long it has stood before a junction it asked for and did not get, s
    ("queued_junction", _I),  # junction cluster that somebody else has, or has waited longer for; else NONE
    ("queued_exit", _I),  # lane beyond the junction on which there is no room for it to stand; else NONE
    ("kept_out_from", _I),  # lane at whose end somebody waits who stands in its way to that room; else NONE
    ("time_since_lane_change", _F),  # s
    ("route_index", _I),  # buses: position of its lane in its route
    ("stop_route_index", _I),  # buses: position in its route of the lane with the next stop
    ("stop_offset", _F),  # the stop's distance along that lane, m; cars: where one that comes to a place stops first
    ("at_stop", _B),  # whether it stands at its stop with its doors open, or at a place where cars stop
    ("stopping", np.uint8),  # cars: DRIVING, APPROACHING and so on
    ("way_offset", _F),  # distance of its front along its way in a car park, m; less than 0 for who goes to none
    ("place", _I),  # cars: place where it stops, an index into the network's; NONE for none
    ("stay_left", _F),  # cars: how long it goes on standing there, or tries to get there, s
    ("presence", np.uint8),  # buses: PRESENT, AWAY or COMING; its body is far off unless it is present
    ("goal", _I),  # cars: goal it drives to, an index into the network's; NONE for none
    ("goal_end", _I),  # cars: the one after its last goal
    ("lights", np.uint8),  # lights it shows: bits as `vico.sim.traffic.lights` has them
    ("laps", _I),  # cars: how often it has left the map and come back in
    ("teleports", _I),  # cars: how often it was taken out of a jam and brought back in at the map's edge
    ("random", np.uint64),  # state of its stream of random numbers
]

VEHICLE = np.dtype([*VEHICLE_PARAMETERS, *VEHICLE_STATE], align=True)

#: A walkway: a stretch of sidewalk, a crossing or a corner; `Walkways` documents it.
WALKWAY = np.dtype(
    [
        ("length", _F),  # m
        ("kind", np.uint8),  # SIDEWALK, CROSSING or CORNER
        ("shut", _B),  # whether an event keeps people off
        ("light", np.uint8),  # crossings: what its signal shows, as that of a lane
        ("start", _I),  # meeting points at its ends
        ("end", _I),
    ],
    align=True,
)

#: Why a pedestrian stands, or follows a point of its own: it looks into a window, talks, waits at a stop; from `LED` on
#: others say where and how long: it boards a bus, or belongs to an event's crowd.
WINDOW, TALK, STOP, BOARD, CROWD = range(1, 6)
LED = BOARD
#: A spot beside a walkway at which people stand.
SPOT = np.dtype(
    [
        ("x", _F),  # ENU metres
        ("y", _F),
        ("yaw", _F),  # where one looks, rad
        ("walkway", _I),
        ("offset", _F),  # metres along it
        ("kind", np.uint8),  # WINDOW, TALK or STOP
        ("partner", _I),  # TALK: spot of the other one, NONE for none
        ("stop", _I),  # STOP: number of the bus stop, NONE for none
    ],
    align=True,
)

#: Longest time that `gait_time` counts, s.
GAIT_TIME = 2.0
#: A pedestrian; it follows a point that runs a little ahead of it along its walkway.
PEDESTRIAN_RECORD = np.dtype(
    [
        ("walkway", _I),  # walkway the followed point is on
        ("offset", _F),  # distance of that point along the walkway, m
        ("direction", _I),  # 1 along the walkway, -1 against it
        (
            "lateral_share",
            _F,
        ),  # how far right of the middle of its room it walks: 0 in the middle, 1 at the edge, less than 0 left of it
        ("preferred_speed", _F),  # m/s
        ("speed", _F),  # measured over the last step, m/s
        ("distance_walked", _F),  # since the start, m
        ("set_out", _F),  # `distance_walked` when it last set out, and what it has walked on treads since, m
        ("gait_time", _F),  # since it set out, or since it stopped if negative, s; counted up to `GAIT_TIME`
        ("tread", _F),  # depth of the treads that it walks on, m; 0 off stairs
        ("tread_before", _F),  # the same before that changed last
        ("tread_time", _F),  # since it changed, s; counted up to `GAIT_TIME`
        ("tread_cycles", _F),  # cycles of its gait on treads since it set out
        ("change_walked", _F),  # metres off treads between when it set out and when the treads changed
        ("change_cycles", _F),  # `tread_cycles` when they changed
        ("stuck_time", _F),  # within a metre of `progress_xy` since it last turned round, s
        ("jammed_time", _F),  # within a metre of `progress_xy`, s
        ("progress_xy", _F, (2,)),  # where it last got on, m
        ("crossing_wait", _F),  # how long it has waited for a crossing, s
        ("before_tram", _B),  # whether a tram stands and waits for it to go
        ("goal", _I),  # goal it walks to, an index into the network's; NONE for none
        ("goal_end", _I),  # the one after its last goal
        ("leaving_crossing", _I),  # crossing its body may still be on, NONE for none
        ("leaving_since", _F),  # `distance_walked` when its point left that crossing, m
        ("leader", _I),  # pedestrian whom it walks with and who decides the way, NONE for who walks alone or leads
        ("group_size", _I),  # how many walk together, 1 for who walks alone
        ("group_place", _I),  # 0 who leads, then 1, 2 from right to left or from front to back
        ("apart", _F),  # how far it is from who leads it, who leads from the farthest companion, m; 0 alone
        ("parted_time", _F),  # who leads: how long somebody has been left behind, s
        ("in_file", _F),  # how long it walks behind instead of beside for somebody who comes, s
        ("stand_kind", np.uint8),  # why it stands, or follows a point of its own; 0 for who walks along walkways
        ("spot", _I),  # spot at which it stands or to which it goes, NONE for none
        ("stand_time", _F),  # how long it goes on standing, s
        ("stand_xy", _F, (2,)),  # where it stands or goes, ENU metres
        ("stand_yaw", _F),  # where it looks then, rad
        ("event", _I),  # event of the city that it goes to or is at, 0 for none
        ("place", _I),  # its number there
        ("boards", _I),  # bus to whose door it goes, NONE for none
        ("aboard", _I),  # bus it rides in, NONE for none
        ("stops_left", _I),  # how many stops it still rides
        ("random", np.uint64),  # state of its stream of random numbers
    ],
    align=True,
)


@compiled
def next_random(owner):
    """Return a number in 0..1 from the stream of a vehicle or pedestrian (splitmix64: one word of state, `random`)."""
    z = owner.random + np.uint64(0x9E3779B97F4A7C15)
    owner.random = z
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return float(z >> np.uint64(11)) / 9007199254740992.0


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
