"""What residents remember of a day: whom they saw, where they were, and what they heard. All of it is bounded.

Looking about is remembered every ten seconds by the clock, so that it does not matter who is asked when.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vico.agents.base import Info, Observation
from vico.agents.state import AgentState

#: Seconds between two times that one takes note of who is about, and the distance up to which one knows them, metres.
EVERY, RECOGNISED = 10.0, 20.0
#: Most people, messages and visits that are remembered; what is oldest is forgotten first.
MOST_PEOPLE, MOST_MESSAGES, MOST_VISITS = 64, 32, 48
# So much of a message is remembered, characters.
_MOST_TEXT = 300
_PEOPLE = ("resident", "assistant")


@dataclass(frozen=True)
class SeenPerson:
    """When and where somebody was seen last.

    Attributes
    ----------
    time
        Seconds since midnight of the first day.
    x, y
        ENU metres.
    place
        Id of the place both were in; empty outdoors.
    """

    agent: str
    time: float
    x: float
    y: float
    place: str


@dataclass(frozen=True)
class HeardMessage:
    """Something that was said to one, or near one."""

    time: float
    speaker: str
    text: str


@dataclass(frozen=True)
class Visit:
    """A time at a place.

    Attributes
    ----------
    stay
        Which stay of the day it was for, by number.
    since, until
        Seconds since midnight of the first day; None while it lasts.
    """

    stay: int
    place: str
    since: float
    until: float | None = None


def _nothing() -> None:
    """Have nothing to tell."""


def tick_of(time: float) -> int:
    """Return the number of the ten seconds that a time lies in."""
    return int(time // EVERY)


class ResidentMemory:
    """What one resident remembers.

    Parameters
    ----------
    places
        Ids of the map's places, in its order.
    """

    def __init__(self, places: Sequence[str] = ()) -> None:
        self.places = places
        #: In which ten seconds one looked about last.
        self.tick = -1
        #: Tells whom one saw as one of a group, before it is asked for; see `vico.agents.talk.crowd_memory`.
        self.settle: Callable[[], None] = _nothing
        # By agent, the one seen longest ago first.
        self._people: dict[str, tuple[float, float, float, str]] = {}
        self._heard: list[HeardMessage] = []
        self._visits: list[Visit] = []

    def look(self, observation: Observation, info: Info) -> None:
        """Take note of who is about, if it is time to."""
        state = observation["state"]
        time = float(state["time"])
        if (tick := tick_of(time)) == self.tick:
            return
        self.tick = tick
        if "in_view" not in info or state["posture"] == "lying":
            return
        self.settle()
        place = str(state["place"] or "")
        for body in info["in_view"].within(RECOGNISED):
            if body.agent and body.kind in _PEOPLE:
                self.see(body.agent, time, float(body.position[0]), float(body.position[1]), place)

    def see(self, agent: str, time: float, x: float, y: float, place: str) -> None:
        """Remember that somebody was seen."""
        self._people.pop(agent, None)
        self._people[agent] = time, x, y, place
        if len(self._people) > MOST_PEOPLE:
            del self._people[next(iter(self._people))]

    def listen(self, observation: Observation) -> None:
        """Remember what is said."""
        for message in observation["events"]:
            heard = HeardMessage(float(message["time"]), str(message["speaker"]), str(message["text"])[:_MOST_TEXT])
            self._heard.append(heard)
        del self._heard[:-MOST_MESSAGES]

    def arrive(self, time: float, stay: int, place: str) -> None:
        """Remember that one has come somewhere for a stay, or is back there."""
        last = self._visits[-1] if self._visits else None
        if last is not None and (last.stay, last.place) == (stay, place):
            self._visits[-1] = replace(last, until=None)
            return
        self.leave(time)
        self._visits.append(Visit(stay, place, time))
        del self._visits[:-MOST_VISITS]

    def leave(self, time: float) -> None:
        """Remember that one has gone, if one was anywhere."""
        if self._visits and self._visits[-1].until is None:
            self._visits[-1] = replace(self._visits[-1], until=time)

    def seen(self, agent: str) -> SeenPerson | None:
        """Return when and where somebody was seen last; None if they were not."""
        self.settle()
        found = self._people.get(agent)
        return None if found is None else SeenPerson(agent, *found)

    @property
    def people(self) -> Iterable[str]:
        """Agents that were seen, the one seen longest ago first."""
        self.settle()
        return self._people.keys()

    @property
    def heard(self) -> Sequence[HeardMessage]:
        """What was said, in order."""
        return self._heard

    @property
    def visits(self) -> Sequence[Visit]:
        """Where one has been, in order."""
        return self._visits

    def state(self) -> AgentState:
        """Return all of it."""
        self.settle()
        rows = list(self._people.values())
        return {
            "tick": self.tick,
            "people": list(self._people),
            "seen": np.array([row[:3] for row in rows], np.float64).reshape(-1, 3),
            "seen_in": [row[3] for row in rows],
            "heard": [[one.time, one.speaker, one.text] for one in self._heard],
            "visits": [[one.stay, one.place, one.since, one.until] for one in self._visits],
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Remember what `state` returned."""
        self.settle()
        self.tick = int(state["tick"])
        seen = np.asarray(state["seen"], np.float64).reshape(-1, 3).tolist()
        rows = zip(state["people"], seen, state["seen_in"], strict=True)
        self._people = {str(agent): (time, x, y, str(place)) for agent, (time, x, y), place in rows}
        self._heard = [HeardMessage(float(time), str(who), str(text)) for time, who, text in state["heard"]]
        self._visits = [
            Visit(int(stay), str(place), float(since), None if until is None else float(until))
            for stay, place, since, until in state["visits"]
        ]


__all__ = [
    "EVERY",
    "MOST_MESSAGES",
    "MOST_PEOPLE",
    "MOST_VISITS",
    "RECOGNISED",
    "HeardMessage",
    "ResidentMemory",
    "SeenPerson",
    "Visit",
    "tick_of",
]
