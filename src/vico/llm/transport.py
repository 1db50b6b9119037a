"""One request to a server and its answer, in the chat completions protocol; which server and which model.

The endpoint is named by the environment, never by a file that could be shared by mistake. Some servers stream whatever
they are asked: an event stream is put together to one completion. What an SDK would add to `vico.io.http` (types of the
protocol, retries of its own) is either not needed or has to be done here anyway, as sizes, times and what is told of a
key are ours to answer for.
"""

from __future__ import annotations

import json
import math
import os
import re
import socket
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import urlsplit

from vico.errors import InputError, SourceError
from vico.io.http import HttpError, HttpRequest, Limits, send

_OPENAI = "https://api.openai.com/v1"


@dataclass(frozen=True)
class Endpoint:
    """A server that speaks the chat completions protocol, and a model it serves.

    Attributes
    ----------
    base
        Address up to and with the version, such as ``http://127.0.0.1:8080/v1``, without a slash at its end.
    model
        Name of the model.
    key
        Sent as a bearer token; nothing is sent if empty. Never shown, recorded or cached.
    price
        Dollars a million tokens read, and written; None if unknown.

    Raises
    ------
    InputError
        If a part is unusable; the sentence names the variable that holds it.
    """

    base: str
    model: str
    key: str = field(default="", repr=False)
    price: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        try:
            parts = urlsplit(self.base)
            usable = parts.scheme in ("http", "https") and bool(parts.hostname) and (parts.port or 1) > 0
        except ValueError:
            usable = False
        if not usable or re.search(r"[\s\x00-\x1f\x7f]", self.base):
            raise InputError(
                "VICO_LLM_BASE_URL: not an http or https address; give one such as http://127.0.0.1:8080/v1"
            )
        if "@" in parts.netloc or parts.query or parts.fragment:
            raise InputError(
                "VICO_LLM_BASE_URL: must hold no user name, query or fragment; the key goes in VICO_LLM_KEY"
            )
        if not self.model or len(self.model) > 300 or not self.model.isprintable():
            raise InputError("VICO_LLM_MODEL: name the model that the server is to answer with")
        if not (self.key.isascii() and self.key.isprintable()) or " " in self.key:
            raise InputError("VICO_LLM_KEY: holds characters that no key has; copy it anew")
        if self.price is not None and not all(math.isfinite(p) and p >= 0 for p in self.price):
            raise InputError(f"VICO_LLM_PRICE: {self.price} are no prices")
        object.__setattr__(self, "base", self.base.rstrip("/"))

    @property
    def url(self) -> str:
        """Where completions are asked for."""
        return f"{self.base}/chat/completions"

    @classmethod
    def from_environment(cls, environ: Mapping[str, str] | None = None) -> Endpoint:
        """Read address, model, key and prices from the environment; `vico.llm` lists the variables.

        ``OPENAI_API_KEY`` goes to OpenAI and to ``OPENAI_BASE_URL`` only: another server must not learn it.

        Raises
        ------
        InputError
            If no server or no model is named, or one of them is unusable.
        """
        env = os.environ if environ is None else environ
        own, openai_base = env.get("VICO_LLM_BASE_URL", "").strip(), env.get("OPENAI_BASE_URL", "").strip()
        openai_key = env.get("OPENAI_API_KEY", "").strip()
        base = own or openai_base or (_OPENAI if openai_key else "")
        if not base:
            raise InputError(
                "no language model is named: set VICO_LLM_BASE_URL (such as http://127.0.0.1:8080/v1), VICO_LLM_MODEL, "
                "and VICO_LLM_KEY if the server wants a key"
            )
        key = env.get("VICO_LLM_KEY", "").strip()
        if not key and base.rstrip("/") in (_OPENAI, openai_base.rstrip("/")):
            key = openai_key
        return cls(base, env.get("VICO_LLM_MODEL", "").strip(), key, _price(env.get("VICO_LLM_PRICE", "").strip()))


