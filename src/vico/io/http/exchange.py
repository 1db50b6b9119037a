"""One HTTP request and its answer, within bounds of time and size."""

from __future__ import annotations

import contextlib
import http.client
import math
import re
import socket
import ssl
import time
import urllib.error
import urllib.request
import zlib
from collections.abc import Iterator, Mapping
from email.message import Message
from email.utils import parsedate_to_datetime
from typing import IO, Any, NamedTuple
from urllib.parse import urlsplit

from vico.io.http.redaction import is_secret
from vico.version import __version__

USER_AGENT = f"virtual-community/{__version__} (vico; builds and simulates cities from map data)"

_RETRIED = (429, 500, 502, 503, 504)
_BLOCK = 1 << 16
_LONGEST_PAGE = 8000  # bytes of an error page that are read


class HttpRequest(NamedTuple):
    """What is sent."""

    method: str
    url: str
    headers: Mapping[str, str] = {}
    body: bytes | None = None


class Limits(NamedTuple):
    """How long and how much is waited for.

    Attributes
    ----------
    silence
        Longest time without a byte, seconds.
    total
        Longest time for the whole body, seconds.
    slowest
        Bytes a second: the time for the body grows by one second for each of these that came.
    max_bytes
        Longest body, bytes, once unpacked.
    redirects
        Whether redirects are followed: to http and https only, never from https to http, and no key goes along to
        another host.
    """

    silence: float = 30.0
    total: float = math.inf
    slowest: float = math.inf
    max_bytes: int = 256 << 20
    redirects: bool = True


class HttpError(Exception):
    """A request got no usable answer; the text says why, and may hold what was sent: `redaction` takes keys out.

    Attributes
    ----------
    status
        HTTP status; None without an answer.
    page
        The text of the server's error page, up to 8,000 bytes.
    retry_after
        Seconds the server asks to wait, or None.
    transient
        Whether another try may help.
    cause
        The exception of the connection, or None.
    tries
        How many requests were made, set by `with_retries`.
    """

    def __init__(
        self,
        what: str,
        *,
        status: int | None = None,
        page: str = "",
        retry_after: float | None = None,
        transient: bool = False,
        cause: object = None,
    ) -> None:
        super().__init__(what)
        self.status, self.page, self.retry_after = status, page, retry_after
        self.transient, self.cause, self.tries = transient, cause, 1


def send(request: HttpRequest, limits: Limits) -> tuple[int, bytes]:
    """Send a request, once.

    Returns
    -------
    int, bytes
        Status (200..299) and body, unpacked.

    Raises
    ------
    HttpError
        If there is no such answer within the limits.
    """
    headers = {"User-Agent": USER_AGENT, "Accept-Encoding": "gzip", "Connection": "close", **request.headers}
    try:
        sent = urllib.request.Request(request.url, data=request.body, headers=headers, method=request.method)
        with _opener(redirects=limits.redirects).open(sent, timeout=limits.silence) as response:
            return int(response.status), _body(response, limits)
    except urllib.error.HTTPError as error:
        with error:
            raise HttpError(
                _meaning(error.code),
                status=error.code,
                page=_page(error),
                retry_after=retry_after(error.headers),
                transient=error.code in _RETRIED,
            ) from None
    except (http.client.HTTPException, zlib.error, OSError) as error:
        reason = error.reason if isinstance(error, urllib.error.URLError) else error
        raise HttpError(_trouble(reason, limits.silence), transient=_may_pass(reason), cause=reason) from None


class _Redirects(urllib.request.HTTPRedirectHandler):
    """Follow redirects to http and https only, never from https to http, and take no key to another host."""

    max_redirections = 5

    def redirect_request(
        self, req: urllib.request.Request, fp: IO[bytes], code: int, msg: str, headers: Any, newurl: str
    ) -> urllib.request.Request | None:
        old, new = urlsplit(req.full_url), urlsplit(newurl)
        if new.scheme not in ("http", "https") or (old.scheme == "https" and new.scheme == "http"):
            raise HttpError(f"is redirected to a {new.scheme or 'nameless'} address, which is not followed")
        onward = super().redirect_request(req, fp, code, msg, headers, newurl)
        if onward is not None and (old.scheme, old.netloc) != (new.scheme, new.netloc):
            for name in [name for name in onward.headers if is_secret(name)]:
                onward.remove_header(name)
        return onward


def _opener(*, redirects: bool) -> urllib.request.OpenerDirector:
    """Make an opener of http and https alone: `build_opener` would add ftp, file and data addresses."""
    opener = urllib.request.OpenerDirector()
    for handler in (
        urllib.request.ProxyHandler(),
        urllib.request.HTTPHandler(),
        urllib.request.HTTPSHandler(),
        urllib.request.HTTPDefaultErrorHandler(),
        urllib.request.HTTPErrorProcessor(),
        urllib.request.UnknownHandler(),
        *([_Redirects()] if redirects else []),
    ):
        opener.add_handler(handler)
    opener.addheaders = []
    return opener


