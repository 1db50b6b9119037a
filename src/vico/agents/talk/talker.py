"""Who listens, decides whether a message is meant for it, and answers: from templates, or as a `Talk` says."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Protocol

from vico.agents.base import Info, Observation
from vico.agents.state import AgentState
from vico.agents.talk.address import calls_somebody_nearer, is_called
from vico.agents.talk.answers import answer_to
from vico.agents.talk.facts import Knowledge, Moment
from vico.agents.talk.grammar import Question, read_grammar
from vico.agents.talk.memory import HeardMessage
from vico.agents.talk.sentences import read_sentences

#: A question to nobody in particular is answered by the resident that stands nearest, within so many metres.
NEAREST = 5.0
#: So many questions of one speaker are answered within so many seconds; then one has to go on.
PATIENCE, PATIENCE_FOR = 8, 600.0
# Answers carry this far, metres.
RANGE = 8.0


class Talk(Protocol):
    """How a resident answers."""

    def reply(self, heard: HeardMessage, question: Question | None, knows: Knowledge, moment: Moment) -> str | None:
        """Return an answer to what was said to one; None leaves it to small talk.

        Parameters
        ----------
        question
            What is asked, if the grammar knows it.
        """


class TemplateTalk:
    """Answers questions of the grammar in the sentences of ``answers.toml``."""

    def reply(self, heard: HeardMessage, question: Question | None, knows: Knowledge, moment: Moment) -> str | None:
        """Return the answer; None for what is no question that the grammar knows."""
        return None if question is None else answer_to(question, knows, moment)


class Talker:
    """Remembers what a resident sees and hears, and answers what it is asked.

    Parameters
    ----------
    knows
        What the resident knows.
    talk
        How it answers.
    """

    def __init__(self, knows: Knowledge, talk: Talk | None = None) -> None:
        self.knows = knows
        self._talk: Talk = talk or TemplateTalk()
        self._names = [name.lower() for name in knows.me.names]
        # By speaker: how many questions were answered since when.
        self._answered: dict[str, tuple[int, float]] = {}

    def state(self) -> AgentState:
        """Return what it remembers."""
        answered = {speaker: [count, since] for speaker, (count, since) in self._answered.items()}
        return {"memory": self.knows.memory.state(), "answered": answered}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Remember what `state` returned."""
        self.knows.memory.restore(state["memory"])
        self._answered = {str(who): (int(count), float(since)) for who, (count, since) in state["answered"].items()}

    def notice(self, observation: Observation, info: Info) -> None:
        """Remember what is seen and heard; to be called whenever the resident is asked what it does."""
        self.knows.memory.look(observation, info)
        if observation["events"]:
            self.knows.memory.listen(observation)

    def reply(self, observation: Observation, moment: Moment) -> tuple[str, str] | None:
        """Return who is answered and what one says; None where nothing was asked of one."""
        for message in observation["events"]:
            said = self._reply(message, moment)
            if said is not None:
                return str(message["speaker"]), said
        return None

    def _reply(self, message: Mapping[str, Any], moment: Moment) -> str | None:
        text, speaker = str(message["text"]), str(message["speaker"])
        question = read_grammar().question_in(text, names=self.knows.me.names)
        if not self._is_meant(text, question, message, moment):
            return None
        count, since = self._answered.get(speaker, (0, moment.time))
        if moment.time - since > PATIENCE_FOR:
            count, since = 0, moment.time
        if count > PATIENCE:
            return None
        if count == PATIENCE:
            said: str | None = read_sentences().say("busy")
        else:
            heard = HeardMessage(float(message["time"]), speaker, text)
            said = self._talk.reply(heard, question, self.knows, moment)
        if said is not None:
            self._answered.pop(speaker, None)
            self._answered[speaker] = count + 1, since
        return said

    def _is_meant(self, text: str, question: Question | None, message: Mapping[str, Any], moment: Moment) -> bool:
        """Whether one is asked: by name, for oneself, or because one stands nearest to who asks nobody by name."""
        me = self.knows.me
        if question is None:
            called = "?" in text and is_called(me.name, text, gender=me.gender)
            return called and not self._calls_another(message, moment)
        if question.what and self.knows.is_me(question.what):
            return True
        if question.to.lower() in self._names:
            return not self._calls_another(message, moment)
        return not question.to and self._stands_nearest(message, moment)

    def _calls_another(self, message: Mapping[str, Any], moment: Moment) -> bool:
        """Whether another of the same name is meant, who stands nearer to who speaks."""
        bodies = () if moment.view is None else moment.view.within(2 * RANGE)
        return calls_somebody_nearer(message, moment.stands, bodies, self.knows.name_and_gender)

    def _stands_nearest(self, message: Mapping[str, Any], moment: Moment) -> bool:
        if moment.view is None:
            return False
        x, y = (float(value) for value in message["position"][:2])
        away = math.hypot(x - moment.stands[0], y - moment.stands[1])
        if away > NEAREST:
            return False
        others = (body for body in moment.view.within(2 * NEAREST) if body.kind == "resident")
        return not any(
            body.agent != message["speaker"] and math.hypot(x - body.position[0], y - body.position[1]) < away
            for body in others
        )


__all__ = ["NEAREST", "PATIENCE", "PATIENCE_FOR", "RANGE", "Talk", "Talker", "TemplateTalk"]
