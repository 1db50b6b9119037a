"""Ground heights around a point, from one elevation file or from several together."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pyproj import Transformer
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
from scipy.spatial import QhullError, cKDTree

from vico.errors import EmptyInputError, InputError, SchemaError
from vico.geo.frame import LocalFrame
from vico.geo.rasters import Raster, read_raster
from vico.io.files import sha256_of

_LOWEST, _HIGHEST = -1000.0, 9000.0  # SRTM's void is -32768, others use -9999; no dry land lies under -430 m
_MOST_CUT = 100_000_000  # pixels
_MOST_POINTS = 160_000
_FINEST = 2.0  # metres; the terrain's own cells are 4 m
_MOST_VOID = 0.5
_BLEND = 8.0  # grid cells over which a coarse file is brought to the level of a fine one beside it


@dataclass(frozen=True)
class HeightSamples:
    """Heights at points.

    Attributes
    ----------
    points
        ENU metres and metres above sea level, float64, shape ``(n, 3)``.
    spacing
        Typical distance between neighbours, metres; of the finest file where there are several.
    name, sha256
        Of the file they came from; of several, all names, and the sum of their sums.
    filled
        How many of the points lay in voids, and were interpolated from their neighbours.
    files
        Name, SHA-256 and number of points of each file, the finest first.
    """

    points: NDArray[np.float64]
    spacing: float
    name: str
    sha256: str
    filled: int = 0
    files: tuple[tuple[str, str, int], ...] = ()


@dataclass(frozen=True)
class _Cut:
    """The part of a raster around the window; `xy` are its pixels' centres, metres, shape ``(rows, columns, 2)``."""

    path: Path
    raster: Raster
    to_raster: Transformer
    affine: NDArray[np.float64]
    heights: NDArray[np.float64]
    xy: NDArray[np.float64]
    spacing: float

    def _holds(self, pixels: NDArray[np.float64]) -> NDArray[np.bool_]:
        # The outermost pixels reach half a pixel beyond their centres.
        size = np.array(self.heights.shape[::-1])
        return np.asarray(((pixels > -0.501) & (pixels < size - 0.499)).all(axis=1), np.bool_)

    def holds(self, frame: LocalFrame, xy: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether points lie on the raster, void or not."""
        lat, lon = frame.to_geodetic(xy)
        return self._holds(_pixels(self.raster, self.to_raster, self.affine, lat, lon))

    def at(self, frame: LocalFrame, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """Heights at points, bilinear; NaN off the raster and where it is void."""
        lat, lon = frame.to_geodetic(xy)
        pixels = _pixels(self.raster, self.to_raster, self.affine, lat, lon)
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


def read_elevation(
    paths: Path | str | Sequence[Path | str], frame: LocalFrame, half: float, margin: float = 60.0
) -> HeightSamples:
    """Read the heights that elevation files have around the frame's origin.

    Parameters
    ----------
    paths
        One file or several: GeoTIFF (``.tif``, ``.tiff``; any CRS with an EPSG code; not compressed, or by deflate,
        LZW or PackBits, with any predictor), ``.hgt``, ``.hgt.gz``, or a zip with one ``.hgt``. Where files overlap the
        finest counts, of equals the first; a coarser one is brought to the finer one's level where they meet.
    frame
        Local frame whose origin is the window's centre.
    half, margin
        Half side of the window and how far beyond it samples are kept, metres; two grid cells more are added.

    Returns
    -------
    HeightSamples
        The files' own grid points, those of finer files than 2 m averaged; voids are filled from other files, else
        from their neighbours.

    Raises
    ------
    MissingFileError, InputError
        If there is no such file, or it is of another kind.
    SchemaError
        If it is broken, too large, or not georeferenced.
    EmptyInputError
        If all files together do not cover the window, or most of it is void.
    """
    given = [Path(paths)] if isinstance(paths, Path | str) else [Path(path) for path in paths]
    if not given:
        raise InputError("elevation: no file given; give a GeoTIFF or HGT, or leave it out for flat ground")
    reach = half + margin
    rasters = [read_raster(path) for path in given]
    cuts = [cut for path, raster in zip(given, rasters, strict=True) if (cut := _cut(path, raster, frame, reach))]
    cuts.sort(key=lambda cut: round(math.log(cut.spacing) / 0.02))
    covered = _coverage(cuts, frame, half)
    if not cuts or covered < 1.0:
        _refuse(given, rasters, frame, half, covered)
    points, filled, counts = _together(cuts, frame, half)
    digests = {path: sha256_of(path) for path in given}
    files = tuple((cut.path.name, digests[cut.path], count) for cut, count in zip(cuts, counts, strict=True) if count)
    gave = {cut.path for cut, count in zip(cuts, counts, strict=True) if count}
    used = [path for path in given if path in gave]
    total = digests[used[0]] if len(used) == 1 else sha256("".join(digests[path] for path in used).encode()).hexdigest()
    return HeightSamples(points, cuts[0].spacing, ", ".join(path.name for path in used), total, filled, files)


def _pixels(
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


def _cut(path: Path, raster: Raster, frame: LocalFrame, reach: float) -> _Cut | None:
    """Return the part of a raster that lies in the window, its heights checked; None where there is none."""
    to_raster = Transformer.from_crs("EPSG:4326", raster.crs, always_xy=True)
    side = np.linspace(-reach, reach, 9)
    lat, lon = frame.to_geodetic(np.array([(x, y) for x in side for y in side]))
    pixels = _pixels(raster, to_raster, raster.affine, lat, lon)
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
    # Finer than the terrain can show, or too many to fit: averaged in blocks.
    step = max(round(_FINEST / spacing), math.ceil(math.sqrt(heights.size / _MOST_POINTS)), 1)
    if step > 1 and min(heights.shape) >= 2 * step:
        heights = _averaged(heights, step)
        affine[:, 2] += affine[:, :2] @ np.full(2, (step - 1) / 2)
        affine[:, :2] *= step
        xy = _centres(frame, to_raster, affine, heights.shape)
        spacing = _spacing(xy, path)
    return _Cut(path, raster, to_raster, affine, heights, xy, spacing)


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


def _coverage(cuts: Sequence[_Cut], frame: LocalFrame, half: float) -> float:
    """Return the share of the window that some file has pixels for, void or not."""
    side = np.linspace(-half, half, 33)
    probes = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    lat, lon = frame.to_geodetic(probes)
    covered = np.zeros(len(probes), bool)
    for cut in cuts:
        rows, columns = cut.heights.shape
        pixels = _pixels(cut.raster, cut.to_raster, cut.affine, lat, lon)
        # One pixel beyond the outermost centres: there the fit still stands on something.
        covered |= (pixels > -1.0).all(axis=1) & (pixels < np.array([columns, rows])).all(axis=1)
    return float(covered.mean())


def _refuse(paths: Sequence[Path], rasters: Sequence[Raster], frame: LocalFrame, half: float, covered: float) -> None:
    """Say what the files cover, since it is not the window."""
    extents: list[str] = []
    for path, raster in zip(paths, rasters, strict=True):
        rows, columns = raster.pixels.shape
        corners = np.array([(x, y) for x in (-0.5, columns - 0.5) for y in (-0.5, rows - 0.5)])
        places = corners @ raster.affine[:, :2].T + raster.affine[:, 2]
        to_raster = Transformer.from_crs("EPSG:4326", raster.crs, always_xy=True)
        lon, lat = to_raster.transform(places[:, 0], places[:, 1], direction="INVERSE")
        extents.append(
            f"{path.name} covers latitudes {lat.min():.4f}..{lat.max():.4f} and longitudes {lon.min():.4f}.."
            f"{lon.max():.4f}"
        )
    what = f"only {100 * covered:.0f} % of" if covered > 0 else "nothing of"
    raise EmptyInputError(
        f"{paths[0] if len(paths) == 1 else 'elevation'}: {what} the {2 * half:.0f} m square around {frame.lat}, "
        f"{frame.lon} is there ({'; '.join(extents)}); add files of the rest, or leave elevation out for flat ground"
    )


def _together(cuts: Sequence[_Cut], frame: LocalFrame, half: float) -> tuple[NDArray[np.float64], int, list[int]]:
    """All cuts as one set of points, the finest file where there are several; voids filled."""
    pieces: list[NDArray[np.float64]] = []
    voids: list[NDArray[np.float64]] = []
    counts: list[int] = []
    for k, cut in enumerate(cuts):
        xy = cut.xy.reshape(-1, 2)
        own = cut.heights.ravel()
        finer = np.full(len(xy), np.nan)
        for other in cuts[:k]:
            finer = np.where(np.isnan(finer), other.at(frame, xy), finer)
        known = np.isfinite(own) & np.isnan(finer)
        offset = _offset(xy, own, finer, cut.spacing)
        pieces.append(np.column_stack([xy, own + offset])[known])
        counts.append(int(known.sum()))
        # Void here and in every other file: to be filled, once.
        void = np.isnan(own) & np.isnan(finer)
        for other in cuts[k + 1 :]:
            void[void] = np.isnan(other.at(frame, xy[void]))
        for earlier in cuts[:k]:
            void[void] = ~earlier.holds(frame, xy[void])
        voids.append(xy[void])
    points, empty = np.concatenate(pieces), np.concatenate(voids)
    window = [np.abs(part[:, :2]).max(axis=1, initial=0.0) <= half + cuts[0].spacing for part in (points, empty)]
    share = window[1].sum() / max(window[0].sum() + window[1].sum(), 1)
    if len(points) < 3 or share > _MOST_VOID:
        raise EmptyInputError(
            f"{', '.join(str(cut.path) for cut in cuts)}: no heights ({100 * share:.0f} % void) around {frame.lat}, "
            f"{frame.lon}; give another elevation file"
        )
    if len(empty):
        points = np.concatenate([points, np.column_stack([empty, _filled(points, empty)])])
    return points, len(empty), counts


def _offset(
    xy: NDArray[np.float64], own: NDArray[np.float64], finer: NDArray[np.float64], spacing: float
) -> NDArray[np.float64]:
    """How much a file must be raised where it meets finer ones, so that there is no step; nothing farther away."""
    both = np.isfinite(own) & np.isfinite(finer)
    offset = np.zeros(len(xy))
    if not both.any():
        return offset
    distance, nearest = cKDTree(xy[both]).query(xy, k=min(12, int(both.sum())))
    distance, nearest = distance.reshape(len(xy), -1), nearest.reshape(len(xy), -1)
    away = np.clip(1.0 - distance[:, 0] / (_BLEND * spacing), 0.0, 1.0)
    return np.median((finer - own)[both][nearest], axis=1) * away * away * (3.0 - 2.0 * away)


def _filled(points: NDArray[np.float64], empty: NDArray[np.float64]) -> NDArray[np.float64]:
    """Heights in voids: linear between the points around them, of the nearest where there are none around."""
    nearest = NearestNDInterpolator(points[:, :2], points[:, 2])(empty)
    try:
        linear = LinearNDInterpolator(points[:, :2], points[:, 2])(empty)
    except QhullError:
        return np.asarray(nearest, np.float64)
    return np.asarray(np.where(np.isfinite(linear), linear, nearest), np.float64)
