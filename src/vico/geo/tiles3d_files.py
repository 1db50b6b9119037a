"""Files of a 3D tileset: where they come from, what they hold, and where their tiles lie.

A tileset is a folder, an archive read in place, or on a server. Files of b3dm, cmpt and glb are taken apart, everything
else is named. Bounding volumes are held against the wanted window.
"""

from __future__ import annotations

import json
import math
import os
import posixpath
import struct
import tarfile
import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol
from urllib.parse import parse_qsl, unquote, urlencode, urljoin, urlsplit, urlunsplit

import numpy as np
from numpy.typing import NDArray
from pyproj import CRS, Transformer
from pyproj.exceptions import CRSError

from vico.errors import InputError, MissingFileError, SchemaError
from vico.geo.frame import LocalFrame
from vico.io.http import HttpClient

# In a legacy b3dm header the field read as a table's length is the start of the next section: '{"' or 'glTF'.
_TEXT = 0x22000000
_MOST_NESTED = 4
_MOST_INNER = 10_000
_MOST_UNPACKED = 1 << 30
_UNREAD = {b"i3dm": "instanced models (i3dm)", b"pnts": "a point cloud (pnts)", b"vctr": "vector data (vctr)"}
_COMPONENTS = {
    "BYTE": "<i1",
    "UNSIGNED_BYTE": "<u1",
    "SHORT": "<i2",
    "UNSIGNED_SHORT": "<u2",
    "INT": "<i4",
    "UNSIGNED_INT": "<u4",
    "FLOAT": "<f4",
    "DOUBLE": "<f8",
}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


@dataclass(frozen=True)
class TileContent:
    """The model in a tile's file.

    Attributes
    ----------
    model
        A glTF file, binary or text.
    centre
        RTC_CENTER of the feature table: what is added to positions turned z up, before the tile's transform; zeros
        without.
    batch
        The batch table, by column: one value a feature.
    """

    model: bytes
    centre: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))
    batch: dict[str, list[Any]] = field(default_factory=dict)


@dataclass(frozen=True)
class TileFile:
    """A tile's file taken apart.

    Attributes
    ----------
    tileset
        The document, if the file is another tileset.
    models
        The models it holds.
    left_out
        Why what else it holds is not read.
    """

    tileset: dict[str, Any] | None = None
    models: tuple[TileContent, ...] = ()
    left_out: tuple[str, ...] = ()


def read_tile_file(data: bytes, where: str) -> TileFile:
    """Take a tile's file apart by what it says it is, whatever its name.

    Raises
    ------
    SchemaError
        If it is damaged or of no known kind.
    """
    try:
        return _taken_apart(_gunzip(data, where), where, 0)
    except (struct.error, ValueError, KeyError, IndexError, TypeError, AttributeError, OverflowError) as error:
        if isinstance(error, SchemaError):
            raise
        raise SchemaError(f"{where}: damaged ({' '.join(str(error).split())[:100]}); download it again") from None
    except RecursionError:
        raise SchemaError(f"{where}: JSON nested too deeply; export it anew") from None


def _gunzip(data: bytes, where: str) -> bytes:
    """Return the bytes, without the gzip that some exporters wrap every file in."""
    if data[:2] != b"\x1f\x8b":
        return data
    unpacker = zlib.decompressobj(wbits=31)
    try:
        plain = unpacker.decompress(data, _MOST_UNPACKED)
    except zlib.error as error:
        raise SchemaError(f"{where}: broken gzip ({error}); download it again") from None
    if not unpacker.eof:
        raise SchemaError(f"{where}: gzip that is truncated or unpacks to too much; download it again")
    return plain


def _taken_apart(data: bytes, where: str, depth: int) -> TileFile:
    magic = data[:4]
    if magic == b"glTF":
        return TileFile(models=(TileContent(data),))
    if magic == b"b3dm":
        return TileFile(models=(_b3dm(data, where),))
    if magic == b"cmpt":
        return _cmpt(data, where, depth)
    if magic in _UNREAD:
        return TileFile(left_out=(f"{_UNREAD[magic]} are not read",))
    if data.lstrip(b"\xef\xbb\xbf \t\r\n")[:1] == b"{":
        document = json.loads(data.removeprefix(b"\xef\xbb\xbf"))
        if isinstance(document.get("root"), dict):
            return TileFile(tileset=document)
        if "meshes" in document or "scenes" in document:
            return TileFile(models=(TileContent(data),))
        raise SchemaError(f"{where}: JSON that is neither a tileset nor glTF; check the address")
    raise SchemaError(f"{where}: begins with {magic!r}, which is no 3D tile; check the address")


