"""Small talk of residents when they meet: short, friendly, and about their own lives."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from vico.agents.base import Action, AgentState, FieldState, Info, Observation
from vico.agents.talk.acquaintance import (
    GROWN_UP,
    Acquaintance,
    address_of,
    calls_somebody_nearer,
    form_of_address_by,
    is_called,
)
from vico.agents.talk.grammar import vocation_of
from vico.clock import DAY
from vico.english import split_name, uncapitalize

# People greet within this distance, metres, and not twice within this time, seconds.
GREETING_DISTANCE = 6.0
GREETING_PAUSE = 1200.0
# A chat in passing ends after this many lines of one's own.
_LINES = 2
_RANGE = 8.0
# From this hour on one asks how school was.
_SCHOOL_IS_OUT = 13
# What those say who go on; what ends a chat; how somebody says how they are.
_GOES_PATTERN = re.compile(
    r"\bon my way\b|\b(?:have|need|must) (?:to )?go\b|\b(?:good)?bye\b|(?:^|[.!] )(?:see you|take care|have a good)\b",
    re.I,
)
_ENDS_PATTERN = re.compile(r"^(?:nice to see you|good to hear)\b", re.I)
_TELLS_PATTERN = re.compile(r"\b(?:I'm|I am|fine|well|busy)\b", re.I)
# What is asked for: how one is; something to do together; school.
_HOW_PATTERN = re.compile(r"\b(?:how are you|how do you do|all right|are you well)\b", re.I)
_INVITES_PATTERN = re.compile(r"\b(?:any time for|feel like|coming out|would you like|shall we)\b", re.I)
_SCHOOL_PATTERN = re.compile(r"\bschool\b", re.I)


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


@dataclass(frozen=True)
class Errand:
    """What one is about.

    Attributes
    ----------
    words
        Follow "I'm ", such as "on my way to work" or "having lunch".
    leaves
        Whether one is on the way, and says goodbye.
    """

    words: str
    leaves: bool


class Conversation(FieldState):
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

    _greeted: dict[str, float]
    _said: dict[str, int]

    def __init__(self, resident: Speaker, known: Sequence[Acquaintance], generator: np.random.Generator) -> None:
        self._me = resident
        # Not everybody's author said these.
        self._gender, self._household = (str(getattr(resident, field, None) or "") for field in ("gender", "household"))
        self._known = {person.agent: person for person in known}
        self._rng = generator
        self._greeted, self._said = {}, {}
        #: Changes whenever somebody is spoken with.
        self.encounters = 0

    def restore(self, state: AgentState) -> None:
        """Remember what `state` returned."""
        self.encounters += 1
        super().restore(state)

    @property
    def acquaintances(self) -> Collection[str]:
        """Agents whom the speaker knows."""
        return self._known.keys()

    @property
    def greeting_times(self) -> Mapping[str, float]:
        """When the speaker last spoke with agents, seconds."""
        return self._greeted

    def meet(self, agent: str, time: float) -> None:
        """Take note that one speaks with somebody, seconds: whom one has just answered one doesn't greet."""
        self._greeted[agent] = time
        self.encounters += 1

    def line(self, observation: Observation, info: Info, errand: Callable[[], Errand]) -> Action | None:
        """Return something to say now, or None.

        Parameters
        ----------
        errand
            Tells what one is about.
        """
        time = observation["state"]["time"]
        for message in observation["events"]:
            if self._is_for_me(message, observation, info):
                reply = self._reply(message, time, errand)
                if reply is not None:
                    return reply
        return self._greet(observation["state"], info, errand)

    def _is_for_me(self, message: Mapping[str, Any], observation: Observation, info: Info) -> bool:
        """Whether one is called, as oneself or as who one is to the speaker, and nobody else of the same name is."""
        me, person = self._me, self._known.get(message["speaker"])
        also: tuple[str, ...] = ()
        if person is not None:
            also = (
                form_of_address_by(person, name=me.name, age=me.age, gender=self._gender, household=self._household),
            )
        if not is_called(me.name, message["text"], gender=self._gender, also=also):
            return False
        x, y = (float(value) for value in observation["pose"][:2])
        bodies = info["in_view"].within(2 * _RANGE) if "in_view" in info else ()
        return not calls_somebody_nearer(message, (x, y), bodies, self._name_and_gender)

    def _name_and_gender(self, agent: str) -> tuple[str, str | None] | None:
        person = self._known.get(agent)
        return None if person is None else (person.name, person.gender)

    def _reply(self, message: Mapping[str, Any], time: float, errand: Callable[[], Errand]) -> Action | None:
        speaker, text = message["speaker"], message["text"]
        person = self._known.get(speaker)
        if time - self._greeted.get(speaker, -1e9) > GREETING_PAUSE:
            self._said[speaker] = 0
        self._greeted[speaker] = time
        self.encounters += 1
        if self._said.get(speaker, 0) >= _LINES:
            return None
        if person is not None and _ENDS_PATTERN.search(text):
            return None
        self._said[speaker] = self._said.get(speaker, 0) + 1
        about = errand()
        if person is None:
            return _communicate(f"Hello! I'm {split_name(self._me.name)[1]}. Sorry, I'm {about.words}.")
        options = self._answers if "?" in text else self._last_words
        return _communicate(self._choose(options(person, self._errand_for(about, person), text)))

    def _greet(self, state: Mapping[str, Any], info: Info, errand: Callable[[], Errand]) -> Action | None:
        time = state["time"]
        # Residents are told who is in view; others who live by a schedule greet nobody, but answer.
        for agent in info["in_view"].agents_within(GREETING_DISTANCE) if "in_view" in info else ():
            person = self._known.get(agent)
            if person is None or time - self._greeted.get(person.agent, -1e9) <= GREETING_PAUSE:
                continue
            self._greeted[person.agent] = time
            self.encounters += 1
            self._said[person.agent] = 1
            about = self._errand_for(errand(), person)
            return _communicate(self._choose(self._greetings(person, time, about, indoors=bool(state["room"]))))
        return None

    def _errand_for(self, errand: Errand, person: Acquaintance) -> Errand:
        """Return what one is about as one tells a person: "having lunch with you", "with Dad"."""
        words = errand.words
        for one in self._known.values():
            called = "you" if one is person else address_of(one, age=self._me.age, household=self._household)
            if one is person or one.kind == "family":
                words = re.sub(rf"(?<![\w-]){re.escape(one.first_name)}(?![\w-])", called, words)
        return replace(errand, words=words)

    def _address_for(self, person: Acquaintance) -> tuple[str, bool]:
        """Return what one calls somebody, and whether that is formal."""
        other = address_of(person, age=self._me.age, household=self._household)
        return other, person.kind != "family" and other != person.first_name

    def _greetings(self, person: Acquaintance, time: float, errand: Errand, *, indoors: bool) -> list[str]:
        other, _ = self._address_for(person)
        hour = time % DAY / 3600
        hello = "Good morning" if hour < 11 else "Hello" if hour < 18 else "Good evening"
        if min(self._me.age, person.age) < GROWN_UP:
            return self._greetings_with_children(person, errand, hour, hello, indoors=indoors)
        ask = "" if re.search(r"\byou\b", errand.words) else " And you?"
        lines = [f"{hello}, {other}! I'm {errand.words}.{ask}", f"Hi {other}, how are you today?"]
        if not indoors:
            lines.append(f"{hello}, {other}! Where are you off to?")
        if person.kind == "colleague":
            lines.append(f"{hello}, {other}! Are you working today, too?")
        if person.kind in ("friend", "family") and self._me.hobbies:
            lines.append(f"{other}! Nice to see you. Any time for {self._hobby()} this week?")
        if person.kind == "neighbour":
            lines.append(f"{hello}, {other}! Is everything all right at home?")
        return lines

    def _greetings_with_children(
        self, person: Acquaintance, errand: Errand, hour: float, hello: str, *, indoors: bool
    ) -> list[str]:
        """Return what children say, and what is said to them."""
        other, formal = self._address_for(person)
        if self._me.age >= GROWN_UP:
            school = "How was school?" if hour >= _SCHOOL_IS_OUT else "Have you got everything for school?"
            lines = [f"Hello, {other}! {school}"]
            if not indoors:
                lines.append(f"Hi {other}! Where are you off to?")
            if person.kind != "family":
                lines.append(f"Hello, {other}! You have grown again.")
            return lines
        if formal:
            return [f"{hello}, {other}!", f"{hello}, {other}! I'm {errand.words}.", f"{hello}, {other}! How are you?"]
        lines = [f"Hi {other}! I'm {errand.words}.", f"Hello, {other}! Guess what: I'm {errand.words}!"]
        if person.age < GROWN_UP:
            lines.append(f"Hey {other}! Are you coming out to play later?")
            if self._me.hobbies:
                when = "later" if hour >= _SCHOOL_IS_OUT else "after school"
                lines.append(f"{other}! Do you feel like {self._hobby()} {when}?")
        return lines

    def _last_words(self, person: Acquaintance, errand: Errand, text: str) -> list[str]:
        """Return how a chat ends after what the other said: with a goodbye if either goes, else with something kind."""
        other, formal = self._address_for(person)
        if not errand.leaves and not _GOES_PATTERN.search(text):
            return [f"Nice to see you, {other}!", *([f"Good to hear, {other}."] if _TELLS_PATTERN.search(text) else [])]
        if formal:
            return [f"Goodbye, {other}!", f"Bye, {other}!"]
        if not errand.leaves:
            return [f"See you later, {other}!", f"Bye, {other}! See you soon."]
        if self._me.age < GROWN_UP:
            return [f"Bye, {other}!", f"See you, {other}!", f"Bye bye, {other}!"]
        return [f"See you, {other}!", f"Take care, {other}.", f"Have a good one, {other}!"]

    def _answers(self, person: Acquaintance, errand: Errand, text: str) -> list[str]:
        """Return what may be said to what the other asked."""
        other, formal = self._address_for(person)
        child = self._me.age < GROWN_UP
        if _HOW_PATTERN.search(text):
            lines = [f"Fine, thanks, {other}. I'm {errand.words}."]
            if self._me.hobbies:
                lines.append(f"All well, {other}. Looking forward to {self._hobby()} later.")
            work = vocation_of(self._me.occupation)
            if work.startswith(("a ", "an ")) and not child:
                lines.append(f"Busy as ever, {other}: the life of {work}.")
            return lines
        if _INVITES_PATTERN.search(text):
            return [f"Yes, gladly, {other}!", f"Maybe, {other}! I'm {errand.words}."]
        if child and _SCHOOL_PATTERN.search(text):
            was = "was" in text
            return [f"It was all right, {other}.", f"Fine, {other}!"] if was else [f"Yes, {other}, everything!"]
        hi = f"Hello, {other}" if formal else f"Hi {other}"
        return [f"{hi}! I'm {errand.words}.", f"Good to see you, {other}. I'm {errand.words}."]

    def _hobby(self) -> str:
        return uncapitalize(self._choose(self._me.hobbies))

    def _choose(self, options: Sequence[str]) -> str:
        return options[int(self._rng.integers(len(options)))]


def _communicate(text: str) -> Action:
    return {"type": "communicate", "text": text, "range": _RANGE}
