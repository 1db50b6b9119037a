"""The fixed grid of a city's tiles."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import shapely
from shapely import Polygon

#: Column and row of a tile, east and north of the tile (0, 0) around the city's centre.
Tile = tuple[int, int]

HALO = 100.0
"""Metres around a tile of which its streets and heights are made, too: what is further away decides next to nothing."""

STRIP = 2.0
"""Metres on both sides of a border where streets are those of the tile that comes first."""

BLEND = 32.0
"""Metres on both sides of a border over which heights pass from one tile's to the other's."""


@dataclass(frozen=True)
class TileGrid:
    """Square tiles around a centre; the same spot is in the same tile however large the city is.

    Attributes
    ----------
    size
        Side of a tile, metres: a multiple of 8, so that the cells of all fields meet at borders.
    first, last
        The south-western and the north-eastern tile.
    """

    size: float
    first: Tile
    last: Tile

    def __iter__(self) -> Iterator[Tile]:
        """Row by row from the south, each from the west: the order in which tiles come first."""
        for row in range(self.first[1], self.last[1] + 1):
            for column in range(self.first[0], self.last[0] + 1):
                yield column, row

    def __len__(self) -> int:
        return (self.last[0] - self.first[0] + 1) * (self.last[1] - self.first[1] + 1)

    def __contains__(self, tile: object) -> bool:
        if not (isinstance(tile, tuple) and len(tile) == 2):
            return False
        return all(a <= k <= b for a, k, b in zip(self.first, tile, self.last, strict=True))

    @property
    def reach(self) -> int:
        """How many tiles there are from the middle one to the side that is farthest from it."""
        return max(abs(k) for k in (*self.first, *self.last))

    @property
    def half(self) -> float:
        """Half the side of the square around the middle tile that holds all tiles, metres."""
        return (self.reach + 0.5) * self.size

    @property
    def edges(self) -> tuple[float, float, float, float]:
        """West, south, east and north of all tiles, metres from the middle one's middle."""
        (west, south), (east, north) = self.first, self.last
        reach = self.size / 2
        return west * self.size - reach, south * self.size - reach, east * self.size + reach, north * self.size + reach

    def place(self, tile: Tile) -> Tile:
        """Return which column and row of that square a tile is, counted from its south-western corner."""
        return tile[0] + self.reach, tile[1] + self.reach

    def centre(self, tile: Tile) -> tuple[float, float]:
        """Return a tile's middle, metres east and north of the city's centre."""
        return tile[0] * self.size, tile[1] * self.size

    def around(self, tile: Tile) -> list[Tile]:
        """Return a tile and its neighbours, those across a corner among them, in the order of the grid."""
        found = [(tile[0] + dx, tile[1] + dy) for dy in (-1, 0, 1) for dx in (-1, 0, 1)]
        return [one for one in found if one in self]

    def nearest(self, tile: Tile) -> Tile:
        """Return a tile itself, or the one next to it where the city has ended."""
        column, row = (min(max(k, a), b) for a, k, b in zip(self.first, tile, self.last, strict=True))
        return column, row

    def box(self, tile: Tile, *, wider: float = 0.0, seen_from: Tile = (0, 0)) -> Polygon:
        """Return a tile's square, widened by some metres, in the coordinates of another tile."""
        x, y = ((a - b) * self.size for a, b in zip(tile, seen_from, strict=True))
        reach = self.size / 2 + wider
        return shapely.box(x - reach, y - reach, x + reach, y + reach)


def grid_of(extent: float, size: float) -> TileGrid:
    """Return the grid that covers a square around the centre, `extent` metres wide: 2 n + 1 tiles a side."""
    more = max(0, -int(-(extent / size - 1.0) // 2))
    return TileGrid(size, (-more, -more), (more, more))


def grid_over(low: tuple[float, float], high: tuple[float, float], size: float) -> TileGrid:
    """Return the grid that covers a rectangle, given by two corners in metres east and north of the centre in it."""
    first = [math.floor(k / size + 0.5) for k in low]
    last = [math.ceil(k / size + 0.5) - 1 for k in high]
    return TileGrid(size, (min(first[0], 0), min(first[1], 0)), (max(last[0], 0), max(last[1], 0)))


def tile_name(tile: Tile) -> str:
    """Return the name of a tile's folder."""
    return f"{tile[0]}_{tile[1]}"
