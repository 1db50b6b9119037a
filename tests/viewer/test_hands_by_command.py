"""What is done by hand to runs that the command line began: going back, branching, playing on."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Any

import pytest

from command_line import vico
from person_at_keys import Person, shown, stopped
from vico.community import read_names
from vico.io.files import read_json
from vico.sim.recording import read_run
from viewer_client import Stream, get_json, stream

FEW = ["--robots", "none", "--cars", 0, "--pedestrians", 0]


def make_steps(client: Stream, url: str, number: int) -> int:
    """Have some steps made, and wait for them."""
    goal = int(get_json(url, "/api/run")["control"]["step"]) + number
    assert client.command("step", steps=number)["ok"]
    end = time.monotonic() + 60.0
    while (told := get_json(url, "/api/run")["control"])["step"] < goal or told["status"] != "paused":
        assert time.monotonic() < end, told
        time.sleep(0.02)
    return int(told["step"])


def hashes(run: Path) -> list[str]:
    return [str(row["hash"]) for row in read_run(run).table("steps").to_pylist()]


def test_a_run_of_the_command_line_goes_back_and_branches(
    helsinki_path: Path, helsinki_people: Path, tmp_path: Path
) -> None:
    run = tmp_path / "run"
    words = ["--steps", 1000, "--observe", "none", "--states-every", 4, "--live", "--paused"]
    with shown("run", helsinki_path, helsinki_people, *FEW, *words, "--out", run) as page:
        with stream(page.url) as client:
            assert make_steps(client, page.url, 6) == 6
            assert client.command("snapshot", name="here")["step"] == 6
            make_steps(client, page.url, 3)

            back = client.command("back", step=5)
            assert (back["ok"], back["step"], Path(back["path"])) == (True, 4, tmp_path / "run.from-4")
            told: dict[str, Any] = client.until(lambda s: s.last("run"))
            assert (Path(told["path"]).name, told["last"]) == ("run.from-4", 4)
            assert make_steps(client, page.url, 5) == 9

            # What is done to the branch, and when, is its own.
            assert client.command("weather", kind="rain", over=0)["ok"]
            branch = client.command("branch", name="wet")
            assert (branch["step"], Path(branch["path"])) == (9, tmp_path / "run.from-4.wet")
            client.until(lambda s: (told := s.last("run")) and Path(told["path"]).name == "run.from-4.wet")
            head = get_json(page.url, "/api/run")
            assert head["run"]["branch_of"] == {"run": "run.from-4", "step": 9}
            assert [line["command"] for line in head["interventions"]] == ["weather"]
            make_steps(client, page.url, 2)

            # A name that is taken, and a step before all checkpoints, are refused; the run stands where it was.
            assert not client.command("back", step=2)["ok"]
            assert get_json(page.url, "/api/run")["control"]["step"] == 11
            stopped(client)
        page.ended(interrupt=True)
    first, dry, wet = (tmp_path / name for name in ("run", "run.from-4", "run.from-4.wet"))
    assert hashes(dry) == hashes(first)  # nothing was done to it: the same again
    assert hashes(wet)[:10] == hashes(first)
    assert len(hashes(wet)) == 12
    assert [mark["text"] for mark in read_json(first / "bookmarks.json")["bookmarks"]] == ["here"]
    assert read_json(wet / "run.json")["status"] == "stopped"


def test_who_was_played_by_hand_is_played_on_by_hand(
    helsinki_path: Path, helsinki_people: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = tmp_path / "run"
    words = [*FEW[2:], "--view", "none", "--out", run]
    play = ["play", helsinki_path, helsinki_people, "--as", read_names(helsinki_people)["resident_1"], *words]
    with shown(*play) as page:
        with stream(page.url) as client:
            person = Person(client)
            person.keep("forward", steps=5)
            assert client.command("snapshot")["ok"]
            kept = person.keep("turn_left", steps=2)["step"]
            stopped(client)
        page.ended(interrupt=True)
    assert read_json(run / "run.json")["played"] == "resident_1"

    assert vico("run", "--resume", run) == 2
    assert (
        "resident_1 was played by a person; go on with the command that began it: vico play" in capsys.readouterr().err
    )
    assert vico("play", helsinki_path, helsinki_people, "--as", "resident_2", *words) == 2
    assert "other settings" in capsys.readouterr().err

    with shown(*play) as page:
        with stream(page.url) as client:
            assert get_json(page.url, "/api/run")["you_play"] == "resident_1"
            step = Person(client).keep("forward", steps=kept)["step"]
            stopped(client)
        page.ended(interrupt=True)
    found = read_run(run)
    assert found.last >= step > kept
    assert len(hashes(run)) == found.last + 1