def _length(data: bytes, where: str) -> int:
    """Return the length a tile's header claims, which the file must have."""
    if len(data) < 12:
        raise SchemaError(f"{where}: truncated after {len(data)} bytes; download it again")
    version, length = struct.unpack_from("<II", data, 4)
    if version != 1:
        raise SchemaError(f"{where}: {data[:4].decode()} version {version}; only version 1 is read")
    if not 12 <= length <= len(data):
        raise SchemaError(f"{where}: truncated at byte {len(data):,} of {length:,}; download it again")
    return int(length)


def _cmpt(data: bytes, where: str, depth: int) -> TileFile:
    length = _length(data, where)
    (count,) = struct.unpack_from("<I", data, 12)
    if depth >= _MOST_NESTED or count > _MOST_INNER:
        raise SchemaError(f"{where}: composite of {count:,} tiles, {depth + 1} deep; that is too many")
    models: list[TileContent] = []
    left_out: list[str] = []
    at = 16
    for k in range(count):
        inner = data[at:length]
        if inner[:4] == b"glTF" and len(inner) >= 12:
            (size,) = struct.unpack_from("<I", inner, 8)
        else:
            size = _length(inner, f"{where}, part {k}")
        part = _taken_apart(inner[:size], f"{where}, part {k}", depth + 1)
        models += part.models
        left_out += part.left_out
        at += max(size, 12)
    return TileFile(models=tuple(models), left_out=tuple(left_out))


def _b3dm(data: bytes, where: str) -> TileContent:
    length = _length(data, where)
    if length < 28:
        raise SchemaError(f"{where}: a b3dm of {length} bytes holds nothing; download it again")
    feature_json, feature_binary, batch_json, batch_binary = struct.unpack_from("<IIII", data, 12)
    at, count = 28, 0
    if batch_json >= _TEXT:  # header of 20 bytes: batch length, batch table
        count, batch_json, at = feature_json, feature_binary, 20
        feature_json = feature_binary = batch_binary = 0
    elif batch_binary >= _TEXT:  # header of 24 bytes: batch table as text, as binary, batch length
        count, batch_json, batch_binary, at = batch_json, feature_json, feature_binary, 24
        feature_json = feature_binary = 0
    ends = np.cumsum([at, feature_json, feature_binary, batch_json, batch_binary]).tolist()
    if ends[-1] > length:
        raise SchemaError(f"{where}: its tables leave the file (byte {ends[-1]:,} of {length:,}); download it again")
    start, centre_at, batch_at, columns_at, model_at = ends
    features, batch = data[start:centre_at], data[batch_at:columns_at]
    centre = np.zeros(3)
    if features.strip():
        table = json.loads(features)
        count = int(table.get("BATCH_LENGTH", count))
        said = table.get("RTC_CENTER")
        if isinstance(said, dict):
            said = struct.unpack_from("<fff", data[centre_at:batch_at], said["byteOffset"])
        if said is not None:
            centre = np.asarray(said, np.float64)
            if centre.shape != (3,) or not np.isfinite(centre).all():
                raise SchemaError(f"{where}: RTC_CENTER is no point; export it anew")
    columns = _columns(json.loads(batch), data[columns_at:model_at], count, where) if batch.strip() else {}
    return TileContent(data[model_at:length], centre, columns)


def _columns(table: dict[str, Any], binary: bytes, count: int, where: str) -> dict[str, list[Any]]:
    """Return the columns of a batch table, those in its binary part too."""
    columns: dict[str, list[Any]] = {}
    for name, value in table.items():
        if isinstance(value, list):
            columns[name] = value
        elif isinstance(value, dict) and "byteOffset" in value:
            width = _WIDTHS[value["type"]]
            kind = np.dtype(_COMPONENTS[value["componentType"]])
            start = value["byteOffset"]
            if start < 0 or count < 0 or start + count * width * kind.itemsize > len(binary):
                raise SchemaError(f"{where}: batch table column {name!r} leaves the table; download it again")
            values = np.frombuffer(binary, kind, count * width, start)
            columns[name] = (values if width == 1 else values.reshape(count, width)).tolist()
    return columns


