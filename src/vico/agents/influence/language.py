"""Language models in the influence challenge: target choice, dialogue and members; each falls back to an offline part.

A model that cannot be reached, refuses, or answers with garbage never ends a run: what it should have decided is
decided by the offline part that was named for it, and that is counted and told.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from vico.agents.influence.profiles import Profile
from vico.agents.influence.situation import Dialogue, Situation, Talk, TargetChoice
from vico.clock import clock_of
from vico.errors import LlmBudgetError, SourceError, VicoError, sentence_of
from vico.llm import LanguageModel, Message, Reply, Usage
from vico.llm.prompts import read_prompt

#: So many characters of a message are said; the rest is cut off at a word.
LONGEST = 600
#: After so many failures in a row that lie with the server or the budget a model is not asked again.
GIVE_UP = 3

T = TypeVar("T", bound=BaseModel)


class TargetReply(BaseModel):
    """Whom to see next."""

    model_config = ConfigDict(extra="forbid")
    member: str = Field(description="Id of one of those listed.")


class MessageReply(BaseModel):
    """What to say."""

    model_config = ConfigDict(extra="forbid")
    message: str = Field(min_length=1, max_length=2000)


class RankingReply(BaseModel):
    """Who is liked better, and why."""

    model_config = ConfigDict(extra="forbid")
    friend: str = Field(description="Id of one of the two.")
    reason: str = ""


class Model(Protocol):
    """What is needed of `vico.llm.LanguageModel`."""

    def ask(
        self, messages: list[Message], reply: type[T], *, check: Callable[[T], list[str]] | None = None
    ) -> Reply[T]:
        """Ask for a record."""


class Asker:
    """Asks a model, counts what that takes and how often nothing came of it.

    Attributes
    ----------
    usage
        What was used.
    fallbacks
        How often an offline part had to decide.
    reasons
        Why, the first time for each kind of error.
    """

    def __init__(self, model: Model | LanguageModel) -> None:
        self._model = model
        self._failed = 0
        self.usage = Usage()
        self.fallbacks = 0
        self.reasons: list[str] = []

    def ask(self, name: str, reply: type[T], check: Callable[[T], list[str]] | None = None, **inputs: Any) -> T | None:
        """Return a record for a prompt; None where an offline part has to decide."""
        if self._failed >= GIVE_UP:
            self.fallbacks += 1
            return None
        try:
            answer = self._model.ask(read_prompt("influence", name, reply).messages(**inputs), reply, check=check)
        except VicoError as error:
            self._failed = self._failed + 1 if isinstance(error, (SourceError, LlmBudgetError)) else 0
            self.fallbacks += 1
            kind = type(error).__name__
            if not any(reason.startswith(kind) for reason in self.reasons):
                self.reasons.append(f"{sentence_of(error)} ({name})")
            return None
        self._failed = 0
        self.usage += answer.usage
        return answer.value


def public(profile: Profile) -> dict[str, Any]:
    """Return a profile as prompts show it."""
    return {
        "id": profile.id,
        "name": profile.name,
        "age": profile.age,
        "occupation": profile.occupation,
        "values": list(profile.values),
        "traits": list(profile.traits),
        "hobbies": list(profile.hobbies),
        "groups": list(profile.groups),
        "lifestyle": profile.lifestyle,
        "biography": profile.biography[:1200],
    }


class LanguageTarget:
    """Asks a model whom to see next."""

    def __init__(self, asker: Asker, fallback: TargetChoice) -> None:
        self.asker, self.fallback = asker, fallback

    def choose(self, situation: Situation, chance: np.random.Generator) -> str | None:
        """Return the model's choice among those who can be met; the fallback's where there is none."""
        options = situation.reachable()
        if not options:
            return None

        def check(reply: TargetReply) -> list[str]:
            known = ", ".join(options)
            return [] if reply.member in options else [f"{reply.member[:40]!r} can't be met now; take one of {known}"]

        listed = []
        for member, seconds in options.items():
            stay = situation.days[member].at(situation.time)
            talks = [talk.record() for talk in situation.talks_with(member)]
            about = {"walk_seconds": round(seconds), "stays_seconds": round(stay.end - situation.time), "talks": talks}
            listed.append(public(situation.members[member]) | about | {"does": stay.activity})
        reply = self.asker.ask(
            "choose_target",
            TargetReply,
            check,
            time=clock_of(int(situation.time))[:5],
            ends=clock_of(int(situation.ends))[:5],
            me=public(situation.me),
            rival=public(situation.rival),
            members=listed,
        )
        return self.fallback.choose(situation, chance) if reply is None else reply.member


class LanguageDialogue:
    """Asks a model what to say."""

    def __init__(self, asker: Asker, fallback: Dialogue) -> None:
        self.asker, self.fallback = asker, fallback

    def say(self, situation: Situation, talk: Talk, chance: np.random.Generator) -> str | None:
        """Return the model's words; the fallback's where there are none."""
        me, listener = public(situation.me), public(situation.members[talk.target])
        talks = [one.record() for one in situation.talks_with(talk.target)]
        if talk.said:
            reply = self.asker.ask("next_message", MessageReply, me=me, listener=listener, said=talks)
        else:
            reply = self.asker.ask("first_message", MessageReply, me=me, listener=listener, earlier=talks)
        return self.fallback.say(situation, talk, chance) if reply is None else shortened(reply.message)


class LanguageMember:
    """Asks a model what a member answers, and how they rank the two."""

    def __init__(self, asker: Asker) -> None:
        self.asker = asker

    def answer(self, me: Profile, speaker: Profile, said: list[Mapping[str, Any]]) -> str | None:
        """Return what a member answers; None where an offline part has to."""
        reply = self.asker.ask("member_reply", MessageReply, me=public(me), speaker=public(speaker), said=said)
        return None if reply is None else shortened(reply.message)

    def friend(self, me: Profile, mains: list[Profile], said: list[Mapping[str, Any]]) -> str | None:
        """Return the id of the main agent whom a member likes better; None where an offline part has to say."""
        ids = [main.id for main in mains]

        def check(reply: RankingReply) -> list[str]:
            return [] if reply.friend in ids else [f"{reply.friend[:40]!r} is none of the two: {', '.join(ids)}"]

        shown = [public(main) for main in mains]
        reply = self.asker.ask("member_ranking", RankingReply, check, me=public(me), mains=shown, said=said)
        return None if reply is None else reply.friend


def shortened(text: str, longest: int = LONGEST) -> str:
    """Return a text in one line, cut off at a word where it is too long."""
    line = " ".join(text.split())
    return line if len(line) <= longest else line[: longest + 1].rsplit(" ", 1)[0][:longest]
