"""Files of buildings, told apart by their names: CityGML, CityJSON, and Overture's footprints.

City models are read member by member or object by object, so that only the window is in memory. CityGML 1.0, 2.0 and
3.0: https://www.ogc.org/standards/citygml; document types and entities are refused. CityJSON and CityJSONSeq 1.0 to
2.0: https://www.cityjson.org/specs/2.0.1/. Everything in a file is untrusted. What their attributes mean in
OpenStreetMap's words is data: ``data/geo/sources/attributes.toml``.
"""

from __future__ import annotations

import json
from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import ParseError, iterparse
from numpy.typing import NDArray
from pydantic import Field

from vico.errors import InputError, MissingFileError, SchemaError
from vico.geo.buildings import BuildingPieces, FoundBuildings, Piece, Surface3
from vico.geo.frame import LocalFrame, ToFrame, split_crs
from vico.geo.overture import read_overture_buildings
from vico.geo.quantities import Kind, read
from vico.io.data_files import DataRecord, cached_data, data_files, read_record
from vico.io.files import sha256_of
from vico.io.json_stream import JsonStream

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
    records = [read_record(path, AttributeNames, guide=_GUIDE) for path in data_files("geo/sources", "attributes")][
        ::-1
    ]
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


CITYGML = "citygml"
_SEMANTICS = {"RoofSurface": "roof", "WallSurface": "wall", "GroundSurface": "ground", "OuterFloorSurface": "roof",
              "OuterCeilingSurface": "wall", "ClosureSurface": "wall"}  # fmt: skip
_OUTLINES = {"lod0FootPrint": "ground", "lod0RoofEdge": "ground"}
# What hangs on a building, opens in it or lies within is no surface of it.
_APART = frozenset(
    {
        "opening",
        "Opening",
        "Door",
        "Window",
        "fillingSurface",
        "interiorRoom",
        "buildingRoom",
        "roomInstallation",
        "outerBuildingInstallation",
        "interiorBuildingInstallation",
        "buildingInstallation",
        "address",
        "appearance",
        "externalReference",
    }
)
_RINGS = ("exterior", "interior")
_ID = "{http://www.opengis.net/gml}id", "{http://www.opengis.net/gml/3.2}id"
_HREF = "{http://www.w3.org/1999/xlink}href"
_MOST_DEPTH = 60


def read_citygml(path: Path, frame: LocalFrame, half: float, crs: str = "") -> FoundBuildings:
    """Read the buildings that a CityGML file has in the square of half side `half` metres around the origin.

    Parameters
    ----------
    crs
        Its reference system where that is not in the file, such as ``EPSG:25833``.

    Raises
    ------
    MissingFileError, SchemaError
        If it is not there, no CityGML, truncated, has a document type or entities, or names no reference system.
    """
    if not path.is_file():
        raise MissingFileError(f"{path}: no such file; give CityGML (.gml, .xml)")
    pieces = BuildingPieces(CITYGML, path.name, half)
    systems: dict[str, ToFrame] = {}  # a file names the same one thousands of times
    try:
        for building, srs in _buildings(path):
            if srs not in systems:
                systems[srs] = ToFrame(crs or srs, frame, str(path))
            _take_building(building, systems[srs], pieces)
    except DefusedXmlException as error:
        raise SchemaError(
            f"{path}: has a document type or entities ({type(error).__name__}), which no CityGML needs and which can "
            "fill the memory or read other files; it is not read: get it from its publisher"
        ) from None
    except ParseError as error:
        raise SchemaError(f"{path}: not readable XML ({error}); download it again") from None
    except (ValueError, RecursionError) as error:
        if isinstance(error, SchemaError):
            raise
        raise SchemaError(f"{path}: not CityGML as its schema has it ({str(error)[:120]}); download it again") from None
    buildings, refused = pieces.buildings()
    return FoundBuildings(CITYGML, path.name, sha256_of(path), buildings, refused)


def _buildings(path: Path) -> Iterator[tuple[Any, str]]:
    """Yield building elements, each with the name of the reference system that holds for it; then forget them."""
    depth, srs, root, within = 0, "", None, 0
    for event, element in iterparse(path, events=("start", "end"), forbid_dtd=True):
        if event == "start":
            depth += 1
            if root is None:
                root = element
                if _local(element) not in ("CityModel", "FeatureCollection", "Envelope"):
                    raise SchemaError(f"{path}: its root is <{_local(element)}>, not a CityModel; give CityGML")
            srs = element.get("srsName") or srs
            if depth > _MOST_DEPTH:
                raise ValueError(f"elements {depth} deep in each other")
            within += _local(element) == "Building"
            continue
        depth -= 1
        if _local(element) == "Building":
            within -= 1
            if within == 0:
                yield element, srs
        if depth == 1 and root is not None:
            root.clear()
    if root is None:
        raise SchemaError(f"{path}: the file is empty; download it again")


