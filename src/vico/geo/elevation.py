"""Ground heights from elevation files: GeoTIFF, and SRTM's HGT, plain or zipped."""

from __future__ import annotations

import re
import zipfile
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import numpy as np
import tifffile
from numpy.typing import NDArray
from pyproj import CRS, Transformer
from pyproj.exceptions import CRSError

from vico.errors import EmptyInputError, InputError, MissingFileError, SchemaError
from vico.geo.frame import LocalFrame

# SRTM's two grids: 3 and 1 arc seconds. A zip that claims another size is not a tile, whatever it unpacks to.
_HGT_SIDES = {1201 * 1201 * 2: 1201, 3601 * 3601 * 2: 3601}
_HGT_NAME = re.compile(r"([NS])(\d{2})([EW])(\d{3})", re.IGNORECASE)
_MOST_PIXELS = 200_000_000
_VOID_BELOW = -1000.0  # SRTM's void is -32768, others use -9999; no dry land lies under -430 m


@dataclass(frozen=True)
class HeightSamples:
    """Heights at points.

    Attributes
    ----------
    points
        ENU metres and metres above sea level, float64, shape ``(n, 3)``.
    spacing
        Typical distance between neighbours, metres.
    name, sha256
        Of the file they came from.
    """

    points: NDArray[np.float64]
    spacing: float
    name: str
    sha256: str


@dataclass(frozen=True)
class _Raster:
    """Heights on a grid; pixel (row, column) has its centre at ``affine @ (column, row, 1)``."""

    heights: NDArray[np.float32]
    affine: NDArray[np.float64]
    crs: CRS


def read_elevation(path: Path, frame: LocalFrame, half: float, margin: float = 60.0) -> HeightSamples:
    """Read the heights an elevation file has around the frame's origin.

    Parameters
    ----------
    path
        GeoTIFF (``.tif``, ``.tiff``; any CRS with an EPSG code), ``.hgt``, or a zip with one ``.hgt``.
    frame
        Local frame whose origin is the window's centre.
    half, margin
        Half side of the window and how far beyond it samples are kept, metres; two grid cells more are added.

    Returns
    -------
    HeightSamples
        The file's own grid points, voids left out.

    Raises
    ------
    MissingFileError, InputError
        If there is no such file, or it is of another kind.
    SchemaError
        If it is broken, too large, or not georeferenced.
    EmptyInputError
        If it does not cover the window.
    """
    path = Path(path)
    if not path.is_file():
        raise MissingFileError(
            f"{path}: no such elevation file; give a GeoTIFF or HGT, or leave it out for flat ground"
        )
    suffix = path.suffix.lower()
    if suffix in (".tif", ".tiff"):
        raster = _read_geotiff(path)
    elif suffix == ".hgt":
        raster = _read_hgt(path.read_bytes(), path.name, path)
    elif suffix == ".zip":
        raster = _read_zipped_hgt(path)
    else:
        raise InputError(
            f"{path}: not an elevation file by its name; it must end in .tif, .tiff, .hgt or .zip (of an .hgt)"
        )
    return _samples(raster, path, frame, half + margin)


def _read_hgt(content: bytes, name: str, path: Path) -> _Raster:
    match = _HGT_NAME.search(name)
    if match is None:
        raise InputError(f"{path}: {name} does not say which tile it is; HGT files are named like N43E007.hgt")
    side = _HGT_SIDES.get(len(content))
    if side is None:
        raise SchemaError(f"{path}: {name} has {len(content):,} bytes, no HGT tile has; download it again")
    south = int(match[2]) * (1 if match[1].upper() == "N" else -1)
    west = int(match[4]) * (1 if match[3].upper() == "E" else -1)
    step = 1.0 / (side - 1)
    heights = np.frombuffer(content, ">i2").reshape(side, side).astype(np.float32)
    affine = np.array([[step, 0.0, west], [0.0, -step, south + 1.0]])
    return _Raster(heights, affine, CRS.from_epsg(4326))


def _read_zipped_hgt(path: Path) -> _Raster:
    try:
        with zipfile.ZipFile(path) as archive:
            tiles = [entry for entry in archive.infolist() if entry.filename.lower().endswith(".hgt")]
            if len(tiles) != 1:
                raise SchemaError(f"{path}: holds {len(tiles)} .hgt files; it must hold exactly one")
            if tiles[0].file_size not in _HGT_SIDES:
                raise SchemaError(f"{path}: {tiles[0].filename} claims {tiles[0].file_size:,} bytes, no HGT tile has")
            with archive.open(tiles[0]) as file:
                # One byte more than claimed: a member that lies about its size is found out, not unpacked.
                content = file.read(tiles[0].file_size + 1)
    except (zipfile.BadZipFile, EOFError, NotImplementedError, RuntimeError) as error:
        raise SchemaError(f"{path}: broken zip file ({error}); download it again") from None
    return _read_hgt(content, Path(tiles[0].filename).name, path)


