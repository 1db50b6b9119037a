"""Walking outdoors: the walker that follows paths of the public map, and the same rules in arrays for many residents.

`Walker` turns and steps ahead from what it sees and the public map. `stride_lengths` finds in arrays who goes straight
to a corner with nothing on the way to decide. Its rules are the walker's; whoever is near the bounds of one of them is
to be asked.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vico.agents.base import HEADING_SLICE, Action, AgentState, Info, Observation, heading
from vico.agents.day_plan import EASY_PACE, RUN_PACE, SLACK, SLACK_SHARE
from vico.geometry import wrap_angle
from vico.rules import ReasonCode, code_name, walk_speed
from vico.world.public import PublicMap
from vico.world.walkable import CROSSING, ROADWAY, WalkableMap

#: Corners count as passed this close, metres.
CORNER = 0.35
#: Metres off the line after a step from which on one turns first.
DRIFT = 0.12
#: Metres of room below which a step is narrow.
NARROW = 0.6
#: Metres off the line, where a step is narrow.
NARROW_DRIFT = 0.03
#: Shares of a step at which the room to walls is looked at.
CLEARANCE_SAMPLES = (0.0, 0.25, 0.5, 0.75, 1.0)
#: Surfaces that are not stepped on without a look for vehicles.
ROAD_SURFACES = (ROADWAY, CROSSING)

# Sines and roots may differ by less than this between one and many, metres.
_MARGIN = 1e-6


class Stride(NamedTuple):
    """What somebody on a straight way goes on with, outdoors and on foot.

    Attributes
    ----------
    x, y
        The corner ahead, ENU metres.
    left
        From the corner to the end of the way, metres.
    pace
        Metres a second; NaN: as the time left until `due` asks for.
    due
        When to be there, second of the day.
    ease, haste
        Pace with time to spare, and when late, metres a second.
    place_x, place_y, least, most
        A point, ENU metres, and between which distances from it nothing changes, metres.
    """

    x: float
    y: float
    left: float
    pace: float
    due: float
    ease: float
    haste: float
    place_x: float
    place_y: float
    least: float
    most: float


def stride_lengths(
    strides: NDArray[np.float64], pose: NDArray[np.float64], second: float, walkable: WalkableMap
) -> NDArray[np.float64]:
    """Return how far ahead each of some walkers goes in the coming second, metres; NaN for those with a decision.

    Parameters
    ----------
    strides
        Rows of `Stride`, shape ``(n, 11)``.
    pose
        As observations have it, shape ``(n, 6)``.
    second
        Of the day.
    """
    corner_x, corner_y, left, pace, due, ease, haste, place_x, place_y, least, most = strides.T
    x, y = pose[:, 0], pose[:, 1]
    heading_x, heading_y = pose[:, HEADING_SLICE].T
    east, north = corner_x - x, corner_y - y
    away = np.sqrt(east * east + north * north)
    speed = np.where(np.isnan(pace), _speeds_to_arrive(away + left, due - second, ease, haste), pace)
    far = np.hypot(x - place_x, y - place_y)
    goes = (away > np.maximum(speed, CORNER) + _MARGIN) & (far > least + _MARGIN) & (far < most - _MARGIN)
    scale = 1.0 / np.maximum(away, 1e-9)
    aside = speed * np.abs(heading_x * north - heading_y * east) * scale / np.hypot(heading_x, heading_y)
    position = np.column_stack([x, y])
    room = walkable.clearance_at(position)
    norm = speed / np.hypot(heading_x, heading_y)
    for share in CLEARANCE_SAMPLES[1:]:
        step = np.column_stack([x + share * norm * heading_x, y + share * norm * heading_y])
        room = np.minimum(room, walkable.clearance_at(step))
    allowed = np.where(room > NARROW + _MARGIN, DRIFT, NARROW_DRIFT)
    goes &= (aside < allowed - _MARGIN) & (heading_x * east + heading_y * north > 0.0)
    ahead = np.column_stack([x + east * scale, y + north * scale])
    goes &= np.isin(walkable.class_at(position), ROAD_SURFACES) | ~np.isin(walkable.class_at(ahead), ROAD_SURFACES)
    return np.where(goes, speed, np.nan)


def walking_speeds_of(age: float) -> tuple[float, float]:
    """Return how fast somebody goes who has time, and who is late, metres a second."""
    ease = walk_speed(age)
    # Past sixty people run less and less, and past ninety they walk quickly at most.
    slower = min(max((age - 60.0) / 30.0, 0.0), 1.0)
    return ease, RUN_PACE + (1.25 * ease - RUN_PACE) * slower


def speed_to_arrive(metres: float, seconds: float, ease: float = EASY_PACE, haste: float = RUN_PACE) -> float:
    """Return how fast to walk, m/s: at ease while there is time, briskly when it gets short, and to run when late."""
    return min(haste, max(ease, metres * (1.0 + SLACK_SHARE) / max(1.0, seconds - SLACK)))


def _speeds_to_arrive(
    metres: NDArray[np.float64], seconds: NDArray[np.float64], ease: NDArray[np.float64], haste: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the same as `speed_to_arrive`, to the last bit, for many."""
    needed = metres * (1.0 + SLACK_SHARE) / np.maximum(1.0, seconds - SLACK)
    return np.asarray(np.minimum(haste, np.maximum(ease, needed)), np.float64)


