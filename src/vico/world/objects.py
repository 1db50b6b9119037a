"""Things that stand in a world, as arrays: street objects, trees, stops, furniture. One row an object."""

from __future__ import annotations

import io
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from vico.errors import MissingFileError, SchemaError
from vico.io.files import write_bytes

GROUPS = ("amenity", "natural", "transit", "indoor")

#: Kinds whose outline hangs over what stands in people's way: the side of their foot at scale 1, metres.
FEET = {
    "tree": 0.55,
    "street_lamp": 0.3,
    "flagpole": 0.25,
    "traffic_signals": 0.2,
    "bus_stop": 0.2,
    "clock": 0.2,
    "sign": 0.15,
    "surveillance": 0.2,
    "traffic_mirror": 0.15,
    "speed_camera": 0.25,
    "railway_signal": 0.25,
    "catenary_mast": 0.35,
    "utility_pole": 0.3,
    "mast": 0.5,
    "lift_gate": 0.35,
}

_TYPES: dict[str, pa.DataType] = {
    "id": pa.string(),
    "entity": pa.int32(),
    "kind": pa.string(),
    "group": pa.string(),
    "prototype": pa.string(),
    "x": pa.float64(),
    "y": pa.float64(),
    "z": pa.float64(),
    "yaw": pa.float64(),
    "scale": pa.float64(),
    "size_x": pa.float64(),
    "size_y": pa.float64(),
    "size_z": pa.float64(),
    "solid": pa.bool_(),
    "room": pa.string(),
}


@dataclass(frozen=True)
class Objects:
    """Objects of a world, all arrays of shape ``(n,)`` in the same order.

    Attributes
    ----------
    id, kind, group, prototype, room
        Text. `group` is one of `GROUPS`; `prototype` names a model of ``prototypes.glb``; `room` is empty outdoors.
    entity
        int32, unique in the world.
    x, y, z
        Where the model's origin (middle of its foot) stands, ENU metres.
    yaw
        Radians, counter-clockwise from east.
    scale
        Uniform factor on the prototype.
    size_x, size_y, size_z
        Bounding box along the object's own axes, after scaling, metres.
    solid
        True if bodies can't pass through it.
    """

    id: NDArray[np.str_]
    entity: NDArray[np.int32]
    kind: NDArray[np.str_]
    group: NDArray[np.str_]
    prototype: NDArray[np.str_]
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    z: NDArray[np.float64]
    yaw: NDArray[np.float64]
    scale: NDArray[np.float64]
    size_x: NDArray[np.float64]
    size_y: NDArray[np.float64]
    size_z: NDArray[np.float64]
    solid: NDArray[np.bool_]
    room: NDArray[np.str_]

    def __len__(self) -> int:
        return len(self.entity)

    @classmethod
    def from_rows(cls, rows: Iterable[Mapping[str, Any]]) -> Objects:
        """Collect mappings that have every column."""
        listed = list(rows)
        columns: dict[str, NDArray[Any]] = {}
        for name, kind in _TYPES.items():
            values = [row[name] for row in listed]
            if kind == pa.string():
                columns[name] = np.array(values, dtype=np.str_)
            else:
                columns[name] = np.array(values, dtype=kind.to_pandas_dtype())
        return cls(**columns)

    @classmethod
    def none(cls) -> Objects:
        """No objects."""
        return cls.from_rows([])

    @classmethod
    def joined(cls, parts: Iterable[Objects]) -> Objects:
        """All objects of several lots, in order."""
        listed = list(parts)
        if not listed:
            return cls.none()
        return cls(**{field.name: np.concatenate([getattr(p, field.name) for p in listed]) for field in fields(cls)})

    def where(self, chosen: NDArray[Any]) -> Objects:
        """Return the rows that a mask or an index array picks."""
        return Objects(**{field.name: getattr(self, field.name)[chosen] for field in fields(self)})

    @property
    def position(self) -> NDArray[np.float64]:
        """Origins, float64, shape ``(n, 3)``."""
        return np.column_stack([self.x, self.y, self.z])

    @property
    def outdoors(self) -> NDArray[np.bool_]:
        """Which objects stand under the sky."""
        return np.asarray(self.room == "", bool)

    def transforms(self) -> NDArray[np.float32]:
        """Model to world, float32, shape ``(n, 4, 4)``."""
        out = np.zeros((len(self), 4, 4), np.float64)
        c, s = np.cos(self.yaw) * self.scale, np.sin(self.yaw) * self.scale
        out[:, 0, 0], out[:, 0, 1] = c, -s
        out[:, 1, 0], out[:, 1, 1] = s, c
        out[:, 2, 2] = self.scale
        out[:, :3, 3] = self.position
        out[:, 3, 3] = 1.0
        return out.astype(np.float32)

    def corners(self) -> NDArray[np.float64]:
        """Corners of the outlines, counter-clockwise, ENU metres, shape ``(n, 4, 2)``."""
        return self._rectangles(self.size_x, self.size_y)

    def feet(self) -> NDArray[np.float64]:
        """Corners of the parts that stand in people's way (a tree's trunk, not its crown), shape ``(n, 4, 2)``."""
        wide, deep = self.size_x.copy(), self.size_y.copy()
        for kind, side in FEET.items():
            chosen = self.kind == kind
            wide[chosen] = deep[chosen] = side * self.scale[chosen]
        return self._rectangles(wide, deep)

    def _rectangles(self, wide: NDArray[np.float64], deep: NDArray[np.float64]) -> NDArray[np.float64]:
        signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * 0.5
        local = np.stack([wide, deep], axis=1)[:, None, :] * signs[None]
        c, s = np.cos(self.yaw)[:, None], np.sin(self.yaw)[:, None]
        x = self.x[:, None] + c * local[..., 0] - s * local[..., 1]
        y = self.y[:, None] + s * local[..., 0] + c * local[..., 1]
        return np.stack([x, y], axis=-1)


def write_objects(path: Path, objects: Objects) -> None:
    """Write `objects` as Parquet, whole or not at all."""
    table = pa.table({name: pa.array(getattr(objects, name).tolist(), kind) for name, kind in _TYPES.items()})
    sink = io.BytesIO()
    pq.write_table(table, sink, compression="zstd")
    write_bytes(path, sink.getvalue())


def read_objects(path: Path) -> Objects:
    """Read what `write_objects` wrote.

    Raises
    ------
    MissingFileError
        If there is no such file.
    SchemaError
        If it is damaged or has other columns.
    """
    try:
        table = pq.read_table(path)
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such file; build the world anew") from None
    except (pa.ArrowException, OSError) as error:
        raise SchemaError(f"{path}: not a readable Parquet file ({error}); build the world anew") from None
    if set(table.column_names) != set(_TYPES):
        odd = sorted(set(table.column_names) ^ set(_TYPES))
        raise SchemaError(f"{path}: columns missing or unknown: {', '.join(odd)}; build the world anew")
    columns: dict[str, NDArray[Any]] = {}
    for name, kind in _TYPES.items():
        if kind == pa.string():
            columns[name] = np.array(table[name].to_pylist(), dtype=np.str_)
        else:
            columns[name] = table[name].to_numpy().astype(kind.to_pandas_dtype())
    return Objects(**columns)
