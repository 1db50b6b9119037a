"""Teaming episodes are played, judged and recorded like any other, and come out the same again."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from vico.challenges.records import Job, load_challenge
from vico.challenges.teaming.evaluate import CAUSES
from vico.challenges.teaming.tasks import CATEGORIES
from vico.errors import InputError
from vico.sim.recording import read_run

SETTING = {"steps": 6, "period": 0.5}


class Broken:
    """Gives motors numbers that are none."""

    stateless = True

    def act(self, observation: dict[str, Any], info: dict[str, Any]) -> dict[str, Any]:
        return {"type": "control", "vector": [float("nan")] * 10}


def job(world: Path, category: str, method: str = "heuristic", **setting: float) -> Job:
    return Job("teaming", category, method, SETTING | setting, world, 3)


PLAY = """
import sys
from pathlib import Path
from vico.challenges.records import Job
from vico.challenges.records import load_challenge
for category in sys.argv[2:]:
    job = Job("teaming", category, "heuristic", {"steps": 6, "period": 0.5}, Path(sys.argv[1]), 3)
    print(load_challenge("teaming").play(job).state_hash)
"""


def test_episodes_are_the_same_in_a_fresh_process_and_can_be_looked_at(helsinki_path: Path, tmp_path: Path) -> None:
    challenge = load_challenge("teaming")
    hashes = []
    for category in CATEGORIES:
        record = challenge.play(job(helsinki_path, category), recording=tmp_path / category)
        hashes.append(record.state_hash)
        assert (record.metrics["SR"], record.metrics["Ts"], record.steps) == (0.0, 6.0, 6)
        assert record.parts[0].cause in CAUSES[category]
        assert record.fault_counts == {}
        assert "robot_0" in {agent["name"] for agent in read_run(tmp_path / category).agents}
    again = subprocess.run(
        [sys.executable, "-c", PLAY, str(helsinki_path), *CATEGORIES], capture_output=True, text=True, check=True
    )
    assert again.stdout.split() == hashes


def test_settings_and_categories_that_make_no_sense_are_refused(helsinki_path: Path) -> None:
    challenge = load_challenge("teaming")
    for odd, says in (({"period": 3.0}, "0.02 to 1"), ({"period": 0.333}, "multiple"), ({"speed": 3}, "no setting")):
        with pytest.raises(InputError, match=says):
            challenge.task(job(helsinki_path, "guide", **odd))
    with pytest.raises(InputError, match="no category called 'juggle'"):
        challenge.task(job(helsinki_path, "juggle"))


def test_robots_that_cannot_be_loaded_fail_at_each_step_and_the_episode_ends(helsinki_path: Path) -> None:
    record = load_challenge("teaming").play(job(helsinki_path, "guide", "no_such_module:Robot"))
    assert record.fault_counts["crashed"] == 12
    assert record.parts[0].cause == "not met"


def test_numbers_that_are_none_are_a_fault_and_the_robot_stands(helsinki_path: Path) -> None:
    record = load_challenge("teaming").play(job(helsinki_path, "accompany", f"{__file__}:Broken"))
    assert record.fault_counts == {"malformed": 12}
    assert record.parts[0].cause == "not met"