VEHICLES = ("car", "bus", "bicycle", "tram", "cyclist")
# The last point of a path is walked to more closely than other corners, metres.
_END = 0.2
# At a kerb, people let vehicles pass that are nearer than this, metres, but not for ever, seconds.
_CAR_NEAR, _PATIENCE = 9.0, 8
# Red is waited for this long, seconds; and it counts this far beside its crossing, metres.
_SIGNAL_PATIENCE, _BESIDE = 150, 0.5
# A goal that moved no farther than this is the same one still; and from so far from walls there is much room, metres.
_SAME_GOAL, _WIDE = 12.0, 1.5
# Radius of what is taken to be closed where one keeps being stopped, and its growth each time, metres.
_BLOCK, _BLOCK_GROWTH = 0.5, 0.4
# Who stepped aside joins its way again this far on, metres, unless that is longer than straight on by so much.
_REJOIN, _DETOUR = 8.0, 6.0
# Degrees one turns for a step aside, and for one back; who is stopped so often steps back, for aside it is no wider.
_ASIDE_ANGLES, _BACK_ANGLES, _BACK_FROM = (50.0, 90.0, 130.0), (130.0, 170.0, 90.0), 9
_HIT_SOLID = code_name(ReasonCode.HIT_SOLID)
# Who rides and is stopped by a vehicle lets it pass, so many times two seconds: a tram is long and stands at stops.
_LETS_PASS, _LETS_TRAM_PASS = 2, 15
# Ways keep so far from the edge of the map, metres; and steps aside so far from others, middle to middle.
_FROM_EDGE, _FROM_OTHERS = 0.3, 0.55
# On foot one steps so far back from a vehicle, metres, and lets it pass until it has stopped one so often.
_STEPS_BACK, _LETS_BY = 0.8, 3
# Who rides steps aside where there is so much room to walls, metres, that the bicycle can be turned there.
_TURNING_ROOM = 0.9

Point = tuple[float, float]


