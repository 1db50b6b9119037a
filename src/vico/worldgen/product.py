"""What a stage made, as bytes and back: plain data, arrays, geometries and our own records, nothing executable.

A product is a tree of dataclasses, records, lists and arrays. It is written as one JSON tree whose leaves may point
at blobs; arrays that are shared in memory (a texture used by many surfaces) are written once and shared again after
reading. Only data classes, records and enumerations of this package are ever made from a file.
"""

from __future__ import annotations

import importlib
import json
import struct
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from hashlib import sha256
from pathlib import Path, PurePath
from typing import Any

import numpy as np
import pyarrow as pa
import shapely
from numpy.typing import NDArray
from pydantic import BaseModel
from shapely.errors import ShapelyError
from shapely.geometry.base import BaseGeometry

from vico.errors import SchemaError
from vico.io.files import write_bytes
from vico.threads import in_order

_MAGIC = b"vicoprod"
_MOST_BLOB = 2 << 30


class _Writer:
    def __init__(self) -> None:
        self.blobs: list[bytes | memoryview] = []
        self._known: dict[int, dict[str, Any]] = {}
        self._alive: list[Any] = []  # objects in `_known` must not be collected while their id is in use

    def blob(self, data: bytes | memoryview) -> int:
        self.blobs.append(data)
        return len(self.blobs) - 1

    def tree(self, value: Any) -> Any:
        if isinstance(value, Enum):
            return {"enum": _name_of(type(value)), "value": self.tree(value.value)}
        if value is None or isinstance(value, bool | str) or type(value) in (int, float):
            return value
        if isinstance(value, np.ndarray | BaseGeometry | bytes):
            if id(value) not in self._known:
                self._known[id(value)] = self._leaf(value)
                self._alive.append(value)
            return self._known[id(value)]
        if isinstance(value, np.generic):
            return {"scalar": value.dtype.str, "value": value.item()}
        if isinstance(value, BaseModel):
            return {"record": _name_of(type(value)), "value": value.model_dump(mode="json")}
        if is_dataclass(value) and not isinstance(value, type):
            content = {f.name: self.tree(getattr(value, f.name)) for f in fields(value)}
            return {"data": _name_of(type(value)), "value": content}
        if isinstance(value, list):
            return [self.tree(item) for item in value]
        if isinstance(value, tuple):
            return {"tuple": [self.tree(item) for item in value]}
        if isinstance(value, Mapping):
            return {"dict": [[self.tree(key), self.tree(item)] for key, item in value.items()]}
        if isinstance(value, set | frozenset):
            return {"set": sorted((self.tree(item) for item in value), key=json.dumps)}
        if isinstance(value, PurePath):
            return {"path": str(value)}
        raise TypeError(f"a product can't hold a {type(value).__module__}.{type(value).__qualname__}")

    def _leaf(self, value: NDArray[Any] | BaseGeometry | bytes) -> dict[str, Any]:
        if isinstance(value, bytes):
            return {"bytes": self.blob(value)}
        if isinstance(value, BaseGeometry):
            return {"shape": self.blob(shapely.to_wkb(value, include_srid=False))}
        if value.dtype == object:
            return {"objects": [self.tree(item) for item in value.ravel().tolist()], "of": list(value.shape)}
        return {
            # A view and no copy: the pages of a district's photos fill half a gigabyte.
            "array": self.blob(np.ascontiguousarray(value).reshape(-1).view(np.uint8).data),
            "type": value.dtype.str,
            "of": list(value.shape),
        }


class _Reader:
    def __init__(self, blobs: list[Any]) -> None:
        self._blobs = blobs
        self._known: dict[int, Any] = {}

    def value(self, node: Any) -> Any:
        if isinstance(node, list):
            return [self.value(item) for item in node]
        if not isinstance(node, dict):
            return node
        kind = next(iter(node))
        content = node[kind]
        if kind in ("array", "bytes", "shape"):
            if content not in self._known:
                self._known[content] = self._leaf(kind, node)
            return self._known[content]
        if kind == "objects":
            array = np.empty(len(content), object)
            array[:] = [self.value(item) for item in content]
            return array.reshape(node["of"])
        if kind == "scalar":
            return np.dtype(content).type(node["value"])
        if kind == "tuple":
            return tuple(self.value(item) for item in content)
        if kind == "dict":
            return {self.value(key): self.value(item) for key, item in content}
        if kind == "set":
            return {self.value(item) for item in content}
        if kind == "path":
            return Path(content)
        made = _type_of(content)
        if kind == "enum" and issubclass(made, Enum):
            return made(self.value(node["value"]))
        if kind == "record" and issubclass(made, BaseModel):
            return made.model_validate_json(json.dumps(node["value"]))
        if kind == "data" and is_dataclass(made):
            given = {f.name for f in fields(made) if f.init}
            make: Any = made
            return make(**{name: self.value(item) for name, item in node["value"].items() if name in given})
        raise ValueError(f"unknown kind {kind!r}")

    def _leaf(self, kind: str, node: dict[str, Any]) -> Any:
        data = self._blobs[node[kind]]
        if kind == "bytes":
            return bytes(data)
        if kind == "shape":
            return shapely.from_wkb(bytes(data))
        # The array lives in what was decompressed, which can be written to.
        return np.frombuffer(data, np.dtype(node["type"])).reshape(node["of"])


