"""Agents that ask a language model: what they spend, and how they go on when it gives nothing.

No failure of a server or a model ends an episode. Each is noted in `ModelAccess.faults`, which results show as faults
of the kind ``model``, so that a table tells how far a method was its model's.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, TypeVar

from pydantic import BaseModel

from vico.agents.base import FieldState
from vico.errors import InputError, LlmBudgetError, LlmReplyError, SourceError, VicoError
from vico.llm import Connection, LanguageModel, Sampling, Usage
from vico.llm.prompts import Prompt
from vico.llm.replies import Check

T = TypeVar("T", bound=BaseModel)

#: Names the most tokens that one agent may use in an episode.
TOKENS_VARIABLE = "VICO_LLM_EPISODE_TOKENS"

_SETUP = (401, 403, 404)  # statuses that no waiting mends
_PATIENCE = 3  # questions in a row that a server may fail at before it is left alone
_ROUNDS = 2  # how often a reply may be mended
_MOST_DETAIL = 240
# A world waits for the answer: there are many questions, and each is short.
_CONNECTION = Connection(timeout=120.0, retries=2)
_SAMPLING = Sampling(seed=0, temperature=0.0, max_tokens=1500)


def model_from_environment(*, method: str) -> LanguageModel:
    """Return the model that the environment names (see `vico.llm`): the same one for all agents of this process.

    Parameters
    ----------
    method
        What it is for, for errors.

    Raises
    ------
    InputError, MissingFileError, SchemaError
        If none is named, or it can't be used.
    """
    named = tuple(sorted((key, value) for key, value in os.environ.items() if key.startswith(("VICO_LLM_", "OPENAI_"))))
    try:
        return _shared_model(named)
    except InputError as error:
        raise InputError(f"method {method}: {error}") from None


@lru_cache(maxsize=1)
def _shared_model(named: tuple[tuple[str, str], ...]) -> LanguageModel:
    return LanguageModel.from_environment(dict(named), connection=_CONNECTION, sampling=_SAMPLING)


def episode_tokens(environ: Mapping[str, str] | None = None) -> int | None:
    """Return the most tokens that the environment lets an agent use in an episode; None for no limit.

    Raises
    ------
    InputError
        If it is no such number.
    """
    text = (os.environ if environ is None else environ).get(TOKENS_VARIABLE, "").strip()
    if not text:
        return None
    if not text.isdecimal() or len(text) > 12:
        raise InputError(f"{TOKENS_VARIABLE}: {text[:40]!r}; give a whole number, such as 200000")
    return int(text)


class ModelAccess(FieldState):
    """Asks a model for one agent.

    Parameters
    ----------
    model
        Whom to ask; may be shared.
    limit
        Most tokens; None for no limit. The last answer may pass it.

    Attributes
    ----------
    tokens, cost
        What was spent, US dollars.
    faults
        Each time there was no usable reply: the step, and why.
    over
        Why nobody is asked any more; empty while the model answers.
    """

    tokens: int = 0
    cost: float = 0.0
    faults: list[tuple[int, str]]
    over: str = ""
    _failed: int = 0  # questions in a row

    def __init__(self, model: LanguageModel, *, limit: int | None = None) -> None:
        self.model, self.limit = model, limit
        self.faults = []

    def ask(
        self, prompt: Prompt, reply: type[T], inputs: Mapping[str, Any], *, step: int, check: Check[T] | None = None
    ) -> T | None:
        """Return a record from the model; None, with a fault noted, where there is no usable one.

        Parameters
        ----------
        inputs
            Of the prompt.
        step
            Of the episode, for the note.
        check
            Says what is wrong with a record; it is asked for again with that, twice at most.
        """
        if not self.over and self.limit is not None and self.tokens >= self.limit:
            self.over = f"all {self.limit:,} tokens of {TOKENS_VARIABLE} are spent"
        if self.over:
            self.note(step, f"not asked: {self.over}")
            return None
        try:
            found = self.model.ask(prompt.messages(**inputs), reply, check=check, rounds=_ROUNDS, spent=self._spend)
        except VicoError as error:
            self._note_error(error, step)
            return None
        self._failed = 0
        return found.value

    def note(self, step: int, why: str) -> None:
        """Note that the agent went on without its model."""
        self.faults.append((step, why[:_MOST_DETAIL]))

    def _spend(self, usage: Usage) -> None:
        self.tokens += usage.tokens
        self.cost += usage.cost

    def _note_error(self, error: VicoError, step: int) -> None:
        """Note an error, and whether it is of any use to ask on."""
        if isinstance(error, LlmReplyError):
            self._failed = 0
        elif isinstance(error, SourceError) or self.model.replays:
            # What was not answered when calls were recorded is not in the recording.
            self._failed += 1
        if isinstance(error, LlmBudgetError) or (isinstance(error, SourceError) and error.status in _SETUP):
            self.over = str(error)
        elif self._failed >= _PATIENCE:
            self.over = f"it failed {_PATIENCE} times in a row, the last time: {error}"
        self.note(step, str(error))
