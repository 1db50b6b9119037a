"""The rows of a run's tables, read from its folder or kept from a simulation that goes on; and when each step was.

The timeline has the time of each step and what had been counted by then; it is read once, and further as the run goes
on.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from vico.errors import EmptyInputError, InputError
from vico.sim.recording import Run, read_run
from vico.sim.recording.manifest import CastMember, take_line
from vico.sim.recording.schema import SEGMENT_STEPS, TABLES, Column, to_stored

Columns = dict[str, NDArray[Any]]

#: Steps of a run that goes on which are kept in memory: more than wait to be written.
KEPT = 2 * SEGMENT_STEPS + 10


class StepTables(Protocol):
    """Rows of the tables of a run (`vico.sim.recording.schema.TABLES`)."""

    @property
    def last(self) -> int:
        """The newest step there is; -1 before the first."""

    def rows_between(self, table: str, first: int, last: int) -> Columns:
        """Return the rows of steps `first` to `last`, both included, as stored, in the order of the format.

        Raises
        ------
        InputError
            If the steps are not there.
        """

    def cast(self) -> dict[int, CastMember]:
        """Everybody and everything that was there at some step, by entity."""

    @property
    def run(self) -> Run | None:
        """The run's folder as far as it is written; None before anything is."""


class RecordedTables:
    """The tables of a run folder, which may still be written.

    Parameters
    ----------
    run
        The run.
    """

    def __init__(self, run: Run) -> None:
        self._run = run
        self._lock = threading.Lock()

    @property
    def run(self) -> Run:
        """The run."""
        return self._run

    @property
    def last(self) -> int:
        """The last step that is written."""
        return self._run.last

    def refresh(self) -> bool:
        """Look for what was recorded meanwhile; return whether there is more."""
        with self._lock:
            return self._run.refresh()

    def rows_between(self, table: str, first: int, last: int) -> Columns:
        """Return rows as stored; see `StepTables.rows_between`."""
        with self._lock:
            rows = self._run.table(table, first, last)
            return {key: _column(rows, key, column) for key, column in TABLES[table].items()}

    def cast(self) -> dict[int, CastMember]:
        """Everybody and everything that was there at some step, by entity."""
        with self._lock:
            return self._run.cast


class LiveTables:
    """The newest steps of a run that goes on, kept in memory; older ones are read from its folder.

    Told of steps by one thread, asked by others. Nothing is copied or encoded before somebody asks.

    Parameters
    ----------
    out
        The run's folder.
    kept
        How many steps are kept.
    """

    def __init__(self, out: Path, *, kept: int = KEPT) -> None:
        self.out = out
        self._ring: deque[tuple[int, Mapping[str, Mapping[str, Any]]]] = deque(maxlen=kept)
        self._cast: dict[int, CastMember] = {}
        self._lock, self._reading = threading.Lock(), threading.Lock()
        self._recorded: RecordedTables | None = None
        self._last = -1

    @property
    def last(self) -> int:
        """The newest step."""
        return self._last

    @property
    def run(self) -> Run | None:
        """The run's folder as far as it is written; None before anything is."""
        recorded = self._on_disk()
        return None if recorded is None else recorded.run

    def begin(self) -> None:
        """Take in what is recorded already, where a run goes on."""
        recorded = self._on_disk()
        if recorded is not None:
            self._last = max(self._last, recorded.last)
            with self._lock:
                self._cast = dict(recorded.cast())

    def add(self, step: int, rows: Mapping[str, Mapping[str, Any]], cast: Sequence[Mapping[str, Any]]) -> None:
        """Take in a step.

        Parameters
        ----------
        rows
            By table, in quantities; nobody changes them any more.
        cast
            Lines that the step brought.
        """
        with self._lock:
            self._ring.append((step, rows))
            for line in cast:
                take_line(self._cast, line)
        self._last = step

    def rows_between(self, table: str, first: int, last: int) -> Columns:
        """Return rows as stored; see `StepTables.rows_between`."""
        with self._lock:
            ring = list(self._ring)
        oldest = ring[0][0] if ring else self._last + 1
        if not 0 <= first <= last <= self._last:
            raise InputError(f"steps {first} to {last} are not there; there are steps 0 to {self._last}")
        inside = [(step, rows) for step, rows in ring if first <= step <= last]
        newer = _kept_columns(table, inside)
        if first >= oldest:
            return newer
        older = self._older(table, first, min(last, oldest - 1))
        if last < oldest:
            return older
        return _in_order(table, {key: np.concatenate([older[key], newer[key]]) for key in TABLES[table]})

    def cast(self) -> dict[int, CastMember]:
        """Everybody and everything that was there at some step, by entity."""
        with self._lock:
            return dict(self._cast)

    def _older(self, table: str, first: int, last: int) -> Columns:
        recorded = self._on_disk()
        if recorded is not None and recorded.last < last:
            recorded.refresh()
        if recorded is None or recorded.last < last:
            raise InputError(f"steps {first} to {last} are neither kept nor written yet")
        return recorded.rows_between(table, first, last)

    def _on_disk(self) -> RecordedTables | None:
        with self._reading:
            if self._recorded is None and (self.out / "segments").is_dir():
                try:
                    self._recorded = RecordedTables(read_run(self.out))
                except EmptyInputError:
                    return None
            return self._recorded


def _column(table: pa.Table, key: str, column: Column) -> NDArray[Any]:
    if column.absent is not None and key not in table.column_names:
        return to_stored(np.full(len(table), column.absent), column)
    return np.asarray(table[key].to_numpy())


def _kept_columns(name: str, rows: Sequence[tuple[int, Mapping[str, Mapping[str, Any]]]]) -> Columns:
    parts = [tables[name] for _, tables in rows if name in tables]
    found: Columns = {}
    for key, column in TABLES[name].items():
        if column.kind == pa.string():
            found[key] = np.array([value for part in parts for value in part[key]], object)
        else:
            found[key] = to_stored(np.concatenate([np.zeros(0), *(part[key] for part in parts)]), column)
    return _in_order(name, found)


def _in_order(name: str, columns: Columns) -> Columns:
    keys = [key for key in ("entity", "joint", "step") if key in columns]
    if len(keys) == 1:
        return columns
    order = np.lexsort([columns[key] for key in reversed(keys)])
    return {key: values[order] for key, values in columns.items()}


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
        new = self._tables.rows_between("steps", known, last)
        self._times = np.concatenate([self._times, new["time"]])
        self._counts = {name: np.concatenate([values, new[name]]) for name, values in self._counts.items()}
