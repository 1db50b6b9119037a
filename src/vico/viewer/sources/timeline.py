"""When each step of a run was, and what had been counted by then; read once, and further as the run goes on."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.viewer.sources.tables import StepTables

COUNTS = ("collisions", "refused", "arrivals", "late")
# Times that differ by less are equal, seconds.
_SAME = 1e-6


class Timeline:
    """Times and counts of all steps.

    Parameters
    ----------
    tables
        Of the run.
    """

    def __init__(self, tables: StepTables) -> None:
        self._tables = tables
        self._lock = threading.Lock()
        self._times = np.zeros(0)
        self._counts = {name: np.zeros(0, np.int32) for name in COUNTS}

    def times(self) -> NDArray[np.float64]:
        """Return seconds since midnight of the first day, of every step."""
        with self._lock:
            self._read()
            return self._times

    def pieces(self) -> list[dict[str, Any]]:
        """Return the times of all steps as pieces in which steps are equally long."""
        times = self.times()
        if len(times) < 2:
            return [{"first": 0, "time": float(times[0]) if len(times) else 0.0, "period": 1.0}]
        gaps = np.diff(times)
        # A piece begins with the step before its first gap.
        begins = [0, *(np.flatnonzero(np.abs(np.diff(gaps)) > _SAME) + 1).tolist()]
        return [{"first": k, "time": float(times[k]), "period": round(float(gaps[k]), 6)} for k in begins]

    def metrics(self, first: int, last: int, points: int) -> dict[str, Any]:
        """Return counts at some steps of a range, evenly spaced, its last one among them."""
        with self._lock:
            self._read()
            end = min(last, len(self._times) - 1)
            every = max((end - first) // max(points - 1, 1), 1)
            steps = np.unique(np.append(np.arange(first, end + 1, every), end)) if end >= first else np.zeros(0, int)
            told = {name: values[steps].tolist() for name, values in self._counts.items()}
            return {"step": steps.tolist(), "time": self._times[steps].tolist(), **told}

    def _read(self) -> None:
        known, last = len(self._times), self._tables.last
        if last < known:
            return
        new = self._tables.stored("steps", known, last)
        self._times = np.concatenate([self._times, new["time"]])
        self._counts = {name: np.concatenate([values, new[name]]) for name, values in self._counts.items()}
