"""Getting to a free seat or bed: through rooms, along benches, and giving up for a while where none is to be had."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal

from vico.agents.base import Action, Info, Observation
from vico.agents.state import AgentState

Rest = Literal["sit", "lie"]
#: Return the next action on the way to a point, None within some metres of it: the point, those metres, and what is
#: observed.
Walk = Callable[[tuple[float, float, float], float, Observation, Info], Action | None]

# Who has not got to a seat after so long, or finds none, tries again after so many seconds.
_PATIENCE, _AGAIN = 150.0, 300.0
_REFUSALS = 3
# Who was not asked for so long begins anew.
_FORGOTTEN = 30.0
_BEFORE_SEAT, _AT_DOOR = 0.3, 0.9
_VERBS = {"sit": "sit", "lie": "sleep"}


class SeatSeeker:
    """Finds its way to a free seat or bed and takes it, by what ``info["rest"]`` tells.

    Parameters
    ----------
    walk
        Gets on within a room, or outdoors.
    """

    def __init__(self, walk: Walk) -> None:
        self._walk = walk
        self._since = self._last = -math.inf
        self._not_before = {"sit": -math.inf, "lie": -math.inf}
        # Whether the last action was to sit or lie down, or to go through a door.
        self._asked = False
        self._refusals = 0

    def state(self) -> AgentState:
        """Return all it remembers."""
        times = [self._since, self._last, self._not_before["sit"], self._not_before["lie"]]
        return {
            "times": [None if math.isinf(time) else time for time in times],
            "asked": self._asked,
            "refusals": self._refusals,
        }

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        times = [-math.inf if time is None else float(time) for time in state["times"]]
        self._since, self._last, self._not_before["sit"], self._not_before["lie"] = times
        self._asked, self._refusals = bool(state["asked"]), int(state["refusals"])

    def again(self, rest: Rest) -> float:
        """Return when it is worth asking for such a rest again, seconds."""
        return self._not_before[rest]

    def towards(self, rest: Rest, observation: Observation, info: Info) -> Action | None:
        """Return the next action on the way to a free seat or bed; None where none is to be had for now."""
        state = observation["state"]
        time: float = state["time"]
        if time < self._not_before[rest]:
            return None
        asked, self._asked = self._asked, False
        found = info.get("rest", {}).get(rest)
        if time - self._last > _FORGOTTEN:
            self._since, asked, self._refusals = time, False, 0
        self._last = time
        # Somebody was quicker: there may be another one.
        if asked and state["action_status"] == "refused":
            self._refusals += 1
        if found is None or self._refusals > _REFUSALS or time - self._since > _PATIENCE:
            self._not_before[rest], self._last = time + _AGAIN, -math.inf
            return None
        if state["posture"] != "standing":
            return {"type": "stand"}
        x, y, z = found["stand"]
        step = self._walk((x, y, z), _AT_DOOR if found["door"] else _BEFORE_SEAT, observation, info)
        if step is not None:
            return step
        self._asked = True
        if found["door"]:
            return {"type": "enter", "place": found["door"]}
        return {"type": _VERBS[rest], "target": found["entity"]}
