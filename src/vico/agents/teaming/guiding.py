"""A robot that shows a person the way: leads a few metres, looks round for them, waits, fetches them."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.base import Action, Info, Observation
from vico.agents.robot.body import Stance
from vico.agents.robot.driving import Drive
from vico.agents.state import AgentState
from vico.agents.teaming.newcomer import I_FOLLOW
from vico.agents.teaming.walking import apart, sight_of, turn, turn_towards
from vico.agents.teaming.words import heard_from
from vico.english import split_name
from vico.geometry import distance
from vico.world.public import PublicMap

Array = NDArray[np.float64]

# How near one comes to call somebody, to a corner of the way, to its end, and to where somebody was last, metres.
_AT_PERSON, _AT_CORNER, _AT_END, _AT_LOST = 2.5, 0.7, 1.0, 1.5
# Metres from one look round to the next; so near the person has to be for the robot to go on.
_LEG, _NEAR = 4.0, 3.5
# Who is farther off than this and calls is gone to, metres, until nearer than that.
_FAR = 5.0
# Seconds between two calls; of turning until it is sure to have looked all round; and of waiting for who is in view,
# but does not come, until it goes to them.
_CALLS_EVERY, _ROUND, _PATIENCE = 4.0, 11.0, 30.0
_TURN = 0.9


class Stage(StrEnum):
    """What the robot is at."""

    MEET = "go to the person"
    CALL = "call them"
    LEAD = "lead"
    LOOK = "look round for them"
    FETCH = "go back to them"
    END = "end"


class Leader:
    """Leads a person along a way of the public map.

    Parameters
    ----------
    told
        What the task tells (`vico.challenges.teaming.model.TeamingTask.instruction`), and ``period``, seconds.
    looks_back
        Whether it looks round for the person; else it goes to the destination without a stop.
    """

    def __init__(self, told: Mapping[str, Any], public_map: PublicMap, *, looks_back: bool = True) -> None:
        self.told, self.looks_back, self.period = dict(told), looks_back, float(told["period"])
        self._map = public_map
        self.goal = np.array(told["destination"]["centre"], np.float64)[:2]
        self.going = Drive(period=self.period)
        self.stage = Stage.MEET
        #: Where the person was last seen or heard, ENU metres.
        self.person = np.array(told["waits_at"], np.float64)[:2]
        self._began = self._faced = False
        self._said = self._looked = 0.0
        self._blocked = 0

    @property
    def wants_picture(self) -> bool:
        """Whether it looks for the person the next time."""
        return self.stage in (Stage.LOOK, Stage.FETCH)

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the action for the coming period."""
        for text, at in heard_from(observation, str(self.told["person"]["agent"])):
            self.person = at[:2].copy()
            if text == I_FOLLOW and self.stage in (Stage.MEET, Stage.CALL):
                self._next(Stage.LEAD)
            elif self.stage == Stage.LEAD and self.looks_back:
                self._next(Stage.LOOK)
            elif self.stage == Stage.LOOK and self._faced and self._away(observation) > _FAR:
                self._next(Stage.FETCH)
        return _STAGES[self.stage](self, observation, info)

    def _meet(self, observation: Observation, info: Info) -> Action:
        if not self._began:
            self._began = True
            self.going.begin(self.person, near=_AT_PERSON, stops=True)
        action = self.going.act(observation)
        if not self.going.busy:
            self._next(Stage.CALL)
            return {"type": "stop"}
        return action

    def _call(self, observation: Observation, info: Info) -> Action:
        self._said -= self.period
        if self._said > 0.0:
            return {"type": "wait"}
        self._said = _CALLS_EVERY
        name = split_name(str(self.told["person"]["name"]))[1]
        return {"type": "communicate", "text": f"{name}, please follow me, I know the way."}

    def _lead(self, observation: Observation, info: Info) -> Action:
        """Go on for some metres, to the end without a look if it does not look back."""
        here = Stance.of(observation).position[:2]
        if not self._began:
            self._began = True
            target, last = self._corner(here)
            self.going.begin(target, near=_AT_END if last else _AT_CORNER, stops=True)
        action = self.going.act(observation)
        if self.going.busy:
            return action
        self._blocked = 0 if self.going.arrived else self._blocked + 1
        at_goal = apart(here, self.goal) <= _AT_END + 0.1
        self._next(Stage.LOOK if self.looks_back else Stage.END if at_goal else Stage.LEAD)
        return {"type": "stop"}

    def _corner(self, here: Array) -> tuple[Array, bool]:
        """Return where this leg of the way ends, and whether that is the end of the way.

        A leg whose end could not be come to is followed by a longer one.
        """
        path = self._map.router.path(here, self.goal)
        if path is None or not self.looks_back:
            return self.goal, True
        left = _LEG * (1 + self._blocked)
        for start, end in pairwise(path):
            length = distance(end, start)
            if length >= left:
                return start + (end - start) * left / length, False
            left -= length
        return self.goal, True

    def _look(self, observation: Observation, info: Info) -> Action:
        """Turn to where the person was, wait while they come, turn on if they are not there."""
        here = Stance.of(observation)
        self._looked += self.period
        seen = sight_of(observation, info, str(self.told["person"]["name"]))
        if seen is not None:
            self.person = seen.position[:2].copy()
            if apart(self.person, here.position) <= _NEAR:
                self._next(Stage.END if apart(here.position, self.goal) <= _AT_END + 0.3 else Stage.LEAD)
                return {"type": "stop"}
            if self._looked > _PATIENCE:
                self._next(Stage.FETCH)
                return {"type": "stop"}
            action = turn_towards(here, self.person, fastest=_TURN)
            self._faced = self._faced or action is None
            return action or {"type": "stop"}
        if not self._faced:
            action = turn_towards(here, self.person, fastest=_TURN)
            if action is not None:
                return action
            self._faced, self._said = True, 0.0
        self._said += self.period
        if self._said > _ROUND:
            self._next(Stage.FETCH)
            return {"type": "stop"}
        return turn(_TURN)

    def _fetch(self, observation: Observation, info: Info) -> Action:
        """Go back to where the person was seen or heard last; there look round again."""
        if not self._began:
            self._began = True
            self.going.begin(self.person, near=_AT_LOST, stops=True)
        action = self.going.act(observation)
        seen = sight_of(observation, info, str(self.told["person"]["name"]))
        if self.going.busy and not (seen is not None and self._away(observation, seen.position) <= _FAR - 1.0):
            return action
        self._next(Stage.LOOK)
        return {"type": "stop"}

    def _rest(self, observation: Observation, info: Info) -> Action:
        return {"type": "wait"}

    def _away(self, observation: Observation, point: Array | None = None) -> float:
        """Return how far off a point is, or the person as far as it knows, metres."""
        return apart(self.person if point is None else point, Stance.of(observation).position)

    def _next(self, stage: Stage) -> None:
        self.stage, self._began, self._faced = stage, False, False
        self._said = self._looked = 0.0

    def state(self) -> AgentState:
        """Return all it remembers."""
        return {
            "going": self.going.state(),
            "stage": str(self.stage),
            "person": self.person.copy(),
            "flags": [self._began, self._faced],
            "seconds": [self._said, self._looked],
            "blocked": self._blocked,
        }

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self.going.restore(state["going"])
        self.stage, self.person = Stage(state["stage"]), np.array(state["person"])
        self._began, self._faced = (bool(flag) for flag in state["flags"])
        self._said, self._looked = (float(value) for value in state["seconds"])
        self._blocked = int(state["blocked"])


_STAGES = {
    Stage.MEET: Leader._meet,
    Stage.CALL: Leader._call,
    Stage.LEAD: Leader._lead,
    Stage.LOOK: Leader._look,
    Stage.FETCH: Leader._fetch,
    Stage.END: Leader._rest,
}
