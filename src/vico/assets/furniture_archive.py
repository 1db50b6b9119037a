"""The furniture archives of the Debian package `sweethome3d-furniture`: found, read out of a .deb, listed; OBJ files.

An archive (``.sh3f``) is a zip with a list of properties and, for each model, a Wavefront OBJ with its materials and
pictures. Everything is read as untrusted: members by name, sizes capped, nothing extracted to disk and nothing run.
"""

from __future__ import annotations

import hashlib
import io
import lzma
import posixpath
import re
import tarfile
import warnings
import zipfile
from collections.abc import Callable, Container, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path, PurePosixPath
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from vico.assets.packages import IntegrityError
from vico.errors import MissingFileError

SYSTEM_FOLDER = Path("/usr/share/sweethome3d/furniture")
_LARGEST_MEMBER = 64 << 20
_LARGEST_ARCHIVE = 256 << 20
_LISTING = "PluginFurnitureCatalog.properties"
_PROPERTY = re.compile(r"(\w+)#(\d+)\s*=\s*(.*?)\s*$")


@dataclass(frozen=True)
class Collection:
    """The models of one archive, as their licence and credits go.

    Attributes
    ----------
    file
        Name of the archive without its ending.
    licence
        Of every model in it.
    owner
        Whom to name beside a model's creator.
    """

    file: str
    licence: str
    owner: str


COLLECTIONS = {
    "Z": Collection("BlendSwap-CC-0", "CC0-1.0", "Blend Swap"),
    "B": Collection("BlendSwap-CC-BY", "CC-BY-3.0", "Blend Swap"),
    "K": Collection("KatorLegaz", "CC-BY-3.0-US", "Andrew Kator & Jennifer Legaz"),
    "S": Collection("Scopia", "CC-BY-3.0", "eTeks and Scopia Visual Interfaces Systems"),
}


@dataclass(frozen=True)
class ArchiveEntry:
    """A model in the list of an archive.

    Attributes
    ----------
    name
        Its identifier in the archive.
    creator
        Who made it.
    model
        Path of the OBJ in the archive.
    size
        Width, depth, height as the list says, metres.
    rotation
        Row-major 3x3 turn that sets the OBJ upright.
    """

    name: str
    creator: str
    model: str
    size: tuple[float, float, float]
    rotation: tuple[float, ...]


class Archive(AbstractContextManager["Archive"]):
    """One ``.sh3f``.

    Raises
    ------
    IntegrityError
        If it is damaged, or its list is.
    """

    def __init__(self, source: Path | bytes, name: str) -> None:
        self.name = name
        try:
            self._zip = zipfile.ZipFile(io.BytesIO(source) if isinstance(source, bytes) else source)
        except (zipfile.BadZipFile, OSError) as error:
            raise IntegrityError(f"things: {name} is damaged ({error}): install the package again") from None
        self.entries = dict(self._read_entries())

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._zip.close()

    def read(self, path: str) -> bytes:
        """Return a member's bytes.

        Raises
        ------
        IntegrityError
            If there is no such member, or it is larger than any sound one.
        """
        try:
            with self._zip.open(path) as member:
                data = member.read(_LARGEST_MEMBER + 1)
        except KeyError:
            raise IntegrityError(f"things: {self.name} holds no {path}: another version of the package?") from None
        except (zipfile.BadZipFile, OSError, EOFError, NotImplementedError, RuntimeError) as error:
            raise IntegrityError(f"things: {self.name}: {path} is damaged ({error}): install it again") from None
        if len(data) > _LARGEST_MEMBER:
            raise IntegrityError(f"things: {self.name}: {path} is larger than {_LARGEST_MEMBER >> 20} MiB")
        return data

    def _read_entries(self) -> Iterator[tuple[str, ArchiveEntry]]:
        rows: dict[int, dict[str, str]] = {}
        for line in self.read(_LISTING).decode("latin-1").splitlines():
            if found := _PROPERTY.match(line):
                rows.setdefault(int(found[2]), {})[found[1]] = found[3]
        for number, row in rows.items():
            try:
                turn = row.get("modelRotation", "1 0 0 0 1 0 0 0 1").split()
                if len(turn) != 9:
                    raise ValueError("modelRotation has not nine numbers")
                name = row["id"].rsplit("#", 1)[-1]
                size = (float(row["width"]) / 100, float(row["depth"]) / 100, float(row["height"]) / 100)
                model = str(PurePosixPath(row["model"].lstrip("/")))
                yield name, ArchiveEntry(name, row.get("creator", ""), model, size, tuple(float(x) for x in turn))
            except (KeyError, ValueError) as error:
                raise IntegrityError(
                    f"things: {self.name}: model {number} of its list can't be read ({error}): install it again"
                ) from None


