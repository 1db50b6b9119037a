"""The part of a raster of heights that lies around a window, as points and as a surface."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pyproj import Transformer

from vico.errors import SchemaError
from vico.geo.frame import LocalFrame
from vico.geo.outliers import without_outliers
from vico.geo.rasters import Raster
from vico.geo.untagged import Patch, without_voids

_LOWEST, _HIGHEST = -1000.0, 9000.0  # SRTM's void is -32768, others use -9999; no dry land lies under -430 m
_MOST_CUT = 100_000_000  # pixels
_MOST_POINTS = 160_000
FINEST = 2.0
"""Metres between points below which they are averaged: the terrain's own cells are 4 m."""


@dataclass(frozen=True)
class RasterCut:
    """The part of a raster around the window.

    Attributes
    ----------
    xy
        Its pixels' centres, metres, shape ``(rows, columns, 2)``.
    spacing
        Distance between neighbouring pixels, metres.
    outliers
        Latitude, longitude and metres of heights that no ground has, and that were left out.
    voids, doubtful
        Latitude and longitude of patches of one value: those left out as voids, and those that may be some.
    """

    path: Path
    raster: Raster
    to_raster: Transformer
    affine: NDArray[np.float64]
    heights: NDArray[np.float64]
    xy: NDArray[np.float64]
    spacing: float
    outliers: tuple[tuple[float, float, float], ...] = ()
    voids: tuple[tuple[float, float, Patch], ...] = ()
    doubtful: tuple[tuple[float, float, Patch], ...] = ()

    def _holds(self, pixels: NDArray[np.float64]) -> NDArray[np.bool_]:
        # The outermost pixels reach half a pixel beyond their centres.
        size = np.array(self.heights.shape[::-1])
        return np.asarray(((pixels > -0.501) & (pixels < size - 0.499)).all(axis=1), np.bool_)

    def holds(self, frame: LocalFrame, xy: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether points lie on the raster, void or not."""
        lat, lon = frame.to_geodetic(xy)
        return self._holds(pixels_of(self.raster, self.to_raster, self.affine, lat, lon))

    def at(self, frame: LocalFrame, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Heights at points, bilinear; NaN off the raster and where it is void."""
        lat, lon = frame.to_geodetic(xy)
        pixels = pixels_of(self.raster, self.to_raster, self.affine, lat, lon)
        rows, columns = self.heights.shape
        on = self._holds(pixels)
        place = np.where(on[:, None], pixels, 0.0)
        low = np.clip(np.floor(place + 1e-6).astype(int), 0, np.maximum(np.array([columns, rows]) - 2, 0))
        part = place - low  # linear beyond the outermost centres, too
        part[np.abs(part) < 1e-6] = 0.0
        part[np.abs(part - 1.0) < 1e-6] = 1.0
        total = np.zeros(len(xy))
        for across, x_weight in ((0, 1.0 - part[:, 0]), (1, part[:, 0])):
            for down, y_weight in ((0, 1.0 - part[:, 1]), (1, part[:, 1])):
                weight = x_weight * y_weight
                row, column = np.minimum(low[:, 1] + down, rows - 1), np.minimum(low[:, 0] + across, columns - 1)
                total += np.where(weight != 0.0, weight * self.heights[row, column], 0.0)
        return np.where(on, total, np.nan)


def pixels_of(
    raster: Raster,
    to_raster: Transformer,
    affine: NDArray[np.float64],
    lat: NDArray[np.float64],
    lon: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Columns and rows of geodetic points, shape ``(n, 2)``."""
    x, y = to_raster.transform(lon, lat)
    if raster.crs.is_geographic:
        # A raster may count longitudes from 0 to 360, and a window may lie over the date line.
        middle = raster.affine[0] @ np.array([raster.pixels.shape[1] / 2, raster.pixels.shape[0] / 2, 1.0])
        x = x + 360.0 * np.round((middle - x) / 360.0)
    inverse = np.linalg.inv(affine[:, :2])
    return (np.stack([x, y], axis=1) - affine[:, 2]) @ inverse.T


def cut_of(path: Path, raster: Raster, frame: LocalFrame, reach: float) -> RasterCut | None:
    """Return the part of a raster that lies in the window, its heights checked; None where there is none."""
    to_raster = Transformer.from_crs("EPSG:4326", raster.crs, always_xy=True)
    side = np.linspace(-reach, reach, 9)
    lat, lon = frame.to_geodetic(np.array([(x, y) for x in side for y in side]))
    pixels = pixels_of(raster, to_raster, raster.affine, lat, lon)
    if not np.isfinite(pixels).all() or np.abs(pixels).max() > 1e9:
        return None
    rows, columns = raster.pixels.shape
    c0, r0 = np.maximum(np.floor(pixels.min(0)).astype(int) - 2, 0).tolist()
    c1, r1 = np.minimum(np.ceil(pixels.max(0)).astype(int) + 3, [columns, rows]).tolist()
    if c0 >= c1 or r0 >= r1:
        return None
    if (r1 - r0) * (c1 - c0) > _MOST_CUT:
        raise SchemaError(f"{path}: {c1 - c0} x {r1 - r0} pixels in the window are too many; save it anew, coarser")
    try:
        heights = raster.pixels.read(r0, r1, c0, c1)
    except SchemaError:
        raise
    except Exception as error:  # the unpackers meet broken blocks with errors of many kinds
        words = " ".join(str(error).split())[:200]
        raise SchemaError(f"{path}: broken data ({type(error).__name__}: {words}); download it again") from None
    with np.errstate(invalid="ignore"):
        heights[~((heights > _LOWEST) & (heights < _HIGHEST))] = np.nan
    affine = raster.affine.copy()
    affine[:, 2] += affine[:, :2] @ np.array([c0, r0])
    xy = _centres(frame, to_raster, affine, heights.shape)
    spacing = _spacing(xy, path)
    heights, *patches = without_voids(heights, spacing)
    heights, odd = without_outliers(heights, spacing)

    def degrees(row: int, column: int) -> tuple[float, float]:
        lat, lon = frame.to_geodetic(xy[row, column])
        return float(lat), float(lon)

    outliers = tuple((*degrees(row, column), height) for row, column, height in odd)
    voids, doubtful = (tuple((*degrees(patch.row, patch.column), patch) for patch in some) for some in patches)
    # Finer than the terrain can show, or too many to fit: averaged in blocks.
    step = max(round(FINEST / spacing), math.ceil(math.sqrt(heights.size / _MOST_POINTS)), 1)
    if step > 1 and min(heights.shape) >= 2 * step:
        heights = _averaged(heights, step)
        affine[:, 2] += affine[:, :2] @ np.full(2, (step - 1) / 2)
        affine[:, :2] *= step
        xy = _centres(frame, to_raster, affine, heights.shape)
        spacing = _spacing(xy, path)
    return RasterCut(path, raster, to_raster, affine, heights, xy, spacing, outliers, voids, doubtful)


def _centres(
    frame: LocalFrame, to_raster: Transformer, affine: NDArray[np.float64], shape: tuple[int, ...]
) -> NDArray[np.float64]:
    grid = np.stack(np.meshgrid(np.arange(shape[1]), np.arange(shape[0])), axis=-1).reshape(-1, 2)
    places = grid @ affine[:, :2].T + affine[:, 2]
    lon, lat = to_raster.transform(places[:, 0], places[:, 1], direction="INVERSE")
    return frame.to_enu(lat, lon).reshape(shape[0], shape[1], 2)


def _spacing(xy: NDArray[np.float64], path: Path) -> float:
    """Distance between neighbouring pixels, metres."""
    if not np.isfinite(xy).all():
        raise SchemaError(f"{path}: some of its pixels lie nowhere on Earth; check its georeferencing")
    steps = [np.hypot(*np.diff(xy, axis=axis).reshape(-1, 2).T) for axis in (0, 1)]
    medians = [float(np.median(step)) for step in steps if len(step)]
    spacing = max(medians, default=0.0)
    if not (math.isfinite(spacing) and spacing > 1e-3):
        raise SchemaError(f"{path}: its pixels have no extent here ({spacing:g} m); check its georeferencing")
    return spacing


def _averaged(heights: NDArray[np.float64], step: int) -> NDArray[np.float64]:
    rows, columns = heights.shape[0] // step, heights.shape[1] // step
    blocks = heights[: rows * step, : columns * step].reshape(rows, step, columns, step)
    known = np.isfinite(blocks)
    count = known.sum(axis=(1, 3))
    total = np.where(known, blocks, 0.0).sum(axis=(1, 3))
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
