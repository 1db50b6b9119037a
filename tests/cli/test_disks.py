"""Disks that fill and folders that others use: one sentence, exit 2, and nothing half-written where it belongs."""

from __future__ import annotations

import resource
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

_BUILD = ["world", "build", "--lat", "60.1690", "--lon", "24.9435", "--radius", "60", "--out"]


def started(*words: object, most: int | None = None) -> subprocess.Popen[str]:
    """A command in a process of its own; no file of it may grow beyond `most` bytes."""

    def limited() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # the write fails instead, as on a full disk
        if most is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))

    return subprocess.Popen(
        [sys.executable, "-m", "vico.cli.main", *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=limited,
    )


def sentence(process: subprocess.Popen[str]) -> str:
    """What a command that can't go on said: one line after its progress."""
    _, said = process.communicate(timeout=300)
    assert process.returncode == 2, said
    assert "Traceback" not in said
    return said.strip().splitlines()[-1]


def when_there(path: Path, process: subprocess.Popen[str]) -> None:
    """Wait until a command has made a file."""
    deadline = time.monotonic() + 240
    while not path.exists():
        assert process.poll() is None, process.communicate()[1]
        assert time.monotonic() < deadline
        time.sleep(0.02)


@pytest.mark.parametrize("most", [20_000, pytest.param(300_000, marks=pytest.mark.slow)])
def test_a_file_that_can_not_grow_ends_a_build_in_one_sentence(tmp_path: Path, most: int) -> None:
    said = sentence(started(*_BUILD, tmp_path / "w", most=most))
    assert said.startswith("vico: ")
    assert not (tmp_path / "w").exists()


@pytest.mark.slow
def test_a_folder_that_is_taken_away_ends_a_build_in_one_sentence(tmp_path: Path) -> None:
    process = started(*_BUILD, tmp_path / "w")
    when_there(tmp_path / "w.partial" / "terrain.npz", process)
    shutil.move(tmp_path / "w.partial", tmp_path / "elsewhere")
    assert sentence(process).startswith("vico: ")
    assert not (tmp_path / "w").exists()


@pytest.mark.slow
def test_force_leaves_a_folder_alone_that_another_build_is_writing(tmp_path: Path) -> None:
    first = started(*_BUILD, tmp_path / "w")
    when_there(tmp_path / "w.partial" / "terrain.npz", first)
    said = sentence(started(*_BUILD, tmp_path / "w", "--force"))
    assert str(tmp_path / "w") in said
    assert first.communicate(timeout=300) is not None
    assert first.returncode == 0
    assert (tmp_path / "w" / "world.json").is_file()
