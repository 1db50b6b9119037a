"""Stops, lines and bicycle stations planned on real maps."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from road_city import HALF, PLACES, STRIP, lanes_of, road_city
from vico.world.heights import HeightField
from vico.world.lanes import LaneGraph
from vico.world.transit import Line, Transit
from vico.worldgen.facts.site import site_facts
from vico.worldgen.streets.netconvert import empty_network
from vico.worldgen.transit.bus_lines import scaled_by_area, width_in_districts
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


def test_stops_stations_and_tracks_of_a_rectangle_lie_in_it() -> None:
    city, whole = road_city(edges=STRIP), road_city()
    _check(city.transit, city.lanes)
    assert len(city.transit.stops) < len(whole.transit.stops)
    stations = [station.position[:2] for station in city.transit.bike_stations]
    mapped = [s.position[:2] for s in whole.transit.bike_stations if city.osm.holds(s.position[:2], inset=6.0)]
    assert mapped
    assert set(mapped) <= set(stations)
    assert city.osm.holds(np.array(stations)).all()
    tracks = [np.array(line.track) for line in city.transit.tram_lines]
    assert tracks
    for track in tracks:
        assert city.osm.holds(track, inset=-0.01).all()
        # In at one edge and out at another.
        assert not city.osm.holds(track[[0, -1]], inset=3.0).any()
    # People wait beside lanes and tracks.
    waits = np.array([stop.wait[:2] for stop in (*city.transit.stops, *city.transit.tram_stops)])
    assert city.osm.holds(waits, inset=-8.0).all()


def test_planned_racks_stand_in_a_rectangle_as_many_as_its_area_takes() -> None:
    osm = road_city().osm
    nodes = [node for node in osm.nodes if node.tags.get("amenity") != "bicycle_rental"]
    areas = [area for area in osm.areas if area.tags.get("amenity") != "bicycle_rental"]
    strip = road_city(edges=STRIP)
    site = site_facts(replace(osm, nodes=nodes, areas=areas, edges=STRIP))
    transit = transit_from_osm(site, strip.lanes, HeightField.flat(HALF))
    assert transit.origin["bike_stations"] == "planned"
    assert len(transit.bike_stations) == round(690.0 * 260.0 / 40_000.0) == 4
    spots = np.array([station.position[:2] for station in transit.bike_stations])
    assert site.osm.holds(spots, inset=5.0, edge=False).all()
    # And on footways where there are no streets.
    paths = replace(site.osm, ways=[way for way in osm.ways if way.tags.get("highway") == "footway"])
    bare = transit_from_osm(site_facts(paths), lanes_of(empty_network(osm.frame, HALF)), HeightField.flat(HALF))
    spots = np.array([station.position[:2] for station in bare.bike_stations])
    assert len(spots) == 4
    assert site.osm.holds(spots, inset=5.0, edge=False).all()


@given(st.floats(10.0, 9_000.0), st.floats(10.0, 9_000.0))
def test_places_have_lines_by_their_area_as_long_as_their_longer_side_asks_for(wide: float, high: float) -> None:
    half = max(wide, high)
    osm = replace(road_city().osm, half=half, edges=(-half, 10.0 - high, wide - half, 10.0))
    assert width_in_districts(osm) == pytest.approx(max(1.0, max(wide, high) / 1200.0))
    assert scaled_by_area(3, osm) == pytest.approx(max(3.0, 3.0 * wide * high / 1200.0**2), abs=0.51)
    square = replace(osm, edges=None)
    assert width_in_districts(square) == max(1.0, half / 600.0)
    assert scaled_by_area(3, square) == round(3 * width_in_districts(square) ** 2)


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
