"""What of a city robots can touch, chunk by chunk: the tiles around robots are read, the rest is not."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vico.sim.physics.records import Chunk, StaticChunks, StaticScene
from vico.sim.physics.surroundings import static_scene_of
from vico.world.city_world import CityWorld
from vico.world.heights import HeightField
from vico.world.world import World

#: About the side of a chunk, metres: a whole number of them is as long as a tile.
_SIDE = 128.0
#: Metres beyond its tile that a thing may reach which is no building: it stands in its tile, and is smaller than that.
_OVERHANG = 64.0
# Tiles whose solids are kept.
_TILES = 16


@dataclass(frozen=True)
class _Tile:
    """Solids of a tile, and the boxes around them: west, south, east, north, shape ``(n, 4)``."""

    solids: StaticScene
    hulls: NDArray[np.float64]
    boxes: NDArray[np.float64]
    pillars: NDArray[np.float64]


class CityChunks:
    """See `vico.sim.physics.records.StaticChunks`.

    A solid is in the scene of every chunk that some part of it is in, whichever tile has it, and in one place among
    the others: tiles follow each other as in the city.

    Parameters
    ----------
    city
        The city.
    flying
        Some of the robots fly: all of its solids count, as high as they are.
    """

    def __init__(self, city: CityWorld, *, flying: bool = False) -> None:
        self._city, self._flying = city, flying
        size = city.city.manifest.size
        self.side = size / max(round(size / _SIDE), 1)
        self._read: dict[tuple[int, int], _Tile] = {}

    @property
    def height(self) -> HeightField:
        """The ground of the whole city."""
        return self._city.height

    @cached_property
    def _outer(self) -> NDArray[np.float64]:
        """Boxes that no solid of a tile reaches beyond: west, south, east, north, shape ``(tiles, 4)``."""
        city = self._city.city
        found = []
        for tile in city.manifest.tiles:
            middle = np.array([tile.column, tile.row]) * city.manifest.size
            half = city.manifest.size / 2 + _OVERHANG
            low, high = middle - half, middle + half
            walls = city.world((tile.column, tile.row)).bounds("collision")
            if walls is not None:
                low, high = np.minimum(low, walls[0, :2] + middle), np.maximum(high, walls[1, :2] + middle)
            found.append([*low, *high])
        return np.array(found).reshape(-1, 4)

    def _tile(self, place: tuple[int, int]) -> _Tile:
        known = self._read.pop(place, None)
        if known is None:
            solids = static_scene_of(self._city.part([place]), flying=self._flying)
            corners = [(points[:, :2].min(axis=0), points[:, :2].max(axis=0)) for points in solids.hulls]
            around = np.hypot(solids.boxes[:, 4], solids.boxes[:, 5])
            known = _Tile(
                solids,
                np.array(corners).reshape(-1, 4),
                _around(solids.boxes, around),
                _around(solids.pillars, solids.pillars[:, 3]),
            )
        self._read[place] = known
        while len(self._read) > _TILES:
            self._read.pop(next(iter(self._read)))
        return known

    def scene(self, chunks: Collection[Chunk]) -> StaticScene:
        """Return the ground of some chunks, and all solids of which some part is in one of them."""
        squares = np.array(list(chunks), np.float64).reshape(-1, 2) * self.side - self.height.half
        bounds = np.concatenate([squares, squares + self.side], axis=1)
        tiles = [
            self._tile((tile.column, tile.row))
            for tile, near in zip(self._city.city.manifest.tiles, _meets(self._outer, bounds), strict=True)
            if near
        ]
        hulls = [tile.solids.hulls[k] for tile in tiles for k in np.flatnonzero(_meets(tile.hulls, bounds)).tolist()]
        boxes = [tile.solids.boxes[_meets(tile.boxes, bounds)] for tile in tiles]
        pillars = [tile.solids.pillars[_meets(tile.pillars, bounds)] for tile in tiles]
        return StaticScene(
            self.height,
            tuple(hulls),
            np.concatenate([np.zeros((0, 7)), *boxes]),
            np.concatenate([np.zeros((0, 5)), *pillars]),
            squares,
            self.side,
        )

    def whole(self) -> StaticScene:
        """Return all of it."""
        return static_scene_of(self._city, flying=self._flying)


def surroundings_of(world: World, *, flying: bool = False) -> StaticScene | StaticChunks:
    """Return everything of a world that robots can touch: all at once, of a city of several tiles chunk by chunk.

    Parameters
    ----------
    flying
        Some of the robots fly: all of it counts, as high as it is.
    """
    if isinstance(world, CityWorld) and len(world.city.manifest.tiles) > 1:
        return CityChunks(world, flying=flying)
    return static_scene_of(world, flying=flying)


def _around(solids: NDArray[np.float64], reach: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return boxes around upright solids: west, south, east, north."""
    return np.concatenate([solids[:, :2] - reach[:, None], solids[:, :2] + reach[:, None]], axis=1)


def _meets(boxes: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which boxes (west, south, east, north) meet one of others, shape ``(n,)``."""
    found = np.zeros(len(boxes), np.bool_)
    for west, south, east, north in others.tolist():
        found |= (boxes[:, 0] <= east) & (boxes[:, 2] >= west) & (boxes[:, 1] <= north) & (boxes[:, 3] >= south)
    return found