def _read_geotiff(path: Path) -> _Raster:
    try:
        with tifffile.TiffFile(path) as file:
            page = file.pages[0]
            if not isinstance(page, tifffile.TiffPage) or len(page.shape) != 2:
                raise SchemaError(f"{path}: shape {page.shape}; an elevation GeoTIFF has one band")
            if page.shape[0] * page.shape[1] > _MOST_PIXELS:
                raise SchemaError(
                    f"{path}: {page.shape[1]} x {page.shape[0]} pixels are too many; clip it to the place first"
                )
            tags = {tag.code: tag.value for tag in page.tags}
            heights = np.asarray(page.asarray(), np.float32)
    except SchemaError:
        raise
    except (tifffile.TiffFileError, ValueError, OSError, IndexError, RuntimeError, KeyError) as error:
        raise SchemaError(f"{path}: not a readable GeoTIFF ({error}); save it anew, deflated or uncompressed") from None
    void = tags.get(42113)
    if void is not None:
        try:
            heights[heights == np.float32(float(str(void).strip("\0 ")))] = np.nan
        except ValueError:
            raise SchemaError(f"{path}: nodata value {void!r} is not a number") from None
    keys = _geo_keys(tags.get(34735, ()))
    code = keys.get(3072) or keys.get(2048)
    if not code or code == 32767:
        raise SchemaError(f"{path}: no EPSG code of its coordinates; save it anew with one, such as EPSG:4326")
    try:
        crs = CRS.from_epsg(code)
    except CRSError:
        raise SchemaError(f"{path}: EPSG:{code} is not a coordinate system known here") from None
    # Area: the tie point is the pixel's corner, half a pixel off its centre. Point: it is the centre.
    shift = 0.0 if keys.get(1025) == 2 else 0.5
    return _Raster(heights, _affine(tags, shift, path), crs)


def _affine(tags: dict[int, object], shift: float, path: Path) -> NDArray[np.float64]:
    matrix, scale, tie = tags.get(34264), tags.get(33550), tags.get(33922)
    if matrix is not None:
        values = np.asarray(matrix, np.float64).reshape(4, 4)
        affine = np.array([values[0, [0, 1, 3]], values[1, [0, 1, 3]]])
    elif scale is not None and tie is not None:
        sx, sy = np.asarray(scale, np.float64)[:2]
        column, row, _, x, y = np.asarray(tie, np.float64)[:5]
        affine = np.array([[sx, 0.0, x - column * sx], [0.0, -sy, y + row * sy]])
    else:
        raise SchemaError(f"{path}: not georeferenced (no pixel scale and tie point); save it anew as a GeoTIFF")
    affine[:, 2] += affine[:, :2] @ np.array([shift, shift])
    return affine


def _geo_keys(directory: object) -> dict[int, int]:
    """The short values of a GeoKeyDirectory."""
    values = np.asarray(directory, np.int64).ravel()
    rows = values[4 : 4 + (len(values) - 4) // 4 * 4].reshape(-1, 4) if len(values) >= 8 else np.zeros((0, 4), np.int64)
    return {int(key): int(value) for key, place, _, value in rows if place == 0}


def _samples(raster: _Raster, path: Path, frame: LocalFrame, reach: float) -> HeightSamples:
    """Cut the window out of the raster and bring its grid points into the local frame."""
    to_raster = Transformer.from_crs("EPSG:4326", raster.crs, always_xy=True)
    side = np.linspace(-reach, reach, 9)
    ring = np.array([(x, y) for x in side for y in side])
    lat, lon = frame.to_geodetic(ring)
    x, y = to_raster.transform(lon, lat)
    inverse = np.linalg.inv(raster.affine[:, :2])
    pixels = (np.stack([x, y], axis=1) - raster.affine[:, 2]) @ inverse.T
    rows, columns = raster.heights.shape
    first = np.floor(pixels.min(0)).astype(int) - 2
    last = np.ceil(pixels.max(0)).astype(int) + 3
    c0, r0 = max(first[0], 0), max(first[1], 0)
    c1, r1 = min(last[0], columns), min(last[1], rows)
    missing = (pixels < -1).any() or (pixels[:, 0] > columns).any() or (pixels[:, 1] > rows).any()
    if c0 >= c1 or r0 >= r1 or missing:
        raise EmptyInputError(
            f"{path}: does not cover the {2 * reach:.0f} m square around {frame.lat}, {frame.lon}; "
            "give the elevation tile of this place, or leave it out for flat ground"
        )
    cut = raster.heights[r0:r1, c0:c1]
    grid = np.stack(np.meshgrid(np.arange(c0, c1), np.arange(r0, r1)), axis=-1).reshape(-1, 2)
    places = grid @ raster.affine[:, :2].T + raster.affine[:, 2]
    lon, lat = to_raster.transform(places[:, 0], places[:, 1], direction="INVERSE")
    xy = frame.to_enu(lat, lon)
    heights = cut.ravel().astype(np.float64)
    good = np.isfinite(heights) & (heights > _VOID_BELOW) & (heights < 9000.0)
    if good.sum() < 3:
        raise EmptyInputError(
            f"{path}: no heights (all void) around {frame.lat}, {frame.lon}; give another elevation file"
        )
    shape = (r1 - r0, c1 - c0, 2)
    across = np.diff(xy.reshape(shape), axis=1).reshape(-1, 2)
    along = np.diff(xy.reshape(shape), axis=0).reshape(-1, 2)
    spacing = float(max(np.median(np.hypot(*across.T)), np.median(np.hypot(*along.T))))
    points = np.concatenate([xy[good], heights[good, None]], axis=1)
    return HeightSamples(points, spacing, path.name, sha256(path.read_bytes()).hexdigest())
