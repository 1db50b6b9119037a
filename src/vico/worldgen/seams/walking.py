"""Where people walk in a whole city: the surfaces of its tiles, room to walls, and what is joined with what."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from vico.io.arrays import new_array, npz_bytes
from vico.io.files import write_bytes
from vico.world.city import COST, GATES, REACHED, ROOM, STEPS, SURFACES
from vico.world.city_gates import Gates
from vico.world.lanes import DisjointSets
from vico.world.routing import walking_costs
from vico.world.walkable import BLOCKED, WalkableMap, read_walkable
from vico.worldgen.seams.grid import Tile, TileGrid

#: Metres of room to walls that are told apart: more is as good as so much.
MOST_ROOM = 16.0


def write_walking(folder: Path, grid: TileGrid, tiles: Mapping[Tile, Path]) -> None:
    """Write the walkable map of a city.

    Parameters
    ----------
    folder
        Where to.
    grid, tiles
        Its tiles, and the files with the maps of those that are built; in others nobody walks.
    """
    first = read_walkable(next(iter(tiles.values())))
    side, cell = first.n, first.cell
    shape = (2 * grid.reach + 1) * side, (2 * grid.reach + 1) * side
    with ExitStack() as files:
        surfaces = files.enter_context(new_array(folder / SURFACES, shape, np.uint8))
        room = files.enter_context(new_array(folder / ROOM, shape, np.float32))
        reached = files.enter_context(new_array(folder / REACHED, shape, np.bool_))
        for tile, path in tiles.items():
            surfaces[square_of(tile, grid, side)] = read_walkable(path).cls
        for tile in tiles:
            room[square_of(tile, grid, side)] = _room(surfaces, square_of(tile, grid, side), cell)
        _write_reached(surfaces, [square_of(tile, grid, side) for tile in tiles], reached)
        cost = files.enter_context(new_array(folder / COST, shape, np.int16))
        for tile in tiles:
            square = square_of(tile, grid, side)
            wide, own = around(square, 1)
            cost[square] = walking_costs(surfaces[wide], room[wide], reached[wide])[own]


def write_gates(folder: Path, gates: Sequence[Gates]) -> None:
    """Write the gates of all tiles of a city as one table."""
    whole = Gates.joined(gates)
    with new_array(folder / STEPS, whole.steps.shape, np.uint8) as steps:
        steps[:] = whole.steps
    write_bytes(folder / GATES, npz_bytes(whole.arrays()))


def around(square: tuple[slice, slice], cells: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Return the rows and columns so many cells around a square, and where it lies in them."""
    wide = tuple(slice(max(0, part.start - cells), part.stop + cells) for part in square)
    own = tuple(slice(part.start - w.start, part.stop - w.start) for part, w in zip(square, wide, strict=True))
    return (wide[0], wide[1]), (own[0], own[1])


def square_of(tile: Tile, grid: TileGrid, side: int) -> tuple[slice, slice]:
    """Return the rows and columns of a tile's cells."""
    column, row = grid.place(tile)
    return slice(row * side, (row + 1) * side), slice(column * side, (column + 1) * side)


def _room(surfaces: NDArray[np.uint8], square: tuple[slice, slice], cell: float) -> NDArray[np.float32]:
    """Return the clearance of a tile's cells; walls of its neighbours count."""
    wide, own = around(square, int(np.ceil(MOST_ROOM / cell)) + 1)
    clearance = WalkableMap(np.ascontiguousarray(surfaces[wide]), 1.0, cell).clearance
    return np.minimum(clearance[own], np.float32(MOST_ROOM))


def _write_reached(surfaces: NDArray[np.uint8], squares: list[tuple[slice, slice]], reached: NDArray[np.bool_]) -> None:
    """Find what is joined with the city's edge, tile by tile; the largest such part where there are several."""
    height, width = surfaces.shape
    regions: list[tuple[NDArray[np.int32], int]] = []
    sizes = [0]
    for square in squares:
        labels, count = ndimage.label(surfaces[square] != BLOCKED)
        regions.append((labels.astype(np.int32), len(sizes) - 1))
        sizes += np.bincount(labels.ravel(), minlength=count + 1)[1:].tolist()
    sets = DisjointSets(len(sizes))
    by_corner = {(square[0].start, square[1].start): k for k, square in enumerate(squares)}
    at_edge: set[int] = set()
    for k, (rows, columns) in enumerate(squares):
        own = _numbered(regions[k])
        for there, mine, theirs in (
            ((rows.start, columns.stop), own[:, -1], lambda other: other[:, 0]),
            ((rows.stop, columns.start), own[-1], lambda other: other[0]),
        ):
            if there in by_corner:
                across = theirs(_numbered(regions[by_corner[there]]))
                for a, b in set(zip(mine.tolist(), across.tolist(), strict=True)):
                    if a and b:
                        sets.join(a, b)
        edges = [own[0]] * (rows.start == 0) + [own[-1]] * (rows.stop == height)
        edges += [own[:, 0]] * (columns.start == 0) + [own[:, -1]] * (columns.stop == width)
        at_edge |= {int(label) for edge in edges for label in np.unique(edge) if label}
    total: dict[int, int] = {}
    for label, size in enumerate(sizes):
        total[sets.root(label)] = total.get(sets.root(label), 0) + size
    roots = sorted({sets.root(label) for label in at_edge})
    if not roots:
        return
    best = max(roots, key=lambda root: (total[root], -root))
    joined = np.array([label > 0 and sets.root(label) == best for label in range(len(sizes))])
    for k, square in enumerate(squares):
        reached[square] = joined[_numbered(regions[k])]


def _numbered(region: tuple[NDArray[np.int32], int]) -> NDArray[Any]:
    """Return a tile's labels as they are counted through the city; 0 where nobody walks."""
    labels, before = region
    return np.where(labels > 0, labels + before, 0)
