"""Frames: what the page needs to draw a step, with sun and weather, and their bytes (docs/viewer_protocol.md)."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import SchemaError
from vico.sim.environment.environment import Sky
from vico.viewer.sources.tables import Columns, StepTables

SKY_FIELDS = 16
_WEATHER_FIELDS = (
    "clouds",
    "rain",
    "snow",
    "visibility",
    "wind",
    "wind_from",
    "temperature",
    "wet",
    "snow_cover",
    "ice",
    "lamps",
)
_MINUTE = 60


class Skylight:
    """Tells where the sun stands over a run, and puts the weather beside it.

    Parameters
    ----------
    sky
        Over the run's world; None where that is not there: then nobody knows where the sun stands.
    """

    def __init__(self, sky: Sky | None) -> None:
        self.over = sky
        self._sun = lru_cache(maxsize=4096)(self._sun_at)

    def sky(self, time: float, air: Mapping[str, Any] | None) -> NDArray[np.float32]:
        """Return the sky of a step, float32, shape ``(16,)``; NaN for what is not known.

        Parameters
        ----------
        time
            Seconds since midnight of the first day.
        air
            Row of the table ``weather``; None in runs from before it.
        """
        found = np.full(SKY_FIELDS, np.nan, np.float32)
        found[:4] = self._sun(int(time))
        if air is not None:
            found[4 : 4 + len(_WEATHER_FIELDS)] = [air[key] for key in _WEATHER_FIELDS]
        found[-1] = 0.0
        return found

    def _sun_at(self, second: int) -> tuple[float, float, float, float]:
        if self.over is None:
            return np.nan, np.nan, np.nan, np.nan
        x, y, z = self.over.sun(second).tolist()
        # As `vico.sim.environment.Environment.dark` has it: a minute at a time.
        return x, y, z, self.over.dark(second // _MINUTE * _MINUTE)


MAGIC, VERSION = 0x56, 2
#: Flags: it answers a range; it is the newest.
OF_RANGE, NEWEST = 1, 2

#: Columns by table, each with its type, in their order.
FRAME_COLUMNS: dict[str, dict[str, str]] = {
    "bodies": {"entity": "<i4", "x": "<i4", "y": "<i4", "z": "<i4", "yaw": "<i4", "speed": "<i4", "lights": "u1"},
    "people": {
        "entity": "<i4",
        "phase": "<i4",
        "pace": "<i4",
        "phase_before": "<i4",
        "pace_before": "<i4",
        "clip_time": "<i4",
        "clip": "i1",
        "clip_before": "i1",
        "hold": "i1",
        "hold_share": "i1",
    },
    "agents": {
        "entity": "<i4",
        "pitch": "<i4",
        "room": "<i4",
        "place": "<i4",
        "vehicle": "<i4",
        "held_left": "<i4",
        "held_right": "<i4",
        "cash": "<i4",
        "posture": "i1",
        "status": "i1",
    },
    "robots": dict.fromkeys(("entity", "x", "y", "z", "qw", "qx", "qy", "qz"), "<i4"),
    "joints": dict.fromkeys(("entity", "joint", "angle"), "<i4"),
    "doors": {"entrance": "<i4", "share": "i1"},
}
# Doors that a frame tells of at most: their number is a byte.
_MOST_DOORS = 255

# Magic, version, flags, doors; step; time; rows of each other table; the range's id.
_HEAD = struct.Struct("<BBBBId5II")
_HEAD_BYTES = _HEAD.size + 4 * SKY_FIELDS
# Steps whose rows are looked for at once.
_CHUNK = 60


@dataclass(frozen=True)
class Frame:
    """A step, as it is drawn.

    Attributes
    ----------
    step, time
        Its number, and seconds since midnight of the first day.
    sky
        As `vico.viewer.sources.frames` has it, float32, shape ``(16,)``.
    tables
        Columns by table, as stored, of the types in `FRAME_COLUMNS`.
    """

    step: int
    time: float
    sky: NDArray[np.float32]
    tables: Mapping[str, Columns]

    def to_bytes(self, *, flags: int = 0, range_id: int = 0) -> bytes:
        """Return the bytes of the frame."""
        most = {"doors": _MOST_DOORS}
        counts = {
            name: min(len(self.tables[name][next(iter(form))]), most.get(name, 2**31))
            for name, form in FRAME_COLUMNS.items()
        }
        doors = counts.pop("doors")
        head = _HEAD.pack(MAGIC, VERSION, flags, doors, self.step, self.time, *counts.values(), range_id)
        parts = [head, self.sky.astype("<f4").tobytes()]
        for name, form in FRAME_COLUMNS.items():
            for key, kind in form.items():
                content = self.tables[name][key][: most.get(name)].astype(kind).tobytes()
                parts.append(content + bytes(-len(content) % 4))
        return b"".join(parts)


def decode_frame(content: bytes) -> tuple[Frame, int, int]:
    """Return the frame that some bytes are, its flags, and the id of the range that it answers.

    Raises
    ------
    SchemaError
        If they are no frame of this version.
    """
    if len(content) < _HEAD_BYTES or content[0] != MAGIC or content[1] != VERSION:
        raise SchemaError(f"frame: {len(content)} bytes are no frame of version {VERSION}")
    _, _, flags, doors, step, time, *counts, range_id = _HEAD.unpack_from(content)
    sky = np.frombuffer(content, "<f4", SKY_FIELDS, _HEAD.size)
    at, tables = _HEAD_BYTES, dict[str, Columns]()
    for (name, form), n in zip(FRAME_COLUMNS.items(), (*counts, doors), strict=True):
        tables[name] = {}
        for key, kind in form.items():
            size = n * np.dtype(kind).itemsize
            if at + size > len(content):
                raise SchemaError(f"frame: ends within {name}.{key}")
            tables[name][key] = np.frombuffer(content, kind, n, at)
            at += size + -size % 4
    return Frame(step, time, sky, tables), flags, range_id


def frames_between(tables: StepTables, skylight: Skylight, first: int, last: int, every: int = 1) -> Iterator[Frame]:
    """Yield the frames of steps `first` to `last`, both included, every so many.

    Raises
    ------
    InputError
        If the steps are not there.
    """
    wanted = range(first, last + 1, every)
    chunk = max(_CHUNK // every, 1)
    for begin in range(0, len(wanted), chunk):
        steps = wanted[begin : begin + chunk]
        begin_step, end_step = steps[0], steps[-1]
        times = tables.rows_between("steps", begin_step, end_step)["time"]
        weather = tables.rows_between("weather", begin_step, end_step)
        rows = {name: _ByStep(tables.rows_between(name, begin_step, end_step)) for name in FRAME_COLUMNS}
        for step in steps:
            time = float(times[step - begin_step])
            air = {key: values[step - begin_step] for key, values in weather.items()} if len(weather["step"]) else None
            found = {name: rows[name].of(step, FRAME_COLUMNS[name]) for name in FRAME_COLUMNS}
            yield Frame(step, time, skylight.sky(time, air), found)


class _ByStep:
    """Rows of a table, found by their step."""

    def __init__(self, columns: Columns) -> None:
        order = np.argsort(columns["step"], kind="stable")
        self._columns = {key: values[order] for key, values in columns.items()}

    def of(self, step: int, form: Mapping[str, str]) -> Columns:
        begin, end = np.searchsorted(self._columns["step"], [step, step + 1])
        return {key: self._columns[key][begin:end].astype(kind) for key, kind in form.items()}
