"""CityGML 1.0, 2.0 and 3.0, read member by member, so that only the window is in memory.

https://www.ogc.org/standards/citygml. Everything in a file is untrusted: document types and entities are refused.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from defusedxml.common import DefusedXmlException
from defusedxml.ElementTree import ParseError, iterparse
from numpy.typing import NDArray

from vico.errors import MissingFileError, SchemaError
from vico.geo.buildings.attributes import attribute_names, tags_of_attributes
from vico.geo.buildings.model import FoundBuildings
from vico.geo.buildings.pieces import BuildingPieces, Piece
from vico.geo.buildings.surfaces import Surface3
from vico.geo.frame import LocalFrame
from vico.geo.reference_systems import ToFrame
from vico.io.files import sha256_of

KIND = "citygml"
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
    pieces = BuildingPieces(KIND, path.name, half)
    systems: dict[str, ToFrame] = {}  # a file names the same one thousands of times
    try:
        for building, srs in _buildings(path):
            if srs not in systems:
                systems[srs] = ToFrame(crs or srs, frame, str(path))
            _take(building, systems[srs], pieces)
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
    return FoundBuildings(KIND, path.name, sha256_of(path), buildings, refused)


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


def _take(building: Any, to_frame: ToFrame, pieces: BuildingPieces) -> None:
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
