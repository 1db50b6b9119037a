"""A robot on the ground that goes where a thing lies: as it is told, or by looking for it itself."""

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
from vico.agents.teaming.spotter import viewpoints
from vico.agents.teaming.walking import apart, sight_of, turn
from vico.agents.teaming.words import ON_MY_WAY, heard_from, told_lies

Array = NDArray[np.float64]

# Metres from the thing at which it stops, so that it does not run into it; directions that it comes from.
_STOPS, _SIDES = 1.3, 8
# How near it comes to the spot it goes to, and to viewpoints, metres; of the thing it counts as there so near.
_AT_SPOT, _AT_VIEW, _THERE = 0.35, 1.5, 1.8
# A full turn, rad/s and seconds; pixels that make a sighting.
_TURN, _ROUND, _PIXELS = 0.8, 8.5, 12
# What was seen from nearer than this is more exact than what was told, metres.
_OWN_EYES = 6.0


class Stage(StrEnum):
    """What the robot is at."""

    WAIT = "wait for word"
    SEARCH = "go to a viewpoint"
    TURN = "look all round"
    GO = "go to the thing"
    STAND = "stand beside it"


class Finder:
    """Waits until it is told where the thing lies, goes there, and stands beside it.

    Parameters
    ----------
    told
        What the task tells (`vico.challenges.teaming.model.TeamingTask.instruction`), and ``period``, seconds.
    spotter
        Name of the robot that looks from above; "" for none: it looks for the thing itself.
    """

    def __init__(self, told: Mapping[str, Any], *, spotter: str) -> None:
        self.told, self.spotter, self.period = dict(told), spotter, float(told["period"])
        region = told["destination"]
        self.viewpoints = viewpoints(np.array(region["centre"][:2]), float(region["radius"]))
        self.going = Drive(period=self.period)
        self.stage = Stage.WAIT if spotter else Stage.SEARCH
        #: Where the thing lies as far as it knows, ENU metres.
        self.thing: Array | None = None
        self._answers = self._began = False
        self._view = self._side = 0
        self._turned = 0.0

    @property
    def wants_picture(self) -> bool:
        """Whether it looks for the thing the next time."""
        return self.stage not in (Stage.WAIT, Stage.STAND)

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the action for the coming period."""
        for text, _ in heard_from(observation, self.spotter):
            at = told_lies(text, str(self.told["object"]))
            if at is not None:
                self._answers, self.thing = True, at
                self._next(Stage.GO)
        if self._answers:
            self._answers = False
            return {"type": "communicate", "text": ON_MY_WAY}
        self._look(observation, info)
        return _STAGES[self.stage](self, observation)

    def _look(self, observation: Observation, info: Info) -> None:
        """Look out for the thing itself: from near by that is more exact than what was told."""
        seen = sight_of(observation, info, str(self.told["object"]), least=_PIXELS)
        if seen is None or self.stage == Stage.STAND:
            return
        near = apart(seen.position, Stance.of(observation).position) <= _OWN_EYES
        if self.thing is None or (near and apart(seen.position, self.thing) > 0.5):
            self.thing = seen.position[:2].copy()
            self._side = 0
            self._next(Stage.GO)

    def _wait(self, observation: Observation) -> Action:
        return {"type": "wait"}

    def _search(self, observation: Observation) -> Action:
        """Go to the next viewpoint; what can't be come to is left out."""
        if not self._began:
            self._began = True
            self.going.begin(self.viewpoints[self._view % len(self.viewpoints)], near=_AT_VIEW, stops=True)
            self._view += 1
        action = self.going.act(observation)
        if self.going.busy:
            return action
        self._next(Stage.TURN if self.going.arrived else Stage.SEARCH)
        return {"type": "stop"}

    def _look_round(self, observation: Observation) -> Action:
        self._turned += self.period
        if self._turned > _ROUND:
            self._next(Stage.SEARCH)
            return {"type": "stop"}
        return turn(_TURN)

    def _go(self, observation: Observation) -> Action:
        """Go beside the thing, from the near side first, then from others."""
        assert self.thing is not None
        here = Stance.of(observation).position[:2]
        if apart(here, self.thing) <= _STOPS:
            self._next(Stage.STAND)
            return {"type": "stop"}
        if not self._began:
            if self._side == _SIDES:  # from nowhere nearer
                self._next(Stage.STAND)
                return {"type": "stop"}
            self._began = True
            self.going.begin(self._beside(here), near=_AT_SPOT, stops=True)
        action = self.going.act(observation)
        if self.going.busy:
            return action
        if apart(here, self.thing) <= _THERE:
            self._next(Stage.STAND)
        else:
            self._side += 1
            self._next(Stage.GO)
        return {"type": "stop"}

    def _beside(self, here: Array) -> Array:
        """Return the spot beside the thing that is tried next: turned to the left and right of the near side."""
        assert self.thing is not None
        back = here - self.thing
        step = (self._side + 1) // 2 * (1 if self._side % 2 else -1)
        angle = math.atan2(back[1], back[0]) + 2.0 * math.pi * step / _SIDES
        return self.thing + (_STOPS - 0.1) * np.array([math.cos(angle), math.sin(angle)])

    def _stand(self, observation: Observation) -> Action:
        return {"type": "wait"}

    def _next(self, stage: Stage) -> None:
        self.stage, self._began, self._turned = stage, False, 0.0

    def state(self) -> AgentState:
        """Return all it remembers."""
        return {
            "going": self.going.state(),
            "stage": str(self.stage),
            "thing": None if self.thing is None else self.thing.copy(),
            "flags": [self._answers, self._began],
            "counts": [self._view, self._side],
            "turned": self._turned,
        }

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self.going.restore(state["going"])
        self.stage, self._turned = Stage(state["stage"]), float(state["turned"])
        self.thing = None if state["thing"] is None else np.array(state["thing"])
        self._answers, self._began = (bool(flag) for flag in state["flags"])
        self._view, self._side = (int(value) for value in state["counts"])


_STAGES = {
    Stage.WAIT: Finder._wait,
    Stage.SEARCH: Finder._search,
    Stage.TURN: Finder._look_round,
    Stage.GO: Finder._go,
    Stage.STAND: Finder._stand,
}
