"""Routes of the viewer's server: the page, the city and the run over HTTP, and frames over a WebSocket.

A `Client` is owed what it asked for, in bounded queues: what it cannot take is dropped, or it is closed. The `Stream`
reads what clients ask for and holds them to the rules (docs/viewer_protocol.md).
"""

from __future__ import annotations

import asyncio
import itertools
import json
import struct
import time
from collections import deque
from collections.abc import Awaitable, Callable, Iterator, Mapping
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Any

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, Response
from starlette.routing import BaseRoute, Mount, Route
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from vico.errors import InputError, MissingFileError, VicoError
from vico.viewer.server.state import COUNTS_EVERY, Hub, ViewerState
from vico.viewer.sources.frames import OF_RANGE
from vico.viewer.sources.source import PROTOCOL
from vico.viewer.sources.views import NoPictureError

MOST_WAITING = 256  #: JSON messages for a client
MOST_RANGES = 8  #: that a client may ask for at a time
MOST_FRAMES_OF_RANGE = 600
# Close codes.
BROKE_RULES = 1008  #: the client broke the rules
TOO_SLOW = 1013  #: the client reads too slowly
ENDS = 1001  #: the server ends

# Frames of a range that are encoded at once.
_BATCH = 30
_MOST_RATE = 60.0
_numbers = itertools.count(1)


@dataclass
class _Range:
    """Frames that a client has asked for and waits for."""

    id: int
    steps: Iterator[tuple[int, int]]
    every: int
    sent: int = 0


