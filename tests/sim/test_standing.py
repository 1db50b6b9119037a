"""Pedestrians who stand, and who ride in buses, on the streets of central Helsinki."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from helsinki_traffic import network
from road_city import HALF, road_city
from vico.sim.bodies.arrays import Bodies
from vico.sim.loop.checks import overlapping
from vico.sim.traffic import Traffic, TrafficNetwork
from vico.sim.traffic.state import STOP, TALK
from vico.sim.traffic.stopping_places import with_spots
from vico.sim.transit import TransitSystem, plan_buses
from vico.world.heights import HeightField
from vico.world.walkable import OPEN, WalkableMap
from vico.world.world import World

# 08:01:40: a bus with room, and a tram, come to stops within the time of the test, and so do their riders.
SECOND = 8 * 3600.0 + 100.0


@cache
def _walkable() -> WalkableMap:
    return WalkableMap(np.full((int(HALF * 4),) * 2, OPEN, np.uint8), HALF)


@cache
def _network() -> TrafficNetwork:
    """Streets with spots for who talks and who waits for a bus."""
    city, plain = road_city(), network()
    world = SimpleNamespace(
        entrances=[], places=[], transit=city.transit, lanes=city.lanes, walkable=_walkable(),
        height=HeightField.flat(HALF),
    )  # fmt: skip
    return replace(plain, walked=with_spots(plain.walked, plain.walks, cast(World, world), city.solids))


def _systems() -> tuple[Traffic, TransitSystem]:
    city = road_city()
    plan = plan_buses(city.transit, city.lanes, SECOND)
    traffic = Traffic(
        _network(), HeightField.flat(HALF), cars=5, pedestrians=60, seed=2, first_entity=1_000_000,
        buses=plan.bus_routes,
    )  # fmt: skip
    transit = TransitSystem(city.transit, traffic, plan, second=SECOND, first_bike=1_100_000)
    transit.take_passengers(_walkable(), 2)
    return traffic, transit


def _advance(traffic: Traffic, transit: TransitSystem, seconds: int) -> None:
    for _ in range(10 * seconds):
        traffic.advance(0.1, transit.bodies())
        transit.advance(0.1, traffic.bodies())


def test_spots_leave_room_for_who_walks_past() -> None:
    traffic, _ = _systems()
    spots, walks = traffic.spots, traffic.walks
    assert (spots["kind"] == TALK).sum() > 50
    assert (spots["kind"] == STOP).sum() > 5
    pairs = spots[spots["kind"] == TALK]
    across = spots[pairs["partner"]]
    assert np.allclose(np.hypot(across["x"] - pairs["x"], across["y"] - pairs["y"]), 0.72, atol=0.05)
    for spot in spots:
        line, room = walks.line(spot["walkway"]), walks.room_at(int(spot["walkway"]), float(spot["offset"]))
        nearest = np.hypot(line[:, 0] - spot["x"], line[:, 1] - spot["y"]).min()
        # Whoever stands in the middle of a narrow way leaves no room on either side.
        assert nearest > 0.05 or room.sum() > 1.0


def test_people_wait_for_buses_and_trams_and_ride_and_talk_in_twos_and_touch_nobody() -> None:
    traffic, transit = _systems()
    walkers = traffic.pedestrian_state
    rode, waited, apart, overlaps = traffic.riding, walkers.stand_kind == STOP, [], 0
    before: dict[str, Any] = {}
    # Of buses, and of trams.
    boarded, alighted = [0, 0], [0, 0]
    for second in range(150):
        riding, aboard = traffic.riding, walkers.aboard.copy()
        # Nobody rides beyond the next stop.
        walkers.stops_left[riding] = np.minimum(walkers.stops_left[riding], 1)
        _advance(traffic, transit, 1)
        for i in np.flatnonzero(traffic.riding & ~riding).tolist():
            boarded[int(walkers.aboard[i] >= traffic.buses)] += 1
        for i in np.flatnonzero(riding & ~traffic.riding).tolist():
            alighted[int(aboard[i] >= traffic.buses)] += 1
        waited |= walkers.stand_kind == STOP
        overlaps += len(overlapping(traffic.bodies(), 0.0))
        talk = np.flatnonzero((walkers.stand_kind == TALK) & (walkers.leader >= 0) & (walkers.gait_time <= -1.0))
        body = traffic.walkers
        apart += np.hypot(*(body.position[talk] - body.position[walkers.leader[talk]])[:, :2].T).tolist()
        if second == 130:
            before = traffic.arrays() | transit.arrays()
    assert rode.any()
    assert waited.any()
    assert min(boarded) > 0
    assert min(alighted) > 0
    assert overlaps == 0
    assert apart
    assert np.median(apart) < 1.2
    # Who rides is where a place of the bus or tram is, and in nobody's way.
    assert len(traffic.bodies()) == traffic.vehicles + 60 - int(traffic.riding.sum())
    for i, place in zip(np.flatnonzero(traffic.riding), traffic.passengers.position, strict=True):
        doors = transit.doors(int(walkers.aboard[i]))
        assert np.hypot(*(doors - place[:2]).T).min() < 3.0
    # From a saved state all goes on as if nothing had been.
    again = _systems()
    again[0].restore(before)
    again[1].restore(before)
    for _ in range(19):
        riding = again[0].riding
        again[0].pedestrian_state.stops_left[riding] = np.minimum(again[0].pedestrian_state.stops_left[riding], 1)
        _advance(*again, 1)
    after, same = traffic.arrays() | transit.arrays(), again[0].arrays() | again[1].arrays()
    assert all(np.array_equal(values, same[name]) for name, values in after.items())


def test_who_stands_where_a_bus_swings_out_goes_on_when_the_bus_waits_for_it() -> None:
    traffic, _ = _systems()
    walkers, fleet = traffic.pedestrian_state, traffic.fleet
    waiting = np.flatnonzero(walkers.stand_kind == STOP)
    asked, other = waiting[:2].tolist()
    assert walkers.stand_time[[asked, other]].min() > 60.0
    for _ in range(50):
        fleet.blocker[0], fleet.stopped_time[0] = traffic.vehicles + asked, 5.0
        traffic.advance(0.1, Bodies.none())
    assert walkers.stand_kind[[asked, other]].tolist() == [0, STOP]
