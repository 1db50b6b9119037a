"""Residents live their day: out of the door on time, along the way, into the next door, and they talk."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import toy_city
from vico.agents.schedule import followers_of, stays_of
from vico.runner.gather import Gatherer
from vico.sim.bodies.state_arrays import Posture
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.state.steps import Event
from vico.world.objects import Objects
from vico.world.public import PublicMap
from vico.world.world import World


def live(
    steps: int, *, observe: tuple[str, ...] | None = (), start: int = 8 * 3600 - 20
) -> tuple[Simulation, list[Event]]:
    """Let the toy city's residents follow their day."""
    sim = Simulation(toy_city.world(), toy_city.community(), SimConfig(start=start, observe=observe, image=64))
    agents = Gatherer(followers_of(toy_city.community(), PublicMap.from_world(sim.world)))
    observations, infos = sim.observe()
    events: list[Event] = []
    for _ in range(steps):
        gathered = agents.gather(observations, infos)
        assert gathered.agent_faults == {}
        result = sim.step(gathered.actions)
        observations, infos = result.observations, result.infos
        events += result.events
    return sim, events


@pytest.fixture(scope="module")
def morning() -> tuple[Simulation, list[Event]]:
    """Two minutes and a half around 08:00, nobody looking."""
    return live(150)


def test_everybody_arrives_on_time(morning: tuple[Simulation, list[Event]]) -> None:
    sim, events = morning
    arrivals = {event.agent: event.data["seconds_late"] for event in events if event.kind == "arrival"}
    assert sorted(arrivals) == ["resident_0", "resident_1", "resident_2"]
    assert max(arrivals.values()) <= 0
    assert sim.punctuality.late.sum() == 0


def test_nobody_leaves_before_the_schedule_says(morning: tuple[Simulation, list[Event]]) -> None:
    exits = [event.time for event in morning[1] if event.kind == "exit"]
    assert len(exits) == 2
    assert min(exits) >= 8 * 3600


def test_no_action_of_theirs_is_refused(morning: tuple[Simulation, list[Event]]) -> None:
    assert [event.text for event in morning[1] if event.kind == "refused"] == []


def test_friends_greet_by_name_when_they_see_each_other() -> None:
    _, events = live(30, observe=None, start=8 * 3600 - 5)
    said = [(event.agent, event.text) for event in events if event.kind == "message"]
    assert any(
        ("Bo" in text and agent == "resident_0") or ("Ada" in text and agent == "resident_1") for agent, text in said
    )


def test_a_person_in_the_way_is_walked_around() -> None:
    config = SimConfig(start=8 * 3600 - 5, assistants=1, observe=())
    sim = Simulation(toy_city.world(), toy_city.community(), config)
    # Right on the straight line from the café's door to the shop's.
    sim.scenario.place_agent("assistant_0", (0.0, 3.9))
    agents = Gatherer(followers_of(toy_city.community(), PublicMap.from_world(sim.world)))
    observations, infos = sim.observe()
    for _ in range(120):
        result = sim.step(agents.gather(observations, infos).actions)
        observations, infos = result.observations, result.infos
    places: list[Any] = [observations[name]["state"]["place"] for name in ("resident_0", "resident_1")]
    assert places == [toy_city.SHOP, toy_city.SHOP]
    assert np.allclose(sim.state.people.position[3, :2], [0.0, 3.9], atol=0.3)


def test_each_stay_knows_when_to_set_out() -> None:
    schedule = toy_city.community().residents[0].schedule
    stays = stays_of(schedule, {toy_city.CAFE: 1, toy_city.SHOP: 1})
    assert [(stay.leave, stay.due, stay.place) for stay in stays] == [
        (0.0, 0.0, toy_city.CAFE),
        (28800.0, 28920.0, toy_city.SHOP),
    ]


def test_words_do_not_decide_what_a_resident_does() -> None:
    def actions(activity: str) -> list[str]:
        people = toy_city.community().residents[:1]
        item = people[0].schedule[0].model_copy(update={"activity": activity, "tag": "work", "type": "main"})
        resident = people[0].model_copy(update={"schedule": [item]})
        community = toy_city.community().model_copy(update={"residents": [resident], "relations": [], "groups": []})
        sim = Simulation(toy_city.world(), community, SimConfig(start=8 * 3600 - 300, observe=()))
        follower = followers_of(community, PublicMap.from_world(sim.world))["resident_0"]
        taken = []
        for _ in range(60):
            observations, infos = sim.observe()
            action = follower.act(observations["resident_0"], infos["resident_0"])
            taken.append(str(action["type"]))
            sim.step({"resident_0": action})
        return taken

    assert actions("Treat patients and run a coffee round") == actions("Sort papers")


def with_chairs(count: int) -> World:
    """The toy city with some chairs in the café's back room."""
    world = toy_city.world()
    chairs = [
        {
            "id": f"chair_{k}",
            "entity": 300_100 + k,
            "kind": "chair",
            "group": "indoor",
            "prototype": "chair",
            "x": -1.0 + 1.5 * k,
            "y": 10.5,
            "z": 0.0,
            "yaw": -np.pi / 2,
            "scale": 1.0,
            "size_x": 0.44,
            "size_y": 0.42,
            "size_z": 0.9,
            "solid": True,
            "room": "r_back",
        }
        for k in range(count)
    ]
    world.__dict__["objects"] = Objects.joined([world.objects, Objects.from_rows(chairs)])
    return world


def after_a_minute_at_work(chairs: int) -> Simulation:
    """Three who work in the café, on their feet at first."""
    day = [toy_city.item("main", "00:00:00", "23:59:59", toy_city.CAFE)]
    people = toy_city.community().model_copy(
        update={
            "residents": [toy_city.resident(k, name, day) for k, name in enumerate(("Ada Berg", "Bo Dahl", "Cleo Ek"))]
        }
    )
    sim = Simulation(with_chairs(chairs), people, SimConfig(start=9 * 3600, observe=()))
    agents = Gatherer(followers_of(people, PublicMap.from_world(sim.world)))
    observations, infos = sim.observe()
    for _ in range(60):
        result = sim.step(agents.gather(observations, infos).actions)
        observations, infos = result.observations, result.infos
    return sim


def test_who_stays_somewhere_sits_down_where_there_is_a_free_seat() -> None:
    assert (after_a_minute_at_work(3).state.people.posture == Posture.SITTING).all()


def test_those_without_a_seat_do_not_stand_chest_to_chest() -> None:
    people = after_a_minute_at_work(0).state.people
    assert (people.posture == Posture.STANDING).all()
    spots = people.position[:, :2]
    assert np.hypot(*(spots[:, None] - spots[None])[np.triu_indices(3, 1)].T).min() >= 0.8
