"""A resident who wants help with carrying: hands things over to a helper who speaks to them, then walks home."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from vico.agents.base import Action, Info, Observation, Plan
from vico.agents.schedule import Scheduled, ScheduleFollower
from vico.agents.state import AgentState
from vico.agents.talk.address import is_called
from vico.clock import DAY, clock_of
from vico.rules import WALK_SPEED, walk_speed
from vico.world.public import PublicMap

#: Names of those who may help begin so.
HELPERS = "assistant_"
#: A helper is heard within this distance, and is handed things within the second, metres.
CALL_DISTANCE, HAND_OVER_DISTANCE = 10.0, 1.4
#: So long one waits for a helper who spoke to come near, seconds.
WAITS_FOR = 60.0
#: Who is helped walks home briskly, metres a second; the old as much slower as they do else.
PACE_HOME = 1.4
# Home is to be reached by then, so that nobody runs; and a stay for ever after.
_BY = "23:59:00"
_THANKS = "Thank you. I am going home now: please follow me, and put it down there."
_HERE = "Here I am. Please come nearer, then I can hand it over."


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
class _WayHome:
    """Somebody whose only plan is to go somewhere, as home, and stay there."""

    resident: Scheduled
    schedule: Sequence[_Item]

    def __getattr__(self, name: str) -> Any:
        return getattr(self.resident, name)


class Dweller(Scheduled, Protocol):
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

    def __init__(self, day: ScheduleFollower, resident: Dweller, public_map: PublicMap, *, seed: int = 0) -> None:
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
            if speaker.startswith(HELPERS) and called and away <= CALL_DISTANCE:
                if self._helper != speaker:
                    self._said = _HERE
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
        return way_home(self._resident, self._map, time=time, pace=PACE_HOME, seed=self._seed)


def way_home(resident: Dweller, public_map: PublicMap, *, time: float, pace: float, seed: int) -> ScheduleFollower:
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
    return _way_to(rest, "walk home", resident, public_map, time=time, pace=pace, seed=seed)


def way_to(
    place: str, resident: Scheduled, public_map: PublicMap, *, time: float, pace: float, seed: int
) -> ScheduleFollower:
    """Return who goes to a place, by its id, from wherever they are, and waits in there; else as `way_home`."""
    visit = _Item("main", _BY, "23:59:59", "see to something", place)
    return _way_to(visit, "walk there", resident, public_map, time=time, pace=pace, seed=seed)


def _way_to(
    stay: _Item, walk: str, resident: Scheduled, public_map: PublicMap, *, time: float, pace: float, seed: int
) -> ScheduleFollower:
    now = clock_of(int(time % DAY))
    own = pace * walk_speed(resident.age) / WALK_SPEED
    plan = (_Item("commute", now, _BY, walk, None), stay)
    return ScheduleFollower(_WayHome(resident, plan), public_map, seed=seed, paces=(own, own))


__all__ = [
    "CALL_DISTANCE",
    "HAND_OVER_DISTANCE",
    "HELPERS",
    "WAITS_FOR",
    "Requester",
    "way_home",
    "way_to",
]
