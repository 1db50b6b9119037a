"""Buses between services: out of the streets, and back at their first stop before they leave it."""

from functools import cache
from types import SimpleNamespace

import numpy as np

from road_city import HALF, road_city
from vico.sim.actions.movement import check_enter_bus
from vico.sim.bodies.arrays import BUS, RESIDENT, Bodies
from vico.sim.loop.checks import overlapping
from vico.sim.traffic import Traffic, TrafficNetwork
from vico.sim.transit import TransitSystem, plan_buses
from vico.world.heights import HeightField

_FIRST = 5 * 3600.0  # when each line's first bus leaves


@cache
def _network() -> TrafficNetwork:
    return TrafficNetwork.of(road_city().lanes, road_city().solids)


def _systems(second: float, cars: int = 0) -> tuple[Traffic, TransitSystem]:
    city = road_city()
    plan = plan_buses(city.transit, city.lanes, second)
    traffic = Traffic(
        _network(),
        HeightField.flat(HALF),
        cars=cars,
        pedestrians=5,
        seed=3,
        first_entity=1_000_000,
        buses=plan.bus_routes,
    )
    return traffic, TransitSystem(city.transit, traffic, plan, second=second, first_bike=1_100_000)


def _advance(traffic: Traffic, transit: TransitSystem, seconds: float, others: Bodies | None = None) -> None:
    for _ in range(round(seconds * 10)):
        traffic.advance(0.1, Bodies.joined([transit.bodies(), *([] if others is None else [others])]))
        transit.advance(0.1, traffic.bodies())


def _person(xy: tuple[float, float]) -> Bodies:
    return Bodies(
        np.array([1], np.int32), np.array([RESIDENT], np.int8), np.array([[*xy, 0.0]]), np.zeros(1),
        np.full(1, 0.28), np.full(1, 0.28), np.full(1, 1.7), np.zeros((1, 3)),
    )  # fmt: skip


def _buses(traffic: Traffic) -> int:
    return int((traffic.bodies().kind == BUS).sum())


def test_at_night_there_are_no_buses_in_the_streets() -> None:
    traffic, transit = _systems(0.0, cars=5)
    assert traffic.buses > 3
    _advance(traffic, transit, 2.0)
    assert _buses(traffic) == 0
    assert len(traffic.bodies()) == 10
    assert len(traffic.lights) == 5
    assert len(traffic.walkers) == 5
    assert (traffic.fleet.held_junctions[traffic.cars :] < 0).all()
    buses = {transit.entity_of(bus) for bus in range(traffic.buses)}
    for drawn in (traffic.draw(), transit.draw()):
        assert not buses & set(drawn.entity.tolist())
    # They have their names all the same.
    assert buses <= set(traffic.entities()[0].tolist())


def test_who_waits_for_a_bus_in_the_depot_is_told_so() -> None:
    _, transit = _systems(0.0)
    line = transit.line_of(0)
    wait = next(stop.wait for stop in transit.transit.stops if stop.id == line.stops[0])
    people = SimpleNamespace(position=np.array([wait]), vehicle=[0], room=[-1])
    state = SimpleNamespace(transit=transit, people=people)
    refusal = check_enter_bus({}, 0, state)  # type: ignore[arg-type]
    assert refusal is not None
    assert f"bus {line.name} is in the depot until shortly before 05:00:00" in refusal.reason


def test_buses_come_back_before_their_departure_and_leave_on_time() -> None:
    traffic, transit = _systems(0.0, cars=10)
    transit.clock[:] = _FIRST - 125.0
    lines = len(transit.transit.lines)
    _advance(traffic, transit, 4.0)
    assert _buses(traffic) == 0
    left: dict[str, float] = {}
    while transit.clock[0] < _FIRST + 5.0:
        _advance(traffic, transit, 0.1)
        assert not overlapping(traffic.bodies())
        for bus in range(traffic.buses):
            if not transit.in_depot(bus) and transit.stopped_at(bus) is None:
                left.setdefault(transit.line_of(bus).id, float(transit.clock[0]))
    assert len(left) == lines
    assert max(abs(when - _FIRST) for when in left.values()) < 0.3
    # A line sends out one bus at a time.
    assert _buses(traffic) == lines


def test_a_bus_waits_in_the_depot_while_somebody_stands_where_it_is_to_stop() -> None:
    traffic, transit = _systems(0.0)
    transit.clock[:] = _FIRST - 121.0
    street = traffic.lanes
    stop = next(s for s in transit.transit.stops if s.id == transit.line_of(0).stops[0])
    lane = street.index[stop.lane]
    there = np.array([np.interp(stop.offset - 5.0, *_along(street, lane, axis)) for axis in (0, 1)])
    line = [bus for bus in range(traffic.buses) if transit.line_of(bus).id == transit.line_of(0).id]
    _advance(traffic, transit, 20.0, _person(tuple(there)))
    assert all(transit.in_depot(bus) for bus in line)
    _advance(traffic, transit, 0.3)
    assert [transit.in_depot(bus) for bus in line] == [False] + [True] * (len(line) - 1)
    assert transit.stopped_at(0) == stop.id
    assert transit.stops_served[0] == 0


def _along(lanes: object, lane: int, axis: int) -> tuple[np.ndarray, np.ndarray]:
    own = slice(int(lanes.first[lane]), int(lanes.first[lane + 1]))  # type: ignore[attr-defined]
    return lanes.along[own], lanes.points[own, axis]  # type: ignore[attr-defined]


def test_a_bus_goes_to_the_depot_when_everybody_is_off() -> None:
    traffic, transit = _systems(8 * 3600.0)
    bus = next(b for b in range(traffic.buses) if transit.stop[b] == 0 and transit.stopped_at(b))
    transit.taken[:] += 1
    transit.board(bus, 7)
    assert not transit.ends(bus)
    _advance(traffic, transit, 20.0)
    assert transit.ends(bus)
    assert transit.aboard(bus) == 1
    transit.alight(bus, 7)
    _advance(traffic, transit, 1.0)
    assert not transit.in_depot(bus)  # its doors close first
    _advance(traffic, transit, 1.0)
    assert transit.in_depot(bus)
    assert transit.stopped_at(bus) is None


def test_what_is_in_the_depot_is_part_of_the_state() -> None:
    traffic, transit = _systems(0.0)
    transit.clock[:] = _FIRST - 125.0
    saved = traffic.arrays(), transit.arrays()
    _advance(traffic, transit, 8.0)
    after = traffic.arrays() | transit.arrays()
    assert 0 < _buses(traffic) < traffic.buses
    other, other_transit = _systems(8 * 3600.0)
    other.restore(saved[0])
    other_transit.restore(saved[1])
    assert _buses(other) == 0
    _advance(other, other_transit, 8.0)
    for name, array in (other.arrays() | other_transit.arrays()).items():
        assert np.array_equal(array, after[name]), name
