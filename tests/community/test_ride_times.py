"""Trips of one ride, beside those that the router of trips finds."""

from __future__ import annotations

import math

import numpy as np
import pytest

from vico.community.model import Mode
from vico.community.ride_times import RideTimes, Walks
from vico.rules import BUS_DWELL, BUS_FARE
from vico.world.model import Point2
from vico.world.routing import Router
from vico.world.transit import BikeStation, Line, Stop, TramLine, TramStop, Transit
from vico.world.trips import Trips
from vico.world.trips.network import find_way
from vico.world.walk_lengths import Walk
from vico.world.walkable import BLOCKED, OPEN, WalkableMap
from vico.world.world import World

EIGHT = 8 * 3600
DOORS: tuple[Point2, Point2] = ((-181.0, -180.0), (177.0, 175.0))


def field() -> Router:
    """Open ground with a wall across it that has a gap."""
    cls = np.full((200, 200), OPEN, np.uint8)
    cls[100:103, :180] = BLOCKED
    return Router(WalkableMap(cls, 200.0, 2.0))


ROUTER = field()


class SameWalks(Walks):
    """Walks as the router of trips finds them, to the centimetre."""

    def __init__(self) -> None:
        self.asked = 0

    def between(self, a: Point2, b: Point2) -> Walk:
        self.asked += 1
        way = find_way(ROUTER, a, b)
        return Walk(way.metres, max(0, len(way.path) - 2))


def town(seed: int) -> Transit:
    """A line of buses and one of trams with five stops each, and four bicycle stations, anywhere."""
    rng = np.random.default_rng(seed)
    spots = (2.0 * rng.integers(-95, 95, (9, 2)) + 1.0).tolist()
    travel, clock = [0.0], 0.0
    for seconds in rng.integers(5, 60, 5).tolist():
        clock += seconds
        travel.append(round(clock, 1))
        clock += BUS_DWELL
    headway = int(rng.integers(40, 400))
    line = Line(
        id="line", name="1", colour="#000000", stops=[f"stop_{k}" for k in range(5)], lanes=[], travel=travel,
        departures=[EIGHT + headway * k for k in range(30)],
    )  # fmt: skip
    stops = [
        Stop(id=f"stop_{k}", entity=k + 1, name=str(k), wait=(*spots[k], 0.0), lane="", offset=0.0) for k in range(5)
    ]
    racks = [
        BikeStation(
            id=f"rack_{k}", entity=k + 10, name=str(k), position=(*spots[5 + k], 0.0), capacity=4,
            bikes=int(rng.integers(0, 5)),
        )
        for k in range(4)
    ]  # fmt: skip
    posts = (2.0 * rng.integers(-95, 95, (5, 2)) + 1.0).tolist()
    tram_stops = [
        TramStop(id=f"tram_stop_{k}", entity=k + 20, name=str(k), wait=(*post, 0.0)) for k, post in enumerate(posts)
    ]
    tram = TramLine(
        id="tram", name="4", kind="tram", colour="#000000", track=[], stops=[stop.id for stop in tram_stops],
        offsets=[], travel=[40.0 + second for second in travel], departures=line.departures,
    )  # fmt: skip
    return Transit(stops=stops, lines=[line], bike_stations=racks, origin={}, tram_stops=tram_stops, tram_lines=[tram])


class Town:
    def __init__(self, transit: Transit) -> None:
        self.transit, self.router = transit, ROUTER


@pytest.mark.parametrize("mode", [Mode.BUS, Mode.TRAM, Mode.BIKE])
@pytest.mark.parametrize("seed", range(12))
def test_the_first_and_the_last_ride_are_those_of_the_router_of_trips(seed: int, mode: Mode) -> None:
    rides, trips = RideTimes(town(seed), SameWalks()), Trips(Town(town(seed)))
    for depart in (EIGHT - 500.0, EIGHT + 777.0):
        first, trip = rides.first(DOORS, mode, depart), trips.plan(*DOORS, depart, modes=(mode.value,))
        if trip is None:
            assert first is None
            continue
        if trip.modes.count(mode.value) == 1:
            assert first is not None
            assert first.arrive == pytest.approx(trip.arrive, abs=2.0)
        due = trip.arrive + 200.0
        last = rides.last(DOORS, mode, (depart, due))
        latest = trips.plan(*DOORS, depart, modes=(mode.value,), arrive_by=due)
        assert latest is not None
        if latest.modes.count(mode.value) == 1:
            assert last is not None
            assert last.depart == pytest.approx(latest.depart, abs=3.0)
            assert last.arrive <= due
            assert last.walked == pytest.approx(latest.walked, rel=0.02)


def test_of_rides_nobody_takes_few_ways_are_measured() -> None:
    walks = SameWalks()
    rides = RideTimes(town(3), walks)
    assert rides.last(DOORS, Mode.BUS, (0.0, 3600.0)) is None
    assert rides.last(DOORS, Mode.BUS, (EIGHT, EIGHT + 60.0)) is None
    assert walks.asked == 0


def test_who_has_too_little_money_does_not_ride() -> None:
    rides = RideTimes(town(3), SameWalks())
    assert rides.first(DOORS, Mode.BUS, EIGHT, BUS_FARE) is not None
    assert rides.first(DOORS, Mode.BUS, EIGHT, BUS_FARE / 2) is None


def test_without_anything_to_ride_there_are_no_rides() -> None:
    rides = RideTimes(Transit(stops=[], lines=[], bike_stations=[], origin={}), SameWalks())
    assert not rides.any
    assert rides.first(DOORS, Mode.BUS, 0.0) is None
    assert rides.last(DOORS, Mode.BIKE, (0.0, math.inf)) is None


def test_a_walk_is_as_long_back_as_there_however_often_it_is_asked_for(helsinki: World) -> None:
    doors = [place.position[:2] for place in helsinki.places[:30]]
    walks, fresh = Walks.of(helsinki), Walks(helsinki)
    assert walks is Walks.of(helsinki)
    for door in doors[1:]:  # often enough to learn the costs to the first
        there = walks.between(doors[0], door)
        assert walks.between(door, doors[0]) == there
    for door in doors[:-8:-1]:
        assert walks.between(doors[0], door) == fresh.between(doors[0], door)
