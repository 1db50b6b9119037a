"""Rates, times and their intervals."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from vico.challenges.results import EpisodeResult, interval, markdown_table, summary, write_results


def episode(success: list[bool], steps: int, *, seed: int = 0) -> EpisodeResult:
    return EpisodeResult(
        world="helsinki", seed=seed, category="delivery", method="heuristic", assistants=1, success=success,
        done_at=[10 if ok else None for ok in success], steps=steps, limit=1500, wall_seconds=2.5, state_hash="0",
    )  # fmt: skip


def test_the_interval_is_students() -> None:
    # By hand: mean 4, s = sqrt((9 + 1 + 1 + 9 + 0) / 4) = sqrt(5), t(0.975; 4) = 2.776 from the table,
    # 2.776 * sqrt(5) / sqrt(5) = 2.776.
    mean, low, high = interval([1.0, 3.0, 5.0, 7.0, 4.0])
    assert mean == pytest.approx(4.0)
    assert (low, high) == pytest.approx((4.0 - 2.776, 4.0 + 2.776), abs=5e-4)


def test_one_value_bounds_nothing() -> None:
    assert interval([3.0]) == (3.0, -math.inf, math.inf)
    told = summary([episode([True, False], 1500)])
    assert (told["SR"], told["SR_low"], told["SR_high"]) == (50.0, None, None)


def test_a_summary_is_over_episodes() -> None:
    told = summary([episode([True] * 6, 900), episode([True] * 3 + [False] * 3, 1500, seed=1)])
    assert (told["SR"], told["Ts"], told["episodes"], told["subtasks"], told["successes"]) == (75.0, 1200.0, 2, 12, 9)
    # t(0.975; 1) = 12.706: the interval is cut at what a rate and a time can be.
    assert (told["SR_low"], told["SR_high"], told["Ts_low"], told["Ts_high"]) == (0.0, 100.0, 0.0, 1500.0)
    assert told["wall_seconds"] == 5.0


def test_the_table_has_a_line_a_method() -> None:
    rows = [summary([episode([True] * 6, 900)]), summary([episode([True] * 6, 900), episode([True] * 6, 902)])]
    lines = markdown_table(rows).splitlines()
    assert len({line.count("|") for line in lines}) == 1
    assert "| 100.0 (one episode) | 900 (one episode) |" in lines[2]
    # s / sqrt(2) = 1, times 12.706.
    assert "| 901 (888 to 914) |" in lines[3]


def test_results_on_disk_hold_every_episode(tmp_path: Path) -> None:
    told = write_results(tmp_path, [episode([True, False], 1500), episode([True, True], 700, seed=1)])
    content = json.loads((tmp_path / "results.json").read_text())
    assert content["summary"] == told
    assert [e["seed"] for e in content["episodes"]] == [0, 1]
    assert (tmp_path / "results.md").read_text() == markdown_table([told])
