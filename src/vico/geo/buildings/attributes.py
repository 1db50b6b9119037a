"""What the attributes of city models mean, in OpenStreetMap's words; data/sources/attributes.toml has the names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from pydantic import Field

from vico.geo.quantities import Kind, read
from vico.io.data_files import DataRecord, cached_data, data_files, read_record

_GUIDE = "docs/sources.md"
_LONGEST = 120


class AttributeNames(DataRecord):
    """Names and codes of attributes; see the data file."""

    height: tuple[str, ...] = ()
    levels: tuple[str, ...] = ()
    name: tuple[str, ...] = ()
    kind: tuple[str, ...] = ()
    roof: tuple[str, ...] = ()
    roof_shapes: dict[str, str] = Field(default_factory=dict)
    building_kinds: dict[str, str] = Field(default_factory=dict)


@cached_data
def attribute_names() -> AttributeNames:
    """Return the names of all data files, a user's own before the package's.

    Raises
    ------
    SchemaError
        If a file is not as its schema says.
    """
    records = [read_record(path, AttributeNames, guide=_GUIDE) for path in data_files("sources", "attributes")][::-1]
    shapes: dict[str, str] = {}
    kinds: dict[str, str] = {}
    for record in reversed(records):
        shapes |= record.roof_shapes
        kinds |= record.building_kinds
    return AttributeNames(
        height=tuple(name for record in records for name in record.height),
        levels=tuple(name for record in records for name in record.levels),
        name=tuple(name for record in records for name in record.name),
        kind=tuple(name for record in records for name in record.kind),
        roof=tuple(name for record in records for name in record.roof),
        roof_shapes=shapes,
        building_kinds=kinds,
    )


def tags_of_attributes(attributes: Mapping[str, object]) -> dict[str, str]:
    """Return what a building's attributes say, in OpenStreetMap's words; what they leave open has no tag."""
    names = attribute_names()
    tags: dict[str, str] = {}
    height, levels = _number(attributes, names.height, Kind.LENGTH), _number(attributes, names.levels, Kind.STOREYS)
    if height is not None and 1.0 < height < 900.0:
        tags["height"] = f"{height:.2f}"
    if levels is not None and 1 <= levels <= 150:
        tags["building:levels"] = str(round(levels))
    if (name := _text(attributes, names.name)) and not _is_code(name):
        tags["name"] = name
    shape = names.roof_shapes.get(_text(attributes, names.roof))
    if shape:
        tags["roof:shape"] = shape
    kind = names.building_kinds.get(_text(attributes, names.kind))
    if kind:
        tags["building"] = kind
    return tags


def _is_code(name: str) -> bool:
    """Whether a name is one for machines: no letter in it, or no vowel beside digits, or an id."""
    return (
        not any(c.isalpha() for c in name)
        or any(c in "_{}|" for c in name)
        or (any(c.isdigit() for c in name) and " " not in name)
    )


def _text(attributes: Mapping[str, object], names: Sequence[str]) -> str:
    for name in names:
        value = attributes.get(name)
        if isinstance(value, list) and value:
            value = value[0]
        if isinstance(value, str | int) and not isinstance(value, bool):
            return " ".join(str(value).split())[:_LONGEST]
    return ""


def _number(attributes: Mapping[str, object], names: Sequence[str], kind: Kind) -> float | None:
    for name in names:
        value = attributes.get(name)
        if isinstance(value, str | int | float) and (number := read(str(value), kind).value) is not None:
            return number
    return None
