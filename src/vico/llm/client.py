"""Ask a model for a record, and get one: retries, repair, budget, cache, recording."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Generic, TypeVar

from pydantic import BaseModel

from vico.errors import InputError, LlmReplyError
from vico.io.http import Backoff, with_retries
from vico.llm.budget import Budget, Usage
from vico.llm.prompts import Message, check_messages, data_block, tokens_of, user
from vico.llm.recording import Answer, Cache, CallRecorder, Replay, digest_of
from vico.llm.replies import Check, one_line, parse_reply, refusal_text, reply_text, response_format, schema_instruction
from vico.llm.transport import Connection, Endpoint, RequestError, post

T = TypeVar("T", bound=BaseModel)

_REFUSED = (400, 415, 422, 501)  # may be meant for a part of the request that we can do without
_FAILED = 500  # may be meant for a schema
# Statuses of keys and names, unless they speak of a part: routers look for a provider that takes it.
_ELSEWHERE = (401, 403, 404)
# Parts of a request that can be left out, the likeliest to be refused first.
_PARTS = ("response_format", "seed", "temperature", "max_tokens")
_MOST_QUOTED = 20_000  # characters of a bad reply that are shown to the model again
_THOUGHT_TOO_LONG = "the reply is empty: the model thought up to its limit; think less, or allow more tokens"
_HELD_BACK = "the provider's filter held the answer back: word the request differently, or ask another model"
_CUT = "the reply breaks off because it is too long: say it with fewer words and numbers"


@dataclass(frozen=True)
class Sampling:
    """How a model is to answer; sent along if given, and left out where the server refuses it.

    Attributes
    ----------
    seed
        Makes answers repeatable on servers that can.
    temperature
        0 = always the likeliest token; the server's own if None.
    max_tokens
        Longest answer, tokens; the server's own limit if None.
    """

    seed: int | None = None
    temperature: float | None = None
    max_tokens: int | None = None


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
    sampling
        How the model is to answer.
    connection
        How requests are sent.
    """

    def __init__(
        self,
        endpoint: Endpoint,
        *,
        cache: Path | None = None,
        budget: Budget | None = None,
        record: Path | None = None,
        replay: Path | None = None,
        sampling: Sampling = Sampling(),
        connection: Connection | None = None,
    ) -> None:
        self.endpoint = endpoint
        self.budget = budget or Budget()
        if self.budget.cost is not None and endpoint.price is None and replay is None:
            raise InputError("budget: the cost can be limited only where prices are known; set VICO_LLM_PRICE")
        self.connection = connection or Connection()
        self._options = asdict(sampling)
        self._cache = Cache(cache) if cache is not None else None
        self._recorder = CallRecorder(record, endpoint) if record is not None else None
        self._replay = Replay(replay) if replay is not None else None
        self._refused: set[str] = set()
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
        if replayed is None:
            return cls(Endpoint.from_environment(env), **options)
        # The endpoint the recording was made with, without its key: enough to replay it.
        replay = Replay(replayed)
        return cls(Endpoint(replay.base, replay.model), **options)

    @property
    def recorded(self) -> bool:
        """Whether calls are recorded or replayed, so that it matters in which order they are made."""
        return self._recorder is not None or self._replay is not None

    @property
    def replays(self) -> bool:
        """Whether all answers come from a recording."""
        return self._replay is not None

    @property
    def name(self) -> str:
        """The model and all that its answers hang on besides the questions, for a key: no secret is in it."""
        options = ", ".join(f"{key} {value}" for key, value in self._options.items() if value is not None)
        return f"{self.endpoint.model} at {self.endpoint.base}" + (f" ({options})" if options else "")

    def ask(
        self,
        messages: Sequence[Message],
        reply: type[T],
        *,
        check: Check[T] | None = None,
        rounds: int = 3,
        spent: Callable[[Usage], None] | None = None,
    ) -> Reply[T]:
        """Ask for a record.

        The record's JSON Schema goes along as ``response_format``; a server that refuses it gets the schema in words,
        and the last fitting JSON object in its reply is taken. A reply that is no such record goes back with what is
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
        spent
            Told what each answer took as it comes, those of no use too.

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
        said = check_messages(messages)
        kept = self._cached_reply(said, reply, check)
        if kept is not None:
            return kept
        used = Usage()
        turns = said
        findings: list[str] = []
        answer = Answer("", "", "", Usage())
        for attempt in range(1, rounds + 2):
            answer = self._answer(turns, reply)
            used += answer.usage
            if spent is not None:
                spent(answer.usage)
            if answer.refusal:
                what = _HELD_BACK if _is_filtered(answer.finish) else f"refuses: {answer.refusal[:300]}"
                raise _unusable(self.endpoint, what, [answer.refusal], answer.text)
            found = parse_reply(answer.text, reply, check)
            if found.value is not None:
                if self._cache is not None and self._replay is None:
                    self._cache.keep(self._cache.place(self.endpoint, self._whole(said, reply)), answer.text)
                return Reply(found.value, used, attempt)
            findings = found.findings
            if answer.finish == "length":
                findings = [_CUT if answer.text.strip() else _THOUGHT_TOO_LONG, *findings]
            turns = [*said, *self._repair(answer.text, findings, reply)]
        more = f" (and {len(findings) - 1} more)" if len(findings) > 1 else ""
        what = f"no usable reply in {rounds + 1}; the last: {findings[0]}{more}"
        raise _unusable(self.endpoint, what, findings, answer.text)

    def _cached_reply(self, said: list[Message], reply: type[T], check: Check[T] | None) -> Reply[T] | None:
        """Return the reply in the cache, if it is still good."""
        if self._cache is None or self._replay is not None:
            return None
        request = self._whole(said, reply)
        text = self._cache.text(self._cache.place(self.endpoint, request))
        found = parse_reply(text, reply, check) if text is not None else None
        if found is None or found.value is None or text is None:
            return None
        if self._recorder is not None:
            self._recorder.keep(request, Answer(text, "stop", "", Usage()), cached=True)
        return Reply(found.value, Usage(), 0)

    @staticmethod
    def _repair(text: str, findings: Sequence[str], reply: type[BaseModel]) -> list[Message]:
        """Return what is said after a bad reply: that reply alone, so that requests don't grow from round to round."""
        # They quote what was asked and said, so they are data, too.
        listed = data_block("findings", list(findings))
        turns = [user(f"This can't be used. What is wrong with it:\n{listed}\nMend it. {schema_instruction(reply)}")]
        return [{"role": "assistant", "content": text[:_MOST_QUOTED]}, *turns] if text.strip() else turns

    def _whole(self, said: Sequence[Message], reply: type[BaseModel]) -> dict[str, Any]:
        """Return the request with all its parts, whatever a server refuses of them: cache and recordings go by it."""
        request = {"model": self.endpoint.model, "messages": list(said), "response_format": response_format(reply)}
        return request | {name: value for name, value in self._options.items() if value is not None}

    def _request(self, said: Sequence[Message], reply: type[BaseModel]) -> dict[str, Any]:
        """Return the request, without what the server refuses."""
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
        """Return a record's schema, by digest: servers refuse some schemas and take others."""
        return f"response_format {digest_of(response_format(reply))[:16]}"

    def _answer(self, turns: Sequence[Message], reply: type[BaseModel]) -> Answer:
        """Return a server's answer, of any kind, within the budget."""
        if self._replay is not None:
            free = self._replay.cached_answer(self._whole(turns, reply))
            if free is not None:
                return free
        asked = self._with_price(Usage(1, tokens_of(turns), 0))
        self.budget.take(asked)
        try:
            answer = self._ask_server(turns, reply)
        except BaseException:
            self.budget.release(asked)
            raise
        self.budget.settle(asked, answer.usage)
        return answer

    def _ask_server(self, turns: Sequence[Message], reply: type[BaseModel]) -> Answer:
        """Return the answer, asked for without what the server turns out to refuse."""
        if self._replay is not None:
            return self._replay.answer(self._whole(turns, reply))
        tried: set[str] = set()
        retries = self.connection.retries
        while True:
            request = self._request(turns, reply)
            try:
                answer = self._read_answer(self._send(request, retries), tokens_of(turns))
                break
            except RequestError as error:
                part = self._to_leave_out(error, request, reply, tried)
                if error.status == _FAILED and not _refused_parts(error, request):
                    retries -= error.tries  # a server that fails all the same is not asked more often for it
                if part is None or retries < 0:
                    self._forget(tried)
                    raise error.for_people(self.endpoint) from None
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

    def _to_leave_out(
        self, error: RequestError, request: Mapping[str, Any], reply: type[BaseModel], tried: Collection[str]
    ) -> str | None:
        """Which part of a refused request to do without, that was not tried yet, or None."""
        if error.of_messages:
            return None
        likely = _refused_parts(error, request)
        if not likely and error.status == _FAILED:
            likely = ["response_format"]  # llama.cpp and others fail at a schema that they can't enforce
        elif not likely and (error.status in _REFUSED or (error.status == 404 and "parameters" in error.told)):
            likely = list(_PARTS)  # nothing is named, so it is guessed: schemas are refused most often
        elif error.status not in (*_REFUSED, _FAILED, *_ELSEWHERE):
            return None
        for name in likely:
            part = self._part(reply) if name == "response_format" else name
            if name in request and part not in tried:
                return part
        return None

    def _send(self, request: dict[str, Any], retries: int) -> dict[str, Any]:
        """Return the answer to a request that is sent as often as it takes, and sent again so many times at most."""
        how = self.connection
        failed = 0

        def send() -> dict[str, Any]:
            nonlocal failed
            try:
                return (how.transport or post)(self.endpoint, request, how.timeout)
            except RequestError as error:
                if error.status == _FAILED and _refused_parts(error, request):
                    error.transient = False  # no waiting helps
                elif error.transient and error.status == _FAILED and "response_format" in request:
                    # It may be the schema. Without such a word it is tried twice.
                    failed += 1
                    error.transient = failed < min(2, retries)
                raise

        return with_retries(send, backoff=Backoff(retries), sleep=how.sleep)

    def _read_answer(self, content: Mapping[str, Any], asked: int) -> Answer:
        """Return the parts of a completion that we use; anything else in it is ignored."""
        choices = content.get("choices")
        choice = choices[0] if isinstance(choices, list) and choices else None
        message = choice.get("message") if isinstance(choice, dict) else None
        if isinstance(choice, dict) and message is None and isinstance(choice.get("text"), str):
            message = {"content": choice["text"]}  # the older protocol of plain completions
        finish = str(choice.get("finish_reason") or "") if isinstance(choice, dict) else ""
        if isinstance(choice, dict) and message is None:
            message = {} if _is_filtered(finish) else choice.get("delta")  # of a stream, where a server sends it whole
        if not isinstance(choice, dict) or not isinstance(message, dict):
            raise RequestError("its answer is no chat completion: is VICO_LLM_BASE_URL the address up to /v1?")
        text = reply_text(message, finish)
        refusal = one_line(
            (refusal_text(message) if not text.strip() else "") or ("filtered" if _is_filtered(finish) else "")
        )
        counted = content.get("usage")
        counted = counted if isinstance(counted, dict) else {}
        usage = Usage(
            1, _count(counted.get("prompt_tokens"), asked), _count(counted.get("completion_tokens"), len(text) // 4)
        )
        return Answer(text, finish, refusal, self._with_price(usage))

    def _with_price(self, usage: Usage) -> Usage:
        if self.endpoint.price is None:
            return usage
        read, written = self.endpoint.price
        return replace(usage, cost=(usage.read * read + usage.written * written) / 1e6)


def _refused_parts(error: RequestError, request: Mapping[str, Any]) -> list[str]:
    """Parts of a request that a server's words name and that can be left out."""
    return [name for name in _PARTS if name in request and error.names(name)]


def _in_words(said: Sequence[Message], reply: type[BaseModel]) -> list[Message]:
    """Messages that ask for a schema in their last one: not every server takes a second system message."""
    *before, last = said
    words = schema_instruction(reply)
    content = last["content"]
    if isinstance(content, list):
        return [*before, {**last, "content": [*content, {"type": "text", "text": words}]}]
    return [*before, last if words in content else {**last, "content": f"{content}\n{words}"}]


def _is_filtered(finish: str) -> bool:
    """Whether a model was stopped by its provider's filter: ``content_filter``, ``content_filter: SAFETY``, ..."""
    return finish.lower().startswith(("content_filter", "safety", "prohibited_content", "blocklist", "spii"))


def _count(value: object, otherwise: int) -> int:
    sound = isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 1 << 40
    return value if sound and isinstance(value, int) else otherwise


def _unusable(endpoint: Endpoint, what: str, findings: Sequence[str], text: str) -> LlmReplyError:
    error = LlmReplyError(f"language model {endpoint.model}: {what}")
    error.findings, error.answer = tuple(findings), text
    return error
