"""Opening worlds: folders of one world, and cities of tiles."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from vico.world.city import CITY, read_city
from vico.world.city_world import CityWorld
from vico.world.stored import read_stored
from vico.world.world import World


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
    return _opened(folder, state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=2)
def _opened(folder: Path, _changed: int, _size: int) -> World:
    return read_world(folder)
