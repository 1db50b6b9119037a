"""What the viewers show of a run: its seconds, however often its agents act."""

from __future__ import annotations

import numpy as np
import pytest

import toy_city
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.recording import read_run
from vico.sim.recording.recorder import Recorder
from vico.viewer.replay import Recording, recording_of


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """Three seconds of two assistants, one of whom acts twice a second and the other, who sees, once."""
    out = tmp_path_factory.mktemp("runs") / "run"
    config = SimConfig(assistants=2, periods={"assistant_0": 0.5}, observe=("assistant_1",), image=64)
    sim = Simulation(toy_city.world(), None, config)
    with Recorder(out, sim, sources={}, wanted=6) as recorder:
        recorder.begin(sim.observe()[0])
        for _ in range(6):
            actions = {name: {"type": "move_forward", "distance": 0.5} for name in sim.due}
            recorder.write(sim.step(actions), actions=actions)
    return recording_of(read_run(out))


def test_seconds_are_shown_not_steps(recording: Recording) -> None:
    assert recording.steps == 3
    assert recording.view_steps.tolist() == [0, 2, 4, 6]
    assert np.isfinite(recording.tracks).all()


def test_pictures_belong_to_the_seconds_they_were_seen_at(recording: Recording) -> None:
    pictures = list(recording.pictures("assistant_1", [0, 1, 2, 3]))
    assert all(picture is not None and picture.shape == (64, 64, 3) for picture in pictures)
    assert [second for second, _ in recording.key_pictures("assistant_1")] == [0]
    steps = [step for step, _ in recording.views["assistant_1"].frames()]
    assert steps == [0, 2, 4, 6]
