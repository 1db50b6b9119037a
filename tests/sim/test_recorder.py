"""A run's folder: what is in it, and that it can be read at any time."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

import toy_city
from vico.agents.schedule import followers_of
from vico.errors import MissingFileError, OutputExistsError, SchemaError
from vico.runner.gather import Gatherer
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.recording import read_run
from vico.sim.recording.recorder import Recorder
from vico.world.public import PublicMap

STEPS = 130


def record(out: Path, *, close: bool = True, observe: tuple[str, ...] = ("resident_2",)) -> Recorder:
    """Record the toy city's morning."""
    config = SimConfig(start=8 * 3600 - 20, observe=observe, image=64)
    sim = Simulation(toy_city.world(), toy_city.community(), config)
    agents = Gatherer(followers_of(toy_city.community(), PublicMap.from_world(sim.world)))
    observations, infos = sim.observe()
    recorder = Recorder(out, sim, sources={"world": "toy"}, wanted=STEPS)
    recorder.begin(observations)
    for _ in range(STEPS):
        gathered = agents.gather(observations, infos)
        result = sim.step(gathered.actions)
        observations, infos = result.observations, result.infos
        recorder.write(result, actions=gathered.actions)
    if close:
        recorder.close()
    return recorder


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A complete run."""
    out = tmp_path_factory.mktemp("runs") / "run"
    record(out)
    return out


def test_a_run_reads_back_with_every_state(path: Path) -> None:
    run = read_run(path)
    tracks = run.tracks()
    assert tracks.position.shape == (STEPS + 1, 3, 3)
    assert np.isfinite(tracks.position).all()
    assert run.steps.tolist() == list(range(STEPS + 1))
    assert run.complete


def test_the_metrics_count_arrivals_and_name_the_last_state(path: Path) -> None:
    run = read_run(path)
    assert (run.metrics["steps"], run.metrics["arrivals"], run.metrics["late"]) == (STEPS, 3, 0)
    assert run.metrics["state_hash"] == run.hashes[-1] == run.manifest["state_hash"]


def test_the_film_has_a_frame_a_step(path: Path) -> None:
    run = read_run(path)
    assert list(run.views) == ["resident_2"]
    assert [step for step, _ in run.views["resident_2"].frames()] == list(range(STEPS + 1))


def test_events_are_told_in_order(path: Path) -> None:
    events = read_run(path).events
    assert {"exit", "enter", "arrival"} <= {event["kind"] for event in events}
    assert [e["step"] for e in events] == sorted(e["step"] for e in events)


def test_a_killed_run_shows_its_whole_minutes(tmp_path: Path) -> None:
    # What is on disk after the last step, before anything is closed, is what a kill leaves.
    recorder = record(tmp_path / "run", close=False, observe=())
    run = read_run(tmp_path / "run")
    recorder.close()
    assert not run.complete
    assert run.steps[-1] == 120


def test_a_run_of_another_version_is_refused(path: Path, tmp_path: Path) -> None:
    shutil.copytree(path, tmp_path / "run")
    manifest = json.loads((tmp_path / "run" / "run.json").read_text())
    (tmp_path / "run" / "run.json").write_text(json.dumps(manifest | {"version": 99}))
    with pytest.raises(SchemaError, match="version 99"):
        read_run(tmp_path / "run")
    with pytest.raises(MissingFileError):
        read_run(tmp_path)


def test_a_folder_that_holds_something_is_not_written_into(path: Path) -> None:
    sim = Simulation(toy_city.world(), toy_city.community(), SimConfig(observe=()))
    with pytest.raises(OutputExistsError):
        Recorder(path, sim, sources={}, wanted=1)
