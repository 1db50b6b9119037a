"""A small world of the packaged place, built once into the user's cache."""

from __future__ import annotations

import sys
from pathlib import Path

from vico.errors import VicoError
from vico.io.cache import cache_folder
from vico.version import __version__
from vico.world.folder import read_world
from vico.world.model import VERSION
from vico.worldgen.packaged import packaged_extract
from vico.worldgen.pipeline import build_world
from vico.worldgen.request import BuildOptions

_HALF = 150.0  # metres: houses, shops with rooms, people, and a street that cars can drive on


def small_world() -> Path:
    """Return the folder of the small world; it is built if it is not there, and a line on stderr says so."""
    extract = packaged_extract()
    folder = cache_folder() / "worlds" / f"{extract.name}-{2 * _HALF:.0f}m-{__version__}-{VERSION}"
    try:
        read_world(folder)
    except VicoError:
        print(f"building a small world of {extract.name}, once, in {folder}", file=sys.stderr, flush=True)
        options = BuildOptions(previews=False)
        build_world(
            extract.path, lat=extract.lat, lon=extract.lon, half=_HALF, seed=0, out=folder, force=True, options=options
        )
    return folder