class Client:
    """What one client is owed; its `write` sends it.

    Parameters
    ----------
    socket
        Accepted.
    hub
        Of the server.
    """

    def __init__(self, socket: WebSocket, hub: Hub) -> None:
        self.number = next(_numbers)
        self._socket, self._hub = socket, hub
        self._awake = asyncio.Event()
        self._waiting: deque[dict[str, Any]] = deque()
        self._ranges: dict[int, _Range] = {}
        self._period: float | None = None
        self._next = self._next_counts = self._next_control = 0.0
        self._sent = self._told = -1
        self._control: dict[str, Any] | None = None
        self._you = -1
        self._epoch = hub.epoch
        self._overflow = False

    def tell(self, message: dict[str, Any]) -> None:
        """Have a JSON message sent."""
        if len(self._waiting) >= MOST_WAITING:
            self._overflow = True
        else:
            self._waiting.append(message)
        self._awake.set()

    def follow(self, rate: float) -> None:
        """Have the newest frames sent, at most so many a second."""
        self._period = 1.0 / min(max(rate, 1.0), _MOST_RATE)
        if self._told < 0:
            self._told = self._hub.state.source.last
        self._awake.set()

    def unfollow(self) -> None:
        """Send no more newest frames."""
        self._period = None

    def ask(self, number: int, first: int, last: int, every: int) -> None:
        """Have the frames of a range sent.

        Raises
        ------
        ValueError
            If it is too long, or too many are waited for.
        """
        if len(self._ranges) >= MOST_RANGES:
            raise ValueError(f"{MOST_RANGES} ranges are waited for already")
        if first > last or every < 1 or (last - first) // every >= MOST_FRAMES_OF_RANGE:
            raise ValueError(f"a range has 1 to {MOST_FRAMES_OF_RANGE} frames")
        chunk = _BATCH * every
        steps = ((begin, min(begin + chunk - 1, last)) for begin in range(first, last + 1, chunk))
        self._ranges[number] = _Range(number, steps, every)
        self._awake.set()

    def cancel(self, number: int) -> None:
        """Send no more frames of a range."""
        self._ranges.pop(number, None)

    async def write(self) -> None:
        """Send what is owed, as fast as the client reads it, until it is gone."""
        listeners = self._hub.listeners
        listeners.add(self._awake)
        try:
            while not self._overflow:
                self._awake.clear()
                await self._send_waiting()
                self._look()
                if self._waiting:
                    continue
                if self._hub.over:
                    await self._socket.close(ENDS, "the server ends")
                    return
                busy = await self._send_newest()
                busy |= await self._send_range()
                if not busy and not self._waiting:
                    await self._sleep()
            await self._socket.close(TOO_SLOW, "messages wait that were not read")
        except (WebSocketDisconnect, RuntimeError):
            pass  # it is gone: whoever reads from it knows
        finally:
            listeners.discard(self._awake)

    def _look(self) -> None:
        """Put what is new into the queue: how the run stands, the agent that is played, counts."""
        state, now = self._hub.state, asyncio.get_running_loop().time()
        if self._epoch != self._hub.epoch:
            self._epoch, self._sent, self._you = self._hub.epoch, -1, -1
            self._told = state.source.last
            self.tell({"type": "run", "path": str(state.source.path), "last": state.source.last})
        if state.hands is not None:
            control = state.hands.told()
            if self._control is None or _differs(control, self._control) or now >= self._next_control:
                self._control, self._next_control = control, now + COUNTS_EVERY
                self.tell({"type": "control", **control})
        if state.player is not None and state.player.owner() == self.number:
            you = state.player.newest()
            if you is not None and you["step"] != self._you:
                self._you = you["step"]
                self.tell({"type": "you", **you})
        if self._period is not None and now >= self._next_counts and state.source.last >= 0:
            self._next_counts = now + COUNTS_EVERY
            self.tell(self._hub.counts())

    async def _send_waiting(self) -> None:
        while self._waiting:
            await self._socket.send_text(json.dumps(self._waiting.popleft(), ensure_ascii=False))

    async def _send_newest(self) -> bool:
        """Send the newest frame if it is time, and what happened since the last one; return whether it was sent."""
        now = asyncio.get_running_loop().time()
        if self._period is None or now < self._next or self._hub.state.source.last == self._sent:
            return False
        step, frame = self._hub.newest()
        if step < 0:
            return False
        self._next = max(self._next + self._period, now)
        if step < self._told:
            self._told = step  # the run was taken back
        for message in self._hub.news(self._told, step):
            self.tell(message)
        self._sent = self._told = step
        await self._socket.send_bytes(frame)
        return True

    async def _send_range(self) -> bool:
        """Send some frames of the range that was asked for first; return whether there was one."""
        if not self._ranges:
            return False
        asked = next(iter(self._ranges.values()))
        steps = next(asked.steps, None)
        if steps is None:
            self._end(asked)
            return True
        try:
            frames = await asyncio.to_thread(self._encode_range, *steps, asked)
        except VicoError as error:
            self._end(asked, str(error))
            return True
        for frame in frames:
            if asked.id not in self._ranges:
                break
            await self._socket.send_bytes(frame)
            asked.sent += 1
            await self._send_waiting()
        return True

    def _encode_range(self, first: int, last: int, asked: _Range) -> list[bytes]:
        frames = self._hub.state.source.frames(first, last, asked.every)
        return [frame.to_bytes(flags=OF_RANGE, range_id=asked.id) for frame in frames]

    def _end(self, asked: _Range, error: str = "") -> None:
        if self._ranges.pop(asked.id, None) is not None:
            self.tell({"type": "range_end", "id": asked.id, "sent": asked.sent} | ({"error": error} if error else {}))

    async def _sleep(self) -> None:
        """Wait for something new, or until the next frame may be sent."""
        timeout: float | None = None
        if self._period is not None and self._hub.state.source.last != self._sent:
            timeout = max(self._next - asyncio.get_running_loop().time(), 0.001)
        with suppress(TimeoutError):
            await asyncio.wait_for(self._awake.wait(), timeout)


