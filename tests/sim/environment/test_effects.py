"""What weather does in a running simulation, beside the same run without it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import toy_city
from vico.envs import EnvSpec
from vico.errors import InputError
from vico.sim.actions import apply_actions
from vico.sim.bodies.state_arrays import Vehicle
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation

FOG = {"weather": [{"at": "00:00", "kind": "fog", "visibility": 25.0}]}


def simulation(**options: Any) -> Simulation:
    return Simulation(toy_city.world(), toy_city.community(), SimConfig(seed=3, assistants=1, observe=(), **options))


def face_to_face(sim: Simulation, apart: float) -> None:
    """Put a resident on the square, and the assistant before it."""
    people = sim.state.people
    people.room[:] = people.place[:] = -1
    people.position[:] = [[-35.0, -35.0 + k, 0.0] for k in range(len(people))]
    people.position[0, :2] = -25.0, -20.0
    people.position[-1, :2] = -25.0 + apart, -20.0
    people.yaw[0] = 0.0


def in_view_of_the_first(sim: Simulation) -> list[str]:
    _, infos = sim.observe()
    return [body.agent for body in infos[sim.agents[0]]["in_view"]]


@pytest.mark.parametrize(("apart", "clear", "fog"), [(8.0, True, True), (12.0, True, False), (41.0, False, False)])
def test_in_fog_one_notices_whom_one_would_see_on_a_clear_day_only_near_by(
    apart: float, clear: bool, fog: bool
) -> None:
    for weather, noticed in (("clear", clear), (FOG, fog)):
        sim = simulation(weather=weather)
        face_to_face(sim, apart)
        assert ("assistant_0" in in_view_of_the_first(sim)) == noticed


def test_on_snow_a_step_gets_less_far_and_indoors_it_does_not() -> None:
    walked = {}
    for weather in ("clear", "snow"):
        sim = simulation(weather=weather, date="2026-01-15", start=12 * 3600)
        face_to_face(sim, 20.0)
        before = sim.state.people.position.copy()
        sim.step({name: {"type": "move_forward", "distance": 1.0} for name in sim.agents})
        walked[weather] = float(np.linalg.norm((sim.state.people.position[0] - before[0])[:2]))
    assert walked["clear"] == pytest.approx(1.0, abs=0.02)
    assert walked["snow"] == pytest.approx(0.88, abs=0.02)


def test_who_rides_a_bicycle_gets_less_far_on_ice_than_on_snow_and_than_on_dry_ground() -> None:
    ridden = {}
    for weather in ("clear", "snow", "freezing_rain"):
        sim = simulation(weather=weather, date="2026-01-15", start=12 * 3600)
        face_to_face(sim, 20.0)
        sim.state.people.vehicle[0] = Vehicle.BIKE
        apply_actions({sim.agents[0]: {"type": "move_forward", "distance": 3.0}}, {}, sim.state)
        ridden[weather] = float(sim.state.people.move_left[0])
    assert ridden == {
        "clear": pytest.approx(3.0), "snow": pytest.approx(2.25), "freezing_rain": pytest.approx(1.8)
    }  # fmt: skip


def test_weather_changes_no_step_indoors() -> None:
    reached = {}
    for weather in ("clear", "snow"):
        sim = simulation(weather=weather, date="2026-01-15", start=12 * 3600)
        people = sim.state.people
        inside = int(np.flatnonzero(people.room >= 0)[0])
        sim.step({sim.agents[inside]: {"type": "move_forward", "distance": 0.5}})
        reached[weather] = people.position[inside].tolist()
    assert reached["clear"] == reached["snow"]


def test_a_run_is_the_same_after_a_snapshot_in_the_rain() -> None:
    one, other = simulation(weather="changing"), simulation(weather="changing")
    one.state.environment.change_weather("rain", over=20.0)
    for _ in range(8):
        one.step({})
    other.restore(one.snapshot())
    for _ in range(70):
        a, b = one.step({}), other.step({})
    assert a.hash == b.hash
    assert a.infos["assistant_0"]["weather"] == b.infos["assistant_0"]["weather"]
    assert a.infos["assistant_0"]["weather"]["rain"] == 4.0
    assert simulation(weather="fair").step({}).hash != simulation(weather="rain").step({}).hash


def test_fog_hides_what_is_far_in_pictures_and_night_is_darker_than_day() -> None:
    brightness, contrast = {}, {}
    for name, weather, hour in (("day", "clear", 12), ("fog", FOG, 12), ("night", "clear", 0)):
        sim = Simulation(
            toy_city.world(), None, SimConfig(assistants=1, image=64, weather=weather, start=hour * 3600, seed=1)
        )
        sim.state.people.position[0] = 0.0, -35.0, 0.0
        sim.state.people.yaw[0] = np.pi / 2
        observation = sim.observe()[0]["assistant_0"]
        house = observation["rgb"][np.isfinite(observation["depth"]) & (observation["depth"] > 25.0)].astype(float)
        brightness[name], contrast[name] = float(observation["rgb"].mean()), float(house.std())
    assert contrast["fog"] < 0.6 * contrast["day"]
    assert brightness["night"] < 0.5 * brightness["day"]


def test_pictures_follow_the_state_and_not_what_was_seen_before() -> None:
    sim = Simulation(toy_city.world(), None, SimConfig(assistants=1, image=64, weather="clear", seed=1))

    def seen() -> Any:
        return sim.observe()[0]["assistant_0"]["rgb"].copy()

    before = seen()
    with sim.branch():
        sim.state.environment.change_weather("fog", over=0.0)
        assert not np.array_equal(seen(), before)
    np.testing.assert_array_equal(seen(), before)


def test_environments_have_a_date_and_weather_too() -> None:
    spec = EnvSpec(weather=FOG, date="2026-12-21", utc_offset=1.0)
    again = EnvSpec.from_json(spec.to_json())
    assert again == spec
    assert again.config.weather == FOG


@pytest.mark.parametrize(
    ("options", "words"),
    [({"date": "yesterday"}, "date"), ({"weather": "frogs"}, "frogs"), ({"utc_offset": float("nan")}, "utc_offset")],
)
def test_nonsense_is_refused(options: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        simulation(**options)