GOOGLE = "https://tile.googleapis.com/v1/3dtiles/root.json"
"""Google's Photorealistic 3D Tiles. Their terms forbid keeping them: nothing of theirs is ever written to disk."""

GOOGLE_KEY = "VICO_GOOGLE_KEY"
"""The environment variable with the user's key."""

MOST_BYTES = 256 << 20
_MOST_ARCHIVE = 4 << 30
_MOST_MEMBERS = 200_000
_ARCHIVES = (".tar", ".tar.gz", ".tgz", ".zip", ".3tz")


class TileSource(Protocol):
    """Gives files by address."""

    @property
    def root(self) -> str:
        """Address of the outermost tileset."""

    def resolve(self, uri: str, base: str) -> str:
        """Return the address that `uri` means in the file at `base`; InputError if it leads out of the tileset."""

    def get(self, address: str) -> bytes:
        """Return the file's bytes; a `VicoError` if there are none."""

    def name(self, address: str) -> str:
        """Return what to call it in reports: no key, no session."""


def tile_source(source: str | Path, *, web: HttpClient | None = None, key: str | None = None) -> TileSource:
    """Return the source a user names.

    Parameters
    ----------
    source
        ``google``; an http or https address of a tileset; a folder with a ``tileset.json``, or its path; or a
        ``.tar``, ``.tar.gz``, ``.zip`` or ``.3tz`` with one inside (read in place, never extracted).
    web
        Client for addresses; one without a cache by default.
    key
        For Google's tiles; by default what the environment variable ``VICO_GOOGLE_KEY`` holds.

    Raises
    ------
    InputError, MissingFileError, SchemaError
        If there is no such source, or its key is missing.
    """
    text = str(source)
    if text == "google":
        text = GOOGLE
    if "://" in text:
        return _Server(text, web or HttpClient(), key)
    path = Path(source)
    if path.is_dir():
        path = path / "tileset.json"
    if not path.is_file():
        raise MissingFileError(f"{path}: no such tileset; give a folder with a tileset.json, an archive or an address")
    return _Archive(path) if path.name.lower().endswith(_ARCHIVES) else _Folder(path)


def _inside(uri: str, base: str) -> str:
    """Return a relative address within a folder, resolved and kept there."""
    parts = urlsplit(uri)
    path = unquote(parts.path)
    if parts.scheme or parts.netloc:
        raise InputError("leads to another host; a local tileset must hold its own files")
    if not path or path.startswith(("/", "\\")) or "\\" in path or "\0" in path or ":" in path:
        raise InputError("is no relative path")
    joined = posixpath.normpath(posixpath.join(posixpath.dirname(base), path))
    if joined == ".." or joined.startswith("../"):
        raise InputError("leads out of the tileset's folder")
    return joined


class _Folder:
    """A tileset in a folder."""

    def __init__(self, path: Path) -> None:
        self.folder = path.parent.resolve()
        self.root = path.name

    def resolve(self, uri: str, base: str) -> str:
        address = _inside(uri, base)
        # A link may lead out where the path does not.
        if not (self.folder / address).resolve().is_relative_to(self.folder):
            raise InputError("leads out of the tileset's folder")
        return address

    def get(self, address: str) -> bytes:
        path = self.folder / address
        try:
            size = path.stat().st_size
            if not path.is_file():
                raise MissingFileError(f"{self.name(address)}: no such file")
            if size > MOST_BYTES:
                raise SchemaError(f"{self.name(address)}: {size:,} bytes are too many for a tile")
            return path.read_bytes()
        except (OSError, ValueError) as error:
            if isinstance(error, MissingFileError | SchemaError):
                raise
            raise MissingFileError(f"{self.name(address)}: no such file") from None

    def name(self, address: str) -> str:
        return address


