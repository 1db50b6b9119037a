"""One request to a server and its answer: the only module that opens a connection.

Python's own HTTP client is enough for it: what an SDK would add (types of the protocol, its own retries) is either
not needed or has to be done here anyway, as sizes, times and what is told of a key are ours to answer for.
"""

from __future__ import annotations

import http.client
import json
import re
import socket
import ssl
import time
import urllib.error
import urllib.request
from collections.abc import Callable
from email.message import Message as Headers
from email.utils import parsedate_to_datetime
from typing import Any

from vico import __version__
from vico.errors import SourceError
from vico.llm.endpoint import Endpoint

MOST_BYTES = 8 << 20  # of an answer
_BLOCK = 1 << 16

#: Sends a request's body to an endpoint within so many seconds, gives the answer; raises `Trouble`. Swap it at will.
Transport = Callable[[Endpoint, dict[str, Any], float], dict[str, Any]]


class Trouble(Exception):
    """A request got no answer.

    Attributes
    ----------
    status
        HTTP status; 0 if there was none.
    passing
        Whether another try may help.
    wait
        Seconds the server asks to wait, or None.
    parameter
        The part of the request that the server names as the one it refuses, or "".
    """

    def __init__(
        self, what: str, *, status: int = 0, passing: bool = False, wait: float | None = None, parameter: str = ""
    ) -> None:
        super().__init__(what)
        self.status, self.passing, self.wait, self.parameter = status, passing, wait, parameter

    def error(self, endpoint: Endpoint, after: int) -> SourceError:
        """The same for a person, free of the key."""
        tries = f" (tried {after} times)" if after > 1 else ""
        words = f"language model at {endpoint.base}: {self}{tries}"
        made = SourceError(words.replace(endpoint.key, "***") if len(endpoint.key) > 3 else words)
        made.status = self.status or None
        return made


def _opener() -> urllib.request.OpenerDirector:
    """Of http and https, through the environment's proxy, without redirects: a key goes to the named host alone."""
    opener = urllib.request.OpenerDirector()
    for handler in (
        urllib.request.ProxyHandler(),
        urllib.request.HTTPHandler(),
        urllib.request.HTTPSHandler(),
        urllib.request.HTTPDefaultErrorHandler(),
        urllib.request.HTTPErrorProcessor(),
    ):
        opener.add_handler(handler)
    opener.addheaders = []
    return opener


def post(endpoint: Endpoint, body: dict[str, Any], timeout: float) -> dict[str, Any]:
    """Send a request, once.

    Parameters
    ----------
    timeout
        Seconds until the whole answer has to be there.

    Returns
    -------
    dict
        The answer, a JSON object without an ``error``.

    Raises
    ------
    Trouble
        If there is none.
    """
    headers = {
        "Content-Type": "application/json",
        "Accept": "application/json",
        "Accept-Encoding": "identity",
        "Connection": "close",
        "User-Agent": f"virtual-community/{__version__} (vico)",
    }
    if endpoint.key:
        headers["Authorization"] = f"Bearer {endpoint.key}"
    content = json.dumps(body, ensure_ascii=False).encode("utf-8", "replace")
    deadline = time.monotonic() + timeout
    try:
        request = urllib.request.Request(endpoint.url, data=content, headers=headers, method="POST")
        with _opener().open(request, timeout=timeout) as response:
            received = _whole(response, deadline, timeout)
    except urllib.error.HTTPError as error:
        with error:
            raise _refusal(error.code, _excerpt(error), error.headers, endpoint) from None
    except (http.client.HTTPException, OSError) as error:
        reason = error.reason if isinstance(error, urllib.error.URLError) else error
        raise _broken(reason, timeout) from None
    return _object(received, endpoint)


def _whole(response: http.client.HTTPResponse, deadline: float, timeout: float) -> bytes:
    expected = response.headers.get("Content-Length", "")
    too_much = Trouble(f"its answer has more than {MOST_BYTES:,} bytes; that is no completion")
    if expected.isdecimal() and int(expected) > MOST_BYTES:
        raise too_much
    received = bytearray()
    while block := response.read1(_BLOCK):
        received += block
        if len(received) > MOST_BYTES:
            raise too_much
        if time.monotonic() > deadline:
            raise Trouble(f"no whole answer within {timeout:g} s", passing=True)
    if expected.isdecimal() and len(received) != int(expected):
        raise Trouble(f"the answer breaks off at byte {len(received):,} of {int(expected):,}", passing=True)
    return bytes(received)


