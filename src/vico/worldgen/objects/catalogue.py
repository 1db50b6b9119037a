"""Models of mapped objects: data of ``vico/data/worldgen/objects`` and of a user's own, read once.

docs/adding_an_object.md describes the files.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from pydantic import Field, model_validator

from vico.assets.models.library import street_models
from vico.errors import SchemaError
from vico.geo.osm import Tags
from vico.geo.quantities import metres
from vico.io.data_files import DataRecord, cached_data, data_files, read_record

ROOM = "worldgen/objects"
GUIDE = "docs/adding_an_object.md"
ANY = "*"
Names = tuple[str, ...]


class Condition(DataRecord):
    """Condition on a tag's value, other than being equal to something.

    Attributes
    ----------
    present
        Whether the thing has the tag at all.
    contains, begins
        What the value contains, or begins with.
    under, at_most, at_least, over
        Bounds of the number that the value begins with; a value without a number is within no bounds.
    """

    present: bool | None = None
    contains: str | None = None
    begins: str | None = None
    under: float | None = None
    at_most: float | None = None
    at_least: float | None = None
    over: float | None = None

    def holds(self, value: str | None) -> bool:
        """Whether a tag's value (None: the thing has no such tag) is so."""
        if self.present is not None and self.present != (value is not None):
            return False
        if value is None:
            return self.present is False
        if self.contains is not None and self.contains not in value:
            return False
        return value.startswith(self.begins or "") and self._within(metres(value))

    def _within(self, found: float | None) -> bool:
        if found is None:
            return all(bound is None for bound in (self.under, self.at_most, self.at_least, self.over))
        below = (self.under is None or found < self.under) and (self.at_most is None or found <= self.at_most)
        return below and (self.at_least is None or found >= self.at_least) and (self.over is None or found > self.over)


class FinerKind(DataRecord):
    """Which of the models of a kind a thing has, by its other tags.

    Attributes
    ----------
    of
        The model that its main tag leads to.
    when
        By tag: its value (the first of several), values it may have, or a `Condition`; all of them have to hold.
    regions
        Where this holds, as `vico.worldgen.objects.mapped_objects.region` says; everywhere without.
    model
        The model, several of which chance picks one, or "" for nothing that stands in streets.
    by, models
        Instead: tags of which the first that is there says the model.
    """

    of: str
    when: dict[str, str | Names | Condition] = Field(default_factory=dict)
    regions: Names = ()
    model: str | Names | None = None
    by: Names = ()
    models: dict[str, str] = Field(default_factory=dict)

    def choice(self, tags: Tags, where: str) -> Names | None:
        """Return the models that suit a thing, none where it does not stand in streets; None if this says nothing."""
        if self.regions and where not in self.regions:
            return None
        if not all(_holds(wanted, tags.get(key)) for key, wanted in self.when.items()):
            return None
        if self.model is not None:
            return self.model if isinstance(self.model, tuple) else (self.model,)
        value = next((tags[key] for key in self.by if key in tags), "")
        return (self.models[value],) if value in self.models else None

    def every_model(self) -> Iterable[str]:
        """All models that this may lead to."""
        single = (self.model,) if isinstance(self.model, str) else self.model or ()
        return (*single, *self.models.values())

    @model_validator(mode="after")
    def _says_one_thing(self) -> FinerKind:
        if (self.model is None) == (not self.models) or bool(self.models) != bool(self.by):
            raise ValueError("give either model, or by and models")
        return self


def _holds(wanted: str | Names | Condition, value: str | None) -> bool:
    if isinstance(wanted, Condition):
        return wanted.holds(value)
    first = None if value is None else value.split(";")[0]
    return first == wanted if isinstance(wanted, str) else first in wanted


class _KindsFile(DataRecord):
    tags: dict[str, dict[str, str]] = Field(default_factory=dict)


class _FinerFile(DataRecord):
    finer: tuple[FinerKind, ...] = ()


class _SignsFile(DataRecord):
    words: dict[str, str] = Field(default_factory=dict)
    like: dict[str, str] = Field(default_factory=dict)
    codes: dict[str, dict[str, str]] = Field(default_factory=dict)


class Standing(DataRecord):
    """How things stand, by how the names of their models begin.

    Attributes
    ----------
    landmarks
        Kinds that may stand in the only way past.
    twins
        Kinds of which two that touch are one, mapped twice.
    at_kerbs
        Kinds that are mapped on the street's middle and stand beside it.
    facing_anywhere
        What has no front.
    facing_street
        What faces the carriageway even where a wall is near.
    facing_along
        What looks along the street, against those who drive on its side.
    facing_path
        Seats: they look over a path, their backs to traffic.
    of_any_size
        What chance makes somewhat larger or smaller.
    """

    landmarks: Names = ()
    twins: Names = ()
    at_kerbs: Names = ()
    facing_anywhere: Names = ()
    facing_street: Names = ()
    facing_along: Names = ()
    facing_path: Names = ()
    of_any_size: Names = ()


class PlantMix(DataRecord):
    """Plants along streets and in woods of a climate; a plant that comes twice is twice as common."""

    streets: Names = Field(min_length=1)
    woods: Names = Field(min_length=1)


class Trees(DataRecord):
    """Trees by what maps say of them.

    Attributes
    ----------
    needles, palms
        Models with needles, and of palms.
    genera
        Model by genus, in lower case.
    names
        Genus by common name, in any language.
    mixes
        By climate.
    room
        Square metres a tree has of its own, by what the area is used for.
    """

    needles: Names = ()
    palms: Names = ()
    genera: dict[str, str] = Field(default_factory=dict)
    names: dict[str, str] = Field(default_factory=dict)
    mixes: dict[str, PlantMix] = Field(default_factory=dict)
    room: dict[str, float] = Field(default_factory=dict)


