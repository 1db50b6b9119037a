"""Walkways of a city led past all that stands there, kept in the user's cache: found once, then read.

In 27 km² that takes a minute and a half, and all runs of a city ask for the same.
"""

from __future__ import annotations

import hashlib
import logging
import zlib
from collections.abc import Sequence
from dataclasses import fields
from functools import lru_cache
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
import shapely

from vico.errors import OutputError
from vico.io.cache import cache_folder
from vico.io.compiled import source_digest
from vico.io.files import write_bytes
from vico.io.npz import npz_bytes, read_npz
from vico.world.heights import HeightField
from vico.world.walkways import Walkways

_log = logging.getLogger(__name__)
_NAMES = tuple(field.name for field in fields(Walkways))


def walkways_past(
    walks: Walkways, solids: Sequence[shapely.Polygon], ground: HeightField | None, *, kept_as: str = ""
) -> Walkways:
    """Return walkways led past solids and kerbs, as `Walkways.clear_of` does.

    Parameters
    ----------
    walks, solids, ground
        As for `Walkways.clear_of`.
    kept_as
        Digest of the world that the ground is of: what was found is kept by it, and by the walkways and solids
        themselves. Nothing is kept without.
    """
    if not kept_as:
        return walks.clear_of(list(solids), ground)
    path = cache_folder() / "walkways" / f"{_key(walks, solids, kept_as)}.npz"
    known = _read(path)
    if known is None:
        known = walks.clear_of(list(solids), ground)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            write_bytes(path, npz_bytes({name: np.asarray(getattr(known, name)) for name in _NAMES}))
        except (OutputError, OSError) as error:  # a cache that can't be written costs time, nothing else
            _log.warning("walkways are not kept: %s", error)
    return known


def _key(walks: Walkways, solids: Sequence[shapely.Polygon], kept_as: str) -> str:
    total = hashlib.sha256(f"{kept_as} {_finder()} {np.__version__} {shapely.geos_version_string}".encode())
    for name in _NAMES:
        total.update(np.asarray(getattr(walks, name)).tobytes())
    for solid in shapely.to_wkb(np.array(solids, object)).tolist():
        total.update(solid)
    return total.hexdigest()[:32]


@lru_cache(maxsize=1)
def _finder() -> str:
    """Return a digest of the code that finds ways past things."""
    return source_digest(Path(__file__).with_name("walkways.py"), "vico.world.walkways")


def _read(path: Path) -> Walkways | None:
    """Return kept walkways; None where there are none, or the file is damaged: they are found anew."""
    try:
        arrays = read_npz(path.read_bytes(), _NAMES)
        return Walkways(**{**arrays, "ids": arrays["ids"].tolist()})
    except (OSError, ValueError, KeyError, EOFError, TypeError, BadZipFile, zlib.error):
        return None
