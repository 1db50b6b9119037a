"""Keys, tokens and passwords kept out of messages and of what is stored."""

from __future__ import annotations

import html
import re
from collections.abc import Iterable, Mapping
from urllib.parse import parse_qsl, quote, urlsplit

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


def redacted(text: str, secrets: Iterable[str]) -> str:
    """Return a text with keys of four characters and more replaced by ``***``, also where they are quoted."""
    for secret in sorted({s for s in secrets if len(s) > 3}, key=lambda s: (-len(s), s)):
        for form in (secret, quote(secret), quote(secret, safe=""), html.escape(secret)):
            text = text.replace(form, "***")
    return text


def _is_form(headers: Mapping[str, str]) -> bool:
    return any(k.lower() == "content-type" and "x-www-form-urlencoded" in v for k, v in headers.items())
