"""What the tiles of a city have of ground and streets, put together: one field of heights, one set of polygons."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely import MultiPolygon, Polygon
from shapely.affinity import translate

from vico.geo import overlay
from vico.geo.overlay import polygons_of
from vico.io.arrays import new_array, npz_bytes
from vico.io.files import write_bytes
from vico.world.city import EDGE, HIGH, LEVELS, LOW, SMOOTH
from vico.world.heights import Decks, HeightField, Stairs
from vico.worldgen.facts.streets import StreetPolygons
from vico.worldgen.seams.grid import Tile, TileGrid
from vico.worldgen.seams.heights import cropped
from vico.worldgen.seams.streets import KINDS


@dataclass(frozen=True)
class TileShape:
    """What of a tile its city's streets depend on, in the tile's coordinates.

    Attributes
    ----------
    solids
        Footprints of what stands there, of buildings beyond the border only those of its own.
    open_ways
        Ids of the ways on decks and in tunnels that can be used.
    streets
        As its neighbours see them, too.
    """

    solids: list[Polygon]
    open_ways: frozenset[int]
    streets: StreetPolygons


def streets_of(shapes: Mapping[Tile, TileShape], grid: TileGrid) -> StreetPolygons:
    """Put the streets of tiles together: polygons alone, without the lines they were made of."""
    parts: dict[str, list[Polygon]] = {kind: [] for kind in KINDS}
    paved: dict[str, list[Polygon]] = {}
    for tile, shape in shapes.items():
        square, (x, y) = grid.box(tile, seen_from=tile), grid.centre(tile)
        for kind in KINDS:
            parts[kind] += _within(getattr(shape.streets, kind), square, x, y)
        for name, polygons in shape.streets.paved.items():
            paved.setdefault(name, []).extend(_within(polygons, square, x, y))
    whole = {kind: _united(found) for kind, found in parts.items()}
    return StreetPolygons(
        **whole, streets=[], crossings=[], rails=[], paved={name: _united(found) for name, found in paved.items()}
    )


def _within(shape: MultiPolygon, square: Polygon, x: float, y: float) -> list[Polygon]:
    return [translate(part, x, y) for part in polygons_of(overlay.intersection(shape, square))]


def _united(parts: Sequence[Polygon]) -> MultiPolygon:
    return MultiPolygon(polygons_of(overlay.union_all(parts))) if parts else MultiPolygon()


def solids_of(shapes: Mapping[Tile, TileShape], grid: TileGrid) -> list[Polygon]:
    """Return the footprints of what stands in all tiles, in the city's coordinates."""
    return [translate(solid, *grid.centre(tile)) for tile, shape in shapes.items() for solid in shape.solids]


def write_ground(folder: Path, grid: TileGrid, levels_of: Callable[[Tile], HeightField]) -> None:
    """Write the heights of a whole city, tile by tile: no more than one is held in memory.

    Parameters
    ----------
    folder
        Where to.
    grid
        The city's tiles.
    levels_of
        Reads the ground of a tile, over its square and more.
    """
    smooth, stepped = 2, 2
    for tile in grid:
        field = cropped(levels_of(tile), half=grid.size / 2)
        smooth = max(smooth, field.heights.shape[0])
        stepped = max(stepped, 2 if field.steps is None else len(field.steps.edge))
    sides = 2 * grid.reach + 1
    decks: list[Decks] = []
    stairs: list[Stairs] = []
    with ExitStack() as files:

        def made(name: str, samples: int, kind: Any, fill: float = 0) -> NDArray[Any]:
            side = sides * (samples - 1) + 1
            return files.enter_context(new_array(folder / name, (side, side), kind, fill))

        heights = made(SMOOTH, smooth, np.float32)
        steps = [made(EDGE, stepped, np.int8, 127), made(LOW, stepped, np.int16), made(HIGH, stepped, np.int16)]
        for tile in grid:
            levels = levels_of(tile)
            field, (x, y) = cropped(levels, half=grid.size / 2), grid.centre(tile)
            _put(heights, _sampled(field, smooth), tile, grid)
            if field.steps is not None:
                _put(steps[0], field.steps.edge, tile, grid)
                _put(steps[1], field.steps.low, tile, grid)
                _put(steps[2], field.steps.high, tile, grid)
            decks += [] if levels.decks is None else [levels.decks.moved(x, y)]
            stairs += [] if levels.stairs is None else [levels.stairs.moved(x, y)]
    arrays: dict[str, NDArray[Any]] = {}
    arrays |= Decks.joined(decks).arrays() if decks else {}
    arrays |= Stairs.joined(stairs).arrays() if stairs else {}
    write_bytes(folder / LEVELS, npz_bytes(arrays))


def _sampled(field: HeightField, samples: int) -> NDArray[np.float32]:
    """Return smooth heights with so many samples a side."""
    if len(field.heights) == samples:
        return field.heights
    axis = np.linspace(-field.half, field.half, samples)
    points = np.stack(np.meshgrid(axis, axis), axis=-1)
    return field.smooth(points).astype(np.float32)


def _put(whole: NDArray[Any], part: NDArray[Any], tile: Tile, grid: TileGrid) -> None:
    side = len(part) - 1
    i, j = (side * k for k in grid.place(tile))
    whole[j : j + side + 1, i : i + side + 1] = part