def _differs(control: Mapping[str, Any], before: Mapping[str, Any]) -> bool:
    """Whether more is different than how far the run is."""
    return any(control[name] != before[name] for name in control.keys() - {"step", "factor"})


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
            client.tell(_error_reply(number, "this is a recording that nobody writes here: nothing can be done in it"))
        else:
            self._reply(client, number, hands.command(name, arguments))

    def _keys(self, client: Client, message: Mapping[str, Any]) -> None:
        if self._hub.state.player is not None:
            self._hub.state.player.keys(client.number, message)

    def _do(self, client: Client, message: Mapping[str, Any]) -> None:
        number, player = _whole(message, "id"), self._hub.state.player
        if player is None:
            client.tell(_error_reply(number, "nobody is played here"))
        else:
            self._reply(client, number, player.do(client.number, message["action"]))

    def _reply(self, client: Client, number: int, done: Future[dict[str, Any]]) -> None:
        task = asyncio.create_task(_reply_when_done(client, number, done))
        self._hub.replies.add(task)
        task.add_done_callback(self._hub.replies.discard)


async def _reply_when_done(client: Client, number: int, done: Future[dict[str, Any]]) -> None:
    try:
        result = await asyncio.wrap_future(done)
    except VicoError as error:
        client.tell(_error_reply(number, str(error)))
    else:
        client.tell({"type": "reply", "id": number, "ok": True, **result})


def _error_reply(number: int, sentence: str) -> dict[str, Any]:
    return {"type": "reply", "id": number, "ok": False, "error": sentence}


def _whole(message: Mapping[str, Any], name: str, usual: int | None = None) -> int:
    value = message.get(name, usual)
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= _MOST_STEP:
        raise ValueError(f"{name} has to be a whole number")
    return value


PAGE = Path(__file__).parents[1] / "page"
#: Steps whose frames one answer holds at most.
MOST_FRAMES = 600

# Of one answer.
_MOST_EVENTS = 5000
_MOST_POINTS = 5000
_MOST_HITS = 100
_LONGEST_QUERY = 200  # characters

Handler = Callable[[Request], Awaitable[Response]]
_Answer = Callable[[ViewerState, Request], Awaitable[Response]]


def routes(state: ViewerState) -> list[BaseRoute]:
    """Return the routes of a server.

    Parameters
    ----------
    state
        What it shows.
    """
    found: list[BaseRoute] = [
        Route("/", _handler(state, _page_answer)),
        Route("/three/index.js", _handler(state, _three_answer)),
        Mount("/page", StaticFiles(directory=PAGE, check_dir=False)),
        Route("/api/person/{entity:int}.bin", _handler(state, _person_answer)),
    ]
    found += [Route(f"/api/{name}", _handler(state, answer)) for name, answer in _API.items()]
    if state.city is not None:
        found.append(Mount("/city", StaticFiles(directory=state.city)))
    return found


def _handler(state: ViewerState, answer: _Answer) -> Handler:
    """Return a handler that makes sentences of our errors."""

    @wraps(answer)
    async def handle(request: Request) -> Response:
        try:
            return await answer(state, request)
        except MissingFileError as error:
            return JSONResponse({"error": str(error)}, 404)
        except VicoError as error:
            return JSONResponse({"error": str(error)}, 400)

    return handle


async def _page_answer(state: ViewerState, request: Request) -> Response:
    return FileResponse(PAGE / "index.html", media_type="text/html; charset=utf-8")


async def _three_answer(state: ViewerState, request: Request) -> Response:
    return FileResponse(state.three(), media_type="text/javascript")


async def _run_answer(state: ViewerState, request: Request) -> Response:
    head = await run_in_threadpool(state.source.head)
    return _json(head | state.more())


async def _cast_answer(state: ViewerState, request: Request) -> Response:
    since = _number(request, "since", None, 0, None)
    return _json(await run_in_threadpool(state.source.cast, since))


async def _moment_answer(state: ViewerState, request: Request) -> Response:
    step = _step(state, request, "step", state.source.last)
    agent = request.query_params.get("agent", "")[:_LONGEST_QUERY]
    return _json(await run_in_threadpool(state.source.moment, step, agent))


