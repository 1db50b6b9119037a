"""Trams on a straight track in the toy city: on time, boarded, stopping for people, and gone at its end."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import toy_city
from road_city import lanes_of
from vico.agents.schedule import followers_of
from vico.agents.travel import Traveller
from vico.community.model import Mode
from vico.geo.frame import LocalFrame
from vico.rules import BUS_DWELL
from vico.seeds import rng
from vico.sim.bodies.state_arrays import Posture, Vehicle
from vico.sim.config import SimConfig
from vico.sim.loop.checks import overlaps_of
from vico.sim.loop.simulation import Simulation
from vico.sim.transit.passengers import FIRST_PASSENGER
from vico.sim.transit.system import TransitSystem
from vico.sim.transit.tram_network import TramNetwork, zones_of
from vico.world.public import PublicMap
from vico.world.transit import TRAM_LENGTH, Track, TramLine, TramStop
from vico.world.walkways import CORNER, CROSSING, SIDEWALK
from vico.world.world import World
from vico.worldgen.streets.netconvert import empty_network

EIGHT = 8 * 3600
Y = -20.0


def line(number: int, track: list[tuple[float, float]], stops: list[str], offsets: list[float]) -> TramLine:
    """A line that leaves every five minutes."""
    travel = [30.0 + 45.0 * k for k in range(len(stops) + 1)]
    return TramLine(
        id=f"tram_{number}", name=str(number + 4), kind="tram", colour="#00985f", track=track, stops=stops,
        offsets=offsets, departures=list(range(EIGHT + 20, EIGHT + 7200, 300)), travel=travel,
    )  # fmt: skip


def tram_world() -> World:
    """The toy city with a tram from west to east; its stops are 34 m apart."""
    world = toy_city.world()
    stops = [
        TramStop(id=f"tram_stop_{k}", entity=93_000 + k, name=name, wait=(x, Y - 2.2, 0.02 * x))
        for k, (name, x) in enumerate((("West", -22.0), ("East", 12.0)))
    ]
    lines = [line(0, [(-40.0, Y), (40.0, Y)], ["tram_stop_0", "tram_stop_1"], [30.0, 64.0])]
    world.__dict__["transit"] = world.transit.model_copy(update={"tram_stops": stops, "tram_lines": lines})
    world.__dict__["lanes"] = lanes_of(empty_network(LocalFrame(60.17, 24.94), toy_city.HALF))
    return world


@pytest.fixture
def sim() -> Simulation:
    config = SimConfig(cars=0, pedestrians=0, assistants=2, start=EIGHT, observe=())
    simulation = Simulation(tram_world(), None, config)
    simulation.state.people.cash[:] = 9.0
    simulation.scenario.place_agent("assistant_0", (-22.0, Y - 2.2))
    simulation.scenario.place_agent("assistant_1", (20.0, 0.0))
    return simulation


def system(sim: Simulation) -> TransitSystem:
    assert sim.state.transit is not None
    return sim.state.transit


def run(sim: Simulation, seconds: int, **action: Any) -> dict[str, Any]:
    state: dict[str, Any] = {}
    for _ in range(seconds):
        result = sim.step({"assistant_0": action} if action else {})
        state = result.observations["assistant_0"]["state"]
        assert overlaps_of(sim.state) == []
    return state


def until(sim: Simulation, stop: str) -> None:
    """Wait until a tram stands at a stop with its doors open."""
    for _ in range(240):
        run(sim, 1)
        trams = system(sim).trams
        if any(trams.stopped_at(int(t)) == stop and trams.open[t] > 0.9 for t in trams.standing):
            return
    raise AssertionError(f"no tram came to {stop}")


def test_a_tram_comes_on_time_takes_people_for_the_fare_and_everybody_off_at_its_last_stop(sim: Simulation) -> None:
    until(sim, "tram_stop_0")
    state = run(sim, 1, type="enter_bus")
    assert (state["action_status"], state["vehicle"], state["cash"]) == ("ok", "tram", 7.0)
    people = sim.state.people
    assert people.posture[0] == Posture.SITTING
    assert sim.state.entity(int(people.vehicle_entity[0]))["kind"] == "tram"
    trams = system(sim).trams
    tram = int(trams.standing[0])
    trams.riders[tram, 5] = FIRST_PASSENGER
    # It leaves by the timetable and not before, with its doors shut, and the rider in it.
    leaves = EIGHT + 20 + 30 + BUS_DWELL
    run(sim, int(leaves - sim.state.second) - 3)
    assert system(sim).stopped_at(system(sim).traffic.buses) == "tram_stop_0"
    run(sim, 4)
    assert system(sim).trams.open.max() == 0.0
    assert run(sim, 1, type="exit_bus")["action_code"] == "moving"
    until(sim, "tram_stop_1")
    assert people.position[0, 0] > -5.0
    seen = []
    for _ in range(60):
        seen += [event.text for event in sim.step({}).events if event.kind == "alighting"]
    assert people.vehicle[0] == Vehicle.NONE
    assert seen == ["gets off at tram_stop_1"]
    told = sim.reports()["trams"]
    assert told["arrivals"] == 2
    assert -25.0 < told["late_mean"] < 2.0
    # It has left the city, and a passer-by with it who found no pavement at the last stop.
    assert len(system(sim).bodies()) == 0
    assert trams.riders[tram, 5] == FIRST_PASSENGER


def test_a_railway_has_trains_that_are_called_so_and_drawn_as_such() -> None:
    world = tram_world()
    line = world.transit.tram_lines[0].model_copy(update={"kind": "rail"})
    world.__dict__["transit"] = world.transit.model_copy(update={"tram_lines": [line]})
    sim = Simulation(world, None, SimConfig(cars=0, pedestrians=0, start=EIGHT + 20))
    sim.step({})
    trams = system(sim).trams
    assert {sim.state.entity(int(entity))["kind"] for entity in trams.bodies().entity} == {"train"}
    drawn = trams.draw()
    assert {drawn.prototypes[k] for k in drawn.index.tolist()} <= {
        f"train_{part}" for part in ("front", "middle", "rear", "leaf")
    }
    assert len(drawn.index) > 0


def test_a_full_tram_says_so(sim: Simulation) -> None:
    until(sim, "tram_stop_0")
    trams = system(sim).trams
    trams.riders[trams.standing[0]] = 999
    sim.step({"assistant_0": {"type": "enter_bus"}})
    capacity = trams.riders.shape[1]
    assert sim.state.people.reason[0] == f"enter_bus: tram 4 is full with {capacity} people"


def test_a_tram_stops_for_who_stands_on_its_track_and_goes_on_when_they_are_gone(sim: Simulation) -> None:
    sim.scenario.place_agent("assistant_0", (10.0, Y))
    run(sim, 120)
    trams = system(sim).trams
    bodies = trams.bodies()
    front = float((bodies.position[:, 0] + bodies.half_length).max())
    assert 6.0 < front < 9.75
    assert trams.speed.max() < 1e-6
    sim.scenario.place_agent("assistant_0", (0.0, 0.0))
    run(sim, 5)
    assert trams.speed.max() > 1.0


def test_a_run_with_trams_goes_on_alike_from_a_snapshot(sim: Simulation) -> None:
    run(sim, 45)
    kept = sim.snapshot()
    run(sim, 30)
    later = sim.state_hash()
    sim.restore(kept)
    run(sim, 30)
    assert sim.state_hash() == later


def test_trips_take_the_tram_where_that_is_faster_and_travellers_follow_them(sim: Simulation) -> None:
    world = sim.world
    trip = world.trips.plan((-22.0, Y - 4.0), (14.0, Y - 4.0), EIGHT, modes=("tram",))
    assert trip is not None
    assert trip.modes == ("walk", "tram", "walk")
    leg = trip.legs[1]
    assert (leg.origin, leg.destination, leg.line, leg.price) == ("tram_stop_0", "tram_stop_1", "tram_0", 2.0)
    assert leg.depart == EIGHT + 20 + 30 + BUS_DWELL
    assert world.trips.plan((-22.0, Y), (14.0, Y), EIGHT, modes=("tram",), closed=["tram_0"]) is None
    traveller = Traveller(PublicMap.from_world(world), rng(0, "traveller"), modes=("tram",))
    observations, infos = sim.observe()
    ridden = False
    for _ in range(200):
        name = "assistant_0"
        action = traveller.towards((14.0, Y - 4.0), observations[name], infos[name])
        if action is None:
            break
        result = sim.step({name: action})
        observations, infos = result.observations, result.infos
        ridden |= bool(sim.state.people.vehicle[0] == Vehicle.BUS)
    assert ridden
    assert np.linalg.norm(sim.state.people.position[0, :2] - (14.0, Y - 4.0)) < 2.0


def test_a_resident_takes_the_tram_as_the_schedule_says_and_the_counts_say_so() -> None:
    world, nobody = tram_world(), toy_city.community()
    way = toy_city.item("commute", "07:59:30", "08:03:30", None).model_copy(update={"mode": Mode.TRAM})
    day = [
        toy_city.item("sleep", "00:00:00", "07:59:30", toy_city.CAFE),
        way,
        toy_city.item("main", "08:03:30", "23:59:59", toy_city.PARK),
    ]
    people = nobody.model_copy(update={"residents": [toy_city.resident(0, "Ada Berg", day)], "relations": []})
    sim = Simulation(world, people, SimConfig(cars=0, pedestrians=0, start=EIGHT - 60, observe=()))
    ada = followers_of(people, PublicMap.from_world(world))["resident_0"]
    observations, infos = sim.observe()
    seen = ("boarding", "alighting", "arrival")
    told: list[tuple[str, Any]] = []
    for _ in range(230):
        result = sim.step({"resident_0": ada.act(observations["resident_0"], infos["resident_0"])})
        observations, infos = result.observations, result.infos
        told += [(event.kind, event.data) for event in result.events if event.kind in seen]
    assert tuple(kind for kind, _ in told) == seen
    assert told[-1][1]["mode"] == "tram"
    assert told[-1][1]["seconds_late"] <= 0.0
    counts = sim.punctuality.by_mode()
    assert [(counts[mode]["meant"], counts[mode]["made"]) for mode in ("tram", "bus")] == [(1, 1), (0, 0)]


def test_where_tracks_cross_one_tram_at_a_time_is_let_in() -> None:
    # Both are due at the crossing at once, every time.
    world = tram_world()
    cross = line(1, [(0.0, -40.0), (0.0, 40.0)], [], [])
    lines = [replace_stops(world.transit.tram_lines[0]), cross]
    world.__dict__["transit"] = world.transit.model_copy(update={"tram_lines": lines})
    sim = Simulation(world, None, SimConfig(cars=0, pedestrians=0, start=EIGHT))
    trams = system(sim).trams
    _, count = zones_of([Track(one.track) for one in lines])
    assert count == 1
    both = 0
    for _ in range(90):
        sim.step({})
        assert overlaps_of(sim.state) == []
        both += int((trams.front > 0).sum() == 2)
    assert both > 10
    assert (trams.front < 0).all()


def replace_stops(one: TramLine) -> TramLine:
    """The same line without stops."""
    return one.model_copy(update={"stops": [], "offsets": [], "travel": one.travel[:1]})


def test_trams_keep_clear_of_all_that_stands_beside_the_track() -> None:
    track = Track([(0.0, 0.0), (40.0, 0.0), (60.0, 20.0), (60.0, 80.0)])
    # In bends sections reach farther to the sides, and are slower.
    assert track.half_width[80] > track.half_width[20] + 0.1
    assert track.speed[80] < track.speed[0]
    middle = track.section(np.arange(TRAM_LENGTH, track.length, 1.0))
    assert np.abs(np.diff(np.unwrap(middle[:, 2]))).max() < 0.25


class _Walks:
    """Walkways as far as tracks are concerned: what each is, and where."""

    def __init__(self, rows: list[tuple[int, list[tuple[float, float]]]]) -> None:
        self.kind = np.array([kind for kind, _ in rows])
        self._lines = [np.array(line) for _, line in rows]

    def __len__(self) -> int:
        return len(self._lines)

    def line(self, k: int) -> np.ndarray:
        return self._lines[k]


def test_nobody_walks_along_tracks_on_sidewalks_or_over_corners_but_across_them(
    sim: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    beside = Y - 3.2
    along, across = [(-10.0, Y + 0.5), (2.0, Y + 0.5)], [(5.0, Y + 9.0), (5.0, beside - 9.0)]
    rows = [
        (SIDEWALK, along), (CORNER, along), (CROSSING, along), (SIDEWALK, [(-10.0, Y + 3.0), (2.0, Y + 3.0)]),
        # Over both tracks at right angles; at the corner round a bend one walks along the nearer one.
        (CORNER, across), (CORNER, [(5.0, Y + 3.0), (5.0, Y), (18.0, Y)]),
    ]  # fmt: skip
    network = TramNetwork([], sim.base.streets.lanes, _Walks(rows))  # type: ignore[arg-type]
    monkeypatch.setattr(network, "tracks", [Track([(-40.0, y), (40.0, y)]) for y in (Y, beside)])
    assert network.walkways_on_tracks.tolist() == [True, True, False, False, False, True]


def test_a_tram_asks_those_to_go_who_stand_on_its_track_before_it(
    sim: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    sim.scenario.place_agent("assistant_0", (10.0, Y))
    run(sim, 120)
    trams = system(sim).trams
    front = float((trams.bodies().position[:, 0] + trams.bodies().half_length).max())
    xy = np.array([[0.0, 0.0], [front + 1.0, Y], [front + 1.0, Y + 1.0], [front + 1.0, Y + 3.0], [front + 9.0, Y]])
    shapes = SimpleNamespace(x=xy[:, 0], y=xy[:, 1])
    walkers = SimpleNamespace(before_tram=np.ones(4, np.bool_))  # the first body is a vehicle
    traffic = SimpleNamespace(shapes=shapes, vehicles=1, pedestrian_state=walkers)
    monkeypatch.setattr(trams, "_traffic", traffic)
    trams._ask_to_go()
    assert walkers.before_tram.tolist() == [True, True, False, False]
    trams.speed[trams.front > -1.0] = 1.0
    trams._ask_to_go()
    assert not walkers.before_tram.any()


def test_simulations_of_a_world_share_what_never_changes_about_its_trams(sim: Simulation) -> None:
    other = Simulation(sim.world, None, sim.config)
    assert system(other).trams.network is system(sim).trams.network
    assert other.state_hash() == Simulation(sim.world, None, sim.config).state_hash()
