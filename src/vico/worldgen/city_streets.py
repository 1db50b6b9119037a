"""The streets of a whole city: one network of lanes and one of public transport, of which each tile gets its part."""

from __future__ import annotations

import math
import re
from collections.abc import Set
from dataclasses import dataclass, replace
from hashlib import sha256
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vico.geo.osm import OsmData
from vico.io.files import read_json, sha256_of, write_bytes, write_json
from vico.io.memory import give_back_memory
from vico.world.city import (
    EDGE,
    HIGH,
    LOW,
    NET,
    ROADS,
    SMOOTH,
    TRANSIT,
    WHOLE,
    XODR,
    release_pages,
    whole_ground,
)
from vico.world.city import (
    LEVELS as LEVELS_OF_CITY,
)
from vico.world.heights import HeightField
from vico.world.lanes import read_lanes
from vico.world.model import Point2, Point3, Roads, StageReport
from vico.world.transit import Transit
from vico.world.world import write_record
from vico.worldgen.city_region import CityRequest, RegionMap
from vico.worldgen.facts.site import site_facts
from vico.worldgen.seams.joins import CUT, Tile, TileGrid, tile_name
from vico.worldgen.seams.mosaic import NetworkCutter, TileShape, solids_of, streets_of, write_ground
from vico.worldgen.stages import SUFFIX, Stages, load_product, read_head, store_product
from vico.worldgen.streets.lane_shapes import CarriagewayEdges
from vico.worldgen.streets.netconvert import RoadNetwork, road_network
from vico.worldgen.streets.roads import closed_roads, roads_from_osm, streets_from_osm
from vico.worldgen.transit.stage import transit_from_osm
from vico.worldgen.transit.waiting import waiting_places

#: Products of a tile: its shape without the ground, and the ground.
SHAPE, LEVELS = "shape", "levels"
#: Folder of the products of a city's streets, among the plans.
STREETS = "streets"
_GROUND, _DONE = "ground.json", "streets.json"
# What is written of a whole city's streets, and of its ground.
_FILES, _HEIGHTS = (ROADS, NET, XODR, TRANSIT), (SMOOTH, EDGE, LOW, HIGH, LEVELS_OF_CITY)
# A tile knows the streets so far around it, metres.
_AROUND = 40.0
_LANE = re.compile(rb'<lane id="([^"]*)"')


@dataclass(frozen=True)
class TileStreets:
    """A tile's part of its city's streets, in the tile's coordinates.

    Attributes
    ----------
    roads
        Those that reach into it, whole; junctions and crossings in it.
    network
        The lanes of streets near it, whole.
    transit
        Stops and stations in it; lines that drive there, with all their stops and lanes.
    """

    roads: Roads
    network: RoadNetwork
    transit: Transit


def make_streets(request: CityRequest, region: RegionMap) -> list[StageReport]:
    """Make a city's streets of what its tiles are, write them, and keep each tile's part for its build.

    Where its map and the shapes of its tiles are what they were, and all that was made of them is there, nothing is.

    Parameters
    ----------
    request
        Which city.
    region
        Its map.

    Returns
    -------
    list of StageReport
        What was made and left out.
    """
    (request.out / WHOLE).mkdir(parents=True, exist_ok=True)
    # All that is read, or will be, of the shapes of tiles is in one digest.
    digests: list[str] = []
    for tile in _tiles_with_shape(request):
        folder = request.plans / tile_name(tile)
        digests += [tile_name(tile), *(read_head(folder / f"{name}{SUFFIX}")[1] for name in (SHAPE, LEVELS))]
    both = sha256("\n".join(digests).encode()).hexdigest()
    known = request.plans / STREETS / _DONE
    key = sha256(f"{region.key} {request.seed} {both}".encode()).hexdigest()
    content = read_json(known) if known.exists() else {}
    if content.get("key") == key and content["made"] == _output_digests(request):
        return [StageReport.model_validate(one) for one in content["reports"]]
    known.unlink(missing_ok=True)
    reports = _make(request, region.of_city, both)
    told = [report.model_dump(mode="json") for report in reports]
    write_json(known, {"key": key, "made": _output_digests(request), "reports": told})
    return reports


def _output_digests(request: CityRequest) -> dict[str, str]:
    """Return digests of all that streets are made into, as far as it is there."""
    whole = request.out / WHOLE
    digests = {name: sha256_of(whole / name) for name in _FILES if (whole / name).exists()}
    # Of heights there are gigabytes.
    digests |= {name: str((whole / name).stat().st_size) for name in _HEIGHTS if (whole / name).exists()}
    for tile in request.grid:
        part = request.plans / tile_name(tile) / f"{CUT}{SUFFIX}"
        if part.exists():
            digests[tile_name(tile)] = read_head(part)[1]
    return digests