async def _events_answer(state: ViewerState, request: Request) -> Response:
    first, last = _range(state, request)
    limit = _number(request, "limit", 1000, 1, _MOST_EVENTS)
    return _json(await run_in_threadpool(state.source.events, first, last, limit))


async def _metrics_answer(state: ViewerState, request: Request) -> Response:
    first, last = _range(state, request)
    points = _number(request, "points", 500, 2, _MOST_POINTS)
    told = await run_in_threadpool(state.source.metrics, first, last, points)
    return _json(told | {"speed": state.factor()})


async def _signals_answer(state: ViewerState, request: Request) -> Response:
    return _json(await run_in_threadpool(lambda: state.source.signals))


async def _search_answer(state: ViewerState, request: Request) -> Response:
    text = request.query_params.get("q", "")[:_LONGEST_QUERY]
    limit = _number(request, "limit", 20, 1, _MOST_HITS)
    return _json(await run_in_threadpool(state.source.search, text, limit))


async def _view_answer(state: ViewerState, request: Request) -> Response:
    agent, output = (request.query_params.get(key, "")[:_LONGEST_QUERY] for key in ("agent", "output"))
    step = _step(state, request, "step", state.source.last)
    try:
        content, kind = await run_in_threadpool(state.view, agent, step, output or "rgb")
    except NoPictureError as error:
        # An answer like any other: a page asks for each step, and a 404 would be a fault in its browser's console.
        return _json({"picture": None, "reason": str(error)})
    except VicoError as error:
        return JSONResponse({"error": str(error)}, 404)
    if isinstance(content, Mapping):
        return _json(content)
    headers = {"X-Depth": "255*exp(-metres/20)"} if output == "depth" else {}
    return Response(content, media_type=kind, headers=headers)


async def _frames_answer(state: ViewerState, request: Request) -> Response:
    first, last = _range(state, request)
    every = _number(request, "every", 1, 1, 100_000)
    if (last - first) // every >= MOST_FRAMES:
        raise InputError(f"frames of {(last - first) // every + 1} steps; ask for {MOST_FRAMES} at most")

    def content() -> bytes:
        frames = [frame.to_bytes() for frame in state.source.frames(first, last, every)]
        return b"".join(struct.pack("<I", len(frame)) + frame for frame in frames)

    return Response(await run_in_threadpool(content), media_type="application/octet-stream")


async def _person_answer(state: ViewerState, request: Request) -> Response:
    content = await run_in_threadpool(state.person, request.path_params["entity"])
    return Response(content, media_type="application/octet-stream")


_API: dict[str, _Answer] = {
    "run": _run_answer,
    "cast": _cast_answer,
    "moment": _moment_answer,
    "events": _events_answer,
    "metrics": _metrics_answer,
    "search": _search_answer,
    "signals": _signals_answer,
    "view": _view_answer,
    "frames": _frames_answer,
}


def _json(content: Mapping[str, Any]) -> Response:
    # Not a number is no JSON; nothing that is told here is one.
    return Response(json.dumps(content, ensure_ascii=False, allow_nan=False), media_type="application/json")


def _range(state: ViewerState, request: Request) -> tuple[int, int]:
    first, last = _step(state, request, "first", 0), _step(state, request, "last", state.source.last)
    if first > last:
        raise InputError(f"first is {first}, after last, which is {last}")
    return first, last


def _step(state: ViewerState, request: Request, name: str, usual: int) -> int:
    return _number(request, name, usual, 0, max(state.source.last, 0))


def _number(request: Request, name: str, usual: Any, low: int, high: int | None) -> Any:
    """Return a number of the query, or the usual one where it is left out.

    Raises
    ------
    InputError
        If it is no whole number, or out of range.
    """
    text = request.query_params.get(name)
    if text is None:
        return usual
    try:
        value = int(text[:20])
    except ValueError:
        raise InputError(f"{name} is {text[:20]!r}; it has to be a whole number") from None
    if value < low or (high is not None and value > high):
        raise InputError(f"{name} is {value}; it has to be {low} to {'any' if high is None else high}")
    return value
