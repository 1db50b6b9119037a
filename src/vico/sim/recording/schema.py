"""The run folder, version 2: its tables, their columns, how exact each is, and its parts on disk.

`docs/formats.md` tells it in prose. Segments are folders named by their first and last step, each of which appears
whole or not at all. A checkpoint is the exact state of the simulation and of the agents at a step, from which a run
can go on.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from vico.errors import MissingFileError, SchemaError
from vico.io.files import FolderKind, read_json, write_bytes, write_json
from vico.io.plain_data import read_plain, write_plain
from vico.sim.state.snapshot import read_snapshot, write_snapshot

__all__ = [
    "AGENTS",
    "AGENT_STATES",
    "CAST",
    "CHECKPOINTS",
    "CLOCK",
    "COMMUNITY",
    "DEMO_FILM",
    "INTERVENTIONS",
    "MANIFEST",
    "METRICS",
    "REPLAY",
    "RUN_FOLDER",
    "SCHEMA",
    "SEGMENTS",
    "SEGMENT_STEPS",
    "SETUP",
    "SETUP_SHAPES",
    "SIMULATION_STATE",
    "TABLES",
    "VERSION",
    "VIEWER_ADDRESS",
    "VIEWS",
    "Checkpoint",
    "Column",
    "Segment",
    "checkpoint_steps",
    "column_values",
    "drop_checkpoints_after",
    "drop_segments_after",
    "read_checkpoint",
    "read_table",
    "segments_of",
    "table_of",
    "to_stored",
    "write_checkpoint",
    "write_segment",
    "written_folder",
]
SCHEMA = "vico.run"
VERSION = 2

#: A segment ends at every multiple of this many steps, at every checkpoint, and where the run ends.
SEGMENT_STEPS = 60

MANIFEST = "run.json"
AGENTS = "agents.json"
CAST = "cast.jsonl"
METRICS = "metrics.json"
COMMUNITY = "community"
SETUP, SETUP_SHAPES = "setup.json", "setup.glb"
SEGMENTS = "segments"
CHECKPOINTS = "checkpoints"
VIEWS = "views"
#: What of a run's folder replays and films make beside the recording, unless they are told where to.
REPLAY, DEMO_FILM = "replay.html", "demo.mp4"
#: What was done to a run from outside; and where its page is, with the token that opens that.
INTERVENTIONS, VIEWER_ADDRESS = "interventions.jsonl", "viewer.json"
# The film as far as it was made where making it was interrupted.
_DEMO_SO_FAR = "demo.partial.mp4"
#: Of a checkpoint: the arrays of the simulation, what agents remember, and the clock and notes.
SIMULATION_STATE, AGENT_STATES, CLOCK = "simulation.npz", "agents.bin", "clock.json"
_RECORDED = (
    *(MANIFEST, AGENTS, CAST, METRICS, SETUP, SETUP_SHAPES, f"{COMMUNITY}/*.json", f"{SEGMENTS}/*/*.parquet"),
    *(f"{CHECKPOINTS}/*/{name}" for name in (SIMULATION_STATE, AGENT_STATES, CLOCK)),
    *(f"{VIEWS}/*/*.mp4", f"{VIEWS}/*/*.npz"),
)
_BESIDE = (REPLAY, DEMO_FILM, _DEMO_SO_FAR, INTERVENTIONS, VIEWER_ADDRESS)
RUN_FOLDER = FolderKind("run", MANIFEST, lambda _: (*_RECORDED, *_BESIDE))


class Column(NamedTuple):
    """A column of a table.

    Attributes
    ----------
    kind
        Arrow type it is stored as.
    unit
        What a stored 1 stands for, in the column's quantity: 0.001 for millimetres of metres; 0.0 for what is not
        scaled.
    absent
        What stands for the column in runs that were recorded without it; None: there are none.
    """

    kind: pa.DataType
    unit: float = 0.0
    absent: float | None = None


_WHOLE, _SMALL, _TEXT = Column(pa.int32()), Column(pa.int8()), Column(pa.string())
_METRES, _TURN = Column(pa.int32(), 1e-3), Column(pa.int32(), 1e-4)
_PHASE, _PACE = Column(pa.int32(), 1e-4), Column(pa.int32(), 1e-3, 1.0)
_FLOAT = Column(pa.float32())

#: Tables by name; columns by name. Positions are to the millimetre, angles to 0.1 mrad.
TABLES: dict[str, dict[str, Column]] = {
    "steps": {
        "step": _WHOLE,
        "time": Column(pa.float64()),
        "hash": _TEXT,
        "collisions": _WHOLE,
        "refused": _WHOLE,
        "arrivals": _WHOLE,
        "late": _WHOLE,
    },
    "weather": {
        "step": _WHOLE,
        "clouds": _FLOAT,
        "rain": _FLOAT,
        "snow": _FLOAT,
        "visibility": _FLOAT,
        "wind": _FLOAT,
        "wind_from": _FLOAT,
        "temperature": _FLOAT,
        "wet": _FLOAT,
        "snow_cover": _FLOAT,
        "ice": _FLOAT,
        "lamps": _FLOAT,
    },
    "bodies": {
        "entity": _WHOLE,
        "step": _WHOLE,
        "x": _METRES,
        "y": _METRES,
        "z": _METRES,
        "yaw": _TURN,
        "speed": Column(pa.int32(), 1e-3),
        "lights": Column(pa.int8(), absent=0.0),
    },
    "people": {
        "entity": _WHOLE,
        "step": _WHOLE,
        "clip": _SMALL,
        "phase": _PHASE,
        "pace": _PACE,
        "clip_before": Column(pa.int8(), absent=0.0),
        "phase_before": _PHASE._replace(absent=0.0),
        "pace_before": _PACE,
        "clip_time": Column(pa.int32(), 1e-2, 10.0),
        "hold": _SMALL._replace(absent=0.0),
        "hold_share": Column(pa.int8(), 1e-2, 0.0),
    },
    "doors": {"entrance": _WHOLE, "step": _WHOLE, "share": Column(pa.int8(), 1e-2)},
    "agents": {
        "entity": _WHOLE,
        "step": _WHOLE,
        "action": _TEXT,
        "status": _SMALL,
        "code": Column(pa.int16()),
        "reason": _TEXT,
        "pitch": _TURN,
        "posture": _SMALL,
        "room": _WHOLE,
        "place": _WHOLE,
        "vehicle": _WHOLE,
        "held_left": _WHOLE,
        "held_right": _WHOLE,
        "cash": Column(pa.int32(), 1e-2),
    },
    "robots": {
        "entity": _WHOLE,
        "step": _WHOLE,
        "x": _METRES,
        "y": _METRES,
        "z": _METRES,
        "qw": _TURN,
        "qx": _TURN,
        "qy": _TURN,
        "qz": _TURN,
    },
    "joints": {"entity": _WHOLE, "joint": _WHOLE, "step": _WHOLE, "angle": _TURN},
    "events": {
        "step": _WHOLE,
        "time": Column(pa.float64()),
        "kind": _TEXT,
        "agent": _TEXT,
        "text": _TEXT,
        "x": _METRES,
        "y": _METRES,
        "z": _METRES,
        "data": _TEXT,
    },
}

_LARGEST = 2**31 - 1


def to_stored(values: Any, column: Column) -> NDArray[Any]:
    """Return numbers as a column stores them: scaled, rounded, and held within what it can hold."""
    array = np.asarray(values)
    if column.unit:
        # What is not finite belongs to no place; it is stored as the lowest number there is.
        scaled = np.nan_to_num(np.rint(array / column.unit), nan=-_LARGEST, posinf=_LARGEST, neginf=-_LARGEST)
        array = np.clip(scaled, -_LARGEST, _LARGEST)
    return array.astype(column.kind.to_pandas_dtype())


def table_of(name: str, columns: Mapping[str, Sequence[Any] | NDArray[Any]]) -> pa.Table:
    """Return columns as a table of the format, rows in the order in which it stores them best.

    Rows are sorted by what they are about, then by step: what follows each other in a column is then nearly alike.
    """
    form = TABLES[name]
    units = ", ".join(f"{key} {column.unit:g}" for key, column in form.items() if column.unit)
    arrays = [pa.array(columns[key], column.kind) for key, column in form.items()]
    table = pa.table(dict(zip(form, arrays, strict=True))).replace_schema_metadata({"units": units})
    keys = [key for key in ("entity", "joint", "step") if key in form]
    order = np.lexsort([np.asarray(columns[key]) for key in reversed(keys)])
    return table if len(keys) == 1 else table.take(order)


def column_values(table: pa.Table, key: str, column: Column) -> NDArray[Any]:
    """Return a column's values in its quantity: metres, radians, text as objects."""
    if column.absent is not None and key not in table.column_names:
        return np.full(len(table), column.absent)
    values = table[key].to_numpy()
    if column.unit:
        return np.where(values == -_LARGEST, np.nan, values * column.unit)
    return np.asarray(values)


