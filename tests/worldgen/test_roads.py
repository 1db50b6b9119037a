"""The road database and the network netconvert makes, on real maps."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from road_city import HALF, PLACES, STRIP, lanes_of, network_of, road_city, roads_of
from vico.errors import MissingExtraError
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmArea, OsmData, OsmNode, OsmWay
from vico.worldgen.facts.fault_isolation import collect_losses
from vico.worldgen.facts.site import OVER_A_STREET, SiteFacts, site_facts
from vico.worldgen.facts.street_habits import drives_left, keeps_left
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


_numbers = st.integers(-160, 160).map(float)
_corners = st.lists(st.tuples(_numbers, _numbers), min_size=2, max_size=12)
_rectangles = st.tuples(*[st.integers(-150, -10)] * 2, *[st.integers(10, 150)] * 2).map(
    lambda sides: tuple(map(float, sides))
)


def _within(edges: tuple[float, float, float, float], corners: list[tuple[float, float]]) -> tuple[float, int]:
    """Metres of a line within a rectangle, and at most how many pieces of it lie there."""
    box = shapely.box(*edges)
    inside = [bool(box.covers(shapely.Point(xy))) for xy in corners]
    metres, runs = 0.0, sum(here and not before for before, here in zip([False, *inside], inside, strict=False))
    for a, b, here, there in zip(corners, corners[1:], inside, inside[1:], strict=False):
        within = shapely.LineString([a, b]).intersection(box).length
        metres += within
        runs += bool(within) and not (here or there)  # through without a node
    return metres, runs


@given(_corners, _rectangles)
def test_ways_are_cut_at_the_edges_of_a_rectangle(
    corners: list[tuple[float, float]], edges: tuple[float, float, float, float]
) -> None:
    streets = streets_from_osm(site_facts(replace(_map(_street(1, corners)), edges=edges)))
    metres, runs = _within(edges, corners)
    # Pieces of half a metre are none.
    assert metres - 0.5 * runs - 1e-6 <= sum(shapely.LineString(s.line).length for s in streets) <= metres + 1e-6
    west, south, east, north = edges
    for street in streets:
        assert (street.line >= np.array([west, south]) - 1e-9).all()
        assert (street.line <= np.array([east, north]) + 1e-9).all()
        for node, (x, y) in zip(street.nodes, street.line, strict=True):
            new = node < 0
            assert new or (x, y) == corners[node - 100]
            assert not new or min(abs(x - west), abs(x - east), abs(y - south), abs(y - north)) < 1e-9


@given(_corners, st.sampled_from([0.0, 5.0, 7.3]), st.integers(10, 160).map(float))
def test_a_rectangle_with_the_window_s_own_sides_is_the_window(
    corners: list[tuple[float, float]], inset: float, half: float
) -> None:
    square = replace(_map(_street(1, corners)), half=half)
    same = replace(square, edges=(-half, -half, half, half))
    points = np.array([*corners, (half, 0.0), (half - inset, 1.0), (inset - half, half - inset)])
    for osm in (square, same):
        assert osm.box == (-half, -half, half, half)
        assert osm.holds(points, inset=inset).tolist() == (np.abs(points).max(axis=1) <= half - inset).tolist()
        strict = np.abs(points).max(axis=1) < half - inset
        assert osm.holds(points, inset=inset, edge=False).tolist() == strict.tolist()
    one, other = (streets_from_osm(site_facts(osm)) for osm in (square, same))
    assert [(s.part, s.nodes, s.line.tolist()) for s in one] == [(s.part, s.nodes, s.line.tolist()) for s in other]
    # As ever: a segment that leaves is cut where the first of the four sides is met.
    for street in one:
        for node, xy in zip(street.nodes, street.line, strict=True):
            assert node > 0 or np.abs(xy).max() == pytest.approx(half, abs=1e-9)


def test_junctions_and_crossings_beyond_a_rectangle_are_left_out() -> None:
    ways = [_street(k, [(-100.0, y), (0.0, y), (100.0, y)]) for k, y in ((1, 0.0), (2, 40.0))] + [
        replace(_street(3, [(0.0, -90.0), (0.0, 0.0), (0.0, 40.0), (0.0, 90.0)]), nodes=[301, 101, 201, 304])
    ]
    nodes = [OsmNode(100 * k + 1, np.array([0.0, y]), {"highway": "crossing"}) for k, y in ((1, 0.0), (2, 40.0))]
    nodes.append(OsmNode(9, np.array([-99.0, 0.0]), {"highway": "crossing"}))
    osm = replace(_map(*ways), nodes=nodes)
    whole, part = roads_of(osm), roads_of(replace(osm, edges=(-50.0, -20.0, 120.0, 20.0)))
    assert sorted(j.position for j in whole.junctions) == [(0.0, 0.0), (0.0, 40.0)]
    assert sorted(whole.crossings) == [(-99.0, 0.0), (0.0, 0.0), (0.0, 40.0)]
    assert [j.position for j in part.junctions] == [(0.0, 0.0)]
    assert part.crossings == [(0.0, 0.0)]
    assert sorted({xy for road in part.roads for xy in road.line}) == [
        (-50.0, 0.0), (0.0, -20.0), (0.0, 0.0), (0.0, 20.0), (100.0, 0.0),
    ]  # fmt: skip


def test_the_network_of_a_rectangle_lies_in_it() -> None:
    city, whole = road_city(edges=STRIP), road_city()
    west, south, east, north = STRIP
    points = np.array([xy for road in roads_of(city.osm).roads for xy in road.line])
    assert (points.min(axis=0) >= [west - 1e-3, south - 1e-3]).all()
    assert (points.max(axis=0) <= [east + 1e-3, north + 1e-3]).all()
    assert 50 < len(city.lanes) < len(whole.lanes) / 2
    # Lanes and pavements lie beside the middles of streets.
    walks = np.concatenate([city.lanes.walks.line(k) for k in range(len(city.lanes.walks))])
    for lines in (city.lanes.points, walks):
        assert (lines.min(axis=0) > [west - 20.0, south - 20.0]).all()
        assert (lines.max(axis=0) < [east + 20.0, north + 20.0]).all()
    near = shapely.box(*STRIP).buffer(-25.0)
    there, here = (
        shapely.MultiLineString([c.lanes.line(k) for k in range(len(c.lanes))]).intersection(near)
        for c in (whole, city)
    )
    assert here.length == pytest.approx(there.length, rel=0.05)


def test_ways_are_closed_for_a_reason_that_the_report_names() -> None:
    osm = _map(
        _street(1, [(-90, 0), (-20, 0)], tunnel="building_passage"),
        _street(2, [(-90, 20), (-20, 20)], covered="yes"),
        _street(3, [(-90, 40), (-20, 40)], tunnel="yes"),
        _street(4, [(0, -90), (0, 90)]),
        _street(5, [(-40, -50), (40, -50)], bridge="yes", layer="1"),
        _street(6, [(20, 60), (90, 60)], location="underground"),
        _street(7, [(20, 80), (90, 80)], layer="-1"),
    )
    house = shapely.box(-60, 10, -40, 30)
    open_ = [street.way for street in streets_from_osm(site_facts(osm), [house]) if is_traffic_street(street)]
    assert open_ == [1, 4, 7]
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
    bad, converted = used[len(used) // 2].way, netconvert._convert

    def refusing(
        binary: Path, site: SiteFacts, some: Sequence[NetworkStreet], height: None, kerbs: None = None
    ) -> RoadNetwork:
        if any(street.way == bad for street in some):
            raise netconvert.NetconvertError("road network: netconvert gave no network")
        return converted(binary, site, some, height, kerbs)

    monkeypatch.setattr(netconvert, "_convert", refusing)
    with collect_losses() as losses:
        network = netconvert.road_network(site, streets)
    assert losses.ids == {f"w{bad}"}
    monkeypatch.undo()
    rest = [street for street in streets if street.way != bad]
    assert network == netconvert.road_network(site, rest)
