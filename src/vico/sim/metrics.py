"""Counts of a run, and the wall-clock seconds its phases take; measured only, they decide nothing."""

from __future__ import annotations

import time
from dataclasses import dataclass, field


@dataclass
class Metrics:
    """Counts and seconds of a run so far.

    Attributes
    ----------
    steps, collisions, refused
        Steps taken, motions stopped by something, actions refused.
    seconds
        Wall-clock seconds by phase of the loop.
    """

    steps: int = 0
    collisions: int = 0
    refused: int = 0
    seconds: dict[str, float] = field(default_factory=dict)


class StopWatch:
    """Adds up wall-clock seconds by phase.

    Parameters
    ----------
    into
        Seconds by phase; added to in place.
    """

    def __init__(self, into: dict[str, float]) -> None:
        self._into = into
        self._last = time.perf_counter()

    def lap(self, phase: str) -> None:
        """Add the time since the last lap to a phase."""
        now = time.perf_counter()
        self._into[phase] = self._into.get(phase, 0.0) + now - self._last
        self._last = now