def _price(text: str) -> tuple[float, float] | None:
    if not text:
        return None
    try:
        read, written = (float(part) for part in text.split(","))
    except ValueError:
        raise InputError(
            f"VICO_LLM_PRICE: {text[:40]!r}; give dollars a million tokens read and written, such as 0.15,0.60"
        ) from None
    return read, written


_WORDS = ("content", "reasoning_content", "reasoning", "refusal")


def completion_from_stream(text: str) -> tuple[dict[str, Any] | None, bool]:
    """Put the chunks of a stream together.

    Parameters
    ----------
    text
        Server-sent events, each with a chunk of a completion as its data; comments between them are skipped.

    Returns
    -------
    dict, bool
        The completion, or the first chunk with an ``error``, or None if the text is no such stream; and whether the
        stream came to its end.
    """
    message: dict[str, Any] = {}
    calls: dict[Any, dict[str, Any]] = {}
    finish, usage, ended, found = None, None, False, False
    for data in _events(text):
        if data.strip() == "[DONE]":
            ended = True
            break
        try:
            chunk = json.loads(data)
        except (ValueError, RecursionError):
            break  # cut in the middle
        if not isinstance(chunk, dict):
            return None, False
        if chunk.get("error"):
            return chunk, True
        found = True
        usage = chunk.get("usage") or usage
        choices = chunk.get("choices")
        choice = choices[0] if isinstance(choices, list) and choices else None
        if isinstance(choice, dict) and choice.get("index") in (None, 0):
            finish = choice.get("finish_reason") or finish
            delta = choice.get("delta") or choice.get("message") or {"content": choice.get("text")}
            if isinstance(delta, dict):
                _add(message, calls, delta)
    if not found:
        return None, False
    if calls:
        message["tool_calls"] = list(calls.values())
    made = {"choices": [{"index": 0, "message": message, "finish_reason": finish}], "usage": usage}
    return made, ended or finish is not None


def _events(text: str) -> list[str]:
    """Return the data of each event."""
    found: list[str] = []
    for event in re.split(r"\r?\n\r?\n|\r\r", text):
        lines = [line.removeprefix("data:") for line in re.split(r"[\r\n]+", event) if line.startswith("data:")]
        # One chunk a line, as the protocol has it; servers that leave out the blank lines between are read, too.
        found += lines if all(_is_whole(line) for line in lines) else ["\n".join(lines)]
    return found


def _is_whole(data: str) -> bool:
    return data.strip() == "[DONE]" or (data.strip().startswith("{") and data.strip().endswith("}"))


def _add(message: dict[str, Any], calls: dict[Any, dict[str, Any]], delta: Mapping[str, Any]) -> None:
    """Add a chunk's words and calls to what came before."""
    for name in _WORDS:
        more = delta.get(name)
        if isinstance(more, str):
            message[name] = message[name] + more if isinstance(message.get(name), str) else more
        elif isinstance(more, list):
            message[name] = [*message[name], *more] if isinstance(message.get(name), list) else more
    parts = delta.get("tool_calls")
    named = [(part.get("index", 0), part.get("function")) for part in parts or () if isinstance(part, dict)]
    for index, function in [*named, (None, delta.get("function_call"))]:
        if isinstance(function, dict):
            call = calls.setdefault(index, {"function": {"name": "", "arguments": ""}})["function"]
            call["name"] = function.get("name") or call["name"]
            more = function.get("arguments")
            call["arguments"] += more if isinstance(more, str) else json.dumps(more) if isinstance(more, dict) else ""


MAX_BYTES = 8 << 20  # of an answer
# How servers say that their filter refuses a request, and that it is longer than the model reads.
_FILTERED = re.compile(
    r"content[ _]?filter|content (?:management )?policy|content_policy|responsible_?ai|data_inspection|"
    r"content exists risk|input was flagged|safety (?:system|filter)",
    re.IGNORECASE,
)
_TOO_LONG = re.compile(
    r"context_length_exceeded|exceed_context_size|(?:prompt|input) is too long|too many (?:input |prompt )?tokens|"
    r"(?:exceed|maximum|longer|larger|greater|too (?:long|large|many)).{0,80}context|"
    r"context.{0,60}(?:exceed|too (?:long|small))|input token count.{0,60}exceeds",
    re.IGNORECASE | re.DOTALL,
)

