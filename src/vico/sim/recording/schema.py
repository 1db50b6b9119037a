"""The run folder, version 2: its tables, their columns, and how exact each is. `docs/formats.md` tells it in prose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from vico.io.folders import FolderKind

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


def stored(values: Any, column: Column) -> NDArray[Any]:
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


def empty_table(name: str) -> pa.Table:
    """Return a table of the format without rows."""
    return table_of(name, {key: [] for key in TABLES[name]})


def column_values(table: pa.Table, key: str, column: Column) -> NDArray[Any]:
    """Return a column's values in its quantity: metres, radians, text as objects."""
    if column.absent is not None and key not in table.column_names:
        return np.full(len(table), column.absent)
    values = table[key].to_numpy()
    if column.unit:
        return np.where(values == -_LARGEST, np.nan, values * column.unit)
    return np.asarray(values)
