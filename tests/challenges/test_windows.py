"""The lists of windows that tables are made of."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from command_line import script
from vico.challenges.windows import PACKAGED_MAP, overlap, overlaps, window_list, window_lists
from vico.errors import InputError, SchemaError
from vico.worldgen.request import covers, packaged_extract

SCRIPT = Path(__file__).parents[2] / "benchmarks" / "worlds.py"


def test_the_standard_list_is_24_windows_of_ten_cities() -> None:
    windows = window_list("standard").windows
    assert len(windows) == 24
    assert len({window.osm for window in windows}) == 10
    assert all(window.radius >= 200 for window in windows)
    assert overlaps(window_list("standard")) == []
    tuned_on = {window.name for window in window_list("tuning").windows}
    assert not tuned_on & {window.name for name in ("standard", "advanced") for window in window_list(name).windows}


def test_the_other_lists_are_what_the_tables_need() -> None:
    counts = {name: len(found.windows) for name, found in window_lists().items()}
    robots = {"robot": 21, "robot_tuning": 9}
    assert counts == robots | {
        "standard": 24, "advanced": 3, "influence": 5, "commute": 10, "reduced": 4, "tuning": 6
    }  # fmt: skip
    reported, tuned_on = ({window.name for window in window_list(name).windows} for name in robots)
    assert not reported & tuned_on
    assert all(window.radius == 400 for window in window_list("commute").windows)


def test_the_reduced_list_needs_the_packaged_map_alone() -> None:
    windows = window_list("reduced")
    assert overlaps(windows) == []
    for window in windows.windows:
        assert window.osm == PACKAGED_MAP
        assert covers(packaged_extract(), window.lat, window.lon, window.radius)


def test_an_overlap_is_a_share_of_the_smaller_window() -> None:
    here = window_list("reduced").windows[0]
    assert overlap(here, here) == pytest.approx(1.0)
    half = here.model_copy(update={"lat": here.lat + here.radius / 111_320})
    assert overlap(here, half) == pytest.approx(0.5, abs=1e-6)
    small = here.model_copy(update={"radius": 100.0})
    assert overlap(here, small) == pytest.approx(1.0)


def test_a_list_of_ones_own_is_read_strictly(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "challenges"
    folder.mkdir()
    one = '[[windows]]\nname = "mine"\nosm = "mine.osm.pbf"\nlat = 1.0\nlon = 2.0\nradius = 250.0\n'
    cases = [
        (one, None), (one * 2, "mine twice"), (one + "moon = 1\n", "moon"), (one.replace("1.0", "91.0"), "lat"),
        (one.replace('"mine"', '"../mine"'), "name"), (one.replace('"mine"', '"helsinki_b"'), "another window"),
        ("", "windows"),
    ]  # fmt: skip
    for number, (text, says) in enumerate(cases):
        (folder / "worlds_mine.toml").write_text('about = "Mine"\n' + text)
        monkeypatch.setenv("VICO_DATA", str(tmp_path) + "/" * number)
        if says is None:
            assert window_list("mine").windows[0].seed == 1
            continue
        with pytest.raises(SchemaError, match=says):
            window_list("mine")
    monkeypatch.delenv("VICO_DATA")
    with pytest.raises(
        InputError, match="there are advanced, commute, influence, reduced, robot, robot_tuning, standard, tuning"
    ):
        window_list("mine")


def test_the_script_shows_a_list_and_says_what_it_lacks(tmp_path: Path) -> None:
    def run(*words: str) -> subprocess.CompletedProcess[str]:
        return script(SCRIPT, *words)

    shown = run("--show")
    assert "monaco_b" in shown.stdout
    assert "share" not in shown.stdout  # no two of them have ground in common
    lacking = run("--out", str(tmp_path / "w"), "--only", "monaco_b")
    assert lacking.returncode == 1
    assert "needs the extract monaco/monaco.osm.pbf; say with --places" in lacking.stderr
    assert "no window called nowhere" in run("--out", str(tmp_path / "w"), "--only", "nowhere").stderr


def test_the_script_of_the_tables_says_what_it_lacks(tmp_path: Path) -> None:
    def said(*words: str) -> str:
        done = script(SCRIPT.with_name("tables.py"), *words, "--out", tmp_path / "out")
        assert done.returncode == 2
        return done.stderr

    assert "the folder with the worlds of the list standard" in said("--table", "assistant")
    assert "there are 1 assistant, advanced, 2 assistants, advanced" in said(
        "--table", "advanced", "--worlds", str(tmp_path), "--block", "3 assistants"
    )
    assert "--world: nowhere; the list advanced has" in said(
        "--table", "advanced", "--worlds", str(tmp_path), "--world", "nowhere"
    )
    assert "no method called 'best'" in said("--table", "assistant", "--worlds", str(tmp_path), "--method", "best")
