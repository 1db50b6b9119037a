"""A person who wants robots to carry something home: puts it down before them when they call, then walks home."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from vico.agents.base import Action, Info, Observation
from vico.agents.requester import CALL_DISTANCE, Dweller, way_home
from vico.agents.schedule import ScheduleFollower
from vico.agents.state import AgentState
from vico.agents.talk.address import is_called
from vico.world.public import PublicMap

#: Names of those who may help begin so.
HELPERS = "robot_"
#: What a robot says that has taken the thing up: nobody waits any longer.
TAKEN = "I have it."
# Nearer than this robots are seen, and what is said is heard, metres.
_NEAR = CALL_DISTANCE
# Degrees that one turns who has no room ahead to put something down.
_ASIDE = 50.0
_HERE = "Here it is. I wait until you have it, then I walk home; please come along, and put it down there."


class Depositor:
    """Stands and waits with something in hand until a robot near by calls them by name; puts it down; goes home.

    Parameters
    ----------
    pace
        Of walking home, metres a second.
    waits
        Beside what was put down, unless a robot says that it has it, seconds.
    """

    def __init__(self, resident: Dweller, public_map: PublicMap, *, pace: float, waits: float, seed: int = 0) -> None:
        self._resident, self._map, self._pace, self._waits, self._seed = resident, public_map, pace, waits, seed
        self._called = self._said = self._tries = False
        self._put_at = math.inf
        self._home: ScheduleFollower | None = None
        self._home_since = 0.0

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the action for the coming second."""
        if self._home is not None:
            return self._home.act(observation, info)
        state = observation["state"]
        time = float(state["time"])
        heard = self._heard(observation)
        self._called = self._called or any(is_called(self._resident.name, text) for text in heard)
        if any(state["held"]):
            return self._put(state) if self._called else {"type": "wait"}
        if not self._said:
            self._said, self._put_at = True, time
            return {"type": "communicate", "text": _HERE}
        if time - self._put_at > self._waits or any(TAKEN in text for text in heard):
            self._home_since = time
            self._home = self._homeward(time)
        return {"type": "wait"}

    def _put(self, state: Mapping[str, Any]) -> Action:
        """Put it down ahead, or turn where there is no room."""
        self._tries = not (self._tries and state["action_status"] == "refused")
        if not self._tries:
            return {"type": "turn_left", "degrees": _ASIDE}
        return {"type": "put", "hand": 0 if state["held"][0] else 1}

    def _heard(self, observation: Observation) -> list[str]:
        """Return what robots near by have said."""
        x, y = observation["pose"][:2]
        return [
            str(message["text"])
            for message in observation["events"]
            if str(message["speaker"]).startswith(HELPERS)
            and math.hypot(message["position"][0] - x, message["position"][1] - y) <= _NEAR
        ]

    def _homeward(self, time: float) -> ScheduleFollower:
        return way_home(self._resident, self._map, time=time, pace=self._pace, seed=self._seed)

    def state(self) -> AgentState:
        """Return how far it came."""
        return {
            "called": self._called,
            "said": self._said,
            "tries": self._tries,
            "put_at": None if math.isinf(self._put_at) else self._put_at,
            "home": None if self._home is None else self._home.state(),
            "home_since": self._home_since,
        }

    def restore(self, state: AgentState) -> None:
        """Go on where `state` was returned."""
        self._called, self._said, self._tries = (bool(state[name]) for name in ("called", "said", "tries"))
        self._put_at = math.inf if state["put_at"] is None else float(state["put_at"])
        self._home_since, self._home = float(state["home_since"]), None
        if state["home"] is not None:
            self._home = self._homeward(self._home_since)
            self._home.restore(state["home"])
