"""Events of the city: files of them, how they are kept, and what each does beside the same run without it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

import toy_city
from vico.agents.schedule import followers_of
from vico.agents.wayfinding import Walker
from vico.errors import VicoError
from vico.seeds import rng
from vico.sim.bodies.state_arrays import FIRST_THING
from vico.sim.config import SimConfig
from vico.sim.environment import Agenda, CityEvent, EventSites, event_kinds
from vico.sim.loop.simulation import Simulation
from vico.sim.people.hearing import noise_at
from vico.sim.recording import read_run
from vico.sim.recording.recorder import Recorder
from vico.sim.state.event_things import THINGS_EACH
from vico.world.public import PublicMap
from vico.world.walkable import CROSSING, ROADWAY
from vico.world.world import World

CLOSED = {"events": [{"kind": "closure", "place": "Hat Shop", "begin": "08:00", "end": "09:00", "name": "stocktaking"}]}


def simulation(events: Any = "none", **options: Any) -> Simulation:
    return Simulation(
        toy_city.world(), toy_city.community(), SimConfig(seed=3, assistants=1, observe=(), events=events, **options)
    )


def at_the_shop(sim: Simulation) -> dict[str, Any]:
    """Put the assistant at the shop's door; return its info."""
    people = sim.state.people
    people.position[-1, :2], people.room[-1], people.place[-1] = (5.0, 4.0), -1, -1
    return sim.observe()[1]["assistant_0"]


# What it says when something is wrong.


@pytest.mark.parametrize(
    ("events", "says"),
    [
        ("sometimes", "'sometimes' is not known; take none, changing"),
        ({"event": []}, "events: field required .and 1 more.; see docs/events.md"),
        (
            {"events": [{"kind": "closure", "begin": "09:00", "place": 7}]},
            "events.0.place: input should be a valid str",
        ),
        ({"events": [{"kind": "carnival", "begin": "09:00"}]}, "events.0: 'carnival' is no kind of event; there are"),
        ({"events": [{"kind": "closure", "begin": "09:00"}]}, "events.0: closure: where is it? give place"),
        ({"events": [{"kind": "closure", "begin": "9 am", "place": "x"}]}, "events.0: "),
        ({"events": [{"kind": "closure", "begin": "09:00", "place": "Hat"}]}, "no place has the id or name 'Hat'"),
        ({"events": [{"kind": "road_works", "begin": "09:00", "street": "A"}]}, "events.0: no street is called 'A'"),
        ({"events": [{"kind": "closure", "begin": "09:00", "place": "Hat Shop", "noise": 200.0}]}, "200 dB"),
        ({"events": [{"kind": "closure", "begin": "09:00", "street": "A", "place": "B"}]}, "can't be at a street"),
    ],
)
def test_a_file_of_events_that_is_wrong_is_refused_with_what_and_where(events: Any, says: str) -> None:
    with pytest.raises(VicoError, match=f"^events: .*{says.replace('?', '.')}"):
        Agenda(EventSites(toy_city.world()), events)


# How they are kept.


def test_a_run_without_events_has_nothing_of_them_in_its_state() -> None:
    assert not [name for name in simulation().arrays() if "events" in name and name != "events.heard"]


def test_events_are_saved_restored_and_hashed() -> None:
    sim = simulation(start=8 * 3600)
    number = sim.state.environment.start_event("closure", place="place_shop", minutes=10)
    before, digest = sim.snapshot(), sim.state_hash()
    sim.state.environment.end_event(number)
    assert sim.state_hash() != digest
    sim.step({})
    sim.restore(before)
    assert sim.state_hash() == digest
    assert [one.id for one in sim.state.environment.agenda.going_on] == [number]
    assert sim.state.environment.start_event("closure", place="place_cafe") == number + 1


def test_a_recording_tells_when_events_began_and_ended(tmp_path: Path) -> None:
    sim = simulation(CLOSED, start=9 * 3600 - 2)
    with Recorder(tmp_path / "run", sim, sources={"world": "", "community": ""}, wanted=3) as recorder:
        recorder.begin({})
        for _ in range(3):
            recorder.write(sim.step({}))
    run = read_run(tmp_path / "run")
    told = [(event["step"], event["text"]) for event in run.events if event["kind"] == "city"]
    assert [text for _, text in told] == ["stocktaking begins", "stocktaking ends"]


