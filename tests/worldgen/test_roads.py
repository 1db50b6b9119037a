"""The road database and the network netconvert makes, on real maps."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

from road_city import HALF, PLACES, lanes_of, network_of, road_city, roads_of
from vico.errors import MissingExtraError
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmArea, OsmData, OsmWay
from vico.worldgen.facts.driving_side import drives_left, keeps_left
from vico.worldgen.facts.expendable import listening
from vico.worldgen.facts.levels import OVER_A_STREET
from vico.worldgen.facts.site import SiteFacts, site_facts
from vico.worldgen.streets import netconvert
from vico.worldgen.streets.netconvert import RoadNetwork, netconvert_binary
from vico.worldgen.streets.roads import (
    THROUGH_A_BUILDING,
    UNDERGROUND,
    NetworkStreet,
    closed_roads,
    is_traffic_street,
    streets_from_osm,
)


def test_no_road_leaves_the_window() -> None:
    roads = roads_of(road_city().osm)
    reach = max(abs(v) for road in roads.roads for point in road.line for v in point)
    assert reach <= HALF + 1e-3


def test_every_junction_joins_three_drivable_roads_at_its_place() -> None:
    roads = roads_of(road_city().osm)
    lines = {road.id: road.line for road in roads.roads}
    for junction in roads.junctions:
        assert len(junction.roads) >= 3
        for road in junction.roads:
            assert junction.position in (lines[road][0], lines[road][-1])


def test_central_helsinki_has_the_junctions_the_map_shows() -> None:
    # 157 junctions of drivable ways in the map (driveways and car parks among them), a third of them private.
    assert 80 <= len(roads_of(road_city().osm).junctions) <= 160


def test_reversed_oneways_run_in_the_direction_of_travel() -> None:
    osm = road_city().osm
    way = next(w for w in osm.ways if w.tags.get("oneway") == "yes" and w.tags.get("highway") == "residential")
    turned = replace(way, tags=way.tags | {"oneway": "-1"})
    (street,) = streets_from_osm(site_facts(replace(osm, half=10_000.0, ways=[turned])))
    assert street.nodes == way.nodes[::-1]


def test_equal_input_gives_equal_network_bytes() -> None:
    city = road_city()
    assert network_of(city.osm) == city.network


def test_network_files_hold_neither_time_nor_path() -> None:
    network = road_city().network
    for content in (network.net_xml, network.xodr):
        assert b"<!--" not in content
        assert b"/tmp" not in content


def test_a_window_without_streets_has_a_network_without_lanes() -> None:
    network = network_of(replace(road_city().osm, ways=[]))
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


def _street(number: int, corners: list[tuple[float, float]], **tags: str) -> OsmWay:
    nodes = [100 * number + k for k in range(len(corners))]
    return OsmWay(number, nodes, np.array(corners, float), False, {"highway": "residential", **tags})


def _map(*ways: OsmWay, lat: float = 60.169, lon: float = 24.9435, country: str = "") -> OsmData:
    frame = LocalFrame(lat, lon)
    house = shapely.box(-5, 30, 5, 40)
    areas = [OsmArea("w900", house, {"building": "yes", "addr:country": country})] if country else []
    return OsmData(frame, 150.0, 60.0, [], list(ways), areas, [])


def test_ways_are_closed_for_a_reason_that_the_report_names() -> None:
    osm = _map(
        _street(1, [(-90, 0), (-20, 0)], tunnel="building_passage"),
        _street(2, [(-90, 20), (-20, 20)], covered="yes"),
        _street(3, [(-90, 40), (-20, 40)], tunnel="yes"),
        _street(4, [(0, -90), (0, 90)]),
        _street(5, [(-40, -50), (40, -50)], bridge="yes", layer="1"),
        _street(6, [(20, 60), (90, 60)], layer="-1"),
    )
    house = shapely.box(-60, 10, -40, 30)
    open_ = [street.way for street in streets_from_osm(site_facts(osm), [house]) if is_traffic_street(street)]
    assert open_ == [1, 4]
    assert {d.id: d.reason for d in closed_roads(roads_of(osm, [house]))} == {
        "w2": THROUGH_A_BUILDING,
        "w3": UNDERGROUND,
        "w5": OVER_A_STREET,
        "w6": UNDERGROUND,
    }


@pytest.mark.parametrize(
    ("lat", "lon", "left"),
    [
        (51.515, -0.103, True), (53.35, -6.26, True), (50.95, 1.86, False), (50.73, 1.61, False), (35.68, 139.7, True),
        (35.18, 129.08, False), (43.1, 131.9, False), (22.3, 114.17, True), (22.55, 114.06, False), (19.0, 72.8, True),
        (31.55, 74.3, True), (34.5, 69.2, False), (13.75, 100.5, True), (17.97, 102.6, False), (1.3, 103.8, True),
        (-33.9, 151.2, True), (-12.8, 28.2, True), (-11.66, 27.5, False), (-8.8, 13.2, False), (-33.9, 18.4, True),
        (18.0, -76.8, True), (20.0, -75.8, False), (60.17, 24.94, False), (43.73, 7.42, False), (35.9, 14.5, True),
    ],
)  # fmt: skip
def test_which_side_traffic_keeps_to(lat: float, lon: float, left: bool) -> None:
    assert drives_left(lat, lon) is left


def test_the_country_of_addresses_goes_before_the_coarse_map() -> None:
    assert keeps_left(_map(country="MT"))
    assert not keeps_left(_map(lat=51.5, lon=-0.1, country="fr"))


@pytest.mark.parametrize(("country", "side"), [("GB", -1.0), ("FI", 1.0)])
def test_oncoming_lanes_lie_on_the_side_the_country_says(country: str, side: float) -> None:
    osm = _map(_street(1, [(-90, 0), (90, 0)], lanes="4"), _street(2, [(0, -90), (0, 90)]), country=country)
    lanes = lanes_of(network_of(osm))
    assert lanes.lefthand is (country == "GB")
    east = [k for k in np.flatnonzero(lanes.inside < 0) if lanes.line(k)[-1, 0] - lanes.line(k)[0, 0] > 20]
    assert east
    for lane in east:
        # Eastbound lanes lie south of the middle where traffic keeps right, the kerb's the farthest out.
        assert np.sign(lanes.line(lane)[:, 1]).tolist() == [-side] * len(lanes.line(lane))
        if lanes.left[lane] >= 0:
            assert abs(lanes.line(lane)[0, 1]) > abs(lanes.line(int(lanes.left[lane]))[0, 1])


def test_a_bridge_over_water_is_open_to_traffic_walkers_and_buses(shared_data: Path) -> None:
    city = road_city(shared_data / "places" / "andorra" / "andorra.osm.pbf", 42.50745, 1.52536)
    lanes, walks = city.lanes, city.lanes.walks
    bridge = 225345368  # Pont Prat de la Creu over the Valira
    assert bridge not in {road.osm_id for road in roads_of(city.osm).roads if road.closed}
    deck = shapely.LineString(next(way.line for way in city.osm.ways if way.id == bridge)).buffer(6, cap_style="flat")
    over = {
        lanes.ids[k]
        for k in np.flatnonzero((lanes.inside < 0) & (lanes.component == 0) & ~lanes.buses_only)
        if shapely.intersection(shapely.LineString(lanes.line(k)), deck).length > 8.0
    }
    assert over
    assert any(over.intersection(line.lanes) for line in city.transit.lines)
    walked = (shapely.intersection(shapely.LineString(walks.line(k)), deck).length for k in range(len(walks)))
    assert max(walked) > 8.0


def test_a_street_that_netconvert_refuses_costs_itself_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    site = site_facts(road_city().osm)
    streets = streets_from_osm(site)
    used = [street for street in streets if is_traffic_street(street)]
    bad, converted = used[len(used) // 2].way, netconvert._converted

    def refusing(
        binary: Path, site: SiteFacts, some: Sequence[NetworkStreet], height: None, kerbs: None = None
    ) -> RoadNetwork:
        if any(street.way == bad for street in some):
            raise netconvert.NetconvertError("road network: netconvert gave no network")
        return converted(binary, site, some, height, kerbs)

    monkeypatch.setattr(netconvert, "_converted", refusing)
    with listening() as losses:
        network = netconvert.road_network(site, streets)
    assert losses.ids == {f"w{bad}"}
    monkeypatch.undo()
    rest = [street for street in streets if street.way != bad]
    assert network == netconvert.road_network(site, rest)
