"""Many worlds side by side: tables and lists of places, and a build task for each place.

A table is a file as people and spreadsheets write it. A list comes with the package (``NAME.toml`` in
``vico/data/worldgen/worlds``), or in the folder ``worldgen/worlds`` of ``$VICO_DATA``. Tasks are done by processes of
this machine or by a Ray cluster.
"""

from __future__ import annotations

import difflib
import importlib
import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from pydantic import Field, model_validator

from vico.errors import InputError, MissingFileError, SchemaError, VicoError
from vico.geo.quantities import Kind, read
from vico.io.data_files import DataRecord, cached_data, data_files, read_record
from vico.io.delimited import DelimitedText, decimal, table_of
from vico.io.stores import FolderStore, Store, store_at
from vico.jobs import Answer, Service, Task, open_executor
from vico.jobs.contract import check_shared_store, shared_store_marker
from vico.world.folder import fetch_manifest, read_world
from vico.world.world import stage_seconds
from vico.worldgen.pipeline import build_world
from vico.worldgen.request import LEAST_RADIUS, SERVICES, Sources

_MOST_BYTES = 16 << 20
_LONGEST_NAME = 200  # bytes; file systems take 255, and a temporary folder's name is longer
_THINGS = ("", "procedural", "installed")
_FILES = ("osm", "dem", "tiles", "gtfs", "places", "photos", "layouts", "buildings", "precedence")
# Other names that tables have for columns, those that count first in front; accents, case and brackets do not count.
_SPELLINGS: dict[str, tuple[str, ...]] = {
    "name": (
        *("place", "place name", "city", "city name", "town", "town name", "title", "label", "site", "site name"),
        *("location", "location name", "world", "Ort", "Ortsname", "Ortschaft", "Stadt", "Gemeinde", "Bezeichnung"),
        *("nom", "ville", "commune", "lieu", "nombre", "ciudad", "lugar", "municipio", "nome", "città", "luogo"),
        *("comune", "cidade", "município", "local", "naam", "plaats", "plaatsnaam", "stad", "nazwa", "miasto"),
        *("miejscowość", "navn", "by", "sted", "namn", "ort", "nimi", "kaupunki", "název", "město", "obec"),
        *("názov", "mesto", "név", "város", "település", "nume", "oraș", "naziv", "ime", "grad", "ad", "şehir", "yer"),
        *("όνομα", "πόλη", "название", "имя", "город", "место", "назва", "місто", "име", "град", "名称", "名稱"),
        *("地名", "城市", "地点", "地點", "名前", "名", "都市", "場所", "이름", "도시", "지명", "الاسم", "المدينة"),
        *("שם", "עיר", "नाम", "शहर", "ชื่อ", "เมือง", "tên", "thành phố", "nama", "kota", "id"),
    ),
    "lat": (
        *("latitude", "lat deg", "latitude deg", "latitude decimal", "decimal latitude", "lat dd", "geo lat"),
        *("gps lat", "gps latitude", "lat wgs84", "latitude wgs84", "wgs84 lat", "Breite", "Breitengrad"),
        *("geographische Breite", "geografische Breite", "geogr Breite", "latitud", "latitudine", "breedte"),
        *("breedtegraad", "szerokość", "szerokość geograficzna", "breddegrad", "bredde", "breddgrad", "leveysaste"),
        *("leveyspiiri", "zeměpisná šířka", "šířka", "zemepisná šírka", "szélesség", "földrajzi szélesség"),
        *("geografska širina", "enlem", "πλάτος", "γεωγραφικό πλάτος", "широта", "географска ширина", "ширина"),
        *("纬度", "緯度", "위도", "خط العرض", "קו רוחב", "अक्षांश", "ละติจูด", "vĩ độ", "lintang", "y"),
    ),
    "lon": (
        *("longitude", "long", "lng", "lon deg", "longitude deg", "longitude decimal", "decimal longitude", "lon dd"),
        *("geo lon", "geo lng", "gps lon", "gps longitude", "lon wgs84", "longitude wgs84", "wgs84 lon", "Länge"),
        *("Laenge", "Längengrad", "Laengengrad", "geographische Länge", "geografische Länge", "geogr Länge"),
        *("longitud", "longitudine", "lengte", "lengtegraad", "długość", "dlugosc", "długość geograficzna"),
        *("længdegrad", "lengdegrad", "lengde", "længde", "longitud", "längdgrad", "pituusaste", "pituuspiiri"),
        *("zeměpisná délka", "délka", "zemepisná dĺžka", "hosszúság", "földrajzi hosszúság", "geografska dužina"),
        *("geografska dolžina", "boylam", "μήκος", "γεωγραφικό μήκος", "долгота", "довгота", "географска дължина"),
        *("经度", "經度", "経度", "경도", "خط الطول", "קו אורך", "देशांतर", "ลองจิจูด", "kinh độ", "bujur", "x"),
    ),
    "osm": ("map", "extract", "osm file", "pbf"),
    "radius": (
        *("radius m", "radius km", "radius ft", "half", "Umkreis", "Halbmesser", "rayon", "radio", "raggio", "raio"),
        *("straal", "promień", "radie", "säde", "poloměr", "sugár", "rază", "yarıçap", "ακτίνα", "радиус", "радіус"),
        *("半径", "半徑", "반경", "반지름"),
    ),
    "dem": ("elevation", "elevation file"),
}
_DASHES = re.compile("[\N{MINUS SIGN}\N{EN DASH}\N{HYPHEN}]")
_THOUSANDS = re.compile(r"[1-9]\d{0,2}([.,])\d{3}(?:\1\d{3})*(?![\d.,])")
_UNIT_OF_HEADER = re.compile(r"(?<![^\W_])(km|ft|feet|mi)(?![^\W_])", re.IGNORECASE)
# 52.1, 52,1°, N 52.1, 52°06'00.0"N
_ANGLE = re.compile(
    r"""(?P<before>[NSEW])?\s*([+-]?\d[\d.,]*)\s*°?(?:\s*(\d[\d.,]*)\s*['′’])?(?:\s*(\d[\d.,]*)\s*(?:"|″|”|''))?\s*(?P<after>[NSEW])?""",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class PlaceRow:
    """A world to build; a row of the table. Several files in a cell are separated by ``;``."""

    name: str
    lat: float
    lon: float
    osm: str = ""
    radius: float = 400.0
    dem: str = ""
    tiles: str = ""
    gtfs: str = ""
    places: str = ""
    photos: str = ""
    layouts: str = ""
    things: str = ""
    buildings: str = ""
    precedence: str = ""
    seed: int = 0


@dataclass(frozen=True)
class BadRow:
    """A row that can't be read: its name, or its line where it has none, and the reason, which gives the line."""

    name: str
    reason: str


@dataclass(frozen=True)
class PlaceTable:
    """Rows of a table of places, and notes on how it is written.

    Attributes
    ----------
    rows
        The places, in the order of the table.
    bad
        Rows that can't be read.
    notes
        What was read otherwise than it is written in the guide, or not at all, a sentence each.
    """

    rows: tuple[PlaceRow, ...]
    bad: tuple[BadRow, ...] = ()
    notes: tuple[str, ...] = ()


def read_place_table(path: Path) -> PlaceTable:
    """Read a table of places with a header: ``name,lat,lon`` and any other field of `PlaceRow`.

    Usual names of columns (``City``, ``Latitude``, ``lng``), semicolons or tabs, decimal commas, degrees and minutes,
    and other encodings than UTF-8 are read too; empty rows are passed over. File names are taken relative to the
    table's folder.

    Raises
    ------
    MissingFileError
        If it is not there.
    SchemaError
        If it is no table, lacks a column, or no row of it can be read; the message gives the line.
    """
    path = Path(path)
    if not path.is_file():
        raise MissingFileError(f"{path}: no such file; give a CSV table with columns name, lat, lon")
    if path.stat().st_size > _MOST_BYTES:
        raise SchemaError(f"{path}: larger than {_MOST_BYTES >> 20} MB; split the table")
    with path.open("rb") as file:
        if file.read(4) in (b"PK\3\4", b"\xd0\xcf\x11\xe0"):
            raise SchemaError(f"{path}: is a spreadsheet's own file; save it as CSV")
    known = [f.name for f in fields(PlaceRow)]
    table = table_of(path, {name: _SPELLINGS.get(name, ()) for name in known})
    notes = _checked_header(table, path, known)
    said = _UNIT_OF_HEADER.search(dict(zip(table.header, table.written, strict=True)).get("radius", ""))
    unit = said[1].lower() if said else ""
    rows: dict[str, tuple[int, PlaceRow]] = {}
    bad: list[BadRow] = []
    for cells in table:
        name, line = dict(zip(table.header, cells, strict=False)).get("name", ""), table.line
        try:
            if any(cells[len(table.header) :]):
                raise ValueError(
                    f"has {len(cells)} cells under {len(table.header)} columns; numbers with decimal commas must be "
                    "quoted in a table that commas separate"
                )
            row = _row(dict(zip(table.header, cells, strict=False)), path, unit)
            if name in rows:
                raise ValueError(f"named as line {rows[name][0]} is; every world needs a folder of its own")
            rows[name] = line, row
        except ValueError as error:
            bad.append(BadRow(name or f"line {line}", f"{path}:{line}: {f'{name}: ' if name else ''}{error}"))
    if not rows:
        raise SchemaError(bad[0].reason if bad else f"{path}: holds no place; add rows below the header")
    if table.foreign or table.encoding != "UTF-8":
        notes.append(f"{path}: read as {'Windows-1252' if table.foreign else table.encoding}, as it is no UTF-8")
    return PlaceTable(tuple(row for _, row in rows.values()), tuple(bad), tuple(notes))


def _checked_header(table: DelimitedText, path: Path, known: list[str]) -> list[str]:
    """Return notes on how a table is written; refuse one that lacks a column, or has one that looks misspelt."""
    header = [column for column in table.header if column]
    found = f"separated by {table.separator}, it has {', '.join(header[:20]) or 'none'}"
    missing = [column for column in ("name", "lat", "lon") if column not in header]
    if missing:
        raise SchemaError(f"{path}: the header lacks {', '.join(missing)} ({found}); columns are {', '.join(known)}")
    unknown = [column for column in header if column not in known]
    for column in unknown:
        if near := difflib.get_close_matches(column.casefold(), known, n=1, cutoff=0.75):
            raise SchemaError(f"{path}: the header has a column {column}; did you mean {near[0]}?")
    notes = []
    if unknown:
        are = "column is" if len(unknown) == 1 else "columns are"
        notes.append(f"{path}: {', '.join(unknown)}: no such {are} known; passed over")
    return notes


def _row(text: Mapping[str, str], path: Path, unit: str) -> PlaceRow:
    """Return a row of the table; `unit` is that of radii which do not say theirs.

    Raises
    ------
    ValueError
        If a cell is not as it should be.
    """
    name = text.get("name", "")
    if not name or name in (".", "..") or any(c in "/\\" or not c.isprintable() for c in name):
        raise ValueError(f"name {name!r} can't be a folder's name")
    if len(name.encode()) > _LONGEST_NAME:
        raise ValueError(f"a name of {len(name.encode())} bytes is too long for a folder's name")
    lat, lon = _degrees(text.get("lat", ""), "latitude", "NS"), _degrees(text.get("lon", ""), "longitude", "EW")
    if not (-90 <= lat <= 90 and -180 <= lon <= 180):
        exchanged = "; latitude and longitude look exchanged" if abs(lon) <= 90 < abs(lat) <= 180 else ""
        raise ValueError(f"{lat:g}, {lon:g} is not on Earth{exchanged}; give degrees, latitude -90..90 first")
    things = text.get("things", "")
    if things not in _THINGS:
        raise ValueError(f"things {things!r}; give procedural or installed, or nothing")
    return PlaceRow(
        name,
        lat,
        lon,
        radius=_radius(text.get("radius", ""), unit),
        things=things,
        seed=_seed(text.get("seed", "")),
        **{column: _beside(text.get(column, ""), path) for column in _FILES},
    )


def _degrees(text: str, what: str, letters: str) -> float:
    """Return an angle, degrees; the second of `letters` (south, west for longitudes) counts down."""
    match = _ANGLE.fullmatch(_DASHES.sub("-", text))
    parts = [] if match is None else [decimal(part) for part in match.group(2, 3, 4) if part is not None]
    if match is None or None in parts:
        raise ValueError(f"{what} {text[:40]!r} is no number of degrees")
    letter = (match["before"] or match["after"] or "").upper()
    if letter and letter not in letters:
        raise ValueError(f"{what} {text[:40]!r} is none; latitude and longitude look exchanged")
    value = sum(abs(part or 0.0) / 60.0**k for k, part in enumerate(parts))
    return -value if match[2].startswith("-") or (letter and letter in "SW") else value


def _radius(text: str, unit: str) -> float:
    """Return a radius, metres (``1000``, ``1,000``, ``1.000 m``, ``0,4 km``).

    Raises
    ------
    ValueError
        If it is none.
    """
    if not text:
        return PlaceRow.radius
    text = re.sub(r"(?<=\d)['’](?=\d{3}(?!\d))", "", text.strip())  # "1'000" is a thousand in Switzerland, not feet
    said = text if not unit or re.search(r"[^\W\d_]", text) else f"{text} {unit}"
    found = read(said, Kind.LENGTH)
    value = found.value if not found.rule or "thousands" in found.rule else None
    # Three digits after the separator are decimals only where that gives a world.
    if (thousands := _THOUSANDS.match(text)) and (value is None or value < LEAST_RADIUS):
        value = read(said.replace(thousands[0], re.sub("[.,]", "", thousands[0])), Kind.LENGTH).value
    if value is None or value <= 0.0:
        raise ValueError(f"radius {text[:40]!r} is no positive number of metres")
    return value


def _seed(text: str) -> int:
    value = decimal(text) if text else float(PlaceRow.seed)
    if value is None or value != round(value):
        raise ValueError(f"seed {text[:40]!r} is no whole number")
    return round(value)


def _beside(text: str, table: Path) -> str:
    parts = [part.strip() for part in text.split(";") if part.strip()]
    return ";".join(part if "://" in part or part in SERVICES else str(table.parent / part) for part in parts)


_ROOM = "worldgen/worlds"
_GUIDE = "docs/places35.md"


class ListedPlace(DataRecord):
    """A place of a list.

    Attributes
    ----------
    name
        Of the world's folder.
    title
        What it is called.
    country
        ISO 3166-1 alpha-2.
    lat, lon
        The centre, degrees.
    radius
        Half the side, metres.
    extract, dem
        Map and elevation, relative to a folder with extracts, for whoever has one.
    paper
        Which figure of the paper shows it, if one does.
    seed
        Of the build.
    """

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9_]{0,60}$")
    title: str = Field(min_length=1)
    country: str = Field(pattern=r"^[A-Z]{2}$")
    lat: float = Field(ge=-85.0, le=85.0)
    lon: float = Field(ge=-180.0, le=180.0)
    radius: float = Field(default=400.0, ge=50.0, le=2000.0)
    extract: str = ""
    dem: tuple[str, ...] = ()
    paper: str = ""
    seed: int = Field(default=0, ge=0)