@pytest.mark.parametrize("seed", range(3))
def test_events_that_come_by_themselves_are_the_same_for_a_seed_and_others_for_another(
    seed: int, helsinki: World
) -> None:
    sites = EventSites(helsinki)
    listed = [Agenda(sites, "changing", seed=k).arrays().get("events", b"") for k in (seed, seed, seed + 1)]
    assert bytes(listed[0]) == bytes(listed[1]) != bytes(listed[2])
    assert {event["kind"] for event in json.loads(bytes(listed[0]))["events"]} <= set(event_kinds())


# What they do.


@pytest.mark.parametrize(("events", "status", "known"), [("none", "ok", []), (CLOSED, "refused", ["notice"])])
def test_nobody_gets_into_a_place_that_is_closed_and_who_stands_there_knows(
    events: Any, status: str, known: list[str]
) -> None:
    sim = simulation(events, start=8 * 3600)
    info = at_the_shop(sim)
    assert [event["known"] for event in info.get("events", [])] == known
    result = sim.step({"assistant_0": {"type": "enter", "place": "place_shop"}})
    assert result.observations["assistant_0"]["state"]["action_status"] == status
    assert result.infos["assistant_0"]["action_code"] == ("closed" if known else "")


def day_of_two(events: Any, *, together: bool) -> tuple[list[str], str]:
    """Return where the two who go to the shop are after two minutes, and the last hash."""
    sim = simulation(events, start=8 * 3600 - 5)
    agents = followers_of(toy_city.community(), PublicMap.from_world(toy_city.world()), seed=3)
    group = next(iter(agents.values())).group
    assert group is not None
    observations, infos = sim.observe()
    result = None
    for _ in range(90):
        if together:
            actions: dict[str, Any] = group.act_for(list(agents), observations, infos)
        else:
            actions = {name: agent.act(observations[name], infos[name]) for name, agent in agents.items()}
        result = sim.step(actions)
        observations, infos = result.observations, result.infos
    assert result is not None
    return [observations[f"resident_{k}"]["state"]["place"] for k in range(2)], result.hash


def test_residents_who_find_the_shop_closed_go_home_whether_asked_alone_or_together() -> None:
    shut = {"events": [{"kind": "closure", "place": "place_shop", "begin": "07:00"}]}
    assert day_of_two("none", together=True)[0] == ["place_shop"] * 2
    alone, together = (day_of_two(shut, together=together) for together in (False, True))
    assert alone == together
    assert alone[0] == ["place_cafe"] * 2


# Road works.

STREET = "Mikonkatu"


def traffic(world: World, events: Any = "none") -> Simulation:
    config = SimConfig(seed=1, cars=20, pedestrians=20, transit=False, observe=(), events=events, start=8 * 3600)
    return Simulation(world, None, config)


@pytest.fixture(scope="module")
def works(helsinki: World) -> dict[str, Any]:
    """The same two minutes with and without road works, which begin after ten seconds; and a snapshot of the middle.

    Cars that are there, or behind those in a street that leads nowhere else, need half a minute to drive out.
    """
    found: dict[str, Any] = {}
    for name in ("none", "works"):
        sim = traffic(helsinki)
        sites = sim.base.event_sites
        event = CityEvent(kind="road_works", street=STREET, begin=0.0, end=1.0)
        closed, walks = sites.lanes_of(event), sites.walkways_of(event)
        sim.check_overlaps()
        entered, before, on_foot = 0, np.zeros(20, bool), []
        for step in range(120):
            if name == "works" and step == 10:
                sim.state.environment.start_event("road_works", street=STREET, walkways=True)
            if name == "works" and step == 60:
                found["snapshot"] = sim.snapshot()
            result = sim.step({})
            assert sim.state.traffic is not None
            assert sim.overlap_check is not None
            now = closed[sim.state.traffic.fleet.lane]
            entered += int((now & ~before).sum()) if step > 60 else 0
            before = now
            on_foot.append(int(walks[sim.state.traffic.pedestrian_state.walkway].sum()))
        found[name] = {
            "entered": entered,
            "on_foot": sum(on_foot[60:]),
            "teleports": int(sim.state.traffic.fleet.teleports.sum()),
            "overlaps": sim.overlap_check.count,
            "hash": result.hash,
            "things": len(sim.state.things),
            "sim": sim,
        }
    return found


def test_no_car_drives_into_a_street_that_is_dug_up_and_none_vanishes(works: dict[str, Any]) -> None:
    assert works["none"]["entered"] >= 3
    assert works["works"]["entered"] == 0
    for run in ("none", "works"):
        assert (works[run]["teleports"], works[run]["overlaps"]) == (0, 0)
    assert (works["none"]["things"], works["works"]["things"]) == (0, 2)


