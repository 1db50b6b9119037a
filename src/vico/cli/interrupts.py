"""Signals that ask a command to end: Ctrl-C, a batch system's SIGTERM, a terminal that is closed."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

# Those that end a program which does not listen to them; SIGINT raises KeyboardInterrupt already.
_ENDING = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
# A second Ctrl-C sooner than this is the first one, passed on by a program between the terminal and this one.
_SAME = 1.0


class Stopped(KeyboardInterrupt):
    """A command was asked to end; it cleans up as after Ctrl-C.

    Attributes
    ----------
    number
        Of the signal.
    """

    def __init__(self, number: int, sentence: str = "") -> None:
        super().__init__(sentence)
        self.number = number


def signal_of(stop: KeyboardInterrupt) -> int:
    """Return the number of the signal that an interruption came of."""
    return stop.number if isinstance(stop, Stopped) else signal.SIGINT


def exit_code(stop: KeyboardInterrupt) -> int:
    """Return what a shell expects of a command that a signal ended: 130 after Ctrl-C, 143 after SIGTERM."""
    return 128 + signal_of(stop)


@contextmanager
def ended_by_signals() -> Iterator[None]:
    """Let SIGTERM and SIGHUP raise `Stopped` while the block lasts, where nothing else was made of them.

    Signals that whoever started the program had it ignore (``nohup``) stay ignored.
    """

    def stop(number: int, _: FrameType | None) -> None:
        raise Stopped(number)

    with _handled({number: stop for number in _ENDING if _is_usual(number)}):
        yield


class StopRequest:
    """Whether a command was asked to end once it has finished what it is at.

    Attributes
    ----------
    number
        Of the signal; 0 as long as nobody asked.
    """

    def __init__(self) -> None:
        self.number = 0

    def __bool__(self) -> bool:
        return bool(self.number)


@contextmanager
def stopped_between_steps(wake: Callable[[], None] = lambda: None) -> Iterator[StopRequest]:
    """Note the first signal that asks to end, while the block lasts, in place of ending at once.

    A second Ctrl-C ends at once all the same. A second SIGTERM does not: batch systems send it to a process and to
    its group, and a SIGKILL after it.

    Parameters
    ----------
    wake
        Called then, in the main thread, wherever it was: has whoever waits there look at the request.
    """
    asked, when = StopRequest(), 0.0

    def stop(number: int, _: FrameType | None) -> None:
        nonlocal when
        now = time.monotonic()
        if not asked:
            asked.number, when = number, now
            # Not printed: the stream may be in the middle of a line.
            _say("vico: this step is finished and the run kept; Ctrl-C once more ends it at once")
            wake()
        elif number == signal.SIGINT and now - when > _SAME:
            raise Stopped(number)

    numbers = [number for number in (signal.SIGINT, *_ENDING) if signal.getsignal(number) is not signal.SIG_IGN]
    with _handled(dict.fromkeys(numbers, stop)):
        yield asked


def _say(sentence: str) -> None:
    try:
        os.write(2, f"\n{sentence}\n".encode())
    except OSError:
        return  # the terminal is gone; the run is kept all the same


def _is_usual(number: int) -> bool:
    return signal.getsignal(number) is signal.SIG_DFL


@contextmanager
def _handled(handlers: dict[int, Callable[[int, FrameType | None], None]]) -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():
        yield  # Python lets nobody else listen to signals
        return
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
