"""Reading a recorded run: whole, stopped, or killed half-way."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from vico.errors import EmptyInputError, MissingFileError, SchemaError
from vico.io.files import read_json

SCHEMA = "vico.run"
VERSION = 1


@dataclass(frozen=True)
class Run:
    """A recorded run, as far as it came.

    Attributes
    ----------
    manifest
        ``run.json``.
    steps, times, hashes
        Recorded steps (0 is the state before the first), seconds of the day, and state hashes; shape ``(s,)``.
    entity
        Bodies in the manifest's order, int32, shape ``(n,)``.
    position, yaw
        By step and body, float32, shapes ``(s, n, 3)`` and ``(s, n)``; NaN where a body was not there.
    clip, status
        By step and body, shape ``(s, n)``; -1 where a body has none. Clips are indices into
        `vico.sim.avatars.CLIPS`, statuses values of `vico.rules.ActionStatus`.
    events
        As in ``events.jsonl``, those of recorded steps only.
    """

    path: Path
    manifest: dict[str, Any]
    steps: NDArray[np.int32]
    times: NDArray[np.float64]
    hashes: list[str]
    entity: NDArray[np.int32]
    position: NDArray[np.float32]
    yaw: NDArray[np.float32]
    clip: NDArray[np.int16]
    status: NDArray[np.int8]
    events: list[dict[str, Any]]

    @property
    def complete(self) -> bool:
        """Whether the run went to its end."""
        return bool(self.manifest["status"] == "complete")

    @cached_property
    def metrics(self) -> dict[str, Any]:
        """Counts and seconds; empty if the run was cut short before they were written."""
        path = self.path / "metrics.json"
        content: dict[str, Any] = read_json(path) if path.exists() else {}
        return content

    @cached_property
    def views(self) -> dict[str, Path]:
        """Films of what agents saw, by agent's name; a frame a step, the first for step 0."""
        names = [agent["name"] for agent in self.manifest["agents"]]
        return {name: path for name in names if (path := self.path / "views" / f"{name}.mp4").exists()}


def read_run(path: Path) -> Run:
    """Read a run folder.

    Raises
    ------
    MissingFileError, SchemaError, EmptyInputError
        If it is no run, damaged, of another version, or was stopped before anything was recorded.
    """
    if not (path / "run.json").exists():
        raise MissingFileError(f"{path}: holds no run.json; make a run with vico run")
    manifest = read_json(path / "run.json")
    if not isinstance(manifest, dict) or manifest.get("schema_name") != SCHEMA:
        raise SchemaError(f"{path}/run.json: not a {SCHEMA} file; give a run folder")
    if manifest.get("version") != VERSION:
        raise SchemaError(
            f"{path}/run.json: version {manifest.get('version')!r} of {SCHEMA}, not {VERSION}; run it anew"
        )
    count = min(len(_parts(path / "states")), len(_parts(path / "steps")))
    if count == 0:
        raise EmptyInputError(f"{path}: the run was stopped before its first minute was written; run it anew")
    states, steps = _tables(path / "states", count), _tables(path / "steps", count)
    entity = np.array([body["entity"] for body in manifest["bodies"]], np.int32)
    numbers = steps["step"].to_numpy()
    order = np.argsort(entity, kind="stable")
    column = order[np.searchsorted(entity[order], states["entity"].to_numpy())]
    row = np.searchsorted(numbers, states["step"].to_numpy())
    shape = (len(numbers), len(entity))

    def grid(name: str, empty: float, kind: Any) -> NDArray[Any]:
        values = np.full(shape, empty, kind)
        values[row, column] = states[name].to_numpy()
        return values

    return Run(
        path,
        manifest,
        numbers,
        steps["time"].to_numpy(),
        steps["hash"].to_pylist(),
        entity,
        np.stack([grid(name, np.nan, np.float32) for name in "xyz"], axis=-1),
        grid("yaw", np.nan, np.float32),
        grid("clip", -1, np.int16),
        grid("status", -1, np.int8),
        _events(path / "events.jsonl", int(numbers[-1])),
    )


def _parts(folder: Path) -> list[Path]:
    return sorted(folder.glob("part-*.parquet"))


def _tables(folder: Path, count: int) -> pa.Table:
    try:
        return pa.concat_tables([pq.read_table(path) for path in _parts(folder)[:count]])
    except (pa.ArrowException, OSError) as error:
        raise SchemaError(f"{folder}: not readable ({error}); run it anew") from None


def _events(path: Path, last: int) -> list[dict[str, Any]]:
    if not path.exists():
        return []
    events = []
    lines = path.read_text(encoding="utf-8").split("\n")
    for number, line in enumerate(lines, 1):
        if not line:
            continue
        try:
            event = json.loads(line)
        except json.JSONDecodeError as error:
            # A kill may cut the last line short; anywhere else the file is damaged.
            if number == len(lines):
                break
            raise SchemaError(f"{path}: line {number} is not JSON ({error}); run it anew") from None
        if event["step"] < last:
            events.append(event)
    return events
