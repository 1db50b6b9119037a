"""HTTP, politely: one exchange with its bounds, retries with back-off, and a client with a cache on top of both.

It stands on Python's own `urllib`. The libraries that were held against it (requests, urllib3, httpx) would bring
connection pools that we do not need, and leave to us what this module is about: redirects to http and https alone that
take no key to another host, answers bounded in size after unpacking and in time, `Retry-After` obeyed up to a bound,
environment proxies (urllib3), errors free of keys, and no cached errors.
"""

from __future__ import annotations

import contextlib
import hashlib
import html
import http.client
import logging
import math
import re
import socket
import ssl
import threading
import time
import urllib.error
import urllib.request
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from email.message import Message
from email.utils import parsedate_to_datetime
from pathlib import Path
from typing import IO, Any, NamedTuple, TypeVar
from urllib.parse import parse_qsl, quote, urlencode, urlsplit, urlunsplit

from vico.errors import InputError, SourceError
from vico.io.files import write_bytes
from vico.version import __version__

__all__ = [
    "MAX_BYTES",
    "USER_AGENT",
    "Backoff",
    "HttpClient",
    "HttpError",
    "HttpRequest",
    "Limits",
    "T",
    "Validate",
    "form_without_secrets",
    "is_secret",
    "log",
    "redact",
    "retry_after",
    "secrets_in",
    "send",
    "with_retries",
    "without_secrets",
]
# Names of keys, and not of a place search's `keyword`.
_SECRET = re.compile(
    r"(^|[-_])(key|token|secret|session|sessionid|signature|sig|pass|password|auth|credential)$"
    r"|apikey|accesstoken|authori[sz]ation|cookie",
    re.IGNORECASE,
)


def is_secret(name: str) -> bool:
    """Return whether a header or parameter of this name holds a key."""
    return _SECRET.search(name) is not None


def without_secrets(url: str, instead: str | None = None) -> str:
    """Return the address without the values of its keys: left out, or replaced."""
    head, mark, query = url.partition("?")
    pairs = [pair.partition("=") for pair in query.split("&")]
    kept: list[str] = []
    for name, equals, value in pairs:
        if not is_secret(name):
            kept.append(f"{name}{equals}{value}")
        elif instead is not None:
            kept.append(f"{name}={instead}")
    return head + mark + "&".join(kept)


def form_without_secrets(body: bytes | None, headers: Mapping[str, str]) -> bytes:
    """Return a body without its keys, where it is a form."""
    if body is None or not _is_form(headers):
        return body or b""
    return b"&".join(p for p in body.split(b"&") if not is_secret(p.partition(b"=")[0].decode("utf-8", "replace")))


def secrets_in(url: str, headers: Mapping[str, str], body: bytes | None) -> list[str]:
    """Return the values of the keys that a request holds."""
    pairs = [*parse_qsl(urlsplit(url).query), *headers.items()]
    if _is_form(headers):
        pairs += parse_qsl((body or b"").decode("utf-8", "replace"))
    return [value for name, value in pairs if is_secret(name)]


def redact(text: str, secrets: Iterable[str]) -> str:
    """Return a text with keys of four characters and more replaced by ``***``, also where they are quoted."""
    for secret in sorted({s for s in secrets if len(s) > 3}, key=lambda s: (-len(s), s)):
        for form in (secret, quote(secret), quote(secret, safe=""), html.escape(secret)):
            text = text.replace(form, "***")
    return text


def _is_form(headers: Mapping[str, str]) -> bool:
    return any(k.lower() == "content-type" and "x-www-form-urlencoded" in v for k, v in headers.items())


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


log = logging.getLogger(__name__)

T = TypeVar("T")


class Backoff(NamedTuple):
    """When to try again.

    Attributes
    ----------
    retries
        Tries after the first.
    first, longest
        Wait after the first failure, seconds, which doubles with each up to the longest.
    longest_asked
        Longest wait a server may ask for, seconds; a server that asks for more is left alone.
    """

    retries: int = 4
    first: float = 1.0
    longest: float = 60.0
    longest_asked: float = 300.0

    def wait(self, attempt: int, asked: float | None = None) -> float:
        """Return the seconds to wait after a failed attempt (counted from 0): what is asked for, if anything."""
        return asked or min(self.first * 2.0**attempt, self.longest)


