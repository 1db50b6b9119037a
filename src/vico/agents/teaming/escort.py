"""Robots that accompany a person: an escort to a door, and a guide who shows the way.

An `Escort` walks with the person and waits beside the door. A `Guide` leads a few metres, looks round for the person,
waits, and fetches them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import StrEnum
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.base import Action, AgentState, FieldState, Info, Observation
from vico.agents.robot.body import Drive, Stance
from vico.agents.teaming.people import I_FOLLOW, LETS_GO
from vico.agents.teaming.team_skills import find_in_view, ground_distance, messages_from, turn, turn_towards
from vico.english import split_name
from vico.exact import dot
from vico.geometry import distance
from vico.world.public import PublicMap
from vico.world.walkable import OPEN, SIDEWALK

Array = NDArray[np.float64]

_ESCORT_CALL_DISTANCE = 3.0  # metres from which somebody is called
_AT_SPOT = 0.5  # metres at which a spot is reached
_ESCORT_CALL_PERIOD = 4.0  # seconds between two calls
# So near the door the robot leaves the person, who goes in, and goes to a spot beside it, metres.
_LEAVES = 5.0
# Spots beside a door.
_RINGS = (2.2, 2.8, 3.3)  # metres from the door, in the order in which they are tried
_ROOM = 0.6  # metres of room
_OFF_WAY = 1.1  # metres off the way in
_SIDES = 16  # directions that are tried
# The way in is kept free so far before the door, metres.
_WAY_IN = 4.0
_ESCORT_TURN_SPEED = 0.6


class EscortStage(StrEnum):
    """What the robot is at."""

    MEET = "go to the person"
    CALL = "call them"
    ALONG = "walk with them"
    DOOR = "go beside the door"
    FACE = "turn to the door"
    WAIT = "wait"


class Escort(FieldState):
    """Goes to the person, calls, follows, leaves them before the door, and stands beside it.

    Parameters
    ----------
    told
        What the task tells (`vico.challenges.teaming.tasks.TeamingTask.instruction`), and ``period``, seconds.
    stays_near
        Whether it keeps near the person on the way; else it goes to the door as fast as it can.
    """

    going: Drive
    stage: EscortStage = EscortStage.MEET
    _began: bool = False
    _said: float = 0.0
    _spot: int = 0

    def __init__(self, told: Mapping[str, Any], public_map: PublicMap, *, stays_near: bool = True) -> None:
        self.told, self.stays_near, self.period = dict(told), stays_near, float(told["period"])
        place = public_map.place_by_id[str(told["destination"]["place"])]
        self.door = np.array(place.entrance or place.position, np.float64)
        self._before = np.array(place.position, np.float64)
        self._map = public_map
        self.going = Drive(period=self.period)

    @property
    def wants_picture(self) -> bool:
        """Whether it looks at its pictures: never; whom it follows its controller finds."""
        return False

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the action for the coming period."""
        heard = messages_from(observation, str(self.told["person"]["agent"]))
        if self.stage in (EscortStage.MEET, EscortStage.CALL) and any(text == LETS_GO for text, _ in heard):
            self._next(EscortStage.ALONG if self.stays_near else EscortStage.DOOR)
        return _ESCORT_STAGES[self.stage](self, observation)

    def _meet(self, observation: Observation) -> Action:
        if not self._began:
            self._began = True
            self.going.begin(np.array(self.told["waits_at"]), near=_ESCORT_CALL_DISTANCE, stops=True)
        action = self.going.act(observation)
        if not self.going.busy:
            self._next(EscortStage.CALL)
            return {"type": "stop"}
        return action

    def _call(self, observation: Observation) -> Action:
        self._said -= self.period
        if self._said > 0.0:
            return {"type": "wait"}
        self._said = _ESCORT_CALL_PERIOD
        name = split_name(str(self.told["person"]["name"]))[1]
        return {"type": "communicate", "text": f"{name}, I am here to walk with you."}

    def _along(self, observation: Observation) -> Action:
        if ground_distance(Stance.of(observation).position, self.door) <= _LEAVES:
            self._next(EscortStage.DOOR)
            return _ESCORT_STAGES[self.stage](self, observation)
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
                self._next(EscortStage.FACE)
                return {"type": "stop"}
            self._began = True
            self.going.begin(spots[self._spot], near=_AT_SPOT, stops=True)
        action = self.going.act(observation)
        if self.going.busy:
            return action
        if self.going.arrived:
            self._next(EscortStage.FACE)
        else:
            self._began, self._spot = False, self._spot + 1
        return {"type": "stop"}

    def _face(self, observation: Observation) -> Action:
        action = turn_towards(Stance.of(observation), self.door, fastest=_ESCORT_TURN_SPEED)
        if action is None:
            self._next(EscortStage.WAIT)
            return {"type": "stop"}
        return action

    def _wait(self, observation: Observation) -> Action:
        return {"type": "wait"}

    def _next(self, stage: EscortStage) -> None:
        self.stage, self._began, self._said = stage, False, 0.0


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
    return sorted(found, key=lambda spot: ground_distance(spot, here))


_ESCORT_STAGES = {
    EscortStage.MEET: Escort._meet,
    EscortStage.CALL: Escort._call,
    EscortStage.ALONG: Escort._along,
    EscortStage.DOOR: Escort._go_beside,
    EscortStage.FACE: Escort._face,
    EscortStage.WAIT: Escort._wait,
}


