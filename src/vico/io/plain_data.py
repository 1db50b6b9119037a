"""Nested plain data as bytes and back: JSON values and NumPy arrays, no objects and no pickle.

::

    8 bytes   b"VICOPD1" and a line feed
    4 bytes   length of the header, little-endian
    header    JSON: {"value": ..., "arrays": [[dtype, shape], ...]}; an array stands in the value as {"__array__": k}
    rest      the arrays' bytes, one after the other

What comes from outside may be anything: `decode` builds nothing but what is named above, and no more than was sent.
A file holds the same, compressed by zlib.
"""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError, MissingFileError, SchemaError
from vico.io.files import write_bytes

_MAGIC = b"VICOPD1\n"
_ARRAY = "__array__"
_KINDS = "biufSU"  # truth values, numbers and text of fixed width
_DEEPEST = 32
_LARGEST = 1 << 30  # bytes of a file when it is unpacked


def encode(value: Any) -> bytes:
    """Return plain data as bytes; tuples become lists, and NumPy's numbers plain ones.

    Raises
    ------
    InputError
        If anything in it is none of this; the message says where.
    """
    arrays: list[NDArray[Any]] = []
    shown = _to_json(value, "", 0, arrays)
    kinds = [[array.dtype.str, list(array.shape)] for array in arrays]
    header = json.dumps({"value": shown, "arrays": kinds}, ensure_ascii=False, separators=(",", ":"))
    try:
        head = header.encode()
    except UnicodeEncodeError:
        raise InputError("plain data: text that is no Unicode (half of a surrogate pair)") from None
    return b"".join([_MAGIC, len(head).to_bytes(4, "little"), head, *(array.tobytes() for array in arrays)])


def decode(content: bytes) -> Any:
    """Return what `encode` was given.

    Raises
    ------
    SchemaError
        If the bytes are anything else.
    """
    head = len(_MAGIC) + 4
    if content[: len(_MAGIC)] != _MAGIC or len(content) < head:
        raise SchemaError("plain data: not of this form")
    end = head + int.from_bytes(content[len(_MAGIC) : head], "little")
    try:
        header = json.loads(content[head:end].decode())
        kinds, value = header["arrays"], header["value"]
        arrays, end = [], min(end, len(content))
        for name, shape in kinds:
            array, end = _array(content, end, name, shape)
            arrays.append(array)
        if end != len(content):
            raise SchemaError(f"plain data: {len(content) - end} bytes too many")
        return _from_json(value, arrays)
    except (ValueError, TypeError, KeyError, IndexError, RecursionError) as error:
        if isinstance(error, SchemaError):
            raise
        raise SchemaError(f"plain data: damaged ({type(error).__name__}: {str(error)[:100]})") from None


def write_plain(path: Path, value: Any) -> None:
    """Write plain data to a file, whole or not at all; see `encode`."""
    write_bytes(path, zlib.compress(encode(value)))


def read_plain(path: Path) -> Any:
    """Read what `write_plain` wrote.

    Raises
    ------
    MissingFileError
        If there is no such file.
    SchemaError
        If it is damaged, or of more than 1 GiB.
    """
    try:
        packed = path.read_bytes()
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such file") from None
    unpacking = zlib.decompressobj()
    try:
        content = unpacking.decompress(packed, _LARGEST)
    except zlib.error as error:
        raise SchemaError(f"{path}: damaged ({error}); make it anew") from None
    if not unpacking.eof or unpacking.unused_data:
        raise SchemaError(f"{path}: damaged, or of more than {_LARGEST >> 20} MiB; make it anew")
    try:
        return decode(content)
    except SchemaError as error:
        raise SchemaError(f"{path}: {error}; make it anew") from None


def _to_json(value: Any, where: str, depth: int, arrays: list[NDArray[Any]]) -> Any:
    """Return a value as JSON has it; arrays are put aside."""
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, np.generic) and value.dtype.kind in "biufU":
        return value.item()
    if isinstance(value, np.ndarray) and value.dtype.kind in _KINDS:
        arrays.append(value)
        return {_ARRAY: len(arrays) - 1}
    if depth > _DEEPEST:
        raise InputError(f"plain data: {where[:80]}...: nested more than {_DEEPEST} deep")
    if isinstance(value, Mapping):
        odd = next((key for key in value if not isinstance(key, str) or key == _ARRAY), None)
        if odd is not None:
            raise InputError(
                f"plain data: {where or 'the whole'}: a key is {odd!r:.40}; keys have to be text other than {_ARRAY!r}"
            )
        return {key: _to_json(part, f"{where}.{key}".lstrip("."), depth + 1, arrays) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_to_json(part, f"{where}[{k}]", depth + 1, arrays) for k, part in enumerate(value)]
    kind = f"an array of {value.dtype}" if isinstance(value, np.ndarray) else f"of type {type(value).__name__}"
    raise InputError(f"plain data: {where or 'the whole'} is {kind}; give numbers, text, lists, dicts or arrays")


def _array(content: bytes, start: int, name: Any, shape: Any) -> tuple[NDArray[Any], int]:
    """Read an array at a position; return it and where it ends."""
    dtype = np.dtype(name) if isinstance(name, str) else None
    if dtype is None or dtype.kind not in _KINDS or dtype.subdtype is not None or dtype.names is not None:
        raise SchemaError(f"plain data: an array of {str(name)[:40]!r}")
    if not isinstance(shape, list) or any(type(side) is not int or side < 0 for side in shape) or len(shape) > 8:
        raise SchemaError(f"plain data: an array of shape {str(shape)[:40]}")
    end = start + math.prod(shape) * dtype.itemsize
    if end > len(content):
        raise SchemaError(f"plain data: an array of {end - start} bytes, of which {len(content) - start} are there")
    return np.frombuffer(content[start:end], dtype).reshape(shape).copy(), end


def _from_json(value: Any, arrays: list[NDArray[Any]]) -> Any:
    if isinstance(value, dict):
        if _ARRAY in value:
            k = value[_ARRAY]
            if type(k) is not int or k < 0 or len(value) > 1:
                raise SchemaError("plain data: an array that is not there")
            return arrays[k]
        return {key: _from_json(part, arrays) for key, part in value.items()}
    return [_from_json(part, arrays) for part in value] if isinstance(value, list) else value