class PlaceList(DataRecord):
    """Places, and what they are for, in a sentence."""

    about: str
    places: tuple[ListedPlace, ...] = Field(min_length=1, alias="place")

    @model_validator(mode="after")
    def _names_differ(self) -> PlaceList:
        names = [place.name for place in self.places]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"{', '.join(twice)} twice; every world needs a folder of its own")
        return self


@cached_data
def place_lists() -> dict[str, PlaceList]:
    """Return every list by name; a user's takes the place of ours of its name.

    Raises
    ------
    SchemaError
        If a file is not as it should be.
    """
    return {path.stem: read_record(path, PlaceList, guide=_GUIDE) for path in data_files(_ROOM)}


def rows_of(places: PlaceList, *, extracts: Path | None = None, only: Collection[str] = ()) -> list[PlaceRow]:
    """Return the rows of a list for `build_many`.

    Parameters
    ----------
    places
        The list.
    extracts
        Folder with maps and elevation models; without, and where it has none for a place, its map is fetched.
    only
        Names of the places to take; all without.

    Raises
    ------
    InputError, MissingFileError
        If a name is none of the list's, or there is no such folder.
    """
    known = [place.name for place in places.places]
    unknown = sorted(set(only) - set(known))
    if unknown:
        raise InputError(f"build-many: {unknown[0]!r} is no place of the list; there are {', '.join(known)}")
    if extracts is not None and not extracts.is_dir():
        raise MissingFileError(f"{extracts}: no such folder of extracts")
    return [_row_of_place(place, extracts) for place in places.places if not only or place.name in only]


