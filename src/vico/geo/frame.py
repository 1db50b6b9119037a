"""The local frame: east, north, up in metres around a point on Earth."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pyproj import Transformer

from vico.errors import InputError


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
