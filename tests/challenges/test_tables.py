"""Means, differences and their intervals, by hand; the pages and files made of them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from toy_challenge import TOY, toy_world
from vico.challenges.episodes import Outcome
from vico.challenges.evaluation import evaluate, jobs_for
from vico.challenges.records import EpisodeRecord, Job, Part
from vico.challenges.tables import results as published_module
from vico.challenges.tables.results import (
    Published,
    published_rows,
    read_results,
    results_page,
    setting_words,
    write_results,
)
from vico.challenges.tables.summary import Estimate, estimate, estimate_of_means, summarise
from vico.errors import SchemaError
from vico.runner.gather import Fault


def outcome(method: str, world: str, seed: int, done: int | None, *, category: str = "fetch") -> Outcome:
    """An episode in which `done` of two parts were done; None for one that was not played."""
    job = Job("toy", category, method, {"assistants": 1}, Path(world), seed)
    if done is None:
        return Outcome(job, None, "2 of 9 places | can be\nreached")
    parts = [Part(f"{i}", i < done, "" if i < done else "not seen") for i in range(2)]
    metrics = {"SR": 50.0 * done} | ({"Ts": 100.0 - 10.0 * done} if category == "fetch" else {})
    record = EpisodeRecord(
        "toy", category, method, {"assistants": 1}, world, seed, metrics, parts, 100, 100, 2.5, "0" * 64,
        tokens=3, cost=0.25,
    )  # fmt: skip
    return Outcome(job, record, world_digest=world * 64)


def test_an_interval_is_students_over_worlds() -> None:
    # Worlds' means 2, 6 and 4: s = 2, 2 / sqrt(3) = 1.1547, t(0.975; 2) = 4.3027 from the table: 4.968.
    found = estimate([1.0, 3.0, 5.0, 7.0, 4.0, 4.0], ["a", "a", "b", "b", "c", "c"])
    assert found.mean == pytest.approx(4.0)
    assert (found.low, found.high) == pytest.approx((4.0 - 4.968, 4.0 + 4.968), abs=1e-3)
    assert (found.count, found.clusters) == (6, 3)


def test_within_one_world_it_is_students_over_episodes() -> None:
    # Mean 4, s = sqrt((9 + 1 + 1 + 9 + 0) / 4) = sqrt(5), t(0.975; 4) = 2.776: 2.776 * sqrt(5) / sqrt(5).
    found = estimate([1.0, 3.0, 5.0, 7.0, 4.0], ["a"] * 5)
    assert (found.low, found.high) == pytest.approx((4.0 - 2.776, 4.0 + 2.776), abs=5e-4)


def test_unequal_worlds_count_by_their_episodes() -> None:
    # x = 0, 0, 3; m = 1. Sums of (x - m) / 3: -2/3 and 2/3. Variance 2 / 1 * (8 / 9), its root 4 / 3; t(1) = 12.706.
    found = estimate([0.0, 0.0, 3.0], ["a", "a", "b"])
    assert found.mean == pytest.approx(1.0)
    assert found.high == pytest.approx(1.0 + 12.706 * 4 / 3, abs=1e-2)


def test_one_value_has_no_interval() -> None:
    assert estimate([3.0], ["a"]) == Estimate(3.0, None, None, 1, 1)
    assert not estimate([3.0], ["a"]).differs


def test_categories_count_the_same_whatever_their_number_of_episodes() -> None:
    # Means 2 and 5; world a: (1-2)/4 + (1-2)/4... by hand: a: -1/4 + 0; b: +1/4 + 0; variance 2 * 2/16 = 1/4.
    found = estimate_of_means([[1.0, 3.0], [5.0, 5.0]], [["a", "b"], ["a", "b"]])
    assert found.mean == pytest.approx(3.5)
    assert found.high == pytest.approx(3.5 + 12.706 * 0.5, abs=1e-2)


def test_differences_are_taken_within_the_same_tasks() -> None:
    outcomes = [
        outcome("good", "a", 0, 2), outcome("bad", "a", 0, 1), outcome("good", "a", 1, 1), outcome("bad", "a", 1, 0),
        outcome("good", "b", 0, 2), outcome("bad", "b", 0, 1), outcome("good", "b", 1, None), outcome("bad", "b", 1, 0),
    ]  # fmt: skip
    summary = summarise(TOY, outcomes, reference="bad")
    good, bad = summary.rows
    assert (good.episodes, good.not_played, good.parts, good.done, good.causes) == (3, 1, 6, 5, {"not seen": 1})
    assert (bad.metrics["SR"].mean, bad.causes) == (25.0, {"not seen": 6})
    (difference,) = summary.differences
    assert (difference.method, difference.reference, difference.pairs) == ("good", "bad", 3)
    # Each pair differs by one part of two: no doubt is left, though the means' intervals are wide.
    assert difference.metrics["SR"] == Estimate(50.0, 50.0, 50.0, 3, 2)
    assert difference.metrics["Ts"].mean == pytest.approx(-10.0)
    assert difference.metrics["SR"].differs
    assert good.metrics["SR"].high == 100.0  # cut at what a rate can be
    assert summary.averages == []


def test_the_average_is_over_categories_and_paired_too() -> None:
    outcomes = [
        outcome(method, world, 0, done, category=category)
        for category, shift in (("fetch", 0), ("find", 1))
        for world in ("a", "b")
        for method, done in (("bad", 0), ("good", 1 + shift))
    ]
    summary = summarise(TOY, outcomes)
    bad, good = summary.averages
    assert (summary.reference, bad.mean.mean, bad.difference) == ("bad", 0.0, None)
    assert good.mean.mean == pytest.approx(75.0)
    assert good.difference is not None
    assert good.difference.mean == pytest.approx(75.0)


def published(**other: Any) -> Published:
    how: dict[str, Any] = {
        "source": "paper", "about": "A paper", "challenge": "toy", "setting": {}, "method": "Theirs",
        "values": {"fetch": {"SR": 12.34}}, "average": None,
    }  # fmt: skip
    return Published(**how | other)


def test_the_page_has_every_table_and_marks_what_was_not_played() -> None:
    outcomes = [outcome(m, w, 0, d) for w in ("a", "b") for m, d in (("bad", 0), ("good", 2))]
    outcomes.append(outcome("good", "b", 1, None))
    assert outcomes[0].record is not None
    outcomes[0].record.faults.append(Fault(3, "assistant_0", "crashed", "no\nplan"))
    outcomes[0].record.fault_counts["crashed"] = 7
    page = results_page(TOY, summarise(TOY, outcomes), outcomes, published=[published()])
    lines = page.splitlines()
    assert lines[0] == "# toy: assistants 1"
    assert "| paper: Theirs | 12.3 | - | - | - | - | - | - | - |" in lines
    assert "| bad | 0.0 (0.0 to 0.0) | 100 (100 to 100) | 2 | 0 | 0 of 4 | 6 | 0.50 | 7 crashed |" in lines
    assert "| good | 100.0 (100.0 to 100.0) | 80 (80 to 80) | 2 | 1 | 4 of 4 | 6 | 0.50 | 0 |" in lines
    assert "| good | **+100.0 (+100.0 to +100.0)** | **-20 (-20 to -20)** | 2 |" in lines
    assert "| bad | 4 | 4 |" in lines
    assert "- SR: episodes that were done (more is better)" in lines
    assert "- Ts: steps until they were (less is better)" in lines
    assert "- fetch, a, seed 0, bad: assistant_0 crashed at step 3 (no plan); 7 times in the episode" in lines
    assert "- fetch, b, seed 1, good: 2 of 9 places | can be reached" in lines
    assert "as published: A paper" in page
    tables = [line.count("|") for line in lines if line.startswith(("| paper", "| bad | 0.0"))]
    assert len(set(tables)) == 1


def test_results_on_disk_come_back(tmp_path: Path) -> None:
    world = toy_world(tmp_path / "east")
    jobs = jobs_for(
        "toy_challenge:TOY", categories=("fetch",), methods=("good", "bad"), setting={"n": 1}, worlds=[world], seeds=3
    )
    outcomes = evaluate("toy_challenge:TOY", jobs, tmp_path / "out")
    write_results(tmp_path / "out", TOY, outcomes, reference="bad")
    content, episodes = read_results(tmp_path / "out" / "results.json")
    assert [record for _, record in episodes] == [outcome.record for outcome in outcomes]
    assert content["reference"] == "bad"
    assert content["worlds"] == {"east": outcomes[0].world_digest}
    assert str(tmp_path) not in (tmp_path / "out" / "results.json").read_text()
    assert (tmp_path / "out" / "results.md").read_text().startswith("# toy: n 1\n")
    path = tmp_path / "out" / "results.json"
    whole = path.read_text()
    assert "wall_seconds" not in whole
    path.with_name("timing.json").unlink()
    assert [record.wall_seconds for _, record in read_results(path)[1]] == [0.0] * len(outcomes)
    path.with_name("timing.json").write_text('{"schema_name": "vico.timing", "version": 1, "episodes": [{}]}')
    with pytest.raises(SchemaError, match="delete it"):
        read_results(path)
    path.with_name("timing.json").unlink()
    for damage in ('"SR": ', '"parts": ', '"worlds": '):
        path.write_text(whole.replace(damage, '"odd": ') if damage != '"SR": ' else whole.replace(damage, '"SR": "x'))
        with pytest.raises(SchemaError):
            read_results(path)
    path.write_text(json.dumps({**content, "version": 3}))
    with pytest.raises(SchemaError, match="not results of version 5"):
        read_results(path)


def test_the_papers_rows_are_those_of_the_setting() -> None:
    one = published_rows("assistant", {"assistants": 1, "advanced": False, "distance": True, "steps": 1500})
    assert [row.method for row in one] == ["Random", "Heuristic", "MCTS Planner", "LLM Planner"]
    assert one[1].of("carry") == {"SR": 34.7, "HR": 16.5}
    assert one[1].label == "paper: Heuristic"
    assert published_rows("assistant", {"assistants": 1, "advanced": False, "distance": True, "steps": 60}) == []
    two = published_rows("assistant", {"assistants": 2, "advanced": True, "distance": True, "steps": 1500})
    assert [(row.method, row.average) for row in two] == [("HP + HP", 9.26), ("LLM + LLM", 16.7), ("HP + LLM", 18.5)]
    assert [row.of("commute")["late_rate"] for row in published_rows("commute", {})][:2] == [10.43, 20.24]
    assert len(published_rows("influence", {"variant": "shared"})) == 4


def test_averages_of_the_paper_are_those_of_its_categories() -> None:
    # Each is the mean of its rates rounded to a tenth; the paper's own roundings differ by a little more in places.
    for row in published_module._all_published():
        if row.average is not None:
            mean = sum(values["SR"] for values in row.values.values()) / len(row.values)
            assert row.average == pytest.approx(mean, abs=0.11), row


def test_a_row_of_ones_own_is_read_strictly(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "challenges"
    folder.mkdir()
    text = 'about = "Mine"\n[[rows]]\nchallenge = "toy"\nmethod = "M"\nvalues = { "*" = { SR = 1.5 } }\n'
    (folder / "published_mine.toml").write_text(text)
    monkeypatch.setenv("VICO_DATA", str(tmp_path))
    (row,) = published_rows("toy", {"assistants": 1})
    assert (row.label, row.of("fetch")) == ("mine: M", {"SR": 1.5})
    (folder / "published_mine.toml").write_text(text + "colour = 3\n")
    monkeypatch.setenv("VICO_DATA", str(tmp_path) + "/")  # another folder, as far as what is kept goes
    with pytest.raises(SchemaError, match="colour"):
        published_rows("toy", {})


def test_a_setting_in_words() -> None:
    assert setting_words({"assistants": 2, "advanced": False, "target_model": "o1"}) == (
        "assistants 2, advanced off, target model o1"
    )
