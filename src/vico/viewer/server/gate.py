"""Who is let in: this machine's own pages and programs that have the token. Everybody else gets a sentence.

A page of elsewhere could give its name the address of this machine (DNS rebinding), so requests are answered under the
names of this machine alone, and under those that its user lets in. The port may be another one: it can be forwarded.
"""

from __future__ import annotations

import re
import secrets
from collections.abc import Awaitable, Callable, MutableMapping, Sequence
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs

from vico.errors import InputError

Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

_METHODS = ("GET", "HEAD")
# This machine's own names.
_OWN_NAMES = frozenset({"127.0.0.1", "localhost", "[::1]"})
_HOST = re.compile(r"[a-z0-9]([a-z0-9.-]{0,250}[a-z0-9])?|\[[0-9a-f:.]{2,45}\]")


class Gate:
    """Lets requests through to an application that come from its own page, with its token.

    Parameters
    ----------
    app
        What answers them.
    port
        That the server listens on.
    token
        Whoever knows it may ask.
    hosts
        Names, beside those of this machine, under which the server is reached: of a proxy or a forwarded port.
    """

    def __init__(self, app: App, *, port: int, token: str, hosts: Sequence[str] = ()) -> None:
        self._app, self._port, self._token = app, port, token
        self._let_in = frozenset(checked_host(host) for host in hosts)
        self._headers = _security_headers(sorted({f"127.0.0.1:{port}", f"localhost:{port}", *self._let_in}))

    @property
    def cookie(self) -> str:
        """Name of the cookie; cookies do not know ports, so that it tells which server it is for."""
        return f"vico_{self._port}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or have it answered."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]}
        reason = self._refusal(scope, headers)
        if reason:
            await _refuse(scope, send, reason, self._headers)
        elif scope["type"] == "http" and scope["path"] == "/" and (token := _given_token(scope)):
            await self._welcome(token, send)
        elif not self._knows_token(headers):
            await _refuse(
                scope, send, "open the address that the command printed: this one lacks its token", self._headers
            )
        else:
            await self._app(scope, receive, self._guarded(scope, send))

    def _refusal(self, scope: Scope, headers: dict[str, str]) -> str:
        """Return why a request is refused whatever it knows; "" if it is not."""
        host = headers.get("host", "").lower()
        if _name_of(host) not in _OWN_NAMES | self._let_in:
            return (
                "this server answers to 127.0.0.1, localhost and [::1] alone; to be reached as "
                f"{_name_of(host) or 'another name'}, it has to be started with --allow-host {_name_of(host) or 'NAME'}"
            )
        origin = headers.get("origin")
        if origin is not None and not self._is_own(origin.lower(), host):
            return "pages of other origins are not answered"
        if scope["type"] == "websocket" and origin is None and "authorization" not in headers:
            return "a WebSocket needs an Origin, or the token in an Authorization header"
        if scope["type"] == "http" and scope["method"] not in _METHODS:
            return f"{scope['method']} is not known; there are {' and '.join(_METHODS)}"
        return ""

    def _is_own(self, origin: str, host: str) -> bool:
        """Whether an origin is of the page that this server gave: under the request's host, or a name let in."""
        scheme, _, theirs = origin.partition("://")
        if scheme == "http" and theirs in {f"127.0.0.1:{self._port}", f"localhost:{self._port}"}:
            return True
        return scheme in ("http", "https") and (theirs == host or _name_of(theirs) in self._let_in)

    def _knows_token(self, headers: dict[str, str]) -> bool:
        kind, _, given = headers.get("authorization", "").partition(" ")
        if kind.lower() == "bearer":
            return self._is_token(given.strip())
        try:
            cookie = SimpleCookie(headers.get("cookie", "")).get(self.cookie)
        except CookieError:
            return False
        return cookie is not None and self._is_token(cookie.value)

    def _is_token(self, text: str) -> bool:
        return secrets.compare_digest(text.encode(), self._token.encode())

    async def _welcome(self, token: str, send: Send) -> None:
        """Give who has the token the cookie, and the address without it."""
        if not self._is_token(token):
            await _answer(
                send, 403, "the token is another one: open the address that the command printed", self._headers
            )
            return
        cookie = f"{self.cookie}={self._token}; HttpOnly; SameSite=Strict; Path=/"
        # Relative: a proxy may have put the page below a path of its own.
        more = [(b"location", b"./"), (b"set-cookie", cookie.encode())]
        await _answer(send, 303, "", [*self._headers, *more])

    def _guarded(self, scope: Scope, send: Send) -> Send:
        """Return `send` with our headers on every answer."""
        kept = scope.get("path", "").startswith(("/city/", "/three/"))
        caching = (b"cache-control", b"no-cache" if kept else b"no-store")

        async def guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                others = [pair for pair in message.get("headers", []) if pair[0].lower() != b"cache-control"]
                message["headers"] = [*others, *self._headers[:-1], caching]
            await send(message)

        return guarded


def checked_host(text: str) -> str:
    """Return the name of a host that is to be let in, in lower case and without a port.

    Raises
    ------
    InputError
        If it is none: an address of a page, or a pattern.
    """
    said = text.strip().lower()
    name = _name_of(said)
    if not _HOST.fullmatch(name) or not re.fullmatch(r"(:\d+)?", said[len(name) :]):
        raise InputError(
            f"--allow-host {text!r}: give the name of a host, such as hub.example.org, without http:// or *"
        )
    return name


def _name_of(host: str) -> str:
    """Return a host without its port: ``localhost:9000``, ``[::1]:8123``."""
    if host.startswith("["):
        return host.partition("]")[0] + "]"
    return host.partition(":")[0]


def _given_token(scope: Scope) -> str:
    return parse_qs(scope.get("query_string", b"").decode("latin-1")).get("token", [""])[0]


def _security_headers(hosts: Sequence[str]) -> list[tuple[bytes, bytes]]:
    # Not every browser takes 'self' for a WebSocket's address, too.
    sockets = " ".join(f"ws://{host} wss://{host}" for host in hosts)
    policy = {
        "default-src": "'self'",
        "img-src": "'self' blob: data:",
        "style-src": "'self' 'unsafe-inline'",
        "connect-src": f"'self' blob: {sockets}",
        "worker-src": "'self' blob:",
        "object-src": "'none'",
        "base-uri": "'none'",
        "frame-ancestors": "'none'",
        "form-action": "'none'",
    }
    return [
        (b"content-security-policy", "; ".join(f"{name} {value}" for name, value in policy.items()).encode()),
        (b"x-content-type-options", b"nosniff"),
        (b"referrer-policy", b"no-referrer"),
        (b"cross-origin-resource-policy", b"same-origin"),
        (b"cache-control", b"no-store"),
    ]


async def _refuse(scope: Scope, send: Send, reason: str, headers: list[tuple[bytes, bytes]]) -> None:
    if scope["type"] == "websocket":
        # Before it is accepted: the answer is 403.
        await send({"type": "websocket.close", "code": 1008, "reason": reason})
    else:
        await _answer(send, 403, reason, headers)


async def _answer(send: Send, status: int, text: str, headers: list[tuple[bytes, bytes]]) -> None:
    body = text.encode()
    kind = [(b"content-type", b"text/plain; charset=utf-8"), (b"content-length", str(len(body)).encode())]
    await send({"type": "http.response.start", "status": status, "headers": [*kind, *headers]})
    await send({"type": "http.response.body", "body": body})
