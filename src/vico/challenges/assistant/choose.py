"""Choosing what a task is about: nine candidates each time, and somebody who picks one.

Who picks is a function, so that a language model can take the seeded choice's place (paper, appendix: place and
object selection).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from vico.challenges.assistant.thresholds import CANDIDATES
from vico.community.model import Resident
from vico.world.model import Record


@dataclass(frozen=True)
class Question:
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
Chooser = Callable[[Question, Sequence[str]], int]


def seeded_chooser(rng: np.random.Generator) -> Chooser:
    """Return the offline chooser: any candidate, with equal chances."""
    return lambda question, candidates: int(rng.integers(len(candidates)))


class Choice(Record):
    """What was chosen of what."""

    chosen: int
    candidates: list[str]


def choose(question: Question, candidates: Sequence[str], chooser: Chooser) -> Choice:
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
