"""A leaderboard is read strictly, ranks only what is comparable, and tells results that changed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from command_line import vico
from toy_challenge import TOY, toy_world
from vico.challenges import records
from vico.challenges.evaluation import evaluate, jobs_for
from vico.challenges.tables.leaderboard import Leaderboard, add_entries, boards, entries_of, read_leaderboard
from vico.challenges.tables.results import write_results
from vico.errors import InputError, SchemaError


@pytest.fixture(autouse=True)
def _toy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(records.CHALLENGES, "toy", "toy_challenge:TOY")


def results(folder: Path, *, methods: tuple[str, ...] = ("bad", "good"), seeds: int = 2) -> Path:
    worlds = [folder / "worlds" / name for name in ("east", "west")]
    for world in worlds:
        if not world.exists():
            toy_world(world)
    jobs = jobs_for(
        "toy", categories=("fetch", "find"), methods=methods, setting={"n": 1}, worlds=worlds, seeds=seeds
    )  # fmt: skip
    out = folder / f"out{seeds}"
    write_results(out, TOY, evaluate("toy", jobs, out))
    return out


def test_results_become_entries_and_the_best_is_first(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, file = results(tmp_path), tmp_path / "leaderboard.json"
    assert vico("leaderboard", "add", out, "--file", file, "--date", "2026-11-30") == 0
    assert "good, fetch:" in capsys.readouterr().out
    board = read_leaderboard(file)
    assert [[entry.method for entry in entries] for entries in boards(board)] == [["good", "bad"]] * 2
    entry = next(one for one in board.entries if (one.method, one.category) == ("good", "fetch"))
    assert (entry.date, entry.seeds, sorted(entry.worlds), entry.episodes) == (
        "2026-11-30",
        [0, 1],
        ["east", "west"],
        4,
    )
    assert entry.rank_by == "SR"
    before = file.read_bytes()
    assert vico("leaderboard", "add", out / "results.json", "--file", file, "--date", "2026-11-30") == 0
    assert file.read_bytes() == before  # the same again is the same
    capsys.readouterr()
    assert vico("leaderboard", "show", file) == 0
    assert "toy, fetch: n 1" in capsys.readouterr().out
    assert vico("leaderboard", "show", file, "--json") == 0
    assert json.loads(capsys.readouterr().out)["schema_name"] == "vico.leaderboard"


def test_other_tasks_are_another_board(tmp_path: Path) -> None:
    board = Leaderboard()
    for seeds in (2, 3):
        board = add_entries(board, entries_of(results(tmp_path, seeds=seeds) / "results.json", TOY))
    assert [len(entries) for entries in boards(board)] == [2, 2, 2, 2]


def test_the_same_method_that_comes_to_something_else_is_refused(tmp_path: Path) -> None:
    entries = entries_of(results(tmp_path) / "results.json", TOY)
    board = add_entries(Leaderboard(), entries)
    other = [entries[0].model_copy(update={"episodes_hash": "f" * 64})]
    with pytest.raises(InputError, match="stands there with other episodes"):
        add_entries(board, other)
    assert len(add_entries(board, other, replace=True).entries) == len(entries)


def change(content: dict[str, Any], **fields: Any) -> dict[str, Any]:
    return {**content, "entries": [{**content["entries"][0], **fields}]}


@pytest.mark.parametrize(
    ("fields", "says"),
    [
        ({"medals": 3}, "medals"),
        ({"episodes": "many"}, "episodes"),
        ({"episodes": 0}, "episodes"),
        ({"seeds": []}, "seeds"),
        ({"date": "yesterday"}, "date"),
        ({"episodes_hash": "12"}, "episodes_hash"),
        ({"rank_by": "fame"}, "rank_by"),
        ({"metrics": {"SR": {"mean": 9, "low": 10.0, "high": 11.0, "unit": "%", "better": "higher"}}}, "not between"),
        ({"metrics": {"SR": {"mean": 9, "low": None, "high": 11.0, "unit": "%", "better": "higher"}}}, "two ends"),
        ({"metrics": {"SR": {"mean": 9, "low": None, "high": None, "unit": "%", "better": "louder"}}}, "better"),
    ],
)
def test_a_leaderboard_edited_into_nonsense_is_refused(
    fields: dict[str, Any], says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "leaderboard.json"
    assert vico("leaderboard", "add", results(tmp_path, methods=("good",), seeds=1), "--file", file) == 0
    content = json.loads(file.read_text())
    file.write_text(json.dumps(change(content, **fields)))
    with pytest.raises(SchemaError, match=says):
        read_leaderboard(file)
    capsys.readouterr()
    assert vico("leaderboard", "show", file) == 2
    assert says in capsys.readouterr().err


def test_an_entry_stands_once(tmp_path: Path) -> None:
    file = tmp_path / "leaderboard.json"
    assert vico("leaderboard", "add", results(tmp_path, methods=("good",), seeds=1), "--file", file) == 0
    content = json.loads(file.read_text())
    file.write_text(json.dumps({**content, "entries": content["entries"] * 2}))
    with pytest.raises(SchemaError, match="twice on one board"):
        read_leaderboard(file)
    file.write_text("[1]")
    with pytest.raises(SchemaError, match="not a leaderboard"):
        read_leaderboard(file)


def test_what_is_no_date_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "leaderboard.json"
    assert (
        vico("leaderboard", "add", results(tmp_path, methods=("good",), seeds=1), "--file", file, "--date", "now") == 2
    )
    assert "'now' is not YYYY-MM-DD" in capsys.readouterr().err
    assert not file.exists()
