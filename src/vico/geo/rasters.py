"""Height grids in files: GeoTIFF and SRTM's HGT, of which only the part that is wanted is unpacked."""

from __future__ import annotations

import gzip
import io
import logging
import math
import re
import struct
import warnings
import zipfile
import zlib
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import Protocol

import numpy as np
import tifffile
from numpy.typing import NDArray
from PIL import Image
from pyproj import CRS
from pyproj.exceptions import CRSError

from vico.errors import InputError, MissingFileError, SchemaError

# SRTM's two grids: 3 and 1 arc seconds. A zip that claims another size is not a tile, whatever it unpacks to.
_HGT_SIDES = {1201 * 1201 * 2: 1201, 3601 * 3601 * 2: 3601}
_HGT_NAME = re.compile(r"([NS])(\d{2})([EW])(\d{3})", re.IGNORECASE)
_MOST_PIXELS = 200_000_000
_FEET = {9002: 0.3048, 9003: 1200 / 3937}
# GDAL's words for a band's unit, without what is no letter.
_UNITS = {
    **dict.fromkeys(("m", "metre", "metres", "meter", "meters"), 1.0),
    **dict.fromkeys(("ft", "foot", "feet", "internationalfoot"), 0.3048),
    **dict.fromkeys(("ftus", "usft", "ussurveyfoot", "footus", "ussurveyfeet"), 1200 / 3937),
    **dict.fromkeys(("dm", "decimetre", "decimeter"), 0.1),
    **dict.fromkeys(("cm", "centimetre", "centimeter", "centimetres", "centimeters"), 0.01),
    **dict.fromkeys(("mm", "millimetre", "millimeter", "millimetres", "millimeters"), 0.001),
}
_ITEM = re.compile(r"<Item\b([^<>]*)>([^<]*)</Item>", re.IGNORECASE)
_ATTRIBUTE = re.compile(r"(\w+)\s*=\s*[\"']([^\"']*)[\"']")
_MOST_METADATA = 1 << 16  # characters
_DEFLATE, _BY_PILLOW = (8, 32946), {5: "LZW", 32773: "PackBits"}


class Pixels(Protocol):
    """A grid of heights, read piece by piece."""

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        ...

    def read(self, r0: int, r1: int, c0: int, c1: int) -> NDArray[np.float64]:
        """Metres of rows `r0` to `r1` and columns `c0` to `c1`, ends excluded; NaN where there is no data."""
        ...


@dataclass(frozen=True)
class Raster:
    """Heights on a grid; pixel (row, column) has its centre at ``affine @ (column, row, 1)`` in `crs`."""

    pixels: Pixels
    affine: NDArray[np.float64]
    crs: CRS


def read_raster(path: Path) -> Raster:
    """Open a file of heights.

    Parameters
    ----------
    path
        GeoTIFF (``.tif``, ``.tiff``), ``.hgt``, ``.hgt.gz`` or a ``.zip`` with one ``.hgt``.

    Raises
    ------
    MissingFileError, InputError
        If there is no such file, or it is of another kind.
    SchemaError
        If it is broken, too large, or not georeferenced.
    """
    if not path.is_file():
        raise MissingFileError(
            f"{path}: no such elevation file; give a GeoTIFF or HGT, or leave it out for flat ground"
        )
    name = path.name.lower()
    if name.endswith((".tif", ".tiff")):
        return _geotiff(path)
    if name.endswith(".hgt"):
        size = path.stat().st_size
        content = path.read_bytes() if size in _HGT_SIDES else b""
        return _hgt(content, path.name, path, size)
    if name.endswith(".hgt.gz"):
        most = max(_HGT_SIDES) + 1
        try:
            with gzip.open(path) as file:
                content = file.read(most)
        except (OSError, EOFError, zlib.error) as error:
            raise SchemaError(f"{path}: broken gzip file ({error}); download it again") from None
        return _hgt(content, path.name, path, len(content))
    if name.endswith(".zip"):
        return _zipped_hgt(path)
    raise InputError(
        f"{path}: not an elevation file by its name; it must end in .tif, .tiff, .hgt, .hgt.gz, .zip (of an .hgt), "
        ".laz or .las"
    )


@dataclass(frozen=True)
class GridArray:
    """Heights in memory, metres, shape ``(rows, columns)``."""

    heights: NDArray[np.generic]

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.heights.shape[0], self.heights.shape[1]

    def read(self, r0: int, r1: int, c0: int, c1: int) -> NDArray[np.float64]:
        """Metres of rows `r0` to `r1` and columns `c0` to `c1`, ends excluded."""
        return self.heights[r0:r1, c0:c1].astype(np.float64)


