"""The request for a city, the map of its region, and waters and tunnels, which are decided once for the whole city.

How high waters lie is decided by all their banks. Which tunnels can be used, and how they lie, is decided by all
their mouths: a tile knows of a tunnel what lies in it alone, and its neighbour would lay another floor, or close it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.affinity import translate
from shapely.geometry.base import BaseGeometry

from vico.geo import overlay
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmData, checked_extract, read_osm
from vico.geo.overlay import polygons_of
from vico.io.files import sha256_of
from vico.world.heights import HeightField
from vico.worldgen.facts.fault_isolation import drop_on_failure
from vico.worldgen.facts.land_cover import sea_of_map, water_of_map
from vico.worldgen.facts.site import WaterBody, site_facts
from vico.worldgen.ground.kerbs_and_banks import piped_waters, water_bodies
from vico.worldgen.ground.terrain import APRON
from vico.worldgen.ground.tunnels import Bore, Box, bores_of, paved_of, tunnel_ways
from vico.worldgen.photos.texturing import Texturing
from vico.worldgen.request import Sources, WorldRequest
from vico.worldgen.seams.joins import BORES, HALO, JOINED, WATERS, JoinedTile, Tile, TileGrid, TilePlace, tile_name
from vico.worldgen.stages import SUFFIX, Stages, code_digest, load_product, read_head, store_product

PLANS = ".plans"


@dataclass(frozen=True)
class CityRequest:
    """Everything that decides what is in a city.

    Attributes
    ----------
    sources
        What to build from.
    lat, lon
        Its centre, degrees.
    grid
        Its tiles.
    seed
        Decides what the map leaves open.
    out
        Its folder.
    """

    sources: Sources
    lat: float
    lon: float
    grid: TileGrid
    seed: int
    out: Path

    @property
    def plans(self) -> Path:
        """Folder of what tiles planned."""
        return self.out / PLANS

    def place(self, tile: Tile) -> TilePlace:
        """Return which tile of the city a world is."""
        return TilePlace(self.grid, tile, self.plans)

    def tile(self, tile: Tile) -> WorldRequest:
        """Return what is asked of one tile's world."""
        place = self.place(tile)
        half = self.grid.size / 2
        return WorldRequest(self.sources, self.lat, self.lon, half, self.seed, Texturing(), None, False, place)

    def to_json(self) -> dict[str, Any]:
        """Return plain values."""
        return {
            "sources": self.sources.to_json(),
            "lat": self.lat,
            "lon": self.lon,
            "grid": asdict(self.grid),
            "seed": self.seed,
            "out": str(self.out),
        }

    @classmethod
    def from_json(cls, content: dict[str, Any]) -> CityRequest:
        """Return the request that `to_json` wrote."""
        grid = content["grid"]
        return cls(
            Sources.from_json(content["sources"]),
            content["lat"],
            content["lon"],
            TileGrid(grid["size"], (grid["first"][0], grid["first"][1]), (grid["last"][0], grid["last"][1])),
            content["seed"],
            Path(content["out"]),
        )


class RegionMap:
    """The map of a city's region; it is read when it is asked for.

    Attributes
    ----------
    key
        Of the file, of the code that reads it, and of the region: where it is the same, so is the map.
    """

    def __init__(self, request: CityRequest) -> None:
        self._path, self._grid = checked_extract(request.sources.osm), request.grid
        self._frame, self._reach = LocalFrame(request.lat, request.lon), request.grid.half + HALO
        where = f"{self._frame} {self._reach} {self._grid.edges} in tiles of {self._grid.size}"
        made_of = [code_digest(), sha256_of(self._path), where]
        self.key = sha256("\n".join(made_of).encode()).hexdigest()

    @cached_property
    def whole(self) -> OsmData:
        """The map of the square around the city, and what is near it."""
        whole = read_osm(self._path, self._frame, self._reach, need_buildings=False)
        # The sea is found for all tiles at once: a tile that no coastline meets could be land or sea.
        # Where that fails each tile looks for its own, and reports what is wrong.
        with drop_on_failure("sea"):
            reach = self._reach
            return replace(whole, sea=sea_of_map(whole, shapely.box(-reach, -reach, reach, reach)))
        return whole

    @property
    def of_city(self) -> OsmData:
        """The map as one that ends with the city's tiles."""
        whole = self.whole
        return replace(whole, half=self._grid.half, margin=whole.margin + HALO, edges=self._grid.edges)


def divide_waters(request: CityRequest, region: RegionMap, ground: HeightField) -> None:
    """Keep for each tile the bodies of water in and around it, as high everywhere as the whole city has them.

    How high a river lies is told by its banks, and how far below them by how large it is: of its part in one tile other
    numbers would come than next to it.
    """
    stages = Stages(request.plans)
    stages.register(region, region.key)
    bodies = stages.run("bodies", _bodies_of_water, region, ground)
    outlines = shapely.STRtree([body.outline for body in bodies])
    half = request.grid.size / 2 + HALO
    for tile in request.grid:
        middle = np.array(request.grid.centre(tile))
        window = shapely.box(*(middle - half), *(middle + half))
        near = [bodies[k] for k in np.sort(outlines.query(window, predicate="intersects")).tolist()]
        parts = [part for body in near for part in _part_of(body, window, middle)]
        store_product(request.plans / tile_name(tile), WATERS, parts)


