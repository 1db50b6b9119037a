"""Data that anybody may add to: TOML files of this package, and of a folder of one's own.

A room's data lie in a folder of its name, such as ``community``. A kind of data is the files there whose name begins
with the kind's, such as ``trades.toml`` and ``trades_harbour.toml``: first those in ``vico/data/<room>``, then those in
``$VICO_DATA/<room>``. Each file is read into a record that names every field it may have; anything else
is an error that says in which file and where.
"""

from __future__ import annotations

import json
import os
import tomllib
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from vico.errors import InputError, MissingFileError, SchemaError

PACKAGED = Path(__file__).parents[1] / "data"
#: Names the folder of a user's own data.
VARIABLE = "VICO_DATA"


class DataRecord(BaseModel):
    """A strict record of a data file: unknown fields and values of another type are errors."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


R = TypeVar("R", bound=DataRecord)


def data_files(room: str, kind: str = "") -> list[Path]:
    """Return the files of a kind of data (all of a room without): the package's by name, then the user's by name.

    Raises
    ------
    InputError
        If the variable names a folder that is not there.
    """
    folders = [PACKAGED / room]
    if own := os.environ.get(VARIABLE, ""):
        if not Path(own).is_dir():
            raise InputError(f"{VARIABLE}: {own} is no folder; make it, or unset the variable")
        folders.append(Path(own) / room)
    return [path for folder in folders if folder.is_dir() for path in sorted(folder.glob(f"{kind}*.toml"))]


def read_record(path: Path, kind: type[R]) -> R:
    """Read a TOML file into a record.

    Raises
    ------
    MissingFileError
        If there is no such file.
    SchemaError
        If it is not TOML, or a field is unknown, missing or of another type; the message names file and field.
    """
    try:
        return parse_record(path.read_text(encoding="utf-8"), kind, source=str(path))
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such file") from None
    except UnicodeDecodeError as error:
        raise SchemaError(f"{path}: not UTF-8 text ({error})") from None


def parse_record(text: str, kind: type[R], *, source: str = "data") -> R:
    """Read TOML text into a record; `source` names it in errors.

    Raises
    ------
    SchemaError
        As `read_record`.
    """
    try:
        # By way of JSON: it has one kind of list, which fits tuples and lists alike under strict types.
        return kind.model_validate_json(json.dumps(tomllib.loads(text)))
    except (tomllib.TOMLDecodeError, TypeError) as error:
        raise SchemaError(f"{source}: not valid TOML ({error})") from None
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "the whole file"
        more = f" (and {error.error_count() - 1} more)" if error.error_count() > 1 else ""
        raise SchemaError(f"{source}: {where}: {first['msg'].lower()}{more}") from None
