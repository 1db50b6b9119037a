"""A bridge over a street: two levels of lanes and walkways, each where the ground or the deck is."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import shapely

from road_city import lanes_of
from vico.geo.frame import LocalFrame
from vico.geo.osm import OsmData, OsmWay
from vico.sim.bodies.arrays import PEDESTRIAN, Bodies
from vico.sim.loop.checks import overlapping
from vico.sim.traffic import Traffic
from vico.sim.traffic.network import TrafficNetwork
from vico.world.heights import HeightField
from vico.world.lanes import LaneGraph
from vico.worldgen.facts.site import CLEARANCE, site_facts
from vico.worldgen.ground.grade_separation import Bridges, bridges_of
from vico.worldgen.ground.grading import grade_ground
from vico.worldgen.ground.terrain import flat_terrain
from vico.worldgen.streets.netconvert import road_network
from vico.worldgen.streets.polygons import road_polygons
from vico.worldgen.streets.roads import is_traffic_street, streets_from_osm
from vico.worldgen.transit.bus_lines import Kerbs

HALF = 180.0


def _way(number: int, points: list[tuple[float, float]], **tags: str) -> OsmWay:
    nodes = [round(x) * 1000 + round(y) + 10_000_000 for x, y in points]
    return OsmWay(number, nodes, np.array(points, np.float64), False, tags)


def _town() -> OsmData:
    """Six streets; the one along y = 0 passes over the one along x = 0 on a bridge of 80 m, and over no other."""
    marks = (-200.0, -150.0, 150.0, 200.0)
    ways = [
        _way(1, [(0, y) for y in marks], highway="residential"),
        _way(2, [(-200, 0), (-150, 0), (-40, 0)], highway="secondary"),
        _way(3, [(-40, 0), (40, 0)], highway="secondary", bridge="yes", layer="1"),
        _way(4, [(40, 0), (150, 0), (200, 0)], highway="secondary"),
        *(_way(10 + k, [(x, -200), (x, -150), (x, 0), (x, 150), (x, 200)], highway="residential")
          for k, x in enumerate((-150.0, 150.0))),
        *(_way(20 + k, [(-200, y), (-150, y), (0, y), (150, y), (200, y)], highway="residential")
          for k, y in enumerate((-150.0, 150.0))),
    ]  # fmt: skip
    return OsmData(LocalFrame(60.169, 24.9435), HALF, 60.0, [], ways, [], [])


def _long_bridge() -> OsmData:
    """The same with a bridge that leads over a second street and out of the map."""
    others = [way for way in _town().ways if way.id not in (3, 4)]
    bridge = _way(3, [(-40, 0), (100, 0), (200, 0)], highway="secondary", bridge="yes", layer="1")
    return replace(_town(), ways=[*others, bridge])


@cache
def _levels(make: Callable[[], OsmData] = _town) -> tuple[Bridges, HeightField, LaneGraph]:
    site = site_facts(make())
    streets = road_polygons(site)
    ground = grade_ground(flat_terrain(half=HALF), site, streets)
    bridges = bridges_of(site, ground, streets)
    height = replace(ground, decks=bridges.levels())
    return bridges, height, lanes_of(road_network(site, streets_from_osm(site, (), bridges.usable), height))


def test_a_bridge_that_comes_down_to_the_ground_is_open_to_traffic() -> None:
    bridges, _, _ = _levels()
    assert bridges.usable == {3}
    used = [s.way for s in streets_from_osm(site_facts(_town()), (), bridges.usable) if is_traffic_street(s)]
    assert used == [1, 2, 3, 4, 10, 11, 20, 21]


def test_lanes_and_walkways_lie_on_the_deck_and_below_it_and_meet_nowhere() -> None:
    _, height, lanes = _levels()
    for graph in (lanes, lanes.walks):
        # Corners of pavements lie level between their ends.
        assert np.abs(graph.z - height.near(np.c_[graph.points, graph.z])).max() < 0.15
    middle = shapely.Point(0, 0)
    here = [i for i in range(len(lanes)) if shapely.LineString(lanes.line(i)).distance(middle) < 6.0]
    deck = [i for i in here if abs(lanes.line(i)[-1, 0] - lanes.line(i)[0, 0]) > 20.0]
    below = [i for i in here if i not in deck]
    assert deck
    assert below
    z = {i: lanes.z[lanes.first[i] : lanes.first[i + 1]] for i in here}
    assert max(float(z[i].max()) for i in below) < 0.1
    assert min(float(z[i].max()) for i in deck) > CLEARANCE
    # Nobody gets from one onto the other but over the ramps.
    assert not {int(k) for i in below for k in lanes.following(i)} & set(deck)
    assert np.hypot(*lanes.junction_position.T).min() > 100.0


def test_slopes_of_lanes_are_gentle_and_steady() -> None:
    _, height, _ = _levels()
    x = np.arange(-140.0, 140.0, 1.0)
    z = np.zeros_like(x)
    for k in range(1, len(x)):
        z[k] = height.near(np.array([x[k], 0.0, z[k - 1]]))
    assert z.max() > CLEARANCE
    assert np.abs(np.diff(z)).max() < 0.085


def test_traffic_drives_and_walks_on_both_levels_and_nobody_is_in_the_way_of_the_other() -> None:
    _, height, lanes = _levels()
    traffic = Traffic(TrafficNetwork.of(lanes), height, cars=30, pedestrians=60, seed=3, first_entity=1)
    seen: set[tuple[bool, bool]] = set()
    before = traffic.bodies().position
    crossed_at_once = 0
    for _ in range(900):
        traffic.advance(0.1, Bodies.none())
        bodies = traffic.bodies()
        at = bodies.position
        assert overlapping(bodies) == []
        # Who did not come in at the edge anew goes on without a jump in height.
        near = np.hypot(*(at - before)[:, :2].T) < 3.0
        assert np.abs(at - before)[near, 2].max() < 0.25
        under = np.abs(at[:, :2]).max(axis=1) < 12.0
        high = at[:, 2] > CLEARANCE - 0.5
        seen.update(zip((bodies.kind[under] == PEDESTRIAN).tolist(), high[under].tolist(), strict=True))
        crossed_at_once += bool((under & high).any() and (under & ~high).any())
        before = at
    assert seen == {(False, False), (False, True), (True, False), (True, True)}
    assert crossed_at_once > 20
    assert float(traffic.fleet.stopped_time.max()) < 30.0


def test_who_comes_in_on_a_deck_at_the_edge_of_the_map_minds_who_is_there() -> None:
    bridges, height, lanes = _levels(_long_bridge)
    assert bridges.usable == {3}
    network = TrafficNetwork.of(lanes)
    (deck,) = (int(i) for i in network.entries if lanes.z[lanes.first[i]] > CLEARANCE)
    traffic = Traffic(
        replace(network, entries=np.array([deck], np.int32)), height, cars=50, pedestrians=0, seed=2, first_entity=1
    )
    # Somebody stands where the only way in is.
    x, y, _ = lanes.at(deck, 3.0)
    place = np.array([[x, y, float(height.near(np.array([x, y, 10.0])))]])
    standing = replace(traffic.bodies().where(np.array([0])), entity=np.array([999], np.int32), position=place)
    for _ in range(400):
        traffic.advance(0.1, standing)
        assert overlapping(Bodies.joined([traffic.bodies(), standing])) == []


def test_heights_of_bodies_are_part_of_the_state() -> None:
    _, height, lanes = _levels()
    one, other = (
        Traffic(TrafficNetwork.of(lanes), height, cars=6, pedestrians=6, seed=3, first_entity=1) for _ in range(2)
    )
    for _ in range(300):
        one.advance(0.1, Bodies.none())
    other.restore(one.arrays())
    for traffic in (one, other):
        for _ in range(50):
            traffic.advance(0.1, Bodies.none())
    assert all(np.array_equal(a, b) for a, b in zip(one.arrays().values(), other.arrays().values(), strict=True))
    assert np.array_equal(one.bodies().position, other.bodies().position)


def test_a_bridge_too_steep_or_in_the_air_stays_closed() -> None:
    short = [way for way in _town().ways if way.id in (1, 3)]
    site = site_facts(replace(_town(), ways=short))
    streets = road_polygons(site)
    ground = grade_ground(flat_terrain(half=HALF), site, streets)
    bridges = bridges_of(site, ground, streets)
    assert bridges.usable == frozenset()
    assert bridges.levels() is None


def test_a_height_field_with_decks_is_read_as_it_was_written() -> None:
    _, height, _ = _levels()
    again = HeightField.from_arrays(height.arrays())
    places = np.random.default_rng(0).uniform(-60.0, 60.0, (500, 3)) * [1.0, 0.2, 0.1]
    assert np.array_equal(again.near(places), height.near(places))
    assert (height.near(places) - height(places)).max() > CLEARANCE


def test_nobody_walks_into_a_ramp_or_waits_for_a_bus_on_a_deck() -> None:
    bridges, height, lanes = _levels()
    x = np.arange(-40.0, 40.0, 0.5)
    places = np.c_[x, np.zeros_like(x)]
    rise = height.near(np.c_[places, np.full(len(x), 1e3)]) - height(places)
    low = shapely.contains_xy(shapely.union_all(bridges.low).buffer(1.6), *places.T)
    assert low[(rise > 0.5) & (rise < 2.2)].all()
    assert not low[rise > CLEARANCE].any()
    for lane in Kerbs(lanes, height).numbers.tolist():
        assert np.abs(lanes.z[lanes.first[lane] : lanes.first[lane + 1]]).max() < 1.0
