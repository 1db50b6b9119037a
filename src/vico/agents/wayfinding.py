"""Walking to a point by turning and stepping ahead, from what one sees and the public map."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.base import Action, Info, Observation, heading, wrapped
from vico.agents.state import AgentState
from vico.rules import ReasonCode, code_name
from vico.world.public import PublicMap
from vico.world.walkable import CROSSING, ROADWAY

VEHICLES = ("car", "bus", "bicycle")
# Corners count as passed this close, metres; the last point of a path is walked to more closely.
_CORNER, _END = 0.35, 0.2
# Off the line by more than this after a step means turning first, metres.
_DRIFT = 0.12
# At a kerb, people let vehicles pass that are nearer than this, metres, but not for ever, seconds.
_CAR_NEAR, _PATIENCE = 9.0, 8
# Radius of what is taken to be closed where one keeps being stopped, and its growth each time, metres.
_BLOCK, _GROW = 0.5, 0.4
_HIT_SOLID = code_name(ReasonCode.HIT_SOLID)


class Walker:
    """Follows walks on the public map, steps aside for what is in the way, and finds another way if it stays there.

    Parameters
    ----------
    public_map
        Its router finds the ways.
    generator
        Decides how long to wait for somebody and which side to pass on.
    """

    def __init__(self, public_map: PublicMap, generator: np.random.Generator) -> None:
        self._map = public_map
        self._rng = generator
        self._goal: tuple[float, float] | None = None
        self._path: NDArray[np.float64] = np.zeros((0, 2))
        self._next = 0
        self._blocked = 0
        self._waited = 0
        self._stepped = False
        self._aside: list[Action] = []
        self._closed: list[tuple[float, float, float]] = []

    def state(self) -> AgentState:
        """Return the way under way and what is known to be in it; the generator is its owner's to save."""
        return {
            "goal": None if self._goal is None else list(self._goal),
            "path": self._path.copy(),
            "next": self._next,
            "blocked": self._blocked,
            "waited": self._waited,
            "stepped": self._stepped,
            "aside": [dict(action) for action in self._aside],
            "closed": np.array(self._closed, np.float64).reshape(-1, 3),
        }

    def restore(self, state: AgentState) -> None:
        """Go on the way that `state` returned."""
        goal = state["goal"]
        self._goal = None if goal is None else (float(goal[0]), float(goal[1]))
        self._path = np.array(state["path"], np.float64).reshape(-1, 2)
        self._next, self._blocked, self._waited = state["next"], state["blocked"], state["waited"]
        self._stepped = state["stepped"]
        self._aside = [dict(action) for action in state["aside"]]
        self._closed = [(float(x), float(y), float(radius)) for x, y, radius in state["closed"]]

    def stop(self) -> None:
        """Forget the way."""
        self._goal = None
        self._aside = []

    def remaining(self, position: NDArray[np.float64]) -> float:
        """Metres still to walk."""
        if self._goal is None or self._next >= len(self._path):
            return 0.0
        points = np.vstack([position[None, :2], self._path[self._next :]])
        return float(np.hypot(*np.diff(points, axis=0).T).sum())

    def towards(self, goal: tuple[float, float], speed: float, observation: Observation, info: Info) -> Action | None:
        """Return the next action on the way to a point; None if there is no way or it is reached.

        Parameters
        ----------
        goal
            ENU metres.
        speed
            Metres a second to walk at, up to 2.5.
        """
        position = observation["pose"][:2]
        if goal != self._goal:
            self._goal, self._closed, self._blocked = goal, [], 0
            self._aside = []
            self._plan(position)
        if observation["state"]["action_status"] == "collision":
            self._meet_obstacle(observation)
        elif self._stepped and not self._aside:
            self._blocked = max(0, self._blocked - 1)
        self._stepped = False
        if self._aside:
            action = self._aside.pop(0)
            if not self._aside:
                self._plan(position)
            return action
        self._pass_corners(position)
        if self._next >= len(self._path):
            return None
        return self._step(speed, observation, info)

    def _plan(self, position: NDArray[np.float64]) -> None:
        assert self._goal is not None
        path = self._map.router.path(position, self._goal, blocked=self._mask())
        if path is None and self._closed:
            # What stood in the way may have moved on by now.
            self._closed = []
            path = self._map.router.path(position, self._goal)
        self._path = np.zeros((0, 2)) if path is None else path
        self._next = 1 if len(self._path) > 1 else 0

    def _mask(self) -> NDArray[np.bool_] | None:
        if not self._closed:
            return None
        walkable = self._map.walkable
        mask = np.zeros(walkable.cls.shape, bool)
        for x, y, radius in self._closed:
            ix, iy = walkable.cell_of((x, y))
            reach = math.ceil(radius / walkable.cell)
            mask[max(0, iy - reach) : iy + reach + 1, max(0, ix - reach) : ix + reach + 1] = True
        return mask

    def _pass_corners(self, position: NDArray[np.float64]) -> None:
        while self._next < len(self._path):
            near = _END if self._next == len(self._path) - 1 else min(_CORNER, self._room(position) * 0.5)
            if np.hypot(*(self._path[self._next] - position)) > near:
                return
            self._next += 1

    def _room(self, position: NDArray[np.float64]) -> float:
        return float(self._map.walkable.clearance_at(position))

    def _step(self, speed: float, observation: Observation, info: Info) -> Action:
        position = observation["pose"][:2]
        gap = self._path[self._next] - position
        away = float(np.hypot(*gap))
        error = wrapped(math.atan2(gap[1], gap[0]) - heading(observation))
        stride = min(away, speed)
        # Where it is narrow there is no room for drifting.
        drift = _DRIFT if self._room(position) > 0.6 else 0.03
        if abs(error) > 1e-3 and (abs(stride * math.sin(error)) > drift or math.cos(error) <= 0.0):
            return {"type": "turn_left" if error > 0 else "turn_right", "degrees": abs(math.degrees(error))}
        if self._should_let_pass(position, gap / max(away, 1e-9), observation, info):
            self._waited += 1
            return {"type": "wait"}
        self._waited = 0
        self._stepped = True  # only a step that was made tells that the way is free again; a wait doesn't
        return {"type": "move_forward", "distance": stride}

    def _should_let_pass(
        self, position: NDArray[np.float64], ahead: NDArray[np.float64], observation: Observation, info: Info
    ) -> bool:
        """Whether one stands at the kerb and a vehicle is near."""
        walkable = self._map.walkable
        road = (ROADWAY, CROSSING)
        if int(walkable.class_at(position)) in road or int(walkable.class_at(position + ahead)) not in road:
            return False
        return self._waited < _PATIENCE and _nearest_vehicle(observation, info) < _CAR_NEAR

    def _meet_obstacle(self, observation: Observation) -> None:
        """Wait a moment, then pass on one side; close the spot for planning if that doesn't help."""
        position, yaw = observation["pose"][:2], heading(observation)
        self._blocked += 1
        self._aside = []
        solid = observation["state"]["action_code"] == _HIT_SOLID
        if self._blocked == 1 and not solid:
            self._aside = [{"type": "wait"}] * int(self._rng.integers(1, 3))
            return
        if self._blocked % 4 == 0:
            spot = position + 0.9 * np.array([math.cos(yaw), math.sin(yaw)])
            # Stopped near a closed spot again: what stands there is wider than was thought.
            again = sum(math.hypot(x - spot[0], y - spot[1]) < 2.5 for x, y, _ in self._closed)
            self._closed = [*self._closed[-5:], (float(spot[0]), float(spot[1]), _BLOCK + _GROW * again)]
        # Everybody passes on the right, mostly: so two who meet don't mirror each other.
        first = -1.0 if self._rng.random() < 0.8 else 1.0
        for side in (first, -first):
            for degrees in (50.0, 90.0, 130.0):
                angle = yaw + side * math.radians(degrees)
                reach = 0.8 + 0.2 * min(self._blocked, 4)
                spot = position + reach * np.array([math.cos(angle), math.sin(angle)])
                if self._room(spot) >= 0.3 and self._room((position + spot) / 2) >= 0.28:
                    turn = "turn_left" if side > 0 else "turn_right"
                    self._aside = [{"type": turn, "degrees": degrees}, {"type": "move_forward", "distance": reach}]
                    return
        self._plan(position)


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
