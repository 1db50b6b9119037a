"""`vico eval` from beginning to end, on a challenge that takes no time."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import toy_challenge
from command_line import kill_once, vico
from toy_challenge import toy_world
from vico.challenges import records
from vico.io.files import read_json


@pytest.fixture(autouse=True)
def _toy(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the toy stand for two of the challenges."""
    for name in ("commute", "assistant", "toy"):
        monkeypatch.setitem(records.CHALLENGES, name, "toy_challenge:TOY")


@pytest.fixture
def worlds(tmp_path: Path) -> list[Path]:
    return [toy_world(tmp_path / "worlds" / name) for name in ("east", "west")]


def words(worlds: list[Path], out: Path, *more: object, methods: tuple[str, ...] = ("bad", "good")) -> list[object]:
    asked = [word for method in methods for word in ("--method", method)]
    return ["eval", "commute", "--worlds", *worlds, *asked, "--seeds", 2, "--workers", 1, "--out", out, *more]


def table(out: Path) -> Any:
    content = read_json(out / "results.json")
    return [content[name] for name in ("rows", "differences", "averages", "episodes", "not_played", "worlds")]


def test_several_methods_are_judged_in_the_same_tasks(
    worlds: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, board = tmp_path / "out", tmp_path / "leaderboard.json"
    assert vico(*words(worlds, out, "--against", "good", "--leaderboard", board, "--date", "2026-11-30", "--json")) == 0
    printed = capsys.readouterr()
    told = json.loads(printed.out)
    assert told == read_json(out / "results.json")
    assert [(row["category"], row["method"], row["episodes"]) for row in told["rows"]] == [
        ("fetch", "bad", 4), ("fetch", "good", 4), ("find", "bad", 4), ("find", "good", 4),
    ]  # fmt: skip
    assert {(one["method"], one["reference"], one["pairs"]) for one in told["differences"]} == {("bad", "good", 4)}
    assert printed.err.count(" of 16: ") == 16
    assert "16 of 16: find, west, seed 1, good: SR" in printed.err
    assert len(read_json(board)["entries"]) == 4
    page = (out / "results.md").read_text()
    assert "Difference from `good` in the same tasks" in page
    assert "## All categories" in page
    assert len(list((out / "episodes").iterdir())) == 16
    assert len(list((out / "tasks").iterdir())) == 8  # the same for both methods


def test_what_was_not_played_is_in_the_table_and_the_exit_code(
    worlds: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VICO_LLM_BASE_URL", "http://127.0.0.1:9/v1")
    monkeypatch.setenv("VICO_LLM_MODEL", "small")
    out = tmp_path / "out"
    assert vico(*words(worlds[:1], out, methods=("good", "llm"))) == 1
    printed = capsys.readouterr()
    assert "not played: fetch, east, seed 0, llm: language model at http://127.0.0.1:9" in printed.err
    assert "Traceback" not in printed.err
    content = read_json(out / "results.json")
    assert [row["not_played"] for row in content["rows"]] == [0, 2, 0, 2]
    assert "## Not played" in (out / "results.md").read_text()
    # What was played is kept; the rest is tried again.
    assert vico(*words(worlds[:1], out, "--resume", methods=("good", "llm"))) == 1
    assert capsys.readouterr().err.count("; kept") == 4


def test_worlds_may_be_named_by_options_of_their_own(worlds: list[Path], tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert vico(*words(worlds[:1], out, "--worlds", str(worlds[1]))) == 0
    assert len(list((out / "episodes").iterdir())) == 16


def test_resume_adds_to_what_is_there(worlds: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    assert vico(*words(worlds, out, methods=("good",))) == 0
    assert vico(*words(worlds, out)) == 2
    assert "exists already" in capsys.readouterr().err
    assert vico(*words(worlds, out, "--resume")) == 0
    assert capsys.readouterr().err.count("; kept") == 8
    assert vico(*words(worlds, tmp_path / "whole")) == 0
    assert table(out) == table(tmp_path / "whole")
    assert not out.with_name("out.partial").exists()


def test_resume_takes_up_no_other_folder(
    worlds: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine").mkdir()
    letter = tmp_path / "mine" / "letter.txt"
    letter.write_text("dear")
    assert vico(*words(worlds, tmp_path / "mine", "--resume")) == 2
    assert "holds no evaluation" in capsys.readouterr().err
    assert letter.read_text() == "dear"


def test_ctrl_c_leaves_what_is_over_and_the_same_command_goes_on(
    worlds: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    played = toy_challenge.Toy.play

    def stopped(self: Any, job: Any, **how: Any) -> Any:
        if (job.method, job.world.name, job.seed) == ("good", "west", 0):
            raise KeyboardInterrupt
        return played(self, job, **how)

    monkeypatch.setattr(toy_challenge.Toy, "play", stopped)
    assert vico(*words(worlds, out)) == 130
    assert "what was finished is on disk" in capsys.readouterr().err
    monkeypatch.setattr(toy_challenge.Toy, "play", played)
    assert not out.exists()
    assert vico(*words(worlds, out)) == 0
    assert capsys.readouterr().err.count("; kept") == 9
    assert vico(*words(worlds, tmp_path / "whole")) == 0
    assert table(out) == table(tmp_path / "whole")


def test_runs_are_kept_where_that_is_asked_for(worlds: list[Path], tmp_path: Path) -> None:
    assert vico(*words(worlds, tmp_path / "out", "--record")) == 0
    assert len(list((tmp_path / "out" / "runs").iterdir())) == 16


def test_the_published_rows_stand_beside_ours(worlds: list[Path], tmp_path: Path) -> None:
    out = tmp_path / "out"
    toy = ["eval", "assistant", "--worlds", *worlds, "--category", "all", "--seeds", 1, "--workers", 1]
    assert vico(*toy, "--method", "good", "--compare", "--out", out) == 0
    content = read_json(out / "results.json")
    assert content["setting"] == {"assistants": 1, "advanced": False, "distance": True, "steps": 1500}


@pytest.mark.parametrize(
    ("more", "says"),
    [
        (("--method", "best"), "no method called 'best'"),
        (("--method", "good", "--against", "fair"), "none of the methods"),
        (("--method", "good", "--method", "good"), "given twice"),
        ((), "needs a --method; there are bad, fair, good, llm"),
        (("--method", "good", "--seeds", 0), "at least one"),
        (("--method", "good", "--workers", -1), "--workers -1"),
        (("--method", "good", "--hours", -1), "--hours -1"),
        (("--method", "good", "--worlds", "nowhere"), "nowhere: no such folder"),
        (("--method", "missing.py:Agent", "--in-process"), "no such file"),
    ],
)
def test_what_cannot_be_is_one_sentence_and_leaves_nothing(
    more: tuple[object, ...], says: str, worlds: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    start = ["eval", "commute", "--out", tmp_path / "out"]
    where = [] if "--worlds" in more else ["--worlds", worlds[0]]
    assert vico(*start, *where, *more) == 2
    printed = capsys.readouterr()
    assert says in printed.err
    assert printed.out == ""
    assert sorted(path.name for path in tmp_path.iterdir()) == ["worlds"]


def test_a_challenge_that_is_not_there_is_one_sentence(
    worlds: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(records.CHALLENGES, "influence", "vico.challenges.nothing_of_the_kind:X")
    assert vico("eval", "influence", "--worlds", worlds[0], "--method", "a+b", "--out", tmp_path / "out") == 2
    assert "this version does not have it" in capsys.readouterr().err


@pytest.mark.slow
def test_a_killed_evaluation_of_assistants_comes_to_the_same_table(helsinki_path: Path, tmp_path: Path) -> None:
    def real(out: Path) -> list[object]:
        steps = ["--seeds", 3, "--steps", 10, "--method", "random", "--workers", 2]
        return ["eval", "assistant", "--worlds", helsinki_path, *steps, "--out", out]

    out = tmp_path / "cut"
    episodes = out.with_name("cut.partial") / "episodes"
    kill_once(real(out), lambda: episodes.is_dir() and len(list(episodes.glob("*.json"))) == 1)
    assert not out.exists()
    # In processes of their own, which know nothing of the toy.
    for folder in (out, tmp_path / "whole"):
        command = [sys.executable, "-m", "vico.cli.main", *map(str, real(folder))]
        assert subprocess.run(command, capture_output=True, check=False).returncode == 0

    for name in ("results.json", "results.md"):
        assert (out / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


def test_what_influence_is_asked_for_is_its_setting(
    worlds: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(records.CHALLENGES, "influence", "toy_challenge:TOY")

    def setting(*more: object) -> Any:
        out = tmp_path / f"out{len(list(tmp_path.iterdir()))}"
        asked = ["--worlds", worlds[0], "--method", "good", "--seeds", 1, "--workers", 1, "--out", out]
        assert vico("eval", "influence", *asked, *more) == 0
        return read_json(out / "results.json")["setting"]

    assert setting() == {}
    assert setting("--start", "09:30", "--hours", 2, "--simulation", "schedule", "--members", "llm") == {
        "start": "09:30", "hours": 2.0, "simulation": "schedule", "members": "llm",
    }  # fmt: skip
    models = ("--target-model", "o1", "--dialogue-model", "gpt-4o", "--member-model", "small")
    assert setting(*models) == {"target_model": "o1", "dialogue_model": "gpt-4o", "member_model": "small"}
    assert setting("--hours", 0) == {}


def test_influence_refuses_what_it_cannot_do(
    worlds: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = ["eval", "influence", "--worlds", worlds[0], "--method", "ours+random", "--out", tmp_path / "out"]
    for more, says in (
        (("--hours", -1), "--hours -1; give hours above 0"),
        (("--simulation", "dream"), "dream"),
        (("--members", "people"), "people"),
    ):
        assert vico(*asked, *more) == 2
        assert says in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("spec", "told"),
    [
        ("missing.py:Greedy", "missing.py: no such file"),
        ("mine.py:Gredy", "mine.py has no 'Gredy'"),
        ("mine.py:Table", "Table has neither act(observation, info) nor predict(observation)"),
        ("broken.py:Greedy", "broken.py cannot be imported"),
        ("no_such_module:Greedy", "no_such_module cannot be imported"),
    ],
)
def test_an_agent_that_is_not_there_is_refused_before_the_first_episode(
    spec: str,
    told: str,
    worlds: list[Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("mine.py").write_text("class Greedy:\n    def act(self, observation, info): return {}\nclass Table: pass\n")
    Path("broken.py").write_text("class Greedy(:\n")
    assert vico(*words(worlds, tmp_path / "out", methods=("good", spec))) == 2
    assert told in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
