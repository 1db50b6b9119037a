"""Recordings that stand for themselves: whoever has the folder alone can simulate the run again."""

from __future__ import annotations

from pathlib import Path

import pytest

import toy_city
from vico.agents.schedule import followers_of
from vico.assets.models.movable import movable_kinds, movable_prototype, movable_surfaces
from vico.community import read_community
from vico.errors import SchemaError
from vico.io.files import read_json, write_json
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.recording import Run, read_run
from vico.sim.recording.recorder import Recorder
from vico.viewer.run_film import FilmSettings, RepeatedRun, still
from vico.world.public import PublicMap

KIND = sorted(movable_kinds())[0]
PROTOTYPE = movable_prototype(KIND, "red")
STEPS, AWAY = 8, 90.0


def set_up(sim: Simulation) -> None:
    """Do everything that can be done before the first step."""
    shape, size = movable_surfaces(KIND, "red"), movable_kinds()[KIND].size
    sim.scenario.add_object("red one", PROTOTYPE, shape, (1.5, -13.0, 1.5 * toy_city.SLOPE), size=size, yaw=0.7)
    sim.scenario.hand_object("other one", PROTOTYPE, shape, "resident_2", size=size)
    sim.scenario.place_agent("assistant_0", (0.0, -5.0), yaw=-1.5)
    sim.scenario.give_cash("assistant_0", 12.5)


@pytest.fixture
def run(tmp_path: Path) -> Run:
    """Some seconds of the toy city, with a minute and a half in the middle in which nobody is asked for anything."""
    sim = Simulation(toy_city.world(), toy_city.community(), SimConfig(start=8 * 3600 - 20, observe=(), assistants=1))
    set_up(sim)
    agents = followers_of(toy_city.community(), PublicMap.from_world(sim.world))
    with Recorder(tmp_path / "made", sim, sources={}, wanted=STEPS) as recorder:
        observations, infos = sim.observe()
        recorder.begin(observations)
        for step in range(STEPS):
            if step == STEPS // 2:
                sim.act({})
                sim.advance(AWAY)
                observations, infos = sim.observe()
            actions = {name: agent.act(observations[name], infos[name]) for name, agent in agents.items()}
            result = sim.step(actions)
            observations, infos = result.observations, result.infos
            recorder.write(result, actions=actions)
    (tmp_path / "made").rename(tmp_path / "moved")
    return read_run(tmp_path / "moved")


def again(run: Run) -> RepeatedRun:
    world = toy_city.world()
    return RepeatedRun(run, world, read_community(run.source("community"), world))


def test_community_setup_and_pauses_are_in_the_folder(run: Run) -> None:
    assert run.source("community") == run.path / "community"
    repeated = again(run)
    calls = read_json(run.path / "setup.json")["calls"]
    assert [call["call"] for call in calls] == ["add_object", "hand_object", "place_agent", "give_cash"]
    assert repeated.sim.state_hash() == run.hashes[0]
    repeated.go_to(STEPS)  # which compares the hash of each step
    assert repeated.sim.state.second == run.times[-1] == run.times[0] + AWAY + STEPS
    truth = repeated.sim.ground_truth
    assert truth.object_holder("other one") == "resident_2"
    assert truth.money("assistant_0") == 12.5
    settings = FilmSettings(follow="resident_2", width=64, height=64, samples=1)
    assert still(again(run), settings, STEPS).std() > 0


def test_a_pause_is_no_part_of_a_film(run: Run) -> None:
    tenths = [len(seen) for seen in again(run).moments(STEPS, lambda state: state.second)]
    assert tenths == [10] * STEPS


@pytest.mark.parametrize(
    ("spoilt", "said"),
    [
        ({"version": 9}, r"setup.json: version: .*; record the run anew"),
        ({"calls": [{"call": "open_safe"}]}, r"setup.json: calls.0: .*'open_safe'"),
        ({"calls": [{"call": "give_cash", "name": "resident_0"}]}, r"calls.0.give_cash.amount: Field required"),
        ({"calls": [{"call": "hand_object", "name": "x", "prototype": "good/x/red", "agent": "resident_2",
                     "size": [1, 1, 1]}]}, r"setup.glb: has no shape 'good/x/red'"),
    ],
)  # fmt: skip
def test_a_setup_that_was_spoilt_is_refused(run: Run, spoilt: dict[str, object], said: str) -> None:
    write_json(run.path / "setup.json", read_json(run.path / "setup.json") | spoilt)
    with pytest.raises(SchemaError, match=said):
        again(run)


def test_a_run_in_which_nothing_was_set_up_has_no_such_file(tmp_path: Path) -> None:
    sim = Simulation(toy_city.world(), toy_city.community(), SimConfig(start=8 * 3600 - 20, observe=()))
    with Recorder(tmp_path / "run", sim, sources={"community": str(tmp_path / "people")}, wanted=1) as recorder:
        recorder.begin({})
        recorder.write(sim.step({}))
    assert not (tmp_path / "run" / "setup.json").exists()
    assert not (tmp_path / "run" / "community").exists()
    assert read_run(tmp_path / "run").source("community") == tmp_path / "people"
