"""The one HTTP client: polite to servers, careful with what they send, and silent about keys.

It goes to http and https addresses only, names itself, keeps a pause between calls to a host, waits as long as a busy
server asks, gives up in one sentence, and keeps good answers in a folder so that nothing is asked twice.
"""

from __future__ import annotations

import contextlib
import hashlib
import html
import http.client
import os
import re
import socket
import tempfile
import threading
import time
import urllib.error
import urllib.request
import zlib
from collections.abc import Callable, Mapping
from email.message import Message
from email.utils import parsedate_to_datetime
from pathlib import Path
from typing import IO, Any
from urllib.parse import parse_qsl, quote, urlencode, urlsplit, urlunsplit

from vico import __version__
from vico.errors import InputError, SourceError

USER_AGENT = f"virtual-community/{__version__} (vico; builds simulated cities from map data)"

#: The reason why an answer is not to be used, or None where it is good.
Valid = Callable[[bytes], str | None]

# Names of keys, and not of a place search's `keyword`.
_SECRET = re.compile(
    r"(^|[-_])(key|token|secret|session|sessionid|signature|sig|pass|password|auth|credential)$"
    r"|apikey|accesstoken|authori[sz]ation|cookie",
    re.IGNORECASE,
)
_RETRIED = (429, 500, 502, 503, 504)
_FIRST_WAIT, _MOST_WAIT, _MOST_ASKED = 1.0, 60.0, 300.0  # seconds: back-off from, to; longest Retry-After obeyed
_BLOCK = 1 << 16
_SLOWEST = 1000.0  # bytes a second, on average: a server that drips slower than this holds us up for ever


class _Unfinished(Exception):
    """The connection broke or went silent: worth another try."""


class _Astray(Exception):
    """A redirect to where we don't go."""


class _Redirects(urllib.request.HTTPRedirectHandler):
    """Follow redirects to http and https only, never from https to http, and take no key to another host."""

    max_redirections = 5

    def redirect_request(
        self, req: urllib.request.Request, fp: IO[bytes], code: int, msg: str, headers: Any, newurl: str
    ) -> urllib.request.Request | None:
        old, new = urlsplit(req.full_url), urlsplit(newurl)
        if new.scheme not in ("http", "https") or (old.scheme == "https" and new.scheme == "http"):
            raise _Astray(f"is redirected to a {new.scheme or 'nameless'} address, which is not followed")
        onward = super().redirect_request(req, fp, code, msg, headers, newurl)
        if onward is not None and (old.scheme, old.netloc) != (new.scheme, new.netloc):
            for name in [name for name in onward.headers if _SECRET.search(name)]:
                onward.remove_header(name)
        return onward


def _opener() -> urllib.request.OpenerDirector:
    """Of http and https alone: `build_opener` would add ftp, file and data addresses."""
    opener = urllib.request.OpenerDirector()
    for handler in (
        urllib.request.ProxyHandler(),
        urllib.request.HTTPHandler(),
        urllib.request.HTTPSHandler(),
        urllib.request.HTTPDefaultErrorHandler(),
        urllib.request.HTTPErrorProcessor(),
        urllib.request.UnknownHandler(),
        _Redirects(),
    ):
        opener.add_handler(handler)
    opener.addheaders = []
    return opener


