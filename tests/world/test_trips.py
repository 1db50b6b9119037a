"""Trips on small networks: against a search of every possibility, and rule by rule."""

from __future__ import annotations

import heapq
import itertools
import math
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vico.errors import InputError
from vico.rules import BUS_DWELL, BUS_FARE, ride_price
from vico.world.model import Point2
from vico.world.routing import Router
from vico.world.transit import BikeStation, Line, LineTimes, Stop, Transit
from vico.world.trips import MODES, Trip, Trips
from vico.world.trips.model import AHEAD, ALIGHT, BOARD, DISMOUNT, MOUNT
from vico.world.trips.network import find_way
from vico.world.walkable import BLOCKED, OPEN, SIDEWALK, WalkableMap

HALF, CELL = 200.0, 2.0
EIGHT = 8 * 3600.0

State = tuple[float, float, float, str, bool]  # when, price, metres on foot, where, whether one came on foot


def ground() -> Router:
    """A field with a wall across it that has one gap, and a pavement."""
    n = int(2 * HALF / CELL)
    cls = np.full((n, n), OPEN, np.uint8)
    cls[:, n // 4 : n // 4 + 4] = SIDEWALK
    cls[n // 2 : n // 2 + 3, : n - 20] = BLOCKED
    return Router(WalkableMap(cls, HALF, CELL))


ROUTER = ground()


@dataclass
class Town:
    transit: Transit
    router: Router = ROUTER


def stop(k: int, at: Point2) -> Stop:
    return Stop(id=f"stop_{k}", entity=k + 1, name=f"Stop {k}", wait=(*at, 0.0), lane="", offset=0.0)


def line(k: int, stops: list[int], departures: list[int], travel: list[float]) -> Line:
    return Line(
        id=f"line_{k}", name=str(k), colour="#000000", stops=[f"stop_{s}" for s in stops], lanes=[],
        departures=departures, travel=travel,
    )  # fmt: skip


def station(k: int, at: Point2, capacity: int = 4, bikes: int = 2) -> BikeStation:
    return BikeStation(
        id=f"bikes_{k}", entity=100 + k, name=f"Bikes {k}", position=(*at, 0.0), capacity=capacity, bikes=bikes
    )


def town(
    stops: list[Stop] | None = None, lines: list[Line] | None = None, bikes: list[BikeStation] | None = None
) -> Town:
    return Town(Transit(stops=stops or [], lines=lines or [], bike_stations=bikes or [], origin={}))


def random_town(seed: int) -> Town:
    """Two lines of quick buses and three stations, anywhere."""
    rng = np.random.default_rng(seed)
    places = [random_spot(int(k)) for k in rng.integers(1 << 30, size=5)]
    lines = []
    for k in range(int(rng.integers(1, 3))):
        served = rng.permutation(5)[: int(rng.integers(2, 6))].tolist()
        travel, clock = [0.0], 0.0
        for seconds in rng.integers(5, 60, len(served)).tolist():
            clock += seconds
            travel.append(round(clock, 1))
            clock += BUS_DWELL
        first, headway = int(rng.integers(-100, 60)), int(rng.integers(20, 120))
        lines.append(
            line(k, served, [int(EIGHT) + first + headway * i for i in range(int(rng.integers(2, 9)))], travel)
        )
    racks = [random_spot(int(k)) for k in rng.integers(1 << 30, size=int(rng.integers(2, 5)))]
    bikes = [station(k, at, 4, int(rng.integers(0, 5))) for k, at in enumerate(racks)]
    return town([stop(k, at) for k, at in enumerate(places)], lines, bikes)


def random_spot(seed: int) -> Point2:
    x, y = np.random.default_rng(seed).integers(-95, 95, 2).tolist()
    return 2.0 * x + 1.0, 2.0 * y + 1.0


towns = st.integers(0, 1 << 30).map(random_town)
spots = st.integers(0, 1 << 30).map(random_spot)


Call = tuple[str, float, float, int]  # stop, when the bus comes, when it leaves, which stop of its line


def bus_runs(transit: Transit) -> list[list[Call]]:
    """Every round of every bus, each with the one that it drives next."""
    runs = []
    for record in transit.lines:
        times = LineTimes.of(record)
        n = len(record.stops)
        for number in range(2 * len(times.departures)):
            calls: list[Call] = []
            comes = times.begins(number)
            for begins in (times.begins(number), times.leaves(number, n)):
                for k, name in enumerate(record.stops):
                    leaves = begins + (record.travel[k] + BUS_DWELL if k else 0.0)
                    calls.append((name, begins + record.travel[k] if k else comes, leaves, k))
                comes = times.arrives(number, n)
            runs.append(calls)
    return runs


class Possible:
    """The time-expanded graph: what may come after being on foot or off a vehicle somewhere at some time."""

    def __init__(self, place: Town, start: Point2, goal: Point2) -> None:
        transit = place.transit
        self.points: dict[str, Point2] = {s.id: (s.wait[0], s.wait[1]) for s in transit.stops}
        self.racks = {b.id: b for b in transit.bike_stations}
        self.points |= {name: (b.position[0], b.position[1]) for name, b in self.racks.items()}
        self.points |= {"start": start, "goal": goal}
        self.ends = [*sorted({s for record in transit.lines for s in record.stops}), *self.racks, "goal"]
        self.runs = bus_runs(transit)
        self.way = cache(lambda a, b: find_way(place.router, self.points[a], self.points[b]))

    def walks(self, at: float, price: float, metres: float, node: str) -> Iterator[State]:
        for to in self.ends:
            walk = self.way(node, to)
            if to == node:
                yield at, price, metres, to, True
            elif walk.metres < math.inf:
                yield at + walk.seconds(1.0), price, metres + walk.metres, to, True

    def rides(self, at: float, price: float, metres: float, node: str) -> Iterator[State]:
        for to, rack in self.racks.items() if node in self.racks and self.racks[node].bikes > 0 else ():
            if to != node and rack.bikes < rack.capacity and self.way(node, to).metres < math.inf:
                seconds = self.way(node, to).seconds(3.0)
                fare = ride_price(seconds + DISMOUNT, returned=True)
                yield at + MOUNT + seconds + DISMOUNT, round(price + fare, 2), metres, to, False
        for calls in self.runs:
            n = len(calls) // 2
            for i, (name, _, leaves, k) in enumerate(calls[:n]):
                if name == node and at + BOARD + (AHEAD if k else 0.0) <= leaves:
                    for to, comes, _, _ in calls[i + 1 : i + n]:
                        yield comes + ALIGHT, round(price + BUS_FARE, 2), metres, to, False


def every_trip(possible: Possible, depart: float, cash: float) -> tuple[float, float, float] | None:
    """Least arrival, then price, then metres on foot, by a search of all that is possible, which drops nothing."""
    queue: list[State] = [(depart, 0.0, 0.0, "start", False)]
    seen: set[State] = set()
    best: tuple[float, float, float] | None = None
    while queue:
        state = heapq.heappop(queue)
        at, price, metres, node, walked = state
        if best is not None and at > best[0]:
            break
        if state in seen or price > cash:
            continue
        seen.add(state)
        if node == "goal":
            best = min(best or (math.inf,) * 3, (at, price, metres))
            continue
        for after in (possible.rides if walked else possible.walks)(at, price, metres, node):
            heapq.heappush(queue, after)
    return best


@settings(max_examples=60)
@given(towns, spots, spots, st.integers(0, 500), st.sampled_from([math.inf, 4.5, 2.2, 0.3]))
def test_no_trip_is_better_than_the_planned_one(
    place: Town, start: Point2, goal: Point2, late: int, cash: float
) -> None:
    trip = Trips(place).plan(start, goal, EIGHT + late, cash=cash)
    best = every_trip(Possible(place, start, goal), EIGHT + late, cash)
    assert (trip is None) == (best is None)
    if trip is not None and best is not None:
        assert trip.arrive == pytest.approx(best[0], abs=1e-6)
        assert trip.price == pytest.approx(best[1], abs=1e-6)
        assert trip.walked == pytest.approx(best[2], abs=1e-6)


def test_the_towns_that_trips_are_tried_on_have_trips_of_all_kinds() -> None:
    found = Counter(
        leg.mode
        for k in range(60)
        for leg in (Trips(random_town(k)).plan(random_spot(k), random_spot(k + 1), EIGHT) or Trip(0.0, ())).legs
    )
    assert min(found[mode] for mode in MODES if mode != "tram") >= 8


@settings(max_examples=60)
@given(towns, spots, spots, st.integers(0, 500))
def test_legs_join_in_space_and_time(place: Town, start: Point2, goal: Point2, late: int) -> None:
    trip = Trips(place).plan(start, goal, EIGHT + late)
    if trip is None:
        return
    ends = [start, *(leg.end for leg in trip.legs)]
    assert [leg.start for leg in trip.legs] == ends[:-1]
    assert ends[-1] == goal
    clock = EIGHT + late
    for leg in trip.legs:
        assert leg.depart >= clock
        assert leg.arrive >= leg.depart
        clock = leg.arrive
    assert trip.price == pytest.approx(sum(leg.price for leg in trip.legs))


@settings(max_examples=40)
@given(towns, spots, spots)
def test_who_leaves_later_arrives_no_earlier(place: Town, start: Point2, goal: Point2) -> None:
    trips = Trips(place)
    arrivals = [trips.seconds(start, goal, EIGHT + late) + late for late in range(0, 600, 37)]
    assert all(a <= b + 1e-6 for a, b in itertools.pairwise(arrivals))


@settings(max_examples=40)
@given(towns, spots, spots, st.integers(60, 900))
def test_who_has_to_be_there_sets_out_at_the_last_second(place: Town, start: Point2, goal: Point2, within: int) -> None:
    trips = Trips(place)
    trip = trips.plan(start, goal, EIGHT, arrive_by=EIGHT + within)

    def is_on_time(late: int) -> bool:
        return trips.seconds(start, goal, EIGHT + late) + late <= within

    assert (trip is None) == (not is_on_time(0))
    if trip is not None:
        last = round(trip.depart - EIGHT)
        assert trip.depart == EIGHT + last
        assert is_on_time(last)
        # Who leaves later arrives no earlier: the next second tells, and a few more in case a bus comes in between.
        assert not any(is_on_time(late) for late in (last + 1, last + 2, *range(last + 3, within + 1, 29)))
        assert trip.arrive <= EIGHT + within


@settings(max_examples=40)
@given(towns, spots, spots)
def test_of_the_alternatives_none_is_as_good_as_another_in_everything(place: Town, start: Point2, goal: Point2) -> None:
    trips = Trips(place)
    found = trips.alternatives(start, goal, EIGHT)
    rows = [(t.arrive, t.price, t.walked) for t in found]
    assert not any(all(x <= y for x, y in zip(a, b, strict=True)) for a, b in itertools.permutations(rows, 2))
    best = trips.plan(start, goal, EIGHT)
    assert (best is None) == (not found)
    if best is not None:
        assert rows[0] == (best.arrive, best.price, best.walked)


@settings(max_examples=30)
@given(towns, st.lists(st.tuples(spots, spots), min_size=4, max_size=4))
def test_what_was_asked_before_changes_no_answer(place: Town, pairs: list[tuple[Point2, Point2]]) -> None:
    def answer(trips: Trips, pair: tuple[Point2, Point2]) -> Any:
        trip = trips.plan(*pair, EIGHT)
        return trip and [(leg.mode, leg.origin, leg.destination, leg.depart, leg.arrive) for leg in trip.legs]

    shared = Trips(place)
    in_turn = [answer(shared, pair) for pair in pairs]
    backwards = Trips(place)
    with ThreadPoolExecutor(4) as pool:
        in_threads = list(pool.map(lambda pair: answer(backwards, pair), reversed(pairs)))[::-1]
    assert in_turn == in_threads == [answer(Trips(place), pair) for pair in pairs]


FAR = town(
    [stop(0, (-151.0, -101.0)), stop(1, (151.0, -101.0))],
    [line(0, [0, 1], [int(EIGHT), int(EIGHT) + 600], [0.0, 40.0, 200.0])],
    [station(0, (-141.0, -95.0)), station(1, (141.0, -95.0))],
)
WEST, EAST = (-155.0, -101.0), (155.0, -101.0)


def test_a_bus_that_leaves_soon_is_taken() -> None:
    trip = Trips(FAR).plan(WEST, EAST, EIGHT - 30)
    assert trip is not None
    assert trip.modes == ("walk", "bus", "walk")
    ride = trip.legs[1]
    assert (ride.line, ride.origin, ride.destination) == ("line_0", "stop_0", "stop_1")
    assert (ride.depart, ride.arrive, trip.price) == (EIGHT, EIGHT + 40.0 + ALIGHT, BUS_FARE)
    assert ride.polyline.tolist() == [[-151.0, -101.0], [151.0, -101.0]]


def test_when_the_bus_is_gone_a_bicycle_is_faster() -> None:
    trip = Trips(FAR).plan(WEST, EAST, EIGHT + 60)
    assert trip is not None
    assert trip.modes == ("walk", "bike", "walk")
    assert trip.price == pytest.approx(ride_price(282 / 3 + DISMOUNT, returned=True))


def test_who_has_to_be_there_sets_out_at_the_last_second_where_no_bus_runs() -> None:
    trips = Trips(FAR)
    trip = trips.plan(WEST, EAST, EIGHT, modes=("walk", "bike"), arrive_by=EIGHT + 900)
    late = trips.plan(WEST, EAST, EIGHT, modes=("walk", "bike"))
    assert trip is not None
    assert late is not None
    assert trip.modes == ("walk", "bike", "walk")
    assert trip.seconds == pytest.approx(late.seconds)
    assert EIGHT + 899 < trip.arrive <= EIGHT + 900


def test_only_the_modes_asked_for_are_used() -> None:
    trips = Trips(FAR)
    walk = trips.plan(WEST, EAST, EIGHT, modes=("walk",))
    bus = trips.plan(WEST, EAST, EIGHT + 60, modes=("bus",))
    assert walk is not None
    assert bus is not None
    assert (walk.modes, bus.modes) == (("walk",), ("walk", "bus", "walk"))
    assert bus.legs[1].depart == EIGHT + 600
    with pytest.raises(InputError, match="'fly'"):
        trips.plan(WEST, EAST, EIGHT, modes=("fly",))


def test_who_has_no_money_walks() -> None:
    trip = Trips(FAR).plan(WEST, EAST, EIGHT - 30, cash=0.1)
    assert trip is not None
    assert (trip.modes, trip.price) == (("walk",), 0.0)


def test_an_empty_station_gives_no_bicycle_and_a_full_one_takes_none() -> None:
    for first, second in ((station(0, (-141.0, -95.0), 4, 0), FAR.transit.bike_stations[1]),
                          (FAR.transit.bike_stations[0], station(1, (141.0, -95.0), 4, 4))):  # fmt: skip
        trip = Trips(town(bikes=[first, second])).plan(WEST, EAST, EIGHT)
        assert trip is not None
        assert trip.modes == ("walk",)


@pytest.mark.parametrize("closed", ["line_0", "stop_0", "stop_1"])
def test_a_closed_line_or_stop_is_not_used(closed: str) -> None:
    trip = Trips(FAR).plan(WEST, EAST, EIGHT - 30, closed=[closed])
    assert trip is not None
    assert trip.modes == ("walk", "bike", "walk")


def test_a_closed_station_is_not_used_and_a_name_nobody_knows_is_refused() -> None:
    trips = Trips(FAR)
    trip = trips.plan(WEST, EAST, EIGHT + 60, closed=["bikes_1"])
    assert trip is not None
    assert trip.modes == ("walk",)
    with pytest.raises(InputError, match="'bikes_9'"):
        trips.plan(WEST, EAST, EIGHT, closed=["bikes_9"])


def test_closed_ground_is_walked_around() -> None:
    trips = Trips(FAR)
    open_way = trips.plan(WEST, EAST, EIGHT, modes=("walk",))
    way_round = trips.plan(WEST, EAST, EIGHT, modes=("walk",), closed=[(0.0, -101.0, 30.0)])
    assert open_way is not None
    assert way_round is not None
    assert way_round.walked > open_way.walked + 5.0
    assert np.hypot(*(way_round.legs[0].polyline - (0.0, -101.0)).T).min() >= 29.0
    again = trips.plan(WEST, EAST, EIGHT, modes=("walk",))
    assert again is not None
    assert again.walked == open_way.walked


def test_a_walk_costs_its_length_and_its_corners() -> None:
    # From one side of the wall to the other by the gap at its end.
    trip = Trips(town()).plan((-101.0, -21.0), (-101.0, 41.0), EIGHT)
    assert trip is not None
    corners = len(trip.legs[0].polyline) - 2
    assert corners >= 1
    assert trip.seconds == pytest.approx(trip.walked + corners, abs=0.01)
    assert trip.walked == pytest.approx(ROUTER.length((-101.0, -21.0), (-101.0, 41.0)), abs=0.01)


def test_from_nowhere_there_is_no_trip() -> None:
    assert Trips(FAR).plan((0.0, 3.0 + 1e4), EAST, EIGHT) is None
    assert Trips(FAR).alternatives((0.0, 1e4), EAST, EIGHT) == []
    assert Trips(FAR).seconds((0.0, 1e4), EAST, EIGHT) == math.inf