def _name_of(kind: type) -> str:
    if not kind.__module__.startswith("vico."):
        raise TypeError(f"a product can't hold a {kind.__module__}.{kind.__qualname__}")
    return f"{kind.__module__}:{kind.__qualname__}"


def _type_of(name: str) -> Any:
    module, _, path = str(name).partition(":")
    if not module.startswith("vico."):
        raise ValueError(f"{name!r} is none of our types")
    found: Any = importlib.import_module(module)
    for part in path.split("."):
        found = vars(found)[part]
    if not (isinstance(found, type) and (is_dataclass(found) or issubclass(found, BaseModel | Enum))):
        raise ValueError(f"{name!r} is no record")
    return found


def packed(value: Any) -> tuple[bytes, list[bytes | memoryview]]:
    """Return the tree of a product as JSON, and its blobs."""
    writer = _Writer()
    tree = json.dumps(writer.tree(value), separators=(",", ":"), ensure_ascii=False).encode()
    return tree, writer.blobs


def digest_of(value: Any) -> str:
    """SHA-256 of a product: equal content, equal digest, in any process."""
    return _digest(*packed(value))


def _digest(tree: Any, blobs: list[Any]) -> str:
    total = sha256(struct.pack("<Q", len(tree)))
    total.update(tree)
    for blob in blobs:
        total.update(struct.pack("<Q", len(blob)))
        total.update(blob)
    return total.hexdigest()


def write_product(path: Path, value: Any, *, key: str) -> str:
    """Write a product with the key it was made under, whole or not at all; return its digest."""
    tree, blobs = packed(value)
    digest = _digest(tree, blobs)
    codec = pa.Codec("zstd", compression_level=1)
    small = list(in_order(lambda blob: codec.compress(blob, asbytes=True), (tree, *blobs)))
    sizes = [(len(raw), len(s)) for raw, s in zip((tree, *blobs), small, strict=True)]
    head = json.dumps({"key": key, "digest": digest, "sizes": sizes}).encode()
    write_bytes(path, [_MAGIC, struct.pack("<Q", len(head)), head, *small])
    return digest


def read_head(path: Path) -> tuple[str, str]:
    """Key and digest of a product; what to compare before reading it whole.

    Raises
    ------
    SchemaError
        If it is damaged.
    """
    head, _ = _head(path)
    return str(head["key"]), str(head["digest"])


def _head(path: Path) -> tuple[dict[str, Any], int]:
    try:
        with path.open("rb") as file:
            start = file.read(16)
            (length,) = struct.unpack("<Q", start[8:])
            if start[:8] != _MAGIC or length > 64 << 20:
                raise ValueError("no stage product")
            head = json.loads(file.read(length))
        if not {"key", "digest", "sizes"} <= set(head):
            raise ValueError("its head is incomplete")
    except (OSError, ValueError, struct.error, TypeError) as error:
        raise SchemaError(f"{path}: not a readable stage product ({error}); build the world anew") from None
    return head, 16 + length


def read_product(path: Path) -> tuple[Any, str]:
    """Read what `write_product` wrote: the product and its digest.

    Raises
    ------
    SchemaError
        If the file is damaged (its digest is checked) or holds anything but our records.
    """
    head, start = _head(path)
    try:
        data = memoryview(path.read_bytes())
        codec = pa.Codec("zstd")
        parts = []
        for raw, small in head["sizes"]:
            if not 0 <= raw <= _MOST_BLOB or not 0 <= small <= len(data) - start:
                raise ValueError("truncated")
            chunk = data[start : start + small]
            parts.append(codec.decompress(chunk, raw) if raw else bytearray())
            start += small
        tree, blobs = parts[0], parts[1:]
        if _digest(tree, list(blobs)) != head["digest"]:
            raise ValueError("its content is not what its digest says")
        value = _Reader(blobs).value(json.loads(bytes(tree)))
    except (OSError, ValueError, KeyError, IndexError, TypeError, AttributeError, ImportError, ShapelyError) as error:
        raise SchemaError(f"{path}: not a readable stage product ({error}); build the world anew") from None
    return value, str(head["digest"])
