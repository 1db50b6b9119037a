"""Buses in traffic: they change lanes where their route does, are let in, and get out of jams along their route."""

import numpy as np
import pytest

from road_city import HALF, road_city
from vico.sim.bodies.arrays import RESIDENT, Bodies
from vico.sim.loop.checks import overlapping
from vico.sim.traffic import Traffic, TrafficNetwork
from vico.sim.traffic.lane_change import distance_to_let_in, places_to_let_in, room_to_change
from vico.sim.traffic.network import BEFORE_JUNCTION, stop_lines
from vico.sim.traffic.population import PATIENCE
from vico.sim.traffic.state import BusRoutes
from vico.sim.transit import plan_buses
from vico.world.heights import HeightField

KERB, BESIDE = "30259989_1", "30259989_2"  # lanes of 101 m before a junction, the second on the left of the first
BUS_LENGTH = 12.0


def _traffic(cars: int, *, start: float, stop: float) -> tuple[Traffic, int]:
    """A bus on a route that goes on in the lane beside, after a stop on the kerb's lane; and its number."""
    city = road_city()
    lanes = city.lanes
    network = TrafficNetwork.of(lanes, city.solids)
    route = [lanes.index[KERB], lanes.index[BESIDE]]
    while len(route) < 8:
        route.append(int(lanes.next[lanes.next_first[route[-1]]]))
    traffic = Traffic(
        network,
        HeightField.flat(HALF),
        cars=cars,
        pedestrians=0,
        seed=1,
        first_entity=1_000_000,
        buses=BusRoutes([route], [0], [(0, start)]),
    )
    traffic.fleet.stop_route_index[cars], traffic.fleet.stop_offset[cars] = 0, stop
    return traffic, cars


def _put(traffic: Traffic, v: int, lane: str, offset: float) -> None:
    assert traffic._place_vehicle(v, traffic.lanes.index[lane], offset, 0.1)


def _person(xy: tuple[float, float]) -> Bodies:
    one = np.full(1, 0.25)
    return Bodies(
        np.array([7], np.int32), np.array([RESIDENT], np.int8), np.array([[*xy, 0.0]]), np.zeros(1), one, one,
        np.array([1.7]), np.zeros((1, 2)),
    )  # fmt: skip


def test_a_bus_whose_route_goes_on_in_the_lane_beside_serves_its_stop_first() -> None:
    traffic, bus = _traffic(0, start=20.0, stop=60.0)
    for _ in range(300):
        traffic.advance(0.1, Bodies.none())
    assert traffic.fleet.at_stop[bus]
    assert traffic.lanes.ids[traffic.fleet.lane[bus]] == KERB
    assert traffic.fleet.offset[bus] == pytest.approx(60.0, abs=0.5)


def test_a_bus_that_has_to_change_lanes_in_a_queue_is_let_in() -> None:
    queue = 8
    traffic, bus = _traffic(queue, start=60.0, stop=20.0)
    for v in range(queue):
        _put(traffic, v, BESIDE, 95.0 - 9.0 * v)
    # Who is first in the queue cannot go on for a while: without being let in, the bus stands there until all are gone.
    somebody = _person(traffic.lanes.at(traffic.lanes.index[BESIDE], 98.0)[:2])
    overlaps = 0
    for step in range(900):
        others = somebody if step < 300 else Bodies.none()
        traffic.advance(0.1, others)
        overlaps += len(overlapping(traffic.bodies(), 0.0))
        if traffic.lanes.ids[traffic.fleet.lane[bus]] == BESIDE:
            break
    behind = traffic.fleet.offset[:queue][traffic.fleet.lane[:queue] == traffic.lanes.index[BESIDE]]
    assert traffic.lanes.ids[traffic.fleet.lane[bus]] == BESIDE
    assert (behind < traffic.fleet.offset[bus] - BUS_LENGTH).any()
    assert overlaps == 0


def test_vehicles_behind_a_bus_that_wants_to_change_stop_for_it_and_those_beside_it_do_not() -> None:
    traffic, bus = _traffic(2, start=60.0, stop=20.0)
    _put(traffic, 0, BESIDE, 30.0)
    _put(traffic, 1, BESIDE, 58.0)
    fleet = traffic._vehicles
    places = places_to_let_in(traffic._net, fleet, traffic.shapes)
    assert distance_to_let_in(fleet[0], places) == pytest.approx(60.0 - BUS_LENGTH - 4.0 - 30.0, abs=0.5)
    assert distance_to_let_in(fleet[1], places) > 1e6
    assert distance_to_let_in(fleet[bus], places) > 1e6
    fleet["speed"][0] = 12.0  # too fast to stop in time
    assert distance_to_let_in(fleet[0], places) > 1e6
    fleet["speed"][0], fleet["granted_count"][0] = 0.0, 1  # let into the junction: others wait for it to go
    assert distance_to_let_in(fleet[0], places) > 1e6
    fleet["granted_count"][0], fleet["at_stop"][bus] = 0, True
    assert places_to_let_in(traffic._net, fleet, traffic.shapes).min() > 1e6


