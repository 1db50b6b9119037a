"""Ground heights of point clouds, LAZ or LAS: what is classed as ground, averaged on a grid around a window.

Points are read in chunks, and none is kept: only sums and counts of the grid's cells are in memory, however large the
file. Holes (under buildings and trees) stay void in the grid and are filled by whoever joins several files.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS, Transformer

from vico.errors import EmptyInputError, MissingExtraError, MissingFileError, SchemaError
from vico.geo.frame import LocalFrame
from vico.geo.raster_cuts import FINEST
from vico.geo.rasters import GridArray, Raster
from vico.geo.reference_systems import crs_named

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
    laspy = _library(path)
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
            for xyz, ground in _chunks(reader):
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
    return _cropped(heights, frame, side)


def _library(path: Path) -> Any:
    try:
        import laspy
    except ImportError:
        raise MissingExtraError(f"{path}: point clouds need laspy; install it with: {_COMMAND}") from None
    if path.name.lower().endswith(".laz") and not laspy.LazBackend.detect_available():
        raise MissingExtraError(f"{path}: packed point clouds need lazrs; install it with: {_COMMAND}")
    return laspy


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


def _chunks(reader: Any) -> Iterator[tuple[NDArray[np.float64], NDArray[np.bool_]]]:
    """Coordinates of points, and which are ground."""
    for points in reader.chunk_iterator(_CHUNK):
        xyz = np.column_stack([np.asarray(points[axis], np.float64) for axis in "xyz"])
        yield xyz, np.asarray(points.classification) == GROUND


def _cropped(heights: NDArray[np.float64], frame: LocalFrame, side: int) -> Raster:
    """Return the part of the grid in which there is ground: beyond it the file does not reach."""
    rows, columns = np.flatnonzero(np.isfinite(heights).any(axis=1)), np.flatnonzero(np.isfinite(heights).any(axis=0))
    if not len(rows):
        return _raster(np.zeros((0, 0)), frame, 0.0, 0.0)
    part = heights[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    return _raster(part, frame, (columns[0] - side + 0.5) * FINEST, (side - rows[0] - 0.5) * FINEST)


def _raster(heights: NDArray[np.float64], frame: LocalFrame, west: float, north: float) -> Raster:
    affine = np.array([[FINEST, 0.0, west], [0.0, -FINEST, north]])
    return Raster(GridArray(heights), affine, CRS.from_proj4(frame.proj4))