#: Sends a request's body to an endpoint within so many seconds, gives the answer; raises `RequestError`.
Transport = Callable[[Endpoint, dict[str, Any], float], dict[str, Any]]


@dataclass(frozen=True)
class Connection:
    """How requests to a language model are sent.

    Attributes
    ----------
    timeout
        Seconds until an answer has to be there.
    retries
        How often a request is sent again after 429, 5xx, a silence or a broken connection.
    transport
        Sends a request; replace it to use another HTTP client. None: `post`.
    sleep
        Waits; tests replace it.
    """

    timeout: float = 120.0
    retries: int = 4
    transport: Transport | None = None
    sleep: Callable[[float], None] = time.sleep


class RequestError(HttpError):
    """A request to a language model got no answer.

    Attributes
    ----------
    parameter
        The part of the request that the server names as the one it refuses, or "".
    told
        The server's own words, without the model's name, which may be a word of the protocol.
    """

    parameter = ""
    told = ""

    @property
    def of_messages(self) -> bool:
        """Whether it is what was said that is refused: no part can be left out for it."""
        return self.parameter.startswith("messages")

    def names(self, part: str) -> bool:
        """Whether the server's words name a part of the request, in whatever way."""
        words = f"{self.parameter} {self.told or self}".lower()
        also = {"response_format": r"|json_?schema|grammar|guided|structured.?output|json_object|json.?mode"}
        return re.search(rf"(?<![a-z]){part}(?![a-z]){also.get(part, '')}", words) is not None

    def for_people(self, endpoint: Endpoint) -> SourceError:
        """Return the same as an error for a person, free of the key."""
        tries = f" (tried {self.tries} times)" if self.tries > 1 else ""
        if self.transient and self.retry_after is not None and self.retry_after > 1.0:
            tries += f"; it asks to wait {_duration(self.retry_after)}"
        words = f"language model at {endpoint.base}: {self}{tries}"
        made = SourceError(words.replace(endpoint.key, "***") if len(endpoint.key) > 3 else words)
        made.status = self.status
        return made


def _duration(seconds: float) -> str:
    """Return a time in the largest unit that it is two of, or a whole one."""
    for unit, length in (("hours", 3600.0), ("minutes", 60.0)):
        if seconds >= length:
            count = seconds / length
            return f"{count:.3g} {unit[:-1] if round(count, 2) == 1.0 else unit}"
    return f"{seconds:.0f} seconds"


def post(endpoint: Endpoint, body: dict[str, Any], timeout: float) -> dict[str, Any]:
    """Send a request, once. No redirect is followed: a key goes to the named host alone.

    Parameters
    ----------
    endpoint
        Where to, with which key.
    body
        The request, sent as JSON.
    timeout
        Seconds until the whole answer has to be there.

    Returns
    -------
    dict
        The answer, a JSON object without an ``error``.

    Raises
    ------
    RequestError
        If there is none.
    """
    headers = {"Content-Type": "application/json", "Accept": "application/json"}
    if endpoint.key:
        headers["Authorization"] = f"Bearer {endpoint.key}"
    content = json.dumps(body, ensure_ascii=False).encode("utf-8", "replace")
    request = HttpRequest("POST", endpoint.url, headers, content)
    try:
        _, received = send(request, Limits(timeout, timeout, max_bytes=MAX_BYTES, redirects=False))
    except HttpError as error:
        if error.status is not None:
            raise _refusal(error.status, error.page, endpoint, error.retry_after) from None
        raise RequestError(f"{error}{_hint(error.cause)}", transient=error.transient) from None
    # Routers that keep a connection open by comments send them before an answer that is no stream, too.
    text = re.sub(r"\A\s*(?::[^\n]*\n\s*)+", "", received.decode("utf-8-sig", "replace"))
    try:
        answer = json.loads(text)
    except (ValueError, RecursionError):
        answer, ended = completion_from_stream(text)
        if answer is not None and not ended:
            raise RequestError("its stream breaks off before the answer is whole", transient=True) from None
    if not isinstance(answer, dict):
        raise RequestError("it does not answer in JSON: is VICO_LLM_BASE_URL the address up to /v1?")
    if answer.get("error"):  # some routers say 200 and put the upstream's failure inside
        told = answer["error"] if isinstance(answer["error"], dict) else {"message": answer["error"]}
        code = told.get("code") or told.get("status")
        status = code if isinstance(code, int) and 400 <= code < 600 else 400
        raise _refusal(status, json.dumps({"error": told}), endpoint)
    return answer


