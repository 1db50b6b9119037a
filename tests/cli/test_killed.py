"""What a kill leaves can be read, and the same command begins again without being asked twice."""

from __future__ import annotations

import json
import shlex
import shutil
from pathlib import Path
from typing import Any

import pytest

from command_line import kill_once, vico
from shared_folders import Shared
from vico.render.film import read_film
from vico.sim.recording import read_run
from vico.world.folder import read_world


@pytest.mark.slow
def test_a_killed_build_leaves_no_world_and_begins_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, partial = tmp_path / "w", tmp_path / "w.partial"
    words: list[object] = ["world", "build", "--lat", 60.1690, "--lon", 24.9435, "--radius", 60, "--out", out]
    kill_once(words, (partial / "objects.parquet").exists)
    assert not out.exists()
    # What was finished is there, and says of itself that it is no world.
    assert (partial / "roads.net.xml").stat().st_size > 0
    assert vico("world", "info", partial) == 2
    assert "no finished world" in capsys.readouterr().err
    assert vico(*words) == 0
    assert [path.name for path in tmp_path.iterdir()] == ["w"]
    assert read_world(out).buildings


@pytest.fixture(scope="module")
def killed(helsinki_path: Path, helsinki_people: Path, shared: Shared) -> tuple[Path, list[object]]:
    """A run killed in its second minute, and the command, without its end: ``--out FOLDER``."""
    words: list[object] = [
        "run", helsinki_path, helsinki_people, "--steps", 90, "--robots", "none", "--cars", 2, "--pedestrians", 2,
        "--observe", "resident_0", "--out",
    ]  # fmt: skip

    def make(out: Path) -> None:
        kill_once([*words, out / "run"], (out / "run" / "segments" / "00000000-00000060").exists)

    return shared("killed_run", make) / "run", words


@pytest.fixture
def remains(killed: tuple[Path, list[object]], tmp_path: Path) -> Path:
    """A copy of what the kill left."""
    shutil.copytree(killed[0], tmp_path / "run")
    return tmp_path / "run"


def test_a_killed_run_shows_its_first_minute(remains: Path) -> None:
    run = read_run(remains)
    assert not run.complete
    assert run.steps.tolist() == list(range(61))
    assert run.hashes[-1]


def test_a_killed_run_can_be_looked_at(remains: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert vico("replay", remains) == 0
    assert capsys.readouterr().out.strip() == str(remains / "replay.html")
    assert (remains / "replay.html").stat().st_size > 50_000
    assert next(read_film(remains / "demo.mp4")).shape == (720, 1280, 3)


def test_the_same_run_begins_again_and_goes_through(
    killed: tuple[Path, list[object]], remains: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = read_run(remains).hashes
    assert vico(*killed[1], remains) == 0
    assert "an unfinished run" in capsys.readouterr().err
    run = read_run(remains)
    assert run.complete
    assert len(run.steps) == 91
    assert run.hashes[:61] == before
    # Now that it is whole, it is not replaced without --force.
    assert vico(*killed[1], remains) == 2
    assert "exists already" in capsys.readouterr().err


def test_an_unfinished_run_with_other_settings_is_kept(
    killed: tuple[Path, list[object]], remains: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert vico(*killed[1], remains, "--seed", 5) == 2
    error = capsys.readouterr().err
    assert "other settings" in error
    assert error.count("\n") == 1
    assert len(read_run(remains).steps) == 61


def test_a_run_killed_before_its_manifest_begins_again(
    helsinki_path: Path, helsinki_people: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    out.mkdir()
    (out / ".run.json.a1b2c3d4.json").write_text("{")
    quiet = ("--robots", "none", "--cars", 0, "--pedestrians", 0, "--observe", "none")
    assert vico("run", helsinki_path, helsinki_people, "--steps", 2, *quiet, "--out", out) == 0
    assert read_run(out).complete
    assert not (out / ".run.json.a1b2c3d4.json").exists()


def test_a_run_that_goes_on_elsewhere_is_left_alone(
    helsinki_path: Path, helsinki_people: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "run"
    words: list[object] = [
        "run", helsinki_path, helsinki_people, "--steps", 100_000, "--robots", "none", "--observe", "none",
        "--cars", 0, "--pedestrians", 0, "--out", out,
    ]  # fmt: skip
    answers: list[tuple[int, str]] = []

    def asked() -> bool:
        if not (out / "run.json").exists():
            return False
        for force in ([], ["--force"]):
            answers.append((vico(*words, *force), capsys.readouterr().err))
        return True

    kill_once(words, asked)
    assert [code for code, _ in answers] == [2, 2]
    assert all("another process is writing it right now" in error for _, error in answers)


def test_a_killed_demo_needs_no_force(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from vico.cli import demo

    class Killed(Exception):
        """In place of a signal: leaves the process at once."""

    def killed(*_: Any, **__: Any) -> int:
        raise Killed

    monkeypatch.setattr("vico.cli.run.run", killed)
    monkeypatch.setattr(demo, "world_build", lambda *_, **__: 0)
    monkeypatch.setattr(demo, "community_build", lambda *_, **__: 0)
    monkeypatch.setattr(demo, "_evening", lambda *_: "")
    for _ in range(2):  # the second time finds what the first one left
        with pytest.raises(Killed):
            demo.demo(tmp_path / "demo")
    monkeypatch.setattr("vico.cli.run.run", lambda *_, **__: 0)
    monkeypatch.setattr(demo, "replay", lambda *_, **__: 0)
    assert demo.demo(tmp_path / "demo") == 0
    assert not (tmp_path / "demo" / ".unfinished").exists()
    printed = capsys.readouterr().out
    assert json.dumps(str(tmp_path))[1:-1] in printed
    # The last line is a command that can be typed as it stands.
    told, _, command = printed.splitlines()[-1].partition(":  ")
    *program, verb, world, people = shlex.split(command)
    assert (told, verb) == ("to walk through it", "play")
    assert (world, people) == (str(tmp_path / "demo" / "world"), str(tmp_path / "demo" / "community"))
    assert Path(program[0]).is_file()
