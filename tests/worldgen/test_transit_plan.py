"""Stops, lines and bicycle stations planned on real maps."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

from road_city import HALF, PLACES, road_city
from vico.world.heights import HeightField
from vico.world.lanes import LaneGraph
from vico.world.transit_model import Line, Transit
from vico.worldgen.facts.site import site_facts
from vico.worldgen.transit.stage import BUS_LENGTH, transit_from_osm


def _is_closed_drive(line: Line, lanes: LaneGraph) -> bool:
    numbers = [lanes.index[lane] for lane in line.lanes]
    for a, b in zip(numbers, numbers[1:] + numbers[:1], strict=True):
        beside = b in (lanes.left[a], lanes.right[a])
        if b not in lanes.following(a) and not beside:
            return False
    return True


def _check(transit: Transit, lanes: LaneGraph) -> None:
    stops = {stop.id: stop for stop in transit.stops}
    assert transit.lines
    assert max(len(line.stops) for line in transit.lines) >= 4
    for line in transit.lines:
        assert len(set(line.stops)) == len(line.stops) >= 2
        assert _is_closed_drive(line, lanes)
        assert all(stops[stop].lane in line.lanes for stop in line.stops)
        assert line.travel == sorted(line.travel)
        assert len(line.travel) == len(line.stops) + 1


def test_helsinki_has_a_closed_line_over_its_mapped_stops() -> None:
    city = road_city()
    assert city.transit.origin["stops"] == "osm"
    _check(city.transit, city.lanes)


def test_a_bus_at_any_stop_stands_whole_on_its_lane() -> None:
    city = road_city()
    for stop in city.transit.stops:
        length = city.lanes.length[city.lanes.index[stop.lane]]
        assert BUS_LENGTH < stop.offset < length


def test_people_wait_beside_the_lane_and_outside_buildings() -> None:
    city = road_city()
    for stop in city.transit.stops:
        point = shapely.Point(stop.wait[:2])
        lane = shapely.LineString(city.lanes.line(city.lanes.index[stop.lane]))
        assert 1.5 < lane.distance(point) < 8.0
    tree = shapely.STRtree(city.solids)
    inside = tree.query([shapely.Point(s.wait[:2]) for s in city.transit.stops], predicate="within")[0]
    assert not len(inside)


def test_departures_run_from_five_to_eleven_at_night_every_six_to_ten_minutes() -> None:
    for line in road_city().transit.lines:
        gaps = set(np.diff(line.departures).tolist())
        assert 0 <= line.departures[0] - 5 * 3600 < 600
        assert 22.8 * 3600 < line.departures[-1] <= 23 * 3600
        assert len(gaps) == 1
        assert 360 <= gaps.pop() <= 600


def test_a_window_with_one_street_has_a_line_up_and_down() -> None:
    city = road_city(half=200.0)
    assert city.transit.origin["lines"] == "planned"
    (line,) = city.transit.lines
    assert len(line.stops) >= 2
    assert _is_closed_drive(line, city.lanes)


def test_racks_stand_off_the_carriageway() -> None:
    city = road_city()
    for station in city.transit.bike_stations:
        near = city.lanes.nearest(station.position[:2])
        assert near is None or near[2] > city.lanes.width[near[0]] / 2


def test_without_mapped_stops_a_line_is_planned() -> None:
    city = road_city()
    bare = replace(
        city.osm,
        nodes=[n for n in city.osm.nodes if n.tags.get("highway") != "bus_stop" and "public_transport" not in n.tags],
        areas=[],
        relations=[],
    )
    transit = transit_from_osm(site_facts(bare), city.lanes, HeightField.flat(HALF))
    assert transit.origin["stops"] == "planned"
    _check(transit, city.lanes)


def test_equal_input_gives_equal_transit() -> None:
    city = road_city()
    again = transit_from_osm(site_facts(city.osm), city.lanes, HeightField.flat(HALF), solids=city.solids)
    assert again == city.transit


@pytest.mark.parametrize("place", PLACES)
def test_other_cities_have_a_closed_line(place: str, shared_data: Path) -> None:
    city = road_city(shared_data / "places" / place / f"{place}.osm.pbf", *PLACES[place])
    _check(city.transit, city.lanes)