def archives(pack: Path) -> dict[str, Archive]:
    """Open the collections we know in a folder of archives or in a Debian package, by `COLLECTIONS`' letters.

    Parameters
    ----------
    pack
        Folder with ``.sh3f`` files, or a ``.deb``.

    Raises
    ------
    MissingFileError
        If there is none of them.
    IntegrityError
        If a file is damaged.
    """
    if not pack.exists():
        raise MissingFileError(f"{pack}: no such file or folder; name a .deb or a folder of .sh3f archives")
    found: dict[str, Archive] = {}
    if pack.is_dir():
        for letter, collection in COLLECTIONS.items():
            path = pack / f"{collection.file}.sh3f"
            if path.is_file():
                found[letter] = Archive(path, path.name)
    else:
        held = _members_of_deb(pack)
        for letter, collection in COLLECTIONS.items():
            if (data := held.get(f"{collection.file}.sh3f")) is not None:
                found[letter] = Archive(data, f"{collection.file}.sh3f")
    if not found:
        wanted = ", ".join(f"{c.file}.sh3f" for c in COLLECTIONS.values())
        raise MissingFileError(f"{pack}: holds none of {wanted}; is it sweethome3d-furniture?")
    return found


def _members_of_deb(path: Path) -> dict[str, bytes]:
    """Return the wanted files of a Debian package (an `ar` file with a compressed tar in it), by base name."""
    wanted = {f"{c.file}.sh3f" for c in COLLECTIONS.values()}
    found: dict[str, bytes] = {}
    try:
        with tarfile.open(fileobj=io.BytesIO(_data_of_deb(path))) as tar:
            for member in tar:
                name = PurePosixPath(member.name).name
                if name in wanted and member.isreg():
                    if member.size > _LARGEST_ARCHIVE:
                        raise IntegrityError(f"{path}: {name} is larger than {_LARGEST_ARCHIVE >> 20} MiB")
                    reader = tar.extractfile(member)
                    if reader is not None:
                        found[name] = reader.read()
    except (tarfile.TarError, lzma.LZMAError, EOFError, OSError) as error:
        raise IntegrityError(f"{path}: a damaged Debian package ({error}): download it again") from None
    return found


def _data_of_deb(path: Path) -> bytes:
    """Return the `data.tar` of a Debian package, still compressed."""
    with path.open("rb") as file:
        if file.read(8) != b"!<arch>\n":
            raise IntegrityError(f"{path}: not a Debian package; name a .deb or a folder of .sh3f archives")
        while len(header := file.read(60)) == 60:
            name = header[:16].decode("latin-1").strip().rstrip("/")
            digits = header[48:58].decode("latin-1").strip()
            if not digits.isdigit() or int(digits) > _LARGEST_ARCHIVE or header[58:] != b"`\n":
                break
            if name.startswith("data.tar"):
                data = file.read(int(digits))
                if len(data) != int(digits):
                    raise IntegrityError(f"{path}: a damaged Debian package (it is cut short): download it again")
                return data
            file.seek(int(digits) + int(digits) % 2, io.SEEK_CUR)
    raise IntegrityError(f"{path}: a Debian package without its data: download it again")


_MOST = 1_000_000  # vertices, and triangles
_MOST_PIXELS = 1 << 25
_CLEAR = (150, 170, 180)  # what glass is drawn like: nothing of ours is see-through
_GREY = (200, 200, 200)  # of a material that says no colour


@dataclass(frozen=True)
class ObjMaterial:
    """A material of an OBJ: sRGB colour 0..255, how opaque it is, and its picture, uint8 ``(h, w, 3 or 4)``."""

    name: str
    colour: tuple[int, int, int]
    opacity: float = 1.0
    picture: NDArray[np.uint8] | None = None


