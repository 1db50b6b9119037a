"""Tunnels dive under streets and lead through hills: cuts in the ground, lanes below it, nobody in others' way."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import shapely

from road_city import lanes_of
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmArea, OsmData, OsmWay
from vico.sim.bodies.arrays import PEDESTRIAN, Bodies
from vico.sim.loop.checks import overlapping
from vico.sim.traffic import Traffic
from vico.sim.traffic.network import TrafficNetwork
from vico.world.heights import HeightField
from vico.world.lanes import LaneGraph
from vico.worldgen.facts.site import site_facts
from vico.worldgen.ground.grade_separation import Bridges, bridges_of
from vico.worldgen.ground.grading import grade_ground
from vico.worldgen.ground.stage import GROUND_APRON, ground_from_osm
from vico.worldgen.ground.stairs import flights_of
from vico.worldgen.ground.terrain import flat_terrain
from vico.worldgen.ground.tunnels import HEADROOM
from vico.worldgen.ground.yards import Yards
from vico.worldgen.streets.netconvert import road_network
from vico.worldgen.streets.polygons import road_polygons
from vico.worldgen.streets.roads import UNDERGROUND, is_traffic_street, roads_from_osm, streets_from_osm
from vico.worldgen.transit.bus_lines import Kerbs

HALF = 180.0


def _way(number: int, points: list[tuple[float, float]], **tags: str) -> OsmWay:
    nodes = [round(x) * 1000 + round(y) + 10_000_000 for x, y in points]
    return OsmWay(number, nodes, np.array(points, np.float64), False, tags)


def _town(*, mouth: float = 70.0) -> OsmData:
    """Six streets; the one along y = 0 passes below the one along x = 0, whatever else lies there."""
    marks = (-200.0, -150.0, 150.0, 200.0)
    ways = [
        _way(1, [(0, y) for y in marks], highway="residential"),
        _way(2, [(-200, 0), (-150, 0), (-mouth, 0)], highway="secondary"),
        _way(3, [(-mouth, 0), (mouth, 0)], highway="secondary", tunnel="yes", layer="-1"),
        _way(4, [(mouth, 0), (150, 0), (200, 0)], highway="secondary"),
        *(_way(10 + k, [(x, -200), (x, -150), (x, 0), (x, 150), (x, 200)], highway="residential")
          for k, x in enumerate((-150.0, 150.0))),
        *(_way(20 + k, [(-200, y), (-150, y), (0, y), (150, y), (200, y)], highway="residential")
          for k, y in enumerate((-150.0, 150.0))),
    ]  # fmt: skip
    return OsmData(LocalFrame(60.169, 24.9435), HALF, 60.0, [], ways, [], [])


def _bridges(town: OsmData, terrain: HeightField | None = None) -> tuple[Bridges, HeightField]:
    site = site_facts(town)
    streets = road_polygons(site)
    ground = grade_ground(terrain or flat_terrain(half=HALF), site, streets)
    bridges = bridges_of(site, ground, streets)
    return bridges, replace(ground, decks=bridges.levels())


@cache
def _dived() -> tuple[Bridges, HeightField, LaneGraph]:
    bridges, height = _bridges(_town())
    site = site_facts(_town())
    return bridges, height, lanes_of(road_network(site, streets_from_osm(site, (), bridges.open_ways), height))


def test_a_tunnel_dives_below_a_street_and_is_open_to_traffic() -> None:
    bridges, _, _ = _dived()
    (bore,) = bridges.bores
    street = np.abs(bore.line[:, 0]) < 8.0
    assert bore.covered[street].all()
    assert bore.z[street].max() < -HEADROOM
    assert np.abs(bore.z[[0, -1]]).max() < 0.2
    used = [s.way for s in streets_from_osm(site_facts(_town()), (), bridges.open_ways) if is_traffic_street(s)]
    assert used == [1, 2, 3, 4, 10, 11, 20, 21]
    assert bridges.portals == []


def test_lanes_follow_the_floor_and_meet_no_lane_above() -> None:
    _, height, lanes = _dived()
    for graph in (lanes, lanes.walks):
        assert np.abs(graph.z - height.near(np.c_[graph.points, graph.z])).max() < 0.15
    middle = shapely.Point(0, 0)
    here = [i for i in range(len(lanes)) if shapely.LineString(lanes.line(i)).distance(middle) < 6.0]
    z = {i: lanes.z[lanes.first[i] : lanes.first[i + 1]] for i in here}
    below = [i for i in here if z[i].min() < -HEADROOM]
    assert len(below) >= 2
    assert len(here) - len(below) >= 2
    assert not {int(k) for i in below for k in lanes.following(i)} & (set(here) - set(below))
    for lane in Kerbs(lanes, height).numbers.tolist():
        assert np.abs(lanes.z[lanes.first[lane] : lanes.first[lane + 1]]).max() < 1.0


def test_who_drives_in_goes_down_and_up_without_a_jump() -> None:
    _, height, _ = _dived()
    x = np.arange(-140.0, 140.0, 1.0)
    z = np.zeros_like(x)
    for k in range(1, len(x)):
        z[k] = height.near(np.array([x[k], 0.0, z[k - 1]]))
    assert z.min() < -HEADROOM
    assert np.abs(np.diff(z[1:])).max() < 0.16
    assert abs(z[-1]) < 0.2
    # Who walks over it stays above.
    y = np.arange(-30.0, 30.0, 1.0)
    assert np.abs(height.near(np.c_[np.zeros_like(y), y, np.zeros_like(y)])).max() < 0.2


def test_the_ground_is_open_over_the_ways_in_and_nowhere_else() -> None:
    bridges, height = _bridges(_town())
    cuts = shapely.union_all(bridges.cuts)
    site = site_facts(_town())
    bare, streets = replace(height, decks=None), road_polygons(site)
    surfaces = ground_from_osm(
        site, bare, streets, bridges, flights_of(site, bare, streets.steps), Yards(site.osm.half + GROUND_APRON)
    )
    x = np.arange(-66.0, 66.0, 1.5)
    corners = np.concatenate([s.positions[s.triangles] for s in surfaces]).astype(np.float64)
    level = np.abs(corners[..., 2]).max(axis=1) < 0.4
    ground = shapely.union_all(shapely.polygons(corners[level][..., :2]).astype(object))
    is_open = np.array([not ground.contains(shapely.Point(a, 0.0)) for a in x])
    deep = np.abs(x) < 60.0  # nearer to the mouths the floor itself is as high
    assert np.array_equal(is_open[deep], shapely.contains_xy(cuts, x[deep], 0.0))
    assert is_open.any()
    assert not is_open[np.abs(x) < 10.0].any()


def test_traffic_is_on_both_levels_and_nobody_is_in_the_way_of_the_other() -> None:
    _, height, lanes = _dived()
    traffic = Traffic(TrafficNetwork.of(lanes), height, cars=30, pedestrians=60, seed=3, first_entity=1)
    seen: set[tuple[bool, bool]] = set()
    before, together = traffic.bodies().position, 0
    for _ in range(700):
        traffic.advance(0.1, Bodies.none())
        bodies = traffic.bodies()
        at = bodies.position
        assert overlapping(bodies) == []
        near = np.hypot(*(at - before)[:, :2].T) < 3.0
        assert np.abs(at - before)[near, 2].max() < 0.3
        over = np.abs(at[:, :2]).max(axis=1) < 12.0
        low = at[:, 2] < -HEADROOM + 0.5
        seen.update(zip((bodies.kind[over] == PEDESTRIAN).tolist(), low[over].tolist(), strict=True))
        together += bool((over & low).any() and (over & ~low).any())
        before = at
    assert seen == {(False, False), (False, True), (True, False), (True, True)}
    assert together > 20
    assert float(traffic.fleet.stopped_time.max()) < 30.0


def test_a_tunnel_through_a_hill_leads_straight_on() -> None:
    axis = np.linspace(-HALF - 40.0, HALF + 40.0, 441)
    x, _ = np.meshgrid(axis, axis)
    hill = 14.0 * np.clip((66.0 - np.abs(x)) / 8.0, 0.0, 1.0)
    bridges, _ = _bridges(
        replace(_town(), ways=[way for way in _town().ways if way.id != 1]),
        HeightField(hill.astype(np.float32), HALF + 40.0),
    )
    (bore,) = bridges.bores
    assert np.ptp(bore.z) < 1.0
    assert bore.covered.mean() > 0.8


@pytest.mark.parametrize("why", ["short", "house", "private"])
def test_a_tunnel_without_a_way_in_stays_closed(why: str) -> None:
    town = _town(mouth=40.0 if why == "short" else 70.0)
    if why == "house":
        house = shapely.box(-60.0, -4.0, -50.0, 14.0)
        town = replace(town, areas=[OsmArea("w99", house, {"building": "yes"})])
    if why == "private":
        ways = [replace(way, tags=way.tags | {"access": "private"}) if way.id == 3 else way for way in town.ways]
        town = replace(town, ways=ways)
    bridges, _ = _bridges(town)
    assert bridges.bores == []
    assert bridges.cuts == []
    assert bridges.levels() is None
    closed = {
        road.osm_id: road.closed for road in roads_from_osm(site_facts(town), streets_from_osm(site_facts(town))).roads
    }
    assert closed[3] == UNDERGROUND
