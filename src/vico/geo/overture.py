"""Buildings and places of the Overture Maps Foundation, from GeoParquet files.

The themes are ``buildings`` and ``places``. Schemas:
https://docs.overturemaps.org/schema/reference/buildings/building/ (types building and building_part) and
https://docs.overturemaps.org/schema/reference/places/place/ (type place; files of the releases before and after
``categories`` gave way to ``taxonomy`` are read alike). Only rows that may touch the window are read; row groups
elsewhere are not. Everything in a file is untrusted.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Sequence
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon
from shapely.errors import ShapelyError

from vico.errors import InputError, MissingFileError, SchemaError
from vico.geo.buildings import FoundBuilding, FoundBuildings
from vico.geo.frame import LocalFrame
from vico.geo.outlines import repair_outline
from vico.geo.places import FoundPlace, one_line
from vico.io.files import sha256_of

_BATCH = 4096

Box = tuple[float, float, float, float]
"""West, south, east, north, degrees."""


def parquet_files(paths: Sequence[Path], *, what: str) -> list[Path]:
    """Return the files among paths and within folders, by name.

    Parameters
    ----------
    paths
        Files, or folders of files.
    what
        What to give, for the error.

    Raises
    ------
    MissingFileError
        If there is no such file, or no ``.parquet`` in a folder.
    """
    files: list[Path] = []
    for path in paths:
        inside = sorted(Path(path).rglob("*.parquet")) if Path(path).is_dir() else [Path(path)]
        if not inside or not inside[0].is_file():
            raise MissingFileError(f"{path}: no such file, or no .parquet in it; give {what}")
        files += inside
    return files


def rows_near(
    path: Path, boxes: Sequence[Box], *, columns: Sequence[str], needed: Sequence[str], give: str
) -> Iterator[dict[str, Any]]:
    """Rows of a file whose box touches one of these; all rows where they have no box.

    Parameters
    ----------
    path
        The file.
    boxes
        Where to look.
    columns
        Which columns are wanted; those that are not there are left out.
    needed
        Columns that must be there.
    give
        What to give instead of a file without them, for the error.

    Raises
    ------
    SchemaError
        If it is not readable, or has not the columns.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with pq.ParquetFile(path) as file:
            there = [name for name in columns if name in file.schema_arrow.names]
            missing = [name for name in needed if name not in there]
            if missing:
                raise SchemaError(f"{path}: has no column {missing[0]}; give {give}")
            groups = [k for k in range(file.num_row_groups) if _touches(file.metadata.row_group(k), boxes)]
            for batch in file.iter_batches(batch_size=_BATCH, row_groups=groups, columns=there):
                for row in batch.to_pylist():
                    if _near(row.get("bbox"), boxes):
                        yield row
    except (pa.ArrowException, OSError, UnicodeDecodeError, OverflowError) as error:
        reason = str(error).splitlines()[0][:160] if str(error) else type(error).__name__
        raise SchemaError(f"{path}: not readable GeoParquet ({reason}); download it again") from None


def _touches(group: Any, boxes: Sequence[Box]) -> bool:
    """Whether a row group's statistics allow rows in the boxes; true where there are none."""
    bounds: dict[str, tuple[float, float]] = {}
    for k in range(group.num_columns):
        column = group.column(k)
        if column.path_in_schema.startswith("bbox.") and column.is_stats_set and column.statistics.has_min_max:
            bounds[column.path_in_schema[5:]] = (column.statistics.min, column.statistics.max)
    if not {"xmin", "xmax", "ymin", "ymax"} <= bounds.keys():
        return True
    return any(
        bounds["xmin"][0] <= east + 1e-5 and bounds["xmax"][1] >= west - 1e-5
        and bounds["ymin"][0] <= north + 1e-5 and bounds["ymax"][1] >= south - 1e-5
        for west, south, east, north in boxes
    )  # fmt: skip


def _near(box: Any, boxes: Sequence[Box]) -> bool:
    """Whether a row's box touches one of the boxes; true where it has none. Stored as 32 bits, so with some slack."""
    if not isinstance(box, dict):
        return True
    try:
        x0, x1, y0, y1 = (float(box[k]) for k in ("xmin", "xmax", "ymin", "ymax"))
    except (KeyError, TypeError, ValueError):
        return True
    return any(
        x0 <= east + 1e-4 and x1 >= west - 1e-4 and y0 <= north + 1e-4 and y1 >= south - 1e-4
        for west, south, east, north in boxes
    )


OVERTURE = "overture"
ATTRIBUTION = "© Overture Maps Foundation (overturemaps.org)"
LICENCE = "ODbL-1.0"

