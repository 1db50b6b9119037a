"""Reading files of models: strict, and only parsed once; shapes are made when they are first asked for."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from vico.assets.models.model import Model, Top
from vico.assets.models.parts import Palette, Scope, surfaces_of
from vico.assets.models.schema import Assembly, ModelEntry, ModelFile, Parts
from vico.errors import InputError, MissingFileError, SchemaError
from vico.world.mesh import Surface, joined

DATA = Path(__file__).parents[2] / "data" / "models"
GUIDE = "docs/adding_a_model.md says what an entry may hold"
_MOST_BYTES = 4 << 20
_Schema = TypeVar("_Schema", bound=BaseModel)


def read_entries(path: Path, schema: type[_Schema]) -> _Schema:
    """Read a TOML file against a strict schema.

    Raises
    ------
    MissingFileError
        If there is no such file.
    SchemaError
        If it is not TOML, or holds what the schema does not know; the message names the entry and the field.
    """
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise SchemaError(f"{path}: larger than {_MOST_BYTES >> 20} MB; split it into several files")
        return schema.model_validate(tomllib.loads(path.read_text("utf-8")))
    except FileNotFoundError:
        raise MissingFileError(f"{path}: there is no such file of models") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise SchemaError(f"{path}: not a TOML file: {error}") from None
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "the whole file"
        raise SchemaError(f"{path}: {where}: {first['msg']}; {GUIDE}") from None


def read_models(path: Path) -> dict[str, Model]:
    """Read the models of a file, by name.

    Raises
    ------
    MissingFileError, SchemaError
        As `read_entries`; also for a model that is like one that the file lacks. Colours and assemblies that it lacks
        are found when the surfaces are first asked for.
    """
    return models_of(read_entries(path, ModelFile), str(path))


def read_folder(folder: Path, *, first: Sequence[str] = ()) -> dict[str, Model]:
    """Read the models of all files of a folder: those named `first`, then the others by name.

    The order is that in which worlds list their prototypes. A model read later replaces its namesake.
    """
    if not folder.is_dir():
        raise MissingFileError(f"{folder}: there is no such folder of models")
    paths = [folder / f"{name}.toml" for name in first]
    found: dict[str, Model] = {}
    for path in (*paths, *sorted(set(folder.glob("*.toml")) - set(paths))):
        found |= read_models(path)
    return found


def models_of(file: ModelFile, where: str) -> dict[str, Model]:
    """Make the models of a file that was read; `where` names it in errors."""
    return {name: _model(name, entry, file, where) for name, entry in file.model.items()}


def _model(name: str, entry: ModelEntry, file: ModelFile, where: str) -> Model:
    here = f"{where}: model.{name}"
    base = entry
    if entry.like is not None:
        found = file.model.get(entry.like)
        if found is None or found.parts is None:
            raise SchemaError(f"{here}.like: the file has no model {entry.like!r} with parts of its own; {GUIDE}")
        base = found
        unknown = sorted(set(entry.colours) - set(base.colours))
        if unknown:
            raise SchemaError(f"{here}.colours: {entry.like!r} has no colour {unknown[0]!r} to change; {GUIDE}")
    parts = base.parts
    if parts is None:  # the schema sees to it
        raise SchemaError(f"{here}: neither parts nor like; {GUIDE}")
    top = entry.top or base.top
    solid = next((given for given in (entry.solid, base.solid) if given is not None), file.solid)
    return Model(
        name,
        entry.kind or base.kind or (entry.like or name),
        entry.group or base.group or file.group,
        _Builder(here, parts, {**file.colours, **base.colours, **entry.colours}, file.assembly),
        solid,
        entry.foot or base.foot,
        None if top is None else Top(top.kind, top.height, top.size, top.centre),
    )


class _Builder:
    """Makes the surfaces of one entry."""

    def __init__(self, here: str, parts: Parts, colours: Palette, assemblies: dict[str, Assembly]) -> None:
        self._here, self._parts, self._scope = here, parts, Scope(colours, assemblies)

    def __call__(self) -> list[Surface]:
        try:
            return joined(surfaces_of(self._parts, self._scope))
        except InputError as error:
            raise SchemaError(f"{self._here}: {error}; {GUIDE}") from None
