"""Observations that are made when they are asked for tell of the moment they were taken at."""

import numpy as np
import pytest

import toy_city
from vico.render.viewers import PictureSet
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation


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


def _two_seeing() -> tuple[Simulation, Simulation]:
    config = SimConfig(observe=("resident_0", "resident_1"), image=64)
    first, second = (Simulation(toy_city.world(), toy_city.community(), config) for _ in range(2))
    return first, second


def test_pictures_asked_for_later_are_those_of_their_moment() -> None:
    at_once, later = _two_seeing()
    walk = {name: {"type": "move_forward", "distance": 1.0} for name in at_once.agents}
    result, kept = at_once.step(walk), later.step(walk)
    known = {name: dict(result.observations[name]) for name in ("resident_0", "resident_1")}
    entities = {name: result.infos[name]["entities"] for name in known}
    for _ in range(2):
        at_once.step(walk), later.step(walk)
    assert at_once.state_hash() == later.state_hash()
    for name, observation in known.items():
        assert kept.infos[name]["entities"] == entities[name]
        for kind in ("rgb", "depth", "segmentation"):
            np.testing.assert_array_equal(kept.observations[name][kind], observation[kind])


def test_who_does_not_look_at_pictures_waits_for_none(monkeypatch: pytest.MonkeyPatch) -> None:
    sim, _ = _two_seeing()
    result = sim.step({})
    whole, about = result.observations["resident_0"], result.infos["resident_0"]

    def never(pictures: PictureSet, k: int) -> None:
        raise AssertionError(f"waited for picture {k}")

    monkeypatch.setattr(PictureSet, "wait_for", never)
    result = sim.step({})
    plain, told = result.observations.without_pictures["resident_0"], result.infos.without_pictures["resident_0"]
    assert set(whole) - set(plain) == {"rgb", "depth", "segmentation", "extrinsics", "intrinsics"}
    assert set(about) - set(told) == {"entities"}
    with pytest.raises(AssertionError, match="waited"):
        result.observations["resident_0"]
