"""Records, height fields and manifests as files of a world folder."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Iterable
from pathlib import Path
from typing import TypeVar

from pydantic import TypeAdapter, ValidationError

from vico.errors import MissingFileError, SchemaError
from vico.io.files import write_bytes
from vico.io.npz import npz_bytes, read_npz
from vico.world.heights import HeightField
from vico.world.model import Manifest, Record

R = TypeVar("R", bound=Record)


def write_records(path: Path, records: Iterable[Record]) -> None:
    """Write a list of records as JSON, one record a line."""
    rows = [json.dumps(r.model_dump(mode="json"), ensure_ascii=False, separators=(",", ":")) for r in records]
    write_bytes(path, ("[\n" + ",\n".join(rows) + "\n]\n").encode())


def write_record(path: Path, record: Record) -> None:
    """Write one record as JSON: a line for every entry of its lists."""
    parts = []
    for key, value in record.model_dump(mode="json").items():
        if isinstance(value, list):
            rows = [json.dumps(v, ensure_ascii=False, separators=(",", ":")) for v in value]
            text = "[\n" + ",\n".join(rows) + "\n]" if rows else "[]"
        else:
            text = json.dumps(value, ensure_ascii=False, sort_keys=True)
        parts.append(f"{json.dumps(key)}: {text}")
    write_bytes(path, ("{\n" + ",\n".join(parts) + "\n}\n").encode())


def read_records(path: Path, kind: type[R]) -> list[R]:
    """Read what `write_records` wrote.

    Raises
    ------
    MissingFileError, SchemaError
        If the file is not there, or a record is not valid; the message gives the path within the file.
    """
    try:
        return TypeAdapter(list[kind]).validate_json(_text(path))  # type: ignore[valid-type]
    except ValidationError as error:
        raise invalid(path, error) from None


def read_record(path: Path, kind: type[R]) -> R:
    """Read what `write_record` wrote; errors as in `read_records`."""
    try:
        return kind.model_validate_json(_text(path))
    except ValidationError as error:
        raise invalid(path, error) from None


def _text(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such file; build the world anew") from None


def invalid(path: Path, error: ValidationError) -> SchemaError:
    """Return what is wrong with a file whose content does not fit a record."""
    first = error.errors()[0]
    where = ".".join(str(part) for part in first["loc"]) or "the whole file"
    return SchemaError(f"{path}: {where}: {first['msg']}; build the world anew")


def write_terrain(path: Path, height: HeightField) -> None:
    """Write a height field as ``.npz``."""
    write_bytes(path, npz_bytes(height.arrays()))


def read_terrain(path: Path) -> HeightField:
    """Read what `write_terrain` wrote."""
    try:
        return HeightField.from_arrays(read_npz(path.read_bytes()))
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such file; build the world anew") from None
    except (ValueError, KeyError, OSError, EOFError, zipfile.BadZipFile) as error:
        raise SchemaError(f"{path}: not a readable height field ({error}); build the world anew") from None


def manifest_bytes(manifest: Manifest) -> bytes:
    """Return the bytes of ``world.json``."""
    return (json.dumps(manifest.model_dump(mode="json"), indent=1, sort_keys=True, ensure_ascii=False) + "\n").encode()