_HOUSE_FIELDS = ("id", "geometry", "bbox", "names", "sources", "subtype", "class", "height", "num_floors", "min_height",
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
_MOST_BUILDINGS = 200_000


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
        for row in rows_near(
            file, frame.boxes(half), columns=_HOUSE_FIELDS, needed=("geometry",), give="Overture's theme=buildings"
        ):
            # A row without an id is known by its outline.
            key = _word(row.get("id"), 80) or sha256(bytes(row.get("geometry") or b"")).hexdigest()[:12]
            name = f"{OVERTURE}:{key}"
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
                parts.setdefault(f"{OVERTURE}:{_word(row['building_id'], 80)}", []).append((shape, tags))
                continue
            buildings[name] = FoundBuilding(name, OVERTURE, path.name, shape, tags)
            for source in row.get("sources") or ():
                if isinstance(source, dict) and (dataset := _word(source.get("dataset"))):
                    credits.add("© OpenStreetMap contributors" if dataset == "OpenStreetMap" else dataset)
            if len(buildings) > _MOST_BUILDINGS:
                raise SchemaError(
                    f"{file}: more than {_MOST_BUILDINGS:,} buildings in the window; this is no real place"
                )
    for name, rows in parts.items():
        if name in buildings:
            buildings[name] = replace(buildings[name], parts=tuple(rows))
        else:
            refused.append((name, "has parts here, but is not here itself"))
    digest = sha256_of(files[0]) if len(files) == 1 else "".join(sha256_of(file)[:8] for file in files)[:64]
    found = tuple(buildings[name] for name in sorted(buildings))
    return FoundBuildings(
        OVERTURE, path.name, digest, found, tuple(sorted(refused)), (ATTRIBUTION, *sorted(credits)), LICENCE
    )


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
    pieces = [repair_outline(part)[0] for part in shapely.get_parts(local)]
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


LEAST_CONFIDENCE = 0.5

_PLACE_FIELDS = ("id", "geometry", "bbox", "names", "categories", "taxonomy", "basic_category", "confidence", "sources",
            "operating_status")  # fmt: skip
_NEEDED = ("id", "geometry", "names")
_MOST_PLACES = 200_000


class OverturePlaces:
    """Places in local GeoParquet files.

    Parameters
    ----------
    paths
        Files, or folders of files.
    least_confidence
        Places that Overture trusts less than this are left out.

    Attributes
    ----------
    refused
        Id and reason of places that were left out.

    Raises
    ------
    MissingFileError
        If there is no such file, or no ``.parquet`` in a folder.
    InputError
        If `least_confidence` is not in 0..1.
    """

    name = "overture"
    may_be_kept = True

    def __init__(self, paths: Sequence[Path], *, least_confidence: float = LEAST_CONFIDENCE) -> None:
        if not 0.0 <= least_confidence <= 1.0:
            raise InputError(f"overture places: least confidence {least_confidence}; it must lie within 0..1")
        self.refused: list[tuple[str, str]] = []
        self._least = least_confidence
        self._files = parquet_files(paths, what="Overture's places")

    def near(self, frame: LocalFrame, half: float) -> list[FoundPlace]:
        """Every place in the square of half side `half` metres around the frame's origin, sorted by id.

        Raises
        ------
        SchemaError
            If a file is no GeoParquet of places.
        """
        self.refused.clear()
        found: dict[str, FoundPlace] = {}
        for path in self._files:
            for row in rows_near(
                path, frame.boxes(half), columns=_PLACE_FIELDS, needed=_NEEDED, give="Overture's theme=places"
            ):
                place = self._place(row, frame, half)
                if place is not None:
                    found[place.id] = place
                if len(found) > _MOST_PLACES:
                    raise SchemaError(f"{path}: more than {_MOST_PLACES:,} places in the window; this is no real place")
        return [found[key] for key in sorted(found)]

    def _place(self, row: dict[str, Any], frame: LocalFrame, half: float) -> FoundPlace | None:
        key = f"overture:{one_line(str(row.get('id') or ''), 80)}"
        where = _point(row.get("geometry"))
        if where is None:
            self.refused.append((key, "its geometry is no point"))
            return None
        xy = frame.to_enu(where[1], where[0])
        if not (abs(xy[0]) <= half and abs(xy[1]) <= half):
            return None
        names = row.get("names")
        name = one_line(str(names.get("primary") or "")) if isinstance(names, dict) else ""
        if not name:
            self.refused.append((key, "has no name"))
            return None
        confidence = row.get("confidence")
        if isinstance(confidence, int | float) and not confidence >= self._least:
            self.refused.append((key, f"{name!r}: confidence {confidence:.2f} is below {self._least:g}"))
            return None
        kind, wider = _kinds(row)
        if not kind:
            self.refused.append((key, f"{name!r}: has no category"))
            return None
        return FoundPlace(
            id=key,
            name=name,
            kind=kind,
            xy=(round(float(xy[0]), 3), round(float(xy[1]), 3)),
            source=self.name,
            attribution=ATTRIBUTION,
            kinds=wider,
            open=row.get("operating_status") not in ("permanently_closed", "temporarily_closed"),
        )


def _kinds(row: dict[str, Any]) -> tuple[str, tuple[str, ...]]:
    """Return the place's category and the wider ones, the nearest first, by the newer schema or the older one."""
    wider: list[str] = []
    kind = ""
    taxonomy, categories = row.get("taxonomy"), row.get("categories")
    if isinstance(taxonomy, dict):
        kind = str(taxonomy.get("primary") or "")
        wider += [str(k) for k in reversed(taxonomy.get("hierarchy") or [])]
        wider += [str(k) for k in taxonomy.get("alternates") or []]
    if isinstance(categories, dict):
        kind = kind or str(categories.get("primary") or "")
        wider += [str(k) for k in (categories.get("alternate") or categories.get("alternates") or [])]
    if row.get("basic_category"):
        kind = kind or str(row["basic_category"])
        wider.append(str(row["basic_category"]))
    kind = one_line(kind, 60).lower()
    return kind, tuple(dict.fromkeys(k for k in (one_line(w, 60).lower() for w in wider[:12]) if k and k != kind))


def _point(value: Any) -> tuple[float, float] | None:
    """Longitude and latitude of a WKB or EWKB point; None if it is none on Earth."""
    if not isinstance(value, bytes) or len(value) < 21 or value[0] not in (0, 1):
        return None
    order = "<" if value[0] == 1 else ">"
    (kind,) = struct.unpack(order + "I", value[1:5])
    start = 9 if kind & 0x2000_0000 else 5
    if (kind & 0xFFFF) % 1000 != 1 or len(value) < start + 16:
        return None
    lon, lat = struct.unpack(order + "dd", value[start : start + 16])
    if not (math.isfinite(lon) and math.isfinite(lat) and abs(lon) <= 180.0 and abs(lat) <= 90.0):
        return None
    return lon, lat