def _hgt(content: bytes, name: str, path: Path, size: int) -> Raster:
    match = _HGT_NAME.search(name)
    south, west = 90, 180
    if match:
        hemisphere, lat, half, lon = match.groups()
        south = int(lat) * (1 if hemisphere.upper() == "N" else -1)
        west = int(lon) * (1 if half.upper() == "E" else -1)
    if not (-90 <= south < 90 and -180 <= west < 180):
        raise InputError(f"{path}: {name} does not say which tile it is; HGT files are named like N43E007.hgt")
    side = _HGT_SIDES.get(size)
    if side is None or len(content) != size:
        raise SchemaError(f"{path}: {name} has {size:,} bytes, no HGT tile has; download it again")
    step = 1.0 / (side - 1)
    heights = np.frombuffer(content, ">i2").reshape(side, side)
    affine = np.array([[step, 0.0, west], [0.0, -step, south + 1.0]])
    return Raster(GridArray(heights), affine, CRS.from_epsg(4326))


def _zipped_hgt(path: Path) -> Raster:
    try:
        with zipfile.ZipFile(path) as archive:
            tiles = [entry for entry in archive.infolist() if entry.filename.lower().endswith(".hgt")]
            if len(tiles) != 1:
                raise SchemaError(f"{path}: holds {len(tiles)} .hgt files; it must hold exactly one")
            size = tiles[0].file_size
            if size not in _HGT_SIDES:
                raise SchemaError(f"{path}: {tiles[0].filename} claims {size:,} bytes, no HGT tile has")
            with archive.open(tiles[0]) as file:
                # One byte more than claimed: a member that lies about its size is found out, not unpacked.
                content = file.read(size + 1)
    except SchemaError:
        raise
    except (
        zipfile.BadZipFile,
        zlib.error,
        EOFError,
        NotImplementedError,
        RuntimeError,
        OSError,
        ValueError,
        struct.error,
    ) as error:
        raise SchemaError(f"{path}: broken zip file ({error}); download it again") from None
    return _hgt(content, Path(tiles[0].filename).name, path, len(content))


