"""The packaged extract, and what to say where there is no map."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from vico.errors import InputError, MissingFileError
from vico.geo.frame import LocalFrame


@dataclass(frozen=True)
class Extract:
    """A map extract and the window it was cut for."""

    path: Path
    name: str
    lat: float
    lon: float
    half: float


def packaged_extract() -> Extract:
    """The one place that comes with the package: central Helsinki (ODbL, (c) OpenStreetMap contributors)."""
    path = Path(str(files("vico").joinpath("data/helsinki.osm.pbf")))
    if not path.exists():
        raise MissingFileError(f"{path}: the packaged map extract is missing; reinstall virtual-community")
    return Extract(path, "helsinki", 60.1690, 24.9435, 400.0)


def extract_for(lat: float | None, lon: float | None, half: float) -> Extract:
    """Return the packaged extract if it covers the window.

    Raises
    ------
    InputError
        If it does not; the message says what to do.
    """
    extract = packaged_extract()
    if lat is None or lon is None:
        raise InputError("world build: say where: --osm FILE, or --lat and --lon")
    if not (-90 <= lat <= 90 and -180 <= lon <= 180):
        raise InputError(f"world build: {lat}, {lon} is not on Earth; latitude is -90..90, longitude -180..180 degrees")
    if abs(lat - extract.lat) < 0.1 and abs(lon - extract.lon) < 0.1:
        east, north = LocalFrame(extract.lat, extract.lon).to_enu(lat, lon)
        if max(abs(float(east)), abs(float(north))) + half <= extract.half + 1.0:
            return extract
    raise InputError(
        f"world build: no map data for {half:.0f} m around {lat}, {lon}: the packaged extract covers "
        f"{extract.half:.0f} m around {extract.lat}, {extract.lon} ({extract.name}); pass --osm FILE for elsewhere"
    )
