"""What the tiles of a city look like from afar: made once a tile, and kept in the cache folder."""

from __future__ import annotations

import logging
from collections.abc import Collection
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from vico.errors import OutputError
from vico.io.cache import cache_folder
from vico.io.files import new_file
from vico.world.city import City, CityTile
from vico.world.far_windows import WINDOWS
from vico.world.mesh import Material, Surface
from vico.world.moving import Shift
from vico.world.silhouettes import FAR, silhouette_of

_log = logging.getLogger(__name__)

# Of the files: another number has all made anew.
_VERSION = 3
_ARRAYS = ("positions", "normals", "uv", "colour", "entity", "triangles")
_MATERIALS = {material.name: material for material in (Material(FAR), WINDOWS)}


class CitySilhouettes:
    """The silhouettes of a city's tiles, in its frame.

    Parameters
    ----------
    city
        The city.
    """

    def __init__(self, city: City) -> None:
        self._city = city
        self._known: dict[tuple[int, int], list[Surface]] = {}

    def beyond(self, tiles: Collection[tuple[int, int]], reach: int) -> list[Surface]:
        """Return the silhouettes of all tiles but some, so many columns or rows beyond these at most."""
        columns, rows = zip(*tiles, strict=True)
        found: list[Surface] = []
        for tile in self._city.manifest.tiles:
            place = tile.column, tile.row
            off = max(min(columns) - place[0], place[0] - max(columns), min(rows) - place[1], place[1] - max(rows))
            if place not in tiles and off <= reach:
                found += self._of(tile)
        return found

    def _of(self, tile: CityTile) -> list[Surface]:
        place = tile.column, tile.row
        if place not in self._known:
            shift = Shift.of(self._city, place)
            self._known[place] = [shift.surface(surface) for surface in self._kept(tile)]
        return self._known[place]

    def _kept(self, tile: CityTile) -> list[Surface]:
        """Return a tile's silhouette in its own frame: the kept one, or a new one that is kept."""
        path = cache_folder() / "silhouettes" / f"{tile.digest[:32]}.{_VERSION}.npz"
        known = _read(path)
        if known is None:
            known = silhouette_of(self._city.world((tile.column, tile.row)))
            try:
                _write(path, known)
            except OutputError as error:
                _log.warning("silhouettes are not kept: %s", error)
        return known


def _read(path: Path) -> list[Surface] | None:
    """Return the surfaces of a file; None where there is none, or none that can be read."""
    try:
        with np.load(path, allow_pickle=False) as file:
            parts = [{name: file[f"{k}.{name}"] for name in _ARRAYS} for k in range(len(file["materials"]))]
            materials = [_MATERIALS[name] for name in file["materials"].tolist()]
    except (OSError, ValueError, KeyError, EOFError, BadZipFile):
        return None
    return [Surface(**arrays, material=material) for arrays, material in zip(parts, materials, strict=True)]


def _write(path: Path, surfaces: list[Surface]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    arrays = {f"{k}.{name}": getattr(surface, name) for k, surface in enumerate(surfaces) for name in _ARRAYS}
    with new_file(path) as temporary, temporary.open("wb") as file:
        np.savez(file, materials=[surface.material.name for surface in surfaces], **arrays)
