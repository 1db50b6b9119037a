"""The container of glTF 2.0 files: the document, its buffers, and the arrays in them.

Files may come from anywhere: sizes and places are checked before anything is read.
"""

from __future__ import annotations

import base64
import binascii
import json
import math
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import SchemaError

_JSON, _BIN = 0x4E4F534A, 0x004E4942
#: Number types by their code.
COMPONENTS: dict[int, np.dtype[Any]] = {
    5120: np.dtype("<i1"),
    5121: np.dtype("<u1"),
    5122: np.dtype("<i2"),
    5123: np.dtype("<u2"),
    5125: np.dtype("<u4"),
    5126: np.dtype("<f4"),
}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_MOST_VALUES = 60_000_000


class GltfFault(ValueError):
    """Something a glTF file must not have; becomes one sentence with the file's name."""


@contextmanager
def gltf_errors(where: str) -> Iterator[None]:
    """Turn whatever a damaged file leads to into one sentence; `where` is what the file is called in it.

    Raises
    ------
    SchemaError
        If the file is damaged, or needs what is not read.
    """
    try:
        yield
    except GltfFault as fault:
        raise SchemaError(f"{where}: {fault}") from None
    except SchemaError:
        raise
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, OverflowError, struct.error) as error:
        told = f"{type(error).__name__}: {' '.join(str(error).split())[:120]}"
        raise SchemaError(f"{where}: not a readable glTF file ({told}); export it anew") from None
    except (RecursionError, MemoryError) as error:
        raise SchemaError(f"{where}: not a readable glTF file ({type(error).__name__}); export it anew") from None


class GltfFile:
    """One glTF document and its buffers.

    Parameters
    ----------
    document
        The JSON.
    binary
        The binary chunk; None without.
    resource
        Fetches what the file refers to by a relative address; None refuses such files.
    """

    def __init__(
        self, document: dict[str, Any], binary: bytes | None, resource: Callable[[str], bytes] | None = None
    ) -> None:
        self.document = document
        self._binary = binary
        self._resource = resource
        self._buffers: dict[int, bytes] = {}

    @classmethod
    def of(cls, data: bytes, resource: Callable[[str], bytes] | None = None) -> GltfFile:
        """Take a binary or textual glTF 2.0 file apart.

        Raises
        ------
        GltfFault
            If it is neither.
        """
        return cls(*_document(data), resource)

    def entry(self, name: str, index: int) -> dict[str, Any]:
        """Return an entry of one of the document's lists; negative numbers name nothing."""
        if not isinstance(index, int) or index < 0:
            raise GltfFault(f"names {name}[{index}], which is not there; export it anew")
        entry = self.document[name][index]
        if not isinstance(entry, dict):
            raise GltfFault(f"{name}[{index}] is no object; export it anew")
        return entry

    def bytes_at(self, uri: str) -> bytes:
        """Return what an address within the document stands for."""
        if uri.startswith("data:"):
            head, _, body = uri.partition(",")
            if not head.endswith(";base64"):
                raise GltfFault("holds a data address that is not base64; export it anew")
            try:
                return base64.b64decode(body, validate=True)
            except binascii.Error:
                raise GltfFault("holds a broken data address; export it anew") from None
        if self._resource is None:
            raise GltfFault(f"refers to {uri[:80]!r} outside itself; export it as one .glb file")
        return self._resource(uri)

    def _buffer(self, index: int) -> bytes:
        if index not in self._buffers:
            uri = self.entry("buffers", index).get("uri")
            if uri is not None:
                self._buffers[index] = self.bytes_at(uri)
            elif index == 0 and self._binary is not None:
                self._buffers[index] = self._binary
            else:
                raise GltfFault(f"its buffer {index} is not there; download it again")
        return self._buffers[index]

    def view(self, index: int) -> tuple[memoryview, int]:
        """Return the bytes of a buffer view, and its stride (0: packed)."""
        view = self.entry("bufferViews", index)
        for name in view.get("extensions", {}):
            if "meshopt" in name:
                raise GltfFault(f"is compressed with {name}, which is not read; export it plain or with Draco")
        buffer = self._buffer(view["buffer"])
        start, size = view.get("byteOffset", 0), view["byteLength"]
        if start < 0 or size < 0 or start + size > len(buffer):
            raise GltfFault(f"buffer view {index} leaves the file; download it again")
        return memoryview(buffer)[start : start + size], int(view.get("byteStride", 0))

    def accessor(self, index: int) -> NDArray[Any]:
        """Return an accessor's values, normalised ones as float."""
        accessor = self.entry("accessors", index)
        kind = COMPONENTS[accessor["componentType"]]
        width = _WIDTHS[accessor["type"]]
        count = accessor["count"]
        if not isinstance(count, int) or not 0 <= count <= _MOST_VALUES:
            raise GltfFault(f"accessor {index} claims {count} values; export it anew")
        if "bufferView" in accessor:
            values = self._read_strided(
                accessor["bufferView"], accessor.get("byteOffset", 0), kind, width, count, index
            )
        else:
            values = np.zeros((count, width), kind)
        sparse = accessor.get("sparse")
        if sparse:
            values = values.copy()
            many = sparse["count"]
            at, new = sparse["indices"], sparse["values"]
            which = self._read_strided(
                at["bufferView"], at.get("byteOffset", 0), COMPONENTS[at["componentType"]], 1, many, index
            )
            values[which[:, 0]] = self._read_strided(
                new["bufferView"], new.get("byteOffset", 0), kind, width, many, index
            )
        if accessor.get("normalized") and kind.kind in "iu":
            values = np.maximum(values / float(np.iinfo(kind).max), -1.0)
        return values[:, 0] if width == 1 else values

    def _read_strided(
        self, view: int, offset: int, kind: np.dtype[Any], width: int, count: int, index: int
    ) -> NDArray[Any]:
        data, stride = self.view(view)
        packed = kind.itemsize * width
        stride = stride or packed
        if count and (offset < 0 or stride < packed or offset + stride * (count - 1) + packed > len(data)):
            raise GltfFault(f"accessor {index} reaches past its buffer view; download it again")
        values: NDArray[Any] = np.ndarray((count, width), kind, data, offset, (stride, kind.itemsize))
        return values


