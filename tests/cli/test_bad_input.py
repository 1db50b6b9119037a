"""Bad input: exit code 2, one clear sentence, and nothing half-written."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from command_line import vico
from vico.cli.run import _MEANINGS
from vico.community import read_community, read_names
from vico.worldgen.request import packaged_extract

EMPTY_MAP = """<?xml version="1.0"?>
<osm version="0.6"><bounds minlat="60.16" minlon="24.94" maxlat="60.17" maxlon="24.95"/>
<node id="1" lat="60.165" lon="24.945" version="1"/><node id="2" lat="60.1651" lon="24.945" version="1"/>
<way id="3" version="1"><nd ref="1"/><nd ref="2"/><tag k="highway" v="footway"/></way></osm>
"""
HERE = ("--lat", 60.1690, "--lon", 24.9435)


def contents(folder: Path) -> list[str]:
    """What lies below a folder, hidden things too."""
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    """Run what must be refused; return the sentence."""
    assert vico(*arguments) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("vico: ")
    assert printed.err.count("\n") == 1, printed.err
    return printed.err


@pytest.fixture
def maps(tmp_path: Path) -> Path:
    """A folder with broken maps."""
    folder = tmp_path / "maps"
    folder.mkdir()
    whole = packaged_extract().path.read_bytes()
    (folder / "cut.osm.pbf").write_bytes(whole[: len(whole) // 3])
    (folder / "words.osm").write_text("hello\n")
    (folder / "words.osm.pbf").write_text("hello\n")
    (folder / "nothing.osm.pbf").write_bytes(b"")
    (folder / "map.txt").write_text("hello\n")
    (folder / "footpath.osm").write_text(EMPTY_MAP)
    return folder


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("missing.osm.pbf", "no such file"),
        ("cut.osm.pbf", "truncated or broken"),
        ("words.osm", "truncated or broken"),
        ("words.osm.pbf", "truncated or broken"),
        ("nothing.osm.pbf", "empty"),
        ("map.txt", "must end in .osm"),
        ("footpath.osm", "no building"),
    ],
)
def test_a_map_that_is_no_use_is_refused(
    maps: Path, name: str, says: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    before = contents(tmp_path)
    sentence = refused(capsys, "world", "build", "--osm", maps / name, "--out", tmp_path / "w")
    assert says in sentence
    assert name in sentence
    assert contents(tmp_path) == before


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--center", "10.0,10.0"), "nothing in the"),
        (("--center", "100.0,10.0"), "out of range"),
        (("--center", "60.0,200.0"), "out of range"),
        (("--center", "nan,24.0"), "no numbers"),
        (("--center", "Helsinki"), "write for example"),
        (("--center", "60.1"), "write for example"),
        (("--center", "60.1,24.9", "--lat", 60.1, "--lon", 24.9), "not both"),
        (("--lat", 60.1), "go together"),
        ((*HERE, "--radius", -5), "radius: -5"),
        ((*HERE, "--radius", "nan"), "radius: nan"),
        ((*HERE, "--radius", 90_000), "radius: 90000"),
        ((*HERE, "--seed", -1), "seed: -1"),
        ((*HERE, "--dem", "missing.tif"), "no such elevation file"),
        ((*HERE, "--dem", "a.tif@EPSG:3067"), "only point clouds"),
        ((*HERE, "--buildings", "missing.gml"), "missing.gml: no such file"),
        ((*HERE, "--buildings", "a.json", "--buildings", "b/a.json"), "a.json is given twice"),
        ((*HERE, "--buildings", "a.shp"), "must end in .json"),
        ((*HERE, "--precedence", "missing.toml"), "missing.toml: no such file"),
    ],
)
def test_a_window_that_cannot_be_is_refused(
    options: tuple[object, ...], says: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    extract = packaged_extract().path
    assert says in refused(capsys, "world", "build", "--osm", extract, *options, "--out", tmp_path / "w")
    assert contents(tmp_path) == []


@pytest.mark.parametrize(
    ("options", "says"),
    [((), "say where"), (("--center", "60.0,200.0"), "not on Earth"), (("--center", "48.85,2.35"), "pass --osm FILE")],
)
def test_a_place_without_a_map_is_refused(
    options: tuple[object, ...], says: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert says in refused(capsys, "world", "build", *options, "--out", tmp_path / "w")
    assert contents(tmp_path) == []


@pytest.fixture
def other_version(helsinki_path: Path, tmp_path: Path) -> Path:
    """The world as another vico might have written it."""
    return changed(helsinki_path, tmp_path / "other_version", version=99)


def changed(world: Path, folder: Path, **fields: Any) -> Path:
    """A copy of a world folder with other entries in its manifest."""
    folder.mkdir()
    for path in world.iterdir():
        if path.name != "world.json":
            (folder / path.name).symlink_to(path)
    content = json.loads((world / "world.json").read_text())
    (folder / "world.json").write_text(json.dumps({**content, **fields}))
    return folder


@pytest.mark.parametrize(
    "verb",
    [
        ("world", "info", "WORLD"),
        ("check", "world", "WORLD"),
        ("community", "build", "WORLD", "--out", "OUT"),
        ("run", "WORLD", "PEOPLE", "--out", "OUT"),
        ("eval", "assistant", "--worlds", "WORLD", "--out", "OUT"),
    ],
    ids=lambda verb: " ".join(verb[:2]),
)
def test_a_world_of_another_version_is_refused(
    verb: tuple[str, ...],
    other_version: Path,
    helsinki_people: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    words = {"WORLD": other_version, "PEOPLE": helsinki_people, "OUT": tmp_path / "out"}
    assert "version 99" in refused(capsys, *(words.get(word, word) for word in verb))
    assert not (tmp_path / "out").exists()


def test_people_of_another_world_are_refused(
    helsinki_path: Path, helsinki_people: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    elsewhere = changed(helsinki_path, tmp_path / "elsewhere", name="elsewhere")
    sentence = refused(capsys, "run", elsewhere, helsinki_people, "--out", tmp_path / "run")
    assert "made for world 'helsinki'" in sentence
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--robots", "husky,frob", "--cars", 2), "robot 'frob' is not known; choose among"),
        (("--observe", "resident_0,Bob", "--cars", 2), "run: --observe: nobody is called 'Bob'; there are "),
        (("--start", "25:00"), "no time of day"),
        (("--start", "8am"), "no time of day"),
        (("--steps", 0), "--steps 0"),
        (("--cars", -1), "cars is -1"),
        (("--pedestrians", -1), "pedestrians is -1"),
        (("--seed", -1), "seed is -1"),
        (("--pedestrians", 100_000), "100,000 pedestrians are more than a run can have; ask for 5,000 at most"),
        (("--cars", 100_000), "100,000 cars are more than a run can have; ask for 2,000 at most"),
        (("--robots", "husky," * 999 + "husky"), "1,000 robots are more than a run can have; ask for 100 at most"),
    ],
)
def test_a_run_that_cannot_be_is_refused(
    options: tuple[object, ...],
    says: str,
    helsinki_path: Path,
    helsinki_people: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert says in refused(capsys, "run", helsinki_path, helsinki_people, *options, "--out", tmp_path / "run")
    assert contents(tmp_path) == []


def test_a_misspelt_person_is_told_before_the_world_is_read(
    helsinki_people: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = read_names(helsinki_people)
    agent, name = next(iter(names.items()))
    head = tmp_path / "head.glb"
    head.write_bytes(b"")
    wrong, nowhere, out = f"{name[:-1]}x", tmp_path / "no_world_here", ("--out", tmp_path / "run")
    meant = f"nobody is called {wrong!r}; did you mean {name} ({agent})?"
    assert f"play: --as: {meant}" in refused(capsys, "play", nowhere, helsinki_people, "--as", wrong, *out)
    for verb in ("run", "live"):
        told = refused(capsys, verb, nowhere, helsinki_people, "--observe", f"resident_0,{wrong}", *out)
        assert f"run: --observe: {meant}" in told
    told = refused(capsys, "run", nowhere, helsinki_people, "--wear", f"{wrong}={head}", *out)
    assert f"run: --wear: {meant}" in told


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--method", "frob"), "no method called 'frob'; there are "),
        (("--assistants", 3), "3 assistants"),
        (("--seeds", 0), "at least one"),
        (("--steps", 0), "at least one"),
    ],
)
def test_an_evaluation_that_cannot_be_is_refused(
    options: tuple[object, ...], says: str, helsinki_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sentence = refused(capsys, "eval", "assistant", "--worlds", helsinki_path, *options, "--out", tmp_path / "e")
    assert says in sentence
    assert contents(tmp_path) == []


@pytest.mark.parametrize("options", [("--residents", 0), ("--residents", -3), ("--seed", -1)])
def test_a_community_that_cannot_be_is_refused(
    options: tuple[object, ...], helsinki_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    refused(capsys, "community", "build", helsinki_path, *options, "--out", tmp_path / "c")
    assert contents(tmp_path) == []


@pytest.mark.parametrize(
    "verb",
    [
        ("world", "build", *HERE, "--radius", 60, "--out", "OUT"),
        ("community", "build", "WORLD", "--out", "OUT"),
        ("run", "WORLD", "PEOPLE", "--out", "OUT"),
        ("eval", "assistant", "--worlds", "WORLD", "--out", "OUT"),
        ("demo", "--out", "OUT"),
    ],
    ids=lambda verb: str(verb[0]),
)
@pytest.mark.parametrize("kind", ["folder", "file", "below a file"])
def test_what_exists_is_not_overwritten(
    verb: tuple[object, ...],
    kind: str,
    helsinki_path: Path,
    helsinki_people: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    mine = tmp_path / "mine" if kind != "folder" else tmp_path / "mine" / "letter.txt"
    mine.parent.mkdir(exist_ok=True)
    mine.write_text("dear")
    out = tmp_path / "mine" / "below" if kind == "below a file" else tmp_path / "mine"
    before = contents(tmp_path)
    words: dict[object, object] = {"WORLD": helsinki_path, "PEOPLE": helsinki_people, "OUT": out}
    sentence = refused(capsys, *(words.get(word, word) for word in verb))
    assert ("not a directory" if kind == "below a file" else "exists") in sentence
    assert contents(tmp_path) == before
    assert mine.read_text() == "dear"


@pytest.mark.parametrize("read", ["world", "people"])
def test_force_never_deletes_what_the_run_reads(
    read: str, helsinki_path: Path, helsinki_people: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    parts = {"world": tmp_path / "project" / "world", "people": tmp_path / "project" / "people"}
    shutil.copytree(helsinki_path, parts["world"], symlinks=True)
    shutil.copytree(helsinki_people, parts["people"])
    before = contents(tmp_path)
    for out in (parts[read], tmp_path / "project"):
        sentence = refused(capsys, "run", parts["world"], parts["people"], "--force", "--out", out)
        assert "--force would delete" in sentence
    assert contents(tmp_path) == before


@pytest.mark.parametrize(
    "verb",
    [
        ("world", "info", "NOWHERE"),
        ("check", "world", "NOWHERE"),
        ("community", "build", "NOWHERE", "--out", "OUT"),
        ("check", "community", "NOWHERE"),
        ("run", "NOWHERE", "NOWHERE", "--out", "OUT"),
        ("replay", "NOWHERE"),
        ("eval", "assistant", "--worlds", "NOWHERE", "--out", "OUT"),
    ],
    ids=lambda verb: " ".join(verb[:2]),
)
def test_a_folder_that_is_not_there_is_named(
    verb: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = {"NOWHERE": tmp_path / "nowhere", "OUT": tmp_path / "out"}
    assert str(tmp_path / "nowhere") in refused(capsys, *(words.get(word, word) for word in verb))
    assert contents(tmp_path) == []


@pytest.mark.parametrize(
    "arguments",
    [
        ("world", "build"),
        ("world",),
        (),
        ("run", "w"),
        ("run", "w", "c", "--out", "o", "--steps", "many"),
        ("eval", "assistant", "--worlds", "w", "--out", "o", "--category", "frob"),
        ("bench", "frob"),
    ],
    ids=lambda arguments: " ".join(arguments) or "nothing",
)
def test_a_command_that_is_not_understood_exits_2(
    arguments: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    assert vico(*arguments) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert "Traceback" not in printed.err
    assert "--help" in printed.err


def test_a_fresh_process_prints_no_traceback_either(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "vico.cli.main", "world", "build", "--osm", "missing.osm", "--out", "w"],
        cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "vico: missing.osm: no such file; give an OpenStreetMap extract (.osm or .osm.pbf)\n"
    assert contents(tmp_path) == []


def test_a_language_model_that_is_not_named_is_said_before_anything_is_built(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("VICO_LLM_BASE_URL", "OPENAI_BASE_URL", "VICO_LLM_MODEL"):
        monkeypatch.delenv(name, raising=False)
    said = refused(capsys, "world", "build", *HERE, "--radius", 60, "--layout-llm", "--out", tmp_path / "w")
    assert "set VICO_LLM_BASE_URL" in said
    assert contents(tmp_path) == []


def test_a_run_on_another_day_than_its_communitys_says_so(
    helsinki_path: Path, helsinki_people: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    day = read_community(helsinki_people).date
    words = ["run", helsinki_path, helsinki_people, "--steps", 1, "--observe", "none", "--robots", "none"]
    words += ["--cars", 0, "--pedestrians", 0]
    assert vico(*words, "--out", tmp_path / "own") == 0
    assert "schedules are of" not in capsys.readouterr().err
    assert vico(*words, "--date", "2026-12-24", "--out", tmp_path / "other") == 0
    assert f"its schedules are of {day:%A} {day}; the run is on 2026-12-24" in capsys.readouterr().err


def test_a_world_built_without_heights_says_that_it_is_flat(
    begun: Callable[..., None], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    begun(tmp_path / "w")
    assert vico("world", "build", "--radius", 60, "--lat", 60.169, "--lon", 24.9435, "--out", tmp_path / "w") == 0
    assert "the ground is flat: no source tells its heights" in capsys.readouterr().err


def test_a_timetable_that_gives_nothing_is_told_with_its_reason(
    begun: Callable[..., None], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    begun(tmp_path / "w")
    tables = {
        "stops.txt": "stop_id,stop_lat,stop_lon\na,60.169,24.9435\n",
        "routes.txt": "route_id,route_type\nr,1\n",
        "trips.txt": "route_id,service_id,trip_id\nr,s,t\n",
        "stop_times.txt": "trip_id,arrival_time,stop_id,stop_sequence\nt,8:00,a,1\n",
        "calendar_dates.txt": "service_id,date,exception_type\ns,20260105,1\n",
    }
    with zipfile.ZipFile(tmp_path / "metro.zip", "w") as archive:
        for name, text in tables.items():
            archive.writestr(name, text)
    words = ["--radius", 60, "--lat", 60.169, "--lon", 24.9435, "--gtfs", tmp_path / "metro.zip"]
    assert vico("world", "build", *words, "--out", tmp_path / "w") == 0
    said = capsys.readouterr().err
    assert "metro.zip gives no bus or tram here: routes.txt has no bus" in said
    assert "only 1 of route_type 1 (underground)" in said


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["rnu", "W", "P"], "no verb 'rnu'; did you mean vico run?"),
        (["world", "buidl"], "no verb 'world buidl'; did you mean vico world build?"),
        (["xyzzy"], "no verb 'xyzzy'; there are "),
        (["run", "PEOPLE", "WORLD"], "is a world, and a community is wanted here; are two folders exchanged?"),
        (["check", "community", "WORLD"], "is a world, and a community is wanted here"),
        (["world", "info", "FOLDER"], "is no finished world; make one with vico world build"),
        (["view", "WORLD"], "is a world, and a run is wanted here"),
        (["run", "WORLD", "PEOPLE", "--speed", 3], "--speed is for the page of a run that is shown; add --live"),
        (["run", "WORLD", "PEOPLE", "--allow-host", "hub"], "--allow-host is for the page"),
        (["run", "WORLD", "PEOPLE", "--out", "/proc/x"], "/proc cannot be written to; choose another folder"),
        (["world", "build", "--lat", 24.9435, "--lon", 60.169, "--osm", "MAP"], "latitude and longitude are exchanged"),
        (["world", "build", "--lat", 48.1, "--lon", 11.5, "--osm", "MAP"], "the extract covers 60.1"),
    ],
)
def test_advice_names_what_is_wrong(
    words: list[object],
    told: str,
    helsinki_path: Path,
    helsinki_people: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (tmp_path / "folder").mkdir()
    known: dict[object, object] = {"WORLD": helsinki_path, "PEOPLE": helsinki_people, "FOLDER": tmp_path / "folder"}
    known["MAP"] = packaged_extract().path
    given = [known.get(word, word) for word in words]
    if words[0] in ("run", "world") and "--out" not in words and "info" not in words:
        given += ["--out", tmp_path / "out"]
    assert told in refused(capsys, *given)


def test_a_number_that_is_none_is_said_to_be_none(capsys: pytest.CaptureFixture[str]) -> None:
    assert vico("run", "W", "P", "--steps", "many") == 2
    assert "'many' is no whole number; give one such as 300" in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize(
    "verb", [["run"], ["live"], ["film"], ["world", "build"], ["community", "build"], ["eval", "commute"]]
)
def test_no_help_speaks_of_none(verb: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert vico(*verb, "--help") == 0
    assert "None" not in capsys.readouterr().out


def test_each_number_of_a_run_has_a_word_beside_it() -> None:
    assert {"collisions", "refused", "late", "rescued", "stuck", "reentered"} <= _MEANINGS.keys()
    assert all(len(words) > 8 for words in _MEANINGS.values())
