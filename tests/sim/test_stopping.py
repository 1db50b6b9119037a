"""Cars that park at the kerb and vans that make deliveries: on a smooth way, seen by others, exact, nothing touches."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import shapely

from road_city import HALF, road_city
from vico.sim.bodies.arrays import Bodies
from vico.sim.loop.checks import overlapping
from vico.sim.traffic import Traffic, TrafficNetwork
from vico.sim.traffic.lights import LEFT, RIGHT
from vico.sim.traffic.state import APPROACHING, BACKING_IN, DRIVING, LEAVING, NONE, STANDING, STOPPING_PLACE
from vico.sim.traffic.stopping_places import with_places, with_stopping_places
from vico.world.heights import HeightField

SIDE, TAPER = -2.9, 10.2


@cache
def _network(*, delivery: bool = False) -> TrafficNetwork:
    """Helsinki with a place halfway along each street lane that has room for one, backed into on every other one."""
    city = road_city()
    network = TrafficNetwork.of(city.lanes, city.solids)
    lanes = network.driven.lanes
    usable = (lanes["inside"] < 0) & (lanes["junction"] < 0) & ~lanes["closed"] & (lanes["length"] > 60.0)
    usable &= (lanes["right"] < 0) & ((lanes["left"] >= 0) | (not delivery))
    rows = np.flatnonzero(usable)
    places = np.zeros(len(rows), STOPPING_PLACE)
    places["lane"], places["middle"], places["longest"] = rows, lanes["length"][rows] / 2, 6.0
    places["side"], places["taper"] = (-0.4, 8.0) if delivery else (SIDE, TAPER)
    places["lot"] = NONE
    places["reverse"], places["delivery"] = ~delivery & (np.arange(len(rows)) % 2 == 1), delivery
    return replace(network, driven=with_places(network.driven, places))


def _traffic(network: TrafficNetwork, cars: int) -> Traffic:
    return Traffic(network, HeightField.flat(HALF), cars=cars, pedestrians=0, seed=4, first_entity=1)


def _advance(traffic: Traffic, steps: int) -> None:
    for _ in range(steps):
        traffic.advance(0.1, Bodies.none())


def test_cars_park_and_leave_again_and_repeat_exactly() -> None:
    network = _network()
    traffic = _traffic(network, 24)
    fleet, places = traffic.fleet, network.driven.places
    seen: dict[tuple[int, int], int] = {}
    saved: dict[str, Any] = {}
    forwards = backwards = 0
    for step in range(600):
        before, yaw = fleet.stopping.copy(), traffic.shapes.yaw.copy()
        _advance(traffic, 1)
        assert step % 8 or len(overlapping(traffic.bodies(), 0.0)) == 0
        turned = np.abs((traffic.shapes.yaw - yaw + np.pi) % (2 * np.pi) - np.pi)[before != DRIVING]
        assert turned.max(initial=0.0) < 0.13
        for v in np.flatnonzero(before != fleet.stopping).tolist():
            change = int(before[v]), int(fleet.stopping[v])
            seen[change] = seen.get(change, 0) + 1
            if change[1] == STANDING:
                place = places[fleet.place[v]]
                x, y, yaw_there = traffic.lanes.at(place["lane"], place["middle"])
                there = np.array([x - np.sin(yaw_there) * SIDE, y + np.cos(yaw_there) * SIDE])
                assert np.hypot(traffic.shapes.x[v] - there[0], traffic.shapes.y[v] - there[1]) < 0.6
                fleet.stay_left[v] = 5.0
                backwards, forwards = backwards + bool(place["reverse"]), forwards + (not place["reverse"])
        standing, leaving = fleet.stopping == STANDING, fleet.stopping == LEAVING
        assert (fleet.stopped_time[standing | leaving] == 0.0).all()
        assert ((traffic.lights & LEFT > 0) & (traffic.lights & RIGHT == 0))[leaving & (before == LEAVING)].all()
        assert (traffic.lights & RIGHT > 0)[fleet.stopping == BACKING_IN].all()
        if step == 300:
            saved = traffic.arrays()
    assert forwards > 0
    assert backwards > 0
    assert seen[LEAVING, DRIVING] > 0
    assert {
        (DRIVING, APPROACHING),
        (APPROACHING, BACKING_IN),
        (BACKING_IN, STANDING),
        (APPROACHING, STANDING),
        (STANDING, LEAVING),
    } <= {*seen}
    assert int(fleet.teleports.sum()) == 0
    assert (saved["fleet.stopping"] != DRIVING).any()
    others = [_traffic(network, 24) for _ in range(2)]
    for other in others:
        other.restore(saved)
        _advance(other, 40)
    for name, array in others[0].arrays().items():
        np.testing.assert_array_equal(array, others[1].arrays()[name], err_msg=name)


def _delivering(cars: int) -> tuple[Traffic, int]:
    """Traffic whose car 0 makes a delivery on a street with another lane, the others far away."""
    network = _network(delivery=True)
    traffic = _traffic(network, cars)
    places = network.driven.places
    k = int(np.argmax(network.driven.lanes["length"][places["lane"]]))
    fleet, place = traffic.fleet, places[k]
    for v in range(cars):
        assert traffic._place_vehicle(v, int(place["lane"]), float(place["middle"]) - 45.0 * v, 0.1)
    fleet.delivers[0] = fleet.at_stop[0] = True
    fleet.stopping[0], fleet.place[0], fleet.stay_left[0] = STANDING, k, 100.0
    fleet.stop_offset[0] = fleet.offset[0]
    return traffic, k


def test_who_is_behind_a_delivery_changes_lanes() -> None:
    traffic, k = _delivering(2)
    fleet = traffic.fleet
    van, lane = traffic.fleet[0].offset, int(fleet.lane[0])
    for _ in range(250):
        _advance(traffic, 1)
        assert len(overlapping(traffic.bodies(), 0.0)) == 0
        if fleet.lane[1] != lane and fleet.offset[1] > van + 1.0:
            break
    else:
        pytest.fail("the car behind did not pass the van")
    assert fleet.offset[0] == van
    assert fleet.lights[0] == LEFT | RIGHT
    assert fleet.place[0] == k


def test_a_delivery_is_over_when_it_holds_somebody_up_for_long() -> None:
    traffic, _ = _delivering(2)
    fleet = traffic.fleet
    fleet.time_since_lane_change[1] = -1e6  # it never changes lanes
    _advance(traffic, 500)
    _advance(traffic, 150)
    assert (fleet.stopping[0], fleet.place[0]) == (DRIVING, NONE)


@pytest.mark.parametrize(("ahead", "behind", "expected"), [(0, 0, [False]), (0, 1, [True]), (1, 0, [])])
def test_a_place_is_where_nothing_stands_in_the_way(ahead: int, behind: int, expected: list[bool]) -> None:
    network = _network()
    lane = int(network.driven.places["lane"][np.argmax(network.driven.lanes["length"][network.driven.places["lane"]])])
    middle = float(network.lanes.length[lane]) / 2
    spot = SimpleNamespace(
        lane=network.lanes.ids[lane], offset=middle, side=SIDE, length=5.8, width=2.0, kind="kerb", car=None
    )
    world: Any = SimpleNamespace(parking=[spot], transit=road_city().transit)
    solids = []
    for there in [5.8] * ahead + [-5.8] * behind:
        x, y, yaw = network.lanes.at(lane, middle + there)
        solids.append(shapely.Point(x - np.sin(yaw) * SIDE, y + np.cos(yaw) * SIDE).buffer(0.9))
    places = with_stopping_places(network.driven, network.lanes, network.walks, world, solids).places
    assert places["reverse"][~places["delivery"]].tolist() == expected
