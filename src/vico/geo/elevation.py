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

from vico.errors import EmptyInputError, InputError
from vico.geo.beyond import flat_beyond
from vico.geo.frame import LocalFrame
from vico.geo.lidar import ground_of_points, is_point_cloud
from vico.geo.raster_cuts import FINEST, RasterCut, cut_of, pixels_of
from vico.geo.rasters import Raster, read_raster
from vico.geo.reference_systems import split_crs
from vico.io.files import sha256_of

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
    covered
        Share of the window that the files have pixels for.
    beyond
        Where they do not cover all of it: what they cover, and what became of the rest.
    outliers
        File, latitude, longitude and metres of each pixel that was left out, as no ground stands so far above or below
        all around it (a spike, a hole); it is filled as voids are.
    voids
        File, latitude, longitude, metres, number of pixels and step to the ground around, metres, of each patch of one
        value that was left out as a void that the file does not tag.
    doubtful
        The same of patches that may be such a void, or a sea below cliffs or the top of a tower; they are kept.
    """

    points: NDArray[np.float64]
    spacing: float
    name: str
    sha256: str
    filled: int = 0
    files: tuple[tuple[str, str, int], ...] = ()
    covered: float = 1.0
    beyond: str = ""
    outliers: tuple[tuple[str, float, float, float], ...] = ()
    voids: tuple[tuple[str, float, float, float, int, float], ...] = ()
    doubtful: tuple[tuple[str, float, float, float, int, float], ...] = ()


def read_elevation(
    paths: Path | str | Sequence[Path | str],
    frame: LocalFrame,
    half: float,
    margin: float = 60.0,
    *,
    finest_first: bool = True,
) -> HeightSamples:
    """Read the heights that elevation files have around the frame's origin.

    Parameters
    ----------
    paths
        One file or several: GeoTIFF (``.tif``, ``.tiff``; any CRS with an EPSG code; not compressed, or by deflate,
        LZW or PackBits, with any predictor), ``.hgt``, ``.hgt.gz``, a zip with one ``.hgt``, or a point cloud
        (``.laz``, ``.las``; ``tile.laz@EPSG:25833`` where it does not say its system). Where files overlap the finest
        counts, of equals the first; another one is brought to its level where they meet.
    frame
        Local frame whose origin is the window's centre.
    half, margin
        Half side of the window and how far beyond it samples are kept, metres; two grid cells more are added.
    finest_first
        Otherwise the file that is given first counts where several overlap.

    Returns
    -------
    HeightSamples
        The files' own grid points, those of finer files than 2 m averaged; voids are filled from other files, else
        from their neighbours; where no file reaches the ground flattens out.

    Raises
    ------
    MissingFileError, InputError
        If there is no such file, or it is of another kind.
    SchemaError
        If it is broken, too large, or not georeferenced.
    EmptyInputError
        If the files cover nothing of the window, or most of what they cover is void, or no point is ground.
    MissingExtraError
        If a point cloud is given, and what reads it is not installed.
    """
    given = [Path(paths)] if isinstance(paths, Path | str) else [Path(path) for path in paths]
    if not given:
        raise InputError("elevation: no file given; give a GeoTIFF or HGT, or leave it out for flat ground")
    reach = half + margin
    systems = [split_crs(path) for path in given]
    rasters = [_opened(path, frame, reach + 2 * FINEST, crs) for path, crs in systems]
    given = [path for path, _ in systems]
    cuts = [cut for path, raster in zip(given, rasters, strict=True) if (cut := cut_of(path, raster, frame, reach))]
    if finest_first:
        cuts.sort(key=lambda cut: round(math.log(cut.spacing) / 0.02))
    covered = _coverage(cuts, frame, half)
    if not cuts or covered <= 0.0:
        _refuse(given, rasters, frame, half)
    points, filled, counts = _together(cuts, frame, half)
    beyond = ""
    if covered < 1.0:
        more, level = flat_beyond(points, cuts, frame, reach)
        points = np.concatenate([points, more])
        beyond = (
            f"only {100 * covered:.0f} % of the window is covered ({_extents(given, rasters)}); the rest flattens out "
            f"to {level:.1f} m; add files of the rest"
        )
    digests = {path: sha256_of(path) for path in given}
    files = tuple((cut.path.name, digests[cut.path], count) for cut, count in zip(cuts, counts, strict=True) if count)
    gave = {cut.path for cut, count in zip(cuts, counts, strict=True) if count}
    used = [path for path in given if path in gave]
    total = digests[used[0]] if len(used) == 1 else sha256("".join(digests[path] for path in used).encode()).hexdigest()
    total += "".join(f" {path.name} {crs}" for path, crs in systems if crs)
    name = ", ".join(path.name for path in used)
    outliers = tuple((cut.path.name, *place) for cut in cuts for place in cut.outliers)
    voids, doubtful = (
        tuple((cut.path.name, lat, lon, p.value, p.pixels, p.step) for cut, lat, lon, p in rows)
        for rows in (
            [(cut, *place) for cut in cuts for place in cut.voids],
            [(cut, *place) for cut in cuts for place in cut.doubtful],
        )
    )
    spacing = min(cut.spacing for cut in cuts)
    return HeightSamples(points, spacing, name, total, filled, files, covered, beyond, outliers, voids, doubtful)


def _opened(path: Path, frame: LocalFrame, reach: float, crs: str) -> Raster:
    if is_point_cloud(path):
        return ground_of_points(path, frame, reach, crs=crs)
    if crs:
        raise InputError(f"{path}: {crs} is said of it; only point clouds (.laz, .las) are told their system so")
    return read_raster(path)


def _coverage(cuts: Sequence[RasterCut], frame: LocalFrame, half: float) -> float:
    """Return the share of the window that some file has pixels for, void or not."""
    side = np.linspace(-half, half, 33)
    probes = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    lat, lon = frame.to_geodetic(probes)
    covered = np.zeros(len(probes), bool)
    for cut in cuts:
        rows, columns = cut.heights.shape
        pixels = pixels_of(cut.raster, cut.to_raster, cut.affine, lat, lon)
        # One pixel beyond the outermost centres: there the fit still stands on something.
        covered |= (pixels > -1.0).all(axis=1) & (pixels < np.array([columns, rows])).all(axis=1)
    return float(covered.mean())


def _refuse(paths: Sequence[Path], rasters: Sequence[Raster], frame: LocalFrame, half: float) -> None:
    """Say what the files cover, since nothing of the window is among it."""
    raise EmptyInputError(
        f"{paths[0] if len(paths) == 1 else 'elevation'}: nothing of the {2 * half:.0f} m square around {frame.lat}, "
        f"{frame.lon} is there ({_extents(paths, rasters)}); give files of this place, or leave elevation out for flat "
        "ground"
    )


def _extents(paths: Sequence[Path], rasters: Sequence[Raster]) -> str:
    """Say what files cover."""
    extents: list[str] = []
    for path, raster in zip(paths, rasters, strict=True):
        rows, columns = raster.pixels.shape
        if not rows:
            extents.append(f"{path.name} lies elsewhere")
            continue
        corners = np.array([(x, y) for x in (-0.5, columns - 0.5) for y in (-0.5, rows - 0.5)])
        places = corners @ raster.affine[:, :2].T + raster.affine[:, 2]
        to_raster = Transformer.from_crs("EPSG:4326", raster.crs, always_xy=True)
        lon, lat = to_raster.transform(places[:, 0], places[:, 1], direction="INVERSE")
        extents.append(
            f"{path.name} covers latitudes {lat.min():.4f}..{lat.max():.4f} and longitudes {lon.min():.4f}.."
            f"{lon.max():.4f}"
        )
    return "; ".join(extents)


def _together(cuts: Sequence[RasterCut], frame: LocalFrame, half: float) -> tuple[NDArray[np.float64], int, list[int]]:
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
        values = sorted({f"{patch.value:g}" for cut in cuts for *_, patch in cut.voids})
        taken = f", patches of exactly {', '.join(values[:4])} m among it" if values else ""
        raise EmptyInputError(
            f"{', '.join(str(cut.path) for cut in cuts)}: no heights ({100 * share:.0f} % void{taken}) around "
            f"{frame.lat}, {frame.lon}; give another elevation file"
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