def _make(request: CityRequest, data: OsmData, both: str) -> list[StageReport]:
    """Make the streets of a map and of its tiles' shapes, whose digest is `both`."""
    shapes = _Shapes(
        {tile: load_product(request.plans / tile_name(tile), SHAPE)[0] for tile in _tiles_with_shape(request)}
    )
    whole = request.out / WHOLE
    known = request.plans / STREETS / _GROUND
    is_there = known.exists() and all((whole / name).exists() for name in _HEIGHTS)
    if not (is_there and read_json(known) == {"key": both}):
        write_ground(whole, request.grid, lambda tile: _levels(request, tile))
        write_json(known, {"key": both})
    stages = Stages(request.plans / STREETS)
    register = stages.register
    data = register(data, f"{data.sha256} {data.frame} {data.half} {data.box}")
    with stages.timer("facts"):
        site = register(site_facts(data), f"facts {stages.digest(data)}")
    levels = register(whole_ground(whole, data.half), f"levels {both}")
    height = register(replace(levels, decks=None, stairs=None), f"ground {both}")
    solids = register(solids_of(shapes, request.grid), f"solids {both}")
    streets = stages.run("polygons", streets_of, register(shapes, both), request.grid)
    usable, tiles = frozenset(way for shape in shapes.values() for way in shape.open_ways), list(shapes)
    del shapes  # hundreds of megabytes in 27 km², and of no use any more
    give_back_memory()
    ways = stages.run(STREETS, streets_from_osm, site, solids, usable)
    roads = stages.run("roads", roads_from_osm, site, ways)
    kerbs = register(CarriagewayEdges(streets.carriageway, solids), f"kerbs {both}")
    release_pages(levels)
    network = stages.run("network", road_network, site, ways, levels, kerbs)
    release_pages(levels)  # half a gigabyte in 27 km²
    write_record(whole / ROADS, roads)
    write_bytes(whole / NET, network.net_xml)
    write_bytes(whole / XODR, network.xodr or b"")
    lanes = register(read_lanes(whole / NET), f"lanes {sha256(network.net_xml).hexdigest()}")
    mapped = stages.run("transit", transit_from_osm, site, lanes, levels, solids=solids, seed=request.seed)
    release_pages(levels)
    with stages.timer("waiting"):
        transit = waiting_places(mapped, streets, lanes, height, solids)
    write_record(whole / TRANSIT, transit)
    counts = {"roads": len(roads.roads), "junctions": len(roads.junctions), "lanes": len(lanes)}
    stages.report("roads", counts, closed_roads(roads))
    counts = {
        "stops": len(transit.stops),
        "lines": len(transit.lines),
        "tram_lines": len(transit.tram_lines),
        "bike_stations": len(transit.bike_stations),
    }
    stages.report("transit", counts, transit.left_out)
    cutter = NetworkCutter(network.net_xml)
    lines = [np.array(road.line) for road in roads.roads]
    boxes = np.array([[*line.min(axis=0), *line.max(axis=0)] for line in lines]).reshape(-1, 4)
    for tile in tiles:
        shift = _Shift(request.grid, tile)
        net = cutter.within(half=request.grid.size / 2 + _AROUND, east=shift.by[0], north=shift.by[1])
        served = {name.decode() for name in _LANE.findall(net)}
        part = TileStreets(_roads_in(roads, boxes, shift), RoadNetwork(net, None), _transit_in(transit, shift, served))
        store_product(request.plans / tile_name(tile), CUT, part)
    return stages.reports


def _tiles_with_shape(request: CityRequest) -> list[Tile]:
    """Return the tiles that have a shape."""
    return [tile for tile in request.grid if (request.plans / tile_name(tile) / f"{SHAPE}{SUFFIX}").exists()]


class _Shapes(dict[Tile, TileShape]):
    """The shapes of tiles; unlike a plain dictionary's, stages don't keep their inputs alive that are of this class."""


def _levels(request: CityRequest, tile: Tile) -> HeightField:
    """Return the ground of a tile; as it was planned where nothing could be made on it."""
    folder = request.plans / tile_name(tile)
    made = (folder / f"{LEVELS}{SUFFIX}").exists()
    levels: HeightField = load_product(folder, LEVELS if made else "grading")[0]
    return levels


class _Shift:
    """Tells coordinates of a city from the middle of a tile, and whether they lie in it."""

    def __init__(self, grid: TileGrid, tile: Tile) -> None:
        self.by, self._size, self._grid, self._tile = grid.centre(tile), grid.size, grid, tile

    def point(self, xy: Point2) -> Point2:
        return round(xy[0] - self.by[0], 3), round(xy[1] - self.by[1], 3)

    def point3(self, xyz: Point3) -> Point3:
        return (*self.point(xyz[:2]), xyz[2])

    def has(self, xy: Point2 | Point3) -> bool:
        own = math.floor(xy[0] / self._size + 0.5), math.floor(xy[1] / self._size + 0.5)
        return self._grid.nearest(own) == self._tile

    def reached_by(self, boxes: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return which of some boxes (west, south, east, north) reach into the tile or near it."""
        half = self._size / 2 + _AROUND
        low, high = boxes[:, :2] - self.by, boxes[:, 2:] - self.by
        return np.flatnonzero((low <= half).all(axis=1) & (high >= -half).all(axis=1))


def _roads_in(roads: Roads, boxes: NDArray[np.float64], shift: _Shift) -> Roads:
    near = [roads.roads[k] for k in shift.reached_by(boxes).tolist()]
    return Roads(
        roads=[road.model_copy(update={"line": [shift.point(xy) for xy in road.line]}) for road in near],
        junctions=[
            junction.model_copy(update={"position": shift.point(junction.position)})
            for junction in roads.junctions
            if shift.has(junction.position)
        ],
        crossings=[shift.point(xy) for xy in roads.crossings if shift.has(xy)],
    )


def _transit_in(transit: Transit, shift: _Shift, lanes: Set[str]) -> Transit:
    def waits(stops: list[Any]) -> list[Any]:
        return [s.model_copy(update={"wait": shift.point3(s.wait)}) for s in stops if shift.has(s.wait)]

    return Transit(
        stops=waits(transit.stops),
        lines=[line for line in transit.lines if not lanes.isdisjoint(line.lanes)],
        bike_stations=[
            station.model_copy(update={"position": shift.point3(station.position)})
            for station in transit.bike_stations
            if shift.has(station.position)
        ],
        origin=transit.origin,
        tram_stops=waits(transit.tram_stops),
        tram_lines=[],
    )