def _local(element: Any) -> str:
    return str(element.tag).rpartition("}")[2]


def _id_of(element: Any) -> str:
    return next((element.get(name) for name in _ID if element.get(name)), "") or ""


def _take_building(building: Any, to_frame: ToFrame, pieces: BuildingPieces) -> None:
    """Take a building in, with its parts."""
    collected = _Collected()
    collected.walk(building, "", -1)
    by_detail = collected.by_detail()
    if not by_detail:
        return
    name = _id_of(building) or f"building of {len(collected.polygons)} surfaces"
    piece = Piece(name[:120], "", tags_of_attributes(_attributes(building)))
    for detail, rows in by_detail.items():
        for kind, rings in rows:
            piece.by_detail.setdefault(detail, []).append(Surface3(kind, tuple(to_frame(ring) for ring in rings)))
    pieces.add(piece)


_Rings = list[NDArray[np.float64]]


class _Collected:
    """Polygons of a building: level of detail, kind of surface, rings."""

    def __init__(self) -> None:
        self.polygons: list[tuple[int, str, _Rings]] = []
        self._named: dict[str, _Rings] = {}
        self._wanted: list[tuple[int, str, str]] = []

    def walk(self, element: Any, kind: str, detail: int) -> None:
        """Gather the polygons below an element."""
        name = _local(element)
        if name in _APART:
            return
        kind = _SEMANTICS.get(name, _OUTLINES.get(name, kind))
        if name.startswith("lod") and len(name) > 3 and name[3].isdigit():
            detail = int(name[3])
        if name in ("Polygon", "Triangle", "Rectangle"):
            rings = [ring for child in element if _local(child) in _RINGS for ring in _rings(child)]
            if rings:
                self.polygons.append((detail, kind, rings))
                self._named[_id_of(element)] = rings
            return
        href = element.get(_HREF)
        if href and name == "surfaceMember" and kind:
            self._wanted.append((detail, kind, href.removeprefix("#")))
        for child in element:
            self.walk(child, kind, detail)

    def by_detail(self) -> dict[float, list[tuple[str, _Rings]]]:
        """Return the polygons by level of detail; where some are named by kind, the others repeat them."""
        rows: dict[float, list[tuple[str, _Rings]]] = {}
        linked = [(detail, kind, self._named[name]) for detail, kind, name in self._wanted if name in self._named]
        for detail, kind, rings in [*self.polygons, *linked]:
            if 0 <= detail <= 3:
                rows.setdefault(float(detail), []).append((kind, rings))
        for level, polygons in rows.items():
            if any(kind == "roof" for kind, _ in polygons):
                rows[level] = [row for row in polygons if row[0]]
        return rows


def _rings(bound: Any) -> Iterator[NDArray[np.float64]]:
    """Rings below an exterior or interior, not closed, shape ``(n, 3)``, in the file's coordinates."""
    for ring in bound.iter():
        if _local(ring) != "LinearRing":
            continue
        text = " ".join(child.text or "" for child in ring if _local(child) in ("posList", "pos", "coordinates"))
        values = np.array(text.replace(",", " ").split(), np.float64)
        if len(values) % 3:
            continue  # of two dimensions: an outline without height
        points = values.reshape(-1, 3)
        if len(points) > 1 and (points[0] == points[-1]).all():
            points = points[:-1]
        if len(points) >= 3:
            yield points


def _attributes(building: Any) -> dict[str, object]:
    """Return what stands in a building's own fields and in its generic attributes."""
    names = attribute_names()
    wanted = {*names.height, *names.levels, *names.name, *names.kind, *names.roof}
    found: dict[str, object] = {}
    for child in building:
        name = _local(child)
        if name in wanted and child.text and child.text.strip():
            found.setdefault(name, child.text.strip())
        said = child.get("name")
        if said in wanted:
            for value in child:
                if _local(value) == "value" and value.text:
                    found.setdefault(said, value.text.strip())
    return found


CITYJSON = "cityjson"
_BUILDINGS = ("Building", "BuildingPart")
_VERSIONS = ("1.0", "1.1", "2.0")
_DEPTH = {"MultiSurface": 0, "CompositeSurface": 0, "Solid": 1, "MultiSolid": 2, "CompositeSolid": 2}
_LONGEST_LINE = 64 << 20
_HEADER = ("type", "version", "transform", "metadata")


