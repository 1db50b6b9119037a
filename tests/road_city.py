"""Streets of real places for the tests of roads, lanes, transit and traffic: built once, and kept."""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from hashlib import sha256
from pathlib import Path

import shapely
from shapely.geometry.base import BaseGeometry

from shared_folders import FOLDERS
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmData, read_osm
from vico.geo.overlay import polygons_of
from vico.world.heights import HeightField
from vico.world.lanes import LaneGraph, read_lanes
from vico.world.model import Roads
from vico.world.transit import Transit
from vico.worldgen.facts.site import site_facts
from vico.worldgen.streets.netconvert import RoadNetwork, road_network
from vico.worldgen.streets.roads import roads_from_osm, streets_from_osm
from vico.worldgen.transit.stage import transit_from_osm

EXTRACT = Path(__file__).parents[1] / "src" / "vico" / "data" / "helsinki.osm.pbf"
HALF = 400.0
# West, south, east and north of a rectangle in that window, as of tiles in a row.
STRIP = (-390.0, -20.0, 300.0, 240.0)
# Centres of the extracts beside the checkout, degrees.
PLACES = {
    "monaco": (43.73384, 7.41813),
    "nyc_les": (40.72103, -73.98768),
    "berlin_mitte": (52.50930, 13.39295),
}


@dataclass(frozen=True)
class RoadCity:
    """A place's map data and what the road stages make of it."""

    osm: OsmData
    network: RoadNetwork
    lanes: LaneGraph
    transit: Transit
    solids: list[shapely.Polygon]


def roads_of(osm: OsmData, solids: Sequence[BaseGeometry] = ()) -> Roads:
    """The road database of a map."""
    site = site_facts(osm)
    return roads_from_osm(site, streets_from_osm(site, solids))


def network_of(osm: OsmData) -> RoadNetwork:
    """The lane-level network of a map."""
    site = site_facts(osm)
    return road_network(site, streets_from_osm(site))


def lanes_of(network: RoadNetwork) -> LaneGraph:
    """Read a network's lanes back from its file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "roads.net.xml"
        path.write_bytes(network.net_xml)
        return read_lanes(path)


@cache
def road_city(
    path: Path = EXTRACT,
    lat: float = 60.1690,
    lon: float = 24.9435,
    half: float = HALF,
    edges: tuple[float, float, float, float] | None = None,
) -> RoadCity:
    """Roads, lanes and transit of 800 m x 800 m; central Helsinki where nothing else is asked for."""

    def make() -> tuple[OsmData, RoadNetwork, Transit, list[shapely.Polygon]]:
        osm = replace(read_osm(path, LocalFrame(lat, lon), half), edges=edges)
        network = network_of(osm)
        solids = [
            polygon
            for area in osm.areas
            if area.tags.get("building", "no") != "no"
            for polygon in polygons_of(area.polygon)
        ]
        lanes = lanes_of(network)
        return osm, network, transit_from_osm(site_facts(osm), lanes, HeightField.flat(half), solids=solids), solids

    asked = repr((path.stat().st_size, path.stat().st_mtime_ns, lat, lon, half, edges)).encode()
    name = f"roads_{path.name.partition('.')[0]}_{sha256(asked).hexdigest()[:8]}"
    osm, network, transit, solids = FOLDERS.product(name, make, ["worldgen"])
    return RoadCity(osm, network, lanes_of(network), transit, solids)
