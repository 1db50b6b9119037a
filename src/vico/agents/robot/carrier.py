"""The carrier: comes where it is called to, and tells where it stands."""

from __future__ import annotations

import numpy as np

from vico.agents.base import Action, Info, Observation
from vico.agents.robot.body import Stance
from vico.agents.robot.driving import Drive
from vico.agents.robot.team import heard_from, says_where, told_come
from vico.agents.state import AgentState

# Seconds between two sentences while it stands; near enough to where it was called to, metres.
_TELLS_EVERY, _NEAR = 2.0, 1.0


class Carrier:
    """Drives to where the other robot calls it, stands, and says where that is.

    Parameters
    ----------
    caller
        Name of the robot with the arm.
    period
        Seconds between two actions.
    """

    def __init__(self, caller: str, *, period: float) -> None:
        self._caller, self._period = caller, period
        self._drive = Drive(period=period)
        self._called = False
        self._told = 0.0

    @property
    def wants_picture(self) -> bool:
        """Whether it looks at its pictures: never."""
        return False

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the action for the coming period."""
        self._told += self._period
        for text in heard_from(observation, self._caller):
            goal = told_come(text)
            if goal is not None:
                self._called = True
                self._drive.begin(np.array(goal), near=_NEAR)
        if self._drive.busy:
            return self._drive.act(observation)
        if self._called and self._told > _TELLS_EVERY:
            self._told = 0.0
            return {"type": "communicate", "text": says_where(Stance.of(observation))}
        return {"type": "wait"}

    def state(self) -> AgentState:
        """Return all it remembers."""
        return {"drive": self._drive.state(), "called": self._called, "told": self._told}

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self._drive.restore(state["drive"])
        self._called, self._told = bool(state["called"]), float(state["told"])