def with_retries(call: Callable[[], T], *, backoff: Backoff, sleep: Callable[[float], None]) -> T:
    """Return what `call` returns, called again after errors that may pass.

    Raises
    ------
    HttpError
        The last one, with its number of tries.
    """
    for attempt in range(backoff.retries + 1):
        try:
            return call()
        except HttpError as error:
            error.tries = attempt + 1
            wait = backoff.wait(attempt, error.retry_after)
            if not error.transient or attempt == backoff.retries or wait > backoff.longest_asked:
                raise
            # Not the error's text, which may hold a key.
            log.info("HTTP %s; trying again in %.0f s", error.status or type(error.cause).__name__, wait)
        sleep(wait)
    raise AssertionError("the last try returns or raises")


#: The reason why an answer is not to be used, or None where it is good.
Validate = Callable[[bytes], str | None]

MAX_BYTES = 256 << 20
_SLOWEST = 1000.0  # bytes a second, on average: a server that drips slower than this holds us up for ever


class HttpClient:
    """The polite HTTP client. One may be shared between threads.

    Parameters
    ----------
    cache
        Folder in which good answers are kept; nothing is kept without.
    timeout
        Longest silence of a server, seconds.
    retries
        How often a call is repeated after 429, 5xx, a silence or a broken connection.
    pause
        Least time between the starts of two calls to one host, seconds.
    sleep
        Waits; tests replace it.
    """

    def __init__(
        self,
        *,
        cache: Path | None = None,
        timeout: float = 30.0,
        retries: int = 4,
        pause: float = 0.0,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self.cache = None if cache is None else Path(cache)
        self.timeout = timeout
        self.pause = pause
        self._backoff = Backoff(retries)
        self._sleep = sleep
        self._lock = threading.Lock()
        self._next: dict[str, float] = {}

    def get(
        self,
        url: str,
        *,
        params: Mapping[str, str] = {},
        headers: Mapping[str, str] = {},
        cached: bool = True,
        max_bytes: int = MAX_BYTES,
        validate: Validate | None = None,
    ) -> bytes:
        """Ask for what is at an address.

        Parameters
        ----------
        url
            An http or https address.
        params
            Added to the address's query.
        headers
            Sent along.
        cached
            Whether the answer may be kept in the cache, and taken from there.
        max_bytes
            Longest answer taken, bytes, once unpacked.
        validate
            Given the body of a 200 answer, says why it is not to be accepted (it is not kept then, and the reason
            becomes the error), or None. It may raise, too.

        Returns
        -------
        bytes
            The body.

        Raises
        ------
        InputError
            If `url` is no http or https address.
        SourceError
            If the server refuses, fails or is silent after all retries, or sends too much.
        OutputError
            If the answer can't be written into the cache.
        """
        request = HttpRequest("GET", _address(url, params), headers)
        return self._ask(request, cached=cached, max_bytes=max_bytes, validate=validate)

    def post(
        self,
        url: str,
        *,
        data: bytes | Mapping[str, str],
        headers: Mapping[str, str] = {},
        cached: bool = True,
        max_bytes: int = MAX_BYTES,
        validate: Validate | None = None,
    ) -> bytes:
        """Send `data` (bytes as they are, a mapping as a form) and return the answer; the rest is as in `get`."""
        sent = dict(headers)
        if isinstance(data, bytes):
            body = data
        else:
            body = urlencode(data).encode()
            sent.setdefault("Content-Type", "application/x-www-form-urlencoded")
        request = HttpRequest("POST", _address(url, {}), sent, body)
        return self._ask(request, cached=cached, max_bytes=max_bytes, validate=validate)

    def _ask(self, request: HttpRequest, *, cached: bool, max_bytes: int, validate: Validate | None) -> bytes:
        kept = None if self.cache is None or not cached else self.cache / _cache_name(request)
        if kept is not None and kept.is_file() and kept.stat().st_size <= max_bytes:
            content = kept.read_bytes()
            if validate is None or validate(content) is None:
                return content
        limits = Limits(self.timeout, 10 * self.timeout, _SLOWEST, max_bytes)
        try:
            status, content = with_retries(
                lambda: self._exchange(request, limits), backoff=self._backoff, sleep=self._sleep
            )
        except HttpError as error:
            raise _source_error(request, self._explanation(error), error.status) from None
        if validate is not None and status == 200:
            reason = validate(content)
            if reason is not None:
                raise _source_error(request, reason, status)
        if kept is not None and status == 200:
            write_bytes(kept, content)
        return content

    def _exchange(self, request: HttpRequest, limits: Limits) -> tuple[int, bytes]:
        self._wait_for_turn(urlsplit(request.url).netloc)
        return send(request, limits)

    def _wait_for_turn(self, host: str) -> None:
        """Wait until this host may be called again."""
        if self.pause <= 0:
            return
        with self._lock:
            now = time.monotonic()
            start = max(now, self._next.get(host, 0.0))
            self._next[host] = start + self.pause
        if start > now:
            self._sleep(start - now)

    def _explanation(self, error: HttpError) -> str:
        if error.status is None:
            return f"{error} after {error.tries} tries" if error.tries > 1 else str(error)
        asked = error.retry_after or 0.0
        later = f"; it asks to wait {asked:.0f} s" if asked > self._backoff.longest_asked else ""
        return f"{error}{_excerpt(error.page)}{later}"


def _source_error(request: HttpRequest, what: str, status: int | None) -> SourceError:
    """Make the error of a request, free of its keys."""
    secrets = secrets_in(request.url, request.headers, request.body)
    error = SourceError(f"{without_secrets(request.url, '***')}: {redact(what, secrets)}")
    error.status = status
    return error


def _cache_name(request: HttpRequest) -> Path:
    """Return the file an answer is kept in: named by what was asked, keys left out."""
    told = sorted((k.lower(), v) for k, v in request.headers.items() if not is_secret(k))
    head = (request.method, without_secrets(request.url), repr(told))
    parts = (*(part.encode() for part in head), form_without_secrets(request.body, request.headers))
    digest = hashlib.sha256(b"\0".join(parts)).hexdigest()
    return Path(digest[:2]) / digest


def _address(url: str, params: Mapping[str, str]) -> str:
    """Return the address with its parameters, checked and quoted."""
    shown = without_secrets(url, "***")[:200]
    try:
        parts = urlsplit(url.strip())
        host, _ = parts.hostname, parts.port
    except ValueError as error:
        raise InputError(f"{shown}: not an address ({error})") from None
    if parts.scheme not in ("http", "https"):
        raise InputError(f"{shown}: only http and https addresses are fetched")
    if not host or re.search(r"[\s\x00-\x1f\x7f]", parts.netloc):
        raise InputError(f"{shown}: the address names no host")
    if "@" in parts.netloc:
        raise InputError(f"{parts.scheme}://***@{host}: an address must hold no user name or password")
    path = quote(parts.path, safe="/%:@!$&'()*+,;=~")
    query = "&".join(q for q in (quote(parts.query, safe="/%:@!$&'()*+,;=~?"), urlencode(params)) if q)
    return urlunsplit((parts.scheme, parts.netloc, path or "/", query, ""))


def _excerpt(page: str) -> str:
    """Return what an error page says, without its markup: for the reader of the message."""
    text = re.sub(r"(?is)<(script|style|head)\b.*?</\1\s*>|<[^>]*>", " ", page)
    words = "".join(c if c.isprintable() else " " for c in html.unescape(text)).split()
    said = " ".join(words)
    return f" ({said[:200]}{'...' if len(said) > 200 else ''})" if said else ""
