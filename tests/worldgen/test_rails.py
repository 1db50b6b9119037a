"""Trams: the map's routes on rails as tracks with stops and times."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import shapely

from road_city import HALF, road_city
from vico.geo.gtfs_feed import Feed, GtfsRoute, GtfsStop, Pattern
from vico.world.heights import HeightField
from vico.world.transit import TRAM_LENGTH, Track
from vico.worldgen.facts.site import site_facts
from vico.worldgen.transit.routes import trams_from_osm

FLAT = HeightField.flat(HALF)


def test_trams_of_central_helsinki_run_both_ways_on_the_rails_of_the_map() -> None:
    transit = road_city().transit
    mapped = [way.line for way in road_city().osm.ways if way.tags.get("railway") == "tram"]
    rails = shapely.MultiLineString(mapped)
    assert len(transit.tram_lines) == 6
    by_name = {line.name: line for line in transit.tram_lines}
    assert len(by_name) == 3
    stops = {stop.id: stop for stop in transit.tram_stops}
    for line in transit.tram_lines:
        track = Track(line.track)
        assert track.length > 500.0
        assert float(shapely.distance(rails, shapely.points(track.xy)).max()) < 0.2
        assert all(b - a > TRAM_LENGTH for a, b in pairwise(line.offsets))
        assert all(b > a for a, b in pairwise(line.travel))
        assert {b - a for a, b in pairwise(line.departures)} == {600}
        for name, offset in zip(line.stops, line.offsets, strict=True):
            x, y = track.at(offset - TRAM_LENGTH / 2)
            assert math.dist((x, y), stops[name].wait[:2]) < TRAM_LENGTH / 2
    # The two directions keep to tracks of their own: trams drive on the right.
    there, back = (Track(line.track) for line in transit.tram_lines if line.name == transit.tram_lines[0].name)
    at = there.xy[200:-200:40]
    left = []
    for k, point in enumerate(at[:-1]):
        ahead = at[k + 1] - point
        other = back.xy[int(np.argmin(np.hypot(*(back.xy - point).T)))] - point
        left.append(ahead[0] * other[1] - ahead[1] * other[0] > 0)
    assert np.mean(left) > 0.8


def test_trams_leave_by_the_timetable_that_names_their_line() -> None:
    city = road_city()
    stops, lines, _ = trams_from_osm(site_facts(city.osm), FLAT, first_entity=1)
    line = lines[0]
    wait = {stop.id: stop.wait for stop in stops}
    poles = tuple(GtfsStop(f"s{k}", name, wait[name][:2]) for k, name in enumerate(line.stops))
    times = tuple(range(6 * 3600, 20 * 3600, 900))
    travel = tuple(round(t - line.travel[0]) for t in line.travel[:-1])
    pattern = Pattern("t", "0", tuple(pole.id for pole in poles), times, travel)
    feed = Feed(
        "feed.zip", "0" * 64, "2024-01-02", poles, (GtfsRoute("t", line.name, "", "tram", "", ""),), (pattern,), ""
    )
    timed = trams_from_osm(site_facts(city.osm), FLAT, feeds=[feed], first_entity=1)[1][0]
    first = timed.departures[0] + timed.travel[0]
    assert abs(first - times[0]) < 60.0
    assert {b - a for a, b in pairwise(timed.departures)} == {900}


def test_a_railway_through_the_window_is_driven_beside_as_many_trams() -> None:
    osm = road_city().osm
    tags = {"type": "route", "route": "train", "ref": "R"}
    relations = [replace(r, tags=tags) if r.tags.get("ref") == "9" else r for r in osm.relations]
    _, lines, left_out = trams_from_osm(site_facts(replace(osm, relations=relations)), FLAT, first_entity=1)
    kinds = {line.name: line.kind for line in lines}
    assert kinds.pop("R") == "rail"
    assert list(kinds.values()) == ["tram"] * 3
    assert all("4 other lines" in dropped.reason for dropped in left_out)


def test_routes_on_bridges_over_streets_and_in_tunnels_are_no_lines() -> None:
    osm = road_city().osm
    under = [
        replace(way, tags=way.tags | {"tunnel": "yes", "layer": "-1"}) if way.tags.get("railway") == "tram" else way
        for way in osm.ways
    ]
    lines = trams_from_osm(site_facts(replace(osm, ways=under)), FLAT, first_entity=1)[1]
    assert [line for line in lines if line.kind == "tram"] == []
