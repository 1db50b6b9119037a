"""The training script: the loss falls, what was stopped goes on to the same weights, what comes out is a policy."""

from __future__ import annotations

import csv
import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

from command_line import vico
from shared_folders import Shared
from vico.agents.robot.chunk_policy import ChunkPolicy
from vico.io.arrays import read_npz
from vico.io.files import sha256_of

SCRIPT = Path(__file__).parents[2] / "scripts" / "train_chunk_policy.py"
NO_TORCH = importlib.util.find_spec("torch") is None
pytestmark = [
    pytest.mark.skipif(NO_TORCH, reason="needs pip install 'virtual-community[imitation]'"),
    pytest.mark.filterwarnings("ignore"),
]


@pytest.fixture(scope="session")
def demonstrations(shared: Shared) -> Path:
    def make(out: Path) -> None:
        code = vico(
            "dataset", "build", "--challenge", "pick_place", "--episodes", 2, "--first-seed", 7, "--size", 32,
            "--steps", 60, "--successes", "--test", 0, "--validation", 0.5, "--to", "lerobot", "--workers", 1,
            "--out", out / "demos",
        )  # fmt: skip
        assert code == 0

    return shared("pick_place_to_train", make) / "demos"


def train(dataset: Path, out: Path, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(SCRIPT), str(dataset), "--out", str(out), "--side", "32", *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)


def test_it_learns_goes_on_where_it_stopped_and_leaves_a_policy(demonstrations: Path, tmp_path: Path) -> None:
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    words = ("--steps", "9", "--every", "3")
    assert train(demonstrations, whole, *words).returncode == 0
    for step in (0, 3, 6):
        done = train(demonstrations, parts, *words, "--minutes", "0")
        assert done.returncode == 0, done.stderr
        assert (f"goes on from step {step}\n" in done.stdout) == (step > 0)
    assert sha256_of(whole / "policy.npz") == sha256_of(parts / "policy.npz")
    assert (whole / "policy.npz.sha256").read_text() == f"{sha256_of(whole / 'policy.npz')}  policy.npz\n"
    with (whole / "curve.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["step"]) for row in rows] == [3, 6, 9]
    losses = [float(row["validation_loss"]) for row in rows]
    assert losses[-1] < losses[0]
    assert ChunkPolicy.read(whole / "policy.npz").shape.side == 32


def test_a_small_policy_can_keep_its_weights_in_half_the_room(demonstrations: Path, tmp_path: Path) -> None:
    words = ("--steps", "2", "--every", "2", "--width", "16")
    for name, more in (("whole", ()), ("half", ("--half",))):
        assert train(demonstrations, tmp_path / name, *words, *more).returncode == 0
    whole, half = (tmp_path / name / "policy.npz" for name in ("whole", "half"))
    assert half.stat().st_size < 0.6 * whole.stat().st_size
    assert ChunkPolicy.read(half).shape == ChunkPolicy.read(whole).shape
    kinds = {str(value.dtype) for name, value in read_npz(half.read_bytes()).items() if name.startswith("weight/")}
    assert kinds == {"float16"}


def test_other_wishes_and_other_datasets_are_refused(demonstrations: Path, tmp_path: Path) -> None:
    words = ("--steps", "1", "--every", "1")
    assert train(demonstrations, tmp_path, *words).returncode == 0
    again = train(demonstrations, tmp_path, *words, "--seed", "1")
    assert (again.returncode, "was trained otherwise" in again.stderr) == (1, True)
    large = train(demonstrations, tmp_path / "large", "--side", "64")
    assert "pictures of 32 pixels; give --side 32 or less" in large.stderr
    narrow = train(demonstrations, tmp_path / "narrow", "--width", "12")
    assert "--width 12: give a multiple of 8" in narrow.stderr
    none = train(tmp_path, tmp_path / "none")
    assert "holds no dataset.json" in none.stderr
