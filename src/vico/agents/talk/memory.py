"""A resident's memory of a day: people seen, places visited, messages heard. All of it is bounded.

Looking about is remembered every ten seconds by the clock, so that it does not matter who is asked when. `CrowdMemory`
takes down in arrays whom many residents see, and tells their memories when these are wanted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.agents.base import AgentState, Info, Observation
from vico.observation_arrays import CrowdObservations

__all__ = [
    "LOOK_PERIOD",
    "MOST_MESSAGES",
    "MOST_PEOPLE",
    "MOST_VISITS",
    "RECOGNITION_DISTANCE",
    "CrowdMemory",
    "HeardMessage",
    "ResidentMemory",
    "SeenPerson",
    "Visit",
    "look_number",
]
#: Seconds between two times that one takes note of who is about, and the distance up to which one knows them, metres.
LOOK_PERIOD, RECOGNITION_DISTANCE = 10.0, 20.0
#: People that are remembered, at most; the oldest are forgotten first.
MOST_PEOPLE = 64
#: Messages, likewise.
MOST_MESSAGES = 32
#: Visits, likewise.
MOST_VISITS = 48
# So much of a message is remembered, characters.
_MAX_TEXT = 300
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


def look_number(time: float) -> int:
    """Return the number of the ten seconds that a time lies in."""
    return int(time // LOOK_PERIOD)


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
        #: Tells whom one saw as one of a group, before it is asked for; see `vico.agents.talk.memory`.
        self.settle: Callable[[], None] = lambda: None
        # By agent, the one seen longest ago first.
        self._people: dict[str, tuple[float, float, float, str]] = {}
        self._heard: list[HeardMessage] = []
        self._visits: list[Visit] = []

    def look(self, observation: Observation, info: Info) -> None:
        """Take note of who is about, if it is time to."""
        state = observation["state"]
        time = float(state["time"])
        if (tick := look_number(time)) == self.tick:
            return
        self.tick = tick
        if "in_view" not in info or state["posture"] == "lying":
            return
        self.settle()
        place = str(state["place"] or "")
        for body in info["in_view"].within(RECOGNITION_DISTANCE):
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
            heard = HeardMessage(float(message["time"]), str(message["speaker"]), str(message["text"])[:_MAX_TEXT])
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

    def last_seen(self, agent: str) -> SeenPerson | None:
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
    def messages(self) -> Sequence[HeardMessage]:
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


_LYING = 2
# Memories are told at the latest after so many times of looking about.
_MOST_PENDING = 60


class CrowdMemory:
    """Looks about for members of a group; each remembers what it would by itself (`ResidentMemory.look`).

    Parameters
    ----------
    memories
        Of the members, by number; None for one that has none.
    """

    def __init__(self, memories: Sequence[ResidentMemory | None]) -> None:
        self._memories = memories
        self._tick = -1
        self._pending: list[tuple[float, NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]] = []
        self._agents: tuple[object, list[str]] = None, []
        for memory in memories:
            if memory is not None:
                memory.settle = self.settle

    def look(self, crowd: CrowdObservations, asked: NDArray[np.int64], number: Callable[[], NDArray[np.int64]]) -> None:
        """Take down who is about, if it is time to.

        Parameters
        ----------
        asked
            Numbers of the members that are asked now, int64, shape ``(n,)``.
        number
            Returns the members' numbers by row of the crowd; -1 for others.
        """
        if (tick := look_number(crowd.time)) == self._tick:
            return
        self._tick = tick
        if self._agents[0] is not crowd.index:
            self.settle()
            self._agents = crowd.index, sorted(crowd.index, key=lambda name: crowd.index[name])
        looks = np.zeros(len(self._memories) + 1, bool)  # the last one is for those who are no members
        for k in asked.tolist():
            memory = self._memories[k]
            if memory is not None and memory.tick != tick:
                memory.tick, looks[k] = tick, True
        me = number()[crowd.viewer]
        kept = looks[me] & (crowd.distance <= RECOGNITION_DISTANCE) & (crowd.posture[crowd.viewer] != _LYING)
        if kept.any():
            viewer, seen = crowd.viewer[kept], crowd.seen[kept]
            where = np.column_stack([crowd.pose[seen, :2], crowd.place[viewer]])
            self._pending.append((float(crowd.time), me[kept], seen, where))
        if len(self._pending) >= _MOST_PENDING:
            self.settle()

    def settle(self) -> None:
        """Tell all memories what was taken down for them."""
        if not self._pending:
            return
        time = np.concatenate([np.full(len(me), when) for when, me, _, _ in self._pending])
        me, seen, where = (np.concatenate([one[k] for one in self._pending]) for k in (1, 2, 3))
        self._pending = []
        pair = me * (int(seen.max()) + 1) + seen
        # Only the last time counts; in order, so that the same ones are forgotten.
        _, last = np.unique(pair[::-1], return_index=True)
        kept = np.sort(len(pair) - 1 - last)
        agents = self._agents[1]
        rows = zip(me[kept].tolist(), seen[kept].tolist(), time[kept].tolist(), where[kept].tolist(), strict=True)
        for k, other, when, (x, y, place) in rows:
            memory = self._memories[k]
            assert memory is not None
            memory.see(agents[other], when, x, y, memory.places[int(place)] if place >= 0 else "")
