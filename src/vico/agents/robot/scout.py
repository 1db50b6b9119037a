"""The carrier that looks about: comes along to the source, says where it sees the thing, goes with the person."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vico.agents.base import Action, Info, Observation
from vico.agents.robot.body import Stance
from vico.agents.robot.depositor import TAKEN
from vico.agents.robot.driving import Drive
from vico.agents.robot.sight import seen_at
from vico.agents.robot.team import heard_from, says_seen
from vico.agents.state import AgentState

# How near to the source it comes, metres: the other robot needs room there; a turn to look about, rad/s.
_AT_SOURCE, _TURN = 4.5, 0.7
# Seconds that one turn takes; who went on turning would wander off on a slope.
_ROUND = 9.5
# Seconds between two looks, and two sentences; until it goes after a person who may have gone.
_LOOKS_EVERY, _SAYS_EVERY, _GONE = 0.5, 6.0, 80.0


class Scout:
    """Looks for the thing from another place than the robot with the arm; with Carry, goes along with the person.

    Parameters
    ----------
    told
        What the task tells (`vico.challenges.robot.model.RobotTask.instruction`), and ``period``, seconds.
    caller
        Name of the robot with the arm.
    """

    def __init__(self, told: Mapping[str, Any], caller: str) -> None:
        self._told, self._caller = dict(told), caller
        self._period = float(told["period"])
        self._drive = Drive(period=self._period)
        self._began = self._taken = self._follows = False
        self._clock = self._looked = self._said = self._turned = 0.0

    @property
    def wants_picture(self) -> bool:
        """Whether it looks about the next time."""
        return self._lies_about and not self._taken and self._clock + self._period - self._looked >= _LOOKS_EVERY

    @property
    def _lies_about(self) -> bool:
        """Whether the thing lies about; else a person has it."""
        return bool(self._told["category"] == "deliver")

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the action for the coming period."""
        self._clock += self._period
        self._taken = self._taken or any(TAKEN in text for text in heard_from(observation, self._caller))
        if not self._lies_about:
            return self._go_along()
        if self._taken:
            return {"type": "stop"}
        said = self._look(observation, info)
        if said is not None:
            return said
        if not self._began:
            self._began = True
            self._drive.begin(np.array(self._told["source"]["centre"]), near=_AT_SOURCE, stops=True)
        if self._drive.busy:
            return self._drive.act(observation)
        self._turned += self._period
        if self._turned > _ROUND:
            return {"type": "stop"}
        return {"type": "control", "space": "velocity", "vector": [0.0, 0.0, _TURN]}

    def _go_along(self) -> Action:
        """Go with the person once the thing was taken up, or long after it should have been."""
        if self._follows:
            return {"type": "wait"}
        if not self._taken and self._clock < _GONE:
            return {"type": "stop"}
        self._follows = True
        return {"type": "follow", "agent": str(self._told["person"]["agent"])}

    def _look(self, observation: Observation, info: Info) -> Action | None:
        """Look for the thing twice a second; return what to say where it is in view."""
        if self._clock - self._looked < _LOOKS_EVERY or "depth" not in observation:
            return None
        self._looked = self._clock
        seen = seen_at(observation, info, str(self._told["object"]))
        if seen is None or (self._said and self._clock - self._said < _SAYS_EVERY):
            return None
        self._said = self._clock
        return {"type": "communicate", "text": says_seen(Stance.of(observation).outside(seen.low))}

    def state(self) -> AgentState:
        """Return all it remembers."""
        return {
            "drive": self._drive.state(),
            "flags": [self._began, self._taken, self._follows],
            "seconds": [self._clock, self._looked, self._said, self._turned],
        }

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self._drive.restore(state["drive"])
        self._began, self._taken, self._follows = (bool(flag) for flag in state["flags"])
        self._clock, self._looked, self._said, self._turned = (float(value) for value in state["seconds"])
