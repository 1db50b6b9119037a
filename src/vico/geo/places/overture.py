"""Places of the Overture Maps Foundation: GeoParquet files of its ``places`` theme, type ``place``.

Schema: https://docs.overturemaps.org/schema/reference/places/place/. Files of the releases before and after
``categories`` gave way to ``taxonomy`` are read alike. Everything in a file is untrusted.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from vico.errors import InputError, SchemaError
from vico.geo.frame import LocalFrame
from vico.geo.geoparquet import parquet_files, rows_near
from vico.geo.places.model import FoundPlace, one_line

LEAST_CONFIDENCE = 0.5
ATTRIBUTION = "© Overture Maps Foundation (overturemaps.org)"

_COLUMNS = ("id", "geometry", "bbox", "names", "categories", "taxonomy", "basic_category", "confidence", "sources",
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
                path, frame.boxes(half), columns=_COLUMNS, needed=_NEEDED, give="Overture's theme=places"
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
