"""Ctrl+C and a request to end: work is finished up to a good place, and what was done is kept."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

#: Exit code of a program that a signal ended: 128 and the signal's number.
_ENDED_BY = 128


class Stopped(KeyboardInterrupt):
    """Work that was stopped from outside and kept: what to say of it, and the exit code."""

    def __init__(self, sentence: str, number: int) -> None:
        super().__init__(sentence)
        self.code = _ENDED_BY + number


class Interrupts:
    """Whether the program was asked to end.

    Attributes
    ----------
    number
        Of the signal; 0 while nobody asked.
    """

    number = 0

    def __bool__(self) -> bool:
        return self.number != 0


@contextmanager
def taken_note_of() -> Iterator[Interrupts]:
    """Take note of SIGINT and SIGTERM within a block instead of ending there; a second one ends it at once.

    Signals reach the main thread alone: in others they stay as they are.
    """
    asked = Interrupts()
    if threading.current_thread() is not threading.main_thread():
        yield asked
        return

    def note(number: int, frame: FrameType | None) -> None:
        if asked:
            raise KeyboardInterrupt
        asked.number = number

    before: dict[int, Any] = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield asked
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
