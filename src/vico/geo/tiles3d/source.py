"""Where a tileset's files come from: a folder, an archive read in place, or a server."""

from __future__ import annotations

import os
import posixpath
import tarfile
import zipfile
from pathlib import Path
from typing import Protocol
from urllib.parse import parse_qsl, unquote, urlencode, urljoin, urlsplit, urlunsplit

from vico.errors import InputError, MissingFileError, SchemaError
from vico.io.http import HttpClient

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