def test_pedestrians_leave_walkways_that_are_closed(works: dict[str, Any]) -> None:
    assert works["none"]["on_foot"] > 50
    assert works["works"]["on_foot"] < 0.2 * works["none"]["on_foot"]


def test_a_run_with_road_works_goes_on_from_a_snapshot_to_the_same_hash(works: dict[str, Any], helsinki: World) -> None:
    sim = traffic(helsinki)
    sim.restore(works["snapshot"])
    for _ in range(60):
        digest = sim.step({}).hash
    assert digest == works["works"]["hash"]


def test_ways_lead_round_a_closed_walkway(works: dict[str, Any], helsinki: World) -> None:
    agenda = works["works"]["sim"].state.environment.agenda
    ground = agenda.effects.ground
    street = agenda.sites.street(agenda.going_on[0].event)
    ends = [shapely.get_coordinates(part)[[0, -1]] for part in shapely.get_parts(shapely.line_merge(street))]
    start, goal = max(ends, key=lambda pair: float(np.hypot(*(pair[0] - pair[1]))))
    trips = helsinki.trips
    free = trips.plan(start, goal, 8 * 3600, modes=("walk",))
    round_it = trips.plan(start, goal, 8 * 3600, modes=("walk",), closed=ground)
    assert free is not None
    assert round_it is not None
    assert round_it.seconds > free.seconds + 10.0
    walked = round_it.legs[0].polyline
    inside = [np.hypot(*(walked[1:-1] - (x, y)).T).min() < radius - 1.0 for x, y, radius in ground]
    assert not any(inside)


def test_residents_walk_round_what_they_know_is_closed(helsinki: World, works: dict[str, Any]) -> None:
    """A walker finds another way as soon as it is told, and its old one when that is over."""
    sites = works["works"]["sim"].base.event_sites
    street = sites.street(CityEvent(kind="road_works", street=STREET, begin=0.0, end=1.0))
    start, goal = shapely.get_coordinates(shapely.line_merge(street))[[0, -1]].tolist()
    walker = Walker(PublicMap.from_world(helsinki), rng(0, "walker"))
    ground = [list(circle) for circle in works["works"]["sim"].state.environment.agenda.effects.ground]
    events = [{"goes_on": True, "closed_ground": ground}]
    told: list[dict[str, Any]] = [{}, {"events": events}, {}]
    observation = {"pose": np.array([*start, 0.0, 1.0, 0.0, 0.0]), "state": {"action_status": "ok"}}
    left = []
    for info in told:
        walker.towards((goal[0], goal[1]), 1.0, observation, info | {"entities": {}, "in_view": Nobody()})
        left.append(walker.remaining(observation["pose"]))
    assert left[1] > left[0] + 3.0
    assert left[2] == left[0]


class Nobody:
    """In view."""

    def nearest(self, _: Any) -> float:
        return np.inf


def test_road_works_drown_what_is_said_beside_them(works: dict[str, Any]) -> None:
    sim = works["works"]["sim"]
    one = sim.state.environment.agenda.going_on[0]
    beside, far = (one.middle + np.array(away) for away in ([10.0, 0.0, 1.5], [-120.0, -120.0, 1.5]))
    assert noise_at(sim.state, beside) > 77.0
    assert noise_at(sim.state, far) < 65.0
    assert noise_at(works["none"]["sim"].state, beside) < 72.0


# Power cuts, markets, accidents.


def test_when_the_power_is_cut_shops_close_and_bodies_are_seen_less_far() -> None:
    seen = {}
    for cut in (False, True):
        sim = simulation(start=23 * 3600, date="2026-01-15", weather="clear")
        if cut:
            sim.state.environment.start_event("power_cut", region=(0.0, 0.0, 30.0))
        people = sim.state.people
        people.room[:] = people.place[:] = -1
        people.position[:] = [[-38.0, -38.0 + k, 0.0] for k in range(len(people))]
        people.position[0, :2], people.position[1, :2], people.yaw[0] = (-10.0, -20.0), (12.0, -20.0), 0.0
        _, infos = sim.observe()
        shut = sorted(sim.state.environment.agenda.effects.shut)
        seen[cut] = [body.agent for body in infos["resident_0"]["in_view"]], shut
    assert seen[False] == (["resident_1"], [])
    assert seen[True] == ([], ["place_cafe", "place_shop"])


