"""A small client of the viewer's server, and things that tests show with it."""

from __future__ import annotations

import json
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from websockets.sync.client import ClientConnection, connect

from vico.viewer.server.serve import Address
from vico.viewer.sources.frames import Frame, decode_frame


def address_of(url: str) -> Address:
    """Return port and token of an address."""
    base, _, token = url.partition("/?token=")
    return Address(port=int(base.rpartition(":")[2]), token=token)


def get(url: str, path: str) -> bytes:
    """Return what the server answers to a program that has the token."""
    return answer(url, path, headers={"Authorization": f"Bearer {address_of(url).token}"})[1]


def get_json(url: str, path: str) -> Any:
    """Return the same as JSON."""
    return json.loads(get(url, path))


def answer(url: str, path: str, *, headers: dict[str, str], method: str = "GET") -> tuple[int, bytes, dict[str, str]]:
    """Return status, body and headers of any request; redirects are not followed."""
    request = urllib.request.Request(f"http://127.0.0.1:{address_of(url).port}{path}", headers=headers, method=method)
    opener = urllib.request.build_opener(_NoRedirect)
    try:
        with opener.open(request, timeout=20) as response:
            return response.status, response.read(), dict(response.headers)
    except urllib.error.HTTPError as error:
        return error.code, error.read(), dict(error.headers)


class _NoRedirect(urllib.request.HTTPRedirectHandler):
    def redirect_request(self, *args: Any, **options: Any) -> None:
        return None


class Stream:
    """An open WebSocket, read message by message."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self.messages: list[dict[str, Any]] = []
        self.frames: list[tuple[Frame, int, int]] = []

    def send(self, **message: Any) -> None:
        self.socket.send(json.dumps(message))

    def read(self, seconds: float = 20.0) -> None:
        """Take in one message."""
        content = self.socket.recv(timeout=seconds)
        if isinstance(content, bytes):
            self.frames.append(decode_frame(content))
        else:
            self.messages.append(json.loads(content))

    def until(self, found: Callable[[Stream], Any], seconds: float = 30.0) -> Any:
        """Take in messages until something is there, and return it."""
        end = time.monotonic() + seconds
        while not (value := found(self)):
            left = end - time.monotonic()
            assert left > 0, f"did not come; there are {[m['type'] for m in self.messages[-20:]]}"
            self.read(left)
        return value

    def last(self, kind: str) -> dict[str, Any] | None:
        """Return the newest message of a type."""
        return next((message for message in reversed(self.messages) if message["type"] == kind), None)

    def command(self, name: str, /, **arguments: Any) -> dict[str, Any]:
        """Give a command and return the reply."""
        number = 1 + sum(message["type"] == "reply" for message in self.messages)
        self.send(type="command", id=number, command=name, arguments=arguments)
        return self.reply(number)

    def reply(self, number: int) -> dict[str, Any]:
        """Wait for the reply with an id."""

        def found(stream: Stream) -> dict[str, Any] | None:
            replies = (m for m in stream.messages if m["type"] == "reply" and m["id"] == number)
            return next(replies, None)

        reply: dict[str, Any] = self.until(found)
        return reply


@contextmanager
def stream(url: str) -> Iterator[Stream]:
    """Open the WebSocket as a program that has the token."""
    address = address_of(url)
    headers = {"Authorization": f"Bearer {address.token}"}
    place = f"ws://127.0.0.1:{address.port}/stream"
    with connect(place, additional_headers=headers, max_size=None, compression=None) as socket:
        yield Stream(socket)
