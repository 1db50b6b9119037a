"""A drone that looks for a thing from above, and tells where it lies."""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.base import Action, Info, Observation
from vico.agents.robot.body import Stance
from vico.agents.state import AgentState
from vico.agents.teaming.walking import sight_of
from vico.agents.teaming.words import ON_MY_WAY, heard_from, says_lies
from vico.world.public import PublicMap

Array = NDArray[np.float64]

# Heights above ground to look from, tried one after the other where something is there; of looking closer, metres.
_HEIGHTS, _CLOSER = (6.0, 9.0, 13.0), 4.5
# Viewpoints: the middle of the area, and rings about it, as shares of its radius, with so many points each.
_RINGS = ((0.0, 1), (0.7, 6), (1.1, 8))
# Metres from a point at which the drone is there; seconds until it counts as there anyway; metres a second to be calm.
_THERE, _PATIENCE, _CALM = 1.0, 25.0, 0.6
# A full turn, rad/s and seconds.
_TURN, _ROUND = 0.9, 7.2
# Pixels that make a sighting, and a sure one; beside it one looks from so far off, metres.
_PIXELS, _SURE, _OFF = 6, 40, 3.0
# Seconds between two messages; how often one looks closer.
_TELLS_EVERY, _LOOKS = 4.0, 3


class Stage(StrEnum):
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
        What the task tells (`vico.challenges.teaming.model.TeamingTask.instruction`), and ``period``, seconds.
    other
        Name of the robot on the ground.
    """

    def __init__(self, told: Mapping[str, Any], public_map: PublicMap, *, other: str) -> None:
        self.told, self.other, self.period = dict(told), other, float(told["period"])
        self._height = public_map.height
        self._half = public_map.half
        region = told["destination"]
        self.viewpoints = viewpoints(np.array(region["centre"][:2]), float(region["radius"]))
        self.stage = Stage.FLY
        #: Where the thing lies as far as it knows, ENU metres.
        self.found: Array | None = None
        self._view = self._level = self._looks = 0
        self._asked = False
        self._clock = self._said = 0.0
        self._aim = np.zeros(3)

    @property
    def wants_picture(self) -> bool:
        """Whether it looks for the thing the next time."""
        return self.stage is not Stage.END

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the action for the coming period."""
        self._clock += self.period
        if any(text == ON_MY_WAY for text, _ in heard_from(observation, self.other)):
            self._next(Stage.END)
        if self.stage in (Stage.FLY, Stage.TURN) and self._sees(observation, info, _PIXELS):
            self._next(Stage.CLOSER)
        return _STAGES[self.stage](self, observation, info)

    def _sees(self, observation: Observation, info: Info, least: int) -> bool:
        """Look for the thing, and remember where it lies."""
        seen = sight_of(observation, info, str(self.told["object"]), least=least)
        if seen is None:
            return False
        self.found = seen.position[:2].copy()
        return True

    def _fly(self, observation: Observation, info: Info) -> Action:
        if not self._asked:
            point = self.viewpoints[self._view % len(self.viewpoints)]
            return self._ask(point, _HEIGHTS[self._level])
        if self._refused(observation):
            self._level += 1
            if self._level == len(_HEIGHTS):
                self._go_on()
            self._asked = False
            return {"type": "wait"}
        if self._is_there(observation):
            self._next(Stage.TURN)
        return {"type": "wait"}

    def _turn(self, observation: Observation, info: Info) -> Action:
        if self._clock > _ROUND:
            self._go_on()
            return {"type": "stop"}
        return {"type": "control", "space": "velocity", "vector": [0.0, 0.0, 0.0, _TURN]}

    def _closer(self, observation: Observation, info: Info) -> Action:
        """Fly nearer to what was seen and look at it again; it is told at once if it can't be flown to."""
        assert self.found is not None
        here = Stance.of(observation)
        if self._sees(observation, info, _SURE):
            self._next(Stage.TELL)
            return {"type": "stop"}
        if not self._asked:
            off = here.position[:2] - self.found
            far = max(float(np.hypot(*off)), 1e-6)
            return self._ask(self.found + off * min(_OFF, far) / far, _CLOSER)
        if self._refused(observation):
            self._next(Stage.TELL)
            return {"type": "stop"}
        if not self._is_there(observation):
            return {"type": "wait"}
        if self._sees(observation, info, _PIXELS) or self._looks >= _LOOKS:
            self._next(Stage.TELL)
            return {"type": "stop"}
        error = math.atan2(*(self.found - here.position[:2])[::-1]) - math.atan2(*here.rotation[1::-1, 0])
        error = (error + math.pi) % (2.0 * math.pi) - math.pi
        if abs(error) < 0.1:
            self._looks += 1
            self._asked, self._clock = False, 0.0
        return {"type": "control", "space": "velocity", "vector": [0.0, 0.0, 0.0, min(max(error, -_TURN), _TURN)]}

    def _tell(self, observation: Observation, info: Info) -> Action:
        """Say it every few seconds until the other one is on its way."""
        assert self.found is not None
        self._sees(observation, info, _PIXELS)
        self._said -= self.period
        if self._said > 0.0:
            return {"type": "wait"}
        self._said = _TELLS_EVERY
        return {"type": "communicate", "text": says_lies(str(self.told["object"]), self.found)}

    def _rest(self, observation: Observation, info: Info) -> Action:
        return {"type": "wait"}

    def _go_on(self) -> None:
        """Take the next viewpoint; after the last one the first, from higher up."""
        self._view += 1
        self._level = min(self._view // len(self.viewpoints), len(_HEIGHTS) - 1)
        self._next(Stage.FLY)

    def _ask(self, point: Array, height: float) -> Action:
        """Ask to fly above a point of the world."""
        edge = self._half - 3.0
        x, y = np.clip(point, -edge, edge).tolist()
        self._aim = np.array([x, y, float(self._height(np.array([x, y]))) + height])
        self._asked, self._clock = True, 0.0
        return {"type": "fly_to", "target": self._aim.tolist()}

    def _refused(self, observation: Observation) -> bool:
        return self._clock <= 1.5 * self.period and observation["state"]["action_status"] == "refused"

    def _is_there(self, observation: Observation) -> bool:
        here, velocity = Stance.of(observation).position, observation["sensors"]["base_velocity"]
        calm = float(np.linalg.norm(velocity)) < _CALM
        return self._clock > _PATIENCE or (calm and float(np.linalg.norm(here - self._aim)) < _THERE)

    def _next(self, stage: Stage) -> None:
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
        self.stage, self._asked = Stage(state["stage"]), bool(state["asked"])
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


_STAGES = {
    Stage.FLY: Spotter._fly,
    Stage.TURN: Spotter._turn,
    Stage.CLOSER: Spotter._closer,
    Stage.TELL: Spotter._tell,
    Stage.END: Spotter._rest,
}
