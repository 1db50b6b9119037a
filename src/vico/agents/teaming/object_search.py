"""Robots that look for a thing: a drone from above, and a robot on the ground.

A `Spotter` looks for the thing and tells where it lies. A `Finder` goes where the thing lies: as it is told, or by
looking for it itself.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.base import Action, AgentState, Info, Observation
from vico.agents.robot.body import Drive, Stance
from vico.agents.teaming.team_skills import (
    ON_MY_WAY,
    find_in_view,
    ground_distance,
    messages_from,
    object_location_message,
    parse_object_location,
    turn,
)
from vico.world.public import PublicMap

Array = NDArray[np.float64]

# Heights above ground to look from, tried one after the other where something is there; of looking closer, metres.
_HEIGHTS, _CLOSER = (6.0, 9.0, 13.0), 4.5
# Viewpoints: the middle of the area, and rings about it, as shares of its radius, with so many points each.
_RINGS = ((0.0, 1), (0.7, 6), (1.1, 8))
_AT_VIEWPOINT = 1.0  # metres from a viewpoint at which the drone is there
_PATIENCE = 25.0  # seconds until it counts as there anyway
_CALM = 0.6  # m/s below which it is calm
# A full turn, rad/s and seconds.
_SPOTTER_TURN_SPEED, _SPOTTER_TURN_TIME = 0.9, 7.2
_SPOTTER_MIN_PIXELS = 6  # pixels of a sighting
_SURE = 40  # pixels of a sure one
_OFF = 3.0  # metres beside a thing from which one looks at it
# Seconds between two messages; how often one looks closer.
_TELLS_EVERY, _LOOKS = 4.0, 3


class SpotterStage(StrEnum):
    """What the drone is at."""

    FLY = "fly to a viewpoint"
    TURN = "look all round"
    CLOSER = "look closer"
    TELL = "tell where it lies"
    END = "hover"


class Spotter:
    """Looks all round from one viewpoint after the other, looks closer at what it finds, and tells the other robot.

    Parameters
    ----------
    told
        What the task tells (`vico.challenges.teaming.tasks.TeamingTask.instruction`), and ``period``, seconds.
    other
        Name of the robot on the ground.
    """

    def __init__(self, told: Mapping[str, Any], public_map: PublicMap, *, other: str) -> None:
        self.told, self.other, self.period = dict(told), other, float(told["period"])
        self._height = public_map.height
        self._half = public_map.half
        region = told["destination"]
        self.viewpoints = viewpoints(np.array(region["centre"][:2]), float(region["radius"]))
        self.stage = SpotterStage.FLY
        #: Where the thing lies as far as it knows, ENU metres.
        self.found: Array | None = None
        self._view = self._level = self._looks = 0
        self._asked = False
        self._clock = self._said = 0.0
        self._aim = np.zeros(3)

    @property
    def wants_picture(self) -> bool:
        """Whether it looks for the thing the next time."""
        return self.stage is not SpotterStage.END

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the action for the coming period."""
        self._clock += self.period
        if any(text == ON_MY_WAY for text, _ in messages_from(observation, self.other)):
            self._next(SpotterStage.END)
        if self.stage in (SpotterStage.FLY, SpotterStage.TURN) and self._sees(observation, info, _SPOTTER_MIN_PIXELS):
            self._next(SpotterStage.CLOSER)
        return _SPOTTER_STAGES[self.stage](self, observation, info)

    def _sees(self, observation: Observation, info: Info, least: int) -> bool:
        """Look for the thing, and remember where it lies."""
        seen = find_in_view(observation, info, str(self.told["object"]), least=least)
        if seen is None:
            return False
        self.found = seen.position[:2].copy()
        return True

    def _fly(self, observation: Observation, info: Info) -> Action:
        if not self._asked:
            point = self.viewpoints[self._view % len(self.viewpoints)]
            return self._ask(point, _HEIGHTS[self._level])
        if self._was_refused(observation):
            self._level += 1
            if self._level == len(_HEIGHTS):
                self._go_on()
            self._asked = False
            return {"type": "wait"}
        if self._is_there(observation):
            self._next(SpotterStage.TURN)
        return {"type": "wait"}

    def _turn(self, observation: Observation, info: Info) -> Action:
        if self._clock > _SPOTTER_TURN_TIME:
            self._go_on()
            return {"type": "stop"}
        return {"type": "control", "space": "velocity", "vector": [0.0, 0.0, 0.0, _SPOTTER_TURN_SPEED]}

    def _closer(self, observation: Observation, info: Info) -> Action:
        """Fly nearer to what was seen and look at it again; it is told at once if it can't be flown to."""
        assert self.found is not None
        here = Stance.of(observation)
        if self._sees(observation, info, _SURE):
            self._next(SpotterStage.TELL)
            return {"type": "stop"}
        if not self._asked:
            off = here.position[:2] - self.found
            far = max(float(np.hypot(*off)), 1e-6)
            return self._ask(self.found + off * min(_OFF, far) / far, _CLOSER)
        if self._was_refused(observation):
            self._next(SpotterStage.TELL)
            return {"type": "stop"}
        if not self._is_there(observation):
            return {"type": "wait"}
        if self._sees(observation, info, _SPOTTER_MIN_PIXELS) or self._looks >= _LOOKS:
            self._next(SpotterStage.TELL)
            return {"type": "stop"}
        error = math.atan2(*(self.found - here.position[:2])[::-1]) - math.atan2(*here.rotation[1::-1, 0])
        error = (error + math.pi) % (2.0 * math.pi) - math.pi
        if abs(error) < 0.1:
            self._looks += 1
            self._asked, self._clock = False, 0.0
        return {
            "type": "control",
            "space": "velocity",
            "vector": [0.0, 0.0, 0.0, min(max(error, -_SPOTTER_TURN_SPEED), _SPOTTER_TURN_SPEED)],
        }

    def _tell(self, observation: Observation, info: Info) -> Action:
        """Say it every few seconds until the other one is on its way."""
        assert self.found is not None
        self._sees(observation, info, _SPOTTER_MIN_PIXELS)
        self._said -= self.period
        if self._said > 0.0:
            return {"type": "wait"}
        self._said = _TELLS_EVERY
        return {"type": "communicate", "text": object_location_message(str(self.told["object"]), self.found)}

    def _rest(self, observation: Observation, info: Info) -> Action:
        return {"type": "wait"}

    def _go_on(self) -> None:
        """Take the next viewpoint; after the last one the first, from higher up."""
        self._view += 1
        self._level = min(self._view // len(self.viewpoints), len(_HEIGHTS) - 1)
        self._next(SpotterStage.FLY)

    def _ask(self, point: Array, height: float) -> Action:
        """Ask to fly above a point of the world."""
        edge = self._half - 3.0
        x, y = np.clip(point, -edge, edge).tolist()
        self._aim = np.array([x, y, float(self._height(np.array([x, y]))) + height])
        self._asked, self._clock = True, 0.0
        return {"type": "fly_to", "target": self._aim.tolist()}

    def _was_refused(self, observation: Observation) -> bool:
        return self._clock <= 1.5 * self.period and observation["state"]["action_status"] == "refused"

    def _is_there(self, observation: Observation) -> bool:
        here, velocity = Stance.of(observation).position, observation["sensors"]["base_velocity"]
        calm = float(np.linalg.norm(velocity)) < _CALM
        return self._clock > _PATIENCE or (calm and float(np.linalg.norm(here - self._aim)) < _AT_VIEWPOINT)

    def _next(self, stage: SpotterStage) -> None:
        self.stage, self._asked, self._clock, self._said = stage, False, 0.0, 0.0

    def state(self) -> AgentState:
        """Return all it remembers."""
        return {
            "stage": str(self.stage),
            "found": None if self.found is None else self.found.copy(),
            "counts": [self._view, self._level, self._looks],
            "asked": self._asked,
            "seconds": [self._clock, self._said],
            "aim": self._aim.copy(),
        }

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self.stage, self._asked = SpotterStage(state["stage"]), bool(state["asked"])
        self.found = None if state["found"] is None else np.array(state["found"])
        self._view, self._level, self._looks = (int(value) for value in state["counts"])
        self._clock, self._said = (float(value) for value in state["seconds"])
        self._aim = np.array(state["aim"])


def viewpoints(middle: Array, radius: float) -> list[Array]:
    """Return points to look about an area from, ENU metres, shape ``(2,)`` each."""
    found = []
    for share, count in _RINGS:
        for k in range(count):
            angle = 2.0 * math.pi * k / count
            found.append(middle + share * radius * np.array([math.cos(angle), math.sin(angle)]))
    return found


_SPOTTER_STAGES = {
    SpotterStage.FLY: Spotter._fly,
    SpotterStage.TURN: Spotter._turn,
    SpotterStage.CLOSER: Spotter._closer,
    SpotterStage.TELL: Spotter._tell,
    SpotterStage.END: Spotter._rest,
}


# Metres from the thing at which it stops, so that it does not run into it; directions that it comes from.
_STOPS, _SIDES = 1.3, 8
_AT_SPOT = 0.35  # metres at which it is at the spot it goes to
_AT_VIEW = 1.5  # metres at which it is at a viewpoint
_BESIDE_OBJECT = 1.8  # metres from the thing at which it counts as there
_FINDER_TURN_SPEED = 0.8  # rad/s of a full turn
_FINDER_TURN_TIME = 8.5  # seconds of a full turn
_FINDER_MIN_PIXELS = 12  # pixels of a sighting
# What was seen from nearer than this is more exact than what was told, metres.
_OWN_EYES = 6.0


class FinderStage(StrEnum):
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
        What the task tells (`vico.challenges.teaming.tasks.TeamingTask.instruction`), and ``period``, seconds.
    spotter
        Name of the robot that looks from above; "" for none: it looks for the thing itself.
    """

    def __init__(self, told: Mapping[str, Any], *, spotter: str) -> None:
        self.told, self.spotter, self.period = dict(told), spotter, float(told["period"])
        region = told["destination"]
        self.viewpoints = viewpoints(np.array(region["centre"][:2]), float(region["radius"]))
        self.going = Drive(period=self.period)
        self.stage = FinderStage.WAIT if spotter else FinderStage.SEARCH
        #: Where the thing lies as far as it knows, ENU metres.
        self.thing: Array | None = None
        self._answers = self._began = False
        self._view = self._side = 0
        self._turned = 0.0

    @property
    def wants_picture(self) -> bool:
        """Whether it looks for the thing the next time."""
        return self.stage not in (FinderStage.WAIT, FinderStage.STAND)

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the action for the coming period."""
        for text, _ in messages_from(observation, self.spotter):
            at = parse_object_location(text, str(self.told["object"]))
            if at is not None:
                self._answers, self.thing = True, at
                self._next(FinderStage.GO)
        if self._answers:
            self._answers = False
            return {"type": "communicate", "text": ON_MY_WAY}
        self._look(observation, info)
        return _FINDER_STAGES[self.stage](self, observation)

    def _look(self, observation: Observation, info: Info) -> None:
        """Look out for the thing itself: from near by that is more exact than what was told."""
        seen = find_in_view(observation, info, str(self.told["object"]), least=_FINDER_MIN_PIXELS)
        if seen is None or self.stage == FinderStage.STAND:
            return
        near = ground_distance(seen.position, Stance.of(observation).position) <= _OWN_EYES
        if self.thing is None or (near and ground_distance(seen.position, self.thing) > 0.5):
            self.thing = seen.position[:2].copy()
            self._side = 0
            self._next(FinderStage.GO)

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
        self._next(FinderStage.TURN if self.going.arrived else FinderStage.SEARCH)
        return {"type": "stop"}

    def _look_round(self, observation: Observation) -> Action:
        self._turned += self.period
        if self._turned > _FINDER_TURN_TIME:
            self._next(FinderStage.SEARCH)
            return {"type": "stop"}
        return turn(_FINDER_TURN_SPEED)

    def _go(self, observation: Observation) -> Action:
        """Go beside the thing, from the near side first, then from others."""
        assert self.thing is not None
        here = Stance.of(observation).position[:2]
        if ground_distance(here, self.thing) <= _STOPS:
            self._next(FinderStage.STAND)
            return {"type": "stop"}
        if not self._began:
            if self._side == _SIDES:  # from nowhere nearer
                self._next(FinderStage.STAND)
                return {"type": "stop"}
            self._began = True
            self.going.begin(self._beside(here), near=_AT_SPOT, stops=True)
        action = self.going.act(observation)
        if self.going.busy:
            return action
        if ground_distance(here, self.thing) <= _BESIDE_OBJECT:
            self._next(FinderStage.STAND)
        else:
            self._side += 1
            self._next(FinderStage.GO)
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

    def _next(self, stage: FinderStage) -> None:
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
        self.stage, self._turned = FinderStage(state["stage"]), float(state["turned"])
        self.thing = None if state["thing"] is None else np.array(state["thing"])
        self._answers, self._began = (bool(flag) for flag in state["flags"])
        self._view, self._side = (int(value) for value in state["counts"])


_FINDER_STAGES = {
    FinderStage.WAIT: Finder._wait,
    FinderStage.SEARCH: Finder._search,
    FinderStage.TURN: Finder._look_round,
    FinderStage.GO: Finder._go,
    FinderStage.STAND: Finder._stand,
}
