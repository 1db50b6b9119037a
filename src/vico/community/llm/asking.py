"""Many questions to a model at a time, and drafts that are mended in rounds; the order of replies changes nothing."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from pydantic import BaseModel

from vico.community.authorship import Origin
from vico.errors import InputError, LlmBudgetError, LlmReplyError, SourceError
from vico.llm import LanguageModel, Message
from vico.llm.prompts import Prompt

T = TypeVar("T", bound=BaseModel)

#: Called with how many questions of a stage are done, and of how many.
Progress = Callable[[str, int, int], None]

_SETUP = (401, 403, 404)  # statuses that no waiting mends
_PATIENCE = 3  # questions in a row that a server may fail at before it is left alone
_MOST_DETAIL = 240


@dataclass
class Draft(Generic[T]):
    """A question, and what came of it.

    Attributes
    ----------
    item
        What is asked for, such as ``household_2``.
    prompt
        The words it is asked with.
    messages
        The question; findings of a draft are added.
    reply
        The record that has to come back.
    value
        The last reply, whether accepted or not; None if there is none.
    origin
        `Origin.WRITTEN` once it is accepted, else why it is not.
    detail
        More of why: the same whenever the same replies come.
    told
        The same for people, with the server's own words.
    """

    item: str
    prompt: Prompt
    messages: list[Message]
    reply: type[T]
    value: T | None = None
    origin: Origin = Origin.NO_ANSWER
    detail: str = ""
    told: str = ""
    findings: list[str] = field(default_factory=list)


#: Says what is wrong with a draft, a sentence each; called in the order of the drafts, never in parallel.
Judge = Callable[[Draft[T]], list[str]]


class ModelDesk:
    """Asks a model for drafts, some at a time, and has them mended.

    Parameters
    ----------
    model
        Whom to ask.
    workers
        Questions under way at a time.
    rounds
        How often a draft may be mended for what its judge finds; a reply that is no such record is mended by the
        client as often.
    progress
        Told how far things are.

    Attributes
    ----------
    over
        Why nobody is asked any more; empty while the model answers.
    answers
        Replies that came, from the cache or a recording, too.
    """

    def __init__(
        self, model: LanguageModel, *, workers: int = 4, rounds: int = 2, progress: Progress = lambda *_: None
    ) -> None:
        if workers < 1:
            raise InputError(f"community build: {workers} questions at a time; ask for at least 1")
        self.model, self.workers, self.rounds = model, workers, rounds
        self.over = ""
        self.answers = 0
        self._progress = progress
        self._failed = 0  # questions in a row
        self._lock = threading.Lock()

    def settle(self, stage: str, drafts: Sequence[Draft[T]], judge: Judge[T]) -> None:
        """Ask for drafts until each is accepted or its rounds are used up; the result stands in them.

        All that are asked at a time are judged one after the other once their replies are there, so that it does not
        matter which came first.
        """
        waiting = list(drafts)
        for turn in range(self.rounds + 1):
            asked = waiting
            self._ask_all(stage, asked, turn)
            waiting = []
            for draft in asked:
                if draft.value is None or draft.origin is not Origin.WRITTEN:
                    continue
                draft.findings = judge(draft)
                if draft.findings:
                    draft.origin, draft.detail = Origin.NOT_GROUNDED, draft.findings[0][:_MOST_DETAIL]
                    draft.told = draft.detail
                    draft.messages = [
                        *draft.messages[:2],
                        *draft.prompt.mending(draft.value.model_dump_json(), draft.findings),
                    ]
                    waiting.append(draft)
            if not waiting:
                return

    def _ask_all(self, stage: str, drafts: Sequence[Draft[T]], turn: int) -> None:
        name = stage if turn == 0 else f"{stage}, mended"
        done = 0
        self._progress(name, 0, len(drafts))
        with ThreadPoolExecutor(self.workers) as pool:
            waiting = [pool.submit(self._ask, draft) for draft in drafts]
            try:
                for one in waiting:
                    one.result()
                    done += 1
                    self._progress(name, done, len(drafts))
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise

    def _ask(self, draft: Draft[T]) -> None:
        """Ask one question and note what came, or why nothing did."""
        if self.over:
            self._unanswered(draft, self.over)
            return
        try:
            reply = self.model.ask(draft.messages, draft.reply, rounds=self.rounds)
        except LlmReplyError as error:
            self._heard()
            if draft.origin is not Origin.NOT_GROUNDED:
                draft.origin = Origin.UNUSABLE
                draft.detail = (error.findings[0] if error.findings else "")[:_MOST_DETAIL]
            draft.told = str(error)
        except LlmBudgetError as error:
            self._give_up(draft, str(error))
        except SourceError as error:
            with self._lock:
                self._failed += 1
                hopeless = error.status in _SETUP or self._failed >= _PATIENCE
            if hopeless:
                self._give_up(draft, str(error))
            else:
                self._unanswered(draft, str(error))
        except InputError as error:
            if not self.model.replays:
                raise
            # What the server did not answer when the calls were recorded is not in the recording.
            self._unanswered(draft, str(error))
        else:
            self._heard()
            draft.value, draft.origin, draft.detail, draft.told = reply.value, Origin.WRITTEN, "", ""

    def _heard(self) -> None:
        with self._lock:
            self._failed = 0
            self.answers += 1

    def _give_up(self, draft: Draft[Any], why: str) -> None:
        with self._lock:
            self.over = self.over or why
        self._unanswered(draft, why)

    @staticmethod
    def _unanswered(draft: Draft[Any], why: str) -> None:
        if draft.origin is not Origin.NOT_GROUNDED:
            draft.origin = Origin.NO_ANSWER
        draft.told = why
