"""What the files of a 3D tileset hold: b3dm, cmpt and glb taken apart, everything else named."""

from __future__ import annotations

import json
import struct
import zlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import SchemaError

# In a legacy b3dm header the field read as a table's length is the start of the next section: '{"' or 'glTF'.
_TEXT = 0x22000000
_MOST_NESTED = 4
_MOST_INNER = 10_000
_MOST_UNPACKED = 1 << 30
_UNREAD = {b"i3dm": "instanced models (i3dm)", b"pnts": "a point cloud (pnts)", b"vctr": "vector data (vctr)"}
_COMPONENTS = {
    "BYTE": "<i1",
    "UNSIGNED_BYTE": "<u1",
    "SHORT": "<i2",
    "UNSIGNED_SHORT": "<u2",
    "INT": "<i4",
    "UNSIGNED_INT": "<u4",
    "FLOAT": "<f4",
    "DOUBLE": "<f8",
}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


@dataclass(frozen=True)
class TileContent:
    """The model in a tile's file.

    Attributes
    ----------
    model
        A glTF file, binary or text.
    centre
        RTC_CENTER of the feature table: what is added to positions turned z up, before the tile's transform; zeros
        without.
    batch
        The batch table, by column: one value a feature.
    """

    model: bytes
    centre: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    batch: dict[str, list[Any]] = field(default_factory=dict)


@dataclass(frozen=True)
class TileFile:
    """A tile's file taken apart.

    Attributes
    ----------
    tileset
        The document, if the file is another tileset.
    models
        The models it holds.
    left_out
        Why what else it holds is not read.
    """

    tileset: dict[str, Any] | None = None
    models: tuple[TileContent, ...] = ()
    left_out: tuple[str, ...] = ()


def read_tile_file(data: bytes, where: str) -> TileFile:
    """Take a tile's file apart by what it says it is, whatever its name.

    Raises
    ------
    SchemaError
        If it is damaged or of no known kind.
    """
    try:
        return _taken_apart(_unpacked(data, where), where, 0)
    except (struct.error, ValueError, KeyError, IndexError, TypeError, AttributeError, OverflowError) as error:
        if isinstance(error, SchemaError):
            raise
        raise SchemaError(f"{where}: damaged ({' '.join(str(error).split())[:100]}); download it again") from None
    except RecursionError:
        raise SchemaError(f"{where}: JSON nested too deeply; export it anew") from None


def _unpacked(data: bytes, where: str) -> bytes:
    """Return the bytes, without the gzip that some exporters wrap every file in."""
    if data[:2] != b"\x1f\x8b":
        return data
    unpacker = zlib.decompressobj(wbits=31)
    try:
        plain = unpacker.decompress(data, _MOST_UNPACKED)
    except zlib.error as error:
        raise SchemaError(f"{where}: broken gzip ({error}); download it again") from None
    if not unpacker.eof:
        raise SchemaError(f"{where}: gzip that is truncated or unpacks to too much; download it again")
    return plain


def _taken_apart(data: bytes, where: str, depth: int) -> TileFile:
    magic = data[:4]
    if magic == b"glTF":
        return TileFile(models=(TileContent(data),))
    if magic == b"b3dm":
        return TileFile(models=(_b3dm(data, where),))
    if magic == b"cmpt":
        return _cmpt(data, where, depth)
    if magic in _UNREAD:
        return TileFile(left_out=(f"{_UNREAD[magic]} are not read",))
    if data.lstrip(b"\xef\xbb\xbf \t\r\n")[:1] == b"{":
        document = json.loads(data.removeprefix(b"\xef\xbb\xbf"))
        if isinstance(document.get("root"), dict):
            return TileFile(tileset=document)
        if "meshes" in document or "scenes" in document:
            return TileFile(models=(TileContent(data),))
        raise SchemaError(f"{where}: JSON that is neither a tileset nor glTF; check the address")
    raise SchemaError(f"{where}: begins with {magic!r}, which is no 3D tile; check the address")


