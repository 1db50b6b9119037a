"""Ask a model for a record, and get one: retries, repair, budget, cache, recording."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Generic, TypeVar

from pydantic import BaseModel

from vico.errors import InputError, LlmReplyError
from vico.llm.budget import Budget, Usage
from vico.llm.endpoint import Endpoint
from vico.llm.messages import Message, checked, tokens_of, user
from vico.llm.recording import Answer, Cache, Recorder, Replay, digest_of, recorded_endpoint
from vico.llm.replies import Check, instruction, plain, read, response_format
from vico.llm.transport import Transport, Trouble, post

T = TypeVar("T", bound=BaseModel)

_FIRST_WAIT, _MOST_WAIT, _MOST_ASKED = 1.0, 60.0, 300.0  # seconds: back-off from, to; longest Retry-After obeyed
_REFUSED = (400, 415, 422, 501)  # may be meant for a part of the request that we can do without
_MOST_QUOTED = 20_000  # characters of a bad reply that are shown to the model again
_CUT = "the reply breaks off because it is too long: say it with fewer words and numbers"


@dataclass(frozen=True)
class Reply(Generic[T]):
    """A record from a model.

    Attributes
    ----------
    value
        The record, valid and accepted by the caller's check.
    usage
        What it took, repairs included; nothing if it came from the cache.
    attempts
        Answers it took: 1 if the first was good, 0 from the cache.
    """

    value: T
    usage: Usage
    attempts: int


class LanguageModel:
    """A model behind an OpenAI-compatible server. Threads may share one.

    Parameters
    ----------
    endpoint
        Server and model.
    cache
        Folder for accepted replies: the same question to the same model is asked once. None asks every time.
    budget
        Limits; may be shared with other models.
    record
        File to which every answer is appended as a line of JSON.
    replay
        Such a file: all answers come from it, in order for each request, and no connection is opened.
    timeout
        Seconds until an answer has to be there.
    retries
        How often a request is sent again after 429, 5xx, a silence or a broken connection.
    seed, temperature
        Sent along if given, and left out where the server refuses them.
    most_tokens
        Longest answer, tokens; the server's own limit if None.
    transport
        Sends a request; replace it to use another HTTP client.
    sleep
        Waits; tests replace it.
    """

    def __init__(
        self,
        endpoint: Endpoint,
        *,
        cache: Path | None = None,
        budget: Budget | None = None,
        record: Path | None = None,
        replay: Path | None = None,
        timeout: float = 120.0,
        retries: int = 4,
        seed: int | None = None,
        temperature: float | None = None,
        most_tokens: int | None = None,
        transport: Transport = post,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.endpoint = endpoint
        self.budget = budget or Budget()
        if self.budget.cost is not None and endpoint.price is None and replay is None:
            raise InputError("budget: the cost can be limited only where prices are known; set VICO_LLM_PRICE")
        self.timeout, self.retries = timeout, retries
        self._options = {"seed": seed, "temperature": temperature, "max_tokens": most_tokens}
        self._cache = Cache(cache) if cache is not None else None
        self._recorder = Recorder(record, endpoint) if record is not None else None
        self._replay = Replay(replay) if replay is not None else None
        self._refused: set[str] = set()
        self._transport, self._sleep = transport, sleep
        self._lock = threading.Lock()

    @classmethod
    def from_environment(cls, environ: Mapping[str, str] | None = None, **options: Any) -> LanguageModel:
        """Make one from the variables that `vico.llm` lists; `options` are those of the class and win over them.

        Raises
        ------
        InputError, MissingFileError, SchemaError
            If a variable is missing or unusable.
        """
        env = os.environ if environ is None else environ
        for option, variable in (("record", "VICO_LLM_RECORD"), ("replay", "VICO_LLM_REPLAY")):
            if env.get(variable):
                options.setdefault(option, Path(env[variable]))
        replayed = options.get("replay")
        endpoint = recorded_endpoint(replayed) if replayed is not None else Endpoint.from_environment(env)
        return cls(endpoint, **options)

    @property
    def recorded(self) -> bool:
        """Whether calls are recorded or replayed, so that it matters in which order they are made."""
        return self._recorder is not None or self._replay is not None

    @property
    def name(self) -> str:
        """The model and all that its answers hang on besides the questions, for a key: no secret is in it."""
        options = ", ".join(f"{key} {value}" for key, value in self._options.items() if value is not None)
        return f"{self.endpoint.model} at {self.endpoint.base}" + (f" ({options})" if options else "")

    def ask(
        self, messages: Sequence[Message], reply: type[T], *, check: Check[T] | None = None, rounds: int = 3
    ) -> Reply[T]:
        """Ask for a record.

        The record's JSON Schema goes along as ``response_format``; a server that refuses it gets the schema in words,
        and the first fitting JSON object in its reply is taken. A reply that is no such record goes back with what is
        wrong, field by field.

        Parameters
        ----------
        messages
            What to say, made by `vico.llm.system` and `vico.llm.user`.
        reply
            The record; read strictly.
        check
            Says what else is wrong with a record, one sentence each; an empty list accepts it.
        rounds
            How often a bad reply may be repaired.

        Returns
        -------
        Reply
            The record, and what it took.

        Raises
        ------
        LlmReplyError
            If the last reply is still bad (`findings` says why), or the model refuses.
        LlmBudgetError
            If the budget is spent.
        SourceError
            If the server refuses, or fails or is silent after all retries; `status` is its last HTTP status.
        InputError
            If the messages are unusable, or the recording that is replayed holds no answer.
        """
        said = checked(messages)
        kept = self._kept(said, reply, check)
        if kept is not None:
            return kept
        used = Usage()
        turns = said
        findings: list[str] = []
        answer = Answer("", "", "", Usage())
        for attempt in range(1, rounds + 2):
            answer = self._answer(turns, reply)
            used += answer.usage
            if answer.refusal:
                raise _unusable(self.endpoint, f"refuses: {answer.refusal[:300]}", [answer.refusal], answer.text)
            found = read(answer.text, reply, check)
            if found.value is not None:
                if self._cache is not None and self._replay is None:
                    self._cache.keep(self._cache.place(self.endpoint, self._whole(said, reply)), answer.text)
                return Reply(found.value, used, attempt)
            findings = [_CUT, *found.findings] if answer.finish == "length" else found.findings
            turns = [*said, *self._repair(answer.text, findings, reply)]
        more = f" (and {len(findings) - 1} more)" if len(findings) > 1 else ""
        what = f"no usable reply in {rounds + 1}; the last: {findings[0]}{more}"
        raise _unusable(self.endpoint, what, findings, answer.text)

    def _kept(self, said: list[Message], reply: type[T], check: Check[T] | None) -> Reply[T] | None:
        """The reply in the cache, if it is still good."""
        if self._cache is None or self._replay is not None:
            return None
        request = self._whole(said, reply)
        text = self._cache.text(self._cache.place(self.endpoint, request))
        found = read(text, reply, check) if text is not None else None
        if found is None or found.value is None or text is None:
            return None
        if self._recorder is not None:
            self._recorder.keep(request, Answer(text, "stop", "", Usage()), cached=True)
        return Reply(found.value, Usage(), 0)

    @staticmethod
    def _repair(text: str, findings: Sequence[str], reply: type[BaseModel]) -> list[Message]:
        """What is said after a bad reply: that reply alone, so that requests don't grow from round to round."""
        listed = "\n".join(f"- {finding}" for finding in findings)
        turns = [user(f"This can't be used:\n{listed}\nMend it. {instruction(reply)}")]
        return [{"role": "assistant", "content": text[:_MOST_QUOTED]}, *turns] if text.strip() else turns

    def _whole(self, said: Sequence[Message], reply: type[BaseModel]) -> dict[str, Any]:
        """The request with all its parts, whatever a server refuses of them: cache and recordings go by it."""
        request = {"model": self.endpoint.model, "messages": list(said), "response_format": response_format(reply)}
        return request | {name: value for name, value in self._options.items() if value is not None}

    def _request(self, said: Sequence[Message], reply: type[BaseModel]) -> dict[str, Any]:
        """The request, without what the server refuses."""
        request = self._whole(said, reply)
        if self._part(reply) in self._refused:
            del request["response_format"]
            request["messages"] = _in_words(said, reply)
        for name in ("seed", "temperature"):
            if name in self._refused:
                request.pop(name, None)
        if "max_tokens" in self._refused and "max_tokens" in request:
            request["max_completion_tokens"] = request.pop("max_tokens")
        return request

    @staticmethod
    def _part(reply: type[BaseModel]) -> str:
        """A record's schema, by digest: servers refuse some schemas and take others."""
        return f"response_format {digest_of(response_format(reply))[:16]}"

    def _answer(self, turns: Sequence[Message], reply: type[BaseModel]) -> Answer:
        """A server's answer, of any kind, within the budget."""
        if self._replay is not None:
            free = self._replay.cached(self._whole(turns, reply))
            if free is not None:
                return free
        asked = self._priced(Usage(1, tokens_of(turns), 0))
        self.budget.take(asked)
        try:
            answer = self._told(turns, reply)
        except BaseException:
            self.budget.release(asked)
            raise
        self.budget.settle(asked, answer.usage)
        return answer

    def _told(self, turns: Sequence[Message], reply: type[BaseModel]) -> Answer:
        """The answer, asked for without what the server turns out to refuse."""
        if self._replay is not None:
            return self._replay.answer(self._whole(turns, reply))
        tried: set[str] = set()
        while True:
            request = self._request(turns, reply)
            try:
                answer = self._read_answer(self._sent(request), tokens_of(turns))
                break
            except Trouble as trouble:
                part = self._to_leave_out(trouble, request, reply)
                if part is None or part in tried:
                    self._forget(tried)
                    raise trouble.error(self.endpoint, 1) from None
                tried.add(part)
                with self._lock:
                    self._refused.add(part)
            except BaseException:
                self._forget(tried)
                raise
        if self._recorder is not None:
            self._recorder.keep(self._whole(turns, reply), answer, cached=False)
        return answer

    def _forget(self, tried: set[str]) -> None:
        """Take back a guess at what the server refuses: the request failed without it just the same."""
        with self._lock:
            self._refused -= tried

    def _to_leave_out(self, trouble: Trouble, request: Mapping[str, Any], reply: type[BaseModel]) -> str | None:
        """Which part of a refused request to do without, or None."""
        if trouble.status not in _REFUSED or trouble.parameter.startswith("messages"):
            return None
        for name in ("temperature", "seed", "max_tokens"):
            if name in request and (trouble.parameter == name or f"'{name}'" in str(trouble)):
                return name
        return self._part(reply) if "response_format" in request else None

    def _sent(self, request: dict[str, Any]) -> dict[str, Any]:
        """The answer to a request that is sent as often as it takes."""
        for attempt in range(self.retries + 1):
            try:
                return self._transport(self.endpoint, request, self.timeout)
            except Trouble as trouble:
                wait = min(_FIRST_WAIT * 2.0**attempt, _MOST_WAIT) if trouble.wait is None else trouble.wait
                if not trouble.passing and trouble.status in _REFUSED:
                    raise
                if not trouble.passing or attempt == self.retries or wait > _MOST_ASKED:
                    raise trouble.error(self.endpoint, attempt + 1) from None
                self._sleep(wait)
        raise AssertionError("the last try returns or raises")

    def _read_answer(self, content: Mapping[str, Any], asked: int) -> Answer:
        """The parts of a completion that we use; anything else in it is ignored."""
        choices = content.get("choices")
        choice = choices[0] if isinstance(choices, list) and choices else None
        message = choice.get("message") if isinstance(choice, dict) else None
        if not isinstance(choice, dict) or not isinstance(message, dict):
            raise Trouble("its answer is no chat completion: is VICO_LLM_BASE_URL the address up to /v1?")
        text = message.get("content")
        if isinstance(text, list):  # parts, as some servers send them
            text = "".join(str(p.get("text", "")) for p in text if isinstance(p, dict) and p.get("type") == "text")
        text = text.encode("utf-8", "replace").decode() if isinstance(text, str) else ""  # lone surrogates
        finish = str(choice.get("finish_reason") or "")
        refusal = plain(str(message.get("refusal") or ("filtered" if finish == "content_filter" else "")))
        counted = content.get("usage")
        counted = counted if isinstance(counted, dict) else {}
        usage = Usage(
            1, _count(counted.get("prompt_tokens"), asked), _count(counted.get("completion_tokens"), len(text) // 4)
        )
        return Answer(text, finish, refusal, self._priced(usage))

    def _priced(self, usage: Usage) -> Usage:
        if self.endpoint.price is None:
            return usage
        read, written = self.endpoint.price
        return replace(usage, cost=(usage.read * read + usage.written * written) / 1e6)


def _in_words(said: Sequence[Message], reply: type[BaseModel]) -> list[Message]:
    """Messages that ask for a schema in their last one: not every server takes a second system message."""
    *before, last = said
    words = instruction(reply)
    content = last["content"]
    if isinstance(content, list):
        return [*before, {**last, "content": [*content, {"type": "text", "text": words}]}]
    return [*before, last if words in content else {**last, "content": f"{content}\n{words}"}]


def _count(value: object, otherwise: int) -> int:
    sound = isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 1 << 40
    return value if sound and isinstance(value, int) else otherwise


def _unusable(endpoint: Endpoint, what: str, findings: Sequence[str], text: str) -> LlmReplyError:
    error = LlmReplyError(f"language model {endpoint.model}: {what}")
    error.findings, error.answer = tuple(findings), text
    return error
