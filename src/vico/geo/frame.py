"""The local frame: east, north, up in metres around a point on Earth; and coordinates of files brought into it.

`crs_named` knows the names that files give to their reference systems; `ToFrame` transforms points of such a system.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pyproj import CRS, Transformer
from pyproj.exceptions import CRSError, ProjError

from vico.errors import InputError, SchemaError


@dataclass(frozen=True)
class LocalFrame:
    """A transverse Mercator centred on a point, so that x is east and y is north, metres.

    The projection is the one netconvert is given, so road networks and meshes share coordinates to a micrometre. At its
    own origin it is true to 1e-8 within a kilometre, at the poles and on the date line as anywhere.

    Attributes
    ----------
    lat, lon
        Where the projection is centred, degrees (WGS 84): the origin, unless it is shifted.
    east, north
        Metres from there to the origin, for windows that share one projection, as the tiles of a city do.

    Raises
    ------
    InputError
        If the origin is no place on Earth.
    """

    lat: float
    lon: float
    east: float = 0.0
    north: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.lat) and math.isfinite(self.lon)):
            raise InputError(
                f"coordinates: ({self.lat}, {self.lon}) are no numbers; give degrees, as in 60.1690,24.9435"
            )
        if abs(self.lat) > 90.0 or abs(self.lon) > 180.0:
            raise InputError(
                f"coordinates: latitude {self.lat}, longitude {self.lon} out of range; latitude must be within "
                "-90..90 and longitude within -180..180 (latitude comes first)"
            )

    @property
    def proj4(self) -> str:
        """The projection as a PROJ string."""
        origin = f"+lat_0={float(self.lat)!r} +lon_0={float(self.lon)!r}"
        if self.east or self.north:
            origin += f" +x_0={-float(self.east)!r} +y_0={-float(self.north)!r}"
        return f"+proj=tmerc {origin} +k=1 +ellps=WGS84 +units=m +no_defs"

    @cached_property
    def _transformer(self) -> Transformer:
        return Transformer.from_crs("EPSG:4326", self.proj4, always_xy=True)

    def to_enu(self, lat: ArrayLike, lon: ArrayLike) -> NDArray[np.float64]:
        """Local coordinates of geodetic points.

        Parameters
        ----------
        lat, lon
            Degrees, shape ``(n,)`` (or scalars, which give shape ``(2,)``).

        Returns
        -------
        ndarray
            Metres east and north of the origin, shape ``(n, 2)``.
        """
        x, y = self._transformer.transform(np.asarray(lon, np.float64), np.asarray(lat, np.float64))
        return np.stack([np.asarray(x, np.float64), np.asarray(y, np.float64)], axis=-1)

    def to_geodetic(self, xy: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Latitude and longitude, degrees, of local points of shape ``(..., 2)``."""
        points = np.asarray(xy, np.float64)
        lon, lat = self._transformer.transform(points[..., 0], points[..., 1], direction="INVERSE")
        return np.asarray(lat, np.float64), np.asarray(lon, np.float64)

    def bbox(self, half: float) -> tuple[float, float, float, float]:
        """West, south, east, north, degrees, of the smallest geodetic box around the square of half side `half`.

        Over the date line west is larger than east, as in GeoJSON; around a pole the box goes all the way round.
        `boxes` gives plain boxes.
        """
        side = np.linspace(-half, half, 5)
        edge = np.full(5, half)
        ring = np.concatenate(
            [np.stack(pair, axis=-1) for pair in ((side, -edge), (side, edge), (-edge, side), (edge, side))]
        )
        lat, lon = self.to_geodetic(ring)
        south, north = float(lat.min()), float(lat.max())
        pole = 90.0 if self.lat >= 0 else -90.0
        if np.abs(self.to_enu(pole, self.lon)).max() <= half:
            return -180.0, min(south, pole), 180.0, max(north, pole)
        off = (lon - self.lon + 180.0) % 360.0 - 180.0
        west, east = float(off.min()) + self.lon, float(off.max()) + self.lon
        return west + 360.0 * (west < -180.0), south, east - 360.0 * (east > 180.0), north

    def boxes(self, half: float) -> list[tuple[float, float, float, float]]:
        """`bbox` as boxes whose west is smaller than their east: two where the square lies over the date line."""
        west, south, east, north = self.bbox(half)
        if west <= east:
            return [(west, south, east, north)]
        return [(west, south, 180.0, north), (-180.0, south, east, north)]


