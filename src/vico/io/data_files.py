"""Data that anybody may add to: TOML files of this package, and of a folder of one's own.

A room's data lie in a folder of its name, such as ``community`` or ``assets/models/indoor``. A kind of data is the
files there whose name begins with the kind's, such as ``trades.toml`` and ``trades_harbour.toml``: first those in
``vico/data/<room>``, then those in ``$VICO_DATA/<room>``. Each file is read into a record that names every field it may
have; anything else is an error that says in which file and where. docs/adding_data.md tells users of it.
"""

from __future__ import annotations

import json
import os
import tomllib
from collections.abc import Callable, Hashable, Mapping, Sequence
from functools import wraps
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from vico.errors import InputError, MissingFileError, SchemaError

PACKAGED = Path(__file__).parents[1] / "data"
#: Names the folder of a user's own data.
VARIABLE = "VICO_DATA"
_MOST_BYTES = 4 << 20

# Folders of a user's own data that were named without their room: by its old name, what it is called now.
_RENAMED = {
    "assistant": "agents/assistant",
    "environment": "sim/environment",
    "facades": "worldgen/facades",
    "generation": "assets/generation",
    "indoor": "worldgen/indoor",
    "influence": "agents/influence (lines) and challenges/influence (lexicons)",
    "models": "assets/models",
    "objects": "worldgen/objects",
    "places": "worldgen/places",
    "prompts": "llm/prompts",
    "sources": "geo/sources",
    "streets": "worldgen/streets",
    "talk": "agents/talk",
    "worlds": "worldgen/worlds",
}

P = ParamSpec("P")
T = TypeVar("T")


class DataRecord(BaseModel):
    """A strict record of a data file: unknown fields and values of another type are errors."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


R = TypeVar("R", bound=DataRecord)


def own_folder() -> Path | None:
    """Return the folder of a user's own data, None without.

    Raises
    ------
    InputError
        If the variable names a folder that is not there, or it holds a folder by the name it had in version 0.1.
    """
    own = os.environ.get(VARIABLE, "")
    if own and not Path(own).is_dir():
        raise InputError(f"{VARIABLE}: {own} is no folder; make it, or unset the variable")
    for old, new in _RENAMED.items() if own else ():
        if (Path(own) / old).is_dir():
            raise InputError(f"{VARIABLE}: {Path(own) / old}: folders bear their room's name; move it to {new} there")
    return Path(own) if own else None


def own_files(room: str, kind: str = "") -> list[Path]:
    """Return the user's files of a kind of data (all of a room without), by name.

    Raises
    ------
    InputError
        If the variable names a folder that is not there.
    """
    own = own_folder()
    return [] if own is None else sorted((own / room).glob(f"{kind}*.toml"))


def data_files(room: str, kind: str = "", *, first: Sequence[str] = ()) -> list[Path]:
    """Return the files of a kind of data (all of a room without): the package's by name, then the user's by name.

    Parameters
    ----------
    first
        Files of the package that come before its others, by name without suffix.

    Raises
    ------
    InputError
        If the variable names a folder that is not there.
    """
    rank = {name: k for k, name in enumerate(first)}
    packaged = sorted((PACKAGED / room).glob(f"{kind}*.toml"), key=lambda path: (rank.get(path.stem, len(rank)), path))
    return packaged + own_files(room, kind)


def cached_data(make: Callable[P, T]) -> Callable[P, T]:
    """Keep what a function makes of data files: made once for the same arguments and folder of a user's own."""
    made: dict[Hashable, T] = {}

    @wraps(make)
    def made_once(*args: P.args, **kwargs: P.kwargs) -> T:
        key = (os.environ.get(VARIABLE, ""), args, tuple(kwargs.items()))
        if key not in made:
            made[key] = make(*args, **kwargs)
        return made[key]

    return made_once


def read_record(path: Path, kind: type[R], *, guide: str = "") -> R:
    """Read a TOML file into a record; `guide` names the page that says what it may hold, for errors.

    Raises
    ------
    MissingFileError
        If there is no such file.
    SchemaError
        If it is too large, not TOML, or a field is unknown, missing or of another type; the message names file and
        field.
    """
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise SchemaError(f"{path}: larger than {_MOST_BYTES >> 20} MB; split it into several files")
        return parse_record(path.read_text(encoding="utf-8"), kind, source=str(path), guide=guide)
    except FileNotFoundError:
        raise MissingFileError(f"{path}: no such file") from None
    except UnicodeDecodeError as error:
        raise SchemaError(f"{path}: not UTF-8 text ({error})") from None


def parse_record(text: str, kind: type[R], *, source: str = "data", guide: str = "") -> R:
    """Read TOML text into a record; `source` names it in errors, `guide` the page that says what it may hold.

    Raises
    ------
    SchemaError
        As `read_record`.
    """
    try:
        plain = json.dumps(tomllib.loads(text))
    except (tomllib.TOMLDecodeError, TypeError) as error:
        raise SchemaError(f"{source}: not valid TOML ({error}){_pointer(guide)}") from None
    return _validate(plain, kind, source, guide)


def record_of(content: Mapping[str, Any], kind: type[R], *, source: str = "data", guide: str = "") -> R:
    """Return plain data, as JSON holds it, as a record; the other parameters as `parse_record` has them.

    Raises
    ------
    SchemaError
        If it holds what JSON has not, or a field is unknown, missing or of another type.
    """
    try:
        plain = json.dumps(content)
    except TypeError as error:
        raise SchemaError(f"{source}: JSON has no such values ({error}){_pointer(guide)}") from None
    return _validate(plain, kind, source, guide)


def _validate(plain: str, kind: type[R], source: str, guide: str) -> R:
    try:
        # JSON has one kind of list, which fits tuples and lists alike under strict types.
        return kind.model_validate_json(plain)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "the whole file"
        more = f" (and {error.error_count() - 1} more)" if error.error_count() > 1 else ""
        raise SchemaError(f"{source}: {where}: {first['msg'].lower()}{more}{_pointer(guide)}") from None


def _pointer(guide: str) -> str:
    return f"; see {guide}" if guide else ""