class Barriers(DataRecord):
    """Models of barriers mapped as lines: by the value of ``barrier``, and of fences by ``fence_type``."""

    lines: dict[str, str] = Field(default_factory=dict)
    fences: dict[str, str] = Field(default_factory=dict)


@dataclass(frozen=True)
class Kinds:
    """Models that tags lead to.

    Attributes
    ----------
    tables
        Models by value, for one key each: what comes first counts.
    finer
        By model, in the order in which they are tried.
    """

    tables: tuple[tuple[str, Mapping[str, str]], ...]
    finer: Mapping[str, tuple[FinerKind, ...]]


@dataclass(frozen=True)
class Signs:
    """Models of traffic signs, by word of the map, and by country and code."""

    words: Mapping[str, str]
    codes: Mapping[str, Mapping[str, str]]


@cached_data
def kinds() -> Kinds:
    """Return what tags lead to; a user's files go before ours.

    Raises
    ------
    SchemaError
        If a file can't be used, or names a model that nobody made.
    """
    tables: list[tuple[str, Mapping[str, str]]] = []
    for path, kind_file in reversed(_read("kinds", _KindsFile)):
        for key, values in kind_file.tags.items():
            _check(path, ((f"tags.{key}.{value}", model) for value, model in values.items()))
            tables.append((key, values))
    finer: dict[str, tuple[FinerKind, ...]] = {}
    for path, finer_file in reversed(_read("finer", _FinerFile)):
        for k, entry in enumerate(finer_file.finer):
            _check(path, [(f"finer.{k}.of", entry.of), *((f"finer.{k}.model", model) for model in entry.every_model())])
            finer[entry.of] = (*finer.get(entry.of, ()), entry)
    return Kinds(tuple(tables), finer)


@cached_data
def signs() -> Signs:
    """Return the models of signs.

    Raises
    ------
    SchemaError
        If a file can't be used, or names a model that nobody made or a country without codes.
    """
    words: dict[str, str] = {}
    codes: dict[str, dict[str, str]] = {}
    for path, file in _read("signs", _SignsFile):
        _check(path, ((f"words.{word}", model) for word, model in file.words.items()))
        for country, table in file.codes.items():
            _check(path, ((f"codes.{country}.{code}", model) for code, model in table.items()))
            codes[country] = {**codes.get(country, {}), **table}
        for country, other in file.like.items():
            if other not in codes:
                raise SchemaError(f"{path}: like.{country}: {other!r} has no codes; there are {', '.join(codes)}")
            codes[country] = {**codes[other], **codes.get(country, {})}
        words |= file.words
    return Signs(words, codes)


@cached_data
def standing() -> Standing:
    """Return how things stand: the lists of all files together."""
    files = [file for _, file in _read("standing", Standing)]
    return Standing(**{name: tuple(n for file in files for n in getattr(file, name)) for name in Standing.model_fields})


@cached_data
def trees() -> Trees:
    """Return which trees there are.

    Raises
    ------
    SchemaError
        If a file can't be used, or names a model or a genus that nobody listed.
    """
    files = _read("trees", Trees)
    genera = {genus: model for _, file in files for genus, model in file.genera.items()}
    for path, file in files:
        _check(path, ((f"genera.{genus}", model) for genus, model in file.genera.items()))
        _check(path, (("needles or palms", model) for model in (*file.needles, *file.palms)))
        for zone, mix in file.mixes.items():
            _check(path, ((f"mixes.{zone}", model) for model in (*mix.streets, *mix.woods)))
        for name, genus in file.names.items():
            if genus not in genera:
                raise SchemaError(f"{path}: names.{name}: no genus {genus!r}; see {GUIDE}")
    return Trees(
        needles=tuple(name for _, file in files for name in file.needles),
        palms=tuple(name for _, file in files for name in file.palms),
        genera=genera,
        names={name: genus for _, file in files for name, genus in file.names.items()},
        mixes={zone: mix for _, file in files for zone, mix in file.mixes.items()},
        room={use: room for _, file in files for use, room in file.room.items()},
    )


@cached_data
def barriers() -> Barriers:
    """Return the models of barriers mapped as lines.

    Raises
    ------
    SchemaError
        If a file can't be used, or names a model that nobody made.
    """
    files = _read("barriers", Barriers)
    for path, file in files:
        _check(path, ((f"lines.{value}", model) for value, model in file.lines.items()))
        _check(path, ((f"fences.{value}", model) for value, model in file.fences.items()))
    return Barriers(
        lines={value: model for _, file in files for value, model in file.lines.items()},
        fences={value: model for _, file in files for value, model in file.fences.items()},
    )


R = TypeVar("R", bound=DataRecord)


def _read(kind: str, record: type[R]) -> list[tuple[Path, R]]:
    return [(path, read_record(path, record, guide=GUIDE)) for path in data_files(ROOM, kind)]


def _check(path: Path, named: Iterable[tuple[str, str]]) -> None:
    """Refuse names of models that nobody made; "" is nothing."""
    models = street_models()
    for where, model in named:
        if model and model not in models:
            raise SchemaError(
                f"{path}: {where}: no model {model!r} stands outdoors; write it (docs/adding_a_model.md) or use one of "
                + ", ".join(sorted(models))
            )
