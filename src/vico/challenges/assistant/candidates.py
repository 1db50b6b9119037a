"""Choosing what a task is about: nine candidates each time, and a chooser that picks one.

The chooser is a seeded draw, or a language model, which is told who asks and picks what fits them (paper, appendix).
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict

from vico.challenges.assistant.tasks import CANDIDATES
from vico.community.model import Resident
from vico.errors import LlmBudgetError, LlmReplyError, VicoError
from vico.llm import LanguageModel, Usage
from vico.llm.prompts import read_prompt
from vico.seeds import rng
from vico.world.model import Record


@dataclass(frozen=True)
class ChoiceQuestion:
    """What has to be settled.

    Attributes
    ----------
    text
        In words.
    category
        Of the task.
    requester
        Who asks; None where just that is the question.
    """

    text: str
    category: str
    requester: Resident | None = None


#: Given a question and the candidates' descriptions, the index of the one that is chosen.
Chooser = Callable[[ChoiceQuestion, Sequence[str]], int]


def seeded_chooser(rng: np.random.Generator) -> Chooser:
    """Return the offline chooser: any candidate, with equal chances."""
    return lambda question, candidates: int(rng.integers(len(candidates)))


class Choice(Record):
    """What was chosen of what."""

    chosen: int
    candidates: list[str]


def choose(question: ChoiceQuestion, candidates: Sequence[str], chooser: Chooser) -> Choice:
    """Put at most nine candidates to the chooser.

    Raises
    ------
    ValueError
        If the chooser names none of them.
    """
    put = list(candidates[:CANDIDATES])
    chosen = chooser(question, put)
    if not 0 <= chosen < len(put):
        raise ValueError(f"chooser: {chosen} is none of {len(put)} candidates for {question.text!r}")
    return Choice(chosen=chosen, candidates=put)


log = logging.getLogger(__name__)

_ROUNDS = 2  # how often a reply may be mended
_PATIENCE = 3  # questions in a row without an answer after which it is not asked any more

_KINDS = {
    "carry": "somebody who is out is found, hands things over, and is followed home with them",
    "delivery": "things are fetched from one place and brought to another",
    "deliver": "robots fetch a thing from one spot outdoors and bring it to another",
    "search": "a thing that was lost is looked for where it was lost",
}


class ChosenCandidate(BaseModel):
    """The index of one of the candidates, and why that one."""

    model_config = ConfigDict(extra="forbid")

    index: int
    reason: str


class ModelChooser:
    """Has a model choose, and falls back to a seeded draw question by question.

    Attributes
    ----------
    tokens, cost
        What was spent, US dollars.
    drawn
        For each question that the model did not settle: its number, from 0, and why.
    asked
        How many questions there were.
    """

    def __init__(self, model: LanguageModel, *, seed: int = 0) -> None:
        self._model, self._seed = model, seed
        self._prompt = read_prompt("assistant", "choice", ChosenCandidate)
        self._failed = 0
        self.tokens, self.cost = 0, 0.0
        self.drawn: list[tuple[int, str]] = []
        self.asked = 0

    def __call__(self, question: ChoiceQuestion, candidates: Sequence[str]) -> int:
        """Return the index of the candidate that is chosen."""
        number, self.asked = self.asked, self.asked + 1
        if len(candidates) == 1:
            return 0
        if self._failed >= _PATIENCE:
            self.drawn.append((number, "not asked: it gave no answer before"))
        elif (index := self._ask_choice(question, candidates, number)) is not None:
            return index
        chance = rng(self._seed, "model chooser", number)
        return seeded_chooser(chance)(question, candidates)

    def _ask_choice(self, question: ChoiceQuestion, candidates: Sequence[str], number: int) -> int | None:
        def check(reply: ChosenCandidate) -> list[str]:
            if 0 <= reply.index < len(candidates):
                return []
            return [f"index: {reply.index} is none of the candidates; give a number from 0 to {len(candidates) - 1}"]

        messages = self._prompt.messages(
            category=question.category,
            kind=_KINDS[question.category],
            requester=_resident_facts(question.requester),
            question=question.text,
            candidates=[{"index": k, "name": name} for k, name in enumerate(candidates)],
        )
        try:
            reply = self._model.ask(messages, ChosenCandidate, check=check, rounds=_ROUNDS, spent=self._spend)
        except VicoError as error:
            answered, spent = isinstance(error, LlmReplyError), isinstance(error, LlmBudgetError)
            self._failed = 0 if answered else _PATIENCE if spent else self._failed + 1
            self.drawn.append((number, str(error)))
            log.warning("task choice: drawn by the seed instead (%s): %s", question.text, error)
            return None
        self._failed = 0
        return reply.value.index

    def _spend(self, usage: Usage) -> None:
        self.tokens += usage.tokens
        self.cost += usage.cost


def llm_chooser(model: LanguageModel, *, seed: int = 0) -> ModelChooser:
    """Return a chooser that asks a model.

    What the model does not settle, because it or its server fails, is drawn by the seed; a warning in the log and
    `ModelChooser.drawn` say which questions those were.

    Parameters
    ----------
    model
        Whom to ask.
    seed
        Of the draws.
    """
    return ModelChooser(model, seed=seed)


def _resident_facts(who: Resident | None) -> dict[str, Any]:
    if who is None:
        return {}
    return {
        "name": who.name,
        "age": who.age,
        "occupation": who.occupation,
        "hobbies": list(who.hobbies),
        "values": list(who.values),
        "lifestyle": who.lifestyle,
    }
