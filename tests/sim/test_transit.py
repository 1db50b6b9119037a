"""Buses and bicycles in central Helsinki: timetable, boarding, prices."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from road_city import HALF, road_city
from vico.assets.vehicles import vehicle_prototypes
from vico.errors import InputError
from vico.rules import BUS_DWELL, BUS_FARE, ride_price
from vico.sim.bodies.arrays import BICYCLE, RESIDENT, Bodies
from vico.sim.loop.checks import overlapping
from vico.sim.traffic import Traffic, TrafficNetwork
from vico.sim.traffic.population import PATIENCE
from vico.sim.transit import TransitSystem, plan_buses
from vico.world.heights import HeightField


@cache
def _network() -> TrafficNetwork:
    return TrafficNetwork.of(road_city().lanes, road_city().solids)


def _systems(
    cars: int = 20, pedestrians: int = 20, *, second: float = 8 * 3600.0, trams: bool = False
) -> tuple[Traffic, TransitSystem]:
    city = road_city()
    lines = city.transit if trams else city.transit.model_copy(update={"tram_lines": []})
    plan = plan_buses(lines, city.lanes, second)
    traffic = Traffic(
        _network(),
        HeightField.flat(HALF),
        cars=cars,
        pedestrians=pedestrians,
        seed=3,
        first_entity=1_000_000,
        buses=plan.bus_routes,
    )
    return traffic, TransitSystem(lines, traffic, plan, second=second, first_bike=1_100_000)


def _advance(traffic: Traffic, transit: TransitSystem) -> None:
    traffic.advance(0.1, transit.bodies())
    transit.advance(0.1, traffic.bodies())


@dataclass
class _Service:
    """What buses did: stops in the order in which the first bus served them, and how late each came to its first."""

    order: list[str]
    served: list[str]
    late: list[float]


@pytest.fixture(scope="module")
def busy() -> _Service:
    """Buses among cars and pedestrians until each has been at its first stop twice."""
    traffic, transit = _systems(30, 30)
    seen = _Service(transit.line_of(0).stops, [], [])
    was = [True] * traffic.buses
    for _ in range(15_000):
        if len(seen.late) >= 2 * traffic.buses and len(seen.served) > len(seen.order):
            break
        _advance(traffic, transit)
        stop = transit.stopped_at(0)
        if stop and (not seen.served or seen.served[-1] != stop):
            seen.served.append(stop)
        for bus in range(traffic.buses):
            there = transit.stopped_at(bus) == transit.line_of(bus).stops[0]
            if there and not was[bus]:
                seen.late.append(float(transit.clock[0] - transit.begun[bus] - transit.line_of(bus).travel[-1]))
            was[bus] = there
    return seen


def test_a_bus_serves_every_stop_of_its_line_in_order(busy: _Service) -> None:
    order, served = busy.order, busy.served
    first = order.index(served[0])
    assert len(served) >= len(order)
    assert served == [order[(first + k) % len(order)] for k in range(len(served))]


def test_buses_come_to_their_first_stop_by_the_timetable_but_for_a_jam(busy: _Service) -> None:
    # Who comes early waits.
    assert np.median(np.maximum(busy.late, 0.0)) < 15.0
    # A car that gets nowhere before a bus is taken out after so long.
    assert max(map(abs, busy.late)) < PATIENCE


@dataclass
class _Stands:
    """How long the first bus stood, sub-steps, with the sub-step at which it left, and how early buses left, s."""

    stood: list[tuple[int, int]]
    early: list[float]


@pytest.fixture(scope="module")
def empty() -> _Stands:
    """Buses alone in the streets for 25 minutes."""
    traffic, transit = _systems(0, 0)
    seen, last = _Stands([], [0.0]), 0
    due: dict[int, tuple[int, float]] = {}
    for step in range(15_000):
        _advance(traffic, transit)
        at = transit.stopped_at(0)
        if at and at != transit.line_of(0).stops[0]:
            last += 1
        elif last:
            seen.stood.append((step, last))
            last = 0
        for bus in range(traffic.buses):
            stop = int(transit.stop[bus])
            if transit.stopped_at(bus):
                due[bus] = stop, transit.begun[bus] + transit.line_of(bus).travel[stop] + BUS_DWELL
            elif bus in due:
                left, when = due.pop(bus)
                seen.early.append(when - transit.clock[0] if left else 0.0)
    return seen


def test_buses_on_empty_streets_leave_no_stop_before_its_time(empty: _Stands) -> None:
    assert len(empty.early) > 10
    assert max(empty.early) < 0.2


def test_a_bus_stands_at_a_stop_for_thirty_seconds_and_until_its_time(empty: _Stands) -> None:
    # The first one counted was under way when the run began.
    assert empty.stood[1:]
    # What was kept of a leg's time for traffic that is not there.
    assert all(BUS_DWELL - 0.3 < steps / 10 < BUS_DWELL + 45.0 for _, steps in empty.stood[1:])


def test_a_bus_that_has_just_left_when_a_run_begins_drives_its_round() -> None:
    travel = plan_buses(road_city().transit, road_city().lanes, 8 * 3600.0)
    second = travel.begun[0] + 10.0
    traffic, transit = _systems(0, 0, second=second)
    assert transit.stop[0] == 0
    for _ in range(300):
        _advance(traffic, transit)
    assert transit.stopped_at(0) is None
    assert transit.begun[0] == travel.begun[0]


def test_a_stop_behind_the_bus_is_a_whole_round_away() -> None:
    traffic, transit = _systems(0, 0)
    short = next(k for k in range(traffic.buses) if len(transit.line_of(k).stops) == 2)
    line = transit.line_of(short)
    number = traffic.lanes.index
    around = sum(float(traffic.lanes.length[number[lane]]) for lane in line.lanes)
    while transit.stop[short] != 1 or transit.stopped_at(short):
        _advance(traffic, transit)
    there = transit._metres(short, 1)
    while not transit.stopped_at(short):
        _advance(traffic, transit)
    assert there > 0.0
    # From the second stop to the first, which lies behind it on the same lane, and on to the second again.
    first = next(s for s in transit.transit.stops if s.id == line.stops[0])
    second = next(s for s in transit.transit.stops if s.id == line.stops[1])
    assert first.lane == second.lane
    assert transit._metres(short, 0) == pytest.approx(around - (second.offset - first.offset), abs=1.0)


def test_a_stopped_bus_can_be_boarded_from_the_place_to_wait() -> None:
    _, transit = _systems()
    waits = {stop.id: stop.wait for stop in transit.transit.stops}
    stop = transit.stopped_at(0)
    assert stop is not None
    assert transit.bus_at(waits[stop]) == 0
    assert transit.board(0, 7) == BUS_FARE
    assert transit.aboard(0) == 1


def test_a_bus_out_of_reach_is_not_found() -> None:
    _, transit = _systems()
    assert transit.bus_at(transit.doors(0)[0] + (40.0, 40.0)) is None


def test_a_moving_bus_can_be_neither_boarded_nor_left() -> None:
    traffic, transit = _systems(0, 0)
    while transit.stopped_at(0):
        _advance(traffic, transit)
    with pytest.raises(InputError, match="not at a stop"):
        transit.board(0, 7)
    with pytest.raises(InputError, match="moving"):
        transit.alight(0, 7)


def test_a_ride_costs_by_the_started_minute_and_more_when_left_astray() -> None:
    assert ride_price(1.0, returned=True) == pytest.approx(0.2)
    assert ride_price(60.0, returned=True) == pytest.approx(0.2)
    assert ride_price(61.0, returned=True) == pytest.approx(0.4)
    assert ride_price(61.0, returned=False) == pytest.approx(20.4)


def test_a_bicycle_taken_and_brought_back_is_in_the_station_again() -> None:
    _, transit = _systems(0, 0)
    before = transit.bicycles.free()
    bike = transit.bicycles.at(transit.transit.bike_stations[0].position)
    assert bike is not None
    transit.bicycles.mount(bike, 0, float(transit.clock[0]))
    assert transit.bicycles.free().sum() == before.sum() - 1
    transit.bicycles.carry(bike, *transit.transit.bike_stations[0].position[:2], 0.0)
    assert transit.bicycles.dismount(bike, float(transit.clock[0])) < 1.0
    assert np.array_equal(transit.bicycles.free(), before)


def test_a_bicycle_left_astray_stays_there_as_a_body() -> None:
    _, transit = _systems(0, 0)
    bike = transit.bicycles.at(transit.transit.bike_stations[0].position)
    assert bike is not None
    transit.bicycles.mount(bike, 0, float(transit.clock[0]))
    transit.bicycles.carry(bike, 3.0, 4.0, 0.5)
    assert transit.bicycles.dismount(bike, float(transit.clock[0])) > 20.0
    bodies = transit.bodies()
    assert bodies.position[bodies.kind == BICYCLE, :2].tolist() == [[3.0, 4.0]]


def test_transit_goes_on_from_a_saved_state_as_if_never_stopped() -> None:
    traffic, transit = _systems(trams=True)
    for _ in range(400):
        _advance(traffic, transit)
    saved = traffic.arrays(), transit.arrays()
    other_traffic, other = _systems(trams=True)
    other_traffic.restore(saved[0])
    other.restore(saved[1])
    for _ in range(400):
        _advance(traffic, transit)
        _advance(other_traffic, other)
    for a, b in ((traffic, other_traffic), (transit, other)):
        here, there = a.arrays(), b.arrays()
        assert all(np.array_equal(here[k], there[k]) for k in here)


def test_a_bus_that_somebody_stops_for_good_goes_on_from_its_next_stop_and_is_counted() -> None:
    traffic, transit = _systems(0, 0)
    while transit.stopped_at(0):
        _advance(traffic, transit)
    goal = transit.line_of(0).stops[int(transit.stop[0])]
    transit.riders[0, 0] = 7
    x, y, yaw = transit.bus_pose(0)
    somebody = Bodies(
        entity=np.array([7], np.int32),
        kind=np.array([RESIDENT], np.int8),
        position=np.array([[x + 14.0 * np.cos(yaw), y + 14.0 * np.sin(yaw), 0.0]]),
        yaw=np.zeros(1),
        half_length=np.full(1, 0.25),
        half_width=np.full(1, 0.25),
        height=np.full(1, 1.8),
        velocity=np.zeros((1, 2)),
    )
    others = Bodies.joined([transit.bodies(), somebody])
    reached = 0.0
    while transit.stopped_at(0) is None and reached < 400.0:
        traffic.advance(0.1, others)
        transit.advance(0.1, traffic.bodies())
        reached += 0.1
        assert len(overlapping(Bodies.joined([traffic.bodies(), others]), 0.0)) == 0
    assert transit.stopped_at(0) == goal
    assert 150.0 < reached < 200.0
    assert traffic.jams.count == 1
    told = traffic.jams.rescued()[0]
    assert (told.entity, told.before) == (transit.entity_of(0), 7)
    assert np.hypot(told.position[0] - x, told.position[1] - y) < 14.0
    assert transit.aboard(0) == 1


def test_buses_trams_and_bicycles_overlap_nobody() -> None:
    traffic, transit = _systems(trams=True)
    overlaps = 0
    for _ in range(3000):
        _advance(traffic, transit)
        overlaps += len(overlapping(Bodies.joined([traffic.bodies(), transit.bodies()]), 0.0))
    assert overlaps == 0


def test_doors_open_to_the_kerb() -> None:
    traffic, transit = _systems(0, 0)
    x, y, yaw = transit.bus_pose(0)
    left = np.array([-np.sin(yaw), np.cos(yaw)])
    assert ((transit.doors(0) - (x, y)) @ left < -1.0).all()
    traffic.lanes = replace(traffic.lanes, lefthand=True)
    assert ((transit.doors(0) - (x, y)) @ left > 1.0).all()
    assert ((transit.exit_spots(0) - (x, y)) @ left > 1.5).all()
    here, there = vehicle_prototypes()["bus"][0], traffic.prototypes()["bus"][0]
    corners = there.positions[there.triangles]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    turned = (outward * there.normals[there.triangles[:, 0]]).sum(axis=1)
    assert (turned > -1e-9).all()
    assert np.allclose(there.positions * (1, -1, 1), here.positions)