def _document(data: bytes) -> tuple[dict[str, Any], bytes | None]:
    """Return the JSON and the binary chunk."""
    if data[:4] != b"glTF":
        document = json.loads(data)
        if not isinstance(document, dict):
            raise GltfFault("is no glTF document; export it anew")
        return document, None
    if len(data) < 20:
        raise GltfFault(f"truncated after {len(data)} bytes; download it again")
    _, version, length = struct.unpack_from("<III", data)
    if version != 2:
        raise GltfFault(f"is binary glTF {version}; only glTF 2.0 is read: convert it first")
    if length > len(data) or length < 20:
        raise GltfFault(f"truncated at byte {len(data):,} of {length:,}; download it again")
    size, kind = struct.unpack_from("<II", data, 12)
    if kind != _JSON or 20 + size > length:
        raise GltfFault("its first chunk is no JSON, or leaves the file; download it again")
    document = json.loads(data[20 : 20 + size])
    if not isinstance(document, dict):
        raise GltfFault("is no glTF document; export it anew")
    at = 20 + size
    at += -at % 4
    while at + 8 <= length:
        size, kind = struct.unpack_from("<II", data, at)
        if at + 8 + size > length:
            raise GltfFault(f"its chunk at byte {at:,} leaves the file; download it again")
        if kind == _BIN:
            return document, data[at + 8 : at + 8 + size]
        at += 8 + size + (-size % 4)
    return document, None


def node_matrix(node: dict[str, Any]) -> NDArray[np.float64]:
    """Return a node's own transform."""
    if "matrix" in node:
        return np.asarray(node["matrix"], np.float64).reshape(4, 4).T
    matrix = np.eye(4)
    x, y, z, w = np.asarray(node.get("rotation", (0.0, 0.0, 0.0, 1.0)), np.float64)
    size = math.sqrt(x * x + y * y + z * z + w * w)
    if size > 0:
        x, y, z, w = x / size, y / size, z / size, w / size
        matrix[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    matrix[:3, :3] *= np.asarray(node.get("scale", (1.0, 1.0, 1.0)), np.float64)[None, :]
    matrix[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return matrix
