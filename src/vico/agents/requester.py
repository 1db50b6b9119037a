"""Residents who want help with carrying: from assistants, who are handed things, and from robots.

A `Requester` hands things over to a helper who speaks to it, and a `Depositor` puts a thing down before the robots that
call it. Both then walk home.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from vico.agents.base import Action, AgentState, Info, Observation, Plan
from vico.agents.schedule import Scheduled, ScheduleFollower
from vico.agents.talk.acquaintance import is_called
from vico.clock import DAY, clock_of
from vico.rules import WALK_SPEED, walk_speed
from vico.world.public import PublicMap

__all__ = [
    "ASSISTANT_PREFIX",
    "CALL_DISTANCE",
    "HAND_OVER_DISTANCE",
    "ROBOT_PREFIX",
    "TAKEN_TEXT",
    "WAITS_FOR",
    "Depositor",
    "Requester",
    "follower_going_home",
    "follower_going_to",
]
#: Names of those who may help begin so.
ASSISTANT_PREFIX = "assistant_"
#: A helper is heard within this distance, and is handed things within the second, metres.
CALL_DISTANCE, HAND_OVER_DISTANCE = 10.0, 1.4
#: So long one waits for a helper who spoke to come near, seconds.
WAITS_FOR = 60.0
#: Who is helped walks home briskly, metres a second; the old as much slower as they do else.
PACE_HOME = 1.4
# Home is to be reached by then, so that nobody runs; and a stay for ever after.
_BY = "23:59:00"
_THANKS = "Thank you. I am going home now: please follow me, and put it down there."
_COME_NEARER = "Here I am. Please come nearer, then I can hand it over."


@dataclass(frozen=True)
class _Item:
    """A stretch of the way there, as schedules have them."""

    type: str
    start: str
    end: str
    activity: str
    place: str | None
    tag: str | None = None
    mode: str | None = None


@dataclass(frozen=True)
class _Homegoer:
    """Somebody whose only plan is to go somewhere, as home, and stay there."""

    resident: Scheduled
    schedule: Sequence[_Item]

    def __getattr__(self, name: str) -> Any:
        return getattr(self.resident, name)


class ResidentWithHome(Scheduled, Protocol):
    """A resident with a home."""

    @property
    def home(self) -> str:
        """Id of the place."""


class Requester:
    """Lives its day with things in hand; when a helper speaks to it, it hands them over, thanks, and goes home.

    Who is spoken to by name within 10 m stops, and waits a minute for the helper to come within 1.4 m with a free hand.

    Parameters
    ----------
    day
        Follows its day.
    """

    def __init__(
        self, day: ScheduleFollower, resident: ResidentWithHome, public_map: PublicMap, *, seed: int = 0
    ) -> None:
        self._day = day
        self._resident = resident
        self._map = public_map
        self._seed = seed
        self._home: ScheduleFollower | None = None
        self._home_since = 0.0
        self._helper = ""
        self._waits_until = -math.inf
        self._said: str | None = None

    def plan(self, second: float) -> Plan | None:
        """Return where its day leads next."""
        return self._day.plan(second)

    def state(self) -> AgentState:
        """Return how far it came with handing over, and its day."""
        return {
            "day": self._day.state(),
            "home": None if self._home is None else self._home.state(),
            "home_since": self._home_since,
            "helper": self._helper,
            "waits_until": None if math.isinf(self._waits_until) else self._waits_until,
            "said": self._said,
        }

    def restore(self, state: AgentState) -> None:
        """Go on where `state` was returned."""
        self._day.restore(state["day"])
        self._home_since, self._helper, self._said = state["home_since"], state["helper"], state["said"]
        waits = state["waits_until"]
        self._waits_until = -math.inf if waits is None else waits
        self._home = None
        if state["home"] is not None:
            self._home = self._homeward(self._home_since)
            self._home.restore(state["home"])

    def act(self, observation: Observation, info: Info) -> Action:
        """Return the action for the coming second."""
        if self._home is not None:
            return self._home.act(observation, info)
        state = observation["state"]
        time = float(state["time"])
        if info.get("coming_out") or state["vehicle"]:
            return self._day.act(observation, info)
        self._listen(observation, time)
        if not any(state["held"]) and self._helper:
            self._home_since = time
            self._home = self._homeward(time)
            return {"type": "communicate", "text": _THANKS}
        if self._helper and time <= self._waits_until:
            return self._meet(observation, info)
        self._helper = ""
        return self._day.act(observation, info)

    def _listen(self, observation: Observation, time: float) -> None:
        """Wait for a helper near by who says one's first name: others may be near, too."""
        x, y = observation["pose"][:2]
        for message in observation["events"]:
            speaker = str(message["speaker"])
            away = math.hypot(message["position"][0] - x, message["position"][1] - y)
            called = is_called(self._resident.name, str(message["text"]))
            if speaker.startswith(ASSISTANT_PREFIX) and called and away <= CALL_DISTANCE:
                if self._helper != speaker:
                    self._said = _COME_NEARER
                self._helper, self._waits_until = speaker, time + WAITS_FOR

    def _meet(self, observation: Observation, info: Info) -> Action:
        """Stand up, answer, and hand things over once the helper is near."""
        state = observation["state"]
        if state["posture"] != "standing":
            return {"type": "wake" if state["posture"] == "lying" else "stand"}
        if self._said is not None:
            said, self._said = self._said, None
            return {"type": "communicate", "text": said}
        seen = next((body for body in info["in_view"].within(CALL_DISTANCE) if body.agent == self._helper), None)
        if seen is not None and seen.distance <= HAND_OVER_DISTANCE:
            hand = 0 if state["held"][0] else 1
            return {"type": "hand_over", "hand": hand, "agent": self._helper}
        return (
            {"type": "wait"}
            if seen is None
            else {"type": "look_at", "target": [*seen.position[:2], seen.position[2] + 1.5]}
        )

    def _homeward(self, time: float) -> ScheduleFollower:
        return follower_going_home(self._resident, self._map, time=time, pace=PACE_HOME, seed=self._seed)


