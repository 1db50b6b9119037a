"""State of the viewer's server: the source it shows, its news, and access. It needs no server package.

`ViewerState` holds what is shown, and by what hands the run can be reached; it is the same for all clients. The `Hub`
wakes clients when a run has gone on: frames are encoded once, JSON messages go to those who follow.

The `Gate` lets in this machine's own pages and programs that have the token; everybody else gets a sentence. A page
of elsewhere could give its name the address of this machine (DNS rebinding), so requests are answered under the names
of this machine alone, and under those that its user lets in. The port may be another one: it can be forwarded.
"""

from __future__ import annotations

import asyncio
import re
import secrets
from collections.abc import Awaitable, Callable, MutableMapping, Sequence
from concurrent.futures import CancelledError
from contextlib import suppress
from functools import cached_property
from http.cookies import CookieError, SimpleCookie
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs

from vico.errors import InputError, MissingFileError
from vico.sim.recording.run import looks_and_manners
from vico.viewer.sources.frames import NEWEST
from vico.viewer.sources.source import Source

if TYPE_CHECKING:
    from vico.runner.control import Control
    from vico.viewer.play import PlayedAgent

View = Callable[[str, int, str], tuple[bytes | dict[str, Any], str]]


class ViewerState:
    """What a server shows.

    Parameters
    ----------
    source
        The run.
    view
        Gives what an agent sees at a step.
    city
        Folder of the world's static files; None where there are none.
    hands, player
        Of a run that goes on; None for recordings, and where nobody is played.
    """

    def __init__(
        self,
        source: Source,
        view: View,
        *,
        city: Path | None = None,
        hands: Control | None = None,
        player: PlayedAgent | None = None,
    ) -> None:
        self.source, self.view, self.city, self.hands, self.player = source, view, city, hands, player
        #: Told how many clients are connected whenever one comes or leaves.
        self.visited: Callable[[int], None] = lambda clients: None

    def more(self) -> dict[str, Any]:
        """Return what ``/api/run`` tells beside the source's head."""
        control = None if self.hands is None else self.hands.told()
        return {"control": control, "you_play": None if self.player is None else self.player.agent}

    def factor(self) -> float | None:
        """Return simulated seconds a second; None for recordings."""
        return None if self.hands is None else self.hands.told()["factor"]

    def three(self) -> Path:
        """Return the file of the page's 3D library.

        Raises
        ------
        MissingFileError
            If it is not installed; the message holds the command to type.
        """
        from vico.viewer.three import three_module

        return three_module()

    def person(self, entity: int) -> bytes:
        """Return the file of a person.

        Raises
        ------
        MissingFileError
            If nobody has this number.
        """
        try:
            return self._people.file(entity)
        except KeyError:
            raise MissingFileError(f"there is no person with the number {entity}") from None

    @cached_property
    def _people(self) -> Any:
        from vico.viewer.city import PeopleFiles

        cast = self.source.tables.cast()
        looks, manners = looks_and_manners(self.source.manifest["seed"], self.source.agents, cast)
        return PeopleFiles(looks, manners, self.source.manifest["seed"])


# Events that one message holds at most.
_MOST_EVENTS = 200
# Seconds between looks at a run that another process writes, and between messages of counts.
_LOOKS_EVERY, _COUNTS_EVERY = 1.0, 1.0
# Rows of the cast are told beyond this many steps only when they are asked for anew.
_MOST_STEPS = 100_000
# News of some steps are kept for the clients that are told the same.
_MOST_NEWS = 16
# Seconds that the end of the server takes at most.
_REPLIES_WITHIN = 1.0  # for replies
_READ_WITHIN = 1.0  # then for clients that read slowly
_LOOKS_AT_THEM = 0.01  # between looks at them


