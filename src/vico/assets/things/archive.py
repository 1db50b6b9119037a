"""The furniture archives of the Debian package `sweethome3d-furniture`: found, read out of a .deb, listed.

An archive (``.sh3f``) is a zip with a list of properties and, for each model, an OBJ with its materials and pictures.
Everything is read as untrusted: members by name, sizes capped, nothing extracted to disk and nothing run.
"""

from __future__ import annotations

import io
import lzma
import re
import tarfile
import zipfile
from collections.abc import Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from types import TracebackType

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
        self.entries = dict(self._listed())

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

    def _listed(self) -> Iterator[tuple[str, ArchiveEntry]]:
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
