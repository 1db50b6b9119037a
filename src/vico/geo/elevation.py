"""Ground heights around a point, from one elevation file or several together, rasters and point clouds.

Point clouds are LAZ or LAS: what is classed as ground is averaged on a grid around the window. Points are read in
chunks, and none is kept: only sums and counts of the grid's cells are in memory, however large the file. Holes (under
buildings and trees) stay void in the grid and are filled where several files are joined. Where no file reaches, the
ground is flat, without a step where the files end.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS, Transformer
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
from scipy.spatial import QhullError, cKDTree

from vico.errors import EmptyInputError, InputError, MissingExtraError, MissingFileError, SchemaError
from vico.geo.frame import LocalFrame, crs_named, split_crs
from vico.geo.raster_windows import FINEST, RasterCut, cut_of, pixels_of
from vico.geo.rasters import GridArray, Raster, read_raster
from vico.io.files import sha256_of

_CELL = 8.0  # metres between points
_FADE = 120.0  # metres over which the height at a file's edge gives way to the flat


def flat_beyond(
    points: NDArray[np.float64], cuts: Sequence[RasterCut], frame: LocalFrame, reach: float
) -> tuple[NDArray[np.float64], float]:
    """Return points where no file reaches, and the height they flatten out to.

    Parameters
    ----------
    points
        Heights where files do reach, ENU metres, shape ``(n, 3)``.
    cuts
        What the files cover.
    frame, reach
        Centre and half side of the square to fill, metres.

    Returns
    -------
    tuple
        Points, shape ``(m, 3)``, and metres above sea level: the median height along the edge of the files.
    """
    side = np.arange(-reach + _CELL / 2, reach, _CELL)
    grid = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    bare = np.ones(len(grid), bool)
    for cut in cuts:
        bare &= ~cut.holds(frame, grid)
    grid = grid[bare]
    if not len(grid):
        return np.zeros((0, 3)), float(np.median(points[:, 2]))
    distance, nearest = cKDTree(points[:, :2]).query(grid)
    edge = points[nearest, 2]
    level = float(np.median(edge))
    away = np.clip(distance / _FADE, 0.0, 1.0)
    fade = away * away * (3.0 - 2.0 * away)
    return np.column_stack([grid, edge + (level - edge) * fade]), level


GROUND = 2
"""The class of ground in the standard's list (ASPRS LAS 1.4, table 17)."""

_CHUNK = 1_000_000
_COMMAND = "pip install 'virtual-community[lidar]'"
_ENDINGS = (".laz", ".las")


def is_point_cloud(path: Path) -> bool:
    """Whether a file is a point cloud by its name."""
    return path.name.lower().endswith(_ENDINGS)


