"""A person who is accompanied: waits until a robot calls, walks to a door, goes in, and maybe comes out again."""

from __future__ import annotations

import math

from vico.agents.base import Action, Info, Observation
from vico.agents.requester import Dweller, way_home, way_to
from vico.agents.schedule import ScheduleFollower
from vico.agents.state import AgentState
from vico.agents.teaming.words import caller_of
from vico.world.public import PublicMap

#: What they say that set out, and that have come out again.
LETS_GO = "Thank you for coming. Let us go."
THANKS = "Thank you for waiting."


class Visitor:
    """Stands and waits until a robot near by calls them by name, and walks to a place without looking round.

    Parameters
    ----------
    place
        Its id.
    pace
        Of walking, metres a second.
    stay
        Seconds until they come out and go home; None: they stay.
    """

    def __init__(
        self, resident: Dweller, public_map: PublicMap, *, place: str, pace: float, stay: float | None, seed: int = 0
    ) -> None:
        self._resident, self._map, self._seed = resident, public_map, seed
        self._place, self._pace, self._stays = place, pace, stay
        self._way: ScheduleFollower | None = None
        self._way_since = self._inside_since = math.inf
        self._returns = self._thanked = False

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the action for the coming second."""
        state = observation["state"]
        time = float(state["time"])
        if self._way is None:
            if not caller_of(observation, self._resident.name):
                return {"type": "wait"}
            self._set_out(time)
            return {"type": "communicate", "text": LETS_GO}
        if state["place"] == self._place and not self._returns:
            self._inside_since = min(self._inside_since, time)
            if self._stays is not None and time - self._inside_since >= self._stays:
                self._returns = True
                self._set_out(time)
        elif self._returns and not self._thanked and not state["room"] and not info.get("coming_out"):
            self._thanked = True
            return {"type": "communicate", "text": THANKS}
        return self._way.act(observation, info)

    def _set_out(self, time: float) -> None:
        self._way_since, self._way = time, self._new_way(time)

    def _new_way(self, time: float) -> ScheduleFollower:
        if self._returns:
            return way_home(self._resident, self._map, time=time, pace=self._pace, seed=self._seed)
        return way_to(self._place, self._resident, self._map, time=time, pace=self._pace, seed=self._seed)

    def state(self) -> AgentState:
        """Return how far they came."""
        return {
            "way": None if self._way is None else self._way.state(),
            "since": [_known(self._way_since), _known(self._inside_since)],
            "returns": self._returns,
            "thanked": self._thanked,
        }

    def restore(self, state: AgentState) -> None:
        """Go on where `state` was returned."""
        self._way_since, self._inside_since = (math.inf if value is None else float(value) for value in state["since"])
        self._returns, self._thanked, self._way = bool(state["returns"]), bool(state["thanked"]), None
        if state["way"] is not None:
            self._way = self._new_way(self._way_since)
            self._way.restore(state["way"])


def _known(time: float) -> float | None:
    return None if math.isinf(time) else time