def test_in_a_power_cut_windows_and_lamps_of_its_district_are_dark(helsinki: World) -> None:
    night = SimConfig(seed=1, assistants=1, transit=False, start=19 * 3600, date="2026-01-15", image=64)
    sim = Simulation(helsinki, None, night)
    people = sim.state.people
    people.position[0, :2], people.yaw[0] = (-35.7, 121.2), -1.5
    bright = [sim.observe()[0]["assistant_0"]["rgb"].mean()]
    number = sim.state.environment.start_event("power_cut", region=(0.0, 0.0, 400.0))
    bright.append(sim.observe()[0]["assistant_0"]["rgb"].mean())
    sim.state.environment.end_event(number)
    bright.append(sim.observe()[0]["assistant_0"]["rgb"].mean())
    assert bright[1] < 0.93 * bright[0]
    assert bright[2] == bright[0]


def test_stalls_stand_at_a_market_and_cars_at_an_accident_and_touch_nobody(helsinki: World) -> None:
    sim = traffic(helsinki)
    sim.check_overlaps()
    market = sim.state.environment.start_event("market", region=(60.0, -120.0, 60.0))
    crash = sim.state.environment.start_event("accident", street=STREET)
    for _ in range(60):
        sim.step({})
    things = sim.state.things.bodies()
    of_event = (things.entity - FIRST_THING) // THINGS_EACH
    assert [int((of_event == number).sum()) for number in (market, crash)] == [8, 2]
    assert [sim.state.entity(int(entity))["kind"] for entity in things.entity[of_event == crash]] == ["car"] * 2
    sim.state.environment.end_event(market)
    sim.step({})
    assert len(sim.state.things) == 2
    assert sim.overlap_check is not None
    assert sim.overlap_check.count == 0


def test_a_concert_has_a_stage_and_a_demonstration_a_street_and_both_are_loud(helsinki: World) -> None:
    sim = traffic(helsinki)
    environment = sim.state.environment
    quiet = noise_at(sim.state, np.array([60.0, -110.0, 1.5]))
    concert = environment.start_event("concert", region=(60.0, -120.0, 60.0))
    assert noise_at(sim.state, np.array([60.0, -110.0, 1.5])) > max(quiet + 15.0, 90.0)
    march = environment.start_event("demonstration", street=STREET)
    shut = environment.agenda.effects.lanes
    assert shut is not None
    event = CityEvent(kind="demonstration", street=STREET, begin=0.0, end=1.0)
    assert np.array_equal(shut, sim.base.event_sites.lanes_of(event))
    assert shut.any()
    middle = environment.agenda.going_on[1].middle
    assert noise_at(sim.state, middle + np.array([0.0, 10.0, 1.5])) > 80.0
    sim.step({})
    things = sim.state.things.bodies()
    assert ((things.entity - FIRST_THING) // THINGS_EACH).tolist() == [concert]
    environment.end_event(march)
    assert environment.agenda.effects.lanes is None


def test_things_of_two_events_do_not_stand_in_each_other(helsinki: World) -> None:
    sim = traffic(helsinki)
    sim.check_overlaps()
    first, second = (sim.state.environment.start_event("concert", region=(60.0, -120.0, 60.0)) for _ in range(2))
    sim.step({})
    standing = ((sim.state.things.bodies().entity - FIRST_THING) // THINGS_EACH).tolist()
    assert standing == [first]
    # When the first one is over, there is room for the second one's stage.
    sim.state.environment.end_event(first)
    sim.step({})
    standing = ((sim.state.things.bodies().entity - FIRST_THING) // THINGS_EACH).tolist()
    assert standing == [second]
    assert sim.overlap_check is not None
    assert sim.overlap_check.count == 0


@pytest.mark.parametrize("kind", ["market", "concert"])
def test_nothing_of_a_market_or_concert_stands_in_a_street(helsinki: World, kind: str) -> None:
    sim = traffic(helsinki)
    sim.state.environment.start_event(kind, region=(0.0, 0.0, 140.0))
    sim.step({})
    things = sim.state.things.bodies()
    assert len(things)
    for x, y, yaw, half_length, half_width in zip(
        *things.position[:, :2].T, things.yaw, things.half_length, things.half_width, strict=True
    ):
        u, v = np.meshgrid(np.linspace(-half_length, half_length, 9), np.linspace(-half_width, half_width, 9))
        c, s = np.cos(yaw), np.sin(yaw)
        ground = helsinki.walkable.class_at(np.stack([x + c * u - s * v, y + s * u + c * v], axis=-1))
        assert not np.isin(ground, (ROADWAY, CROSSING)).any()