@dataclass
class _Header:
    """Header of a file."""

    said: str = ""  # the reference system, where the caller says it
    members: dict[str, Any] = field(default_factory=dict)

    def check(self, path: Path) -> None:
        if self.members.get("type") != "CityJSON":
            raise SchemaError(f"{path}: its type is {str(self.members.get('type'))[:40]!r}, not CityJSON")
        version = str(self.members.get("version"))
        if version not in _VERSIONS:
            raise SchemaError(
                f"{path}: CityJSON {version[:20]}; versions {', '.join(_VERSIONS)} are read: upgrade it, as with "
                "cjio FILE upgrade save NEW"
            )

    def to_frame(self, frame: LocalFrame, path: Path) -> ToFrame:
        metadata = self.members.get("metadata")
        name = metadata.get("referenceSystem") if isinstance(metadata, dict) else None
        return ToFrame(self.said or str(name or ""), frame, str(path))

    def transform_vertices(self, vertices: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return vertices as the transform has them."""
        transform = self.members.get("transform")
        if not isinstance(transform, dict):
            return vertices
        scale, shift = (np.asarray(transform[key], np.float64) for key in ("scale", "translate"))
        if scale.shape != (3,) or shift.shape != (3,):
            raise ValueError("a transform that is not of three numbers")
        return vertices * scale + shift

    def credits(self) -> tuple[str, ...]:
        metadata = self.members.get("metadata")
        contact = metadata.get("pointOfContact") if isinstance(metadata, dict) else None
        name = contact.get("contactName") if isinstance(contact, dict) else None
        return (" ".join(str(name).split())[:120],) if name else ()


def read_cityjson(path: Path, frame: LocalFrame, half: float, crs: str = "") -> FoundBuildings:
    """Read the buildings that a CityJSON file has in the square of half side `half` metres around the origin.

    Parameters
    ----------
    path
        ``.json`` (one object), or ``.jsonl`` (CityJSONSeq: a header, then a feature a line).
    crs
        Its reference system where that is not in the file, such as ``EPSG:7415``.

    Raises
    ------
    MissingFileError, SchemaError
        If it is not there, no CityJSON of a version that is read, truncated, or without reference system.
    """
    pieces = BuildingPieces(CITYJSON, path.name, half)
    header = _Header(crs)
    try:
        if path.name.lower().endswith(".jsonl"):
            _read_lines(path, frame, header, pieces)
        else:
            _read_object(path, frame, header, pieces)
    except (KeyError, IndexError, TypeError, ValueError, AttributeError) as error:
        if isinstance(error, SchemaError):
            raise
        raise SchemaError(
            f"{path}: not CityJSON as its specification has it ({type(error).__name__}: {str(error)[:120]}); validate "
            "it with cjval"
        ) from None
    buildings, refused = pieces.buildings()
    return FoundBuildings(CITYJSON, path.name, sha256_of(path), buildings, refused, header.credits())


def _read_object(path: Path, frame: LocalFrame, header: _Header, pieces: BuildingPieces) -> None:
    """Read a file of one object, twice: its vertices come last, and are needed first."""
    numbers = array("d")
    for key, _, value in JsonStream(path).members(within=frozenset(("CityObjects", "vertices", "appearance"))):
        if key == "vertices":
            numbers.extend((float(value[0]), float(value[1]), float(value[2])))
        elif key in _HEADER:
            header.members[key] = value
    header.check(path)
    vertices = header.to_frame(frame, path)(
        header.transform_vertices(np.frombuffer(numbers, np.float64).reshape(-1, 3))
    )
    for key, name, value in JsonStream(path).members(within=frozenset(("CityObjects", "vertices", "appearance"))):
        if key == "CityObjects":
            _take_city_object(name, value, vertices, pieces)


def _read_lines(path: Path, frame: LocalFrame, header: _Header, pieces: BuildingPieces) -> None:
    to_frame: ToFrame | None = None
    for number, feature in _lines(path):
        if to_frame is None:
            header.members = {key: feature[key] for key in _HEADER if key in feature}
            header.check(path)
            to_frame = header.to_frame(frame, path)
            continue
        if feature.get("type") != "CityJSONFeature":
            raise SchemaError(f"{path}:{number}: its type is {str(feature.get('type'))[:40]!r}, not CityJSONFeature")
        vertices = to_frame(header.transform_vertices(np.asarray(feature["vertices"], np.float64).reshape(-1, 3)))
        for name, value in feature["CityObjects"].items():
            _take_city_object(name, value, vertices, pieces)
    if to_frame is None:
        raise SchemaError(f"{path}: the file is empty; download it again")


def _lines(path: Path) -> Iterator[tuple[int, dict[str, Any]]]:
    """Objects of a file of lines, with the line's number."""
    if not path.is_file():
        list(JsonStream(path).members())  # says that it is missing
    with path.open("rb") as file:
        number = 0
        while line := file.readline(_LONGEST_LINE):
            number += 1
            if not line.strip():
                continue
            try:
                value = json.loads(line)
            except (ValueError, RecursionError):
                raise SchemaError(f"{path}:{number}: not readable JSON; download it again") from None
            if not isinstance(value, dict):
                raise SchemaError(f"{path}:{number}: no JSON object; download it again")
            yield number, value


def _take_city_object(
    name: str, thing: Mapping[str, Any], vertices: NDArray[np.float64], pieces: BuildingPieces
) -> None:
    """Take a city object in, if it is a building or a part of one."""
    if thing.get("type") not in _BUILDINGS:
        return
    parents = thing.get("parents") or ()
    attributes = thing.get("attributes")
    piece = Piece(
        name[:120],
        str(parents[0])[:120] if parents else "",
        tags_of_attributes(attributes) if isinstance(attributes, dict) else {},
    )
    for geometry in thing.get("geometry") or ():
        depth = _DEPTH.get(geometry.get("type"))
        if depth is None:
            continue
        surfaces = list(_surfaces(geometry, depth, vertices))
        piece.by_detail.setdefault(float(geometry.get("lod", 0)), []).extend(surfaces)
    pieces.add(piece)


def _surfaces(geometry: Mapping[str, Any], depth: int, vertices: NDArray[np.float64]) -> Iterator[Surface3]:
    semantics = geometry.get("semantics")
    kinds: list[str] = []
    values: Any = None
    if isinstance(semantics, dict):
        kinds = [_SEMANTICS.get(surface.get("type"), "") for surface in semantics["surfaces"]]
        values = semantics.get("values")
    for boundary, value in _flatten_surfaces(geometry["boundaries"], values, depth):
        rings = []
        for indices in boundary:
            index = np.asarray(indices, np.int64)
            if len(index) and (index.min() < 0 or index.max() >= len(vertices)):
                raise ValueError("a surface with a vertex that is not there")
            rings.append(vertices[index])
        if rings and len(rings[0]) >= 3:
            kind = kinds[value] if isinstance(value, int) and 0 <= value < len(kinds) else ""
            yield Surface3(kind, tuple(rings))


def _flatten_surfaces(boundaries: Any, values: Any, depth: int) -> Iterator[tuple[Any, Any]]:
    """Surfaces of shells of solids, each with its value."""
    for k, boundary in enumerate(boundaries):
        value = values[k] if isinstance(values, list) and k < len(values) else None
        if depth == 0:
            yield boundary, value
        else:
            yield from _flatten_surfaces(boundary, value, depth - 1)


_READERS = (
    ((".json", ".jsonl"), read_cityjson),
    ((".gml", ".xml", ".citygml"), read_citygml),
    ((".parquet", ".geoparquet"), read_overture_buildings),
)
_ENDINGS = tuple(ending for endings, _ in _READERS for ending in endings)


def read_buildings(given: Sequence[str | Path], frame: LocalFrame, half: float) -> list[FoundBuildings]:
    """Read the buildings that files have in the square of half side `half` metres around the frame's origin.

    Parameters
    ----------
    given
        CityJSON (``.json``, or ``.jsonl`` with a feature a line), CityGML (``.gml``, ``.xml``), Overture's GeoParquet
        (``.parquet``, or a folder of such). A model that does not say its reference system is given with it:
        ``city.json@EPSG:7415``.

    Returns
    -------
    list of FoundBuildings
        One each, in their order.

    Raises
    ------
    InputError
        If a file is of another kind by its name, or given twice.
    MissingFileError, SchemaError
        As the readers raise them.
    """
    return [_read(path, frame, half, crs) for path, crs in checked_files(given)]


def checked_files(given: Sequence[str | Path]) -> list[tuple[Path, str]]:
    """Return files and the reference systems said of them, after a look at their names, before anything is read.

    Raises
    ------
    InputError, MissingFileError
        If a file is of another kind by its name, given twice, or not there.
    """
    files = [split_crs(one) for one in given]
    names = [path.name for path, _ in files]
    if doubled := sorted({name for name in names if names.count(name) > 1}):
        raise InputError(f"buildings: {', '.join(doubled)} is given twice; rename one, so that each has a name")
    for path, _ in files:
        if not path.is_dir() and not path.name.lower().endswith(_ENDINGS):
            raise InputError(
                f"{path}: not a file of buildings by its name; it must end in .json or .jsonl (CityJSON), .gml or .xml "
                "(CityGML) or .parquet (Overture)"
            )
        if not path.exists():
            raise MissingFileError(f"{path}: no such file; give CityJSON, CityGML or Overture's GeoParquet")
    return files


def _read(path: Path, frame: LocalFrame, half: float, crs: str) -> FoundBuildings:
    if path.is_dir():
        return read_overture_buildings(path, frame, half, crs)
    read = next(read for endings, read in _READERS if path.name.lower().endswith(endings))
    return read(path, frame, half, crs)
