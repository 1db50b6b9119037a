"""The polite HTTP client: pauses, retries, and a cache in which good answers are kept."""

from __future__ import annotations

import hashlib
import html
import re
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from urllib.parse import quote, urlencode, urlsplit, urlunsplit

from vico.errors import InputError, SourceError
from vico.io.files import write_bytes
from vico.io.http.exchange import HttpError, HttpRequest, Limits, send
from vico.io.http.redaction import form_without_secrets, is_secret, redacted, secrets_in, without_secrets
from vico.io.http.retries import Backoff, with_retries

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
            raise _source_error(request, self._explained(error), error.status) from None
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

    def _explained(self, error: HttpError) -> str:
        if error.status is None:
            return f"{error} after {error.tries} tries" if error.tries > 1 else str(error)
        asked = error.retry_after or 0.0
        later = f"; it asks to wait {asked:.0f} s" if asked > self._backoff.longest_asked else ""
        return f"{error}{_excerpt(error.page)}{later}"


def _source_error(request: HttpRequest, what: str, status: int | None) -> SourceError:
    """Make the error of a request, free of its keys."""
    secrets = secrets_in(request.url, request.headers, request.body)
    error = SourceError(f"{without_secrets(request.url, '***')}: {redacted(what, secrets)}")
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
