"""What weather does to traffic, measured beside the same traffic on a dry day."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import toy_city
from road_city import HALF, road_city
from vico.sim.bodies.arrays import RESIDENT, Bodies
from vico.sim.config import SimConfig
from vico.sim.environment import Agenda, Conditions, Environment, EventSites, Sky
from vico.sim.loop.checks import overlapping
from vico.sim.loop.simulation import Simulation
from vico.sim.traffic import Traffic, TrafficNetwork
from vico.sim.transit import TransitSystem, plan_buses
from vico.world.heights import HeightField
from vico.world.world import World

#: Stopping distance from 50 km/h by the handbook's friction, metres: v^2 / (2 g friction).
HANDBOOK = {"clear": (11.0, 15.0), "rain": (15.0, 22.0), "snow": (33.0, 50.0), "freezing_rain": (80.0, 105.0)}
FIFTY = 50 / 3.6


@cache
def conditions(kind: str) -> Conditions:
    agenda = Agenda(EventSites(toy_city.world()))
    return Environment(Sky.over(60.17, 24.94, "2026-01-15"), kind, seed=0, second=12 * 3600.0, agenda=agenda).conditions


@cache
def network() -> TrafficNetwork:
    return TrafficNetwork.of(road_city().lanes, road_city().solids)


def traffic_in(kind: str, *, cars: int, pedestrians: int = 0) -> Traffic:
    traffic = Traffic(
        network(), HeightField.flat(HALF), cars=cars, pedestrians=pedestrians, seed=1, first_entity=1_000_000
    )
    traffic.set_conditions(conditions(kind))
    return traffic


def somebody_at(xy: np.ndarray) -> Bodies:
    one = np.full(1, 0.25)
    return Bodies(
        np.array([7], np.int32), np.array([RESIDENT], np.int8), np.array([[*xy, 0.0]]), np.zeros(1), one, one,
        np.array([1.7]), np.zeros((1, 2)),
    )  # fmt: skip


def _mean_speed(kind: str) -> tuple[float, float, int]:
    """Mean speeds of cars and pedestrians, and overlaps in any sub-step."""
    traffic = traffic_in(kind, cars=40, pedestrians=40)
    driven, walked, overlaps = 0.0, 0.0, 0
    for _ in range(1800):
        traffic.advance(0.1, Bodies.none())
        driven += float(traffic.fleet.speed.mean())
        walked += float(traffic.pedestrian_state.speed.mean())
        overlaps += len(overlapping(traffic.bodies(), 0.0))
    return driven / 1800, walked / 1800, overlaps


def test_worse_weather_slows_cars_and_pedestrians_and_nobody_touches() -> None:
    found = {kind: _mean_speed(kind) for kind in ("clear", "downpour", "snow", "freezing_rain")}
    cars = {kind: driven / found["clear"][0] for kind, (driven, _, _) in found.items()}
    # Heavy rain slows by 3-16 %, heavy snow by 5-40 %, and on bare ice people creep.
    assert 0.80 < cars["downpour"] < 0.97
    assert 0.55 < cars["snow"] < 0.85
    assert cars["freezing_rain"] < cars["snow"]
    walks = {kind: walked / found["clear"][1] for kind, (_, walked, _) in found.items()}
    assert walks["downpour"] == pytest.approx(1.0, abs=0.03)
    assert 0.8 < walks["snow"] < 0.95
    assert 0.65 < walks["freezing_rain"] < 0.82
    assert all(overlaps == 0 for _, _, overlaps in found.values())


def _hardest_braking_before(kind: str, ahead: float) -> float:
    """How hard a car at 50 km/h brakes when somebody stands before it all of a sudden, m/s^2."""
    traffic = traffic_in(kind, cars=1)
    lane = max(range(len(traffic.lanes)), key=lambda n: _straightness(traffic, n))
    traffic._net.lanes["speed"][:] = FIFTY
    traffic.fleet.speed_factor[:] = 1.0
    start = 8.0
    assert traffic._place_vehicle(0, lane, start, 1.0)
    traffic.fleet.speed[0] = FIFTY
    person = somebody_at(traffic.lanes.at(np.array([lane]), np.array([start + ahead + 0.25]))[0, :2])
    hardest = 0.0
    for _ in range(600):
        before = float(traffic.fleet.speed[0])
        traffic.advance(0.1, person)
        hardest = max(hardest, (before - float(traffic.fleet.speed[0])) / 0.1)
        if traffic.fleet.speed[0] == 0.0:
            break
    return hardest


def _straightness(traffic: Traffic, lane: int) -> float:
    """How far the ends of a lane between junctions are apart, metres."""
    line = traffic.lanes.line(lane)
    return float(np.linalg.norm(line[-1] - line[0])) if traffic.lanes.zone[lane] < 0 else 0.0


@pytest.mark.parametrize("kind", HANDBOOK)
def test_cars_stop_from_fifty_within_what_the_handbook_says(kind: str) -> None:
    most = conditions(kind).hard_braking + 1e-6
    too_near, far_enough = 8.0, 128.0
    while far_enough - too_near > 1.0:
        ahead = (too_near + far_enough) / 2
        if _hardest_braking_before(kind, ahead) <= most:
            far_enough = ahead
        else:
            too_near = ahead
    least, greatest = HANDBOOK[kind]
    assert least <= far_enough <= greatest


@pytest.mark.parametrize("kind", HANDBOOK)
def test_a_car_that_sets_off_stands_no_more_however_slippery_it_is(kind: str) -> None:
    # One that stands for long gives the junction back that it was let into.
    traffic = traffic_in(kind, cars=1)
    traffic.fleet.speed[0], traffic.fleet.stopped_time[0] = 0.0, 10.0
    traffic.advance(0.1, Bodies.none())
    assert 0.0 < traffic.fleet.speed[0] <= conditions(kind).traction * 0.1 + 1e-9
    assert traffic.fleet.stopped_time[0] == 0.0


def _bus_lateness(kind: str) -> dict[str, float]:
    city = road_city()
    lines = city.transit.model_copy(update={"tram_lines": []})
    plan = plan_buses(lines, city.lanes, 8 * 3600.0)
    traffic = Traffic(
        network(), HeightField.flat(HALF), cars=0, pedestrians=0, seed=3, first_entity=1_000_000, buses=plan.bus_routes
    )
    transit = TransitSystem(lines, traffic, plan, second=8 * 3600.0, first_bike=1_100_000)
    traffic.set_conditions(conditions(kind))
    for _ in range(5_000):
        traffic.advance(0.1, transit.bodies())
        transit.advance(0.1, traffic.bodies())
    return transit.lateness()


def test_buses_are_late_in_snow_and_later_on_ice() -> None:
    clear, snow, ice = (_bus_lateness(kind) for kind in ("clear", "snow", "freezing_rain"))
    assert clear["arrivals"] > 10
    assert abs(clear["late_mean"]) < 8.0
    assert clear["late_mean"] + 8.0 < snow["late_mean"] < ice["late_mean"]
    assert clear["late_most"] < snow["late_most"]


def test_on_a_clear_day_all_is_as_without_weather() -> None:
    with_weather, without = traffic_in("clear", cars=20, pedestrians=20), traffic_in("snow", cars=20, pedestrians=20)
    # Back to what it was before anybody said anything of the weather.
    without.set_conditions(conditions("fair"))
    for _ in range(300):
        with_weather.advance(0.1, Bodies.none())
        without.advance(0.1, Bodies.none())
    for name, array in with_weather.arrays().items():
        np.testing.assert_array_equal(array, without.arrays()[name], err_msg=name)


def test_one_run_in_snow_does_not_slow_another_of_the_same_streets() -> None:
    before = network().driven.lanes["speed"].copy()
    traffic = traffic_in("snow", cars=1)
    assert (traffic._net.lanes["speed"] < before).all()
    np.testing.assert_array_equal(network().driven.lanes["speed"], before)


def test_a_run_goes_on_exactly_from_the_middle_of_a_change_of_weather(helsinki: World) -> None:
    config = SimConfig(cars=8, pedestrians=8, assistants=1, observe=(), date="2026-01-15", weather="clear")
    one, other = (Simulation(helsinki, None, config) for _ in range(2))
    one.state.environment.change_weather("freezing_rain", over=40.0)
    for _ in range(15):
        one.step({})
    with one.branch() as tried:
        tried.state.environment.change_weather("clear", over=0.0)
        for _ in range(3):
            tried.step({})
    other.restore(one.snapshot())
    for _ in range(30):
        a, b = one.step({}), other.step({})
        assert a.hash == b.hash
    assert one.state.environment.conditions.driving < 1.0


def test_runs_tell_how_late_buses_were(helsinki: World) -> None:
    sim = Simulation(helsinki, None, SimConfig(assistants=1, observe=()))
    sim.step({})
    assert sim.reports()["buses"] == {"arrivals": 0, "late_mean": 0.0, "late_most": 0.0, "skipped": 0}
