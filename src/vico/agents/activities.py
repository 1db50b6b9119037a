"""Activities of residents at a place: queue and buy at a till, serve customers behind it, take a seat or a bed.

`Buyer` stands in line by what ``info["till"]`` tells, moves up, and is done once served. `Clerk` stands behind the till
of the room it works in, where ``info["counter"]`` says. `SeatSeeker` goes to a free seat or bed through rooms and along
benches, and gives up for a while where none is to be had.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal

from vico.agents.base import Action, AgentState, FieldState, Info, Observation, heading
from vico.geometry import wrap_angle

RestPosture = Literal["sit", "lie"]
#: Return the next action on the way to a point, None within some metres of it: the point, those metres, and what is
#: observed.
WalkAction = Callable[[tuple[float, float, float], float, Observation, Info], Action | None]

# Who has not got to a seat after so long, or finds none, tries again after so many seconds.
_SEAT_PATIENCE, _SEAT_RETRY = 150.0, 300.0
_SEAT_REFUSALS = 3
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

    def __init__(self, walk: WalkAction) -> None:
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

    def again(self, rest: RestPosture) -> float:
        """Return when it is worth asking for such a rest again, seconds."""
        return self._not_before[rest]

    def towards(self, rest: RestPosture, observation: Observation, info: Info) -> Action | None:
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
        if found is None or self._refusals > _SEAT_REFUSALS or time - self._since > _SEAT_PATIENCE:
            self._not_before[rest], self._last = time + _SEAT_RETRY, -math.inf
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


# Who has not been served after so many seconds goes without.
_TILL_PATIENCE = 400.0
_QUEUE_TOLERANCE = 0.35  # metres from one's spot in line


class Buyer(FieldState):
    """Buys once for each errand.

    Parameters
    ----------
    walk
        Gets on within a room.
    """

    _errand: str = ""
    _since: float = -math.inf
    _waits: bool = False
    _asked: bool = False
    _done: bool = False

    def __init__(self, walk: WalkAction) -> None:
        self._walk = walk

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
        if till is None or served or refused or time - self._since > _TILL_PATIENCE:
            self._done = True
            return None
        self._waits, self._asked = bool(till["waits"]), False
        step = self._walk(till["stand"], _QUEUE_TOLERANCE, observation, info)
        if step is not None:
            return step
        self._asked = not self._waits
        return {"type": "wait" if self._waits else "queue"}


# Who has not got behind a till after so many seconds leaves it.
_COUNTER_PATIENCE = 150.0
_AT_POST, _ALIGNED = 0.2, math.radians(8.0)


class Clerk(FieldState):
    """Takes its place behind a till once for each shift, and looks over it.

    Parameters
    ----------
    walk
        Gets on within a room.
    """

    _shift: str = ""
    _since: float = -math.inf
    serves: bool = False  # whether it stands where it serves

    def __init__(self, walk: WalkAction) -> None:
        self._walk = walk

    def towards(self, shift: str, observation: Observation, info: Info) -> Action | None:
        """Return the next action of a shift, a name of it; None where there is no free till, or no way to it."""
        time: float = observation["state"]["time"]
        if shift != self._shift:
            self._shift, self._since, self.serves = shift, time, False
        counter = info.get("counter")
        if counter is None or (not self.serves and time - self._since > _COUNTER_PATIENCE):
            self.serves = False
            return None
        x, y, z, yaw = counter
        step = self._walk((x, y, z), _AT_POST, observation, info)
        if step is not None:
            self.serves = False
            return step
        self.serves = True
        turn = wrap_angle(yaw - heading(observation))
        if abs(turn) > _ALIGNED:
            return {"type": "turn_left" if turn > 0 else "turn_right", "degrees": abs(math.degrees(turn))}
        return {"type": "wait"}