def _body(response: http.client.HTTPResponse, limits: Limits) -> bytes:
    """Read a body, unpacked, and no more than is allowed of it."""
    expected = response.headers.get("Content-Length", "")
    coding = response.headers.get("Content-Encoding", "identity").strip().lower()
    if coding not in ("gzip", "x-gzip", "identity", ""):
        raise HttpError(f"answers in the coding {coding[:20]!r}, which was not asked for")
    too_much = f"sends more than {limits.max_bytes:,} bytes"
    if expected.isdecimal() and int(expected) > limits.max_bytes:
        raise HttpError(f"{too_much} ({int(expected):,})")
    unpacker = _Gunzip() if coding in ("gzip", "x-gzip") else None
    pieces: list[bytes] = []
    size = got = 0
    began = time.monotonic()
    while block := response.read1(_BLOCK):
        got += len(block)
        if time.monotonic() - began > limits.total + got / limits.slowest:
            raise HttpError(f"sent {got:,} bytes in {time.monotonic() - began:.0f} s", transient=True)
        for piece in unpacker.pieces(block) if unpacker is not None else (block,):
            size += len(piece)
            if size > limits.max_bytes:
                raise HttpError(too_much)
            pieces.append(piece)
    if expected.isdecimal() and got != int(expected):
        raise HttpError(f"the answer breaks off at byte {got:,} of {int(expected):,}", transient=True)
    if unpacker is not None and not unpacker.complete:
        raise HttpError(f"the packed answer breaks off at byte {got:,}", transient=True)
    return b"".join(pieces)


class _Gunzip:
    """Unpacks gzip in small pieces, so that a bomb is noticed before it has gone off."""

    def __init__(self) -> None:
        self._unpacker = zlib.decompressobj(wbits=31)

    @property
    def complete(self) -> bool:
        return self._unpacker.eof

    def pieces(self, block: bytes) -> Iterator[bytes]:
        while block:
            yield self._unpacker.decompress(block, _BLOCK)
            block = self._unpacker.unconsumed_tail
            if self._unpacker.eof:
                block = self._unpacker.unused_data
                if block:  # gzip files may be several, one after the other
                    self._unpacker = zlib.decompressobj(wbits=31)


def retry_after(headers: Message) -> float | None:
    """Return the seconds to wait that ``Retry-After`` asks for, or None.

    It is a number, or a date, which is held against the server's own clock where it tells it.
    """
    value = (headers.get("Retry-After") or "").strip()
    if re.fullmatch(r"\d{1,9}(\.\d{1,6})?", value):
        return float(value)
    try:
        until = parsedate_to_datetime(value).timestamp()
        now = time.time()
        with contextlib.suppress(ValueError, TypeError, OverflowError):
            now = parsedate_to_datetime(headers.get("Date", "")).timestamp()
        return max(0.0, until - now)
    except (ValueError, TypeError, OverflowError):
        return None


def _page(response: IO[bytes]) -> str:
    try:
        return response.read(_LONGEST_PAGE).decode("utf-8", "replace")
    except (OSError, http.client.HTTPException):
        return ""


def _meaning(status: int) -> str:
    if status in (401, 403):
        return f"refuses ({status}): check the key or the rights"
    if status == 429:
        return "is asked too often (429): try again later"
    if status in (404, 410):
        return f"has nothing there ({status})"
    if status >= 500:
        return f"fails ({status}): try again later"
    if 300 <= status < 400:
        return f"redirects in a way that is not followed ({status})"
    return f"refuses the request ({status})"


def _may_pass(error: object) -> bool:
    """Return whether another try may help: no name, no listener and a bad certificate stay as they are."""
    lasting = (socket.gaierror, ConnectionRefusedError, ssl.SSLCertVerificationError, http.client.InvalidURL)
    return isinstance(error, BaseException) and not isinstance(error, lasting)


def _trouble(error: object, timeout: float) -> str:
    if isinstance(error, TimeoutError):
        return f"no answer within {timeout:g} s"
    if isinstance(error, socket.gaierror):
        return f"the host's name can't be resolved ({error.strerror}); is there a network?"
    if isinstance(error, ConnectionRefusedError):
        return "nobody listens there (connection refused)"
    if isinstance(error, ssl.SSLCertVerificationError):
        return f"its certificate is not to be trusted ({error.verify_message})"
    words = " ".join(str(error).split())[:200]
    return f"the connection fails ({type(error).__name__}{': ' if words else ''}{words})"
