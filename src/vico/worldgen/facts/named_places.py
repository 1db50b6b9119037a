"""Named places: their tags and categories, what words of other sources mean, and names of the nameless.

Data of ``vico/data/worldgen/places`` and of a user's own, read once; docs/adding_a_place.md describes the files.
"""

from __future__ import annotations

import string
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
import shapely
from numpy.typing import NDArray
from pydantic import Field

from vico.errors import SchemaError
from vico.geo.osm import OsmData, Tags
from vico.io.data_files import DataRecord, cached_data, data_files, read_record
from vico.world.model import Category
from vico.worldgen.facts.fault_isolation import drop_on_failure

ROOM = "worldgen/places"
GUIDE = "docs/adding_a_place.md"
Words = tuple[str, ...]
Meaning = tuple[Category, str]


class _CategoriesFile(DataRecord):
    tags: dict[str, dict[Category, Words]] = Field(default_factory=dict)
    any: dict[str, Category] = Field(default_factory=dict)


class Ending(DataRecord):
    """Meaning of words with an ending."""

    endings: Words
    category: Category
    kind: str


class _WordsFile(DataRecord):
    nobody: Words = ()
    words: dict[Category, dict[str, Words]] = Field(default_factory=dict)
    ending: tuple[Ending, ...] = ()


class _NamesFile(DataRecord):
    home: str | None = None
    at_address: str | None = None
    on_street: str | None = None
    building: str | None = None
    what: dict[str, str] = Field(default_factory=dict)


@dataclass(frozen=True)
class Categories:
    """Categories by value, for one key of tags each, in the order in which they are looked at; and by key alone."""

    tables: tuple[tuple[str, Mapping[str, Category]], ...]
    any: Mapping[str, Category]


@dataclass(frozen=True)
class SourceWords:
    """Meanings of words, None for what nobody goes to; and of endings, the first that fits."""

    words: Mapping[str, Meaning | None]
    endings: tuple[Ending, ...]


@dataclass(frozen=True)
class PlaceNames:
    """How places are called that bring no name.

    Attributes
    ----------
    home
        A place where people live.
    at_address, on_street, building
        Sentences with ``{what}``, ``{where}``, ``{street}``, ``{id}``.
    what
        Kinds of places and uses of buildings in words.
    """

    home: str
    at_address: str
    on_street: str
    building: str
    what: Mapping[str, str]

    def of(self, kind: str) -> str:
        """Return a kind in words."""
        return self.what.get(kind) or kind.replace("_", " ").capitalize()

    def describe(self, what: str, *, where: str | None = None, street: str | None = None) -> str:
        """Return what something is, with its address or its street if it has any."""
        if where:
            return self.at_address.format(what=what, where=where)
        return self.on_street.format(what=what, street=street) if street else what


_FIELDS = {"home": (), "at_address": ("what", "where"), "on_street": ("what", "street"), "building": ("what", "id")}


@cached_data
def categories() -> Categories:
    """Return which tags make a place; a user's files go before ours.

    Raises
    ------
    SchemaError
        If a file can't be used.
    """
    files = [file for _, file in reversed(_read("categories", _CategoriesFile))]
    return Categories(
        tables=tuple(
            (key, {value: category for category, values in table.items() for value in values})
            for file in files
            for key, table in file.tags.items()
        ),
        any={key: category for file in files for key, category in file.any.items()},
    )


@cached_data
def source_words() -> SourceWords:
    """Return what words of other sources mean; a user's files go before ours.

    Raises
    ------
    SchemaError
        If a file can't be used.
    """
    words: dict[str, Meaning | None] = {}
    endings: list[Ending] = []
    for _, file in reversed(_read("words", _WordsFile)):
        ours: dict[str, Meaning | None] = dict.fromkeys(file.nobody)
        for category, kinds in file.words.items():
            ours |= {word: (category, kind) for kind, said in kinds.items() for word in said}
        words = {**ours, **words}
        endings += file.ending
    return SourceWords(words, tuple(endings))


@cached_data
def place_names() -> PlaceNames:
    """Return how places are called that bring no name; what a user's file says takes the place of ours.

    Raises
    ------
    SchemaError
        If a file can't be used, or a sentence has a gap that nothing fills.
    """
    said: dict[str, str] = {}
    what: dict[str, str] = {}
    for path, file in _read("names", _NamesFile):
        for field, gaps in _FIELDS.items():
            sentence = getattr(file, field)
            if sentence is not None:
                _check_gaps(f"{path}: {field}", sentence, gaps)
                said[field] = sentence
        what |= file.what
    return PlaceNames(**said, what=what)


def _check_gaps(where: str, sentence: str, gaps: tuple[str, ...]) -> None:
    try:
        named = [name for _, name, _, _ in string.Formatter().parse(sentence) if name is not None]
    except ValueError as error:
        raise SchemaError(f"{where}: {error}; see {GUIDE}") from None
    for name in named:
        if name not in gaps:
            known = ", ".join(f"{{{gap}}}" for gap in gaps) or "none"
            raise SchemaError(f"{where}: nothing fills {{{name}}}; gaps may be {known}; see {GUIDE}")


R = TypeVar("R", bound=DataRecord)


def _read(kind: str, record: type[R]) -> list[tuple[Path, R]]:
    return [(path, read_record(path, record, guide=GUIDE)) for path in data_files(ROOM, kind)]


_CLOSED_VALUES = {"no", "vacant", "disused", "closed", "abandoned"}


@dataclass(frozen=True)
class NamedPlace:
    """Something with a name that people go to.

    Attributes
    ----------
    xy
        Where, metres, shape ``(2,)``.
    area
        Its area, None for points.
    exact
        False where `xy` may say which building it is in, but not where its door is.
    """

    id: str
    name: str
    category: Category
    kind: str
    xy: NDArray[np.float64]
    tags: Tags
    area: shapely.Geometry | None
    exact: bool = True


def named_places(osm: OsmData) -> list[NamedPlace]:
    """Everything with a name and a category, within the map's box."""
    found: list[NamedPlace] = []
    rows = [(f"n{n.id}", n.xy, n.tags, None) for n in osm.nodes]
    for area in osm.areas:
        with drop_on_failure(area.id):
            centre = np.array(area.polygon.representative_point().coords[0])
            rows.append((area.id, centre, area.tags, area.polygon))
    for key, xy, tags, shape in rows:
        name = tags.get("name") or tags.get("brand") or (tags.get("operator") if "shop" in tags else None)
        if not name or not osm.holds(xy):
            continue
        what = category_of(tags, shape is not None)
        if what is not None:
            found.append(NamedPlace(key, name.strip(), what[0], what[1], xy, tags, shape))
    return found


def category_of(tags: Tags, is_area: bool) -> tuple[Category, str] | None:
    """Return the category that tags mean, and the value that says so; None if they mean no place."""
    for key, values in categories().tables:
        value = tags.get(key, "").split(";")[0]
        if value in values:
            return values[value], value
    for key, category in categories().any.items():
        value = tags.get(key, "no").split(";")[0]
        if value not in _CLOSED_VALUES:
            return category, value if value != "yes" else key
    if is_area and tags.get("highway") == "pedestrian" and "building" not in tags:
        return Category.OPEN, "square"
    return None
