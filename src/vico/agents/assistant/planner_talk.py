"""When two assistants talk: at decisions, while they are near, a few lines, and never longer than it is of use.

Who has the lower number begins. Who has spoken waits two steps for an answer, and says no more than three lines before
it goes on with its work. What is heard is data for the model, whoever says it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import Any

import numpy as np

from vico.agents.assistant.planner_memory import Conversation
from vico.agents.assistant.skills import Action, AssistantSkills, ObservationView
from vico.agents.state import AgentState

#: A colleague as near as this can hear, metres.
NEAR = 10.0
# Lines that one says before it goes on; steps one waits for an answer, or for who begins; turns of the look around.
_MOST_SAID, _PATIENCE, _LOOK_AROUND = 3, 2, 4
# Where somebody was seen or heard so long ago they may still be, seconds; a line reaches so much farther, metres.
_FRESH, _MARGIN = 3.0, 2.0

#: Returns what to say now; None for nothing.
Author = Callable[[], str | None]


class Talk:
    """One assistant's side of the conversation.

    Parameters
    ----------
    name, colleague
        Agents' names; no colleague where empty.
    begins
        Whether it speaks first when they meet for the first time.
    also
        Agents' names of others whose words are remembered.
    """

    def __init__(self, name: str, colleague: str, *, begins: bool, also: Collection[str] = ()) -> None:
        self.name, self.colleague = name, colleague
        self.conversation = Conversation()
        self._begins, self._also = begins, frozenset(also)
        self._place: list[float] | None = None  # where the colleague was last heard, and when
        self._room, self._heard_at = "", -np.inf
        self._met = False
        self._turns = 0
        self._anew()

    def _anew(self) -> None:
        self._over = False
        self._said = self._waited = 0
        self._answered = True

    def state(self) -> AgentState:
        """Return what was said, and how far the conversation is."""
        return {
            "lines": [dict(line) for line in self.conversation.lines],
            "place": self._place,
            "room": self._room,
            "heard_at": None if np.isinf(self._heard_at) else self._heard_at,
            "met": self._met,
            "turns": self._turns,
            "over": self._over,
            "said": self._said,
            "waited": self._waited,
            "answered": self._answered,
        }

    def restore(self, state: AgentState) -> None:
        """Go on where `state` was returned."""
        self.conversation.lines = [dict(line) for line in state["lines"]]
        self._place, self._room = state["place"], state["room"]
        self._heard_at = -np.inf if state["heard_at"] is None else float(state["heard_at"])
        self._met, self._turns, self._over = state["met"], state["turns"], state["over"]
        self._said, self._waited, self._answered = state["said"], state["waited"], state["answered"]

    def hear(self, view: ObservationView, clock: str) -> None:
        """Remember what the colleague, and those the tasks are about, said."""
        for message in view.observation["events"]:
            speaker = str(message["speaker"])
            if speaker == self.name or not (speaker == self.colleague or speaker in self._also):
                continue
            self.conversation.add(clock, speaker, str(message["text"]))
            if speaker == self.colleague:
                self._place, self._room = [float(x) for x in message["position"][:2]], view.room or ""
                self._heard_at, self._answered = float(view.state["time"]), True

    def next(self, view: ObservationView, skills: AssistantSkills, clock: str, author: Author) -> Action | None:
        """Return what to do for the conversation's sake before the next decision; None to go on.

        Parameters
        ----------
        author
            Asked for a line where one may speak.
        """
        if not self.colleague or self._over:
            return None
        away = self._away(view, skills)
        if away is None:
            return self._look_around()
        if self._waits():
            self._waited += 1
            return {"type": "wait"}
        text = author() if self._may_speak() else None
        self._met = True
        if not text:
            self._over = True
            return None
        self.conversation.add(clock, self.name, text)
        said = self.conversation.lines[-1]["text"]
        if not said:
            self._over = True
            return None
        self._said, self._waited, self._answered = self._said + 1, 0, False
        return {"type": "communicate", "text": said, "range": min(NEAR, away + _MARGIN)}

    def decided(self) -> None:
        """Take note that a decision was made: at the next one they may talk again."""
        self._anew()

    def seen(self, view: ObservationView, skills: AssistantSkills) -> Mapping[str, Any] | None:
        """Return how near the colleague is, for the model; None where it is not known to be near."""
        away = self._away(view, skills) if self.colleague else None
        return None if away is None else {"name": self.colleague, "near": True}

    def _look_around(self) -> Action | None:
        """Turn round once at the start, to see who is there."""
        if not self._met and self._turns < _LOOK_AROUND:
            self._turns += 1
            return {"type": "turn_left", "degrees": 88.0}
        self._turns = _LOOK_AROUND
        self._over = True
        return None

    def _waits(self) -> bool:
        lets_begin = not self._met and not self._begins and np.isinf(self._heard_at)
        return (lets_begin or not self._answered) and self._waited < _PATIENCE

    def _may_speak(self) -> bool:
        return self._answered and self._said < _MOST_SAID

    def _away(self, view: ObservationView, skills: AssistantSkills) -> float | None:
        """Metres to the colleague, if it is near and in the same space."""
        now, room = float(view.state["time"]), view.room or ""
        found: list[tuple[float, float]] = []
        seen = skills.seen.last_seen(self.colleague)
        if seen is not None and seen.room == room and now - seen.time <= _FRESH:
            found.append((seen.time, view.away(seen.position)))
        if self._place is not None and self._room == room and now - self._heard_at <= _FRESH:
            found.append((self._heard_at, view.away(self._place)))
        if not found:
            return None
        _, away = max(found)
        return away if away <= NEAR else None