_EPSG = re.compile(r"EPSG[^0-9]*(?:[0-9.]*[:/])?:*([0-9]{4,6})", re.IGNORECASE)
_OGC = re.compile(r"(?:crs:EPSG|EPSG/0/|EPSG::|EPSG:)[:/]?(?:[0-9.]+[:/])?([0-9]{4,6})", re.IGNORECASE)
# Germany's surveys write ETRS89_UTM32*DE_DHHN2016_NH instead of a number.
_ADV = re.compile(r"ETRS89_UTM(3[123])", re.IGNORECASE)


_SAID = re.compile(r"(?P<path>.+)@(?P<crs>EPSG:[0-9]{4,6})", re.IGNORECASE)


def split_crs(given: str | Path) -> tuple[Path, str]:
    """Return a file and the reference system that is said after its name (``city.json@EPSG:7415``), empty if none."""
    found = _SAID.fullmatch(str(given))
    return (Path(found["path"]), found["crs"].upper()) if found else (Path(given), "")


def crs_named(name: str, where: str) -> tuple[CRS, bool]:
    """Return the reference system that a file names, and whether its geographic coordinates begin with latitude.

    Parameters
    ----------
    name
        Such as ``urn:ogc:def:crs:EPSG::25833``, ``https://www.opengis.net/def/crs/EPSG/0/7415``, ``EPSG:4326`` or
        ``urn:adv:crs:ETRS89_UTM32*DE_DHHN2016_NH``. Of a compound the horizontal part is meant.
    where
        File, and what in it, for errors.

    Raises
    ------
    SchemaError
        If it names none that is known.
    """
    adv = _ADV.search(name)
    found = _OGC.search(name) or _EPSG.search(name)
    code = int(f"258{adv[1]}") if adv else int(found[1]) if found else 0
    if not code:
        said = f"names {name[:80]!r}" if name else "names none"
        raise SchemaError(
            f"{where}: no EPSG code of its coordinates ({said}); say which after its name, as in "
            f"{Path(where).name}@EPSG:25833"
        )
    try:
        crs = CRS.from_epsg(code)
    except CRSError:
        raise SchemaError(f"{where}: EPSG:{code} is not a coordinate system known here") from None
    horizontal = crs.sub_crs_list[0] if crs.is_compound else crs
    # By the book latitude comes first; short names are used by those who put longitude first.
    by_the_book = "urn:" in name.lower() or "://" in name
    return horizontal, by_the_book and (horizontal.is_geographic or horizontal.is_geocentric)


class ToFrame:
    """Brings points of a file into a local frame.

    Parameters
    ----------
    name, where
        As `crs_named` takes them.
    frame
        The local frame.

    Raises
    ------
    SchemaError
        If the system is unknown.
    """

    def __init__(self, name: str, frame: LocalFrame, where: str) -> None:
        self._where = where
        self._crs, self._latitude_first = crs_named(name, where)
        try:
            self._transformer = Transformer.from_crs(self._crs, "EPSG:4326", always_xy=True)
        except ProjError as error:
            raise SchemaError(f"{where}: can't be brought to latitude and longitude ({error})") from None
        self._frame = frame

    def __call__(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return points, shape ``(n, 3)``, with ENU metres for their first two coordinates; far ones may be inf."""
        x, y = (points[:, 1], points[:, 0]) if self._latitude_first else (points[:, 0], points[:, 1])
        lon, lat = self._transformer.transform(x, y)
        return np.column_stack([self._frame.to_enu(lat, lon), points[:, 2]])