@dataclass(frozen=True)
class ObjMesh:
    """Triangles with a material each, in the file's own axes.

    Attributes
    ----------
    points
        float64, shape ``(n, 3)``.
    faces
        Indices of corners, int64, shape ``(m, 3)``.
    uv
        Texture coordinates of each corner (v = 0 at the picture's foot), float64, shape ``(m, 3, 2)``; NaN where the
        file has none.
    paint
        Number of each triangle's material, int64, shape ``(m,)``.
    paints
        The materials.
    digest
        SHA-256 over all that was read.
    """

    points: NDArray[np.float64]
    faces: NDArray[np.int64]
    uv: NDArray[np.float64]
    paint: NDArray[np.int64]
    paints: tuple[ObjMaterial, ...]
    digest: str


def read_obj(path: str, read: Callable[[str], bytes], *, largest_texture: int = 256) -> ObjMesh:
    """Read an OBJ and what it names.

    Parameters
    ----------
    path
        Of the OBJ, with ``/``; files it names lie beside it or below.
    read
        Gives a file's bytes.
    largest_texture
        Side to which pictures are reduced, texels.

    Raises
    ------
    IntegrityError
        If it is no sound OBJ, is too large, or names files elsewhere.
    """
    seen = hashlib.sha256()

    def content(name: str) -> bytes:
        data = read(name)
        seen.update(hashlib.sha256(data).digest())
        return data

    shape = _Statements()
    for count, line in enumerate(content(path).decode("utf-8", "replace").splitlines(), 1):
        try:
            shape.follow(line)
        except (ValueError, IndexError):
            raise IntegrityError(f"{path}: line {count} can't be read ({line[:40]!r})") from None
        if shape.too_large:
            raise IntegrityError(f"{path}: more than {_MOST:,} vertices or triangles")
    points, uv = shape.arrays(path)
    known: dict[str, ObjMaterial] = {}
    for library in shape.libraries:
        known |= _paints(_beside(path, library), content, largest_texture, shape.materials)
    paints = tuple(known.get(name, ObjMaterial(name, _GREY)) for name in shape.materials)
    return ObjMesh(points, np.array(shape.faces), uv, np.array(shape.worn), paints, seen.hexdigest())