def _people_on(traffic: Traffic, lane: str) -> list[Bodies]:
    """Return people who keep a bus from changing to a lane from its middle on."""
    return [_person(traffic.lanes.at(traffic.lanes.index[lane], at)[:2]) for at in (52.0, 60.0, 68.0, 76.0, 84.0, 92.0)]


def test_a_bus_waits_for_room_to_change_lanes_where_it_can_end_the_change_before_the_junction() -> None:
    traffic, bus = _traffic(0, start=60.0, stop=20.0)
    others = Bodies.joined(_people_on(traffic, BESIDE))
    for _ in range(300):
        traffic.advance(0.1, others)
    left = traffic.lanes.length[traffic.lanes.index[KERB]] - traffic.fleet.offset[bus]
    assert left == pytest.approx(room_to_change(traffic._net, traffic._vehicles[bus]), abs=1.0)


def test_a_bus_in_a_jam_whose_stop_is_taken_goes_on_from_before_it() -> None:
    traffic, bus = _traffic(0, start=60.0, stop=20.0)
    route = traffic._net.route
    stop = max(k for k in range(len(route)) if traffic.lanes.inside[route[k]] < 0)
    traffic.fleet.stop_route_index[bus], traffic.fleet.stop_offset[bus] = stop, 20.0
    at_stop = _person(traffic.lanes.at(int(route[stop]), 15.0)[:2])
    others = Bodies.joined([*_people_on(traffic, BESIDE), at_stop])
    for _ in range(int(PATIENCE * 10) + 100):
        traffic.advance(0.1, others)
    assert [jam.entity for jam in traffic.jams.rescued()] == [1_000_000]
    assert 1 < traffic.fleet.route_index[bus] <= stop
    assert not len(overlapping(Bodies.joined([traffic.bodies(), others]), 0.0))


def test_stop_lines_are_set_back_at_few_lanes_and_only_for_buses() -> None:
    city = road_city()
    lanes, routes = city.lanes, plan_buses(city.transit, city.lanes, 8 * 3600.0).bus_routes.routes
    found = stop_lines(lanes, routes)
    assert (stop_lines(lanes, []) == BEFORE_JUNCTION).all()
    assert 0 < (found > BEFORE_JUNCTION).sum() < 20
    assert found.max() < 6.6


@pytest.mark.parametrize(
    ("bus_lane", "car_lane"),
    [(KERB, BESIDE), ("127809159#2_1", "-4243036#0_1"), ("369151175#0_1", "14472965#0_1")],
)
def test_a_bus_turns_past_a_car_that_waits_at_the_end_of_another_lane(bus_lane: str, car_lane: str) -> None:
    city = road_city()
    lanes = city.lanes
    start = lanes.index[bus_lane]
    routes = [list(r) for r in plan_buses(city.transit, lanes, 8 * 3600.0).bus_routes.routes if start in r]
    begin = routes[0].index(start)
    route = routes[0][begin:] + routes[0][:begin]
    traffic = Traffic(
        TrafficNetwork.of(lanes, city.solids),
        HeightField.flat(HALF),
        cars=1,
        pedestrians=0,
        seed=1,
        first_entity=1_000_000,
        buses=BusRoutes([route], [0], [(0, float(lanes.length[start]) - 7.0)]),
    )
    fleet, car, bus = traffic.fleet, 0, 1
    fleet.stop_route_index[bus] = len(route) - 2
    _put(traffic, car, car_lane, float(lanes.length[lanes.index[car_lane]]) - 14.0)
    waited, overlaps, is_past = 0, 0, False
    for _ in range(180):
        traffic.advance(0.1, Bodies.none())
        overlaps += len(overlapping(traffic.bodies(), 0.0))
        waited += lanes.ids[fleet.lane[car]] == car_lane and fleet.speed[car] < 0.1
        on_street = fleet.lane[bus] != start and lanes.zone[fleet.lane[bus]] < 0
        is_past |= bool(on_street and fleet.offset[bus] > BUS_LENGTH)
    assert waited > 5
    assert overlaps == 0
    assert is_past
    assert lanes.ids[fleet.lane[car]] != car_lane


def test_a_bus_with_several_lanes_to_change_waits_for_the_first_change_where_it_may_begin_it() -> None:
    traffic, bus = _traffic(0, start=15.5, stop=10.0)
    there_and_back = [traffic.lanes.index[lane] for lane in (KERB, BESIDE, KERB, BESIDE)]
    traffic._net.route[: len(there_and_back)] = there_and_back
    length = traffic.lanes.length[traffic.lanes.index[KERB]]
    assert length - room_to_change(traffic._net, traffic._vehicles[bus]) >= BUS_LENGTH + 3.0
    reached = 0
    for _ in range(180):
        traffic.advance(0.1, Bodies.none())
        reached = max(reached, int(traffic.fleet.route_index[bus]))
    assert reached >= len(there_and_back) - 1
