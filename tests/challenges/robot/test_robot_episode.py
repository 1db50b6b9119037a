"""Robot episodes are played, judged and recorded like any other, and come out the same again."""

from __future__ import annotations

from pathlib import Path

import pytest

from vico.challenges.records import Job, load_challenge
from vico.challenges.robot.evaluate import CAUSES
from vico.errors import InputError
from vico.sim.recording import read_run

SETTING = {"steps": 8, "period": 0.1}


def job(world: Path, category: str = "deliver", method: str = "heuristic", **setting: float) -> Job:
    return Job("robot", category, method, SETTING | setting, world, 3)


@pytest.mark.parametrize("category", ["deliver", "carry"])
def test_an_episode_is_the_same_again_and_can_be_looked_at(category: str, helsinki_path: Path, tmp_path: Path) -> None:
    challenge = load_challenge("robot")
    first = challenge.play(job(helsinki_path, category), recording=tmp_path / "run")
    again = challenge.play(job(helsinki_path, category))
    assert first.state_hash == again.state_hash
    assert first.metrics == again.metrics
    assert (first.metrics["SR"], first.metrics["Ts"], first.steps) == (0.0, 8.0, 8)
    assert first.parts[0].cause in CAUSES
    assert first.fault_counts == {}
    run = read_run(tmp_path / "run")
    assert {"robot_0", "robot_1"} <= {agent["name"] for agent in run.agents}


def test_settings_and_methods_that_make_no_sense_are_refused(helsinki_path: Path) -> None:
    challenge = load_challenge("robot")
    for odd, says in (({"period": 0.5}, "0.01 to 0.1"), ({"speed": 3}, "no setting 'speed'")):
        with pytest.raises(InputError, match=says):
            challenge.task(job(helsinki_path, **odd))
    with pytest.raises(InputError, match="no category called 'juggle'"):
        challenge.task(job(helsinki_path, "juggle"))


def test_robots_that_cannot_be_loaded_fail_at_each_step_and_the_episode_ends(helsinki_path: Path) -> None:
    record = load_challenge("robot").play(job(helsinki_path, method="telepathy"))
    assert record.fault_counts["crashed"] == 160
    assert record.parts[0].cause == "not found"
