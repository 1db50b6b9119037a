"""Residents take buses, trams and bicycles: their author plans it, the validator checks it, they do it and arrive."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from vico.agents.schedule import ScheduleFollower, followers_of
from vico.clock import clock_of, seconds_of_day
from vico.community import Community, Mode, Resident, ScheduleItem, build_community, check_community
from vico.community.place_index import PlaceIndex
from vico.io.plain_data import decode, encode
from vico.rules import walk_speed
from vico.sim.config import SimConfig
from vico.sim.loop.punctuality import EARLIEST
from vico.sim.loop.simulation import Simulation
from vico.world.public import PublicMap
from vico.world.world import World

Way = tuple[ScheduleItem, ScheduleItem, ScheduleItem]


@pytest.fixture(scope="module")
def people(helsinki_city: World) -> Community:
    return build_community(helsinki_city, residents=40, seed=3)


def ways(resident: Resident) -> list[Way]:
    day = resident.schedule
    return [(a, way, b) for (a, way), b in zip(pairwise(day), day[2:], strict=False) if way.type == "commute"]


def rides(community: Community, mode: Mode) -> list[tuple[Resident, Way]]:
    return [(r, way) for r in community.residents for way in ways(r) if way[1].mode is mode]


def test_some_ride_and_most_walk_and_the_validator_agrees(helsinki_city: World, people: Community) -> None:
    walked = [way for r in people.residents for way in ways(r) if way[1].mode is None]
    by_bus, by_tram, by_bike = (rides(people, mode) for mode in (Mode.BUS, Mode.TRAM, Mode.BIKE))
    assert by_bus
    assert by_tram
    assert len(by_bike) > len(by_bus) + len(by_tram)
    assert len(walked) > 4 * (len(by_bus) + len(by_tram) + len(by_bike))
    assert check_community(people, helsinki_city) == []


def test_who_rides_sets_out_later_than_on_foot_and_never_for_a_short_way(
    helsinki_city: World, people: Community
) -> None:
    index = PlaceIndex(helsinki_city, people.date)
    for mode in (Mode.BUS, Mode.TRAM, Mode.BIKE):
        for resident, (before, way, after) in rides(people, mode):
            on_foot = index.minutes(before.place or "", after.place or "", walk_speed(resident.age))
            assert on_foot is not None
            assert on_foot >= 6
            # Who takes the bus sets out a minute sooner than the way to its stop asks for.
            spare = 1 if mode is Mode.BUS else 0
            assert seconds_of_day(way.end) - seconds_of_day(way.start) <= 60 * (on_foot + spare)


def test_who_takes_the_bus_has_a_minute_to_spare_on_the_way_to_the_stop(
    helsinki_city: World, people: Community
) -> None:
    index = PlaceIndex(helsinki_city, people.date)
    taken = rides(people, Mode.BUS)
    assert taken
    for resident, (before, way, after) in taken:
        a, b = (index.place_by_id[item.place or ""] for item in (before, after))
        doors = a.position[:2], b.position[:2]
        late = seconds_of_day(way.start) + index.indoors(a.id) + 60.0
        found = index.rides.first(doors, Mode.BUS, late, resident.cash)
        assert found is not None
        assert found.arrive + index.indoors(b.id) <= seconds_of_day(way.end)


def test_no_more_bicycles_are_planned_with_than_a_station_has(helsinki_city: World, people: Community) -> None:
    index = PlaceIndex(helsinki_city, people.date)
    moves: dict[str, list[tuple[float, int]]] = {}
    for resident, (before, way, after) in rides(people, Mode.BIKE):
        ends = [index.place_by_id[item.place or ""].position[:2] for item in (before, after)]
        depart = seconds_of_day(way.start) + index.indoors(before.place or "") + 20.0
        trip = helsinki_city.trips.plan(*ends, depart, modes=("bike",), cash=float(resident.cash))
        assert trip is not None
        ride = next(leg for leg in trip.legs if leg.mode == "bike")
        moves.setdefault(ride.origin or "", []).append((ride.depart, -1))
        moves.setdefault(ride.destination or "", []).append((ride.arrive, 1))
    for station in helsinki_city.transit.bike_stations:
        counts = station.bikes + np.cumsum([change for _, change in sorted(moves.get(station.id, []))])
        assert counts.size == 0 or (counts.min() >= 0 and counts.max() <= station.capacity)


def changed(community: Community, find: Callable[[Resident, Way], dict[str, Any] | None]) -> Community:
    """The community with the first way or stay changed for which `find` has a change."""
    for n, resident in enumerate(community.residents):
        for way in ways(resident):
            change = find(resident, way)
            if change is not None:
                day = [item.model_copy(update=change) if item is way[1] else item for item in resident.schedule]
                people = list(community.residents)
                people[n] = resident.model_copy(update={"schedule": day})
                return community.model_copy(update={"residents": people})
    raise AssertionError("nothing to change")


def test_the_validator_sees_rides_that_cannot_be(helsinki_city: World, people: Community) -> None:
    def hurried(resident: Resident, way: Way) -> dict[str, Any] | None:
        if way[1].mode is not Mode.BIKE:
            return None
        return {"start": clock_of(seconds_of_day(way[1].end) - 60)}

    findings = check_community(changed(people, hurried), helsinki_city)
    assert any("for the way by bike" in finding.what for finding in findings)

    def stays(resident: Resident, way: Way) -> Community:
        day = [item.model_copy(update={"mode": Mode.BUS}) if item is way[0] else item for item in resident.schedule]
        mine = [resident.model_copy(update={"schedule": day}), *people.residents[1:]]
        return people.model_copy(update={"residents": mine})

    first = people.residents[0]
    assert any("has a mode" in f.what for f in check_community(stays(first, ways(first)[0]), helsinki_city))


def seconds(way: ScheduleItem) -> int:
    """How long a way is meant to take."""
    return seconds_of_day(way.end) - seconds_of_day(way.start)


class Commute:
    """One resident on one way of the day; nobody else lives here."""

    def __init__(self, city: World, people: Community, mode: Mode) -> None:
        # The shortest way, which costs the fewest steps.
        self.resident, (_, self.way, self.after) = min(rides(people, mode), key=lambda ride: seconds(ride[1][1]))
        nobody = {"residents": [self.resident], "groups": [], "relations": []}
        self.community = people.model_copy(update=nobody)
        start = seconds_of_day(self.way.start) - 2
        self.sim = Simulation(city, self.community, SimConfig(start=start, observe=(), cars=10, pedestrians=10))
        self.public = PublicMap.from_world(city)
        self.agent = self.follower()
        self.vehicles: set[str] = set()
        self.arrived: dict[str, Any] | None = None

    def follower(self) -> ScheduleFollower:
        return followers_of(self.community, self.public)[self.resident.id]

    def go(self, seconds: int, *, twin: ScheduleFollower | None = None, into: str | None = None) -> None:
        """Go on until there or, if one is named, in a vehicle."""
        observations, infos = self.sim.observe()
        me = self.resident.id
        for _ in range(seconds):
            action = self.agent.act(observations[me], infos[me])
            if twin is not None:
                assert twin.act(observations[me], infos[me]) == action
            result = self.sim.step({me: action})
            observations, infos = result.observations, result.infos
            self.vehicles.add(observations[me]["state"]["vehicle"])
            for event in result.events:
                if event.kind == "arrival":
                    self.arrived = event.data
                    return
            if into in self.vehicles:
                return


@pytest.mark.parametrize("mode", [Mode.BUS, Mode.BIKE])
def test_a_resident_rides_as_the_schedule_says_and_is_on_time_and_so_does_a_restored_one(
    helsinki_city: World, people: Community, mode: Mode
) -> None:
    commute = Commute(helsinki_city, people, mode)
    commute.go(1500, into=mode)
    assert commute.arrived is None
    twin = commute.follower()
    twin.restore(decode(encode(commute.agent.state())))
    commute.go(1500, twin=twin)  # which would do the same
    assert commute.arrived is not None
    assert commute.arrived["mode"] == mode
    assert commute.arrived["place"] == commute.after.place
    assert commute.arrived["seconds_late"] <= 60.0
    assert commute.vehicles == {"", mode}
    told = commute.sim.punctuality.by_mode()[mode]
    assert (told["made"], told["meant"], told["on_time"]) == (1, 1, 1)
    assert told["late_median"] == max(round(commute.arrived["seconds_late"]), EARLIEST)


def test_who_finds_no_bicycle_walks_and_the_counts_say_so(helsinki_city: World, people: Community) -> None:
    commute = Commute(helsinki_city, people, Mode.BIKE)
    transit = commute.sim.state.transit
    assert transit is not None
    # Somebody took them all for the day, and nobody goes by bus here.
    transit.bicycles.station[:] = transit.bicycles.slot[:] = -1
    transit.bicycles.xy[:] = (390.0, 390.0)
    commute.sim.state.people.cash[0] = 1.0
    commute.go(2400)
    assert commute.arrived is not None
    assert commute.arrived["mode"] == "walk"
    assert commute.vehicles == {""}
    found = commute.sim.punctuality.by_mode()
    assert (found["bike"]["meant"], found["bike"]["made"], found["walk"]["made"]) == (1, 0, 1)
