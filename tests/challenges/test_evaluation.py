"""Many episodes: the same however they are shared out, gone on with after a kill, and none ends the others."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from toy_challenge import NAME as TOY
from toy_challenge import played, toy_world
from toy_challenge import toy_jobs as jobs
from vico.challenges.episodes import Outcome
from vico.challenges.evaluation import evaluate, jobs_for
from vico.challenges.records import EpisodeRecord
from vico.errors import InputError, OutputError


@pytest.fixture
def worlds(tmp_path: Path) -> list[Path]:
    return [toy_world(tmp_path / "worlds" / name) for name in ("east", "west")]


def records(outcomes: list[Outcome]) -> list[EpisodeRecord | None]:
    return [outcome.record for outcome in outcomes]


def test_workers_and_order_decide_nothing(worlds: list[Path], tmp_path: Path) -> None:
    asked = jobs(worlds)
    alone = evaluate(TOY, asked, tmp_path / "alone")
    shared = evaluate(TOY, asked[::-1], tmp_path / "shared", workers=2)
    assert all(record is not None for record in records(alone))
    assert records(shared)[::-1] == records(alone)
    names = [sorted(path.name for path in (tmp_path / run / "episodes").iterdir()) for run in ("alone", "shared")]
    assert names[0] == names[1]
    assert len(names[0]) == len(asked) == 16


def test_what_is_there_is_not_played_again(worlds: list[Path], tmp_path: Path) -> None:
    count = tmp_path / "count"
    asked = jobs(worlds, count_in=str(count))
    first = evaluate(TOY, asked[:5], tmp_path / "out")
    assert len(played(count)) == 5
    again = evaluate(TOY, asked, tmp_path / "out")
    assert len(played(count)) == len(set(played(count))) == len(asked)
    assert records(again)[:5] == records(first)
    assert [outcome.kept for outcome in again] == [True] * 5 + [False] * (len(asked) - 5)


def test_a_table_goes_on_from_one_file_of_its_episodes(worlds: list[Path], tmp_path: Path) -> None:
    script = Path(__file__).parents[2] / "benchmarks" / "kept_episodes.py"
    asked, file = jobs(worlds), tmp_path / "kept.jsonl"
    evaluate(TOY, asked[:5], tmp_path / "here" / "part")
    for words in (("pack", tmp_path / "here", file), ("unpack", file, tmp_path / "there")):
        subprocess.run([sys.executable, script, *map(str, words)], check=True)
    there = evaluate(TOY, asked, tmp_path / "there" / "part")
    assert [outcome.kept for outcome in there] == [True] * 5 + [False] * (len(asked) - 5)
    file.write_text(json.dumps({"path": "../episodes/x.json", "content": {}}) + "\n")
    done = subprocess.run(
        [sys.executable, script, "unpack", file, tmp_path / "there"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert "line 1" in done.stderr
    assert not (tmp_path / "episodes").exists()


def test_kept_episodes_say_which_policy_played_but_not_where_it_lay(tmp_path: Path) -> None:
    script = Path(__file__).parents[2] / "benchmarks" / "kept_episodes.py"
    episode = tmp_path / "out" / "part" / "episodes" / "one.json"
    episode.parent.mkdir(parents=True)
    setting = {"policy": "/home/somebody/runs/both", "policy_sha256": "ab12"}
    episode.write_text(json.dumps({"episode": {"setting": setting}}))
    words = [sys.executable, script, "pack", tmp_path / "out", tmp_path / "kept.jsonl"]
    subprocess.run([str(word) for word in words], check=True)
    row = json.loads((tmp_path / "kept.jsonl").read_text())
    assert row["content"]["episode"]["setting"] == {"policy": "both", "policy_sha256": "ab12"}


def test_a_changed_world_and_a_damaged_episode_are_played_again(worlds: list[Path], tmp_path: Path) -> None:
    asked = jobs(worlds)
    whole = evaluate(TOY, asked, tmp_path / "out")
    episodes = sorted((tmp_path / "out" / "episodes").iterdir())
    episodes[0].write_text("{" * 5000)
    episodes[1].write_text(episodes[1].read_text().replace('"success": false', '"success": "perhaps"'))
    episodes[2].write_text("[]")
    again = evaluate(TOY, asked, tmp_path / "out")
    assert sum(not outcome.kept for outcome in again) in (2, 3)  # one may have had no failed part
    assert records(again) == records(whole)
    manifest = worlds[0] / "world.json"
    manifest.write_text(manifest.read_text() + " ")
    third = evaluate(TOY, asked, tmp_path / "out")
    assert [outcome.kept for outcome in third] == [job.world == worlds[1] for job in asked]


def test_a_place_that_vanished_is_marked_and_ends_nothing(worlds: list[Path], tmp_path: Path) -> None:
    asked = jobs(worlds)
    whole = evaluate(TOY, asked, tmp_path / "whole")
    shutil.rmtree(worlds[0])
    for workers in (1, 2):
        outcomes = evaluate(TOY, asked, tmp_path / f"{workers}", workers=workers)
        for outcome, before in zip(outcomes, whole, strict=True):
            if outcome.job.world == worlds[0]:
                assert outcome.record is None
                assert f"{worlds[0]}: no such folder" in outcome.reason
            else:
                assert outcome.record == before.record


def test_a_world_without_enough_places_is_marked_with_the_reason(worlds: list[Path], tmp_path: Path) -> None:
    outcomes = evaluate(TOY, jobs(worlds, crowded=True), tmp_path / "out")
    assert [outcome.record is None for outcome in outcomes] == [outcome.job.seed == 1 for outcome in outcomes]
    assert {outcome.reason for outcome in outcomes if outcome.reason} == {
        f"{name}: 2 of 9 places can be reached; choose another world" for name in ("east", "west")
    }


def test_a_fault_of_the_challenge_is_marked_as_one(worlds: list[Path], tmp_path: Path) -> None:
    outcomes = evaluate(TOY, jobs(worlds, bug=True), tmp_path / "out")
    reasons = [outcome.reason for outcome in outcomes if outcome.record is None]
    assert len(reasons) == 8
    assert all("KeyError: 'no such shelf' at toy_challenge.py" in reason for reason in reasons)
    assert all("a fault of the challenge" in reason for reason in reasons)


def test_a_worker_that_is_killed_is_started_again(worlds: list[Path], tmp_path: Path) -> None:
    asked = jobs(worlds[:1], methods=("good",), seeds=3, killed=str(tmp_path / "flag"))
    outcomes = evaluate(TOY, asked, tmp_path / "out", workers=2)
    assert all(outcome.record is not None for outcome in outcomes)
    assert (tmp_path / "flag").exists()


def test_a_job_that_kills_its_worker_twice_is_marked(worlds: list[Path], tmp_path: Path) -> None:
    asked = jobs(worlds[:1], methods=("good",), seeds=3, killed=str(tmp_path / "flag"), always=True)
    outcomes = evaluate(TOY, asked, tmp_path / "out", workers=2)
    assert [outcome.record is None for outcome in outcomes] == [job.seed == 1 for job in asked]
    assert {outcome.reason for outcome in outcomes} == {
        "", "its process was ended by SIGKILL, twice; it may lack memory: try fewer --workers",
    }  # fmt: skip


@pytest.mark.parametrize("workers", [pytest.param(1, marks=pytest.mark.slow), 2])
def test_an_evaluation_that_is_killed_goes_on_to_the_same(workers: int, worlds: list[Path], tmp_path: Path) -> None:
    out, count = tmp_path / "out", tmp_path / "count"
    setting = {"slow": 0.2, "count_in": str(count)}
    program = (
        "import sys; from pathlib import Path; from test_evaluation import jobs, evaluate, TOY\n"
        f"if __name__ == '__main__':\n"
        f"    evaluate(TOY, jobs([Path(p) for p in {[str(w) for w in worlds]!r}], **{setting!r}), "
        f"Path({str(out)!r}), workers={workers})\n"
    )
    script = tmp_path / "script.py"
    script.write_text(program)
    here = Path(__file__).parent
    path = os.pathsep.join([str(here), str(here.parent), *sys.path])
    process = subprocess.Popen([sys.executable, str(script)], env={**os.environ, "PYTHONPATH": path})
    began = time.monotonic()
    while len(list((out / "episodes").glob("*.json"))) < 3:
        assert process.poll() is None
        assert time.monotonic() - began < 120
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    process.wait()
    time.sleep(1.0)  # its workers end with it
    before = len(played(count))
    assert before < 16
    outcomes = evaluate(TOY, jobs(worlds, **setting), out, workers=workers)
    assert sum(outcome.kept for outcome in outcomes) >= 3
    assert len(played(count)) == before + sum(not outcome.kept for outcome in outcomes)
    whole = evaluate(TOY, jobs(worlds, **setting), tmp_path / "whole")
    assert records(outcomes) == records(whole)


def test_ctrl_c_leaves_what_is_over(worlds: list[Path], tmp_path: Path) -> None:
    asked = jobs(worlds, slow=0.05)

    def stop(outcome: Outcome, done: int, of: int) -> None:
        if done == 4:
            raise KeyboardInterrupt

    for workers in (1, 2):
        out = tmp_path / f"{workers}"
        with pytest.raises(KeyboardInterrupt):
            evaluate(TOY, asked, out, workers=workers, finished=stop)
        assert len(list((out / "episodes").glob("*.json"))) >= 4
        assert sum(outcome.kept for outcome in evaluate(TOY, asked, out)) >= 4


def test_a_folder_that_cannot_be_written_ends_it(worlds: list[Path], tmp_path: Path) -> None:
    (tmp_path / "out").write_text("a file")
    for workers in (1, 2):
        with pytest.raises(OutputError, match="cannot be written"):
            evaluate(TOY, jobs(worlds), tmp_path / "out", workers=workers)


def test_each_episode_can_be_recorded(worlds: list[Path], tmp_path: Path) -> None:
    asked = jobs(worlds[:1], methods=("good",), seeds=1)
    evaluate(TOY, asked, tmp_path / "out")
    assert not (tmp_path / "out" / "runs").exists()
    # An episode without its run is played again; one with it is kept.
    assert not any(outcome.kept for outcome in evaluate(TOY, asked, tmp_path / "out", record=True))
    assert all(outcome.kept for outcome in evaluate(TOY, asked, tmp_path / "out", record=True))
    runs = sorted(path.name for path in (tmp_path / "out" / "runs").iterdir())
    assert runs == sorted(path.stem for path in (tmp_path / "out" / "episodes").iterdir())


@pytest.mark.parametrize("no_budget", [True, False])
def test_no_budget_and_a_dead_endpoint_mark_the_episode(
    no_budget: bool, worlds: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VICO_LLM_BASE_URL", "http://127.0.0.1:9/v1")
    monkeypatch.setenv("VICO_LLM_MODEL", "small")
    setting = {"no_budget": True} if no_budget else {}
    outcomes = evaluate(TOY, jobs(worlds, methods=("llm", "good"), **setting), tmp_path / "out")
    for outcome in outcomes:
        assert (outcome.record is None) == (outcome.job.method == "llm")
    reasons = {outcome.reason for outcome in outcomes if outcome.record is None}
    assert all(("budget" if no_budget else "127.0.0.1:9") in reason for reason in reasons), reasons


def test_what_cannot_be_asked_for_is_said_before_anything_is_played(worlds: list[Path], tmp_path: Path) -> None:
    def refused(**other: Any) -> str:
        how: dict[str, Any] = {
            "categories": ("fetch",), "methods": ("good",), "setting": {}, "worlds": worlds, "seeds": 1,
        }  # fmt: skip
        with pytest.raises(InputError) as refusal:
            jobs_for(other.pop("challenge", TOY), **how | other)
        return str(refusal.value)

    assert "no challenge called 'chess'; there are assistant, commute, influence" in refused(challenge="chess")
    assert "has no NOTHING" in refused(challenge="toy_challenge:NOTHING")
    assert "there is no module nowhere_at_all" in refused(challenge="nowhere_at_all:X")
    assert "has no name" in refused(challenge="toy_challenge:SKILL")
    assert "no method called 'best'; there are bad, fair, good, llm" in refused(methods=("good+best",))
    assert "no category called 'sing'" in refused(categories=("sing",))
    assert "given twice" in refused(methods=("good", "good"))
    assert "given twice" in refused(worlds=[worlds[0], worlds[0] / ".." / "east"])
    assert "at least one" in refused(seeds=0)
    twice = jobs(worlds[:1]) * 2
    with pytest.raises(InputError, match="given twice"):
        evaluate(TOY, twice, tmp_path / "out")
    with pytest.raises(InputError, match="at least one is needed"):
        evaluate(TOY, jobs(worlds), tmp_path / "out", workers=0)


def test_code_and_terms_of_an_agent_decide_its_episode(
    worlds: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = tmp_path / "mine.py"
    source.write_text("class Mine: ...")
    count = tmp_path / "count"
    asked = jobs(worlds[:1], methods=(f"{source}:Mine",), seeds=1, count_in=str(count))
    evaluate(TOY, asked, tmp_path / "out")
    evaluate(TOY, asked, tmp_path / "out")
    assert len(played(count)) == 2
    source.write_text("class Mine: better = True")
    evaluate(TOY, asked, tmp_path / "out")
    assert len(played(count)) == 4
    evaluate(TOY, [replace(job, terms=replace(job.terms, deadline=5.0)) for job in asked], tmp_path / "out")
    assert len(played(count)) == 6