def follower_going_home(
    resident: ResidentWithHome, public_map: PublicMap, *, time: float, pace: float, seed: int
) -> ScheduleFollower:
    """Return who goes home from wherever they are, and stays there.

    Parameters
    ----------
    time
        Now, seconds since the first midnight.
    pace
        Of a grown-up, metres a second; the old are as much slower as they are else.
    """
    # Who comes home sits down, and leaves the hall to others.
    rest = _Item("meal", _BY, "23:59:59", "have a rest at home", resident.home, tag="meal_home")
    return _follower_with_plan(rest, "walk home", resident, public_map, time=time, pace=pace, seed=seed)


def follower_going_to(
    place: str, resident: Scheduled, public_map: PublicMap, *, time: float, pace: float, seed: int
) -> ScheduleFollower:
    """Return somebody who goes to a place, by its id, and waits in there; else as `follower_going_home`."""
    visit = _Item("main", _BY, "23:59:59", "see to something", place)
    return _follower_with_plan(visit, "walk there", resident, public_map, time=time, pace=pace, seed=seed)


def _follower_with_plan(
    stay: _Item, walk: str, resident: Scheduled, public_map: PublicMap, *, time: float, pace: float, seed: int
) -> ScheduleFollower:
    now = clock_of(int(time % DAY))
    own = pace * walk_speed(resident.age) / WALK_SPEED
    plan = (_Item("commute", now, _BY, walk, None), stay)
    return ScheduleFollower(_Homegoer(resident, plan), public_map, seed=seed, paces=(own, own))


#: Names of robots begin so.
ROBOT_PREFIX = "robot_"
#: What a robot says that has taken the thing up: nobody waits any longer.
TAKEN_TEXT = "I have it."
# Nearer than this robots are seen, and what is said is heard, metres.
_CALL_RANGE = CALL_DISTANCE
# Degrees that one turns who has no room ahead to put something down.
_TURN_ASIDE = 50.0
_PUT_DOWN = "Here it is. I wait until you have it, then I walk home; please come along, and put it down there."


class Depositor:
    """Stands and waits with something in hand until a robot near by calls them by name; puts it down; goes home.

    Parameters
    ----------
    pace
        Of walking home, metres a second.
    waits
        Beside what was put down, unless a robot says that it has it, seconds.
    """

    def __init__(
        self, resident: ResidentWithHome, public_map: PublicMap, *, pace: float, waits: float, seed: int = 0
    ) -> None:
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
        heard = self._robot_messages(observation)
        self._called = self._called or any(is_called(self._resident.name, text) for text in heard)
        if any(state["held"]):
            return self._put(state) if self._called else {"type": "wait"}
        if not self._said:
            self._said, self._put_at = True, time
            return {"type": "communicate", "text": _PUT_DOWN}
        if time - self._put_at > self._waits or any(TAKEN_TEXT in text for text in heard):
            self._home_since = time
            self._home = self._homeward(time)
        return {"type": "wait"}

    def _put(self, state: Mapping[str, Any]) -> Action:
        """Put it down ahead, or turn where there is no room."""
        self._tries = not (self._tries and state["action_status"] == "refused")
        if not self._tries:
            return {"type": "turn_left", "degrees": _TURN_ASIDE}
        return {"type": "put", "hand": 0 if state["held"][0] else 1}

    def _robot_messages(self, observation: Observation) -> list[str]:
        """Return what robots near by have said."""
        x, y = observation["pose"][:2]
        return [
            str(message["text"])
            for message in observation["events"]
            if str(message["speaker"]).startswith(ROBOT_PREFIX)
            and math.hypot(message["position"][0] - x, message["position"][1] - y) <= _CALL_RANGE
        ]

    def _homeward(self, time: float) -> ScheduleFollower:
        return follower_going_home(self._resident, self._map, time=time, pace=self._pace, seed=self._seed)

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
