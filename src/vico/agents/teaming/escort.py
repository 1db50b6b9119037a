"""A robot that walks with a person to a door and waits beside it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.base import Action, Info, Observation
from vico.agents.robot.body import Stance
from vico.agents.robot.driving import Drive
from vico.agents.state import AgentState
from vico.agents.teaming.visitor import LETS_GO
from vico.agents.teaming.walking import apart, turn_towards
from vico.agents.teaming.words import heard_from
from vico.english import split_name
from vico.exact import dot
from vico.world.public import PublicMap
from vico.world.walkable import OPEN, SIDEWALK

Array = NDArray[np.float64]

# How near one comes to call somebody, and to a spot, metres; seconds between two calls.
_AT_PERSON, _AT_SPOT, _CALLS_EVERY = 3.0, 0.5, 4.0
# So near the door the robot leaves the person, who goes in, and goes to a spot beside it, metres.
_LEAVES = 5.0
# Spots beside a door: so far from it, with so much room, and so far off the way in, metres; directions that are tried.
_RINGS, _ROOM, _OFF_WAY, _SIDES = (2.2, 2.8, 3.3), 0.6, 1.1, 16
# The way in is kept free so far before the door, metres.
_WAY_IN = 4.0
_TURN = 0.6


class Stage(StrEnum):
    """What the robot is at."""

    MEET = "go to the person"
    CALL = "call them"
    ALONG = "walk with them"
    DOOR = "go beside the door"
    FACE = "turn to the door"
    WAIT = "wait"


class Escort:
    """Goes to the person, calls, follows, leaves them before the door, and stands beside it.

    Parameters
    ----------
    told
        What the task tells (`vico.challenges.teaming.model.TeamingTask.instruction`), and ``period``, seconds.
    stays_near
        Whether it keeps near the person on the way; else it goes to the door as fast as it can.
    """

    def __init__(self, told: Mapping[str, Any], public_map: PublicMap, *, stays_near: bool = True) -> None:
        self.told, self.stays_near, self.period = dict(told), stays_near, float(told["period"])
        place = public_map.place_by_id[str(told["destination"]["place"])]
        self.door = np.array(place.entrance or place.position, np.float64)
        self._before = np.array(place.position, np.float64)
        self._map = public_map
        self.going = Drive(period=self.period)
        self.stage = Stage.MEET
        self._began, self._said, self._spot = False, 0.0, 0

    @property
    def wants_picture(self) -> bool:
        """Whether it looks at its pictures: never; whom it follows its controller finds."""
        return False

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the action for the coming period."""
        heard = heard_from(observation, str(self.told["person"]["agent"]))
        if self.stage in (Stage.MEET, Stage.CALL) and any(text == LETS_GO for text, _ in heard):
            self._next(Stage.ALONG if self.stays_near else Stage.DOOR)
        return _STAGES[self.stage](self, observation)

    def _meet(self, observation: Observation) -> Action:
        if not self._began:
            self._began = True
            self.going.begin(np.array(self.told["waits_at"]), near=_AT_PERSON, stops=True)
        action = self.going.act(observation)
        if not self.going.busy:
            self._next(Stage.CALL)
            return {"type": "stop"}
        return action

    def _call(self, observation: Observation) -> Action:
        self._said -= self.period
        if self._said > 0.0:
            return {"type": "wait"}
        self._said = _CALLS_EVERY
        name = split_name(str(self.told["person"]["name"]))[1]
        return {"type": "communicate", "text": f"{name}, I am here to walk with you."}

    def _along(self, observation: Observation) -> Action:
        if apart(Stance.of(observation).position, self.door) <= _LEAVES:
            self._next(Stage.DOOR)
            return _STAGES[self.stage](self, observation)
        if not self._began:
            self._began = True
            return {"type": "follow", "agent": str(self.told["person"]["agent"])}
        return {"type": "wait"}

    def _go_beside(self, observation: Observation) -> Action:
        """Go to one spot after the other beside the door until one can be come to."""
        here = Stance.of(observation).position
        if not self._began:
            spots = waiting_spots(self._map, self.door, self._before, here)
            if self._spot >= len(spots):
                self._next(Stage.FACE)
                return {"type": "stop"}
            self._began = True
            self.going.begin(spots[self._spot], near=_AT_SPOT, stops=True)
        action = self.going.act(observation)
        if self.going.busy:
            return action
        if self.going.arrived:
            self._next(Stage.FACE)
        else:
            self._began, self._spot = False, self._spot + 1
        return {"type": "stop"}

    def _face(self, observation: Observation) -> Action:
        action = turn_towards(Stance.of(observation), self.door, fastest=_TURN)
        if action is None:
            self._next(Stage.WAIT)
            return {"type": "stop"}
        return action

    def _wait(self, observation: Observation) -> Action:
        return {"type": "wait"}

    def _next(self, stage: Stage) -> None:
        self.stage, self._began, self._said = stage, False, 0.0

    def state(self) -> AgentState:
        """Return all it remembers."""
        return {
            "going": self.going.state(),
            "stage": str(self.stage),
            "began": self._began,
            "said": self._said,
            "spot": self._spot,
        }

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self.going.restore(state["going"])
        self.stage, self._began = Stage(state["stage"]), bool(state["began"])
        self._said, self._spot = float(state["said"]), int(state["spot"])


def waiting_spots(public_map: PublicMap, door: Array, before: Array, here: Array) -> list[Array]:
    """Return free ground beside a door where nobody who goes in or comes out is in the way, the nearest first.

    Parameters
    ----------
    door, before, here
        The door, a point before it, and from where one comes, ENU metres.

    Returns
    -------
    list of ndarray
        ENU metres, shape ``(2,)`` each.
    """
    walkable, middle = public_map.walkable, door[:2]
    out = before[:2] - middle
    out = out / max(float(np.hypot(*out)), 1e-6)
    found = []
    for ring in _RINGS:
        for k in range(_SIDES):
            angle = 2.0 * math.pi * k / _SIDES
            offset = ring * np.array([math.cos(angle), math.sin(angle)])
            x, y = (middle + offset).tolist()
            along, aside = float(dot(offset, out)), abs(float(offset[0] * out[1] - offset[1] * out[0]))
            if not bool(walkable.is_connected((x, y))) or walkable.class_of(x, y) not in (OPEN, SIDEWALK):
                continue
            if walkable.clearance_of(x, y) >= _ROOM and along > 0.0 and (aside >= _OFF_WAY or along > _WAY_IN):
                found.append(np.array([x, y]))
    return sorted(found, key=lambda spot: apart(spot, here))


_STAGES = {
    Stage.MEET: Escort._meet,
    Stage.CALL: Escort._call,
    Stage.ALONG: Escort._along,
    Stage.DOOR: Escort._go_beside,
    Stage.FACE: Escort._face,
    Stage.WAIT: Escort._wait,
}
