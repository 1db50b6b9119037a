"""What the tiles of a city look like from afar: made once a tile, and kept in the cache folder.

Beyond the city's edge nothing is known. There its outermost tiles are seen once more, mirrored at the edge: streets go
on straight, ground and water meet theirs, houses are like those near by. It is of the entity `ENTITY_BACKDROP`, for
nothing of it is a record of the city.
"""

from __future__ import annotations

import itertools
import logging
from collections.abc import Collection, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from vico.errors import OutputError
from vico.io.cache import cache_folder
from vico.io.files import new_file
from vico.world.city import City, CityTile
from vico.world.far_windows import WINDOWS
from vico.world.mesh import Material, Surface
from vico.world.model import ENTITY_BACKDROP
from vico.world.moving import Shift
from vico.world.silhouettes import FAR, silhouette_of

_log = logging.getLogger(__name__)

# Of the files: another number has all made anew.
_VERSION = 3
_ARRAYS = ("positions", "normals", "uv", "colour", "entity", "triangles")
# Tiles beyond the edge that are drawn.
_BEYOND = 2
_REACH_IN = 0.5  # metres that a leaf of a tree there may reach into the city
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
        self._pictures: list[NDArray[np.uint8]] = []

    def beyond(self, tiles: Collection[tuple[int, int]], reach: int) -> list[Surface]:
        """Return the silhouettes of all tiles but some, so many columns or rows beyond these at most.

        And what is seen beyond the city's edge.
        """
        columns, rows = zip(*tiles, strict=True)

        def is_seen(column: int, row: int) -> bool:
            off = max(min(columns) - column, column - max(columns), min(rows) - row, row - max(rows))
            return off <= reach

        found: list[Surface] = []
        for tile in self._city.manifest.tiles:
            if (tile.column, tile.row) not in tiles and is_seen(tile.column, tile.row):
                found += self._of(tile)
        for place in self._around:
            if is_seen(*place):
                found += self._beyond_edge(place)
        self._pictures.clear()
        return found

    @cached_property
    def _around(self) -> dict[tuple[int, int], tuple[CityTile, tuple[float, float]]]:
        """Places beyond the edge, the tile that is seen there, and which of its axes are turned round, -1 each or 1."""
        tiles = {(tile.column, tile.row): tile for tile in self._city.manifest.tiles}
        columns, rows = ((min(numbers), max(numbers)) for numbers in zip(*tiles, strict=True))
        places = itertools.product(
            range(columns[0] - _BEYOND, columns[1] + _BEYOND + 1), range(rows[0] - _BEYOND, rows[1] + _BEYOND + 1)
        )
        found: dict[tuple[int, int], tuple[CityTile, tuple[float, float]]] = {}
        for column, row in places:
            (east, turned_east), (north, turned_north) = _mirrored(column, *columns), _mirrored(row, *rows)
            # A tile that is missing within the city stays bare.
            if (east, north) != (column, row) and (east, north) in tiles:
                found[column, row] = tiles[east, north], (turned_east, turned_north)
        return found

    def _beyond_edge(self, place: tuple[int, int]) -> list[Surface]:
        """Return the silhouette of a tile as it is seen mirrored at a place beyond the edge."""
        if place not in self._known:
            tile, turned = self._around[place]
            at, source = np.array(place), np.array([tile.column, tile.row])
            moved = (at - np.array(turned) * source) * self._city.manifest.size
            found = [_turned(surface, np.array([*turned, 1.0]), np.array([*moved, 0.0])) for surface in self._of(tile)]
            self._known[place] = [
                replace(surface, entity=np.full_like(surface.entity, ENTITY_BACKDROP))
                for surface in self._without_overhang(found)
            ]
        return self._known[place]

    def _without_overhang(self, surfaces: Sequence[Surface]) -> list[Surface]:
        """Return surfaces without what reaches into the city: the mirror image of a house that stands across the edge.

        The house itself is drawn, on both sides of the edge.
        """
        tiles = np.array([(tile.column, tile.row) for tile in self._city.manifest.tiles])
        size = self._city.manifest.size
        low, high = (tiles.min(axis=0) - 0.5) * size + _REACH_IN, (tiles.max(axis=0) + 0.5) * size - _REACH_IN
        gone = np.unique(
            np.concatenate(
                [s.entity[((s.positions[:, :2] > low) & (s.positions[:, :2] < high)).all(axis=1)] for s in surfaces]
            )
        )
        return [replace(s, triangles=s.triangles[~np.isin(s.entity[s.triangles[:, 0]], gone)]) for s in surfaces]

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
            world = self._city.world((tile.column, tile.row))
            known = silhouette_of(world)
            # The next tile has most of these, too: as long as they are here they need not be decoded again.
            self._pictures = world.textures()
            try:
                _write(path, known)
            except OutputError as error:
                _log.warning("silhouettes are not kept: %s", error)
        return known


def _mirrored(k: int, first: int, last: int) -> tuple[int, float]:
    """Return the column or row within a city that one beyond its edge mirrors; -1.0 if that turns it round, or 1.0."""
    turned = 1.0
    while not first <= k <= last:
        k = 2 * first - 1 - k if k < first else 2 * last + 1 - k
        turned = -turned
    return k, turned


def _turned(surface: Surface, turns: NDArray[np.float64], moved: NDArray[np.float64]) -> Surface:
    """Return a surface with axes turned round, -1 each or 1, and moved, metres."""
    turned = turns.astype(np.float32)
    return replace(
        surface,
        positions=surface.positions * turned + moved.astype(np.float32),
        normals=surface.normals * turned,
        # Still counter-clockwise seen from outside.
        triangles=surface.triangles[:, ::-1] if turns.prod() < 0.0 else surface.triangles,
    )


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
