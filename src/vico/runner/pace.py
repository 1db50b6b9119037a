"""How fast a run goes by the clock on the wall: held back to a speed, and measured. It decides nothing in the run."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable

# Who is later than this does not try to make up for it, seconds.
_LATE = 0.5
# The measured speed is that of so many seconds.
_MEASURED = 3.0


class Pace:
    """Holds a run back to a speed.

    Parameters
    ----------
    speed
        Simulated seconds a second; 0 does not hold it back.
    clock
        Seconds of a clock that never goes back.

    Attributes
    ----------
    factor
        Simulated seconds a second of late.
    """

    def __init__(self, speed: float, *, clock: Callable[[], float] = time.monotonic) -> None:
        self.speed = speed
        self.factor = 0.0
        self._clock = clock
        self._anchor: tuple[float, float] | None = None
        self._marks: deque[tuple[float, float]] = deque()

    def ahead(self, second: float) -> float:
        """Return how many seconds a run is ahead that is about to go on from a simulated second; 0 if it is not."""
        now = self._clock()
        if not self.speed:
            self._measure(now, second)
            return 0.0
        if self._anchor is None:
            self._anchor = now, second
        due = self._anchor[0] + (second - self._anchor[1]) / self.speed
        if due > now:
            return due - now
        if now - due > _LATE:
            self._anchor = now, second
        self._measure(now, second)
        return 0.0

    def forget(self) -> None:
        """Begin anew: it was held up, or is to go at another speed."""
        self._anchor = None
        self._marks.clear()
        self.factor = 0.0

    def _measure(self, now: float, second: float) -> None:
        self._marks.append((now, second))
        while now - self._marks[0][0] > _MEASURED:
            self._marks.popleft()
        began, first = self._marks[0]
        if now > began:
            self.factor = (second - first) / (now - began)
