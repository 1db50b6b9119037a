"""What the challenge lets an agent do: it asks the agent on its way alone, and refuses what is not legal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Any

from vico.agents.base import Action, Agent, AgentState, Info, Observation
from vico.challenges.commute.rules import LEGAL, MOST_ON_BIKE, MOST_ON_FOOT
from vico.rules import ReasonCode, code_name

_TINY = 1e-6


def refusal(action: object, vehicle: str) -> tuple[str, str] | None:
    """Return code and reason why an action is not legal; None if it is, or if it has no form to be judged by.

    Parameters
    ----------
    action
        What the agent answered. What is no action at all is left to the simulation, which refuses and counts it.
    vehicle
        What the agent rides, as observations have it.
    """
    if not isinstance(action, Mapping) or not isinstance(kind := action.get("type"), str):
        return None
    if kind not in LEGAL:
        return code_name(ReasonCode.NOT_ABLE), f"{kind}: not legal on a commute; legal are {', '.join(LEGAL)}"
    distance = action.get("distance")
    most = MOST_ON_BIKE if vehicle == "bike" else MOST_ON_FOOT
    if kind == "move_forward" and isinstance(distance, (int, float)) and distance > most + _TINY:
        return code_name(ReasonCode.OUT_OF_RANGE), f"move_forward: {distance:g} m; {most:g} m a step are legal"
    return None


class LegalAgent:
    """Passes an agent's legal actions on; one that is not becomes a wait, is counted, and the agent is told.

    Parameters
    ----------
    inner
        The agent under test.
    commutes
        What the agent is told as ``info["commute"]``: the appointment it is on its way to. Looked up at every step.

    Attributes
    ----------
    refused
        How often each type of action was refused.
    """

    def __init__(self, inner: Agent, commutes: CommuteInfo) -> None:
        self.inner = inner
        self.refused: Counter[str] = Counter()
        self._commutes = commutes
        self._last: tuple[str, str] | None = None

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the agent's action, or a wait."""
        if self._last is not None:
            code, reason = self._last
            said = {"action_status": "refused", "action_code": code, "action_reason": reason}
            observation = {**observation, "state": {**observation["state"], **said}}
        action = self.inner.act(observation, {**info, "commute": self._commutes.current()})
        self._last = refusal(action, observation["state"]["vehicle"])
        if self._last is None:
            return action
        self.refused[str(action["type"])[:40]] += 1
        return {"type": "wait"}

    def state(self) -> AgentState:
        """Return what the agent remembers, and what was refused last."""
        return {"inner": self.inner.state(), "last": self._last, "refused": dict(self.refused)}

    def restore(self, state: AgentState) -> None:
        """Go on from what `state` returned."""
        self.inner.restore(state["inner"])
        self._last = None if state["last"] is None else (state["last"][0], state["last"][1])
        self.refused = Counter(state["refused"])


class CommuteInfo:
    """The appointment an agent is on its way to, as plain data."""

    def __init__(self, instructions: list[dict[str, Any]]) -> None:
        self._told = instructions[0]["appointments"]
        #: Number of the appointment.
        self.index = 1

    def current(self) -> dict[str, Any]:
        """Return number, place, position, start and end of the appointment, and whether it is the day's last."""
        last = self.index == len(self._told) - 1
        return {"index": self.index, "last": last, **self._told[self.index]}