class Hub:
    """Wakes clients when a run has gone on, and keeps the bytes of its newest frame for all of them.

    Belongs to the thread of the server's loop; `notify` may be called from any thread.

    Parameters
    ----------
    state
        What the server shows.
    """

    def __init__(self, state: ViewerState) -> None:
        self.state = state
        self.listeners: set[asyncio.Event] = set()
        self._clients = 0
        #: Replies that are waited for.
        self.replies: set[asyncio.Task[None]] = set()
        #: Whether clients get what they are still owed, and are then let go.
        self.over = False
        self._loop: asyncio.AbstractEventLoop | None = None
        self._pending = False
        #: Which run is shown: another number, another run.
        self.epoch = 0
        self._frame = -1, b""
        self._news: dict[tuple[int, int], list[dict[str, Any]]] = {}

    async def run(self) -> None:
        """Look for what another process has recorded; while the run goes on in this one, tell how it stands."""
        self._loop = asyncio.get_running_loop()
        state = self.state
        while True:
            await asyncio.sleep(_LOOKS_EVERY)
            grows = state.hands is None and state.source.manifest["status"] == "running"
            if state.hands is not None or (grows and await asyncio.to_thread(state.source.refresh)):
                self._wake()

    def notify(self) -> None:
        """Say that there is a new step; cheap where nobody listens, and while the last word is not heard yet."""
        if self.listeners and not self._pending and self._loop is not None:
            self._pending = True
            self._loop.call_soon_threadsafe(self._wake)

    def count(self, more: int) -> None:
        """Note that a client has come (1) or left (-1)."""
        self._clients += more
        self.state.visited(self._clients)

    def end(self) -> None:
        """Send clients what they are still owed, replies among it, and let them go; from another thread."""
        if self._loop is not None and not self._loop.is_closed():
            # Cancelled where the loop ends by itself meanwhile: then nobody is there to be told.
            with suppress(TimeoutError, CancelledError):
                asyncio.run_coroutine_threadsafe(self._end(), self._loop).result(_REPLIES_WITHIN + 2 * _READ_WITHIN)

    async def _end(self) -> None:
        if self.replies:
            await asyncio.wait(self.replies, timeout=_REPLIES_WITHIN)
        self.over = True
        self._wake()
        for _ in range(round(_READ_WITHIN / _LOOKS_AT_THEM)):
            if not self.listeners:
                return
            await asyncio.sleep(_LOOKS_AT_THEM)

    def newest(self) -> tuple[int, bytes]:
        """Return the newest step and its frame, encoded once for all."""
        last = self.state.source.last
        if last != self._frame[0] and last >= 0:
            frame = next(self.state.source.frames(last, last))
            self._frame = last, frame.to_bytes(flags=NEWEST)
        return self._frame

    def news(self, since: int, until: int) -> list[dict[str, Any]]:
        """Return messages of events and of the cast, of the steps after `since`, up to `until`."""
        if until <= since or until - since > _MOST_STEPS:
            return []
        if (since, until) not in self._news:
            if len(self._news) >= _MOST_NEWS:
                self._news.pop(next(iter(self._news)))
            self._news[since, until] = self._new(since, until)
        return self._news[since, until]

    def _new(self, since: int, until: int) -> list[dict[str, Any]]:
        source, told = self.state.source, list[dict[str, Any]]()
        events = source.events(since + 1, until, _MOST_EVENTS)
        if events["events"]:
            told.append({"type": "events", "step": until, **events})
        cast = source.cast(since)
        if cast["cast"]:
            told.append({"type": "cast", **cast})
        return told

    def change(self) -> None:
        """Say that the run is another one from here on; from any thread."""
        if self._loop is not None:
            self._loop.call_soon_threadsafe(self._change)

    def _change(self) -> None:
        self._frame, self._news = (-1, b""), {}
        self.epoch += 1
        self._wake()

    def counts(self) -> dict[str, Any]:
        """Return the message ``metrics`` of the newest step."""
        last = self.state.source.last
        told = self.state.source.metrics(last, last, 2)
        return {"type": "metrics", **{name: values[-1] if values else None for name, values in told.items()}}

    def _wake(self) -> None:
        self._pending = False
        for listener in self.listeners:
            listener.set()


COUNTS_EVERY = _COUNTS_EVERY


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
            await self._app(scope, receive, self._with_headers(scope, send))

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

    def _with_headers(self, scope: Scope, send: Send) -> Send:
        """Return `send` with our headers on every answer."""
        kept = scope.get("path", "").startswith(("/city/", "/three/"))
        caching = (b"cache-control", b"no-cache" if kept else b"no-store")

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                others = [pair for pair in message.get("headers", []) if pair[0].lower() != b"cache-control"]
                message["headers"] = [*others, *self._headers[:-1], caching]
            await send(message)

        return send_with_headers


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
