"""The pages that benchmarks make of tables: planted episodes in, markdown out."""

from __future__ import annotations

import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import command_line
from toy_challenge import TOY
from vico.challenges.episodes import Outcome
from vico.challenges.influence import INFLUENCE
from vico.challenges.influence.evaluate import CAUSES
from vico.challenges.records import EpisodeRecord, Job, Part
from vico.challenges.tables.results import write_results

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


def script(name: str, *words: object) -> subprocess.CompletedProcess[str]:
    return command_line.script(BENCHMARKS / name, *words)


def planted(
    challenge: str, category: str, method: str, world: str, *, metrics: dict[str, float], lost: str = ""
) -> Outcome:
    """Return the outcome of an episode of two things, of which one is lost if a cause is given."""
    job = Job(challenge, category, method, {"hours": 2.0} if challenge == "influence" else {"n": 1}, Path(world), 5)
    parts = [Part("one", True), Part("two", not lost, lost)]
    record = EpisodeRecord(
        challenge, category, method, job.setting, "Town", 5, metrics, parts, steps=10, limit=10,
        wall_seconds=1800.0, state_hash="aa",
    )  # fmt: skip
    return Outcome(job, record, world_digest=f"digest of {world}")


def write(folder: Path, challenge: Any, outcomes: list[Outcome], **how: Any) -> None:
    folder.mkdir(parents=True)
    write_results(folder, challenge, outcomes, **how)


def test_the_blocks_of_a_table_become_one_page(tmp_path: Path) -> None:
    outcomes = [
        planted("toy", "find", method, world, metrics={"SR": rate}, lost="" if rate == 100 else "not seen")
        for world in ("a", "b") for method, rate in (("bad", 50.0), ("good", 100.0))
    ]  # fmt: skip
    write(tmp_path / "out" / "one_assistant", TOY, outcomes)
    write(tmp_path / "out" / "two_assistants", TOY, outcomes[:2])
    page = tmp_path / "page.md"
    done = script("table_page.py", tmp_path / "out", "--title", "Toys", "--frozen", "0000ffabcd", "--page", page)
    assert done.returncode == 0, done.stderr
    lines = page.read_text().splitlines()
    assert lines[0] == "# Toys"
    assert any("3.0 hours of episodes on the clock" in line for line in lines)  # six episodes of half an hour
    assert any("`ours` is frozen at commit `0000ffabcd`" in line and line.endswith("digits, 255. What is comparable "
               "with the paper's rows, and what is not: [docs/challenges.md](../../docs/challenges.md#results).")
               for line in lines)  # fmt: skip
    assert lines.count("## toy: n 1") == 2
    assert lines.count("### find") == 2
    assert "| bad | 50.0 (50.0 to 50.0) | 2 | 0 | 2 of 4 | 0 | 0.00 | 0 |" in lines
    assert "| bad | 2 | 2 |" in lines  # failed, not seen


def test_the_influence_page_has_rates_causes_and_visits(tmp_path: Path) -> None:
    def day(method: str, world: str, win: float) -> Outcome:
        metrics = {"win": win, "conv": win / 2, "visits": 8.0, "talks": 6.0, "visits_not_found": 1.5}
        return planted("influence", "day", method, world, metrics=metrics, lost=CAUSES[0])

    outcomes = [
        day(method, world, win)
        for method, wins in (("ours+random", (80.0, 60.0)), ("ours+nearest", (50.0, 50.0)))
        for world, win in zip(("a", "b"), wins, strict=True)
    ]
    write(tmp_path / "out" / "pairings", INFLUENCE, outcomes)
    done = script("influence_page.py", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0] == "# Influence: all pairings, with bodies"
    assert "## Every pairing of the offline strategies" in lines
    assert any(line.startswith("| ours+random | 2 | 70.0 (") for line in lines)
    assert "| Pairing, Win / Conv | a 5 | b 5 |" in lines
    assert "| ours+random | 80 / 40 | 60 / 30 |" in lines
    assert f"| ours+nearest | 2 of 4 | 2 |{' 0 |' * (len(CAUSES) - 1)}" in lines
    assert any(line.startswith("| ours+random | 8.0 | 6.0 | ") and "1.5" in line for line in lines)
    assert (
        "4 episodes of two days, 2.0 hours on the clock of a shared machine, 0 faults of agents; "
        "0 episodes could not be played." in lines
    )


@pytest.mark.parametrize("name", ["table_page.py", "influence_page.py"])
def test_a_folder_without_results_is_one_sentence(name: str, tmp_path: Path) -> None:
    title = ["--title", "x"] if name == "table_page.py" else []
    done = script(name, tmp_path, *title)
    assert done.returncode == 2
    assert "no results; play" in done.stderr
    assert "Traceback" not in done.stderr


def test_results_of_another_challenge_are_refused(tmp_path: Path) -> None:
    outcome = planted("toy", "find", "bad", "a", metrics={"SR": 50.0})
    write(tmp_path / "out" / "pairings", TOY, [replace(outcome)])
    done = script("influence_page.py", tmp_path / "out")
    assert done.returncode == 2
    assert "results of another challenge" in done.stderr
