"""An event of a run, with what its kind and place make of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vico.sim.environment.city_event import CityEvent
from vico.sim.environment.event_kinds import EventKind


@dataclass(frozen=True)
class Occurrence:
    """An event of a run.

    Attributes
    ----------
    id
        Counts from 1; an event keeps it.
    middle
        The point it is at, ENU metres.
    circles
        Ground that it closes to people: x, y and radius, ENU metres.
    """

    id: int
    event: CityEvent
    kind: EventKind
    middle: NDArray[np.float64]
    circles: tuple[tuple[float, float, float], ...]

    @property
    def noise(self) -> float:
        """How loud it is 10 m from its middle, dB; 0 for not at all."""
        return self.kind.noise if self.event.noise is None else self.event.noise