_SEGMENT_NAME = re.compile(r"(\d{8,})-(\d{8,})")


class Segment(NamedTuple):
    """Some steps in a row, recorded.

    Attributes
    ----------
    first, last
        The first and the last of its steps.
    path
        Its folder.
    """

    first: int
    last: int
    path: Path


def segments_of(run: Path) -> list[Segment]:
    """Return the segments of a run in the order of their steps, as far as they follow each other without a gap."""
    folder = run / SEGMENTS
    matches = ((_SEGMENT_NAME.fullmatch(path.name), path) for path in (folder.iterdir() if folder.is_dir() else ()))
    found = sorted(Segment(int(match[1]), int(match[2]), path) for match, path in matches if match is not None)
    whole: list[Segment] = []
    for segment in found:
        if segment.first != (whole[-1].last + 1 if whole else 0):
            break
        whole.append(segment)
    return whole


def write_segment(run: Path, first: int, last: int, tables: Mapping[str, pa.Table]) -> None:
    """Write a segment; tables without rows are left out."""
    folder = run / SEGMENTS / f"{first:08d}-{last:08d}"
    with written_folder(folder) as work:
        for name, table in tables.items():
            if table.num_rows:
                write_bytes(work / f"{name}.parquet", _parquet(name, table))


def read_table(segment: Segment, name: str) -> pa.Table:
    """Return a table of a segment.

    Raises
    ------
    SchemaError
        If its file is damaged.
    """
    path = segment.path / f"{name}.parquet"
    if not path.exists():
        return table_of(name, {key: [] for key in TABLES[name]})
    try:
        return pq.read_table(path, memory_map=False)
    except (pa.ArrowException, OSError) as error:
        raise SchemaError(f"{path}: not readable ({' '.join(str(error).split())}); run it anew") from None


