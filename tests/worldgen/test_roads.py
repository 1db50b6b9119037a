"""The road database and the network netconvert makes, on real maps."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from road_city import HALF, PLACES, lanes_of, road_city
from vico.errors import MissingExtraError
from vico.worldgen.netconvert import netconvert_binary, road_network
from vico.worldgen.roads import roads_from_osm, streets_from_osm


def test_no_road_leaves_the_window() -> None:
    roads = roads_from_osm(road_city().osm)
    reach = max(abs(v) for road in roads.roads for point in road.line for v in point)
    assert reach <= HALF + 1e-3


def test_every_junction_joins_three_drivable_roads_at_its_place() -> None:
    roads = roads_from_osm(road_city().osm)
    lines = {road.id: road.line for road in roads.roads}
    for junction in roads.junctions:
        assert len(junction.roads) >= 3
        for road in junction.roads:
            assert junction.position in (lines[road][0], lines[road][-1])


def test_central_helsinki_has_the_junctions_the_map_shows() -> None:
    # 157 junctions of drivable ways in the map (driveways and car parks among them), a third of them private.
    assert 80 <= len(roads_from_osm(road_city().osm).junctions) <= 160


def test_reversed_oneways_run_in_the_direction_of_travel() -> None:
    osm = road_city().osm
    way = next(w for w in osm.ways if w.tags.get("oneway") == "yes" and w.tags.get("highway") == "residential")
    turned = replace(way, tags=way.tags | {"oneway": "-1"})
    (street,) = streets_from_osm(replace(osm, ways=[turned]), 10_000.0)
    assert street.nodes == way.nodes[::-1]


def test_equal_input_gives_equal_network_bytes() -> None:
    city = road_city()
    assert road_network(city.osm) == city.network


def test_network_files_hold_neither_time_nor_path() -> None:
    network = road_city().network
    for content in (network.net_xml, network.xodr):
        assert b"<!--" not in content
        assert b"/tmp" not in content


def test_a_window_without_streets_has_a_network_without_lanes() -> None:
    network = road_network(replace(road_city().osm, ways=[]))
    assert len(lanes_of(network)) == 0
    assert b"<OpenDRIVE>" in network.xodr


def test_without_netconvert_the_message_says_what_to_type(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.metadata.files", lambda _: None)
    with pytest.raises(MissingExtraError, match=r"pip install 'virtual-community\[worldgen\]'"):
        netconvert_binary()


@pytest.mark.parametrize("place", PLACES)
def test_other_cities_give_a_network_within_their_window(place: str, shared_data: Path) -> None:
    city = road_city(shared_data / "places" / place / f"{place}.osm.pbf", *PLACES[place])
    assert len(city.lanes) > 200
    assert np.abs(city.lanes.points).max() < HALF + 20.0
