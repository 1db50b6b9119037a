"""Serving customers: standing behind the till of the room one works in, where ``info["counter"]`` says."""

from __future__ import annotations

import math

from vico.agents.base import Action, Info, Observation, heading, wrapped
from vico.agents.resting import Walk
from vico.agents.state import AgentState

# Who has not got behind a till after so many seconds leaves it.
_PATIENCE = 150.0
_AT_POST, _ALIGNED = 0.2, math.radians(8.0)


class Clerk:
    """Takes its place behind a till once for each shift, and looks over it.

    Parameters
    ----------
    walk
        Gets on within a room.
    """

    def __init__(self, walk: Walk) -> None:
        self._walk = walk
        self._shift, self._since = "", -math.inf
        #: Whether it stands where it serves.
        self.serves = False

    def state(self) -> AgentState:
        """Return all it remembers."""
        return {"shift": self._shift, "since": None if math.isinf(self._since) else self._since, "serves": self.serves}

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self._shift, self.serves = str(state["shift"]), bool(state["serves"])
        self._since = -math.inf if state["since"] is None else float(state["since"])

    def towards(self, shift: str, observation: Observation, info: Info) -> Action | None:
        """Return the next action of a shift, a name of it; None where there is no free till, or no way to it."""
        time: float = observation["state"]["time"]
        if shift != self._shift:
            self._shift, self._since, self.serves = shift, time, False
        counter = info.get("counter")
        if counter is None or (not self.serves and time - self._since > _PATIENCE):
            self.serves = False
            return None
        x, y, z, yaw = counter
        step = self._walk((x, y, z), _AT_POST, observation, info)
        if step is not None:
            self.serves = False
            return step
        self.serves = True
        turn = wrapped(yaw - heading(observation))
        if abs(turn) > _ALIGNED:
            return {"type": "turn_left" if turn > 0 else "turn_right", "degrees": abs(math.degrees(turn))}
        return {"type": "wait"}
