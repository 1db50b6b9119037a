"""One client of the stream: what it is owed, in bounded queues; what it cannot take is dropped, or it is closed."""

from __future__ import annotations

import asyncio
import itertools
import json
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from vico.errors import VicoError
from vico.viewer.server.hub import COUNTS_EVERY, Hub
from vico.viewer.sources.frames import OF_RANGE

#: JSON messages that may wait for a client; ranges that it may ask for at a time; frames of one.
MOST_WAITING, MOST_RANGES, MOST_FRAMES = 256, 8, 600
#: Close codes: it broke the rules; it reads too slowly; the server ends.
BROKE_RULES, TOO_SLOW, ENDS = 1008, 1013, 1001

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
        if first > last or every < 1 or (last - first) // every >= MOST_FRAMES:
            raise ValueError(f"a range has 1 to {MOST_FRAMES} frames")
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
            frames = await asyncio.to_thread(self._encoded, *steps, asked)
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

    def _encoded(self, first: int, last: int, asked: _Range) -> list[bytes]:
        frames = self._hub.state.source.frames(first, last, asked.every)
        return [frame.encoded(flags=OF_RANGE, range_id=asked.id) for frame in frames]

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