def _hint(cause: object) -> str:
    if isinstance(cause, socket.gaierror):
        return " Check VICO_LLM_BASE_URL"
    if isinstance(cause, ConnectionRefusedError):
        return ": is the server running, and VICO_LLM_BASE_URL right?"
    return ""


def _refusal(status: int, page: str, endpoint: Endpoint, wait: float | None = None) -> RequestError:
    message, code, parameter = _error_details(page)
    said = f" ({message})" if message else ""
    transient = False
    about = f"{code} {message}"
    if status in (400, 403, 422, 500) and _FILTERED.search(about):
        what, parameter = (
            f"the provider's filter refuses what was asked ({status}): word it differently{said}",
            "messages",
        )
    elif status in (400, 413, 422, 500) and _TOO_LONG.search(about):
        what = f"the request is longer than the model reads ({status}): serve it with a larger context{said}"
        parameter = "messages"
    elif status in (401, 403):
        key = "refuses the key" if endpoint.key else "wants a key"
        what = f"it {key} ({status}): set VICO_LLM_KEY to one that may use {endpoint.model}{said}"
    elif status == 404:
        what = (
            f"it has no such page, or no model {endpoint.model!r} (404): check VICO_LLM_BASE_URL, VICO_LLM_MODEL{said}"
        )
    elif status == 429 and code == "insufficient_quota":
        what = f"the account has no quota left (429){said}"
    elif 300 <= status < 400:
        what = f"it redirects ({status}), which is not followed: set VICO_LLM_BASE_URL to the final address"
    elif status in (408, 409, 425, 429) or (status >= 500 and status != 501):
        what = f"it {'is asked too often' if status == 429 else 'fails'} ({status}){said}"
        transient = True
    else:
        what = f"it refuses the request ({status}){said}"
    error = RequestError(what, status=status, transient=transient, retry_after=wait)
    error.parameter = parameter
    error.told = re.sub(rf"(?<!\w){re.escape(endpoint.model)}(?!\w)", " ", message, flags=re.IGNORECASE)
    return error


def _error_details(page: str) -> tuple[str, str, str]:
    """Return message, code and parameter of an error page; its bare text where it is not the protocol's JSON."""
    try:
        found = json.loads(page)
    except (ValueError, RecursionError):
        found = None
    if isinstance(found, list) and found:  # a large provider's gateway puts the error in a list
        found = found[0]
    error = found.get("error", found) if isinstance(found, dict) else None
    if isinstance(error, dict):
        message = error.get("message") or error.get("detail") or error.get("msg") or ""
        code, parameter = str(error.get("code") or error.get("type") or ""), str(error.get("param") or "")
        if isinstance(message, list):  # FastAPI: where, and what is wrong there
            rows = [row for row in message if isinstance(row, dict)]
            ways = [".".join(str(part) for part in row.get("loc", ()) if part != "body") for row in rows]
            parameter = parameter or (ways[0] if ways else "")
            message = "; ".join(f"{way}: {row.get('msg', '')}" for way, row in zip(ways, rows, strict=True))
    else:
        message, code, parameter = error if isinstance(error, str) else re.sub(r"<[^>]*>", " ", page), "", ""
    words = " ".join("".join(c if c.isprintable() else " " for c in str(message)).split())
    return words[:300] + ("..." if len(words) > 300 else ""), code[:60], parameter[:60]
