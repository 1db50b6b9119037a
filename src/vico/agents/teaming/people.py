"""People whom robots help: a visitor who is accompanied to a door, and a newcomer who does not know the way.

A `Visitor` waits until a robot calls, walks to a door, goes in, and maybe comes out again. A `Newcomer` follows a robot
while it is near and in sight, and stops now and then.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from vico.agents.base import Action, AgentState, Info, Observation, generator_state, restore_generator
from vico.agents.requester import ResidentWithHome, follower_going_home, follower_going_to
from vico.agents.schedule import ScheduleFollower
from vico.agents.teaming.team_skills import caller_of
from vico.agents.wayfinding import Walker
from vico.rules import WALK_SPEED, walk_speed
from vico.seeds import rng
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
        self,
        resident: ResidentWithHome,
        public_map: PublicMap,
        *,
        place: str,
        pace: float,
        stay: float | None,
        seed: int = 0,
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
            return follower_going_home(self._resident, self._map, time=time, pace=self._pace, seed=self._seed)
        return follower_going_to(self._place, self._resident, self._map, time=time, pace=self._pace, seed=self._seed)

    def state(self) -> AgentState:
        """Return how far they came."""
        return {
            "way": None if self._way is None else self._way.state(),
            "since": [_finite_or_none(self._way_since), _finite_or_none(self._inside_since)],
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


def _finite_or_none(time: float) -> float | None:
    return None if math.isinf(time) else time


#: What they say that set out, that fall behind, and that give up.
I_FOLLOW = "I follow you."
WAIT_FOR_ME = "Please wait for me."
GAVE_UP = "I have lost you, I give up."
_KEEPS_DISTANCE = 1.8  # metres kept behind the robot
_CALLS_EVERY = 6.0  # seconds between two calls
_LOOK_AFTER = 2.0  # seconds until one turns to look elsewhere


class Newcomer:
    """Waits until a robot near by calls them by name, and follows it.

    Parameters
    ----------
    pace
        Of walking, metres a second; the old are as much slower as they are else.
    pauses
        Stops on the way: after so many metres of walking, for so many seconds.
    within
        A robot that is farther off is not followed, metres: they stand and call.
    gives_up
        Seconds without a robot in sight after which they do not go on.
    """

    def __init__(
        self,
        resident: ResidentWithHome,
        public_map: PublicMap,
        *,
        pace: float,
        pauses: Sequence[tuple[float, float]],
        within: float,
        gives_up: float,
        seed: int = 0,
    ) -> None:
        self._resident, self._within, self._gives_up = resident, within, gives_up
        self._pace = pace * walk_speed(resident.age) / WALK_SPEED
        self._pauses = [(float(after), float(seconds)) for after, seconds in pauses]
        self._rng = rng(seed, "newcomer", resident.id)
        self._walker = Walker(public_map, self._rng)
        self._guide = ""
        self._walked, self._last = 0.0, (0.0, 0.0)
        self._stands_until = self._called_at = -math.inf
        self._seen_at, self._looks_at = 0.0, (0.0, 0.0, 0.0)
        self._gone = False

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the action for the coming second."""
        time = float(observation["state"]["time"])
        x, y = observation["pose"][:2].tolist()
        if not self._guide:
            self._guide = caller_of(observation, self._resident.name)
            self._seen_at, self._last, self._looks_at = time, (x, y), (x, y, 0.0)
            return {"type": "communicate", "text": I_FOLLOW} if self._guide else {"type": "wait"}
        self._walked += math.dist((x, y), self._last)
        self._last = (x, y)
        if self._gone or time < self._stands_until:
            return {"type": "wait"}
        if self._pauses and self._walked >= self._pauses[0][0]:
            self._stands_until = time + self._pauses.pop(0)[1]
            return {"type": "wait"}
        seen = next((body for body in info["in_view"].within(40.0) if body.agent == self._guide), None)
        if seen is None:
            return self._look_about(time)
        self._seen_at, self._looks_at = time, seen.position
        if seen.distance > self._within:
            return self._call(time)
        step = None
        if seen.distance > _KEEPS_DISTANCE:
            step = self._walker.towards((seen.position[0], seen.position[1]), self._pace, observation, info)
        return step or {"type": "look_at", "target": [*seen.position[:2], seen.position[2] + 0.3]}

    def _call(self, time: float) -> Action:
        """Stand and call whoever is too far ahead, and look after them in between."""
        if time - self._called_at >= _CALLS_EVERY:
            self._called_at = time
            return {"type": "communicate", "text": WAIT_FOR_ME}
        return {"type": "look_at", "target": list(self._looks_at)}

    def _look_about(self, time: float) -> Action:
        """Look where the robot was last, then all round; call; give up in the end."""
        gone = time - self._seen_at
        self._walker.stop()
        if gone >= self._gives_up:
            self._gone = True
            return {"type": "communicate", "text": GAVE_UP}
        if gone > _LOOK_AFTER and time - self._called_at >= _CALLS_EVERY:
            self._called_at = time
            return {"type": "communicate", "text": WAIT_FOR_ME}
        if gone <= _LOOK_AFTER:
            return {"type": "look_at", "target": list(self._looks_at)}
        return {"type": "turn_left", "degrees": 60.0}

    def state(self) -> AgentState:
        """Return all they remember."""
        return {
            "generator": generator_state(self._rng),
            "walker": self._walker.state(),
            "guide": self._guide,
            "pauses": [list(pause) for pause in self._pauses],
            "walked": self._walked,
            "last": list(self._last),
            "times": [None if math.isinf(t) else t for t in (self._stands_until, self._called_at, self._seen_at)],
            "looks_at": list(self._looks_at),
            "gone": self._gone,
        }

    def restore(self, state: AgentState) -> None:
        """Go on where `state` was returned."""
        restore_generator(self._rng, state["generator"])
        self._walker.restore(state["walker"])
        self._guide, self._walked, self._gone = str(state["guide"]), float(state["walked"]), bool(state["gone"])
        self._pauses = [(float(after), float(seconds)) for after, seconds in state["pauses"]]
        times = (-math.inf if t is None else float(t) for t in state["times"])
        self._stands_until, self._called_at, self._seen_at = times
        (x, y), (a, b, c) = state["last"], state["looks_at"]
        self._last, self._looks_at = (float(x), float(y)), (float(a), float(b), float(c))