def _object(received: bytes, endpoint: Endpoint) -> dict[str, Any]:
    try:
        answer = json.loads(received)
    except (ValueError, RecursionError):
        answer = None
    if not isinstance(answer, dict):
        raise Trouble("it does not answer in JSON: is VICO_LLM_BASE_URL the address up to /v1?")
    if answer.get("error"):  # some routers say 200 and put the upstream's failure inside
        told = answer["error"] if isinstance(answer["error"], dict) else {"message": answer["error"]}
        code = told.get("code") or told.get("status")
        status = code if isinstance(code, int) and 400 <= code < 600 else 400
        raise _refusal(status, json.dumps({"error": told}), Headers(), endpoint)
    return answer


def _refusal(status: int, page: str, headers: Headers, endpoint: Endpoint) -> Trouble:
    message, code, parameter = _told(page)
    said = f" ({message})" if message else ""
    if status in (401, 403):
        key = "refuses the key" if endpoint.key else "wants a key"
        return Trouble(
            f"it {key} ({status}): set VICO_LLM_KEY to one that may use {endpoint.model}{said}", status=status
        )
    if status == 404:
        return Trouble(
            f"it has no such page, or no model {endpoint.model!r} (404): check VICO_LLM_BASE_URL, VICO_LLM_MODEL{said}",
            status=status,
        )
    if status == 429 and code == "insufficient_quota":
        return Trouble(f"the account has no quota left (429){said}", status=status)
    if 300 <= status < 400:
        return Trouble(
            f"it redirects ({status}), which is not followed: set VICO_LLM_BASE_URL to the final address", status=status
        )
    if status in (408, 409, 425, 429) or (status >= 500 and status != 501):
        what = "is asked too often" if status == 429 else "fails"
        return Trouble(
            f"it {what} ({status}){said}", status=status, passing=True, wait=_asked_wait(headers), parameter=parameter
        )
    return Trouble(f"it refuses the request ({status}){said}", status=status, parameter=parameter)


def _told(page: str) -> tuple[str, str, str]:
    """Message, code and parameter of an error page; its bare text where it is not the protocol's JSON."""
    try:
        found = json.loads(page)
    except (ValueError, RecursionError):
        found = None
    error = found.get("error", found) if isinstance(found, dict) else None
    if isinstance(error, dict):
        message = error.get("message") or error.get("detail") or ""
        code, parameter = str(error.get("code") or error.get("type") or ""), str(error.get("param") or "")
    else:
        message, code, parameter = error if isinstance(error, str) else re.sub(r"<[^>]*>", " ", page), "", ""
    words = " ".join("".join(c if c.isprintable() else " " for c in str(message)).split())
    return words[:300] + ("..." if len(words) > 300 else ""), code[:60], parameter[:60]


def _excerpt(error: urllib.error.HTTPError) -> str:
    try:
        return error.read(8000).decode("utf-8", "replace")
    except (OSError, http.client.HTTPException):
        return ""


def _asked_wait(headers: Headers) -> float | None:
    """Seconds, as ``Retry-After`` says: a number, or a date held against the server's own clock."""
    value = (headers.get("Retry-After") or "").strip()
    try:
        if re.fullmatch(r"\d{1,9}(\.\d{1,6})?", value):
            return float(value)
        until, now = parsedate_to_datetime(value), parsedate_to_datetime(headers.get("Date", ""))
        return max(0.0, until.timestamp() - now.timestamp())
    except (ValueError, TypeError, OverflowError):
        return None


def _broken(reason: object, timeout: float) -> Trouble:
    if isinstance(reason, TimeoutError):
        return Trouble(f"no answer within {timeout:g} s", passing=True)
    if isinstance(reason, socket.gaierror):
        return Trouble("the host's name can't be resolved: check VICO_LLM_BASE_URL, and whether there is a network")
    if isinstance(reason, ConnectionRefusedError):
        return Trouble("nobody listens there: is the server running, and VICO_LLM_BASE_URL right?")
    if isinstance(reason, ssl.SSLCertVerificationError):
        return Trouble(f"its certificate is not to be trusted ({reason.verify_message})")
    words = " ".join(str(reason).split())[:200]
    return Trouble(f"the connection breaks ({type(reason).__name__}{': ' if words else ''}{words})", passing=True)
