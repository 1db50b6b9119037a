"""CityJSON and CityJSONSeq: versions 1.0 to 2.0, read object by object, so that only the window is in memory.

https://www.cityjson.org/specs/2.0.1/. Everything in a file is untrusted.
"""

from __future__ import annotations

import json
from array import array
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.errors import SchemaError
from vico.geo.buildings.attributes import tags_of_attributes
from vico.geo.buildings.model import FoundBuildings
from vico.geo.buildings.pieces import BuildingPieces, Piece
from vico.geo.buildings.surfaces import Surface3
from vico.geo.frame import LocalFrame
from vico.geo.reference_systems import ToFrame
from vico.io.files import sha256_of
from vico.io.json_stream import JsonStream

KIND = "cityjson"
_BUILDINGS = ("Building", "BuildingPart")
_VERSIONS = ("1.0", "1.1", "2.0")
_SEMANTICS = {"RoofSurface": "roof", "WallSurface": "wall", "GroundSurface": "ground", "OuterFloorSurface": "roof",
              "OuterCeilingSurface": "wall", "ClosureSurface": "wall"}  # fmt: skip
_DEPTH = {"MultiSurface": 0, "CompositeSurface": 0, "Solid": 1, "MultiSolid": 2, "CompositeSolid": 2}
_LONGEST_LINE = 64 << 20
_HEADER = ("type", "version", "transform", "metadata")


@dataclass
class _Header:
    """What stands at the top of a file."""

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

    def placed(self, vertices: NDArray[np.float64]) -> NDArray[np.float64]:
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
    pieces = BuildingPieces(KIND, path.name, half)
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
    return FoundBuildings(KIND, path.name, sha256_of(path), buildings, refused, header.credits())


def _read_object(path: Path, frame: LocalFrame, header: _Header, pieces: BuildingPieces) -> None:
    """Read a file of one object, twice: its vertices come last, and are needed first."""
    numbers = array("d")
    for key, _, value in JsonStream(path).members(within=frozenset(("CityObjects", "vertices", "appearance"))):
        if key == "vertices":
            numbers.extend((float(value[0]), float(value[1]), float(value[2])))
        elif key in _HEADER:
            header.members[key] = value
    header.check(path)
    vertices = header.to_frame(frame, path)(header.placed(np.frombuffer(numbers, np.float64).reshape(-1, 3)))
    for key, name, value in JsonStream(path).members(within=frozenset(("CityObjects", "vertices", "appearance"))):
        if key == "CityObjects":
            _take(name, value, vertices, pieces)


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
        vertices = to_frame(header.placed(np.asarray(feature["vertices"], np.float64).reshape(-1, 3)))
        for name, value in feature["CityObjects"].items():
            _take(name, value, vertices, pieces)
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


def _take(name: str, thing: Mapping[str, Any], vertices: NDArray[np.float64], pieces: BuildingPieces) -> None:
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
    for boundary, value in _flattened(geometry["boundaries"], values, depth):
        rings = []
        for indices in boundary:
            index = np.asarray(indices, np.int64)
            if len(index) and (index.min() < 0 or index.max() >= len(vertices)):
                raise ValueError("a surface with a vertex that is not there")
            rings.append(vertices[index])
        if rings and len(rings[0]) >= 3:
            kind = kinds[value] if isinstance(value, int) and 0 <= value < len(kinds) else ""
            yield Surface3(kind, tuple(rings))


def _flattened(boundaries: Any, values: Any, depth: int) -> Iterator[tuple[Any, Any]]:
    """Surfaces of shells of solids, each with its value."""
    for k, boundary in enumerate(boundaries):
        value = values[k] if isinstance(values, list) and k < len(values) else None
        if depth == 0:
            yield boundary, value
        else:
            yield from _flattened(boundary, value, depth - 1)
