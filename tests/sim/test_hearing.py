"""Who hears what is said: distance, corners, traffic, rain."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import toy_city
from vico.sim.bodies.arrays import BUS, CAR, Bodies
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.people.hearing import listeners_of_person, noise_at


def two_in_the_street(apart: float, *, weather: str = "clear") -> Simulation:
    """Two assistants on the open square, one south of the other."""
    sim = Simulation(toy_city.world(), None, SimConfig(assistants=2, observe=(), weather=weather))
    people = sim.state.people
    people.room[:] = people.place[:] = -1
    people.position[:, :2] = [[-20.0, -20.0], [-20.0, -20.0 - apart]]
    people.position[:, 2] = 0.0
    return sim


class PassingTraffic:
    """Vehicles that stand for traffic: no more than their bodies are asked for."""

    def __init__(self, kind: int, x: float, y: float, speed: float) -> None:
        one = np.ones(1)
        self._bodies = Bodies(
            np.array([99], np.int32), np.array([kind], np.int8), np.array([[x, y, 0.0]]), 0 * one, 2.2 * one, 0.9 * one,
            1.5 * one, np.array([[speed, 0.0]]),
        )  # fmt: skip

    def bodies(self) -> Bodies:
        return self._bodies


def heard(sim: Simulation, reach: float = 10.0) -> bool:
    return listeners_of_person(sim.state, 0, reach).hearers == ["assistant_1"]


@pytest.mark.parametrize("apart", [1.0, 5.0, 9.9])
def test_in_a_quiet_street_a_raised_voice_reaches_as_far_as_it_is_meant_to(apart: float) -> None:
    assert heard(two_in_the_street(apart))
    assert not heard(two_in_the_street(apart), reach=apart - 0.5)


def test_a_passing_car_covers_a_voice_from_afar_and_not_from_near() -> None:
    for apart, understood in ((9.0, False), (2.0, True)):
        sim = two_in_the_street(apart)
        sim.state.traffic = PassingTraffic(CAR, -20.0, -20.0 - apart - 20.0, 13.0)  # type: ignore[assignment]
        found = listeners_of_person(sim.state, 0, 10.0)
        assert (found.hearers == ["assistant_1"]) == understood
        assert found.missed == ({} if understood else {"assistant_1": "noise"})


def test_buses_are_louder_than_cars_and_standing_is_quieter_than_driving() -> None:
    place = np.array([-20.0, -20.0, 1.6])
    levels = []
    for kind, speed in ((CAR, 0.0), (CAR, 8.0), (BUS, 8.0)):
        sim = two_in_the_street(3.0)
        sim.state.traffic = PassingTraffic(kind, -20.0, -12.5, speed)  # type: ignore[assignment]
        levels.append(noise_at(sim.state, place))
    assert levels == sorted(levels)
    assert levels[2] - levels[1] == pytest.approx(6.0, abs=0.3)
    # Twice as far is 6 dB less of the vehicle itself.
    sim.state.traffic = PassingTraffic(BUS, -20.0, -5.0, 8.0)  # type: ignore[assignment]
    assert levels[2] - noise_at(sim.state, place) == pytest.approx(20 * math.log10(2), abs=0.5)


def test_in_a_downpour_one_has_to_come_nearer() -> None:
    assert heard(two_in_the_street(9.0))
    assert not heard(two_in_the_street(9.0, weather="downpour"))
    assert heard(two_in_the_street(2.5, weather="downpour"))


def test_a_corner_of_a_building_keeps_a_voice_off() -> None:
    sim = two_in_the_street(3.0)
    # On either side of the house's south-west corner.
    sim.state.people.position[:, :2] = [[-12.0, 9.0], [-5.0, 3.5]]
    found = listeners_of_person(sim.state, 0, 10.0)
    assert found.missed == {"assistant_1": "walls"}


def test_the_event_tells_who_missed_it(capsys: pytest.CaptureFixture[str]) -> None:
    sim = two_in_the_street(9.0, weather="downpour")
    said: dict[str, Any] = {"type": "communicate", "text": "Over here!"}
    result = sim.step({"assistant_0": said})
    event = next(event for event in result.events if event.kind == "message")
    assert (event.data["hearers"], event.data["missed"]) == ([], {"assistant_1": "noise"})
    assert result.observations["assistant_1"]["events"] == []


def test_robots_are_heard_by_people_near_and_by_each_other_wherever_they_are() -> None:
    places = {"robot_0": (-20.0, -22.0, 0.0), "robot_1": (20.0, 25.0, 0.0)}
    config = SimConfig(assistants=2, robots=("husky", "husky"), robot_places=places, observe=(), weather="clear")
    sim = Simulation(toy_city.world(), None, config)
    people = sim.state.people
    people.room[:] = people.place[:] = -1
    people.position[:, :2] = [[-20.0, -18.0], [20.0, 20.0]]
    result = sim.step({"robot_0": {"type": "communicate", "text": "Here is your parcel."}})
    told = {name: result.observations[name]["events"] for name in ("assistant_0", "assistant_1", "robot_1")}
    assert [message["text"] for message in told["assistant_0"]] == ["Here is your parcel."]
    assert told["assistant_0"][0]["speaker"] == "robot_0"
    assert told["assistant_1"] == []
    assert [message["text"] for message in told["robot_1"]] == ["Here is your parcel."]
