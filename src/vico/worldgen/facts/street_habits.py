"""Habits of streets by country: the driving side, how streets are painted and paved, what plates look like.

The driving side follows from the country that addresses name, else from where the place lies. The rest is data of
``vico/data/worldgen/streets``, read once; docs/adding_street_habits.md describes the files.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import shapely
from pydantic import Field

from vico.errors import SchemaError
from vico.geo.osm import OsmData
from vico.io.data_files import DataRecord, cached_data, data_files, read_record

_CODES = """
AG AI AU BB BD BM BN BS BT BW CC CK CX CY DM FJ FK GB GD GG GY HK ID IE IM IN JE JM JP KE KI KN KY LC LK LS MO MS MT MU
MV MW MY MZ NA NF NP NR NU NZ PG PK PN SB SC SG SH SR SZ TC TH TK TL TO TT TV TZ UG VC VG VI WS ZA ZM ZW
"""
LEFT_COUNTRIES = frozenset(_CODES.split())
"""ISO 3166-1 codes of the countries and territories where traffic keeps left."""

# Coarse outlines, longitude and latitude, drawn so that no neighbour's town of the other side lies within.
_OUTLINES: tuple[list[tuple[float, float]], ...] = (
    # Britain, Ireland, the Isle of Man; the Channel Islands; Malta; Cyprus.
    [(-11, 51), (-6.5, 49.7), (-1, 50.3), (1.35, 50.75), (1.6, 51.2), (2.2, 52.6), (0, 61.2), (-9, 61)],
    [(-2.8, 49.1), (-1.95, 49.1), (-1.95, 49.78), (-2.8, 49.78)],
    [(14.1, 35.7), (14.7, 35.7), (14.7, 36.2), (14.1, 36.2)],
    [(32.2, 34.5), (34.1, 34.5), (34.7, 35.8), (32.2, 35.5)],
    # Japan and its southern islands.
    [(128.4, 32), (129.2, 34.9), (133, 37), (137, 38.6), (138.8, 41.5), (139, 43.5), (141.3, 45.7), (146, 44.2),
     (145, 42), (142.5, 38), (141.5, 30), (130, 29.5)],
    [(122.8, 24), (126, 24), (131.5, 28), (131.5, 31), (127, 29), (122.8, 24.8)],
    # India, Pakistan, Nepal, Bhutan, Bangladesh, Sri Lanka, the Maldives.
    [(61.8, 25), (62.9, 27.2), (61, 29.7), (66.3, 29.9), (66.8, 31.3), (69.3, 31.9), (70, 34), (71.5, 36.4),
     (74.8, 37), (77.8, 35.4), (79, 32.5), (81.2, 30.1), (88.2, 27.9), (91.8, 27.8), (95.5, 29.2), (97.3, 28.2),
     (94.8, 25.5), (93.2, 24), (92.6, 21.2), (92, 20.7), (89, 20), (82.5, 5), (72.5, -1), (71, 12), (66, 23)],
    # Thailand, Malaysia, Singapore, Brunei, Indonesia, East Timor, Papua New Guinea.
    [(97.6, 18.3), (98.9, 16.3), (98.3, 13.8), (99.4, 11.5), (97.8, 8), (94.5, 6), (105, -9), (125, -11.5),
     (155.5, -11.8), (157, -2), (141, 0.5), (126.5, 5), (119, 4.9), (117, 7.5), (108, 5), (103.3, 9.5),
     (102.5, 11.7), (102.9, 13.5), (105.5, 14.4), (104.8, 16.6), (103.9, 18.1), (102.5, 17.87), (101, 17.6),
     (101.2, 19.5), (100, 20.4), (98, 19.7)],
    [(113.82, 22.18), (114.05, 22.49), (114.22, 22.55), (114.5, 22.5), (114.5, 22.1)],
    [(113.52, 22.1), (113.6, 22.1), (113.6, 22.215), (113.53, 22.215)],
    # Australia, New Zealand, the Solomons, Fiji.
    [(112, -22), (129, -10.5), (142, -9.8), (154.5, -24), (154.5, -38), (147, -44.5), (112, -36)],
    [(165, -48.5), (170, -48.5), (179.2, -40), (179.2, -36), (171.5, -33.5), (165.5, -45)],
    [(154.5, -6.5), (155.5, -12.5), (163, -12.5), (161, -8)],
    [(176.5, -19.8), (180, -19.8), (180, -15.5), (176.5, -15.5)],
    # Africa from Kenya to the Cape, without Angola and the Congo; Mauritius, the Seychelles.
    [(34, 4.3), (36, 4.5), (41.2, 4), (41, -1.6), (44, -4.7), (41.5, -12), (41, -16), (33.3, -35.5), (18, -35.5),
     (11.5, -17.3), (13.9, -17.4), (18.4, -17.4), (21.4, -17.9), (22, -16.2), (22, -13), (24, -12.9), (24, -11),
     (25.4, -11.8), (27.1, -12), (28.2, -12.45), (29.1, -13.4), (29.8, -13.4), (29.8, -12.2), (28.4, -12.4),
     (28.4, -9.2), (30.8, -8.3), (29.5, -6.5), (29.4, -4.5), (30.8, -3.3), (30.8, -1.1), (29.6, -1.4), (29.6, -0.5),
     (30.5, 1.5), (31.1, 2.3), (31, 3.7)],
    [(57, -20.7), (64, -20.7), (64, -19.5), (57, -19.5)],
    [(46, -10.5), (56.5, -10.5), (56.5, -3.5), (46, -3.5)],
    # The Bahamas, Jamaica, the Caymans; islands from the Virgins to Trinidad; Guyana and Surinam; Bermuda.
    [(-79.3, 25.5), (-77.5, 27.5), (-71, 21.8), (-71, 20.9), (-73.3, 20.7), (-77, 22.6)],
    [(-81.6, 19.1), (-79.5, 19.1), (-78.6, 17.6), (-76, 17.6), (-76, 18.6), (-79.5, 19.9), (-81.6, 19.5)],
    [(-65.1, 17.6), (-64.2, 17.6), (-64.2, 18.8), (-65.1, 18.8)],
    [(-63.2, 17.05), (-61.6, 16.95), (-61.5, 17.8), (-62.9, 17.5), (-62.95, 18.3), (-63.3, 18.3)],
    [(-61.6, 15.15), (-61.1, 15.15), (-61.1, 15.68), (-61.6, 15.68)],
    [(-61.2, 14.15), (-60.8, 14.15), (-59.2, 13.5), (-59.2, 12.8), (-60.3, 10), (-61.95, 10), (-61.95, 12.4)],
    [(-60.7, 8), (-57, 6.5), (-54, 6), (-54.1, 4.8), (-54.6, 2.4), (-59, 1.4), (-61.3, 5.9)],
    [(-65, 32.2), (-64.6, 32.2), (-64.6, 32.45), (-65, 32.45)],
)  # fmt: skip
_LEFT = shapely.union_all([shapely.Polygon(corners) for corners in _OUTLINES])


def drives_left(lat: float, lon: float) -> bool:
    """Whether traffic keeps left at a place, by a coarse map of the countries where it does."""
    return bool(_LEFT.contains(shapely.Point(lon, lat)))


def country_named(osm: OsmData) -> str | None:
    """Return the country that most addresses of a map name, ISO 3166-1; None where none names one."""
    named = Counter(
        tags["addr:country"].strip().upper()
        for tags in (*(node.tags for node in osm.nodes), *(area.tags for area in osm.areas))
        if len(tags.get("addr:country", "").strip()) == 2
    )
    return max(named.items(), key=lambda item: (item[1], item[0]))[0] if named else None


def keeps_left(osm: OsmData) -> bool:
    """Whether traffic keeps left in a window.

    The country that most addresses of the map name decides; where none names one, where the window lies.
    """
    country = country_named(osm)
    return drives_left(osm.frame.lat, osm.frame.lon) if country is None else country in LEFT_COUNTRIES


ROOM = "worldgen/streets"
GUIDE = "docs/adding_street_habits.md"
Rgb = tuple[int, int, int]
Ring = tuple[tuple[float, float], ...]


class Paving(DataRecord):
    """Covering of a kind of ground: a material of ours, metres that its texture covers, and a tint."""

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
    """Colours of plates with the names of streets and the numbers of houses.

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
    """Customs in the streets of a place.

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
    holding = [entry for entry in entries.values() if _is_valid_at(entry, lat, lon, country)]
    # What the entry leaves open comes from those it is like.
    entry = (holding or list(entries.values()))[-1 if holding else 0]
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


def _is_valid_at(entry: _Entry, lat: float, lon: float, country: str | None) -> bool:
    if entry.only and not _within(entry.only, lat, lon):
        return False
    if country is not None:
        return country in entry.countries
    return _within(entry.outlines, lat, lon)


def _within(rings: Iterable[Ring], lat: float, lon: float) -> bool:
    point = shapely.Point(lon, lat)
    return any(shapely.Polygon(ring).contains(point) for ring in rings)
