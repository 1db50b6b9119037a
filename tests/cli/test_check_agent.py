"""`vico check-agent`: without a world, in a process of its own, with the reason and exit code 1 where it fails."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from command_line import vico
from vico.io.cache import cache_folder
from vico.worldgen import pipeline

PLANTED = Path(__file__).parents[1] / "planted_agents.py"


@pytest.fixture
def built(helsinki_path: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[Path]:
    """Where small worlds were built; the one that is there already takes the place of each."""
    folders: list[Path] = []

    def copied(_: Path, *, out: Path, **__: object) -> None:
        folders.append(out)
        shutil.copytree(helsinki_path, out)

    monkeypatch.setattr(pipeline, "build_world", copied)
    # No world is kept; people's bodies are.
    (tmp_path / "cache").mkdir()
    (tmp_path / "cache" / "bodies").symlink_to(cache_folder() / "bodies")
    monkeypatch.setenv("VICO_CACHE", str(tmp_path / "cache"))
    return folders


def test_the_small_world_is_built_once(built: list[Path], capsys: pytest.CaptureFixture[str]) -> None:
    for _ in range(2):
        assert vico("check-agent", f"{PLANTED}:Honest", "--steps", 4, "--deadline", 60) == 0
    printed = capsys.readouterr()
    assert len(built) == 1
    assert printed.err.count("building a small world of helsinki, once, in ") == 1
    assert printed.out.count("keeps the contract") == 2


def test_a_cheater_exits_1_with_the_reason(built: list[Path], capsys: pytest.CaptureFixture[str]) -> None:
    assert vico("check-agent", f"{PLANTED}:Spy", "--steps", 4, "--deadline", 60, "--json") == 1
    told = json.loads(capsys.readouterr().out)
    assert not told["ok"]
    assert [(finding["promise"], finding["where"]) for finding in told["findings"]] == [("fair", "step 1")]
    assert vico("check-agent", f"{PLANTED}:Broken", "--steps", 4) == 1
    assert "made: assistant_0: " in capsys.readouterr().out


def test_what_is_no_world_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert vico("check-agent", f"{PLANTED}:Honest", "--world", tmp_path / "nowhere") == 2
    assert "no such folder" in capsys.readouterr().err
    assert vico("check-agent", f"{PLANTED}:Honest", "--steps", 1) == 2
