"""How streets are painted and paved where a place lies: data of ``vico/data/streets``, read once.

docs/adding_street_habits.md describes the files.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import shapely
from pydantic import Field

from vico.errors import SchemaError
from vico.geo.osm import OsmData
from vico.io.data_files import DataRecord, cached_data, data_files, read_record
from vico.worldgen.facts.driving_side import country_named

ROOM = "streets"
GUIDE = "docs/adding_street_habits.md"
Rgb = tuple[int, int, int]
Ring = tuple[tuple[float, float], ...]


class Paving(DataRecord):
    """What a kind of ground is covered with: a material of ours, metres that its texture covers, and a tint."""

    material: str
    tile: float
    tint: Rgb


class _Markings(DataRecord):
    centre: Literal["white", "yellow"] | None = None
    solid_centre: bool | None = None
    dash: float | None = Field(default=None, gt=0.0)
    gap: float | None = Field(default=None, gt=0.0)
    line: float | None = Field(default=None, gt=0.0)
    stop: float | None = Field(default=None, gt=0.0)
    cycle_lane: Rgb | Literal["none"] | None = None
    signal_crossing: Literal["zebra", "lines", "ladder", "dashes", "dots", "broken_lines", "studs"] | None = None
    kerb_lines: Literal["none", "double_yellow"] | None = None


class _Plates(DataRecord):
    names_on: Literal["walls", "posts", "nothing"] | None = None
    ground: Rgb | None = None
    letters: Rgb | None = None
    rim: Rgb | Literal["none"] | None = None
    number_ground: Rgb | None = None
    number_letters: Rgb | None = None


class _Entry(DataRecord):
    name: str
    like: str | None = None
    countries: tuple[str, ...] = ()
    outlines: tuple[Ring, ...] = ()
    only: tuple[Ring, ...] = ()
    markings: _Markings = _Markings()
    plates: _Plates = _Plates()
    pavings: dict[str, Paving] = Field(default_factory=dict)


class _File(DataRecord):
    habits: tuple[_Entry, ...] = ()


@dataclass(frozen=True)
class Markings:
    """How carriageways are painted; lengths and widths in metres.

    Attributes
    ----------
    centre, solid_centre
        Colour of lines between opposite directions, and whether they are two solid ones instead of dashes.
    dash, gap
        Of broken lines.
    line, stop
        Width of lines, and of stop lines.
    cycle_lane
        Colour of the strip; None: lines only.
    signal_crossing
        How crossings with signals are painted where the map does not say.
    kerb_lines
        Lines along kerbs of main streets where nobody may wait.
    """

    centre: str = "white"
    solid_centre: bool = False
    dash: float = 3.0
    gap: float = 6.0
    line: float = 0.12
    stop: float = 0.4
    cycle_lane: Rgb | None = (148, 92, 78)
    signal_crossing: str = "zebra"
    kerb_lines: str = "none"


@dataclass(frozen=True)
class Plates:
    """What plates with the names of streets and the numbers of houses look like.

    Attributes
    ----------
    names_on
        Whether streets' names are on the walls of corner houses, or on posts that stand at the corner; nothing: no
        street has one.
    ground, letters, rim
        Colours of these; None: no rim.
    number_ground, number_letters
        Colours of the numbers of houses.
    """

    names_on: str = "walls"
    ground: Rgb = (22, 58, 132)
    letters: Rgb = (244, 244, 240)
    rim: Rgb | None = None
    number_ground: Rgb = (22, 58, 132)
    number_letters: Rgb = (244, 244, 240)


@dataclass(frozen=True)
class StreetHabits:
    """What is usual in the streets of a place.

    Attributes
    ----------
    name, family
        Of the entry, and of the one that it is `like` at last.
    markings, pavings
        Paint, and pavings by kind of ground.
    plates
        Names of streets and numbers of houses.
    """

    name: str
    family: str
    markings: Markings
    plates: Plates
    pavings: dict[str, Paving]


@cached_data
def _entries() -> dict[str, _Entry]:
    """Return all entries by name; a user's come after ours, and replace those of the same name."""
    found: dict[str, _Entry] = {}
    for path in data_files(ROOM, "habits"):
        for entry in read_record(path, _File, guide=GUIDE).habits:
            _check(path, entry, found)
            found.pop(entry.name, None)
            found[entry.name] = entry
    return found


def _check(path: Path, entry: _Entry, known: Iterable[str]) -> None:
    if entry.like is not None and entry.like not in known:
        raise SchemaError(f"{path}: {entry.name}: like: no habits {entry.like!r} before it; see {GUIDE}")
    for ring in (*entry.outlines, *entry.only):
        if len(ring) < 3:
            raise SchemaError(f"{path}: {entry.name}: an outline needs three corners or more; see {GUIDE}")


def street_habits(osm: OsmData) -> StreetHabits:
    """Return what is usual in the streets of a map: by the country that addresses name, else by where it lies.

    Raises
    ------
    SchemaError
        If a file can't be used; the message says which, where, and what is wrong.
    """
    return habits_at(osm.frame.lat, osm.frame.lon, country_named(osm))


@cached_data
def habits_at(lat: float, lon: float, country: str | None = None) -> StreetHabits:
    """Return what is usual at a place, degrees, in a country (ISO 3166-1; None: unknown)."""
    entries = _entries()
    holding = [entry for entry in entries.values() if _holds(entry, lat, lon, country)]
    return _resolved((holding or list(entries.values()))[-1 if holding else 0], entries)


def _holds(entry: _Entry, lat: float, lon: float, country: str | None) -> bool:
    if entry.only and not _within(entry.only, lat, lon):
        return False
    if country is not None:
        return country in entry.countries
    return _within(entry.outlines, lat, lon)


def _within(rings: Iterable[Ring], lat: float, lon: float) -> bool:
    point = shapely.Point(lon, lat)
    return any(shapely.Polygon(ring).contains(point) for ring in rings)


def _resolved(entry: _Entry, entries: dict[str, _Entry]) -> StreetHabits:
    """Fill in what an entry leaves open."""
    line = [entry]
    while line[-1].like is not None:
        line.append(entries[line[-1].like])
    family = line[-1].name
    line.append(next(iter(entries.values())))
    said: dict[str, object] = {}
    plates: dict[str, object] = {}
    pavings: dict[str, Paving] = {}
    for one in reversed(line):
        said |= one.markings.model_dump(exclude_none=True)
        plates |= one.plates.model_dump(exclude_none=True)
        pavings |= one.pavings
    if said.get("cycle_lane") == "none":
        said["cycle_lane"] = None
    if plates.get("rim") == "none":
        plates["rim"] = None
    return StreetHabits(entry.name, family, Markings(**said), Plates(**plates), pavings)  # type: ignore[arg-type]