_GUIDE_CALL_DISTANCE = 2.5  # metres from which somebody is called
_AT_CORNER = 0.7  # metres at which a corner of the way is reached
_AT_END = 1.0  # metres at which its end is
_AT_LOST = 1.5  # metres at which the place is where somebody was last
# Metres from one look round to the next; so near the person has to be for the robot to go on.
_LEG, _NEAR = 4.0, 3.5
# Who is farther off than this and calls is gone to, metres, until nearer than that.
_FAR = 5.0
_GUIDE_CALL_PERIOD = 4.0  # seconds between two calls
_GUIDE_TURN_TIME = 11.0  # seconds of turning until it has looked all round
_PATIENCE = 30.0  # seconds until it goes to somebody in view who does not come
_GUIDE_TURN_SPEED = 0.9


class GuideStage(StrEnum):
    """What the robot is at."""

    MEET = "go to the person"
    CALL = "call them"
    LEAD = "lead"
    LOOK = "look round for them"
    FETCH = "go back to them"
    END = "end"


class Guide:
    """Leads a person along a way of the public map.

    Parameters
    ----------
    told
        What the task tells (`vico.challenges.teaming.tasks.TeamingTask.instruction`), and ``period``, seconds.
    looks_back
        Whether it looks round for the person; else it goes to the destination without a stop.
    """

    def __init__(self, told: Mapping[str, Any], public_map: PublicMap, *, looks_back: bool = True) -> None:
        self.told, self.looks_back, self.period = dict(told), looks_back, float(told["period"])
        self._map = public_map
        self.goal = np.array(told["destination"]["centre"], np.float64)[:2]
        self.going = Drive(period=self.period)
        self.stage = GuideStage.MEET
        #: Where the person was last seen or heard, ENU metres.
        self.person = np.array(told["waits_at"], np.float64)[:2]
        self._began = self._faced = False
        self._said = self._looked = 0.0
        self._blocked = 0

    @property
    def wants_picture(self) -> bool:
        """Whether it looks for the person the next time."""
        return self.stage in (GuideStage.LOOK, GuideStage.FETCH)

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the action for the coming period."""
        for text, at in messages_from(observation, str(self.told["person"]["agent"])):
            self.person = at[:2].copy()
            if text == I_FOLLOW and self.stage in (GuideStage.MEET, GuideStage.CALL):
                self._next(GuideStage.LEAD)
            elif self.stage == GuideStage.LEAD and self.looks_back:
                self._next(GuideStage.LOOK)
            elif self.stage == GuideStage.LOOK and self._faced and self._away(observation) > _FAR:
                self._next(GuideStage.FETCH)
        return _GUIDE_STAGES[self.stage](self, observation, info)

    def _meet(self, observation: Observation, info: Info) -> Action:
        if not self._began:
            self._began = True
            self.going.begin(self.person, near=_GUIDE_CALL_DISTANCE, stops=True)
        action = self.going.act(observation)
        if not self.going.busy:
            self._next(GuideStage.CALL)
            return {"type": "stop"}
        return action

    def _call(self, observation: Observation, info: Info) -> Action:
        self._said -= self.period
        if self._said > 0.0:
            return {"type": "wait"}
        self._said = _GUIDE_CALL_PERIOD
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
        at_goal = ground_distance(here, self.goal) <= _AT_END + 0.1
        self._next(GuideStage.LOOK if self.looks_back else GuideStage.END if at_goal else GuideStage.LEAD)
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
        seen = find_in_view(observation, info, str(self.told["person"]["name"]))
        if seen is not None:
            self.person = seen.position[:2].copy()
            if ground_distance(self.person, here.position) <= _NEAR:
                self._next(
                    GuideStage.END if ground_distance(here.position, self.goal) <= _AT_END + 0.3 else GuideStage.LEAD
                )
                return {"type": "stop"}
            if self._looked > _PATIENCE:
                self._next(GuideStage.FETCH)
                return {"type": "stop"}
            action = turn_towards(here, self.person, fastest=_GUIDE_TURN_SPEED)
            self._faced = self._faced or action is None
            return action or {"type": "stop"}
        if not self._faced:
            action = turn_towards(here, self.person, fastest=_GUIDE_TURN_SPEED)
            if action is not None:
                return action
            self._faced, self._said = True, 0.0
        self._said += self.period
        if self._said > _GUIDE_TURN_TIME:
            self._next(GuideStage.FETCH)
            return {"type": "stop"}
        return turn(_GUIDE_TURN_SPEED)

    def _fetch(self, observation: Observation, info: Info) -> Action:
        """Go back to where the person was seen or heard last; there look round again."""
        if not self._began:
            self._began = True
            self.going.begin(self.person, near=_AT_LOST, stops=True)
        action = self.going.act(observation)
        seen = find_in_view(observation, info, str(self.told["person"]["name"]))
        if self.going.busy and not (seen is not None and self._away(observation, seen.position) <= _FAR - 1.0):
            return action
        self._next(GuideStage.LOOK)
        return {"type": "stop"}

    def _rest(self, observation: Observation, info: Info) -> Action:
        return {"type": "wait"}

    def _away(self, observation: Observation, point: Array | None = None) -> float:
        """Return how far off a point is, or the person as far as it knows, metres."""
        return ground_distance(self.person if point is None else point, Stance.of(observation).position)

    def _next(self, stage: GuideStage) -> None:
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
        self.stage, self.person = GuideStage(state["stage"]), np.array(state["person"])
        self._began, self._faced = (bool(flag) for flag in state["flags"])
        self._said, self._looked = (float(value) for value in state["seconds"])
        self._blocked = int(state["blocked"])


_GUIDE_STAGES = {
    GuideStage.MEET: Guide._meet,
    GuideStage.CALL: Guide._call,
    GuideStage.LEAD: Guide._lead,
    GuideStage.LOOK: Guide._look,
    GuideStage.FETCH: Guide._fetch,
    GuideStage.END: Guide._rest,
}
