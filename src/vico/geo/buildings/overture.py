"""Buildings of the Overture Maps Foundation: GeoParquet of its ``buildings`` theme, types building and building_part.

Schema: https://docs.overturemaps.org/schema/reference/buildings/building/. Everything in a file is untrusted.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon
from shapely.errors import ShapelyError

from vico.errors import InputError, SchemaError
from vico.geo.buildings.model import FoundBuilding, FoundBuildings
from vico.geo.frame import LocalFrame
from vico.geo.geoparquet import parquet_files, rows_near
from vico.geo.outlines import mended
from vico.io.files import sha256_of

KIND = "overture"
ATTRIBUTION = "© Overture Maps Foundation (overturemaps.org)"
LICENCE = "ODbL-1.0"

_COLUMNS = ("id", "geometry", "bbox", "names", "sources", "subtype", "class", "height", "num_floors", "min_height",
            "min_floor", "is_underground", "building_id", "roof_shape", "roof_height", "roof_direction",
            "roof_orientation", "roof_color", "roof_material", "facade_color", "facade_material")  # fmt: skip
# Overture's column -> OpenStreetMap's key, for values that are numbers and for those that are words.
_NUMBERS = {
    "height": "height",
    "num_floors": "building:levels",
    "min_height": "min_height",
    "min_floor": "building:min_level",
    "roof_height": "roof:height",
    "roof_direction": "roof:direction",
}
_WORDS = {"roof_shape": "roof:shape", "roof_orientation": "roof:orientation", "roof_color": "roof:colour",
          "roof_material": "roof:material", "facade_color": "building:colour",
          "facade_material": "building:material"}  # fmt: skip
_MOST = 200_000


def read_overture_buildings(path: Path, frame: LocalFrame, half: float, crs: str = "") -> FoundBuildings:
    """Read the buildings that Overture's files have in the square of half side `half` metres around the origin.

    Parameters
    ----------
    path
        A file, or a folder of files; parts may be in files of their own.
    crs
        Must be empty, or EPSG:4326: Overture's coordinates are longitudes and latitudes.

    Raises
    ------
    MissingFileError
        If there is no such file.
    InputError
        If another reference system is said.
    SchemaError
        If a file is no GeoParquet with outlines.
    """
    if crs not in ("", "EPSG:4326"):
        raise InputError(f"{path}: {crs} is said of it, but Overture's coordinates are longitudes and latitudes")
    buildings: dict[str, FoundBuilding] = {}
    parts: dict[str, list[tuple[Polygon | MultiPolygon, dict[str, str]]]] = {}
    refused: list[tuple[str, str]] = []
    credits: set[str] = set()
    files = parquet_files([path], what="Overture's theme=buildings")
    for file in files:
        for row in _rows(file, frame, half):
            name = f"{KIND}:{_word(row.get('id'), 80) or _key_of(row)}"
            shape = _shape(row.get("geometry"), frame)
            if shape is None:
                refused.append((name, "its geometry is no outline on Earth"))
                continue
            if not shape.intersects(shapely.box(-half, -half, half, half)):
                continue
            if row.get("is_underground"):
                refused.append((name, "underground"))
                continue
            tags = _tags(row)
            if row.get("building_id"):
                parts.setdefault(f"{KIND}:{_word(row['building_id'], 80)}", []).append((shape, tags))
                continue
            buildings[name] = FoundBuilding(name, KIND, path.name, shape, tags)
            credits.update(_datasets(row))
            if len(buildings) > _MOST:
                raise SchemaError(f"{file}: more than {_MOST:,} buildings in the window; this is no real place")
    for name, rows in parts.items():
        if name in buildings:
            buildings[name] = replace(buildings[name], parts=tuple(rows))
        else:
            refused.append((name, "has parts here, but is not here itself"))
    digest = sha256_of(files[0]) if len(files) == 1 else "".join(sha256_of(file)[:8] for file in files)[:64]
    found = tuple(buildings[name] for name in sorted(buildings))
    return FoundBuildings(
        KIND, path.name, digest, found, tuple(sorted(refused)), (ATTRIBUTION, *sorted(credits)), LICENCE
    )


def _key_of(row: dict[str, Any]) -> str:
    """Return a key of a row without an id: of its outline."""
    return sha256(bytes(row.get("geometry") or b"")).hexdigest()[:12]


def _rows(file: Path, frame: LocalFrame, half: float) -> Iterator[dict[str, Any]]:
    return rows_near(file, frame.boxes(half), columns=_COLUMNS, needed=("geometry",), give="Overture's theme=buildings")


def _shape(value: Any, frame: LocalFrame) -> Polygon | MultiPolygon | None:
    """Return an outline in ENU metres from well-known binary of longitudes and latitudes."""
    if not isinstance(value, bytes):
        return None
    try:
        shape = shapely.force_2d(shapely.from_wkb(value))
    except (ShapelyError, ValueError):
        return None
    if not isinstance(shape, Polygon | MultiPolygon) or shape.is_empty:
        return None
    points = shapely.get_coordinates(shape)
    if not (np.isfinite(points).all() and (np.abs(points) <= (180.0, 90.0)).all()):
        return None
    local = shapely.transform(shape, lambda xy: frame.to_enu(xy[:, 1], xy[:, 0]))
    pieces = [mended(part)[0] for part in shapely.get_parts(local)]
    rings = [part for piece in pieces for part in shapely.get_parts(piece) if part.area > 0.0]
    if not rings:
        return None
    return rings[0] if len(rings) == 1 else MultiPolygon(rings)


def _tags(row: dict[str, Any]) -> dict[str, str]:
    """Return what a row says, in OpenStreetMap's words."""
    tags: dict[str, str] = {}
    for column, key in _NUMBERS.items():
        value = row.get(column)
        if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value) and value >= 0:
            tags[key] = f"{value:g}"
    for column, key in _WORDS.items():
        if word := _word(row.get(column)):
            tags[key] = word
    names = row.get("names")
    if isinstance(names, dict) and (name := _word(names.get("primary"), 120)):
        tags["name"] = name
    if kind := _word(row.get("class")) or _word(row.get("subtype")):
        tags["building"] = kind
    return tags


def _word(value: Any, longest: int = 60) -> str:
    return " ".join(value.split())[:longest] if isinstance(value, str) else ""


def _datasets(row: dict[str, Any]) -> Iterator[str]:
    """Names of the data sets that a row was made of."""
    for source in row.get("sources") or ():
        if isinstance(source, dict) and (name := _word(source.get("dataset"))):
            yield "© OpenStreetMap contributors" if name == "OpenStreetMap" else name