class Web:
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
        self.retries = retries
        self.pause = pause
        self._sleep = sleep
        self._opener = _opener()
        self._lock = threading.Lock()
        self._next: dict[str, float] = {}

    def get(
        self,
        url: str,
        *,
        params: Mapping[str, str] = {},
        headers: Mapping[str, str] = {},
        keep: bool = True,
        most: int = 256 << 20,
        valid: Valid | None = None,
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
        keep
            Whether the answer may be kept in the cache, and taken from there.
        most
            Longest answer taken, bytes, once unpacked.
        valid
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
        """
        return self._ask("GET", _address(url, params), None, headers, keep=keep, most=most, valid=valid)

    def post(
        self,
        url: str,
        *,
        data: bytes | Mapping[str, str],
        headers: Mapping[str, str] = {},
        keep: bool = True,
        most: int = 256 << 20,
        valid: Valid | None = None,
    ) -> bytes:
        """Send `data` (bytes as they are, a mapping as a form) and return the answer; the rest is as in `get`."""
        sent = dict(headers)
        if isinstance(data, bytes):
            body = data
        else:
            body = urlencode(data).encode()
            sent.setdefault("Content-Type", "application/x-www-form-urlencoded")
        return self._ask("POST", _address(url, {}), body, sent, keep=keep, most=most, valid=valid)

    def _ask(
        self,
        method: str,
        url: str,
        body: bytes | None,
        headers: Mapping[str, str],
        *,
        keep: bool,
        most: int,
        valid: Valid | None,
    ) -> bytes:
        kept = self._place(method, url, body, headers) if keep and self.cache is not None else None
        if kept is not None and kept.is_file() and kept.stat().st_size <= most:
            content = kept.read_bytes()
            if valid is None or valid(content) is None:
                return content
        said = _Said(url, headers, body)
        status, content = self._answer(method, url, body, headers, most, said)
        if valid is not None and status == 200:
            reason = valid(content)
            if reason is not None:
                raise said.error(reason, status)
        if kept is not None and status == 200:
            try:
                write_whole(kept, content)
            except OSError as error:
                raise said.error(f"the answer can't be kept in {self.cache} ({error.strerror})") from None
        return content

    def _place(self, method: str, url: str, body: bytes | None, headers: Mapping[str, str]) -> Path:
        """The file an answer is kept in: named by what was asked, keys left out."""
        assert self.cache is not None
        told = sorted((k.lower(), v) for k, v in headers.items() if not _SECRET.search(k))
        parts = (method, _without_secrets(url), repr(told), _form_without_secrets(body, headers))
        digest = hashlib.sha256(b"\0".join(p if isinstance(p, bytes) else p.encode() for p in parts)).hexdigest()
        return self.cache / digest[:2] / digest

    def _turn(self, host: str) -> None:
        """Wait until this host may be called again."""
        if self.pause <= 0:
            return
        with self._lock:
            now = time.monotonic()
            start = max(now, self._next.get(host, 0.0))
            self._next[host] = start + self.pause
        if start > now:
            self._sleep(start - now)

    def _answer(
        self, method: str, url: str, body: bytes | None, headers: Mapping[str, str], most: int, said: _Said
    ) -> tuple[int, bytes]:
        """Status and body of a successful answer, after as many tries as it takes."""
        sent = {"User-Agent": USER_AGENT, "Accept-Encoding": "gzip", "Connection": "close", **headers}
        host = urlsplit(url).netloc
        for attempt in range(self.retries + 1):
            self._turn(host)
            backoff = min(_FIRST_WAIT * 2.0**attempt, _MOST_WAIT)
            last = attempt == self.retries
            try:
                request = urllib.request.Request(url, data=body, headers=sent, method=method)
                with self._opener.open(request, timeout=self.timeout) as response:
                    return int(response.status), self._body(response, most, said)
            except urllib.error.HTTPError as error:
                with error:
                    told = _excerpt(error)
                    wait = _asked_wait(error.headers, backoff)
                if error.code not in _RETRIED or last or wait > _MOST_ASKED:
                    later = f"; it asks to wait {wait:.0f} s" if wait > _MOST_ASKED else ""
                    raise said.error(f"{_meaning(error.code)}{told}{later}", error.code) from None
            except SourceError:
                raise
            except _Astray as error:
                raise said.error(str(error)) from None
            except (_Unfinished, http.client.HTTPException, zlib.error, OSError) as error:
                reason = error.reason if isinstance(error, urllib.error.URLError) else error
                if last or not _passes(reason):
                    tries = f" after {attempt + 1} tries" if attempt else ""
                    raise said.error(f"{_trouble(reason, self.timeout)}{tries}") from None
                wait = backoff
            self._sleep(wait)
        raise AssertionError("the last try returns or raises")

    def _body(self, response: http.client.HTTPResponse, most: int, said: _Said) -> bytes:
        """Read an answer, unpacked, and no more than `most` bytes of it."""
        expected = response.headers.get("Content-Length", "")
        coding = response.headers.get("Content-Encoding", "identity").strip().lower()
        if coding not in ("gzip", "x-gzip", "identity", ""):
            raise said.error(f"answers in the coding {coding[:20]!r}, which was not asked for")
        packed = coding in ("gzip", "x-gzip")
        too_much = f"sends more than {most:,} bytes"
        if expected.isdecimal() and int(expected) > most:
            raise said.error(f"{too_much} ({int(expected):,})")
        unpacker = zlib.decompressobj(wbits=31)
        pieces: list[bytes] = []
        size = got = 0
        began = time.monotonic()
        while block := response.read1(_BLOCK):
            got += len(block)
            if time.monotonic() - began > 10 * self.timeout + got / _SLOWEST:
                raise _Unfinished(f"sent {got:,} bytes in {time.monotonic() - began:.0f} s")
            while block:
                if packed:
                    piece = unpacker.decompress(block, _BLOCK)
                    block = unpacker.unconsumed_tail
                    if unpacker.eof:
                        block = unpacker.unused_data
                        if block:  # gzip files may be several, one after the other
                            unpacker = zlib.decompressobj(wbits=31)
                else:
                    piece, block = block, b""
                size += len(piece)
                if size > most:
                    raise said.error(too_much)
                pieces.append(piece)
        if expected.isdecimal() and got != int(expected):
            raise _Unfinished(f"the answer breaks off at byte {got:,} of {int(expected):,}")
        if packed and not unpacker.eof:
            raise _Unfinished(f"the packed answer breaks off at byte {got:,}")
        return b"".join(pieces)


class _Said:
    """Makes the errors of one call, free of its keys."""

    def __init__(self, url: str, headers: Mapping[str, str], body: bytes | None) -> None:
        self.url = _without_secrets(url, "***")
        pairs = [*parse_qsl(urlsplit(url).query), *headers.items()]
        if _is_form(headers):
            pairs += parse_qsl((body or b"").decode("utf-8", "replace"))
        self.secrets = sorted({v for k, v in pairs if _SECRET.search(k) and len(v) > 3}, key=lambda v: (-len(v), v))

    def error(self, what: str, status: int | None = None) -> SourceError:
        for secret in self.secrets:
            for form in (secret, quote(secret), quote(secret, safe=""), html.escape(secret)):
                what = what.replace(form, "***")
        made = SourceError(f"{self.url}: {what}")
        made.status = status
        return made


def cache_folder() -> Path:
    """Return the user's cache of ours: ``$VICO_CACHE``, else the platform's usual place. It may not exist yet."""
    import sys

    if chosen := os.environ.get("VICO_CACHE"):
        return Path(chosen).expanduser()
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA", "") or str(Path.home() / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = str(Path.home() / "Library" / "Caches")
    else:
        base = os.environ.get("XDG_CACHE_HOME", "") or str(Path.home() / ".cache")
    return Path(base) / "vico"


def write_whole(path: Path, content: bytes) -> None:
    """Write a whole file or nothing: to a temporary neighbour, synced, then renamed over `path`."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name[:40]}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def _address(url: str, params: Mapping[str, str]) -> str:
    """The address with its parameters, checked and quoted."""
    try:
        parts = urlsplit(url.strip())
        host, _ = parts.hostname, parts.port
    except ValueError as error:
        raise InputError(f"{_without_secrets(url, '***')[:200]}: not an address ({error})") from None
    if parts.scheme not in ("http", "https"):
        raise InputError(f"{_without_secrets(url, '***')[:200]}: only http and https addresses are fetched")
    if not host or re.search(r"[\s\x00-\x1f\x7f]", parts.netloc):
        raise InputError(f"{_without_secrets(url, '***')[:200]}: the address names no host")
    if "@" in parts.netloc:
        raise InputError(f"{parts.scheme}://***@{host}: an address must hold no user name or password")
    path = quote(parts.path, safe="/%:@!$&'()*+,;=~")
    query = "&".join(q for q in (quote(parts.query, safe="/%:@!$&'()*+,;=~?"), urlencode(params)) if q)
    return urlunsplit((parts.scheme, parts.netloc, path or "/", query, ""))


def _without_secrets(url: str, instead: str | None = None) -> str:
    """The address without the values of its keys: left out, or replaced."""
    head, mark, query = url.partition("?")
    pairs = [pair.partition("=") for pair in query.split("&")]
    kept: list[str] = []
    for name, equals, value in pairs:
        if not _SECRET.search(name):
            kept.append(f"{name}{equals}{value}")
        elif instead is not None:
            kept.append(f"{name}={instead}")
    return head + mark + "&".join(kept)


def _is_form(headers: Mapping[str, str]) -> bool:
    return any(k.lower() == "content-type" and "x-www-form-urlencoded" in v for k, v in headers.items())


def _form_without_secrets(body: bytes | None, headers: Mapping[str, str]) -> bytes:
    if body is None or not _is_form(headers):
        return body or b""
    return b"&".join(p for p in body.split(b"&") if not _SECRET.search(p.partition(b"=")[0].decode("utf-8", "replace")))


def _asked_wait(headers: Message, otherwise: float) -> float:
    """Seconds to wait, as ``Retry-After`` says: a number, or a date (held against the server's own clock)."""
    value = (headers.get("Retry-After") or "").strip()
    if value.isdecimal():
        return max(float(value[:9]), otherwise if value == "0" else 0.0)
    with contextlib.suppress(ValueError, TypeError):
        until = parsedate_to_datetime(value).timestamp()
        now = time.time()
        with contextlib.suppress(ValueError, TypeError):
            now = parsedate_to_datetime(headers.get("Date", "")).timestamp()
        return max(until - now, otherwise)
    return otherwise


def _excerpt(response: IO[bytes]) -> str:
    """What an error page says, without its markup: for the reader of the message."""
    try:
        text = response.read(4000).decode("utf-8", "replace")
    except (OSError, http.client.HTTPException):
        return ""
    text = re.sub(r"(?is)<(script|style|head)\b.*?</\1\s*>|<[^>]*>", " ", text)
    words = "".join(c if c.isprintable() else " " for c in html.unescape(text)).split()
    said = " ".join(words)
    return f" ({said[:200]}{'...' if len(said) > 200 else ''})" if said else ""


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


def _passes(error: object) -> bool:
    """Whether another try may help: no name, no listener and a bad certificate stay as they are."""
    import ssl

    lasting = (socket.gaierror, ConnectionRefusedError, ssl.SSLCertVerificationError, http.client.InvalidURL)
    return isinstance(error, BaseException) and not isinstance(error, lasting)


def _trouble(error: object, timeout: float) -> str:
    if isinstance(error, TimeoutError):
        return f"no answer within {timeout:g} s"
    if isinstance(error, socket.gaierror):
        return f"the host's name can't be resolved ({error.strerror}); is there a network?"
    if isinstance(error, ConnectionRefusedError):
        return "nobody listens there (connection refused)"
    if isinstance(error, _Unfinished):
        return str(error)
    words = " ".join(str(error).split())[:200]
    return f"the connection fails ({type(error).__name__}{': ' if words else ''}{words})"
