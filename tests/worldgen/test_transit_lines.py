"""Bus lines of timetables and relations: driven, timed, named, or left out with a reason."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from road_city import HALF, RoadCity, lanes_of, network_of, road_city
from vico.geo.frame import LocalFrame
from vico.geo.gtfs import read_gtfs
from vico.geo.gtfs_feed import DAY, Feed, GtfsRoute, GtfsStop, Pattern
from vico.geo.osm import OsmData, OsmNode, OsmRelation, read_osm
from vico.rules import BUS_DWELL
from vico.sim.transit import plan_buses
from vico.world.heights import HeightField
from vico.world.lanes import LaneGraph
from vico.world.transit import Line, Transit, departure
from vico.worldgen.facts.site import site_facts
from vico.worldgen.streets.netconvert import empty_network
from vico.worldgen.transit.routes import interval_of, routes_from_osm
from vico.worldgen.transit.stage import transit_from_osm

FLAT = HeightField.flat(HALF)
CITIES = {
    "heidelberg": (49.41013, 8.70711),
    "london_city": (51.51521, -0.10294),
    "detroit": (42.33185, -83.04797),
    "andorra": (42.50745, 1.52536),
    "garmisch": (47.49264, 11.08940),
    "stockholm": (59.31612, 18.06403),
}


def _closed(line: Line, lanes: LaneGraph) -> bool:
    numbers = [lanes.index[lane] for lane in line.lanes]
    return all(
        b in lanes.following(a) or b in (lanes.left[a], lanes.right[a])
        for a, b in zip(numbers, numbers[1:] + numbers[:1], strict=True)
    )


def _driveable(transit: Transit, lanes: LaneGraph) -> None:
    for line in transit.lines:
        assert _closed(line, lanes)
        assert len(set(line.stops)) == len(line.stops) >= 2
        assert all(b > a for a, b in pairwise(line.travel))
        assert all(b > a for a, b in pairwise(line.departures))
        assert line.departures[0] >= 0
        assert line.departures[-1] <= DAY
    plan = plan_buses(transit, lanes, 8 * 3600.0)
    assert len(plan.line_of_bus) >= len(transit.lines)


def _feed(city: RoadCity, lines: int = 2) -> Feed:
    """A made timetable over four stops that a bus can drive past."""
    by_id = {stop.id: stop for stop in city.transit.stops}
    longest = max(city.transit.lines, key=lambda line: len(line.stops))
    spots = [by_id[stop].wait[:2] for stop in longest.stops[:4]]
    stops = tuple(GtfsStop(f"s{k}", f"Halt {k}", xy) for k, xy in enumerate(spots))
    routes = tuple(GtfsRoute(f"r{k}", f"{k + 1}", "", "bus", "#12ab34", "HSL") for k in range(lines))
    patterns = []
    for k in range(lines):
        there = tuple(stop.id for stop in stops)
        times = tuple(range(6 * 3600 + 120 * k, 26 * 3600, 1200))
        patterns.append(Pattern(f"r{k}", "0", there, times, (0, 60, 120, 180)))
    tram = GtfsRoute("t", "T9", "", "tram", "", "HSL")
    return Feed("feed.zip", "0" * 64, "2024-01-02", stops, (*routes, tram), tuple(patterns), "HSL")


def test_timetables_come_before_the_map_and_keep_names_colours_and_departures() -> None:
    city = road_city()
    transit = transit_from_osm(site_facts(city.osm), city.lanes, FLAT, solids=city.solids, feeds=[_feed(city)])
    _driveable(transit, city.lanes)
    line = transit.lines[0]
    # Two routes over the same stops are driven as one line with the buses of both.
    assert line.name == "1/2"
    assert line.colour == "#12ab34"
    assert "gtfs" in transit.origin["lines"]
    assert len(line.departures) == 120
    # Those after midnight come first; between them and the morning's there are none.
    assert line.departures[0] == 0
    assert sorted(set(np.diff(line.departures).tolist())) == [120, 1080, 4 * 3600 + 1080]
    assert "tram T9: its rails are not on the map, or not chosen" in [what.reason for what in transit.left_out]


def test_buses_leave_when_the_timetable_says() -> None:
    city = road_city()
    transit = transit_from_osm(site_facts(city.osm), city.lanes, FLAT, solids=city.solids, feeds=[_feed(city)])
    line = transit.lines[0]
    assert departure(line, 1) == line.departures[1]
    assert departure(line, len(line.departures)) == line.departures[0] + DAY
    assert departure(line, -1) == line.departures[-1] - DAY


def test_every_route_of_the_map_is_driven_or_left_out_with_a_reason() -> None:
    city = road_city()
    routes, untold = routes_from_osm(city.osm)
    driven = {name for line in city.transit.lines for name in line.name.split("/")}
    told = {what.id for what in city.transit.left_out}
    assert {what.id for what in untold} <= told
    assert all(route.name in driven or route.id in told for route in routes)


def test_a_timetable_of_which_no_line_can_be_driven_is_told() -> None:
    city = road_city()
    feed = _feed(city)
    far = replace(feed, stops=tuple(replace(stop, xy=(9000.0, 9000.0 + k)) for k, stop in enumerate(feed.stops)))
    transit = transit_from_osm(site_facts(city.osm), city.lanes, FLAT, solids=city.solids, feeds=[far])
    told = [what.reason for what in transit.left_out if what.id == "feed.zip"]
    assert told == [
        "gives no bus here: none of its bus routes can be driven on the map's streets; each is told of with its reason"
    ]
    assert "gtfs" not in transit.origin["lines"]


def test_stops_of_the_old_schema_make_two_runs() -> None:
    city = road_city()
    spots = [(-300.0, 0.0), (0.0, 0.0), (300.0, 0.0)]
    nodes = [OsmNode(10 * side + k, np.array([x, y + side]), {"highway": "bus_stop", "name": f"{k}"})
             for side in (1, 2) for k, (x, y) in enumerate(spots)]  # fmt: skip
    # The stops of the way back are listed in the order of the way there, as many are.
    made = OsmRelation(
        5,
        [("n", node.id, "forward_stop" if node.id < 20 else "backward_stop") for node in nodes],
        {"type": "route", "route": "bus", "ref": "99", "colour": "#abc", "interval": "00:15"},
    )
    (route,), _ = routes_from_osm(replace(city.osm, nodes=nodes, relations=[made]))
    assert (route.name, route.colour, route.interval) == ("99", "#aabbcc", 900)
    assert [pole.key for pole in route.there] == ["n10", "n11", "n12"]
    assert [pole.key for pole in route.back] == ["n22", "n21", "n20"]


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("10", 600), ("00:07:30", 450), ("01:00", 3600), ("PT20M", 1200), ("often", None), ("0", None), ("99:99", None)],
)
def test_intervals_as_the_map_writes_them(text: str, seconds: int | None) -> None:
    assert interval_of({"interval": text}) == seconds


def test_without_lanes_there_are_no_lines_but_a_reason_and_racks() -> None:
    city = road_city()
    bare = replace(city.osm, ways=[w for w in city.osm.ways if w.tags.get("highway") == "footway"])
    lanes = lanes_of(empty_network(bare.frame, HALF))
    transit = transit_from_osm(site_facts(bare), lanes, FLAT)
    assert (transit.stops, transit.lines) == ([], [])
    assert transit.left_out[-1].reason == "no streets for traffic in the window: none is planned"
    assert transit.bike_stations


@pytest.mark.slow
@pytest.mark.parametrize("place", CITIES)
def test_other_cities_have_driveable_lines(place: str, shared_data: Path) -> None:
    city = road_city(shared_data / "places" / place / f"{place}.osm.pbf", *CITIES[place])
    assert city.transit.lines
    _driveable(city.transit, city.lanes)
    assert len(city.transit.stops) + len(city.transit.lines) + len(city.transit.bike_stations) >= 9


@pytest.mark.slow
def test_heidelberg_drives_by_its_timetable(shared_data: Path) -> None:
    folder = shared_data / "places" / "heidelberg"
    city = road_city(folder / "heidelberg.osm.pbf", *CITIES["heidelberg"])
    feed = read_gtfs(folder / "gtfs_rnv_2016.zip", city.osm.frame, HALF)
    transit = transit_from_osm(site_facts(city.osm), city.lanes, FLAT, solids=city.solids, feeds=[feed])
    _driveable(transit, city.lanes)
    by_name = {line.name: line for line in transit.lines}
    assert by_name.keys() & {"33", "35"}
    assert all(len(line.departures) >= 50 for line in transit.lines)
    assert transit.origin["lines"] == "gtfs"


def _idle(line: Line) -> float:
    """Seconds that buses wait at their first stop for their time, after people boarded."""
    headway = float(np.median(np.diff(line.departures)))
    round_trip = line.travel[-1] + BUS_DWELL
    return float(np.ceil(round_trip / headway) * headway - round_trip)


def test_buses_drive_about_rather_than_wait_for_their_time() -> None:
    transit = road_city().transit
    assert len(transit.lines) > 3
    assert max(map(_idle, transit.lines)) < 75.0


def test_buses_with_a_long_wait_stand_in_lanes_that_no_other_line_drives() -> None:
    city = road_city()
    rare = [replace(r, tags={**r.tags, "interval": "02:00"}) for r in city.osm.relations]
    transit = transit_from_osm(site_facts(replace(city.osm, relations=rare)), city.lanes, FLAT, solids=city.solids)
    lane_of = {stop.id: stop.lane for stop in transit.stops}
    waiting = [line for line in transit.lines if _idle(line) > 60.0]
    assert waiting
    for line in waiting:
        others = {lane for other in transit.lines if other is not line for lane in other.lanes}
        assert lane_of[line.stops[0]] not in others


def test_no_more_than_two_lines_stop_at_a_place_and_not_at_one_time() -> None:
    lines = road_city().transit.lines
    for stop in {stop for line in lines for stop in line.stops}:
        here = [line for line in lines if stop in line.stops]
        assert len(here) <= 2
        assert len({line.departures[0] for line in here}) == len(here)


def test_what_is_left_out_names_the_lines_that_serve_its_stops() -> None:
    transit = road_city().transit
    served = [what.reason for what in transit.left_out if "are served by" in what.reason]
    assert served
    names = [name for line in transit.lines for name in line.name.split("/")]
    assert all(any(name in reason for name in names) for reason in served)


@pytest.fixture(scope="module")
def one_street(tmp_path_factory: pytest.TempPathFactory) -> tuple[OsmData, LaneGraph]:
    """A village along one street from west to east, which ends at both edges of the window."""
    path = tmp_path_factory.mktemp("street") / "street.osm"
    ends = "".join(f'<node id="{k}" lat="0" lon="{x / 111_200:.7f}"/>' for k, x in ((1, -150.0), (2, 150.0)))
    way = '<way id="1"><nd ref="1"/><nd ref="2"/><tag k="highway" v="secondary"/></way>'
    path.write_text(f'<osm version="0.6">{ends}{way}</osm>')
    osm = read_osm(path, LocalFrame(0.0, 0.0), 120.0, need_buildings=False)
    return osm, lanes_of(network_of(osm))


def _in_a_row(order: Sequence[int]) -> Feed:
    """A timetable with two buses along the village's street, past its stops in some order, 15 m south of the middle."""
    stops = tuple(GtfsStop(f"s{k}", f"Halt {k}", (-90.0 + 60.0 * k, -5.0)) for k in range(4))
    pattern = Pattern("r", "0", tuple(f"s{k}" for k in order), (8 * 3600, 9 * 3600), (0, 60, 120, 180))
    return Feed("f.zip", "0" * 64, "2024-01-02", stops, (GtfsRoute("r", "7", "", "bus", "", ""),), (pattern,), "")


@pytest.mark.parametrize("order", [(0, 1, 2, 3), (3, 2, 1, 0)])
def test_a_bus_of_a_village_along_one_street_turns_at_its_ends(
    one_street: tuple[OsmData, LaneGraph], order: tuple[int, ...]
) -> None:
    osm, lanes = one_street
    transit = transit_from_osm(site_facts(osm), lanes, HeightField.flat(120.0), feeds=[_in_a_row(order)])
    (line,) = transit.lines
    _driveable(transit, lanes)
    assert line.name == "7"
    names = {stop.id: stop.name for stop in transit.stops}
    # A round: where the list begins is nobody's business, but the order is the timetable's.
    called = [int(names[stop].split()[1]) for stop in line.stops]
    first = called.index(order[0])
    assert [*called[first:], *called[:first]] == list(order)
    at = line.departures[0] + line.travel[first]
    assert at == pytest.approx(8 * 3600, abs=60)