def _length(data: bytes, where: str) -> int:
    """Return the length a tile's header claims, which the file must have."""
    if len(data) < 12:
        raise SchemaError(f"{where}: truncated after {len(data)} bytes; download it again")
    version, length = struct.unpack_from("<II", data, 4)
    if version != 1:
        raise SchemaError(f"{where}: {data[:4].decode()} version {version}; only version 1 is read")
    if not 12 <= length <= len(data):
        raise SchemaError(f"{where}: truncated at byte {len(data):,} of {length:,}; download it again")
    return int(length)


def _cmpt(data: bytes, where: str, depth: int) -> TileFile:
    length = _length(data, where)
    (count,) = struct.unpack_from("<I", data, 12)
    if depth >= _MOST_NESTED or count > _MOST_INNER:
        raise SchemaError(f"{where}: composite of {count:,} tiles, {depth + 1} deep; that is too many")
    models: list[TileContent] = []
    left_out: list[str] = []
    at = 16
    for k in range(count):
        inner = data[at:length]
        if inner[:4] == b"glTF" and len(inner) >= 12:
            (size,) = struct.unpack_from("<I", inner, 8)
        else:
            size = _length(inner, f"{where}, part {k}")
        part = _taken_apart(inner[:size], f"{where}, part {k}", depth + 1)
        models += part.models
        left_out += part.left_out
        at += max(size, 12)
    return TileFile(models=tuple(models), left_out=tuple(left_out))


def _b3dm(data: bytes, where: str) -> TileContent:
    length = _length(data, where)
    if length < 28:
        raise SchemaError(f"{where}: a b3dm of {length} bytes holds nothing; download it again")
    feature_json, feature_binary, batch_json, batch_binary = struct.unpack_from("<IIII", data, 12)
    at, count = 28, 0
    if batch_json >= _TEXT:  # header of 20 bytes: batch length, batch table
        count, batch_json, at = feature_json, feature_binary, 20
        feature_json = feature_binary = batch_binary = 0
    elif batch_binary >= _TEXT:  # header of 24 bytes: batch table as text, as binary, batch length
        count, batch_json, batch_binary, at = batch_json, feature_json, feature_binary, 24
        feature_json = feature_binary = 0
    ends = np.cumsum([at, feature_json, feature_binary, batch_json, batch_binary]).tolist()
    if ends[-1] > length:
        raise SchemaError(f"{where}: its tables leave the file (byte {ends[-1]:,} of {length:,}); download it again")
    start, centre_at, batch_at, columns_at, model_at = ends
    features, batch = data[start:centre_at], data[batch_at:columns_at]
    centre = np.zeros(3)
    if features.strip():
        table = json.loads(features)
        count = int(table.get("BATCH_LENGTH", count))
        said = table.get("RTC_CENTER")
        if isinstance(said, dict):
            said = struct.unpack_from("<fff", data[centre_at:batch_at], said["byteOffset"])
        if said is not None:
            centre = np.asarray(said, np.float64)
            if centre.shape != (3,) or not np.isfinite(centre).all():
                raise SchemaError(f"{where}: RTC_CENTER is no point; export it anew")
    columns = _columns(json.loads(batch), data[columns_at:model_at], count, where) if batch.strip() else {}
    return TileContent(data[model_at:length], centre, columns)


def _columns(table: dict[str, Any], binary: bytes, count: int, where: str) -> dict[str, list[Any]]:
    """Return the columns of a batch table, those in its binary part too."""
    columns: dict[str, list[Any]] = {}
    for name, value in table.items():
        if isinstance(value, list):
            columns[name] = value
        elif isinstance(value, dict) and "byteOffset" in value:
            width = _WIDTHS[value["type"]]
            kind = np.dtype(_COMPONENTS[value["componentType"]])
            start = value["byteOffset"]
            if start < 0 or count < 0 or start + count * width * kind.itemsize > len(binary):
                raise SchemaError(f"{where}: batch table column {name!r} leaves the table; download it again")
            values = np.frombuffer(binary, kind, count * width, start)
            columns[name] = (values if width == 1 else values.reshape(count, width)).tolist()
    return columns
