"""Observations that are made when they are asked for tell of the moment they were taken at."""

import numpy as np

import toy_city
from vico.sim.config import SimConfig
from vico.sim.simulation import Simulation


def test_what_was_observed_stays_when_time_goes_on() -> None:
    made, late = (Simulation(toy_city.world(), toy_city.community(), SimConfig(observe=())) for _ in range(2))
    made.step({}), late.step({})
    spoken = {"resident_0": {"type": "communicate", "text": "Hello!", "range": 500.0}}
    before = made.step(spoken).observations
    known = {name: dict(before[name]) for name in before}
    observations = late.step(spoken).observations
    for _ in range(3):
        late.step({name: {"type": "move_forward", "distance": 1.0} for name in late.agents})
    assert list(observations) == list(known)
    for name in known:
        assert observations[name]["state"] == known[name]["state"]
        assert observations[name]["events"] == known[name]["events"]
        np.testing.assert_array_equal(observations[name]["pose"], known[name]["pose"])


def test_arrays_say_what_the_dicts_say() -> None:
    sim = Simulation(toy_city.world(), toy_city.community(), SimConfig(observe=(), assistants=1, robots=("go2",)))
    result = sim.step({"resident_0": {"type": "communicate", "text": "Hello!", "range": 500.0}})
    crowd = result.observations.crowd
    places = [place.id for place in sim.world.places]
    for name, i in crowd.index.items():
        told = result.observations[name]
        np.testing.assert_array_equal(crowd.pose[i], told["pose"])
        assert ("standing", "sitting", "lying")[crowd.posture[i]] == told["state"]["posture"]
        assert (places[crowd.place[i]] if crowd.place[i] >= 0 else "") == told["state"]["place"]
        assert crowd.heard[i] == bool(told["events"])
        assert crowd.time == told["state"]["time"]
    names = list(crowd.index)
    pairs = {(names[i], names[j]) for i, j in zip(crowd.viewer, crowd.seen, strict=True)}
    told_pairs = {
        (name, body.agent)
        for name, info in result.infos.items()
        for body in info.get("in_view", ())
        if body.agent in sim.state.people.names
    }
    assert pairs == told_pairs
