"""What is new in a run, told to all clients: frames encoded once, JSON messages for those who follow."""

from __future__ import annotations

import asyncio
from concurrent.futures import CancelledError
from contextlib import suppress
from typing import Any

from vico.viewer.server.state import ViewerState
from vico.viewer.sources.frames import NEWEST

# Events that one message holds at most.
_MOST_EVENTS = 200
# Seconds between looks at a run that another process writes, and between messages of counts.
_LOOKS_EVERY, _COUNTS_EVERY = 1.0, 1.0
# Rows of the cast are told beyond this many steps only when they are asked for anew.
_MOST_STEPS = 100_000
# News of some steps are kept for the clients that are told the same.
_MOST_NEWS = 16
# Seconds that the end waits for replies, and then for clients that read slowly; between looks at them.
_REPLIES_WITHIN, _READ_WITHIN, _LOOKS_AT_THEM = 1.0, 1.0, 0.01


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
            self._frame = last, frame.encoded(flags=NEWEST)
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
