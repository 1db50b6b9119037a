"""Opening worlds: folders of one world, cities of tiles, and worlds that lie in an object store.

A world in a store is copied to this machine's cache, once, and checked against its manifest.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path

from vico.errors import MissingFileError, SchemaError
from vico.io.cache import cache_folder
from vico.io.files import new_folder, sha256_of, write_bytes, write_errors
from vico.io.stores import Store, store_at
from vico.world.city import CITY, read_city
from vico.world.city_world import CityWorld
from vico.world.world import World, read_stored


def is_world(path: Path) -> bool:
    """Return whether a folder holds a finished world, or a city."""
    return any((Path(path) / name).exists() for name in ("world.json", CITY))


def read_world(path: Path) -> World:
    """Open a world folder, or a city as one world.

    Raises
    ------
    MissingFileError
        If there is no finished world at `path`.
    SchemaError
        If its manifest is damaged, of another kind, or of another version.
    """
    folder = Path(path)
    return CityWorld(read_city(folder)) if (folder / CITY).exists() else read_stored(folder)


def kept_world(path: Path) -> World:
    """Open a world folder; the last two are kept, with all that was derived of them, until they are built anew.

    Raises
    ------
    MissingFileError, SchemaError
        As `read_world`.
    """
    folder = Path(path).resolve()
    try:
        state = (folder / (CITY if (folder / CITY).exists() else "world.json")).stat()
    except OSError:
        return read_world(path)  # says what is missing
    return _open_cached(folder, state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=2)
def _open_cached(folder: Path, _changed: int, _size: int) -> World:
    return read_world(folder)


_MANIFEST = "world.json"


def fetch_manifest(url: str) -> Path:
    """Copy as much of a world as says which it is; return a folder of its name, in the cache.

    Raises
    ------
    MissingFileError
        If there is no world at the URL.
    SourceError
        If the store does not answer.
    """
    content = _manifest(store_at(url), url)
    folder = _home("world_manifests", content) / _name(url)
    if not (folder / _MANIFEST).exists():
        write_bytes(folder / _MANIFEST, content)
    return folder


def fetch_world(url: str) -> Path:
    """Copy a world to the cache if it is not there; return its folder.

    It is kept by its digest: a world that changed at its URL is another one. Processes that want the same world at the
    same time wait for the first of them.

    Parameters
    ----------
    url
        Of the world's folder: ``s3://BUCKET/worlds/helsinki``.

    Raises
    ------
    MissingFileError
        If there is no world at the URL, or not all of it.
    SchemaError
        If a file is not the one that the manifest names.
    SourceError
        If the store does not answer.
    """
    store = store_at(url)
    content = _manifest(store, url)
    home = _home("worlds", content)
    out = home / _name(url)
    with write_errors(out):
        home.mkdir(parents=True, exist_ok=True)
    with _only_one(home):
        if not (out / _MANIFEST).exists():
            with new_folder(out, force=True) as folder:
                store.fetch_folder("", folder)
                _check(folder, url)
    return out


def _manifest(store: Store, url: str) -> bytes:
    content = store.read(_MANIFEST)
    if content is None:
        raise MissingFileError(f"{url}: holds no world.json, so there is no finished world; give the URL of a world")
    return content


def _check(folder: Path, url: str) -> None:
    """Make sure that what was copied is what the manifest names."""
    for name, digest in read_world(folder).manifest.files.items():
        if not (folder / name).is_file():
            raise MissingFileError(f"{url}: lacks {name}; copy the world there anew")
        if sha256_of(folder / name) != digest:
            raise SchemaError(f"{url}: {name} is not the file that world.json names; copy the world there anew")


def _home(kind: str, manifest: bytes) -> Path:
    return cache_folder() / kind / hashlib.sha256(manifest).hexdigest()[:16]


def _name(url: str) -> str:
    return url.rstrip("/").rpartition("/")[2]


@contextmanager
def _only_one(folder: Path) -> Iterator[None]:
    """Lock a folder for one process at a time; the system unlocks it however that process ends."""
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)
