"""Which source decides what of a building: a small file that a person can read and change."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from vico.errors import InputError
from vico.geo.buildings import CITY_MODELS, KINDS
from vico.io.data_files import PACKAGED, DataRecord, read_record

_GUIDE = "docs/sources.md"
OSM = "osm"
_CITY_MODELS = "lod2"
_WORDS = (OSM, _CITY_MODELS, *KINDS)
Share = Annotated[float, Field(ge=0.0, le=1.0)]


class Precedence(DataRecord):
    """Order of sources by what they tell; see data/sources/precedence.toml.

    Attributes
    ----------
    footprint, height, roof, name
        Sources, the one that counts first first; one that is not named does not count.
    added
        Sources whose buildings are added where the map has none.
    terrain
        Which of overlapping elevation files counts.
    same, free
        Shares of area from which on two outlines are one building, and up to which they are two.
    """

    footprint: tuple[str, ...]
    height: tuple[str, ...]
    roof: tuple[str, ...]
    name: tuple[str, ...]
    added: tuple[str, ...]
    terrain: Literal["finest", "given"]
    same: Share
    free: Share


def read_precedence(path: Path | None, files: Sequence[str]) -> Precedence:
    """Read the file, or the package's own.

    Parameters
    ----------
    path
        The file; None for the package's.
    files
        Names of the files of buildings that are given.

    Raises
    ------
    MissingFileError, SchemaError
        If it is not there, or not as its schema says.
    InputError
        If it names a source that there is not.
    """
    where = path or PACKAGED / "sources" / "precedence.toml"
    precedence = read_record(where, Precedence, guide=_GUIDE)
    for field in ("footprint", "height", "roof", "name", "added"):
        order: tuple[str, ...] = getattr(precedence, field)
        for name in order:
            if name not in _WORDS and name not in files:
                there = f" or a file that is given ({', '.join(files)})" if files else ""
                raise InputError(f"{where}: {field}: no source {name!r}; write {', '.join(_WORDS)}{there}")
        if doubled := sorted({name for name in order if order.count(name) > 1}):
            raise InputError(f"{where}: {field}: {', '.join(doubled)} twice; each source has one place")
    if precedence.free > precedence.same:
        raise InputError(f"{where}: free ({precedence.free:g}) is larger than same ({precedence.same:g})")
    return precedence


def rank_of(kind: str, file: str, order: Sequence[str]) -> int | None:
    """Return the place of a source in an order, by its file's name, its kind, or as a city model; None: it has none."""
    for name in (file, kind, _CITY_MODELS if kind in CITY_MODELS else kind):
        if name in order:
            return order.index(name)
    return None