@dataclass(frozen=True)
class _Tiff:
    """One band of a TIFF; its strips or tiles are read when they are asked for."""

    path: Path
    shape: tuple[int, int]
    block: tuple[int, int]
    tiled: bool
    dtype: np.dtype[np.generic]
    compression: int
    predictor: int
    reversed_bits: bool
    offsets: tuple[int, ...]
    counts: tuple[int, ...]
    void: float | None
    scale: float
    offset: float

    def read(self, r0: int, r1: int, c0: int, c1: int) -> NDArray[np.float64]:
        found = np.full((r1 - r0, c1 - c0), np.nan)
        high, wide = self.block
        across = -(-self.shape[1] // wide)
        with self.path.open("rb") as file:
            for row in range(r0 // high, -(-r1 // high)):
                for column in range(c0 // wide, -(-c1 // wide)):
                    values = self._block(file, row * across + column, row)
                    top, left = row * high, column * wide
                    a, b = max(r0, top), min(r1, top + len(values))
                    c, d = max(c0, left), min(c1, left + wide)
                    found[a - r0 : b - r0, c - c0 : d - c0] = values[a - top : b - top, c - left : d - left]
        return found

    def _block(self, file: io.BufferedReader, index: int, row: int) -> NDArray[np.float64]:
        """Return the heights of one strip or tile."""
        high, wide = self.block
        rows = high if self.tiled else min(high, self.shape[0] - row * high)
        if self.counts[index] == 0 or self.offsets[index] == 0:
            return np.full((rows, wide), np.nan)  # GDAL leaves out blocks without data
        expected = rows * wide * self.dtype.itemsize
        file.seek(self.offsets[index])
        packed = file.read(min(self.counts[index], 2 * expected + (1 << 16)))
        if self.compression == 1:
            raw = packed
        elif self.compression in _DEFLATE:
            raw = zlib.decompressobj().decompress(packed, expected)
        else:
            raw = _by_pillow(packed, rows, wide * self.dtype.itemsize, self.compression, self.reversed_bits)
        if len(raw) < expected:
            raise SchemaError(
                f"{self.path}: block {index} holds {len(raw):,} of {expected:,} bytes: the file is truncated or "
                "broken; download it again"
            )
        values = _undo_predictor(raw[:expected], rows, wide, self.dtype, self.predictor)
        heights = values.astype(np.float64)
        if self.void is not None:
            heights[values == np.asarray(self.void).astype(values.dtype)] = np.nan
        return heights * self.scale + self.offset


class _Tag(IntEnum):
    """Fields of a TIFF's directory."""

    WIDTH = 256
    LENGTH = 257
    BITS_PER_SAMPLE = 258
    COMPRESSION = 259
    BLACK_IS_ZERO = 262
    FILL_ORDER = 266
    STRIP_OFFSET = 273
    SAMPLES_PER_PIXEL = 277
    ROWS_PER_STRIP = 278
    STRIP_BYTES = 279


def _by_pillow(packed: bytes, rows: int, width: int, compression: int, reversed_bits: bool) -> bytes:
    """Unpack one block with Pillow's TIFF reader, as a picture of bytes: the base install has no other LZW."""
    values = {
        _Tag.WIDTH: width,
        _Tag.LENGTH: rows,
        _Tag.BITS_PER_SAMPLE: 8,
        _Tag.COMPRESSION: compression,
        _Tag.BLACK_IS_ZERO: 1,
        _Tag.STRIP_OFFSET: 0,
        _Tag.SAMPLES_PER_PIXEL: 1,
        _Tag.ROWS_PER_STRIP: rows,
        _Tag.STRIP_BYTES: len(packed),
    }
    if reversed_bits:
        values[_Tag.FILL_ORDER] = 2
    values[_Tag.STRIP_OFFSET] = 8 + 2 + 12 * len(values) + 4
    entries = b"".join(struct.pack("<HHII", tag, 4, 1, values[tag]) for tag in sorted(values))
    content = b"II*\0" + struct.pack("<IH", 8, len(values)) + entries + bytes(4) + packed
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the size was checked before; Pillow knows of pictures only
        with Image.open(io.BytesIO(content), formats=("TIFF",)) as picture:
            return picture.tobytes()


def _undo_predictor(
    raw: bytes, rows: int, wide: int, dtype: np.dtype[np.generic], predictor: int
) -> NDArray[np.generic]:
    """Undo TIFF's predictors: differences between neighbours (2), or between bytes of floats sorted by place (3)."""
    if predictor == 3:
        planes = np.cumsum(np.frombuffer(raw, np.uint8).reshape(rows, -1), axis=1, dtype=np.uint8)
        big = planes.reshape(rows, dtype.itemsize, wide).transpose(0, 2, 1)
        return np.ascontiguousarray(big).view(dtype.newbyteorder(">"))[..., 0]
    values = np.frombuffer(raw, dtype).reshape(rows, wide)
    if predictor != 2:
        return values
    unsigned = values.view(dtype.newbyteorder("=") if dtype.byteorder == "|" else dtype)
    whole = np.dtype(f"u{dtype.itemsize}").newbyteorder(dtype.byteorder)
    sums = np.cumsum(unsigned.view(whole), axis=1, dtype=np.dtype(f"u{dtype.itemsize}"))
    return sums.view(dtype.newbyteorder("="))


def _geotiff(path: Path) -> Raster:
    log = logging.getLogger("tifffile")  # it tells of each bad tag; we tell of the file, once
    silent, log.disabled = log.disabled, True
    try:
        with tifffile.TiffFile(path) as file:
            page = file.pages[0]
            if not isinstance(page, tifffile.TiffPage) or len(page.shape) != 2:
                raise SchemaError(f"{path}: shape {page.shape}; an elevation GeoTIFF has one band")
            tags = {tag.code: tag.value for tag in page.tags}
            raster = Raster(
                crs=_crs(tags, path), affine=_affine(tags, path), pixels=_tiff(page, file.byteorder, tags, path)
            )
    except SchemaError:
        raise
    except Exception as error:  # tifffile meets hostile tags with whatever its arithmetic raises
        words = " ".join(str(error).split())[:200]
        raise SchemaError(
            f"{path}: not a readable GeoTIFF ({type(error).__name__}: {words}); save it anew, deflated or uncompressed"
        ) from None
    finally:
        log.disabled = silent
    return raster


def _tiff(page: tifffile.TiffPage, order: str, tags: dict[int, object], path: Path) -> _Tiff:
    compression, predictor = int(page.compression), int(page.predictor)
    if compression not in (1, *_DEFLATE, *_BY_PILLOW):
        raise SchemaError(
            f"{path}: compressed by {getattr(page.compression, 'name', compression)}, which is not read here; save it "
            "anew with: gdal_translate -co COMPRESS=DEFLATE FILE NEW.tif"
        )
    dtype = page.dtype
    if dtype is None or dtype.kind not in "iuf" or page.bitspersample != 8 * dtype.itemsize:
        raise SchemaError(f"{path}: {page.bitspersample} bits a pixel are no heights; save it anew as Float32")
    if predictor not in (1, 2, 3) or (predictor == 3) != (predictor == 3 and dtype.kind == "f"):
        raise SchemaError(f"{path}: predictor {predictor} of {dtype} is unknown; save it anew without one")
    rows, columns = int(page.imagelength), int(page.imagewidth)
    block = (
        (int(page.tilelength), int(page.tilewidth))
        if page.is_tiled
        else (min(int(page.rowsperstrip) or rows, rows), columns)
    )
    if min(*block, rows, columns) < 1 or block[0] * block[1] > _MOST_PIXELS:
        raise SchemaError(f"{path}: blocks of {block[1]} x {block[0]} pixels are too many; clip it to the place first")
    offsets, counts = tuple(map(int, page.dataoffsets)), tuple(map(int, page.databytecounts))
    blocks = -(-rows // block[0]) * -(-columns // block[1])
    if len(offsets) < blocks or len(counts) < blocks:
        raise SchemaError(f"{path}: lists {len(offsets):,} of {blocks:,} blocks; download it again")
    void = tags.get(42113)
    try:
        nothing = None if void is None else float(str(void).strip("\0 "))
    except ValueError:
        raise SchemaError(f"{path}: nodata value {str(void)[:40]!r} is not a number") from None
    if nothing is not None and dtype.kind in "iu":
        limits = np.iinfo(dtype)
        if not (math.isfinite(nothing) and limits.min <= nothing <= limits.max):
            nothing = None  # no pixel can have it
    scale, offset = _scale(tags, path)
    return _Tiff(
        path,
        (rows, columns),
        block,
        bool(page.is_tiled),
        dtype.newbyteorder(order),
        compression,
        predictor,
        int(page.fillorder) == 2,
        offsets,
        counts,
        nothing,
        scale,
        offset,
    )


def _scale(tags: dict[int, object], path: Path) -> tuple[float, float]:
    """Return metres a count and metres of count 0, as GDAL's metadata of the first band and the CRS's unit say."""
    said = {"scale": "1", "offset": "0", "unittype": ""}
    for attributes, value in _ITEM.findall(str(tags.get(42112, ""))[:_MOST_METADATA]):
        words = {key.lower(): text for key, text in _ATTRIBUTE.findall(attributes)}
        role = words.get("role", "").lower()
        if role in said and words.get("sample", "0") == "0":
            said[role] = value.strip()
    try:
        scale, offset = float(said["scale"]), float(said["offset"])
    except ValueError:
        scale, offset = math.nan, math.nan
    if not (math.isfinite(scale) and math.isfinite(offset) and scale != 0.0):
        raise SchemaError(
            f"{path}: its band's scale {said['scale'][:20]!r} and offset {said['offset'][:20]!r} are no numbers to "
            "count with; set them with: gdal_edit.py -a_scale 1 -a_offset 0 FILE"
        )
    vertical = _FEET.get(_geo_keys(tags.get(34735, ())).get(4099, 0), 1.0)
    unit = _UNITS.get(re.sub(r"[\W_]+", "", said["unittype"].casefold()), vertical)
    return scale * unit, offset * unit


def _crs(tags: dict[int, object], path: Path) -> CRS:
    keys = _geo_keys(tags.get(34735, ()))
    code = keys.get(3072) or keys.get(2048)
    if not code or code == 32767:
        raise SchemaError(f"{path}: no EPSG code of its coordinates; save it anew with one, such as EPSG:4326")
    try:
        return CRS.from_epsg(code)
    except CRSError:
        raise SchemaError(f"{path}: EPSG:{code} is not a coordinate system known here") from None


def _affine(tags: dict[int, object], path: Path) -> NDArray[np.float64]:
    # Area: the tie point is the pixel's corner, half a pixel off its centre. Point: it is the centre.
    shift = 0.0 if _geo_keys(tags.get(34735, ())).get(1025) == 2 else 0.5
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
    sides = np.hypot(*affine[:, :2])
    if not np.isfinite(affine).all() or abs(np.linalg.det(affine[:, :2])) <= 1e-6 * float(np.prod(sides)):
        raise SchemaError(f"{path}: its georeferencing is degenerate (pixels without extent); save it anew")
    return affine


def _geo_keys(directory: object) -> dict[int, int]:
    """Return the short values of a GeoKeyDirectory."""
    values = np.asarray(directory, np.int64).ravel()
    rows = values[4 : 4 + (len(values) - 4) // 4 * 4].reshape(-1, 4) if len(values) >= 8 else np.zeros((0, 4), np.int64)
    return {int(key): int(value) for key, place, _, value in rows if place == 0}