class _Archive:
    """A tileset in an archive, read into memory: nothing is written, so no name in it can do harm."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.files: dict[str, bytes] = {}
        self.total = 0
        try:
            if path.name.lower().endswith((".zip", ".3tz")):
                self._unzip()
            else:
                self._untar()
        except (tarfile.TarError, zipfile.BadZipFile, EOFError, OSError, RuntimeError, NotImplementedError) as error:
            raise SchemaError(f"{path}: broken archive ({str(error)[:80]}); download it again") from None
        except ValueError as error:
            if isinstance(error, SchemaError):
                raise
            raise SchemaError(f"{path}: broken archive ({str(error)[:80]}); download it again") from None
        roots = sorted(
            (n for n in self.files if posixpath.basename(n) == "tileset.json"), key=lambda n: (n.count("/"), n)
        )
        if not roots:
            raise SchemaError(f"{path}: holds no tileset.json; give an archive of a 3D tileset")
        self.root = roots[0]

    def _add(self, name: str, size: int) -> bool:
        """Whether a member is wanted: a plain file with a plain path, within what memory is meant to hold."""
        self.total += size
        if self.total > _MOST_ARCHIVE or len(self.files) >= _MOST_MEMBERS:
            raise SchemaError(f"{self.path}: unpacks to too much; unpack it yourself and give the folder")
        return size <= MOST_BYTES and not name.startswith(("/", "../"))

    def _untar(self) -> None:
        with tarfile.open(self.path, "r:*") as archive:
            for member in archive:
                name = posixpath.normpath(member.name)
                if member.isfile() and self._add(name, member.size):
                    file = archive.extractfile(member)
                    if file is not None:
                        self.files[name] = file.read()

    def _unzip(self) -> None:
        with zipfile.ZipFile(self.path) as archive:
            for entry in archive.infolist():
                name = posixpath.normpath(entry.filename)
                if not entry.is_dir() and self._add(name, entry.file_size):
                    with archive.open(entry) as file:
                        # One byte more than claimed: a member that lies about its size is found out, not unpacked.
                        content = file.read(entry.file_size + 1)
                    if len(content) == entry.file_size:
                        self.files[name] = content

    def resolve(self, uri: str, base: str) -> str:
        return _inside(uri, base)

    def get(self, address: str) -> bytes:
        try:
            return self.files[address]
        except KeyError:
            raise MissingFileError(f"{address}: no such file in {self.path.name}") from None

    def name(self, address: str) -> str:
        return address


class _Server:
    """A tileset on a server; Google's protocol where the address is Google's.

    Google: the first answer's child address carries ``session``; every later request repeats it together with ``key``.
    """

    def __init__(self, url: str, web: HttpClient, key: str | None) -> None:
        parts = urlsplit(url)
        if parts.scheme not in ("http", "https") or not parts.hostname:
            raise InputError(f"{parts.scheme}://{parts.hostname or ''}: tiles come from http or https addresses only")
        self.web = web
        self.host = (parts.scheme, parts.netloc)
        said = dict(parse_qsl(parts.query))
        self.google = parts.path.startswith("/v1/3dtiles/")
        # Without an argument the key goes to Google alone, whatever address somebody wrote into a script.
        if key is None and self.google and parts.hostname == "tile.googleapis.com":
            key = said.get("key") or os.environ.get(GOOGLE_KEY)
            if not key:
                raise InputError(
                    f"Google's 3D tiles need a key of yours: put it into the environment variable {GOOGLE_KEY}"
                )
        self.repeated = {**({} if self.google else said), **({"key": key} if key else {})}
        if self.google and "key" in said:
            self.repeated.setdefault("key", said["key"])
        self.root = urlunsplit((parts.scheme, parts.netloc, parts.path, "", ""))

    def resolve(self, uri: str, base: str) -> str:
        address = urljoin(base, uri)
        parts = urlsplit(address)
        # A foreign tileset must not send us, or the user's key, wherever it likes.
        if (parts.scheme, parts.netloc) != self.host:
            raise InputError("leads to another host, which is not followed")
        query = dict(parse_qsl(parts.query))
        if self.google and "session" in query:
            self.repeated["session"] = query.pop("session")
        query.pop("key", None)
        return urlunsplit((parts.scheme, parts.netloc, parts.path, urlencode(query), ""))

    def get(self, address: str) -> bytes:
        parts = urlsplit(address)
        query = {**self.repeated, **dict(parse_qsl(parts.query))}
        plain = urlunsplit((parts.scheme, parts.netloc, parts.path, "", ""))
        return self.web.get(plain, params=query, cached=not self.google, max_bytes=MOST_BYTES)

    def name(self, address: str) -> str:
        return urlsplit(address).path


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
