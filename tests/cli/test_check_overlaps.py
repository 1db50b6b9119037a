"""`vico run --check overlaps`: what it prints, and its exit code."""

from __future__ import annotations

import io
import json
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import pytest

from command_line import vico
from vico.sim.loop import checks
from vico.sim.loop.checks import Overlap


def _run(world: Path, people: Path, out: Path) -> tuple[int, dict[str, object], str]:
    said, warned = io.StringIO(), io.StringIO()
    with redirect_stdout(said), redirect_stderr(warned):
        code = vico(
            "run", world, people, "--steps", 3, "--robots", "none", "--cars", 3, "--pedestrians", 3,
            "--observe", "none", "--check", "overlaps", "--out", out, "--json",
        )  # fmt: skip
    return code, json.loads(said.getvalue()), warned.getvalue()


def test_a_run_tells_overlaps_rescues_and_who_is_stuck(
    helsinki_path: Path, helsinki_people: Path, tmp_path: Path
) -> None:
    code, metrics, _ = _run(helsinki_path, helsinki_people, tmp_path / "run")
    assert code == 0
    assert metrics["overlaps"] == {"sub_steps": 30, "count": 0, "pairs": 0, "deepest": 0.0, "first": []}
    assert metrics["rescued"] == {"count": 0, "who": []}
    assert metrics["stuck"] == {"count": 0, "who": []}
    assert json.loads((tmp_path / "run" / "metrics.json").read_text())["overlaps"] == metrics["overlaps"]


def test_overlaps_make_the_exit_code_1_and_a_sentence(
    helsinki_path: Path, helsinki_people: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    planted = [Overlap(1_000_000, 1_000_001, 0.25, (1.0, 2.0, 3.0), -1)]
    monkeypatch.setattr(checks, "overlaps_of", lambda state: planted)
    code, metrics, warned = _run(helsinki_path, helsinki_people, tmp_path / "run")
    assert code == 1
    assert metrics["overlaps"]["count"] == 30  # type: ignore[index]
    assert "1 pairs overlapped in 30 of 30 sub-steps" in warned
    assert "250 mm" in warned
