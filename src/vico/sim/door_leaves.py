"""Leaves of the doors of houses: those that are not closed, and how far each is open."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Seconds that a door takes to open or to close.
SWING = 0.6


class DoorLeaves:
    """The doors of a world that are not closed; all the others are.

    Attributes
    ----------
    entrance
        Row of each in ``world.entrances``, ascending, int32, shape ``(n,)``.
    share
        How far it is open, 0..1, float64, shape ``(n,)``.
    held
        Seconds for which it is still held open, float64, shape ``(n,)``; then it closes.
    """

    def __init__(self) -> None:
        self.entrance = np.zeros(0, np.int32)
        self.share = np.zeros(0)
        self.held = np.zeros(0)

    def __len__(self) -> int:
        return len(self.entrance)

    def arrays(self) -> dict[str, NDArray[Any]]:
        """Every array by name."""
        return {"entrance": self.entrance, "share": self.share, "held": self.held}

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Go back to what `arrays` held."""
        self.entrance, self.share, self.held = (np.array(arrays[name]) for name in ("entrance", "share", "held"))

    def hold(self, entrance: int, seconds: float) -> None:
        """Have a door open, or stay open, for some seconds."""
        k = int(np.searchsorted(self.entrance, entrance))
        if k == len(self) or self.entrance[k] != entrance:
            self.entrance = np.insert(self.entrance, k, entrance).astype(np.int32)
            self.share, self.held = np.insert(self.share, k, 0.0), np.insert(self.held, k, 0.0)
        self.held[k] = max(float(self.held[k]), seconds)

    def share_of(self, entrance: int) -> float:
        """Return how far a door is open, 0..1."""
        k = int(np.searchsorted(self.entrance, entrance))
        return float(self.share[k]) if k < len(self) and self.entrance[k] == entrance else 0.0

    def advance(self, dt: float) -> None:
        """Open and close doors for `dt` seconds."""
        if not len(self):
            return
        way = np.where(self.held > 1e-6, dt, -dt) / SWING
        self.share = np.clip(self.share + way, 0.0, 1.0)
        self.held = np.maximum(self.held - dt, 0.0)
        there = (self.share > 1e-6) | (self.held > 1e-6)
        if not there.all():
            self.entrance, self.share, self.held = self.entrance[there], self.share[there], self.held[there]
