"""Which map a window is made from: the packaged extract, else one that a server is asked for."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from vico.errors import InputError, MissingFileError
from vico.geo.frame import LocalFrame
from vico.geo.overpass import MapSource


@dataclass(frozen=True)
class Extract:
    """A map extract and the window it was cut for."""

    path: Path
    name: str
    lat: float
    lon: float
    half: float


def packaged_extract() -> Extract:
    """Return the one place that comes with the package: central Helsinki (ODbL, (c) OpenStreetMap contributors)."""
    path = Path(str(files("vico").joinpath("data/helsinki.osm.pbf")))
    if not path.exists():
        raise MissingFileError(f"{path}: the packaged map extract is missing; reinstall virtual-community")
    return Extract(path, "helsinki", 60.1690, 24.9435, 400.0)


def covers(extract: Extract, lat: float, lon: float, half: float) -> bool:
    """Whether an extract holds the whole window."""
    if abs(lat - extract.lat) > 0.1 or abs(lon - extract.lon) > 0.1:
        return False
    east, north = LocalFrame(extract.lat, extract.lon).to_enu(lat, lon)
    return max(abs(float(east)), abs(float(north))) + half <= extract.half + 1.0


def map_for(lat: float | None, lon: float | None, half: float, *, source: MapSource | None) -> Path:
    """Find a map that covers a window: the packaged extract, else what `source` fetches.

    Raises
    ------
    InputError
        If no place is given, it is not on Earth, or the packaged extract does not cover it and there is no `source`.
    SourceError
        If the source can't be reached.
    """
    if lat is None or lon is None:
        raise InputError("world build: say where: --osm FILE, or --lat and --lon")
    if not (-90 <= lat <= 90 and -180 <= lon <= 180):
        raise InputError(f"world build: {lat}, {lon} is not on Earth; latitude is -90..90, longitude -180..180 degrees")
    extract = packaged_extract()
    if covers(extract, lat, lon, half):
        return extract.path
    if source is None:
        raise InputError(
            f"world build: no map data for {half:.0f} m around {lat}, {lon}: the packaged extract covers "
            f"{extract.half:.0f} m around {extract.lat}, {extract.lon} ({extract.name}), and asking a server is off; "
            "pass --osm FILE, or --overpass URL"
        )
    return source.fetch(lat, lon, half)
