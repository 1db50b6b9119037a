"""A tile's streets and ground, and those of its neighbours, made one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import shapely
from shapely import Polygon

from vico.world.heights import HeightField
from vico.worldgen.facts.building_plans import BuildingPlans
from vico.worldgen.facts.streets import StreetPolygons
from vico.worldgen.seams.grid import Tile, TileGrid, tile_name
from vico.worldgen.seams.heights import blended, cropped
from vico.worldgen.seams.streets import adopted

#: Product of the city's streets that a tile is given: its part of them.
CUT = "cut"
#: Product with what of the map lies in a tile and around it.
MAP = "map"
#: Product with the city's bodies of water in a tile and around it, as the whole city has them.
WATERS = "waters"
#: Product with the city's tunnels in a tile and around it.
BORES = "near bores"
#: Product of a tile's own streets and ground made one with its neighbours'.
JOINED = "seams"


@dataclass(frozen=True)
class TilePlace:
    """Which tile of which city a world is.

    Attributes
    ----------
    grid, tile
        The grid, and the tile's column and row.
    plans
        Folder of the folders with what all tiles planned: streets and graded ground.
    """

    grid: TileGrid
    tile: Tile
    plans: Path

    @property
    def own(self) -> Path:
        """Folder of what this tile planned."""
        return self.folder(self.tile)

    def folder(self, tile: Tile) -> Path:
        """Return the folder of what a tile planned."""
        return self.plans / tile_name(tile)


@dataclass(frozen=True)
class Seamless:
    """What of a tile's plan its neighbours have a say in."""

    streets: StreetPolygons
    height: HeightField


def seamless(
    grid: TileGrid, tile: Tile, streets: list[StreetPolygons], heights: list[HeightField], *, apron: float
) -> Seamless:
    """Make a tile's streets and heights one with its neighbours'.

    Parameters
    ----------
    grid, tile
        Which tile.
    streets, heights
        Of the tile and its neighbours, in the order of `TileGrid.around`.
    apron
        How far the heights go on beyond the tile, metres.
    """
    around = grid.around(tile)
    height = blended(dict(zip(around, heights, strict=True)), tile, grid)
    return Seamless(
        adopted(dict(zip(around, streets, strict=True)), tile, grid),
        cropped(height, half=grid.size / 2 + apron),
    )


def parted(plans: BuildingPlans, grid: TileGrid, tile: Tile) -> tuple[BuildingPlans, list[Polygon]]:
    """Return the buildings whose middle lies in a tile, and the footprints of those around it that other tiles have.

    What has its middle beyond the city stands in no tile: there is open ground.
    """
    square, (x, y) = grid.box(tile, seen_from=tile), grid.centre(tile)
    west, south, east, north = grid.edges
    city = shapely.box(west - x, south - y, east - x, north - y)
    middles = [plan.outline.centroid for plan in plans.plans]
    mine = [plan for plan, middle in zip(plans.plans, middles, strict=True) if square.contains(middle)]
    others = [
        plan
        for plan, middle in zip(plans.plans, middles, strict=True)
        if city.contains(middle) and not square.contains(middle)
    ]
    return BuildingPlans(mine, plans.dropped), [shape.shape for shape in BuildingPlans(others, []).standing()]