def _bodies_of_water(region: RegionMap, ground: HeightField) -> list[WaterBody]:
    osm, half = region.whole, ground.half
    return water_bodies(ground, [*water_of_map(osm, shapely.box(-half, -half, half, half)), *piped_waters(osm)])


def _part_of(body: WaterBody, window: shapely.Polygon, middle: NDArray[np.float64]) -> list[WaterBody]:
    """Return the parts of a body in a window, as high as it is, in coordinates around another middle."""
    here = polygons_of(overlay.intersection(body.outline, window))
    return [replace(body, outline=translate(part, *(-middle).tolist()), shore=body.shore - middle) for part in here]


Floats = NDArray[np.float64]

_BESIDE = 40.0  # metres beside a tunnel's line whose ground and streets say whether it can be used
_INSIDE = 1.0  # metres from the city's edge from which on the ground is known
_MORE = 10.0  # metres beyond the ground of a tile within which it gets the tunnels


def tiles_with_tunnels(request: CityRequest, region: RegionMap) -> list[Tile]:
    """Return the tiles in or close to which there are tunnels that could be used."""
    stages = Stages(request.plans)
    stages.register(region, region.key)
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
    stages.register(region, region.key)
    heads = [read_head(request.plans / tile_name(tile) / f"{JOINED}{SUFFIX}")[1] for tile in tiles]
    ground = stages.register(_JoinedTiles(request, tiles), "\n".join(heads))
    bores = stages.run("bores", _bores, region, ground)
    for tile in request.grid:
        store_product(request.plans / tile_name(tile), BORES, _bores_near(bores, tile, request.grid))


def _window(grid: TileGrid) -> Box:
    west, south, east, north = grid.edges
    return west + _INSIDE, south + _INSIDE, east - _INSIDE, north - _INSIDE


def _tiles_with_tunnels(region: RegionMap, grid: TileGrid) -> list[Tile]:
    lines = [shapely.LineString(way.line) for way in tunnel_ways(region.whole, _window(grid))]
    tree = shapely.STRtree([grid.box(tile) for tile in grid])
    near = tree.query(np.array(lines, object), predicate="dwithin", distance=_BESIDE)[1] if lines else []
    chosen = set(np.asarray(near, np.int64).tolist())
    return [tile for k, tile in enumerate(grid) if k in chosen]


def _bores(region: RegionMap, joined: _JoinedTiles) -> list[Bore]:
    if not joined.tiles:
        return []
    osm, window = region.whole, _window(joined.request.grid)
    ends = np.concatenate([way.line[[0, -1]] for way in tunnel_ways(osm, window)])
    ground = joined.ground(ends)
    return bores_of(site_facts(osm), ground, window, ground.paved)


@dataclass(frozen=True)
class _JoinedTiles:
    """Tiles whose ground has been joined with their neighbours'; it is read when it is asked for."""

    request: CityRequest
    tiles: Sequence[Tile]

    def ground(self, ends: Floats) -> _CityGround:
        """Read the ground; kerbs are looked at where tunnels end, metres, shape ``(n, 2)``: they take gigabytes."""
        grid, paved = self.request.grid, []
        heights: dict[Tile, HeightField] = {}
        kerbed, owner = np.zeros(len(ends)), _owners(ends, self.tiles, grid)
        for k, tile in enumerate(self.tiles):
            joined: JoinedTile = load_product(self.request.plans / tile_name(tile), JOINED)[0]
            kerbed[owner == k] = joined.height(ends[owner == k] - grid.centre(tile))
            heights[tile] = replace(joined.height, steps=None)
            own = overlay.intersection(paved_of(joined.streets), grid.box(tile, seen_from=tile))
            paved.append(translate(own, *grid.centre(tile)))
        return _CityGround(
            grid, heights, shapely.STRtree(shapely.points(ends)), kerbed, overlay.union_all(paved, grid=None)
        )


def _owners(points: Floats, tiles: Sequence[Tile], grid: TileGrid) -> NDArray[np.int64]:
    """Return which tile each point lies in, or of those that are there is nearest to."""
    away = np.abs(points[:, None] - np.array([grid.centre(tile) for tile in tiles])[None]).max(axis=2)
    return np.asarray(away.argmin(axis=1), np.int64)


@dataclass(frozen=True)
class _CityGround:
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


def _bores_near(bores: Sequence[Bore], tile: Tile, grid: TileGrid) -> list[Bore]:
    """Return the parts of tunnels near a tile, in the tile's coordinates."""
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
