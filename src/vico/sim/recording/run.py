"""Reading a recorded run: finished, stopped, killed half-way, or still being written by another process."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from vico.errors import EmptyInputError, InputError
from vico.io.files import read_json
from vico.rules import ActionStatus, code_name
from vico.sim.animation.names import CLIPS
from vico.sim.recording.cast import CastMember, read_cast
from vico.sim.recording.checkpoints import Checkpoint, checkpoint_steps, read_checkpoint
from vico.sim.recording.films import View, views_of
from vico.sim.recording.manifest import read_manifest
from vico.sim.recording.schema import AGENTS, METRICS, TABLES, column_values
from vico.sim.recording.segments import Segment, read_table, segments_of

#: Segments kept in memory by a reader that goes back and forth.
_KEPT = 4


@dataclass(frozen=True)
class Tracks:
    """Where everything was in a range of steps.

    Attributes
    ----------
    steps
        Shape ``(s,)``.
    entity
        Bodies that were there at any of the steps, in ascending order, int32, shape ``(n,)``.
    position, yaw, speed
        Metres, radians, metres a second; float64, shapes ``(s, n, 3)``, ``(s, n)`` and ``(s, n)``; NaN where a body was
        not there.
    """

    steps: NDArray[np.int32]
    entity: NDArray[np.int32]
    position: NDArray[np.float64]
    yaw: NDArray[np.float64]
    speed: NDArray[np.float64]


@dataclass(frozen=True)
class AgentRecord:
    """An agent at a step.

    Attributes
    ----------
    action
        What it asked for in the step that ended here, as recorded; None if it asked for nothing.
    status, code, reason
        How that went: a `vico.rules.ActionStatus` in lower case, why (a `ReasonCode`), and why in words.
    clip, phase
        A person's motion (`vico.sim.animation.CLIPS`) and where in its cycle, 0..1; "" and 0 for robots.
    pitch
        Of the gaze, radians.
    posture, room, place, vehicle, held, cash
        As in `vico.sim.state.People`.
    joints
        A robot's joint angles, radians, in the order of its motors; empty for people.
    """

    action: Any
    status: str
    code: str
    reason: str
    clip: str
    phase: float
    pitch: float
    posture: int
    room: int
    place: int
    vehicle: int
    held: tuple[int, int]
    cash: float
    joints: NDArray[np.float64]


@dataclass(frozen=True)
class Moment:
    """Everything that was recorded of a step.

    Attributes
    ----------
    step, time, hash
        Its number, seconds since midnight of the first day, and the hash of the state.
    entity, position, yaw, speed
        Of all bodies, by ascending entity; shapes ``(n,)``, ``(n, 3)``, ``(n,)``, ``(n,)``.
    agents
        By name.
    events
        What happened in the step that ended here; messages among them.
    metrics
        Counts since the start of the run.
    """

    step: int
    time: float
    hash: str
    entity: NDArray[np.int32]
    position: NDArray[np.float64]
    yaw: NDArray[np.float64]
    speed: NDArray[np.float64]
    agents: dict[str, AgentRecord]
    events: list[dict[str, Any]]
    metrics: dict[str, int]


class Run:
    """A recorded run, as far as it came when it was opened or last refreshed; see `read_run`.

    Attributes
    ----------
    path
        Its folder.
    manifest
        ``run.json``.
    agents
        ``agents.json``: who takes part.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.manifest = read_manifest(path)
        self.agents: list[dict[str, Any]] = read_json(path / AGENTS)["agents"]
        self._segments = segments_of(path)
        self._table = lru_cache(maxsize=_KEPT * len(TABLES))(read_table)
        if not self._segments:
            raise EmptyInputError(f"{path}: the run was stopped before its first minute was written; run it anew")

    def __repr__(self) -> str:
        status = self.manifest.get("status", "unfinished")
        return f"Run({str(self.path)!r}: {self.last} steps, {len(self.agents)} agents, {status})"

    def refresh(self) -> bool:
        """Look for what was recorded meanwhile; return whether there is more."""
        before = self.last
        self.manifest = read_manifest(self.path)
        self._segments = segments_of(self.path)
        for name in ("_steps", "cast", "metrics"):
            self.__dict__.pop(name, None)
        return self.last > before

    # What there is.

    def source(self, what: Literal["world", "community"]) -> Path:
        """Return the folder of the world or the community of the run; it may be there no longer."""
        return Path(os.path.normpath(self.path / self.manifest[what]["path"]))

    @property
    def complete(self) -> bool:
        """Whether the run went to its end."""
        return bool(self.manifest["status"] == "complete")

    @property
    def last(self) -> int:
        """The last recorded step; the first is 0, the state before anything happened."""
        return self._segments[-1].last

    @property
    def steps(self) -> NDArray[np.int32]:
        """Numbers of all recorded steps."""
        return np.arange(self.last + 1, dtype=np.int32)

    @property
    def times(self) -> NDArray[np.float64]:
        """Seconds since midnight of the first day, of every step."""
        return np.asarray(self._steps["time"].to_numpy())

    @property
    def hashes(self) -> list[str]:
        """State hashes of every step."""
        found: list[str] = self._steps["hash"].to_pylist()
        return found

    @property
    def counts(self) -> dict[str, NDArray[np.int32]]:
        """Metrics over time: counts since the start, at every step."""
        return {name: self._steps[name].to_numpy() for name in _COUNTS}

    @cached_property
    def cast(self) -> dict[int, CastMember]:
        """Everybody and everything that was there at some step, by entity."""
        return read_cast(self.path, self.last)

    @property
    def names(self) -> dict[str, str]:
        """What everybody and everything that was there is called, by the name a simulation has for it."""
        return {member.agent or member.name: member.name for member in self.cast.values()}

    @cached_property
    def metrics(self) -> dict[str, Any]:
        """Counts and seconds; empty if the run was cut short before they were written."""
        path = self.path / METRICS
        content: dict[str, Any] = read_json(path) if path.exists() else {}
        return content

    @property
    def views(self) -> dict[str, View]:
        """Films of what agents saw, by agent's name; a frame for every step at which it observed."""
        return views_of(self.path, [agent["name"] for agent in self.agents], self.last)

    @property
    def checkpoints(self) -> list[int]:
        """Steps of which the exact state was kept."""
        return [step for step in checkpoint_steps(self.path) if step <= self.last]

    def checkpoint(self, step: int) -> Checkpoint:
        """Return the exact state at one of the `checkpoints`.

        Raises
        ------
        MissingFileError, SchemaError
            If there is none of that step, or it is damaged.
        """
        return read_checkpoint(self.path, step, owner=self.manifest["identity"])

    # What happened.

    def table(self, name: str, first: int = 0, last: int | None = None) -> pa.Table:
        """Return the rows of a table (`docs/formats.md`) from step `first` to step `last`, both included, as stored.

        Raises
        ------
        InputError
            If the steps were not recorded.
        SchemaError
            If a file is damaged.
        """
        end = self.last if last is None else last
        parts = [self._table(segment, name) for segment in self._covering(first, end)]
        table = pa.concat_tables(parts)
        steps = table["step"].to_numpy()
        inside = (steps >= first) & (steps <= end)
        return table if inside.all() else table.filter(pa.array(inside))

    def columns(self, name: str, first: int = 0, last: int | None = None) -> dict[str, NDArray[Any]]:
        """Return the same as arrays in the columns' quantities: metres, radians, seconds."""
        table = self.table(name, first, last)
        return {key: column_values(table, key, column) for key, column in TABLES[name].items()}

    def tracks(self, first: int = 0, last: int | None = None) -> Tracks:
        """Return where everything was from step `first` to step `last`, both included."""
        rows = self.columns("bodies", first, last)
        steps = np.arange(first, (self.last if last is None else last) + 1, dtype=np.int32)
        entity, column = np.unique(rows["entity"], return_inverse=True)
        place = rows["step"] - first, column

        def grid(*names: str) -> NDArray[np.float64]:
            values = np.full((len(steps), len(entity), len(names)), np.nan)
            for k, name in enumerate(names):
                values[(*place, np.full(len(column), k))] = rows[name]
            return values

        return Tracks(steps, entity, grid("x", "y", "z"), grid("yaw")[..., 0], grid("speed")[..., 0])

    @property
    def events(self) -> list[dict[str, Any]]:
        """Everything that happened, in its order; see `events_between`."""
        return self.events_between(0, self.last)

    def events_between(self, first: int, last: int) -> list[dict[str, Any]]:
        """Return what happened in the steps `first` to `last`: ``step`` is the one at whose end it is told."""
        table = self.columns("events", first, last)
        names = list(table)
        rows = zip(*(table[name].tolist() for name in names), strict=True)
        events = [dict(zip(names, row, strict=True)) for row in rows]
        return [event | {"data": json.loads(event["data"])} for event in events]

    def at(self, step: int) -> Moment:
        """Return everything that was recorded of a step, reading its segment alone.

        Raises
        ------
        InputError
            If it was not recorded.
        """
        head = {key: values[0] for key, values in self.columns("steps", step, step).items()}
        bodies = self.columns("bodies", step, step)
        return Moment(
            step,
            float(head["time"]),
            str(head["hash"]),
            bodies["entity"],
            np.column_stack([bodies["x"], bodies["y"], bodies["z"]]),
            bodies["yaw"],
            bodies["speed"],
            self._agents_at(step),
            self.events_between(step, step),
            {name: int(head[name]) for name in _COUNTS},
        )

    def _agents_at(self, step: int) -> dict[str, AgentRecord]:
        names = {agent["entity"]: agent["name"] for agent in self.agents}
        rows = self.columns("agents", step, step)
        people = self.columns("people", step, step)
        motion = {int(e): k for k, e in enumerate(people["entity"])}
        joints = self.columns("joints", step, step)
        found: dict[str, AgentRecord] = {}
        for k, entity in enumerate(rows["entity"].tolist()):
            row = {key: values[k] for key, values in rows.items()}
            moving = motion.get(entity)
            found[names[entity]] = AgentRecord(
                None if row["action"] is None else json.loads(row["action"]),
                ActionStatus(int(row["status"])).name.lower(),
                code_name(int(row["code"])),
                row["reason"],
                "" if moving is None else CLIPS[int(people["clip"][moving])],
                0.0 if moving is None else float(people["phase"][moving]),
                float(row["pitch"]),
                int(row["posture"]),
                int(row["room"]),
                int(row["place"]),
                int(row["vehicle"]),
                (int(row["held_left"]), int(row["held_right"])),
                float(row["cash"]),
                joints["angle"][joints["entity"] == entity],
            )
        return {agent["name"]: found[agent["name"]] for agent in self.agents if agent["name"] in found}

    def _covering(self, first: int, last: int) -> Sequence[Segment]:
        if not 0 <= first <= last <= self.last:
            raise InputError(
                f"{self.path}: steps {first} to {last} were not all recorded; there are steps 0 to {self.last}"
            )
        return [segment for segment in self._segments if segment.first <= last and segment.last >= first]

    @cached_property
    def _steps(self) -> pa.Table:
        return self.table("steps")


_COUNTS = tuple(name for name in TABLES["steps"] if name not in ("step", "time", "hash"))


def read_run(path: Path | str) -> Run:
    """Open a run folder; what is asked of the run is read when it is asked for.

    A run that is being written can be opened, too: it is read as far as it came, and `Run.refresh` looks for more.

    Raises
    ------
    MissingFileError, SchemaError, EmptyInputError
        If it is no run, damaged, of another version, or was stopped before anything was recorded.
    """
    return Run(Path(path))


__all__ = ["AgentRecord", "Moment", "Run", "Tracks", "read_run"]
