"""Heights of a tile as it and its neighbours have them: the same at a spot, whichever tile looks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.world.heights import HeightField, Steps
from vico.worldgen.seams.grid import BLEND, Tile, TileGrid

Floats = NDArray[np.float64]


def cropped(field: HeightField, *, half: float, east: float = 0.0, north: float = 0.0) -> HeightField:
    """Cut a square out of a field along its cells.

    Parameters
    ----------
    field
        Any field without decks and stairs.
    half
        Half the side of the square, metres.
    east, north
        Its middle; the result is told from there.
    """
    if field.heights.size == 4 and not np.ptp(field.heights):
        heights = field.heights
    else:
        heights = _cut(field.heights, field.half, half, east, north)
    steps = field.steps
    if steps is not None:
        steps = Steps(*(_cut(part, field.half, half, east, north) for part in (steps.edge, steps.low, steps.high)))
    return replace(field, heights=heights, half=half, steps=steps)


def blended(fields: Mapping[Tile, HeightField], tile: Tile, grid: TileGrid) -> HeightField:
    """Return a tile's heights, which pass to its neighbours' across its borders.

    Parameters
    ----------
    fields
        Of the tile and all its neighbours, each over its own square and what lies around that.
    tile, grid
        Which tile, of which grid.

    Returns
    -------
    HeightField
        Over the square of the tile's own field. Smooth heights are weighted by how far a spot is from the borders,
        edges are those of the tile that a spot lies in. A neighbour computes the very same numbers.
    """
    own = fields[tile]
    heights = own.heights
    if any(field.heights.size > 4 or float(field.heights[0, 0]) for field in fields.values()):
        n = max(field.heights.shape[0] for field in fields.values())
        heights = _smooth(fields, tile, grid, np.linspace(-own.half, own.half, n))
    return replace(own, heights=heights, steps=_edges(fields, tile, grid))


def _smooth(fields: Mapping[Tile, HeightField], tile: Tile, grid: TileGrid, axis: Floats) -> NDArray[np.float32]:
    total = np.zeros((len(axis), len(axis)))
    weights = np.zeros_like(total)
    for one, (wx, wy) in _shares(tile, grid, axis).items():
        weight = wy[:, None] * wx[None, :]
        rows, columns = np.nonzero(weight)
        if not len(rows):
            continue
        away = [(a - b) * grid.size for a, b in zip(tile, one, strict=True)]
        there = np.stack([axis[columns] + away[0], axis[rows] + away[1]], axis=1)
        total[rows, columns] += weight[rows, columns] * fields[one].smooth(there)
        weights += weight
    return (total / weights).astype(np.float32)


def _shares(tile: Tile, grid: TileGrid, axis: Floats) -> dict[Tile, tuple[Floats, Floats]]:
    """Return how much each tile around has to say along both axes; those beyond the city's edge speak for its edge."""

    def share(k: int) -> Floats:
        return np.clip((grid.size / 2 + BLEND - np.abs(axis - k * grid.size)) / (2 * BLEND), 0.0, 1.0)

    along: list[dict[int, Floats]] = []
    for which in (0, 1):
        found: dict[int, Floats] = {}
        for k in (-1, 0, 1):
            there = [tile[0], tile[1]]
            there[which] += k
            nearest = grid.nearest((there[0], there[1]))[which]
            found[nearest] = found.get(nearest, np.zeros(len(axis))) + share(k)
        along.append(found)
    return {(column, row): (along[0][column], along[1][row]) for row in sorted(along[1]) for column in sorted(along[0])}


def _edges(fields: Mapping[Tile, HeightField], tile: Tile, grid: TileGrid) -> Steps | None:
    own = fields[tile]
    there = {one: field.steps for one, field in fields.items()}
    n = max((len(steps.edge) for steps in there.values() if steps is not None), default=0)
    if not n:
        return None
    axis = np.linspace(-own.half, own.half, n)
    cell = axis[1] - axis[0]
    column, row = (np.floor(axis / grid.size + 0.5).astype(int) + k for k in tile)
    edge, low, high = np.full((n, n), 127, np.int8), np.zeros((n, n), np.int16), np.zeros((n, n), np.int16)
    for one in grid.around(tile):
        steps = there[one]
        if steps is None:
            continue
        mine = [
            np.flatnonzero([grid.nearest(_at(k, which, tile))[which] == one[which] for k in line])
            for which, line in ((0, column), (1, row))
        ]
        shift = [round((a - b) * grid.size / cell) for a, b in zip(tile, one, strict=True)]
        x, y = mine[0] + shift[0], mine[1] + shift[1]
        kept_x, kept_y = (x >= 0) & (x < n), (y >= 0) & (y < n)
        target = np.ix_(mine[1][kept_y], mine[0][kept_x])
        source = np.ix_(y[kept_y], x[kept_x])
        edge[target], low[target], high[target] = steps.edge[source], steps.low[source], steps.high[source]
    return Steps(edge, low, high)


def _at(k: int, which: int, tile: Tile) -> Tile:
    return (int(k), tile[1]) if which == 0 else (tile[0], int(k))


def _cut(values: NDArray[Any], whole: float, half: float, east: float, north: float) -> NDArray[Any]:
    n = len(values)
    cell = 2 * whole / (n - 1)
    count = round(2 * half / cell) + 1
    i, j = round((whole + east - half) / cell), round((whole + north - half) / cell)
    return np.ascontiguousarray(values[j : j + count, i : i + count])
