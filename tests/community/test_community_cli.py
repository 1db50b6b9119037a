"""`vico community build` and `vico check community` on a real world, as a newcomer types them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from vico.cli.main import main
from vico.community import read_community


def run(*arguments: object) -> int:
    with pytest.raises(SystemExit) as exit_:
        main([str(a) for a in arguments])
    code = exit_.value.code
    return code if isinstance(code, int) else 0


@pytest.fixture(scope="module")
def people(helsinki_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("cli") / "people"
    assert run("community", "build", helsinki_path, "--residents", 6, "--out", out) == 0
    return out


def test_build_tells_who_lives_there(helsinki_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run("community", "build", helsinki_path, "--residents", 4, "--out", tmp_path / "p", "--json") == 0
    assert len(json.loads(capsys.readouterr().out)["people"]) == 4


def test_check_finds_the_world_by_itself(people: Path) -> None:
    assert run("check", "community", people) == 0


def test_check_exits_1_when_something_is_wrong(
    people: Path, helsinki_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = tmp_path / "other"
    other.mkdir()
    for file in helsinki_path.iterdir():
        (other / file.name).symlink_to(file)
    (other / "world.json").unlink()
    content = json.loads((helsinki_path / "world.json").read_text())
    (other / "world.json").write_text(json.dumps({**content, "name": "elsewhere"}))
    assert run("check", "community", people, "--world", other, "--json") == 1
    assert not json.loads(capsys.readouterr().out)["ok"]


def test_an_existing_folder_exits_2_with_one_sentence(
    people: Path, helsinki_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("community", "build", helsinki_path, "--out", people) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_missing_world_exits_2(tmp_path: Path) -> None:
    assert run("community", "build", tmp_path / "none", "--out", tmp_path / "p") == 2


def test_days_are_built_and_one_is_taken(
    helsinki_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = ("--residents", 5, "--day", "friday", "--days", 3, "--out", tmp_path / "people")
    assert run("community", "build", helsinki_path, *asked) == 0
    assert len(read_community(tmp_path / "people").dates) == 3
    assert run("community", "day", tmp_path / "people", "--day", "sunday", "--out", tmp_path / "sunday") == 0
    assert run("check", "community", tmp_path / "sunday", "--world", helsinki_path) == 0
    assert read_community(tmp_path / "sunday").weekday == "Sunday"
    capsys.readouterr()
    assert run("community", "day", tmp_path / "people", "--day", "monday", "--out", tmp_path / "no") != 0
    assert "no monday among 2025-06-06 (Friday)" in capsys.readouterr().err