class _Statements:
    """What the lines of an OBJ have stated so far."""

    def __init__(self) -> None:
        self.points: list[tuple[float, ...]] = []
        self.texels: list[tuple[float, ...]] = [(float("nan"), float("nan"))]  # number 0: a corner that has none
        self.faces: list[tuple[int, int, int]] = []
        self.corners: list[tuple[int, int, int]] = []
        self.worn: list[int] = []
        self.materials: dict[str, int] = {}
        self.libraries: list[str] = []
        self._current = -1

    @property
    def too_large(self) -> bool:
        """Whether there are more vertices or triangles than anything sound has."""
        return len(self.points) > _MOST or len(self.faces) > _MOST or len(self.texels) > 3 * _MOST

    def follow(self, line: str) -> None:
        """Take in one line; raise `ValueError` or `IndexError` if it makes no sense."""
        words = line.split()
        match words[0] if words else "":
            case "v":
                self.points.append(tuple(float(x) for x in words[1:4]))
            case "vt":
                self.texels.append(tuple(float(x) for x in words[1:3]))
            case "f":
                self._add_polygon(words[1:])
            case "usemtl":
                self._current = self.materials.setdefault(_rest(line), len(self.materials))
            case "mtllib":
                self.libraries.append(_rest(line))

    def _add_polygon(self, words: list[str]) -> None:
        """Cut a polygon into a fan of triangles that wear the current material."""
        ring = [_corner(word, len(self.points), len(self.texels) - 1) for word in words]
        if self._current < 0:
            self._current = self.materials.setdefault("", len(self.materials))
        for a, b in pairwise(ring[1:]):
            self.faces.append((ring[0][0], a[0], b[0]))
            self.corners.append((ring[0][1], a[1], b[1]))
            self.worn.append(self._current)

    def arrays(self, path: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the points, and the texture coordinates of each triangle's corners; both are checked."""
        if not self.faces or any(len(p) != 3 for p in self.points) or any(len(t) != 2 for t in self.texels):
            raise IntegrityError(f"{path}: no triangles, or points of other than three numbers")
        xyz, uv = np.array(self.points, np.float64), np.array(self.texels, np.float64)[np.array(self.corners)]
        if not np.isfinite(xyz).all() or np.isinf(uv).any():
            raise IntegrityError(f"{path}: holds numbers that are none")
        return xyz, uv


def _rest(line: str) -> str:
    """Return what follows a line's first word: a name, which may hold blanks."""
    return line.split(None, 1)[1].strip()


def _corner(word: str, points: int, texels: int) -> tuple[int, int]:
    """Return indices from 0 of a corner's point, and of its texture coordinate (0: none)."""
    parts = word.split("/")
    point = int(parts[0])
    texel = int(parts[1]) if len(parts) > 1 and parts[1] else 0
    point = point - 1 if point > 0 else points + point
    texel = texel if texel >= 0 else texels + 1 + texel
    if not (0 <= point < points and 0 <= texel <= texels):
        raise ValueError("an index beyond what came before")
    return point, texel


def _beside(path: str, name: str) -> str:
    """Path of a file that another names."""
    folder = posixpath.dirname(path)
    joined = posixpath.normpath(posixpath.join(folder, name.replace("\\", "/")))
    if not joined.startswith(f"{folder}/" if folder else "") or joined.startswith(("/", "..")):
        raise IntegrityError(f"{path}: names {name!r}, which is not beside it")
    return joined


def _paints(path: str, content: Callable[[str], bytes], largest: int, worn: Container[str]) -> dict[str, ObjMaterial]:
    """Return the materials of an MTL file that are worn."""
    paints: dict[str, ObjMaterial] = {}
    pictures: dict[str, NDArray[np.uint8]] = {}
    for name, row in _material_rows(path, content(path).decode("utf-8", "replace")).items():
        if name not in worn:
            continue
        colour = row.get("colour", _GREY)
        if len(colour) != 3:
            raise IntegrityError(f"{path}: the colour of {name} has not three numbers")
        opacity, picture = row.get("opacity", 1.0), None
        if "map" in row:
            at = _beside(path, row["map"])
            if at not in pictures:
                pictures[at] = _picture(at, content(at), largest)
            # A picture says its colours itself: exporters write a grey beside it that nobody means.
            picture, colour = pictures[at], (255, 255, 255)
        elif opacity < 0.6:
            colour = _glassy(colour, max(opacity, 0.0))
        paints[name] = ObjMaterial(name, colour, opacity, picture)
    return paints


def _material_rows(path: str, text: str) -> dict[str, dict[str, Any]]:
    """Return what an MTL file says of each material: ``colour``, ``opacity``, ``map``, where it does."""
    found: dict[str, dict[str, Any]] = {}
    here: dict[str, Any] = {}
    for count, line in enumerate(text.splitlines(), 1):
        words = line.split()
        try:
            match words[0].lower() if words else "":
                case "newmtl":
                    here = found.setdefault(_rest(line), {})
                case "kd":
                    here["colour"] = tuple(min(max(round(float(x) * 255), 0), 255) for x in words[1:4])
                case "d":
                    here["opacity"] = float(words[-1])
                case "tr":
                    here.setdefault("opacity", 1.0 - float(words[-1]))
                case "map_kd":
                    here["map"] = words[-1]
        except (ValueError, IndexError, OverflowError):
            raise IntegrityError(f"{path}: line {count} can't be read ({line[:40]!r})") from None
    return found


def _glassy(colour: tuple[int, ...], opacity: float) -> tuple[int, int, int]:
    """Mix a see-through material's colour with what glass is drawn like."""
    r, g, b = (round(c * opacity + clear * (1 - opacity)) for c, clear in zip(colour, _CLEAR, strict=True))
    return r, g, b


def _picture(path: str, data: bytes, largest: int) -> NDArray[np.uint8]:
    """Return a picture with sides that are powers of two, no larger than `largest`."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            image = Image.open(io.BytesIO(data), formats=("PNG", "JPEG", "GIF", "BMP"))
            if image.width * image.height > _MOST_PIXELS:
                raise IntegrityError(f"{path}: a picture of more than {_MOST_PIXELS:,} pixels")
            clear = image.mode in ("RGBA", "LA", "PA") or "transparency" in image.info
            image = image.convert("RGBA" if clear else "RGB")
    except (UnidentifiedImageError, OSError, ValueError, SyntaxError, Image.DecompressionBombWarning) as error:
        raise IntegrityError(f"{path}: not a readable picture ({error})") from None
    sides = [min(1 << max(round(np.log2(side)), 0), largest) for side in image.size]
    pixels = np.asarray(image.resize((sides[0], sides[1]), Image.Resampling.BOX if clear else Image.Resampling.LANCZOS))
    if clear and int(pixels[..., 3].min()) >= 128:
        pixels = pixels[..., :3]
    return np.ascontiguousarray(pixels)
