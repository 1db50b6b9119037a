"""Ctrl+C and a request to end: a run keeps its state, says how it goes on, and comes to the same end."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

from command_line import interrupted, vico
from vico.io.files import read_json

STEPS = 500


def has_steps(out: Path) -> bool:
    """Whether a run has recorded its first minute."""
    return (out / "run.json").is_file() and read_json(out / "run.json")["steps"] >= 60


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_run_that_is_interrupted_keeps_its_state_and_says_how_it_goes_on(
    number: signal.Signals, helsinki_path: Path, helsinki_people: Path, tmp_path: Path
) -> None:
    out = tmp_path / "run"
    words: list[object] = ["run", helsinki_path, helsinki_people, "--observe", "none", "--robots", "none"]
    words += ["--cars", 0, "--pedestrians", 0, "--steps", STEPS]
    code, said = interrupted([*words, "--out", out], lambda: has_steps(out), number)
    assert code == 128 + number
    assert f"go on with: vico run --resume {out}" in said
    manifest = read_json(out / "run.json")
    assert manifest["status"] == "stopped"
    made = manifest["steps"]
    assert (out / "checkpoints" / f"{made:08d}").is_dir()
    # It goes on as if nothing had been.
    assert vico("run", "--resume", out) == 0
    assert vico(*words, "--out", tmp_path / "whole") == 0
    hashes = [read_json(folder / "metrics.json")["state_hash"] for folder in (out, tmp_path / "whole")]
    assert hashes[0] == hashes[1]
