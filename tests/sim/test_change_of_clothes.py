"""Who leaves home is dressed for the weather there is then, in the state and in pictures."""

from __future__ import annotations

import numpy as np
import pytest

import toy_city
from vico.assets.people.model import dress_for_weather
from vico.render.motion import moment_of, show_interpolated
from vico.sim.config import SimConfig
from vico.sim.environment.weather import Weather
from vico.sim.loop.simulation import Simulation
from vico.sim.pictures.people import DrawnPeople
from vico.sim.pictures.scene import SceneRenderer

_SNOW = Weather(temperature=-6.0, snow=1.0, clouds=1.0)


@pytest.fixture
def sim() -> Simulation:
    """Two residents at home on a day without snow, and an assistant in the street."""
    config = SimConfig(residents=2, assistants=1, start=6 * 3600, observe=(), image=32)
    return Simulation(toy_city.world(), toy_city.community(), config)


def _go_out(sim: Simulation) -> None:
    while sim.state.people.room[0] >= 0:
        sim.step({"resident_0": {"type": "exit"}})


def test_who_leaves_home_in_snow_has_a_coat_on_and_who_stays_has_not(sim: Simulation) -> None:
    people = sim.state.people
    start = people.clothes[0].copy()
    drawn = DrawnPeople(sim, detail="light", far=True)
    first = drawn.batch
    drawn.follow(sim.state)
    assert drawn.batch is first
    at_home = sim.snapshot()
    sim.state.environment.change_weather(_SNOW, over=0.0)
    sim.step({})
    assert people.clothes.tolist() == [start.tolist()] * 3
    _go_out(sim)
    assert people.clothes[0] == pytest.approx([-6.0, 0.0, 1.0])
    assert people.clothes[1:].tolist() == [start.tolist()] * 2
    drawn.follow(sim.state)
    look = drawn.looks[0]
    assert look.top == "coat"
    assert look == dress_for_weather(look, -6.0, 0.0, 1.0)
    assert drawn.looks[1] == sim.looks[1]
    assert len(drawn.batch.vertices) != len(first.vertices) or not np.array_equal(drawn.batch.colour, first.colour)
    # Back in time they have not changed.
    sim.restore(at_home)
    drawn.follow(sim.state)
    assert drawn.looks[0] == sim.looks[0]
    assert np.array_equal(drawn.batch.vertices, first.vertices)


def test_between_two_moments_the_others_move_on_when_somebody_has_changed(sim: Simulation) -> None:
    renderer = SceneRenderer(sim)
    state = sim.state
    before = moment_of(renderer.show(state), state.second)
    sim.state.environment.change_weather(_SNOW, over=0.0)
    _go_out(sim)
    state.people.position[2, 0] += 1.0
    after = moment_of(renderer.show(state), state.second)
    entity = int(state.people.entity[2])
    middle = []
    for share in (0.0, 0.5, 1.0):
        scene = show_interpolated(before, after, share)
        spans = scene.arrays.avatars.span
        span = next(s for s in spans if scene.arrays.mesh.entity[s["first_triangle"]] == entity)
        middle.append(float(scene.arrays.mesh.x[span["first_vertex"] : span["end_vertex"]].mean()))
    assert middle[1] - middle[0] == pytest.approx(0.5, abs=0.05)
    assert middle[2] - middle[0] == pytest.approx(1.0, abs=0.1)
