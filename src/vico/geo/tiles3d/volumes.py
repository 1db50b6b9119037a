"""Where a tileset lies: its bounding volumes against the wanted window, and its coordinates in the local frame."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS, Transformer
from pyproj.exceptions import CRSError

from vico.errors import InputError
from vico.geo.frame import LocalFrame

ECEF = "EPSG:4978"
WEB_MERCATOR = "EPSG:3857"

LARGEST = 1e12
"""Metres, and factors: beyond, a tileset is broken."""

_LOW, _HIGH = -1000.0, 9500.0  # metres; no city lies outside


@dataclass(frozen=True)
class TileWindow:
    """The wanted square, in a tileset's coordinates and in the local frame.

    Attributes
    ----------
    frame, reach
        The local frame, and half the side of the square, metres.
    centre, axes
        The box over it, in the tileset's coordinates: its middle, and rows that lead from there to its faces.
    """

    frame: LocalFrame
    reach: float
    centre: NDArray[np.float64]
    axes: NDArray[np.float64]
    crs: str
    _to_enu: Transformer

    @classmethod
    def of(cls, frame: LocalFrame, reach: float, crs: str) -> TileWindow:
        """Return the window of a tileset in `crs`: ``EPSG:4978`` (as 3D Tiles are meant to be), or a projected one.

        Raises
        ------
        InputError
            If `crs` is not known here, or has no metres.
        """
        middle = 0.5 * (_LOW + _HIGH)
        tall = 0.5 * (_HIGH - _LOW)
        if crs == ECEF:
            lat, lon = math.radians(frame.lat), math.radians(frame.lon)
            up = np.array([math.cos(lat) * math.cos(lon), math.cos(lat) * math.sin(lon), math.sin(lat)])
            east = np.array([-math.sin(lon), math.cos(lon), 0.0])
            north = np.cross(up, east)
            to_ecef = Transformer.from_crs("EPSG:4979", ECEF, always_xy=True)
            centre = np.array(to_ecef.transform(frame.lon, frame.lat, middle))
            axes = np.stack([east * reach, north * reach, up * tall])
            there = Transformer.from_pipeline(
                f"+proj=pipeline +step +inv +proj=cart +ellps=WGS84 +step {frame.proj4.replace(' +no_defs', '')}"
            )
            return cls(frame, reach, centre, axes, crs, there)
        try:
            system = CRS.from_user_input(crs)
            if not system.is_projected:
                raise InputError(f"crs {crs!r}: has no metres; give a projected system such as EPSG:28992")
            outward = Transformer.from_crs("EPSG:4326", system, always_xy=True)
            there = Transformer.from_crs(system, frame.proj4, always_xy=True)
        except CRSError:
            raise InputError(
                f"crs {crs!r}: no coordinate system known here; give an EPSG code such as EPSG:28992"
            ) from None
        side = np.linspace(-reach, reach, 9)
        lat_, lon_ = frame.to_geodetic(np.array([(x, y) for x in side for y in side]))
        x, y = (np.asarray(v) for v in outward.transform(lon_, lat_))
        if not (np.isfinite(x).all() and np.isfinite(y).all()):
            raise InputError(f"crs {crs!r}: does not reach {frame.lat}, {frame.lon}; give the system of the tileset")
        low, high = np.array([x.min(), y.min(), _LOW]), np.array([x.max(), y.max(), _HIGH])
        return cls(frame, reach, (low + high) / 2, np.diag((high - low) / 2), crs, there)

    def to_enu(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Points of the tileset in the local frame, shape ``(n, 3)``; z is the height the tileset gives."""
        if not len(points):
            return np.zeros((0, 3))
        if self.crs == ECEF:
            x, y, z = self._to_enu.transform(points[:, 0], points[:, 1], points[:, 2])
        else:
            x, y = self._to_enu.transform(points[:, 0], points[:, 1])
            z = points[:, 2]
        return np.stack([np.asarray(x), np.asarray(y), np.asarray(z)], axis=1)

    def touches(self, volume: dict[str, Any], transform: NDArray[np.float64]) -> bool:
        """Whether a bounding volume of 3D Tiles reaches into the window.

        Parameters
        ----------
        volume
            ``boundingVolume`` of a tile. Kinds that are not known here are taken to reach in.
        transform
            From the tile's coordinates to the tileset's.

        Raises
        ------
        ValueError
            If the volume's numbers make no sense.
        """
        if "region" in volume:
            return self._touches_region(_numbers(volume["region"], 6))
        if "box" in volume:
            numbers = _numbers(volume["box"], 12)
            middle = transform[:3, :3] @ numbers[:3] + transform[:3, 3]
            axes = numbers[3:].reshape(3, 3) @ transform[:3, :3].T
            return boxes_touch(middle, axes, self.centre, self.axes)
        if "sphere" in volume:
            numbers = _numbers(volume["sphere"], 4)
            middle = transform[:3, :3] @ numbers[:3] + transform[:3, 3]
            radius = abs(numbers[3]) * float(np.linalg.norm(transform[:3, :3], 2))
            size = np.linalg.norm(self.axes, axis=1)
            away = np.abs((self.axes / size[:, None]) @ (middle - self.centre)) - size
            return bool(np.linalg.norm(np.maximum(away, 0.0)) <= radius)
        return True

    def _touches_region(self, region: NDArray[np.float64]) -> bool:
        west, south, east, north = region[:4]
        mine = np.radians(self.frame.bbox(self.reach))
        if north < mine[1] or south > mine[3]:
            return False
        turn = 2 * math.pi
        if east < west:  # over the date line
            east += turn
        first, last = mine[0], mine[2] + (turn if mine[2] < mine[0] else 0.0)
        return any(west <= last + k * turn and east >= first + k * turn for k in (-1, 0, 1))


def boxes_touch(
    first: NDArray[np.float64], a: NDArray[np.float64], second: NDArray[np.float64], b: NDArray[np.float64]
) -> bool:
    """Whether two boxes, each a middle and three half axes as rows, have a point in common.

    Separating axes; flat boxes lose some of them and are then found to touch too often, never too seldom.
    """
    normals = [*a, *b, *(np.cross(u, v) for u in a for v in b)]
    axes = np.array(normals)
    size = np.linalg.norm(axes, axis=1)
    axes = axes[size > 1e-9 * max(float(size.max()), 1e-300)]
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    gap = np.abs(axes @ (second - first))
    reach = np.abs(axes @ a.T).sum(axis=1) + np.abs(axes @ b.T).sum(axis=1)
    return bool((gap <= reach * (1 + 1e-12) + 1e-6).all())


def _numbers(values: Sequence[float], count: int) -> NDArray[np.float64]:
    numbers = np.asarray(values, np.float64)
    if numbers.shape != (count,) or not (np.abs(numbers) < LARGEST).all():
        raise ValueError(f"a bounding volume needs {count} numbers of sensible size")
    return numbers
