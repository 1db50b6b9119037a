"""Episodes of a challenge become demonstrations: played for the purpose, or recorded by an evaluation."""

from __future__ import annotations

import hashlib
import importlib.util
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from command_line import kill_once, vico
from shared_folders import Shared
from vico.datasets.folder import Dataset
from vico.datasets.inspection import findings_of

PLAY = ["--challenge", "search", "--steps", 12, "--subtasks", 1, "--test", 0, "--workers", 1]
CHECK = Path(__file__).parents[2] / "scripts" / "check_lerobot.py"
EXAMPLE = Path(__file__).parents[2] / "examples" / "16_behaviour_cloning.py"


def bytes_of(folder: Path) -> dict[str, str]:
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.fixture(scope="module")
def played(helsinki_path: Path, shared: Shared) -> Dataset:
    """Two short episodes, played for the dataset."""

    def make(out: Path) -> None:
        outputs = ["--outputs", "rgb,depth,segmentation", "--size", 64]
        words = ["dataset", "build", "--world", helsinki_path, "--episodes", 2, *PLAY, *outputs, "--to", "lerobot"]
        assert vico(*words, "--out", out / "demos") == 0

    return Dataset(shared("played_episodes", make) / "demos")


def test_an_episode_is_told_of_its_task_and_judged(played: Dataset) -> None:
    assert findings_of(played) == []
    rows = played.episodes()
    assert [row["seed"] for row in rows] == [0, 1]
    assert {row["category"] for row in rows} == {"search"}
    for row in rows:
        assert row["success"] in (True, False)
        assert len(row["persons"]) == 1
        assert " asks: find " in row["instructions"][0]
        assert len(row["instructions"]) == 1
    goal = np.array([frame["observation.environment_state"] for frame in played.frames(0)])
    names = played.about.features["observation.environment_state"]
    assert (goal[:, names.index("source.there")] == 1.0).all()
    assert (goal[:, names.index("destination.there")] == 0.0).all()
    assert played.about.made["setting"]["subtasks"] == 1


def test_recorded_evaluations_give_the_same_demonstrations(
    played: Dataset, helsinki_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["eval", "assistant", "--category", "search", "--method", "heuristic", "--worlds", helsinki_path]
    words += ["--seeds", 2, "--steps", 12, "--subtasks", 1, "--workers", 1, "--record", "--out", tmp_path / "results"]
    assert vico(*words) == 0
    runs = sorted((tmp_path / "results" / "runs").iterdir())
    words = [
        "dataset",
        "build",
        "--runs",
        *runs,
        "--to",
        "lerobot",
        "--size",
        64,
        "--test",
        0,
        "--out",
        tmp_path / "out",
    ]
    assert vico(*words) == 0
    capsys.readouterr()
    mine = Dataset(tmp_path / "out")
    told = ("seed", "category", "method", "success", "instructions", "persons", "run", "frames")
    assert [{k: row[k] for k in told} for row in mine.episodes()] == [
        {k: row[k] for k in told} for row in played.episodes()
    ]
    for one, other in zip(mine.frames(1), played.frames(1), strict=True):
        for name in ("observation.state", "observation.environment_state", "action", "action.status"):
            assert one[name] == other[name]
        # A film of a film: nearly the same picture.
        assert np.abs(one["pictures"]["rgb"].astype(float) - other["pictures"]["rgb"]).mean() < 12


def test_an_agent_that_only_fails_demonstrates_nothing(
    helsinki_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [
        "dataset",
        "build",
        "--world",
        helsinki_path,
        "--episodes",
        1,
        *PLAY,
        "--to",
        "parquet",
        "--outputs",
        "none",
    ]
    assert vico(*words, "--method", "no_such_module:Agent", "--out", tmp_path / "out") == 2
    assert "failed at every step" in capsys.readouterr().err


@pytest.mark.slow
def test_a_build_that_was_killed_comes_to_the_same_bytes(played: Dataset, helsinki_path: Path, tmp_path: Path) -> None:
    words: list[Any] = ["dataset", "build", "--world", helsinki_path, "--episodes", 2, *PLAY]
    words += ["--outputs", "rgb,depth,segmentation", "--size", 64, "--to", "lerobot", "--out", tmp_path / "demos"]
    parts = tmp_path / "demos.partial" / "parts"
    kill_once(words, lambda: bool(list(parts.glob("000000.*/part.json"))))
    assert not (tmp_path / "demos").exists()
    assert vico(*words) == 0
    assert bytes_of(tmp_path / "demos") == bytes_of(played.path)


@pytest.mark.skipif(
    importlib.util.find_spec("lerobot") is None or importlib.util.find_spec("torch") is None,
    reason="lerobot and torch are not installed: docs/datasets.md says how to check with them",
)
def test_lerobot_loads_it(played: Dataset) -> None:
    done = subprocess.run(
        [sys.executable, str(CHECK), str(played.path)], capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "frames read and equal" in done.stdout


def test_a_policy_is_trained_on_it_and_judged(played: Dataset, helsinki_path: Path, tmp_path: Path) -> None:
    words = [
        "--dataset",
        played.path,
        "--worlds",
        helsinki_path,
        "--out",
        tmp_path / "cloned",
        "--seeds",
        1,
        "--steps",
        4,
    ]
    done = subprocess.run(
        [sys.executable, str(EXAMPLE), *map(str, words), "--epochs", "3", "--failures"],
        capture_output=True,
        text=True,
        timeout=400,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "trained on 2 episodes: loss " in done.stdout
    assert done.stdout.count(" of 1 done") == 3
    assert (tmp_path / "cloned" / "weights.npz").is_file()


@pytest.mark.skipif(importlib.util.find_spec("rerun") is None, reason="rerun is not installed: the extra 'rerun'")
def test_a_run_opens_in_rerun(helsinki_run: tuple[Path, Any], tmp_path: Path) -> None:
    out = tmp_path / "run.rrd"
    assert vico("dataset", "export", helsinki_run[0], "--to", "rerun", "--out", out) == 0
    assert out.read_bytes()[:4] == b"RRF2"
    assert out.stat().st_size > 50_000


def test_without_rerun_it_says_what_to_type(
    helsinki_run: tuple[Path, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert vico("dataset", "export", helsinki_run[0], "--to", "rerun", "--out", tmp_path / "run.rrd") == 2
    assert "pip install 'virtual-community[rerun]'" in capsys.readouterr().err
    assert not (tmp_path / "run.rrd").exists()
