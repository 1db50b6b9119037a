"""The WebSocket: reads what clients ask for, and holds them to the rules."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from contextlib import suppress
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from vico.errors import VicoError
from vico.viewer.server.client import BROKE_RULES, Client
from vico.viewer.server.hub import Hub
from vico.viewer.sources.source import PROTOCOL

#: Bytes of a message, and messages a second, that a client may send.
LONGEST_MESSAGE, MOST_MESSAGES = 16 * 1024, 200

_MOST_STEP = 2**31 - 1


class Stream:
    """Serves the WebSocket.

    Parameters
    ----------
    hub
        Of the server.
    """

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        self._answers: dict[str, Callable[[Client, Mapping[str, Any]], None]] = {
            "range": self._range,
            "cancel": self._cancel,
            "follow": self._follow,
            "unfollow": self._unfollow,
            "command": self._command,
            "keys": self._keys,
            "do": self._do,
            "ping": self._ping,
        }

    async def serve(self, socket: WebSocket) -> None:
        """Talk with one client until it is gone."""
        await socket.accept()
        self._hub.count(1)
        client = Client(socket, self._hub)
        client.tell(self._hello())
        writer = asyncio.create_task(client.write())
        reader = asyncio.create_task(self._read(socket, client))
        try:
            await asyncio.wait({writer, reader}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in (writer, reader):
                task.cancel()
            await asyncio.gather(writer, reader, return_exceptions=True)
            if self._hub.state.player is not None:
                self._hub.state.player.leave(client.number)
            self._hub.count(-1)

    async def _read(self, socket: WebSocket, client: Client) -> None:
        budget, before = float(MOST_MESSAGES), time.monotonic()
        with suppress(WebSocketDisconnect):
            while True:
                message = await socket.receive()
                if message["type"] != "websocket.receive":
                    return
                now = time.monotonic()
                budget = min(budget + (now - before) * MOST_MESSAGES, MOST_MESSAGES) - 1.0
                before = now
                reason = "too many messages" if budget < 0 else self._take(client, message.get("text"))
                if reason:
                    await socket.close(BROKE_RULES, reason)
                    return

    def _take(self, client: Client, text: str | None) -> str:
        """Do what a message asks for; return why the client is to be closed, "" if it is not."""
        if text is None or len(text) > LONGEST_MESSAGE:
            return "messages are JSON text of at most 16 KiB"
        try:
            message = json.loads(text)
            answer = self._answers[message["type"]]
        except (ValueError, KeyError, TypeError, RecursionError):
            return f"no message with a type among {', '.join(self._answers)}"
        try:
            answer(client, message)
        except (KeyError, TypeError, ValueError) as error:
            return f"{message['type']}: {str(error)[:80]}"
        return ""

    def _hello(self) -> dict[str, Any]:
        state = self._hub.state
        manifest = state.source.manifest
        run = {"identity": manifest["identity"], "path": str(state.source.path), "last": state.source.last}
        return {"type": "hello", "protocol": PROTOCOL, "run": run, "live": state.source.live, **state.more()}

    def _range(self, client: Client, message: Mapping[str, Any]) -> None:
        number, first, last = (_whole(message, name) for name in ("id", "first", "last"))
        client.ask(number, first, last, _whole(message, "every", 1))

    def _cancel(self, client: Client, message: Mapping[str, Any]) -> None:
        client.cancel(_whole(message, "id"))

    def _follow(self, client: Client, message: Mapping[str, Any]) -> None:
        rate = message.get("rate", 10)
        if isinstance(rate, bool) or not isinstance(rate, int | float):
            raise ValueError("rate has to be a number")
        client.follow(float(rate))

    def _unfollow(self, client: Client, message: Mapping[str, Any]) -> None:
        client.unfollow()

    def _ping(self, client: Client, message: Mapping[str, Any]) -> None:
        client.tell({"type": "pong", "id": _whole(message, "id", 0)})

    def _command(self, client: Client, message: Mapping[str, Any]) -> None:
        number, name, arguments = _whole(message, "id"), message["command"], message.get("arguments", {})
        if not isinstance(name, str) or not isinstance(arguments, dict):
            raise ValueError("command has to be a name, arguments an object")
        hands = self._hub.state.hands
        if hands is None:
            client.tell(_failed(number, "this is a recording that nobody writes here: nothing can be done in it"))
        else:
            self._reply(client, number, hands.command(name, arguments))

    def _keys(self, client: Client, message: Mapping[str, Any]) -> None:
        if self._hub.state.player is not None:
            self._hub.state.player.keys(client.number, message)

    def _do(self, client: Client, message: Mapping[str, Any]) -> None:
        number, player = _whole(message, "id"), self._hub.state.player
        if player is None:
            client.tell(_failed(number, "nobody is played here"))
        else:
            self._reply(client, number, player.do(client.number, message["action"]))

    def _reply(self, client: Client, number: int, done: Future[dict[str, Any]]) -> None:
        task = asyncio.create_task(_replied(client, number, done))
        self._hub.replies.add(task)
        task.add_done_callback(self._hub.replies.discard)


async def _replied(client: Client, number: int, done: Future[dict[str, Any]]) -> None:
    try:
        result = await asyncio.wrap_future(done)
    except VicoError as error:
        client.tell(_failed(number, str(error)))
    else:
        client.tell({"type": "reply", "id": number, "ok": True, **result})


def _failed(number: int, sentence: str) -> dict[str, Any]:
    return {"type": "reply", "id": number, "ok": False, "error": sentence}


def _whole(message: Mapping[str, Any], name: str, usual: int | None = None) -> int:
    value = message.get(name, usual)
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= _MOST_STEP:
        raise ValueError(f"{name} has to be a whole number")
    return value
