"""Buying at a till: standing in line by what ``info["till"]`` tells, moving up, and being done once served."""

from __future__ import annotations

import math

from vico.agents.base import Action, Info, Observation
from vico.agents.resting import Walk
from vico.agents.state import AgentState

# Who has not been served after so many seconds goes without.
_PATIENCE = 400.0
_BEHIND = 0.35  # metres from one's spot in line


class Buyer:
    """Buys once for each errand.

    Parameters
    ----------
    walk
        Gets on within a room.
    """

    def __init__(self, walk: Walk) -> None:
        self._walk = walk
        self._errand, self._since = "", -math.inf
        self._waits = self._asked = self._done = False

    def state(self) -> AgentState:
        """Return all it remembers."""
        since = None if math.isinf(self._since) else self._since
        flags = {"waits": self._waits, "asked": self._asked, "done": self._done}
        return {"errand": self._errand, "since": since} | flags

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self._errand = str(state["errand"])
        self._since = -math.inf if state["since"] is None else float(state["since"])
        self._waits, self._asked, self._done = (bool(state[name]) for name in ("waits", "asked", "done"))

    def towards(self, errand: str, observation: Observation, info: Info) -> Action | None:
        """Return the next action of buying for an errand, a name of it; None once that is done or can't be."""
        state = observation["state"]
        time: float = state["time"]
        if errand != self._errand:
            self._errand, self._since = errand, time
            self._waits = self._asked = self._done = False
        if self._done:
            return None
        till = info.get("till")
        refused = self._asked and state["action_status"] == "refused"
        served = self._waits and (till is None or not till["waits"])
        if till is None or served or refused or time - self._since > _PATIENCE:
            self._done = True
            return None
        self._waits, self._asked = bool(till["waits"]), False
        step = self._walk(till["stand"], _BEHIND, observation, info)
        if step is not None:
            return step
        self._asked = not self._waits
        return {"type": "wait" if self._waits else "queue"}
