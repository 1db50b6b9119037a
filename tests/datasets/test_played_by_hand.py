"""An episode that somebody plays at the page becomes a demonstration, with nothing done in between."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from command_line import vico
from person_at_keys import Person, shown, stopped
from shared_folders import Shared
from vico.datasets.folder import Dataset
from vico.io.files import read_json
from vico.sim.recording import Run, read_run
from viewer_client import stream


@pytest.fixture(scope="module")
def results(helsinki_path: Path, shared: Shared) -> Path:
    """What `vico play --task` leaves of a delivery that somebody begins, asks about and gives up."""

    def make(out: Path) -> None:
        with shown("play", helsinki_path, "--task", "delivery", "--seed", 0, "--out", out / "results") as page:
            with stream(page.url) as client:
                person = Person(client)
                person.keep("forward", steps=8)
                person.keep("forward", "turn_left", steps=8)
                assert person.do(type="communicate", text="Where is it?")["ok"]
                person.keep("turn_right", steps=4)
                assert client.command("stop")["ok"]
            page.ended()
            assert page.process.returncode == 0

    return shared("played_by_hand", make) / "results"


def the_run(results: Path) -> Run:
    (folder,) = (results / "runs").iterdir()
    return read_run(folder)


@pytest.fixture(scope="module")
def played(results: Path, shared: Shared) -> Dataset:
    """A dataset of it, made by the command of the page."""

    def make(out: Path) -> None:
        words = ["--runs", *sorted((results / "runs").iterdir()), "--to", "lerobot", "--size", 64, "--test", 0]
        assert vico("dataset", "build", *words, "--out", out / "demos") == 0

    return Dataset(shared("played_by_hand_dataset", make) / "demos")


def test_it_says_what_was_asked_for_and_what_came_of_it(played: Dataset, results: Path) -> None:
    (row,) = played.episodes()
    task = read_json(next((results / "tasks").iterdir()))
    assert row["instructions"]
    assert row["instructions"][0] in [subtask["text"] for subtask in task["subtasks"]]
    assert (row["method"], row["category"], row["agent"]) == ("human", "delivery", "assistant_0")
    assert row["success"] is False  # given up
    assert played.about.fps == 10
    assert played.about.frames == the_run(results).last > 10


def test_it_holds_what_the_person_did_and_saw(played: Dataset, results: Path) -> None:
    run = the_run(results)
    film = dict(run.views["assistant_0"].frames())
    frames = list(played.frames(0))
    done: list[dict[str, Any]] = []
    for frame in frames:
        step = frame["step"]
        action = run.at(step + 1).agents["assistant_0"].action
        again = played.form.decode(frame["action"], (0, 0, 0, 0), text=frame["action.text"])
        asked = {name: value for name, value in action.items() if name != "turn" or abs(value) >= 0.5}
        assert again | asked == {name: pytest.approx(value, abs=1e-3) for name, value in again.items()}
        assert asked.keys() <= again.keys()
        done.append(again)
        side = min(film[step].shape[:2]) // 64
        small = film[step][: 64 * side, : 64 * side].reshape(64, side, 64, side, 3).mean(axis=(1, 3))
        assert np.abs(frame["pictures"]["rgb"].astype(float) - small).mean() < 6.0
    assert {"move_forward", "turn_right", "communicate", "wait"} <= {action["type"] for action in done}
    assert any(action.get("turn", 0.0) > 90.0 for action in done)
    assert "Where is it?" in [action.get("text") for action in done]
    assert np.abs(np.subtract(*(frames[k]["pictures"]["rgb"].astype(float) for k in (0, -1)))).mean() > 2.0


def test_it_is_found_to_be_whole(played: Dataset, capsys: pytest.CaptureFixture[str]) -> None:
    assert vico("dataset", "check", played.path) == 0
    assert "1 episodes" in capsys.readouterr().out


def test_of_several_assistants_those_are_taken_whose_pictures_there_are(
    helsinki_path: Path, helsinki_people: Path, tmp_path: Path
) -> None:
    run, out = tmp_path / "run", tmp_path / "played"
    few = ["--cars", 0, "--pedestrians", 0]
    with shown("play", helsinki_path, helsinki_people, "--as", "assistant_1", *few, "--out", run) as page:
        with stream(page.url) as client:
            Person(client).keep("forward", steps=5)
            stopped(client)
        page.ended(interrupt=True)
    build = ["dataset", "build", "--runs", run, "--to", "parquet", "--size", 64, "--test", 0]
    assert vico(*build, "--instruction", "Look around.", "--out", out) == 0
    (row,) = Dataset(out).episodes()
    assert (row["agent"], row["instructions"], row["success"]) == ("assistant_1", ["Look around."], None)
    assert Dataset(out).about.fps == 10