def _row_of_place(place: ListedPlace, extracts: Path | None) -> PlaceRow:
    osm, dem = "", ""
    if extracts is not None and place.extract and (extracts / place.extract).is_file():
        osm = str(extracts / place.extract)
        dem = ";".join(str(extracts / name) for name in place.dem if (extracts / name).is_file())
    return PlaceRow(place.name, place.lat, place.lon, osm=osm, radius=place.radius, dem=dem, seed=place.seed)


@dataclass(frozen=True)
class Outcome:
    """Result for a place: built, kept (it was there), or failed with a reason."""

    name: str
    state: str
    buildings: int = 0
    places: int = 0
    seconds: float = 0.0
    reason: str = ""
    flat: bool = False


Locate = Callable[[float, float, float], Path]
#: Called with each outcome as it comes, how many there are by now, and how many there will be.
Finished = Callable[[Outcome, int, int], None]


def build_many(
    rows: Sequence[PlaceRow],
    out: Path | Store,
    *,
    locate: Locate,
    workers: int = 1,
    force: bool = False,
    ray: str | None = None,
    finished: Finished | None = None,
) -> list[Outcome]:
    """Build every place into a folder of `out`; a world that is there and whole is kept, one that fails is reported.

    Parameters
    ----------
    rows
        The places.
    out
        Parent folder of the worlds, or a store.
    locate
        Finds a map for a place without a file: latitude, longitude, half side to a path. A function of a module, as
        other processes must find it.
    workers
        How many processes side by side; with one, all is done in this process.
    force
        Build worlds anew that are there.
    ray
        Hand the places to a Ray cluster instead: its address, or ``auto``; see `vico.jobs.open_executor`.
    finished
        Told of each outcome as it comes, how many there are by now, and how many there will be.

    Returns
    -------
    list of Outcome
        In the order of the rows.

    Raises
    ------
    InputError
        If `workers` is no number of processes, or there is no such cluster.
    MissingExtraError
        If `ray` is asked for and not installed.
    """
    store = FolderStore(out) if isinstance(out, Path) else out
    outcomes: dict[int, Outcome] = {}

    def record(index: int, answer: Answer) -> None:
        name = rows[index].name
        content = answer.content or asdict(Outcome(name, "failed", reason=answer.reason))
        outcomes[index] = Outcome(**content)
        if finished is not None:
            finished(outcomes[index], len(outcomes), len(rows))

    if ray is None:
        workers = min(workers, max(1, len(rows)))
    options = {"out": str(store), "locate": f"{locate.__module__}:{locate.__qualname__}", "force": force}
    with open_executor(workers=workers, ray=ray) as executor, shared_store_marker(store, executor) as seen:
        service = Service("vico.worldgen.batch:builder", {**options, "seen": seen})
        executor.run(service, [Task(asdict(row)) for row in rows], done=record)
    return [outcomes[index] for index in range(len(rows))]


