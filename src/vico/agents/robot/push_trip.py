"""A thing that the jaw cannot hold is pushed: to the destination where that is near, else to where it may be held."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.base import Action, Observation
from vico.agents.robot.body import ArmBody, metres_apart
from vico.agents.robot.pushing import FARTHEST, Pusher
from vico.agents.robot.put_spots import WITHIN
from vico.agents.robot.skill import ArmSkill
from vico.agents.robot.thing_search import side_of_try
from vico.agents.robot.worker import ArmWorker
from vico.agents.state import AgentState

Array = NDArray[np.float64]

# Why a thing that cannot be picked is pushed; how often at most, and how far where the destination is not near, metres.
_NO_HOLD = ("too wide for the jaw", "out of reach", "the jaw closed on nothing", "it slipped")
_PUSHES, _ON = 4, 0.6
# So often the destination itself is what it is pushed to.
_HOME = 2


class PushTrip:
    """Pushes the thing of a task, another way each time.

    Parameters
    ----------
    told
        What the task tells; see `vico.agents.robot.heuristic.Manipulator`.
    body, worker
        The arm, and what picks and places with it.
    period
        Seconds between two actions.

    Attributes
    ----------
    is_there
        Whether the last push brought the thing to the destination.
    """

    def __init__(self, told: Mapping[str, Any], body: ArmBody, worker: ArmSkill, *, period: float) -> None:
        self._goal = np.array(told["destination"]["centre"][:2], np.float64)
        self._brings = told["category"] == "deliver"
        self._worker, self._pusher = worker, Pusher(body, period=period)
        self._pushed = 0
        self.is_there = False

    @property
    def busy(self) -> bool:
        """Whether it is at work."""
        return self._pusher.busy

    @property
    def wants_picture(self) -> bool:
        """Whether it looks at the thing the next time."""
        return self._pusher.wants_picture

    @property
    def helps(self) -> bool:
        """Whether pushing may help where the last pick failed."""
        return self._pushed < _PUSHES and self._worker.why in _NO_HOLD

    def begin(self, entity: int, thing: Array, here: Array) -> None:
        """Begin to push a thing that stands at a point, both ENU metres."""
        self._pusher.push(entity, thing, self._to(thing[:2], here[:2]))
        self._pushed += 1
        self.is_there = False

    def act(self, observation: Observation) -> Action:
        """Return the action for the coming period; once it is not busy the arm's servos are the worker's again."""
        action = self._pusher.act(observation)
        if not self._pusher.busy:
            if isinstance(self._worker, ArmWorker):
                self._worker.moved(self._pusher.servos)
            came = self._pusher.outcome == "pushed"
            self.is_there = came and self._brings and metres_apart(self._pusher.thing, self._goal) < WITHIN
        return action

    def _to(self, thing: Array, here: Array) -> Array:
        """Return where a thing is pushed to: the destination, or half a metre on, another way each time."""
        if self._brings and metres_apart(thing, self._goal) < FARTHEST and self._pushed < _HOME:
            return self._goal
        away = thing - here
        first = math.atan2(float(away[1]), float(away[0]))
        return np.asarray(thing + _ON * side_of_try(self._pushed, first))

    def state(self) -> AgentState:
        """Return all it remembers."""
        return {"pusher": self._pusher.state(), "pushed": self._pushed, "is_there": self.is_there}

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self._pusher.restore(state["pusher"])
        self._pushed, self.is_there = int(state["pushed"]), bool(state["is_there"])