class Walker:
    """Follows walks on the public map, steps aside for what is in the way, and finds another way if it stays there.

    Parameters
    ----------
    public_map
        Its router finds the ways.
    generator
        Decides how long to wait for somebody and which side to pass on.

    Attributes
    ----------
    wide_drift
        How far off its line a step may lead where there is much room, metres; who turns less is there sooner.
    """

    def __init__(self, public_map: PublicMap, generator: np.random.Generator) -> None:
        self.wide_drift = DRIFT
        self._map = public_map
        self._rng = generator
        self._goal: tuple[float, float] | None = None
        self._path: list[tuple[float, float]] = []
        # Metres from each point of the path to its end.
        self._left: list[float] = []
        self._next = 0
        self._blocked = 0
        self._waited = 0
        self._stepped = False
        self._aside: list[Action] = []
        self._closed: list[tuple[float, float, float]] = []
        # Ground that events close, as far as the agent knows: circles, and the cells within.
        self._avoided: list[tuple[float, float, float]] = []
        self._shut: NDArray[np.bool_] | None = None
        # Metres to walls that are wanted at corners, as told in every step.
        self._turns_in = 0.0

    def state(self) -> AgentState:
        """Return the way under way and what is known to be in it; the generator is its owner's to save."""
        return {
            "goal": None if self._goal is None else list(self._goal),
            "path": np.array(self._path, np.float64).reshape(-1, 2),
            "next": self._next,
            "blocked": self._blocked,
            "waited": self._waited,
            "stepped": self._stepped,
            "aside": [dict(action) for action in self._aside],
            "closed": np.array(self._closed, np.float64).reshape(-1, 3),
            "avoided": np.array(self._avoided, np.float64).reshape(-1, 3),
        }

    def restore(self, state: AgentState) -> None:
        """Go on the way that `state` returned."""
        goal = state["goal"]
        self._goal = None if goal is None else (float(goal[0]), float(goal[1]))
        self._take(np.asarray(state["path"], np.float64).reshape(-1, 2).tolist())
        self._next, self._blocked, self._waited = state["next"], state["blocked"], state["waited"]
        self._stepped = state["stepped"]
        self._aside = [dict(action) for action in state["aside"]]
        self._closed = [(float(x), float(y), float(radius)) for x, y, radius in state["closed"]]
        self._avoid([(float(x), float(y), float(radius)) for x, y, radius in state["avoided"]])

    def stop(self) -> None:
        """Forget the way."""
        self._goal = None
        self._aside = []

    def remaining(self, position: Sequence[float]) -> float:
        """Metres still to walk."""
        if self._goal is None or self._next >= len(self._path):
            return 0.0
        corner = self._path[self._next]
        east, north = corner[0] - float(position[0]), corner[1] - float(position[1])
        # As `vico.agents.wayfinding` reckons for many, to the last bit.
        return math.sqrt(east * east + north * north) + self._left[self._next]

    @property
    def way(self) -> list[tuple[float, float]]:
        """Corners still to come, ENU metres."""
        return [] if self._goal is None else self._path[self._next :]

    @property
    def straight_on(self) -> tuple[float, float, float] | None:
        """The corner that the last step led towards, ENU metres, and how far it is from there to the end of the way.

        None where the next step towards the same goal may change what the walker remembers, even if nothing is met.
        """
        if not self._stepped or self._blocked:
            return None
        return (*self._path[self._next], self._left[self._next])

    def towards(
        self, goal: tuple[float, float], speed: float, observation: Observation, info: Info, *, room: float = 0.0
    ) -> Action | None:
        """Return the next action on the way to a point; None if there is no way or it is reached.

        Parameters
        ----------
        goal
            ENU metres.
        speed
            Metres a second to walk at, up to 2.5.
        room
            Metres to walls at the corners of the way, where there is such a way.
        """
        self._turns_in = room
        x, y = observation["pose"][:2].tolist()
        position = (x, y)
        avoided = closed_ground(info)
        if avoided != self._avoided:
            self._goal = None
            self._avoid(avoided)
        if goal != self._goal:
            # Who goes after somebody has a goal that moves: what stands in the way is passed all the same.
            if self._goal is None or math.dist(goal, self._goal) > _SAME_GOAL:
                self._closed, self._blocked, self._aside = [], 0, []
            self._goal = goal
            self._plan(position)
        if observation["state"]["action_status"] == "collision":
            self._meet_obstacle(position, observation, info)
        elif self._stepped and not self._aside:
            self._blocked = max(0, self._blocked - 1)
        self._stepped = False
        if self._aside:
            action = self._aside.pop(0)
            if not self._aside:
                self._rejoin(position)
            return action
        self._pass_corners(position)
        if self._next >= len(self._path):
            return None
        return self._step(position, speed, observation, info)

    def _avoid(self, ground: list[tuple[float, float, float]]) -> None:
        """Plan no way over some ground, circles, from now on."""
        self._avoided = ground
        self._shut = self._map.walkable.cells_within(ground) if ground else None

    def _plan(self, position: Point) -> None:
        assert self._goal is not None
        if self._turns_in and self._take_wide_way(position):
            return
        path = self._map.router.path(position, self._goal, blocked=self._shut, closed=self._closed)
        if path is None and self._closed:
            # What stood in the way may have moved on by now.
            self._closed = []
            path = self._map.router.path(position, self._goal, blocked=self._shut)
        if path is None and self._avoided:
            # Whoever lives where it is closed gets there nevertheless.
            path = self._map.router.path(position, self._goal)
        self._take([] if path is None else path.tolist())
        self._next = 1 if len(self._path) > 1 else 0

    def _take_wide_way(self, position: Point) -> bool:
        """Take a way with room at its corners, if there is one."""
        assert self._goal is not None
        router, shut, room = self._map.router, self._shut, self._turns_in
        path = router.path(position, self._goal, blocked=shut, closed=self._closed, room=room)
        if path is None:
            return False
        self._take(path.tolist())
        # From where it is narrow the way there is a part of it.
        self._next = int(len(self._path) > 1 and math.dist(self._path[0], position) < CORNER)
        return True

    def _rejoin(self, position: Point) -> None:
        """Go back to the way a little further on, which is found sooner than all of it anew; else find a new one."""
        corners = range(self._next, len(self._path)) if self._turns_in == 0.0 else ()
        ahead = next((k for k in corners if self._along(k) >= _REJOIN), None)
        if ahead is not None:
            path = self._map.router.path(position, self._path[ahead], blocked=self._shut, closed=self._closed)
            points = [] if path is None else path.tolist()
            detour = sum(math.dist(p, q) for p, q in pairwise(points)) - math.dist(position, self._path[ahead])
            if points and detour <= _DETOUR:
                self._take([*points, *self._path[ahead + 1 :]])
                self._next = 1 if len(points) > 1 else 0
                return
        self._plan(position)

    def _along(self, k: int) -> float:
        """Metres along the way from the next corner to another."""
        return self._left[self._next] - self._left[k]

    def _take(self, path: Sequence[Sequence[float]]) -> None:
        """Take a path for one's way; where it runs along the map's edge, so far from it that a body has room."""
        edge = self._map.walkable.half - _FROM_EDGE
        self._path = [(min(max(float(x), -edge), edge), min(max(float(y), -edge), edge)) for x, y in path]
        self._left = [0.0] * len(self._path)
        for k in range(len(self._path) - 2, -1, -1):
            self._left[k] = self._left[k + 1] + math.dist(self._path[k], self._path[k + 1])

    def _pass_corners(self, position: Point) -> None:
        while self._next < len(self._path):
            near = _END if self._next == len(self._path) - 1 else min(CORNER, self._room(position) * 0.5)
            if math.dist(self._path[self._next], position) > near:
                return
            self._next += 1

    def _room(self, position: Point) -> float:
        return self._map.walkable.clearance_of(*position)

    def _step(self, position: Point, speed: float, observation: Observation, info: Info) -> Action:
        corner = self._path[self._next]
        east, north = corner[0] - position[0], corner[1] - position[1]
        away = math.sqrt(east * east + north * north)
        yaw = heading(observation)
        error = wrap_angle(math.atan2(north, east) - yaw)
        stride = min(away, speed)
        # Where it is narrow there is no room for drifting: all along the step, for a post may stand beside it.
        room = min(self._room(_point_ahead(position, yaw, stride * share)) for share in CLEARANCE_SAMPLES)
        drift = NARROW_DRIFT if room <= NARROW else DRIFT if room <= _WIDE else self.wide_drift
        if abs(error) > 1e-3 and (abs(stride * math.sin(error)) > drift or math.cos(error) <= 0.0):
            return {"type": "turn_left" if error > 0 else "turn_right", "degrees": abs(math.degrees(error))}
        scale = 1.0 / max(away, 1e-9)
        if self._should_let_pass(
            position, (position[0] + east * scale, position[1] + north * scale), observation, info
        ):
            self._waited += 1
            return {"type": "wait"}
        self._waited = 0
        self._stepped = True  # only a step that was made tells that the way is free again; a wait doesn't
        return {"type": "move_forward", "distance": stride}

    def _should_let_pass(self, position: Point, ahead: Point, observation: Observation, info: Info) -> bool:
        """Whether one stands at the kerb, with the point a metre ahead on the road, and a vehicle is near."""
        surface = self._map.walkable.class_of
        if surface(*position) in ROAD_SURFACES or surface(*ahead) not in ROAD_SURFACES:
            return False
        if self._waited < _SIGNAL_PATIENCE and shows_red(ahead, info):
            return True
        return self._waited < _PATIENCE and _nearest_vehicle(observation, info) < _CAR_NEAR

    def _meet_obstacle(self, position: Point, observation: Observation, info: Info) -> None:
        """Wait a moment, then pass on one side; close the spot for planning if that doesn't help."""
        yaw = heading(observation)
        self._blocked += 1
        self._aside = []
        solid = observation["state"]["action_code"] == _HIT_SOLID
        if self._blocked == 1 and not solid:
            self._aside = [{"type": "wait"}] * int(self._rng.integers(1, 3))
            return
        # How often somebody on a bicycle waits for what stopped it to go on.
        obstacle = str(observation["state"].get("action_reason", "")).removeprefix("stopped by ")
        patience = _LETS_TRAM_PASS if obstacle == "tram" else _LETS_PASS if obstacle in VEHICLES else 0
        if self._turns_in and self._blocked <= patience:
            # It goes on when it can: who presses on beside it gets stuck between it and a wall.
            self._aside = [{"type": "wait"}] * 2
            return
        if not self._turns_in and self._steps_back_from_vehicle(position, yaw, patience):
            return
        if self._blocked % 4 == 0:
            x, y = _point_ahead(position, yaw, 0.9)
            # Stopped near a closed spot again: what stands there is wider than was thought.
            again = sum(math.dist((x, y), spot[:2]) < 2.5 for spot in self._closed)
            self._closed = [*self._closed[-5:], (x, y, _BLOCK + _BLOCK_GROWTH * again)]
        # Everybody passes on the right, mostly: so two who meet don't mirror each other.
        first = -1.0 if self._rng.random() < 0.8 else 1.0
        least = _TURNING_ROOM if self._turns_in and self._room(position) >= _TURNING_ROOM else 0.3
        for side in (first, -first):
            for degrees in _ASIDE_ANGLES if self._blocked < _BACK_FROM else _BACK_ANGLES:
                angle = yaw + side * math.radians(degrees)
                reach = 0.8 + 0.2 * min(self._blocked, 4)
                if _runs_into_people(position, angle, reach, info):
                    continue
                if self._room(_point_ahead(position, angle, reach)) >= least and (
                    self._room(_point_ahead(position, angle, reach / 2)) >= 0.28
                ):
                    turn = "turn_left" if side > 0 else "turn_right"
                    self._aside = [{"type": turn, "degrees": degrees}, {"type": "move_forward", "distance": reach}]
                    return
        self._plan(position)

    def _steps_back_from_vehicle(self, position: Point, yaw: float, patience: int) -> bool:
        """Step back from a vehicle that stopped one on foot, and let it pass, the longer the more often it did."""
        if not 1 < self._blocked <= min(patience, _LETS_BY):
            return False
        waits: list[Action] = [{"type": "wait"}] * (2 * self._blocked)
        if self._blocked == 2 and self._room(_point_ahead(position, yaw + math.pi, _STEPS_BACK)) >= 0.3:
            waits = [{"type": "turn_left", "degrees": 180.0}, {"type": "move_forward", "distance": _STEPS_BACK}, *waits]
        self._aside = waits
        return True


