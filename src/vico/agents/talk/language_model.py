"""Answers by a language model, from the resident's facts; what the facts don't hold is not said."""

from __future__ import annotations

import json
import re
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from vico.agents.talk.acquaintance import address_of
from vico.agents.talk.answers import Knowledge, Moment, TemplateTalk, about_person, answer_to
from vico.agents.talk.grammar import Question
from vico.agents.talk.memory import HeardMessage
from vico.clock import DAY, clock_of
from vico.errors import InputError, LlmBudgetError, LlmReplyError, SourceError
from vico.llm import LanguageModel, Usage
from vico.llm.prompts import read_prompt

__all__ = ["MOST_SAID", "LlmTalk", "SpokenReply", "facts_for_model", "reply_faults"]
#: Longest answer, characters.
MOST_SAID = 300
_MOST_HEARD = 400  # characters of a message that are shown
_MOST_PEOPLE = 24  # people among the facts
_MOST_SEEN = 12  # sightings among the facts
_MOST_MESSAGES = 6  # messages among the facts
# A server that failed so often in a row is not asked again.
_GIVES_UP = 3
# Shorter names may be words.
_A_NAME = 4
_CLOCK = re.compile(r"\b\d{1,2}:\d{2}\b")


class SpokenReply(BaseModel):
    """What somebody says."""

    model_config = ConfigDict(extra="forbid")

    text: Annotated[str, Field(min_length=1, max_length=MOST_SAID, description="The spoken words, and nothing else.")]


class LlmTalk:
    """Has a model word the answers of residents; templates answer where it fails. Residents may share one.

    Parameters
    ----------
    model
        Whom to ask; its budget, cache and recording hold for all residents.
    """

    def __init__(self, model: LanguageModel) -> None:
        self._model = model
        self._templates = TemplateTalk()
        self._failed = 0
        #: How many answers the model gave, and how many were left to templates.
        self.answered = self.fallbacks = 0
        #: Why the last one was left to templates; empty if none was.
        self.reason = ""
        #: What was spent.
        self.usage = Usage()

    def reply(self, heard: HeardMessage, question: Question | None, knows: Knowledge, moment: Moment) -> str | None:
        """Return what the model says, or the template's answer where it fails or says what the facts don't hold."""
        if self._failed < _GIVES_UP:
            try:
                said = self._ask_model(heard, question, knows, moment)
            except (SourceError, LlmReplyError, LlmBudgetError, InputError) as error:
                self._failed = self._failed + 1 if isinstance(error, SourceError) else 0
                self.reason = str(error)
            else:
                self._failed = 0
                self.answered += 1
                return said
        self.fallbacks += 1
        return self._templates.reply(heard, question, knows, moment)

    def _ask_model(self, heard: HeardMessage, question: Question | None, knows: Knowledge, moment: Moment) -> str:
        facts = facts_for_model(question, knows, moment)
        prompt = read_prompt("talk", "reply", SpokenReply)
        told = [
            {"by": knows.name_of(one.speaker), "at": _clock_text(one.time), "text": one.text}
            for one in knows.memory.messages
            if (one.time, one.speaker) != (heard.time, heard.speaker)
        ]
        shown = facts | {"what_was_said_to_them_or_near_them": told[-_MOST_MESSAGES:]}
        message = {"speaker": knows.name_of(heard.speaker), "text": heard.text[:_MOST_HEARD]}
        reply = self._model.ask(
            prompt.messages(facts=shown, message=message),
            SpokenReply,
            check=lambda said: reply_faults(said.text, facts, knows),
            rounds=1,
        )
        self.usage += reply.usage
        return " ".join(reply.value.text.split())


def facts_for_model(question: Question | None, knows: Knowledge, moment: Moment) -> dict[str, Any]:
    """Return what a resident may speak of: all of it its own knowledge, as JSON has it; no message is in it."""
    me, place = knows.me, knows.public_map.place_by_id.get(moment.place)
    near = None if place is not None else knows.beside(*moment.stands)
    people = [
        {
            "name": one.name,
            "called": address_of(one, age=me.age, household=me.household),
            "tie": one.kind,
            "note": one.note,
            "what_they_know": about_person(one.agent, knows, moment),
        }
        for one in list(knows.known.values())[:_MOST_PEOPLE]
    ]
    seen = [agent for agent in reversed(list(knows.memory.people)) if agent not in knows.known][:_MOST_SEEN]
    return {
        "person": {"name": me.name, "age": me.age, "occupation": me.occupation, "hobbies": list(me.hobbies)},
        "time": _clock_text(moment.time),
        "where_they_are": place.name if place is not None else f"outdoors, near {near.name}" if near else "outdoors",
        "what_they_are_about": f"I'm {moment.errand()}.",
        "day_so_far": answer_to(Question("did"), knows, moment),
        "plans": answer_to(Question("plans"), knows, moment),
        "people_they_know": people,
        "others_they_saw": [about_person(agent, knows, moment) for agent in seen],
        "sentence_that_answers": None if question is None else answer_to(question, knows, moment),
    }


def reply_faults(text: str, facts: dict[str, Any], knows: Knowledge) -> list[str]:
    """Return why somebody can't say something: a question, or times, places and people that the facts don't hold."""
    held = json.dumps(facts, ensure_ascii=False).lower()
    said = text.lower()
    faults = ["It must hold no question."] if "?" in text else []
    if not text.isprintable():
        faults.append("It must be one line of printable text.")
    faults += [f"The facts hold no time {clock}." for clock in _CLOCK.findall(text) if clock not in held]
    places = (place.name for place in knows.public_map.places)
    people = (name for name in knows.names.values())
    for name in dict.fromkeys([*places, *people]):
        if len(name) >= _A_NAME and name.lower() not in held and re.search(rf"\b{re.escape(name.lower())}\b", said):
            faults.append(f"The facts hold no {name!r}.")
    return faults


def _clock_text(time: float) -> str:
    return clock_of(int(time % DAY))[:5]
