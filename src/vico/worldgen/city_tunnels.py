"""The tunnels of a whole city: which can be used and how they lie is decided once, by all their mouths.

A tile knows of a tunnel what lies in it; its neighbour would lay another floor, or close it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.affinity import translate
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.world.heights import HeightField
from vico.worldgen.city_map import RegionMap
from vico.worldgen.city_request import CityRequest
from vico.worldgen.facts.site import site_facts
from vico.worldgen.ground.terrain import APRON
from vico.worldgen.ground.tunnels import Bore, Box, bores_of, paved_of, tunnel_ways
from vico.worldgen.product import read_head
from vico.worldgen.seams.grid import Tile, TileGrid, tile_name
from vico.worldgen.seams.join import BORES, JOINED, Seamless
from vico.worldgen.stages import SUFFIX, Stages, keep_product, kept_product

Floats = NDArray[np.float64]

_BESIDE = 40.0  # metres beside a tunnel's line whose ground and streets say whether it can be used
_INSIDE = 1.0  # metres from the city's edge from which on the ground is known
_MORE = 10.0  # metres beyond what a tile knows of the ground that it is told of tunnels


def tiles_with_tunnels(request: CityRequest, region: RegionMap) -> list[Tile]:
    """Return the tiles in or close to which there are tunnels that could be used."""
    stages = Stages(request.plans)
    stages.given(region, region.key)
    found = stages.run("tunnels", _tiles_with_tunnels, region, request.grid)
    return [(column, row) for column, row in found]


def divide_tunnels(request: CityRequest, region: RegionMap, tiles: Sequence[Tile]) -> None:
    """Decide the tunnels of a city, and keep for each tile those near it.

    Parameters
    ----------
    request
        Which city.
    region
        Its map.
    tiles
        Those with tunnels: their ground and streets have been joined with their neighbours'.
    """
    stages = Stages(request.plans)
    stages.given(region, region.key)
    heads = [read_head(request.plans / tile_name(tile) / f"{JOINED}{SUFFIX}")[1] for tile in tiles]
    ground = stages.given(_Joined(request, tiles), "\n".join(heads))
    bores = stages.run("bores", _bores, region, ground)
    for tile in request.grid:
        keep_product(request.plans / tile_name(tile), BORES, _near(bores, tile, request.grid))


def _window(grid: TileGrid) -> Box:
    west, south, east, north = grid.edges
    return west + _INSIDE, south + _INSIDE, east - _INSIDE, north - _INSIDE


def _tiles_with_tunnels(region: RegionMap, grid: TileGrid) -> list[Tile]:
    lines = [shapely.LineString(way.line) for way in tunnel_ways(region.whole, _window(grid))]
    tree = shapely.STRtree([grid.box(tile) for tile in grid])
    near = tree.query(np.array(lines, object), predicate="dwithin", distance=_BESIDE)[1] if lines else []
    chosen = set(np.asarray(near, np.int64).tolist())
    return [tile for k, tile in enumerate(grid) if k in chosen]


def _bores(region: RegionMap, joined: _Joined) -> list[Bore]:
    if not joined.tiles:
        return []
    osm, window = region.whole, _window(joined.request.grid)
    ends = np.concatenate([way.line[[0, -1]] for way in tunnel_ways(osm, window)])
    ground = joined.ground(ends)
    return bores_of(site_facts(osm), ground, window, ground.paved)


@dataclass(frozen=True)
class _Joined:
    """Tiles whose ground has been joined with their neighbours'; it is read when it is asked for."""

    request: CityRequest
    tiles: Sequence[Tile]

    def ground(self, ends: Floats) -> _Ground:
        """Read the ground; kerbs are looked at where tunnels end, metres, shape ``(n, 2)``: they take gigabytes."""
        grid, paved = self.request.grid, []
        heights: dict[Tile, HeightField] = {}
        kerbed, owner = np.zeros(len(ends)), _owners(ends, self.tiles, grid)
        for k, tile in enumerate(self.tiles):
            joined: Seamless = kept_product(self.request.plans / tile_name(tile), JOINED)[0]
            kerbed[owner == k] = joined.height(ends[owner == k] - grid.centre(tile))
            heights[tile] = replace(joined.height, steps=None)
            own = overlay.intersection(paved_of(joined.streets), grid.box(tile, seen_from=tile))
            paved.append(translate(own, *grid.centre(tile)))
        return _Ground(
            grid, heights, shapely.STRtree(shapely.points(ends)), kerbed, overlay.union_all(paved, grid=None)
        )


def _owners(points: Floats, tiles: Sequence[Tile], grid: TileGrid) -> NDArray[np.int64]:
    """Return which tile each point lies in, or of those that are there is nearest to."""
    away = np.abs(points[:, None] - np.array([grid.centre(tile) for tile in tiles])[None]).max(axis=2)
    return np.asarray(away.argmin(axis=1), np.int64)


@dataclass(frozen=True)
class _Ground:
    """The ground of some tiles of a city, in the city's coordinates, and where people and vehicles move on it."""

    grid: TileGrid
    heights: Mapping[Tile, HeightField]
    ends: shapely.STRtree
    kerbed: Floats
    paved: BaseGeometry

    def smooth(self, xy: Floats) -> Floats:
        """Return heights without kerbs at points, metres; of those in other tiles the nearest there are."""
        points = np.asarray(xy, np.float64).reshape(-1, 2)
        owner = _owners(points, list(self.heights), self.grid)
        found = np.empty(len(points))
        for k, (tile, field) in enumerate(self.heights.items()):
            mine = owner == k
            if mine.any():
                found[mine] = field.smooth(points[mine] - self.grid.centre(tile))
        return found.reshape(np.shape(xy)[:-1])

    def __call__(self, xy: Floats) -> Floats:
        """Return heights with kerbs at ends of tunnels, metres."""
        return np.asarray(self.kerbed[self.ends.nearest(shapely.points(xy))])


def _near(bores: Sequence[Bore], tile: Tile, grid: TileGrid) -> list[Bore]:
    """Return what of tunnels is near a tile, told from its middle."""
    middle = np.array(grid.centre(tile))
    reach = grid.size / 2 + APRON + _MORE
    found: list[Bore] = []
    for bore in bores:
        line = bore.line - middle
        inside = (np.abs(line) <= reach).all(axis=1)
        # With a point more at both ends, so that the pieces that lead out of it are whole.
        kept = np.convolve(inside, (True, True, True), "same") > 0
        ends = np.flatnonzero(np.diff(np.concatenate([[False], kept, [False]]).astype(np.int8)))
        for first, last in ends.reshape(-1, 2).tolist():
            if last - first > 1:
                part = slice(first, last)
                way = replace(bore.way, line=bore.way.line - middle)
                found.append(replace(bore, way=way, line=line[part], z=bore.z[part], covered=bore.covered[part]))
    return found