def drop_segments_after(run: Path, step: int) -> None:
    """Delete what was recorded after a step, and what an interrupted writer left unfinished."""
    kept = {segment.path for segment in segments_of(run) if segment.last <= step}
    folder = run / SEGMENTS
    for path in list(folder.iterdir()) if folder.is_dir() else ():
        if path not in kept:
            shutil.rmtree(path)


class written_folder:
    """A folder that takes its name when the block ends well: what it holds is then on the disk."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._work = folder.with_name(f".{folder.name}.partial")

    def __enter__(self) -> Path:
        shutil.rmtree(self._work, ignore_errors=True)
        self._work.mkdir(parents=True)
        return self._work

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is not None:
            shutil.rmtree(self._work, ignore_errors=True)
            return
        # A checkpoint may be taken twice after one step, when somebody has done something in between.
        shutil.rmtree(self._folder, ignore_errors=True)
        os.replace(self._work, self._folder)
        handle = os.open(self._folder.parent, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _parquet(name: str, table: pa.Table) -> bytes:
    """Return a table as Parquet: whole numbers by their differences, text and flags by dictionary, zstd over all."""
    whole = [key for key, column in TABLES[name].items() if column.kind == pa.int32()]
    differences = dict.fromkeys(whole, "DELTA_BINARY_PACKED")
    others = [key for key in table.column_names if key not in differences]
    sink = pa.BufferOutputStream()
    pq.write_table(
        table,
        sink,
        compression="zstd",
        compression_level=9,
        use_dictionary=others,
        column_encoding=differences,
        write_statistics=["step"],
        store_schema=False,
    )
    return bytes(sink.getvalue().to_pybytes())


_CHECKPOINT_NAME = re.compile(r"\d{8,}")


@dataclass(frozen=True)
class Checkpoint:
    """The state of a run at a step.

    Attributes
    ----------
    step
        The step it was taken after.
    arrays
        The whole state of the simulation; `Simulation.restore` goes back to it.
    agents
        State of each agent, by name.
    notes
        What else whoever ran the simulation kept.
    clock
        Wall-clock seconds spent so far: ``wall_seconds`` in all, and ``seconds_by_phase``.
    """

    step: int
    arrays: dict[str, NDArray[Any]]
    agents: dict[str, Any]
    notes: dict[str, Any]
    clock: dict[str, Any]

    @property
    def interventions(self) -> int:
        """How many lines of the run's interventions had been done by then."""
        return int(self.notes.get("interventions", 0))


def write_checkpoint(run: Path, checkpoint: Checkpoint, *, owner: str) -> None:
    """Write a checkpoint, whole or not at all; `owner` is the identity of its simulation."""
    with written_folder(run / CHECKPOINTS / f"{checkpoint.step:08d}") as folder:
        write_snapshot(folder / SIMULATION_STATE, checkpoint.arrays, owner=owner)
        write_plain(folder / AGENT_STATES, {"agents": checkpoint.agents, "notes": checkpoint.notes})
        write_json(folder / CLOCK, checkpoint.clock)


def checkpoint_steps(run: Path) -> list[int]:
    """Return the steps of which a run has checkpoints, in their order."""
    folder = run / CHECKPOINTS
    return sorted(
        int(path.name)
        for path in (folder.iterdir() if folder.is_dir() else ())
        if _CHECKPOINT_NAME.fullmatch(path.name)
    )


def read_checkpoint(run: Path, step: int, *, owner: str) -> Checkpoint:
    """Read a checkpoint.

    Raises
    ------
    MissingFileError
        If there is none of that step.
    SchemaError
        If it is damaged, or of another simulation than `owner`.
    """
    folder = run / CHECKPOINTS / f"{step:08d}"
    if not folder.is_dir():
        steps = ", ".join(map(str, checkpoint_steps(run))) or "none"
        raise MissingFileError(f"{run}: no checkpoint of step {step}; there are: {steps}")
    arrays = read_snapshot(folder / SIMULATION_STATE, owner=owner)
    kept = read_plain(folder / AGENT_STATES)
    return Checkpoint(step, arrays, kept["agents"], kept["notes"], read_json(folder / CLOCK))


def drop_checkpoints_after(run: Path, step: int) -> None:
    """Delete checkpoints of later steps, and what an interrupted writer left unfinished."""
    folder = run / CHECKPOINTS
    kept = {f"{k:08d}" for k in checkpoint_steps(run) if k <= step}
    for path in list(folder.iterdir()) if folder.is_dir() else ():
        if path.name not in kept:
            shutil.rmtree(path)
