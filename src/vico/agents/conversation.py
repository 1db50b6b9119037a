"""What residents say when they meet: short, friendly, and about their own lives."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from vico.agents.base import Action, Info, Observation
from vico.agents.state import AgentState
from vico.agents.talk.acquaintance import Acquaintance
from vico.clock import DAY

# People greet within this distance, metres, and not twice within this time, seconds.
GREETING_DISTANCE = 6.0
GREETING_PAUSE = 1200.0
# A chat in passing ends after this many lines of one's own.
_LINES = 2
_RANGE = 8.0
# Who is younger talks of other things, years.
_GROWN_UP = 18
# From this hour on one asks how school was.
_SCHOOL_IS_OUT = 13


class Speaker(Protocol):
    """What a conversation needs to know of a resident."""

    @property
    def id(self) -> str:
        """Name of the agent."""

    @property
    def name(self) -> str:
        """Name of the person."""

    @property
    def age(self) -> int:
        """Years."""

    @property
    def occupation(self) -> str:
        """What they do."""

    @property
    def hobbies(self) -> list[str]:
        """What they like to do."""


class Conversation:
    """Decides whether to speak, and what to say.

    Parameters
    ----------
    resident
        Who speaks.
    known
        Whom they know.
    generator
        Decides which words.
    """

    def __init__(self, resident: Speaker, known: Sequence[Acquaintance], generator: np.random.Generator) -> None:
        self._me = resident
        self._known = {person.agent: person for person in known}
        self._rng = generator
        self._greeted: dict[str, float] = {}
        #: Changes whenever somebody is spoken with.
        self.encounters = 0
        self._said: dict[str, int] = {}

    def state(self) -> AgentState:
        """Return whom it greeted when, and how much it said; the generator is its owner's to save."""
        return {"greeted": dict(self._greeted), "said": dict(self._said)}

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self.encounters += 1
        self._greeted, self._said = dict(state["greeted"]), dict(state["said"])

    @property
    def known(self) -> Collection[str]:
        """Agents whom the speaker knows."""
        return self._known.keys()

    @property
    def greeted(self) -> Mapping[str, float]:
        """When the speaker last spoke with agents, seconds."""
        return self._greeted

    def meet(self, agent: str, time: float) -> None:
        """Take note that one speaks with somebody, seconds: whom one has just answered one doesn't greet."""
        self._greeted[agent] = time
        self.encounters += 1

    def line(self, observation: Observation, info: Info, errand: Callable[[], str]) -> Action | None:
        """Return something to say now, or None.

        Parameters
        ----------
        errand
            Says what one is about, to follow "I'm ", such as "on my way to work".
        """
        time = observation["state"]["time"]
        for message in observation["events"]:
            reply = self._reply(message, time, errand)
            if reply is not None:
                return reply
        return self._greet(info, time, errand)

    def _reply(self, message: dict[str, Any], time: float, errand: Callable[[], str]) -> Action | None:
        speaker, text = message["speaker"], message["text"]
        person = self._known.get(speaker)
        mine = self._me.name.split()[0]
        if mine.lower() not in text.lower():
            return None
        if time - self._greeted.get(speaker, -1e9) > GREETING_PAUSE:
            self._said[speaker] = 0
        self._greeted[speaker] = time
        self.encounters += 1
        if self._said.get(speaker, 0) >= _LINES:
            return None
        self._said[speaker] = self._said.get(speaker, 0) + 1
        if person is None:
            return _say(f"Hello! I'm {mine}. Sorry, I'm {errand()}.")
        return _say(self._choose(self._answers(person, errand(), last="?" not in text)))

    def _greet(self, info: Info, time: float, errand: Callable[[], str]) -> Action | None:
        # Residents are told who is in view; others who live by a schedule greet nobody, but answer.
        for agent in info["in_view"].agents_within(GREETING_DISTANCE) if "in_view" in info else ():
            person = self._known.get(agent)
            if person is None or time - self._greeted.get(person.agent, -1e9) <= GREETING_PAUSE:
                continue
            self._greeted[person.agent] = time
            self.encounters += 1
            self._said[person.agent] = 1
            return _say(self._choose(self._greetings(person, time, errand())))
        return None

    def _greetings(self, person: Acquaintance, time: float, errand: str) -> list[str]:
        other = person.first_name
        if min(self._me.age, person.age) < _GROWN_UP:
            return self._greetings_with_children(person, errand, time % DAY / 3600)
        hour = time % DAY / 3600
        hello = "Good morning" if hour < 11 else "Hello" if hour < 18 else "Good evening"
        lines = [
            f"{hello}, {other}! I'm {errand}. And you?",
            f"Hi {other}, how are you today?",
            f"{hello}, {other}! Where are you off to?",
        ]
        if person.kind == "colleague":
            lines.append(f"{hello}, {other}! Are you working today, too?")
        if person.kind in ("friend", "family") and self._me.hobbies:
            lines.append(f"{other}! Nice to see you. Any time for {self._hobby()} this week?")
        if person.kind == "neighbour":
            lines.append(f"{hello}, {other}! Is everything all right at home?")
        return lines

    def _greetings_with_children(self, person: Acquaintance, errand: str, hour: float) -> list[str]:
        """Return what children say, and what is said to them."""
        other = person.first_name
        if self._me.age >= _GROWN_UP:
            school = "How was school?" if hour >= _SCHOOL_IS_OUT else "Have you got everything for school?"
            lines = [f"Hello, {other}! {school}", f"Hi {other}! Where are you off to?"]
            if person.kind != "family":
                lines.append(f"Hello, {other}! You have grown again.")
            return lines
        lines = [f"Hi {other}! I'm {errand}.", f"Hello, {other}! Guess what: I'm {errand}!"]
        if person.age < _GROWN_UP:
            lines.append(f"Hey {other}! Are you coming out to play later?")
            if self._me.hobbies:
                lines.append(f"{other}! Shall we do some {self._hobby()} after school?")
        return lines

    def _answers(self, person: Acquaintance, errand: str, *, last: bool) -> list[str]:
        other = person.first_name
        if last and self._me.age < _GROWN_UP:
            return [f"Bye, {other}!", f"See you, {other}!", f"Bye bye, {other}!"]
        if last:
            return [f"See you, {other}!", f"Take care, {other}.", f"Have a good one, {other}!"]
        lines = [
            f"Hi {other}! I'm {errand}.",
            f"Fine, thanks, {other}. I'm {errand}.",
            f"Good to see you, {other}. I'm {errand}, a little in a hurry.",
        ]
        if self._me.hobbies:
            lines.append(f"All well, {other}. Looking forward to some {self._hobby()} later.")
        if self._me.occupation and self._me.age >= _GROWN_UP:
            lines.append(f"Busy as ever, {other}: the life of a {self._me.occupation.lower()}.")
        return lines

    def _hobby(self) -> str:
        return self._choose(self._me.hobbies).lower()

    def _choose(self, options: Sequence[str]) -> str:
        return options[int(self._rng.integers(len(options)))]


def _say(text: str) -> Action:
    return {"type": "communicate", "text": text, "range": _RANGE}