def ground_of_points(path: Path, frame: LocalFrame, reach: float, *, crs: str = "") -> Raster:
    """Return the ground that a point cloud has around the frame's origin, on a grid of 2 m.

    Parameters
    ----------
    path
        ``.laz`` or ``.las`` with points of class 2.
    frame, reach
        Centre, and half side of the square that is read, metres.
    crs
        Its reference system where the file does not say it, such as ``EPSG:25833``.

    Returns
    -------
    Raster
        Metres, in the local frame's own projection; cells without ground are NaN. Without a row where the file has
        nothing in the square.

    Raises
    ------
    MissingFileError
        If there is no such file.
    MissingExtraError
        If the library that reads it is not installed.
    SchemaError
        If it is broken, or does not say its reference system.
    EmptyInputError
        If it has points there, but none is classed as ground.
    """
    if not path.is_file():
        raise MissingFileError(f"{path}: no such elevation file; give a point cloud, or leave it out for flat ground")
    try:
        import laspy
    except ImportError:
        raise MissingExtraError(f"{path}: point clouds need laspy; install it with: {_COMMAND}") from None
    if path.name.lower().endswith(".laz") and not laspy.LazBackend.detect_available():
        raise MissingExtraError(f"{path}: packed point clouds need lazrs; install it with: {_COMMAND}")
    side = int(np.ceil(reach / FINEST))
    total, count = np.zeros((2 * side) ** 2), np.zeros((2 * side) ** 2, np.int64)
    inside = 0
    try:
        with laspy.open(path) as reader:
            system = crs_named(crs, str(path))[0] if crs else _system(reader.header, path)
            unit = _vertical_unit(reader.header, system)
            transformer = Transformer.from_crs(system, frame.proj4, always_xy=True)
            if not _reaches(reader.header, transformer, reach):
                return _raster(np.zeros((0, 0)), frame, 0.0, 0.0)
            for points in reader.chunk_iterator(_CHUNK):
                xyz = np.column_stack([np.asarray(points[axis], np.float64) for axis in "xyz"])
                ground = np.asarray(points.classification) == GROUND
                x, y = transformer.transform(xyz[:, 0], xyz[:, 1])
                column, row = np.floor(x / FINEST) + side, np.floor(-y / FINEST) + side
                near = (column >= 0) & (column < 2 * side) & (row >= 0) & (row < 2 * side)
                inside += int(near.sum())
                used = near & ground
                cell = (row[used] * 2 * side + column[used]).astype(np.int64)
                total += np.bincount(cell, xyz[used, 2] * unit, minlength=len(total))
                count += np.bincount(cell, minlength=len(count))
    except (SchemaError, MissingExtraError):
        raise
    except Exception as error:  # laspy and its unpacker meet broken files with errors of many kinds
        words = " ".join(str(error).split())[:160]
        raise SchemaError(
            f"{path}: not a readable point cloud ({type(error).__name__}: {words}); download it again"
        ) from None
    if inside and not count.any():
        raise EmptyInputError(
            f"{path}: none of its {inside:,} points in the window is classed as ground (class {GROUND}); classify it, "
            "as with pdal ground, or give a terrain GeoTIFF"
        )
    with np.errstate(invalid="ignore"):
        heights = np.where(count > 0, total / np.maximum(count, 1), np.nan).reshape(2 * side, 2 * side)
    # Beyond the part of the grid in which there is ground the file does not reach.
    rows, columns = np.flatnonzero(np.isfinite(heights).any(axis=1)), np.flatnonzero(np.isfinite(heights).any(axis=0))
    if not len(rows):
        return _raster(np.zeros((0, 0)), frame, 0.0, 0.0)
    part = heights[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    return _raster(part, frame, (columns[0] - side + 0.5) * FINEST, (side - rows[0] - 0.5) * FINEST)


def _system(header: Any, path: Path) -> CRS:
    """Return the horizontal reference system that a header says."""
    try:
        found = header.parse_crs()
    except Exception:  # whatever is written there
        found = None
    if found is None:
        return crs_named("", str(path))[0]  # says that it is missing, and how to give it
    return found.sub_crs_list[0] if found.is_compound else found


def _vertical_unit(header: Any, horizontal: CRS) -> float:
    """Metres in the heights' unit: as the vertical system says, else the horizontal one's, else metres."""
    try:
        found = header.parse_crs()
    except Exception:
        found = None
    vertical = [crs for crs in (found.sub_crs_list if found is not None else []) if crs.is_vertical]
    axes = vertical[0].axis_info if vertical else () if horizontal.is_geographic else horizontal.axis_info
    return float(axes[0].unit_conversion_factor) if axes else 1.0


def _reaches(header: Any, transformer: Transformer, reach: float) -> bool:
    """Whether a file's box touches the square."""
    (west, south, _), (east, north, _) = header.mins, header.maxs
    side = np.linspace(0.0, 1.0, 9)
    x, y = np.meshgrid(west + (east - west) * side, south + (north - south) * side)
    there = np.column_stack(transformer.transform(x.ravel(), y.ravel()))
    if not np.isfinite(there).all():
        return True  # the points will tell
    return bool((there.min(axis=0) < reach).all() and (there.max(axis=0) > -reach).all())


def _raster(heights: NDArray[np.float64], frame: LocalFrame, west: float, north: float) -> Raster:
    affine = np.array([[FINEST, 0.0, west], [0.0, -FINEST, north]])
    return Raster(GridArray(heights), affine, CRS.from_proj4(frame.proj4))


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
    rasters = [_open_raster(path, frame, reach + 2 * FINEST, crs) for path, crs in systems]
    given = [path for path, _ in systems]
    cuts = [cut for path, raster in zip(given, rasters, strict=True) if (cut := cut_of(path, raster, frame, reach))]
    if finest_first:
        cuts.sort(key=lambda cut: round(math.log(cut.spacing) / 0.02))
    covered = _coverage(cuts, frame, half)
    if not cuts or covered <= 0.0:
        raise EmptyInputError(
            f"{given[0] if len(given) == 1 else 'elevation'}: nothing of the {2 * half:.0f} m square around "
            f"{frame.lat}, {frame.lon} is there ({_extents(given, rasters)}); give files of this place, or leave "
            "elevation out for flat ground"
        )
    points, filled, counts = _merge_cuts(cuts, frame, half)
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


def _open_raster(path: Path, frame: LocalFrame, reach: float, crs: str) -> Raster:
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


def _extents(paths: Sequence[Path], rasters: Sequence[Raster]) -> str:
    """Return what files cover."""
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


def _merge_cuts(
    cuts: Sequence[RasterCut], frame: LocalFrame, half: float
) -> tuple[NDArray[np.float64], int, list[int]]:
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
        points = np.concatenate([points, np.column_stack([empty, _fill_voids(points, empty)])])
    return points, len(empty), counts


def _offset(
    xy: NDArray[np.float64], own: NDArray[np.float64], finer: NDArray[np.float64], spacing: float
) -> NDArray[np.float64]:
    """Return how much a file must be raised so that it meets finer ones without a step; nothing farther away."""
    both = np.isfinite(own) & np.isfinite(finer)
    offset = np.zeros(len(xy))
    if not both.any():
        return offset
    distance, nearest = cKDTree(xy[both]).query(xy, k=min(12, int(both.sum())))
    distance, nearest = distance.reshape(len(xy), -1), nearest.reshape(len(xy), -1)
    away = np.clip(1.0 - distance[:, 0] / (_BLEND * spacing), 0.0, 1.0)
    return np.median((finer - own)[both][nearest], axis=1) * away * away * (3.0 - 2.0 * away)


def _fill_voids(points: NDArray[np.float64], empty: NDArray[np.float64]) -> NDArray[np.float64]:
    """Heights in voids: linear between the points around them, of the nearest where there are none around."""
    nearest = NearestNDInterpolator(points[:, :2], points[:, 2])(empty)
    try:
        linear = LinearNDInterpolator(points[:, :2], points[:, 2])(empty)
    except QhullError:
        return np.asarray(nearest, np.float64)
    return np.asarray(np.where(np.isfinite(linear), linear, nearest), np.float64)