def shows_red(point: Point, info: Info) -> bool:
    """Whether a point lies on a crossing whose signal tells people to wait."""
    for signal in info.get("signals", ()):
        if signal["for"] == "pedestrians" and signal["light"] in ("red", "amber"):
            (x, y), (to_x, to_y) = signal["crossing"]
            east, north = to_x - x, to_y - y
            length = math.hypot(east, north)
            along = ((point[0] - x) * east + (point[1] - y) * north) / max(length, 1e-9)
            aside = abs((point[0] - x) * north - (point[1] - y) * east) / max(length, 1e-9)
            if -_BESIDE <= along <= length + _BESIDE and aside <= signal["width"] / 2 + _BESIDE:
                return True
    return False


def closed_ground(info: Info) -> list[tuple[float, float, float]]:
    """Return the ground that events close now, as far as one knows of them: x, y and radius, ENU metres."""
    known = [event for event in info.get("events", ()) if event["goes_on"]]
    return [(x, y, radius) for event in known for x, y, radius in event["closed_ground"]]


def _point_ahead(position: Point, yaw: float, reach: float) -> Point:
    return position[0] + reach * math.cos(yaw), position[1] + reach * math.sin(yaw)


def _runs_into_people(position: Point, angle: float, reach: float, info: Info) -> bool:
    """Return whether a step aside would lead into people whom one has in view."""
    if "in_view" not in info:
        return False
    cosine, sine = math.cos(angle), math.sin(angle)
    for body in info["in_view"].within(reach + _FROM_OTHERS):
        if body.kind not in VEHICLES:
            east, north = body.position[0] - position[0], body.position[1] - position[1]
            along = min(max(cosine * east + sine * north, 0.0), reach)
            if math.hypot(east - along * cosine, north - along * sine) < _FROM_OTHERS and along > 0.0:
                return True
    return False


def _nearest_vehicle(observation: Observation, info: Info) -> float:
    """Metres to the nearest vehicle in view: as one is told, else as the pictures show; infinite if there is none."""
    if "in_view" in info:
        return float(info["in_view"].nearest(VEHICLES))
    seen = (entity for entity, what in info["entities"].items() if what["kind"] in VEHICLES)
    return min((_distance_to(entity, observation) for entity in seen), default=math.inf)


def _distance_to(entity: int, observation: Observation) -> float:
    """Distance along the view to what is seen of an entity, metres; infinite if it is not seen."""
    depth: NDArray[Any] = observation["depth"][observation["segmentation"] == entity]
    return float(np.median(depth)) if len(depth) else math.inf
