"""An assistant goes from door to door by bus and by bicycle, in the simulation, with what it is told and no more."""

from __future__ import annotations

import itertools
import json
from typing import Any

import numpy as np
import pytest

from vico.agents.travel import Traveller
from vico.rules import BUS_FARE
from vico.seeds import rng
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.world.public import PublicMap
from vico.world.world import World

EIGHT = 8 * 3600
ME = "assistant_0"
Spot = tuple[float, float]


@pytest.fixture(scope="module")
def public(helsinki_city: World) -> PublicMap:
    return PublicMap.from_world(helsinki_city)


class Journey:
    """One assistant with money on its way through the city."""

    def __init__(self, city: World, public: PublicMap, ends: tuple[Spot, Spot], modes: tuple[str, ...]) -> None:
        self.start, self.goal = ends
        self.sim = Simulation(city, None, SimConfig(assistants=1, observe=(), start=EIGHT, cars=20, pedestrians=20))
        self.sim.state.people.cash[0] = 50.0
        self.sim.scenario.place_agent(ME, self.start)
        self.public, self.modes, self.chance = public, modes, rng(0, "travel")
        self.traveller = Traveller(public, self.chance, modes=modes)
        self.observation, self.info = (part[ME] for part in self.sim.observe())
        self.vehicles: list[str] = []

    @property
    def second(self) -> float:
        return float(self.observation["state"]["time"])

    @property
    def paid(self) -> float:
        return round(50.0 - float(self.observation["state"]["cash"]), 2)

    def do(self, action: dict[str, Any]) -> None:
        result = self.sim.step({ME: action})
        self.observation, self.info = result.observations[ME], result.infos[ME]
        self.vehicles.append(self.observation["state"]["vehicle"])

    def go(self, limit: float, twin: Traveller | None = None) -> bool:
        """Travel until there, for so many seconds at most."""
        while self.second < EIGHT + limit:
            action = self.traveller.towards(self.goal, self.observation, self.info)
            assert twin is None or twin.towards(self.goal, self.observation, self.info) == action
            if action is None:
                return bool(np.hypot(*(self.observation["pose"][:2] - self.goal)) < 0.5)
            self.do(action)
        return False

    def board(self) -> None:
        """Travel until in a vehicle."""
        while not self.vehicles or not self.vehicles[-1]:
            action = self.traveller.towards(self.goal, self.observation, self.info)
            assert action is not None
            self.do(action)

    def restored(self) -> Traveller:
        """Another traveller in the state of this one."""
        saved = self.traveller.state()
        rest = {k: v for k, v in saved.items() if k not in ("walker", "legs")}
        assert json.loads(json.dumps(rest)) == rest
        chance = np.random.Generator(np.random.PCG64())
        chance.bit_generator.state = self.chance.bit_generator.state
        twin = Traveller(self.public, chance, modes=self.modes)
        twin.restore(saved)
        return twin


def ends_of_a_ride(public: PublicMap, mode: str, number: int) -> tuple[Spot, Spot]:
    """A start and a goal that one travels between by bus or bicycle, a little way from the stops."""
    if mode == "bus":
        # The loop's stops: where streets are wider than their lanes one may wait out of reach of the doors.
        loop = max(public.lines, key=lambda line: len(line.stops))
        spots, only = [stop.wait for stop in public.stops if stop.id in loop.stops], loop.id
    else:
        spots, only = [station.position for station in public.bike_stations], None
    found = 0
    for k, (a, b) in enumerate(itertools.permutations(spots, 2)):
        chance = rng(k, "ends")
        start, goal = (
            tuple(public.walkable.random_point(chance, near=spot[:2], radius=25.0, clearance=0.6).tolist())
            for spot in (a, b)
        )
        trip = public.trips.plan(start, goal, EIGHT, modes=(mode,))
        if (
            trip is not None
            and trip.modes == ("walk", mode, "walk")
            and trip.seconds < 600
            and trip.legs[1].line == only
        ):
            if found == number:
                return start, goal
            found += 1
    raise AssertionError(f"no {mode} ride in this city")


@pytest.mark.parametrize(("mode", "number"), [("bus", 0), ("bike", 0), pytest.param("bike", 5, marks=pytest.mark.slow)])
def test_a_traveller_arrives_about_when_planned_and_a_restored_one_would(
    helsinki_city: World, public: PublicMap, mode: str, number: int
) -> None:
    ends = ends_of_a_ride(public, mode, number)
    trip = public.trips.plan(*ends, EIGHT, modes=(mode,))
    assert trip is not None
    journey = Journey(helsinki_city, public, ends, (mode,))
    transit = journey.sim.state.transit
    assert transit is not None
    before = transit.bicycles.free()
    journey.board()
    # Buses are up to two minutes late (see the timetable's tests), and others are in the way.
    assert journey.go(trip.seconds * 1.2 + 120.0, journey.restored())
    assert journey.traveller.plans == 1
    assert {mode} < set(journey.vehicles)
    assert journey.paid == (BUS_FARE if mode == "bus" else pytest.approx(trip.price, abs=0.2 * 3))
    change = dict(zip((s.id for s in public.bike_stations), (transit.bicycles.free() - before).tolist(), strict=True))
    brought = {trip.legs[1].origin: -1, trip.legs[1].destination: 1} if mode == "bike" else {}
    assert {name: k for name, k in change.items() if k} == brought


@pytest.mark.slow
def test_who_finds_the_rack_empty_plans_anew(helsinki_city: World, public: PublicMap) -> None:
    ends = ends_of_a_ride(public, "bike", 0)
    journey = Journey(helsinki_city, public, ends, ("walk", "bike"))
    first = public.trips.plan(*ends, EIGHT, modes=("bike",))
    assert first is not None
    transit = journey.sim.state.transit
    assert transit is not None
    gone = next(k for k, s in enumerate(public.bike_stations) if s.id == first.legs[1].origin)
    # Somebody took them all for the day.
    taken = transit.bicycles.station == gone
    transit.bicycles.station[taken] = transit.bicycles.slot[taken] = -1
    transit.bicycles.xy[taken] = (390.0, 390.0)
    journey.traveller = Traveller(public, rng(0, "travel"), modes=("bike",))
    assert journey.go(2500.0)
    assert journey.traveller.plans >= 2


def test_who_misses_the_bus_takes_another_way(helsinki_city: World, public: PublicMap) -> None:
    ends = ends_of_a_ride(public, "bus", 0)
    journey = Journey(helsinki_city, public, ends, ("bus",))
    trip = public.trips.plan(*ends, EIGHT, modes=("bus",))
    assert trip is not None
    action = journey.traveller.towards(journey.goal, journey.observation, journey.info)
    assert action is not None
    while journey.second < trip.legs[1].depart + 250.0:
        journey.do({"type": "wait"})  # dawdles
    assert journey.go(2500.0)
    assert journey.traveller.plans == 2


def test_who_has_no_money_walks(helsinki_city: World, public: PublicMap) -> None:
    journey = Journey(helsinki_city, public, ends_of_a_ride(public, "bike", 0), ("walk", "bus", "bike"))
    journey.sim.state.people.cash[0] = 0.1
    journey.observation["state"]["cash"] = 0.1
    action = journey.traveller.towards(journey.goal, journey.observation, journey.info)
    assert action is not None
    assert journey.traveller.trip is not None
    assert journey.traveller.trip.modes == ("walk",)