def builder(options: Mapping[str, Any], _: object) -> Callable[[Mapping[str, Any]], dict[str, Any]]:
    """Return what builds a place, of the fields of a `PlaceRow`, and returns the fields of an `Outcome`."""
    store = store_at(options["out"])
    check_shared_store(store, options["seen"])
    module, _, name = options["locate"].partition(":")
    locate: Locate = getattr(importlib.import_module(module), name)

    def build(content: Mapping[str, Any]) -> dict[str, Any]:
        return asdict(build_one(PlaceRow(**content), store=store, locate=locate, force=options["force"]))

    return build


def build_one(row: PlaceRow, *, store: Store, locate: Locate, force: bool) -> Outcome:
    """Build one place; bad input becomes an outcome, so that it does not end the others."""
    try:
        if not force and store.has(f"{row.name}/world.json"):
            there = store.folder / row.name if isinstance(store, FolderStore) else fetch_manifest(f"{store}/{row.name}")
            kept = read_world(there).manifest.counts
            return Outcome(row.name, "kept", kept["buildings"], kept["places"])
        sources = Sources(
            osm=Path(row.osm) if row.osm else locate(row.lat, row.lon, row.radius),
            dem=tuple(Path(p) for p in row.dem.split(";") if p),
            tiles=row.tiles or None,
            photos=row.photos or None,
            places=tuple(p for p in row.places.split(";") if p),
            gtfs=tuple(Path(p) for p in row.gtfs.split(";") if p),
            layouts=Path(row.layouts) if row.layouts else None,
            installed_things=row.things == "installed",
            buildings=tuple(p for p in row.buildings.split(";") if p),
            precedence=Path(row.precedence) if row.precedence else None,
        )
        with store.new_folder(row.name, last="world.json") as folder:
            build_world(
                sources,
                lat=row.lat,
                lon=row.lon,
                half=row.radius,
                seed=row.seed,
                out=folder,
                force=force,
            )
            world = read_world(folder)
            counts, seconds = world.manifest.counts, sum(stage_seconds(world).values())
    except (VicoError, OSError) as error:
        return Outcome(row.name, "failed", reason=str(error))
    flat = world.manifest.is_flat
    return Outcome(row.name, "built", counts["buildings"], counts["places"], round(seconds, 2), flat=flat)
