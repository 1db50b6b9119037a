"""Nested records of JSON values and NumPy arrays, written to one file without pickle.

The file is an ``.npz``: ``json`` holds the record as UTF-8 JSON in which ``{"$array": 3}`` stands for the array named
``3`` of the same file, and ``{"$float": "nan"}`` for a number that JSON does not know.
"""

from __future__ import annotations

import io
import json
import math
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import InputError, MissingFileError, SchemaError
from vico.io.files import write_bytes

_ARRAY, _FLOAT = "$array", "$float"
_DEEPEST = 64


def nested_bytes(record: Mapping[str, Any]) -> bytes:
    """Return a record as the bytes of a file; the same record gives the same bytes.

    Parameters
    ----------
    record
        Of None, booleans, integers, floats, text, NumPy arrays and scalars, lists, and mappings with text as keys.
        Tuples come back as lists, NumPy scalars as plain numbers; floats come back exactly.

    Raises
    ------
    InputError
        If it holds anything else; the sentence says where.
    """
    arrays: list[NDArray[Any]] = []
    text = json.dumps(_packed(record, "", arrays, 0), ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    sink = io.BytesIO()
    named = {str(k): array for k, array in enumerate(arrays)}
    np.savez_compressed(sink, allow_pickle=False, json=np.frombuffer(text.encode(), np.uint8), **named)
    return sink.getvalue()


def nested_from(content: bytes, *, name: str = "record") -> dict[str, Any]:
    """Return the record that `nested_bytes` made.

    Parameters
    ----------
    name
        What to call it in errors.

    Raises
    ------
    SchemaError
        If the bytes are damaged, or not of `nested_bytes`.
    """
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as data:
            arrays = {key: data[key] for key in data.files}
        record = _unpacked(json.loads(arrays.pop("json").tobytes().decode()), arrays)
    except (ValueError, OSError, EOFError, KeyError, TypeError, zipfile.BadZipFile, zlib.error) as error:
        raise SchemaError(f"{name}: not a readable record ({error}); make it anew") from None
    if not isinstance(record, dict):
        raise SchemaError(f"{name}: not a record but a {type(record).__name__}; make it anew")
    return record


def write_nested(path: Path, record: Mapping[str, Any]) -> None:
    """Write a record, whole or not at all; see `nested_bytes`."""
    write_bytes(path, nested_bytes(record))


def read_nested(path: Path) -> dict[str, Any]:
    """Read what `write_nested` wrote.

    Raises
    ------
    MissingFileError
        If there is no such file.
    SchemaError
        If it is damaged.
    """
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such file") from None
    return nested_from(content, name=str(path))


def _packed(value: Any, where: str, arrays: list[NDArray[Any]], depth: int) -> Any:
    """Return a value as JSON knows it; its arrays are appended to `arrays`."""
    if depth > _DEEPEST:
        raise InputError(f"record{where}: nested deeper than {_DEEPEST} levels; keep it flatter")
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else {_FLOAT: repr(value)}
    if isinstance(value, np.ndarray):
        if value.dtype.hasobject:
            raise InputError(f"record{where}: an array of objects; arrays of numbers and text can be saved")
        arrays.append(value)
        return {_ARRAY: len(arrays) - 1}
    if isinstance(value, list | tuple):
        return [_packed(item, f"{where}[{k}]", arrays, depth + 1) for k, item in enumerate(value)]
    if isinstance(value, Mapping):
        return {_key(key, where): _packed(item, f"{where}.{key}", arrays, depth + 1) for key, item in value.items()}
    raise InputError(
        f"record{where}: {type(value).__name__} cannot be saved; use JSON values, NumPy arrays, lists and mappings"
    )


def _key(key: Any, where: str) -> str:
    if not isinstance(key, str) or key in (_ARRAY, _FLOAT):
        raise InputError(f"record{where}: key {key!r} cannot be saved; keys are text other than {_ARRAY} and {_FLOAT}")
    return key


def _unpacked(value: Any, arrays: Mapping[str, NDArray[Any]]) -> Any:
    if isinstance(value, list):
        return [_unpacked(item, arrays) for item in value]
    if not isinstance(value, dict):
        return value
    if _ARRAY in value:
        return arrays[str(value[_ARRAY])]
    if _FLOAT in value:
        return float(value[_FLOAT])
    return {key: _unpacked(item, arrays) for key, item in value.items()}
