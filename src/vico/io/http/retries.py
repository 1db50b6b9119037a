"""Trying again: how often, and how long to wait before."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import NamedTuple, TypeVar

from vico.io.http.exchange import HttpError

log = logging.getLogger(__name__)

T = TypeVar("T")


class Backoff(NamedTuple):
    """When to try again.

    Attributes
    ----------
    retries
        Tries after the first.
    first, longest
        Wait after the first failure, seconds, which doubles with each up to the longest.
    longest_asked
        Longest wait a server may ask for, seconds; a server that asks for more is left alone.
    """

    retries: int = 4
    first: float = 1.0
    longest: float = 60.0
    longest_asked: float = 300.0

    def wait(self, attempt: int, asked: float | None = None) -> float:
        """Return the seconds to wait after a failed attempt (counted from 0): what is asked for, if anything."""
        return asked or min(self.first * 2.0**attempt, self.longest)


def with_retries(call: Callable[[], T], *, backoff: Backoff, sleep: Callable[[float], None]) -> T:
    """Return what `call` returns, called again after errors that may pass.

    Raises
    ------
    HttpError
        The last one, with its number of tries.
    """
    for attempt in range(backoff.retries + 1):
        try:
            return call()
        except HttpError as error:
            error.tries = attempt + 1
            wait = backoff.wait(attempt, error.retry_after)
            if not error.transient or attempt == backoff.retries or wait > backoff.longest_asked:
                raise
            # Not the error's text, which may hold a key.
            log.info("HTTP %s; trying again in %.0f s", error.status or type(error.cause).__name__, wait)
        sleep(wait)
    raise AssertionError("the last try returns or raises")
