"""Travelling by a trip: on foot, by bus, tram and bicycle, leg by leg, and planning anew when a trip fails.

Legs of a trip under way are saved as plain data. A bicycle with its rider is longer than wide and does not go
backwards, so in a narrow passage it can't be turned about where it stands. `find_way_out` finds the few turns and
metres straight on that lead out, by breadth-first search over where the bicycle is and which way it points.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Collection, Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from vico.agents.base import Action, AgentState, Info, Observation, heading
from vico.agents.day_plan import RUN_PACE
from vico.agents.wayfinding import Walker, closed_ground
from vico.rules import BIKE_SPEED, BUS_DWELL, STATION_REACH, TRAM_WIDTH, WALK_SPEED, ReasonCode, code_name
from vico.world.model import Point2
from vico.world.public import PublicMap
from vico.world.transit import Line, Stop, TramLine, TramStop
from vico.world.trips import AHEAD, MODES, Closure, Leg, Trip
from vico.world.walkable import ROADWAY, WalkableMap

__all__ = [
    "TURNING_CLEARANCE",
    "Traveller",
    "TripPlanner",
    "can_ride_out",
    "find_way_out",
    "leg_from_state",
    "leg_state",
]
_LEG_FIELDS = ("mode", "depart", "arrive", "metres", "price", "line", "origin", "destination")


def leg_state(leg: Leg) -> dict[str, Any]:
    """Return a leg as plain data."""
    fields = {name: getattr(leg, name) for name in _LEG_FIELDS}
    return fields | {"start": list(leg.start), "end": list(leg.end), "polyline": leg.polyline.copy()}


def leg_from_state(state: dict[str, Any]) -> Leg:
    """Return the leg that `leg_state` returned as data."""
    start, end = ((float(x), float(y)) for x, y in (state["start"], state["end"]))
    polyline = np.array(state["polyline"], np.float64).reshape(-1, 2)
    return Leg(start=start, end=end, polyline=polyline, **{name: state[name] for name in _LEG_FIELDS})


#: Where walls are no nearer than this, metres, a bicycle is turned about with ease.
TURNING_CLEARANCE = 0.9
# Room to walls that a bicycle needs, metres, at these points along it.
_SIDE_CLEARANCE = 0.28
_BICYCLE_SAMPLES = (-0.6, -0.4, -0.2, 0.0, 0.2, 0.4, 0.6)
_TURN_STEP = 15  # degrees of a turn of the search
_RIDE_STEP = 0.5  # metres of a ride of the search
_SEARCH_CELL = 0.25  # metres within which places are the same to it
_HEADINGS = 360 // _TURN_STEP
_MAX_SEARCH_NODES = 1500
# Where one gets on: on the spot or a step or two aside, as the rules of mounting have it.
_MOUNT_OFFSETS = [(0.0, 0.0)] + [
    (r * math.cos(k * math.pi / 4), r * math.sin(k * math.pi / 4)) for r in (0.9, 1.8) for k in range(8)
]

# x, y and the direction: steps of `_DEGREES` from where the bicycle points at first.
_BicyclePose = tuple[float, float, int]


def find_way_out(walkable: WalkableMap, position: Sequence[float], heading: float) -> list[Action] | None:
    """Return the fewest actions that bring a bicycle to where it is turned about with ease.

    Parameters
    ----------
    position
        Of the rider, ENU metres.
    heading
        Counter-clockwise from east, radians.

    Returns
    -------
    list of dict or None
        Empty where it is wide already; None if no way out was found.
    """
    x, y = float(position[0]), float(position[1])
    found = _search_manoeuvre(walkable, [(x, y, 0)], heading)
    if found is None:
        return None
    actions: list[Action] = []
    for (ax, ay, before), (bx, by, after) in pairwise(found):
        if before == after:
            # Whole steps: by rounding alone the longest would be a little more than is allowed.
            steps = round(math.hypot(bx - ax, by - ay) / _RIDE_STEP)
            actions.append({"type": "move_forward", "distance": steps * _RIDE_STEP})
        else:
            turn = ((after - before) * _TURN_STEP + 180) % 360 - 180
            actions.append({"type": "turn_left" if turn > 0 else "turn_right", "degrees": float(abs(turn))})
    return actions


def can_ride_out(walkable: WalkableMap, station: Point2) -> bool:
    """Return whether a bicycle that one gets on at a station can be ridden to where there is room to turn it."""
    poses = [
        (station[0] + east, station[1] + north, turned)
        for east, north in _MOUNT_OFFSETS
        for turned in range(0, _HEADINGS, 45 // _TURN_STEP)
    ]
    return _search_manoeuvre(walkable, [pose for pose in poses if _bicycle_fits(walkable, pose, 0.0)], 0.0) is not None


def _search_manoeuvre(
    walkable: WalkableMap, starts: Sequence[_BicyclePose], heading: float
) -> list[_BicyclePose] | None:
    """Return the poses from a start to where it is wide, with the fewest actions; None if there are none."""
    before: dict[tuple[int, int, int], _BicyclePose | None] = {}
    queue: deque[_BicyclePose] = deque()
    for pose in starts:
        if _pose_key(pose) not in before:
            before[_pose_key(pose)] = None
            queue.append(pose)
    for _ in range(_MAX_SEARCH_NODES):
        if not queue:
            return None
        pose = queue.popleft()
        if walkable.clearance_of(pose[0], pose[1]) >= TURNING_CLEARANCE:
            path = [pose]
            while (parent := before[_pose_key(path[-1])]) is not None:
                path.append(parent)
            return path[::-1]
        for onward in _next_poses(walkable, pose, heading):
            if _pose_key(onward) not in before:
                before[_pose_key(onward)] = pose
                queue.append(onward)
    return None


def _next_poses(walkable: WalkableMap, pose: _BicyclePose, heading: float) -> Iterator[_BicyclePose]:
    """Yield where one action leads: straight on, or turned to either side as far as nothing is in the way."""
    x, y, turned = pose
    angle = heading + math.radians(turned * _TURN_STEP)
    for k in range(1, int(BIKE_SPEED / _RIDE_STEP) + 1):
        ahead = (x + k * _RIDE_STEP * math.cos(angle), y + k * _RIDE_STEP * math.sin(angle), turned)
        if not _bicycle_fits(walkable, ahead, heading):
            break
        yield ahead
    for side in (1, -1):
        for k in range(1, _HEADINGS // 2 + 1):
            about = (x, y, (turned + side * k) % _HEADINGS)
            if not _bicycle_fits(walkable, about, heading):
                break
            yield about


def _bicycle_fits(walkable: WalkableMap, pose: _BicyclePose, heading: float) -> bool:
    x, y, turned = pose
    angle = heading + math.radians(turned * _TURN_STEP)
    c, s = math.cos(angle), math.sin(angle)
    return all(walkable.clearance_of(x + along * c, y + along * s) >= _SIDE_CLEARANCE for along in _BICYCLE_SAMPLES)


def _pose_key(pose: _BicyclePose) -> tuple[int, int, int]:
    return round(pose[0] / _SEARCH_CELL), round(pose[1] / _SEARCH_CELL), pose[2]


# As near as this is there. Beside the spot will do, but not on the road or so near to the middle of a track that one
# would keep the bus or tram from coming up.
_AT_STOP = 0.3  # metres from where one waits for a bus
_BY_STOP = 1.5  # metres, where something stands in that spot
_BY_OTHERS = 4.0  # metres, among others and where one has got nowhere for some seconds
_AT_RACK = 1.0  # metres from a rack
_FROM_TRACK, _GETS_NOWHERE = TRAM_WIDTH / 2 + 0.8, 3
# A bicycle is turned where there is so much room to walls, metres; straight on narrower ways will do.
_TURNING = 1.0
# A bicycle is left this near to the middle of its rack, metres.
_TO_RACK = STATION_REACH - 1.0
# Riders sit this near to the place to wait when their bus stands at a stop, metres.
_BUS_AT_STOP = 12.0
# A bus that is this late is not waited for, nor any other of its line on this way, and one that is this late aboard is
# left; seconds.
_LATE, _LOST = 240.0, 300.0
# Who comes so late by the way that is meant, seconds, is not late.
_GRACE = 60.0
# After so many seconds of trying when the bus should be there one steps back from the road for as long, so many metres;
# who stands on the road or a track for as long, as one gets no nearer to a stop, does without it.
_IN_THE_WAY, _STEP_BACK = 15, 2.5
# From so long before a bus is to leave who waits beside the place for it tries to come up to it, seconds.
_COMES_UP = 10.0
# So long before a bus is to leave one tries to board: it stands for half a minute, and may be early.
_EARLY = 2 * BUS_DWELL
# Stands who has moved less than this in a second, metres; a bus stands that has for so many seconds.
_STILL, _STANDSTILL_SECONDS = 0.05, 3
# How often one looks for another spot to get on a bicycle before going elsewhere.
_TRIES = 4
# How often one tries to turn a bicycle where it is narrow before leaving it there: that costs as much as 100 minutes.
_PUSHES = 120

#: Modes in which one is taken along.
_TRANSIT_MODES = ("bus", "tram")

_NO_VEHICLE, _NO_FREE_SPOT, _NO_MONEY, _CLOSED, _HIT_BODY = map(
    code_name,
    (
        ReasonCode.NO_VEHICLE,
        ReasonCode.NO_FREE_SPOT,
        ReasonCode.NO_MONEY,
        ReasonCode.CLOSED,
        ReasonCode.HIT_BODY,
    ),
)


#: Plans a trip from what one observes to a point, without what was found to be out of use (ids, closed ground); None if
#: there is none. For who rides a bicycle it begins with a leg of mode ``bike``; one without a destination ends at its
#: end with the rider on the bicycle still, who keeps it.
TripPlanner = Callable[[Observation, tuple[float, float], tuple[Closure, ...]], Trip | None]


class Traveller:
    """Goes from door to door by the trip that arrives first, from observations and the public map alone.

    It walks to the stop, waits, boards, gets off where it planned to, takes a bicycle and brings it back to a station.
    When a bus is gone or late, a rack empty or the money short, it plans anew from where it is.

    Parameters
    ----------
    public_map
        Streets, timetables and stations.
    generator
        Decides how to get around others.
    modes
        Ways to get about that it may choose, of `vico.world.trips.MODES`.
    planner
        Plans its trips; None: the trip that arrives first.
    fastest
        Metres a second that it does not exceed on foot.

    Attributes
    ----------
    trip
        The trip under way, None without one.
    plans
        How many trips were planned so far.
    """

    def __init__(
        self,
        public_map: PublicMap,
        generator: np.random.Generator,
        *,
        modes: Collection[str] = MODES,
        planner: TripPlanner | None = None,
        fastest: float = RUN_PACE,
    ) -> None:
        self._map = public_map
        self._rng = generator
        self._modes = tuple(modes)
        self._planner, self._fastest = planner, fastest
        self._walker = Walker(public_map, generator)
        self._goal: tuple[float, float] | None = None
        self.trip: Trip | None = None
        self.plans = 0
        self._leg = 0
        # Stations that had no bicycle, or none one could get on, and lines waited for in vain. Lines there is no
        # money for need no note: it is seen.
        self._closed: list[str] = []
        # Whether no trip to the goal was begun yet; and how one means to make it.
        self._fresh = True
        self._ride: tuple[str, float] | None = None
        self._without: tuple[str, ...] = ()
        # Ground that events close, as the agent is told anew in every step.
        self._ground: list[tuple[float, float, float]] = []
        self._asked = ""
        self._tries = 0
        # What is still to be done to get a bicycle out of a narrow place.
        self._out: list[Action] = []
        self._last: tuple[float, float] | None = None
        self._still = 0

    def state(self) -> AgentState:
        """Return the trip under way; the generator is its owner's to save."""
        trip = self.trip
        return {
            "walker": self._walker.state(),
            "goal": None if self._goal is None else list(self._goal),
            "depart": None if trip is None else trip.depart,
            "legs": {} if trip is None else {str(k): leg_state(leg) for k, leg in enumerate(trip.legs)},
            "plans": self.plans,
            "leg": self._leg,
            "closed": list(self._closed),
            "fresh": self._fresh,
            "asked": self._asked,
            "tries": self._tries,
            "out": [dict(action) for action in self._out],
            "last": None if self._last is None else list(self._last),
            "still": self._still,
        }

    def restore(self, state: AgentState) -> None:
        """Go on with the trip that `state` returned."""
        self._walker.restore(state["walker"])
        self._goal = None if state["goal"] is None else (float(state["goal"][0]), float(state["goal"][1]))
        legs = tuple(leg_from_state(state["legs"][str(k)]) for k in range(len(state["legs"])))
        self.trip = None if state["depart"] is None else Trip(float(state["depart"]), legs)
        self.plans, self._leg = int(state["plans"]), int(state["leg"])
        self._closed, self._asked = [str(name) for name in state["closed"]], str(state["asked"])
        self._fresh = bool(state["fresh"])
        self._tries, self._still = int(state["tries"]), int(state["still"])
        self._out = [dict(action) for action in state["out"]]
        self._last = None if state["last"] is None else (float(state["last"][0]), float(state["last"][1]))

    def stop(self) -> None:
        """Forget the trip; who is in a bus gets off at its next stop, who rides a bicycle takes it to a station."""
        self._goal, self.trip, self._closed, self._fresh = None, None, [], True
        self._walker.stop()

    @property
    def waits_for_bus(self) -> bool:
        """Whether it stands at a stop until its bus comes."""
        return (
            self.trip is not None
            and self._leg < len(self.trip.legs)
            and self.trip.legs[self._leg].mode in _TRANSIT_MODES
        )

    @property
    def way(self) -> list[tuple[float, float]]:
        """Corners of the trip still to come, ENU metres."""
        legs = [] if self.trip is None else self.trip.legs[self._leg + 1 :]
        return [*self._walker.way, *((float(x), float(y)) for leg in legs for x, y in leg.polyline)]

    def remaining(self, position: Sequence[float]) -> float:
        """Metres still to walk on the present leg."""
        return self._walker.remaining(position)

    def towards(
        self,
        goal: tuple[float, float],
        observation: Observation,
        info: Info,
        *,
        speed: float = WALK_SPEED,
        ride: tuple[str, float] | None = None,
        without: Collection[str] = (),
    ) -> Action | None:
        """Return the next action on the way to a point; None once there, or if there is no way.

        Parameters
        ----------
        goal
            ENU metres; a point outdoors. Who is in a building goes out first.
        speed
            Metres a second on foot, up to 2.5; to a bus that would be missed it goes faster.
        ride
            Mode that is meant, and the second of the day by which one wants to be there: if a trip by it is there in
            time, or a minute later, that is made. Where it fails (a bus gone or full, a rack empty) the trip that
            arrives first is.
        without
            Modes that one does not choose now; what was begun is gone on with.
        """
        if goal != self._goal:
            self.stop()
            self._goal = goal
        if info.get("coming_out"):  # of a door: nobody does anything else meanwhile
            return {"type": "wait"}
        self._notice(observation)
        self._ride, self._without, self._ground = ride, tuple(without), closed_ground(info)
        action = self._act(goal, observation, info, speed)
        self._asked = "" if action is None else str(action["type"])
        return action

    def _notice(self, observation: Observation) -> None:
        x, y = (float(v) for v in observation["pose"][:2])
        moved = math.inf if self._last is None else math.hypot(x - self._last[0], y - self._last[1])
        self._still = self._still + 1 if moved < _STILL else 0
        self._last = x, y

    def _act(self, goal: tuple[float, float], observation: Observation, info: Info, speed: float) -> Action | None:
        vehicle = observation["state"]["vehicle"]
        if vehicle in ("bus", "tram", "train"):
            return self._ride_bus(observation)
        if vehicle == "bike":
            return self._ride_bike(goal, observation, info)
        leg = self._leg_on_foot(goal, observation)
        if leg is None:
            return None
        if leg.mode in _TRANSIT_MODES:
            return self._board(leg, observation, info)
        if leg.mode == "bike":
            return self._mount(leg, observation, info)
        last = self.trip is not None and self._leg == len(self.trip.legs) - 1
        pace = self._pace(observation, speed)
        action = self._walker.towards(goal if last else leg.end, pace, observation, info)
        if action is not None or last:
            return action
        return self._at_the_ways_end(leg, observation)

    def _at_the_ways_end(self, leg: Leg, observation: Observation) -> Action:
        """Begin the ride from as near as one gets, as others stand in the place for it; do without it from farther."""
        assert self.trip is not None
        ride = self.trip.legs[self._leg + 1]
        away = _distance_to(observation, ride.start)
        # Nobody waits at a rack: there one is in no bus's way.
        is_in_the_way = ride.mode in _TRANSIT_MODES and self._is_in_the_way(observation["pose"][:2])
        if away > _BY_OTHERS or (is_in_the_way and self._still >= _IN_THE_WAY):
            self._close(leg)
        elif not is_in_the_way:
            self._leg += 1
        self._walker.stop()
        return {"type": "wait"}

    def _leg_on_foot(self, goal: tuple[float, float], observation: Observation) -> Leg | None:
        """Return the leg that is due for who is in no vehicle, planning if need be; None without a trip."""
        trip = self.trip
        if trip is not None and self._asked in ("exit_bus", "exit_bike"):
            # Got off: where it was planned, or somewhere else.
            leg = trip.legs[self._leg]
            if _distance_to(observation, leg.end) > _BUS_AT_STOP:
                trip = None
            self._leg, self._tries = self._leg + 1, 0
        self.trip = trip
        trip = self.trip or self._begin(goal, observation)
        if trip is None:
            return None
        leg = trip.legs[self._leg]
        rides_next = leg.mode == "walk" and self._leg < len(trip.legs) - 1
        if rides_next and self._is_at_the_ride(trip.legs[self._leg + 1], observation):
            self._leg += 1
            self._walker.stop()
            leg = trip.legs[self._leg]
        return leg

    def _begin(self, goal: tuple[float, float], observation: Observation) -> Trip | None:
        """Plan a trip and begin it; None if there is none."""
        self.trip, self._leg, self._tries = self._plan_trip(goal, observation), 0, 0
        self.plans += 1
        return self.trip

    def _plan_trip(self, goal: tuple[float, float], observation: Observation) -> Trip | None:
        """Return the trip that is meant, if there is one in time; else the one that arrives first."""
        if self._planner is not None:
            return self._planner(observation, goal, (*self._closed, *self._ground))
        state = observation["state"]
        here, now, cash = observation["pose"][:2], float(state["time"]), float(state["cash"])
        meant, self._fresh = self._ride if self._fresh else None, False
        if meant is not None and meant[0] not in self._without:
            mode, due = meant
            trip = self._map.trips.plan(here, goal, now, modes=(mode,), cash=cash, closed=self._ground)
            if trip is not None and trip.arrive <= due + _GRACE:
                return trip
        closed: list[Closure] = [*self._closed, *self._ground]
        modes = tuple(mode for mode in self._modes if mode not in self._without)
        return self._map.trips.plan(here, goal, now, modes=modes, cash=cash, closed=closed)

    def _pace(self, observation: Observation, speed: float) -> float:
        """Return the speed on foot at which the bus that comes next is not missed, if that can be done."""
        trip = self.trip
        ride = trip.legs[self._leg + 1] if trip is not None and self._leg + 1 < len(trip.legs) else None
        if ride is None or ride.mode not in _TRANSIT_MODES:
            return speed
        left = ride.depart - AHEAD - float(observation["state"]["time"])
        return max(speed, min(self._fastest, self.remaining(observation["pose"]) / max(left, 1.0)))

    def _is_at_the_ride(self, ride: Leg, observation: Observation) -> bool:
        """Return whether one stands where a ride begins."""
        away = _distance_to(observation, ride.start)
        if ride.mode == "bike":
            return away <= _AT_RACK
        state = observation["state"]
        if away > _BY_OTHERS or state["action_status"] != "collision":
            return away <= _AT_STOP
        among_others = state["action_code"] == _HIT_BODY and self._still >= _GETS_NOWHERE
        return away <= (_BY_OTHERS if among_others else _BY_STOP) and not self._is_in_the_way(observation["pose"][:2])

    def _is_in_the_way(self, position: NDArray[np.float64]) -> bool:
        """Return whether buses or trams come by a place."""
        if int(self._map.walkable.class_at(position)) == ROADWAY:
            return True
        here = shapely.Point(position)
        return any(shapely.LineString(line.track).distance(here) < _FROM_TRACK for line in self._map.tram_lines)

    # -- buses -------------------------------------------------------------------------------------------------------

    def _board(self, leg: Leg, observation: Observation, info: Info) -> Action:
        """Wait for the bus, and get in; once it is too late for it, plan anew."""
        state = observation["state"]
        now = float(state["time"])
        if self._asked == "enter_bus" and state["action_code"] == _NO_MONEY:
            return self._plan_anew()
        if self._asked == "enter_bus" and state["action_code"] == _CLOSED:
            return self._close(leg)
        if now > leg.depart + _LATE:
            assert leg.line is not None
            self._closed.append(leg.line)
            return self._plan_anew()
        # Which line a bus is of can't be seen: where several stop the time tells.
        lines: list[Line | TramLine] = [*self._map.lines, *self._map.tram_lines]
        others = [line for line in lines if leg.origin in line.stops and line.id != leg.line]
        if others and now < leg.depart - _EARLY:
            return {"type": "wait"}
        if self._asked == "enter_bus" and state["action_code"] == _NO_VEHICLE and now > leg.depart - BUS_DWELL:
            self._tries += 1
            if now > leg.depart - _COMES_UP and _distance_to(observation, leg.start) > _BY_STOP:
                # Others who stand there go when their bus comes.
                step = self._walker.towards(leg.start, WALK_SPEED, observation, info)
                if step is not None:
                    return step
        # A bus that leaves or comes round a bend may stop short of who waits at the kerb: now and then room is made.
        back = self._tries // _IN_THE_WAY % 2 == 1
        spot = self._back_from_road(leg.start) if back else leg.start
        if self._tries >= _IN_THE_WAY:
            step = self._walker.towards(spot, WALK_SPEED, observation, info)
            if step is not None:
                self._tries += 1
                return step
        return {"type": "enter_bus"}

    def _back_from_road(self, spot: tuple[float, float]) -> tuple[float, float]:
        """Return a point a step farther from the road than a spot beside it; the spot if there is no room."""
        walkable, here = self._map.walkable, np.asarray(spot, np.float64)
        ix, iy = walkable.cell_of(here)
        k = math.ceil(4.0 / walkable.cell)
        low_x, low_y = max(0, int(ix) - k), max(0, int(iy) - k)
        rows, columns = np.nonzero(walkable.cls[low_y : int(iy) + k + 1, low_x : int(ix) + k + 1] == ROADWAY)
        road = walkable.centre_of(np.column_stack([columns + low_x, rows + low_y]))
        around = np.arange(0.0, 2 * math.pi, math.pi / 8)
        ring = here + _STEP_BACK * np.column_stack([np.cos(around), np.sin(around)])
        ring = ring[walkable.is_connected(ring) & (walkable.clearance_at(ring) >= 0.3)]
        if not len(road) or not len(ring):
            return spot
        away = np.hypot(ring[:, None, 0] - road[None, :, 0], ring[:, None, 1] - road[None, :, 1]).min(axis=1)
        best = ring[int(np.argmax(np.round(away, 3)))]
        return float(best[0]), float(best[1])

    def _ride_bus(self, observation: Observation) -> Action:
        """Stay in until the bus stands where one wants to get off."""
        trip = self.trip
        leg = trip.legs[self._leg] if trip is not None and self._leg < len(trip.legs) else None
        if leg is None or leg.mode not in _TRANSIT_MODES:
            return {"type": "exit_bus"}
        if _distance_to(observation, leg.end) <= _BUS_AT_STOP:
            return {"type": "exit_bus"}
        late = float(observation["state"]["time"]) > leg.arrive + _LOST
        if self._still >= _STANDSTILL_SECONDS and (late or self._is_off_the_line(leg, observation)):
            return {"type": "exit_bus"}
        return {"type": "wait"}

    def _is_off_the_line(self, leg: Leg, observation: Observation) -> bool:
        """Return whether the bus stands at a stop of other lines only: it is not the one that was meant."""
        stops: list[Stop | TramStop] = [*self._map.stops, *self._map.tram_stops]
        lines: list[Line | TramLine] = [*self._map.lines, *self._map.tram_lines]
        near = [stop.id for stop in stops if _distance_to(observation, stop.wait) <= _BUS_AT_STOP]
        mine = next(line.stops for line in lines if line.id == leg.line)
        return bool(near) and not any(stop in mine for stop in near)

    # -- bicycles ----------------------------------------------------------------------------------------------------

    def _mount(self, leg: Leg, observation: Observation, info: Info) -> Action:
        """Get on a bicycle at the rack; if there is none, plan anew without it."""
        code = observation["state"]["action_code"] if self._asked == "enter_bike" else ""
        if code == _NO_MONEY:
            return self._plan_anew()
        if code == _NO_VEHICLE or self._tries > _TRIES:
            return self._close(leg)
        if code == _NO_FREE_SPOT:
            self._tries += 1
        if self._tries and self._asked == "enter_bike":
            # No room to get on just here: from a step aside there may be.
            aside = float(self._rng.uniform(40.0, 140.0))
            return {"type": "turn_left" if self._tries % 2 else "turn_right", "degrees": aside}
        if self._tries and self._asked in ("turn_left", "turn_right"):
            return {"type": "move_forward", "distance": 0.8}
        return {"type": "enter_bike"}

    def _ride_bike(self, goal: tuple[float, float], observation: Observation, info: Info) -> Action | None:
        """Ride to the station, and leave the bicycle there; None once there with a bicycle that is kept."""
        trip = self.trip
        if trip is None and self._planner is not None:
            trip = self._begin(goal, observation)
        leg = trip.legs[self._leg] if trip is not None and self._leg < len(trip.legs) else None
        if leg is not None and leg.mode == "bike" and leg.destination is None:
            freed = self._free_bicycle(observation)
            return freed or self._walker.towards(leg.end, BIKE_SPEED, observation, info, room=_TURNING)
        end = leg.end if leg is not None and leg.mode == "bike" else self._nearest_station(observation)
        if end is None or _distance_to(observation, end) <= _TO_RACK:
            refused = self._asked == "exit_bike" and observation["state"]["action_code"] == _NO_FREE_SPOT
            if end is None or not refused:
                return {"type": "exit_bike"}
        freed = self._free_bicycle(observation)
        if freed is not None:
            return freed
        action = self._walker.towards(end, BIKE_SPEED, observation, info, room=_TURNING)
        if action is None and _distance_to(observation, end) > _TO_RACK:
            # Where there is room to turn is not near enough: the rest of the way is narrow.
            self._walker.stop()
            action = self._walker.towards(end, BIKE_SPEED, observation, info)
        return {"type": "exit_bike"} if action is None else action

    def _free_bicycle(self, observation: Observation) -> Action | None:
        """Return what gets a bicycle out of a place where it can't be turned; None where it can."""
        stopped = observation["state"]["action_status"] == "collision"
        self._out = [] if stopped else self._out
        if self._out:
            return self._out.pop(0)
        if not stopped or self._asked not in ("turn_left", "turn_right"):
            return self._out_of_narrow_place(observation) if self._asked == "enter_bike" else None
        self._tries += 1
        # Every second time, for others may stand where the map has room.
        out = self._out_of_narrow_place(observation) if self._tries % 2 else None
        if out is not None and self._tries <= _PUSHES:
            return out
        if self._tries > _PUSHES:
            leg = self.trip.legs[self._leg] if self.trip is not None and self._leg < len(self.trip.legs) else None
            if leg is not None and leg.origin is not None:
                self._closed.append(leg.origin)  # there is no getting away from that rack
            return {"type": "exit_bike"}
        # Ahead a little, or round the other way.
        if self._tries % 4 == 1:
            return {"type": "move_forward", "distance": float(self._rng.uniform(0.3, 1.2))}
        other = "turn_right" if self._asked == "turn_left" else "turn_left"
        return {"type": other, "degrees": float(self._rng.uniform(20.0, 120.0))}

    def _out_of_narrow_place(self, observation: Observation) -> Action | None:
        """Return the first action on the way to where a bicycle can be turned, the others to come; None if it can."""
        self._out = find_way_out(self._map.walkable, observation["pose"][:2], heading(observation)) or []
        self._walker.stop()
        return self._out.pop(0) if self._out else None

    def _nearest_station(self, observation: Observation) -> tuple[float, float] | None:
        spots = [(s.position[0], s.position[1]) for s in self._map.bike_stations]
        return min(spots, key=lambda spot: _distance_to(observation, spot), default=None)

    def _close(self, leg: Leg) -> Action:
        """Do without the place where a ride should have begun."""
        trip = self.trip
        ride = leg if leg.origin is not None or trip is None else trip.legs[self._leg + 1]
        if ride.origin is not None:
            self._closed.append(ride.origin)
        return self._plan_anew()

    def _plan_anew(self) -> Action:
        self.trip = None
        self._walker.stop()
        return {"type": "wait"}


def _distance_to(observation: Observation, point: tuple[float, ...]) -> float:
    x, y = observation["pose"][:2]
    return math.hypot(float(x) - point[0], float(y) - point[1])
