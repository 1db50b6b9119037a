"""Driving to a point on ways of the map, and knowing by one's own odometry when one is there."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.state import AgentState
from vico.geometry import distance

Array = NDArray[np.float64]
Action = dict[str, Any]

# Slower than this a robot stands, m/s; so long it stands where it has arrived, and before a way is asked for anew, s.
_STANDS, _ARRIVES, _STUCK = 0.03, 1.0, 12.0
#: How often a way is asked for.
TRIES = 3


class Drive:
    """Brings a robot near a point: asks for a way, waits, asks anew where nothing moves.

    Parameters
    ----------
    period
        Seconds between two actions.

    Attributes
    ----------
    arrived
        Whether the last way led near its point.
    why
        Why not; "" if it did.
    """

    def __init__(self, *, period: float) -> None:
        self._period = period
        self._goal: Array | None = None
        self._near, self._stops = 0.5, False
        self._tries = 0
        self._asked = False
        self._stood = 0.0
        self.arrived, self.why = False, ""

    @property
    def busy(self) -> bool:
        """Whether it is on its way."""
        return self._goal is not None

    def begin(self, goal: Array, *, near: float = 0.5, stops: bool = False) -> None:
        """Begin to go to a point, ENU metres, or so near to it; it `stops` there, or goes on as far as it can.

        Who stops keeps off a person, or leaves the point itself to somebody else.
        """
        self._goal, self._near, self._stops = np.array(goal, np.float64)[:2], near, stops
        self._tries, self._asked, self._stood = 0, False, 0.0
        self.arrived, self.why = False, ""

    def act(self, observation: Mapping[str, Any]) -> Action:
        """Return the action for the coming period; once it is not `busy` any more, the robot stands."""
        if self._goal is None:
            return {"type": "stop"}
        sensors, state = observation["sensors"], observation["state"]
        position = np.asarray(sensors["base_pose"], np.float64)[:3]
        away = distance(position[:2], self._goal)
        stands = float(np.abs(sensors["base_velocity"][:2]).max()) < _STANDS
        self._stood = self._stood + self._period if stands else 0.0
        refused = self._asked and state["action_status"] == "refused"
        if away <= self._near and (self._stops or self._stood >= _ARRIVES or not self._asked):
            return self._end(arrived=True)
        if not self._asked or self._stood >= _STUCK or refused:
            if self._tries >= TRIES or refused:
                return self._end(arrived=False, why=str(state["action_reason"]) or "stuck on the way")
            self._asked, self._stood = True, 0.0
            self._tries += 1
            return {"type": "go_to", "target": [*self._goal.tolist(), float(position[2])]}
        return {"type": "wait"}

    def _end(self, *, arrived: bool, why: str = "") -> Action:
        self._goal, self.arrived, self.why = None, arrived, why
        return {"type": "stop"}

    def state(self) -> AgentState:
        """Return all it remembers."""
        return {
            "goal": None if self._goal is None else self._goal.copy(),
            "near": self._near,
            "stops": self._stops,
            "tries": self._tries,
            "asked": self._asked,
            "stood": self._stood,
            "arrived": self.arrived,
            "why": self.why,
        }

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self._goal = None if state["goal"] is None else np.array(state["goal"])
        self._near, self._stops, self._stood = float(state["near"]), bool(state["stops"]), float(state["stood"])
        self._tries, self._asked = int(state["tries"]), bool(state["asked"])
        self.arrived, self.why = bool(state["arrived"]), str(state["why"])
